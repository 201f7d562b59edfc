//! From electrons to volts and digital numbers.

use ndarray::Array2;
use rand::RngExt;
use rand_distr::{Distribution, Exp1, StandardNormal};
use rayon::prelude::*;

use crate::{
    Binning, BinningKind, Electrons, Exposure, Noise, NoiseSource, Raw, RawPlane, Sensor, SensorError, TelegraphNoise,
    Volts, noise::Kind, raw::Levels,
};

impl Sensor {
    /// Returns the voltages at the pixels' outputs: not amplified and not clipped, so that noise keeps its shape.
    ///
    /// Pixels whose charges or voltages are read as one ([`Exposure::binning`]) have one output.
    ///
    /// # Errors
    /// When the exposure makes no sense, or its binning does not go with the sensor ([`as_read`](Self::as_read)).
    pub fn volts(&self, electrons: &Electrons, exposure: &Exposure, noise: &Noise) -> Result<Volts, SensorError> {
        exposure.check()?;
        let planes = &electrons.planes_e;
        let Some(binning) = exposure.binning else { return Ok(self.volts_of(planes, exposure, noise)) };
        let (sheet, lines) = (self.as_read(exposure)?, self.read_lines(exposure)?);
        let sums = |planes: &[Array2<f32>], factor: f64| -> Result<Vec<Array2<f32>>, SensorError> {
            planes.iter().map(|plane| binning.sums(lines, plane, factor)).collect()
        };
        match binning.kind {
            BinningKind::Charge => {
                let well_e = sheet.full_well_e(exposure.gain_mode) as f32;
                let held: Vec<Array2<f32>> =
                    sums(planes, 1.0)?.iter().map(|plane| plane.mapv(|e| e.min(well_e))).collect();
                Ok(sheet.volts_of(&held, exposure, noise))
            }
            BinningKind::Voltage => {
                let followers =
                    Self { column_offset_v: 0.0, column_gain_fraction: 0.0, row_noise_v: 0.0, ..self.clone() };
                let means_v = sums(&followers.volts_of(planes, exposure, noise).planes_v, 1.0 / binning.n() as f64)?;
                // Columns and rows take volts for electrons.
                let columns = Self {
                    conversion_gain_v_per_e: 1.0,
                    high_gain: None,
                    read_noise_v: 0.0,
                    reset_noise_v: 0.0,
                    dsnu_v: 0.0,
                    telegraph: TelegraphNoise::default(),
                    ..sheet.into_owned()
                };
                Ok(columns.volts_of(&means_v, exposure, noise))
            }
            BinningKind::Digital => Ok(self.volts_of(planes, exposure, noise)),
        }
    }

    /// Reads electrons, each pixel by itself.
    fn volts_of(&self, planes_e: &[Array2<f32>], exposure: &Exposure, noise: &Noise) -> Volts {
        let plane = |(number, electrons): (usize, &Array2<f32>)| {
            let mut volts = electrons.as_standard_layout().into_owned();
            let n_columns = volts.ncols();
            let readout = Readout::new(self, exposure, noise, number, n_columns);
            let rows = volts.as_slice_mut().expect("a standard layout is contiguous").par_chunks_mut(n_columns);
            rows.enumerate().for_each(|(row, values)| readout.read_row(row, values));
            volts
        };
        Volts { planes_v: planes_e.iter().enumerate().map(plane).collect() }
    }

    /// Returns the frame as the converter gives it: offset, analog gain, clipping, response curve, rounding.
    ///
    /// Voltages are clipped to the swing above, and below to 0 or as far under it as the black level reaches, so that a
    /// black level lets dark noise through on both sides.
    ///
    /// # Errors
    /// When the sensor or the exposure makes no sense.
    pub fn digitize(&self, volts: &Volts, exposure: &Exposure) -> Result<Raw, SensorError> {
        self.digitize_by_row(volts, &[*exposure], &|_| 0)
    }

    /// Returns a frame of which each row is amplified as one of several exposures asks; its levels are those of the first.
    pub(crate) fn digitize_by_row(
        &self,
        volts: &Volts,
        exposures: &[Exposure],
        exposure_of: &(dyn Fn(usize) -> usize + Sync),
    ) -> Result<Raw, SensorError> {
        self.check()?;
        exposures.iter().try_for_each(Exposure::check)?;
        let exposure = &exposures[0];
        let (sheet, lines) = (self.as_read(exposure)?, self.read_lines(exposure)?);
        let gains: Vec<f64> = exposures.iter().map(|exposure| exposure.analog_gain).collect();
        let gain_of = |row: usize| gains[exposure_of(row)];
        let plane = |plane: &Array2<f32>| {
            let numbers = self.convert(plane, &gain_of);
            match exposure.binning {
                Some(binning @ Binning { kind: BinningKind::Digital, .. }) => binning.sums_of_numbers(lines, numbers),
                _ => Ok(numbers),
            }
        };
        let planes = volts.planes_v.iter().map(plane).collect::<Result<_, _>>()?;
        Ok(sheet.frame(planes, exposure)?.clamped(&sheet))
    }

    /// Returns the frame of planes as they are read.
    fn frame(&self, planes: Vec<RawPlane>, exposure: &Exposure) -> Result<Raw, SensorError> {
        Ok(Raw {
            planes,
            tile: self.tile()?,
            filter_names: self.filters.iter().map(|f| f.name.clone()).collect(),
            levels: Levels::new(self, exposure),
            exposure: *exposure,
            row_time_us: self.row_time_us,
            merged: Vec::new(),
            masked: None,
        })
    }

    /// Returns digital numbers that a program made as a frame of this sensor's pixels and converter, of any size.
    ///
    /// # Errors
    /// When the sensor or the exposure makes no sense, the sensor has no converter or stacked filters, a number is beyond the highest of the
    /// converter, or there is none.
    pub fn frame_of(&self, dn: Array2<u16>, exposure: &Exposure) -> Result<Raw, SensorError> {
        self.check()?;
        exposure.check()?;
        let sheet = self.as_read(exposure)?;
        let refused = |reason: String| Err(SensorError::Unsuitable { what: "the raw frame", reason });
        let Some(top) = sheet.adc.top_dn() else {
            return refused(format!(
                "is of digital numbers, expected a sensor with a converter, which {} has not",
                self.name
            ));
        };
        if self.tile()?.is_none() && self.filters.len() > 1 {
            return refused(format!(
                "has one plane, expected a sensor with a mosaic: {} has stacked filters",
                self.name
            ));
        }
        match dn.iter().max() {
            None => return refused("has no pixel".to_owned()),
            Some(&most) if most > top => {
                return refused(format!("holds {most}, expected digital numbers of {} up to {top}", self.name));
            }
            Some(_) => {}
        }
        sheet.frame(vec![RawPlane::Dn(dn)], exposure)
    }

    fn convert(&self, volts: &Array2<f32>, gain_of: &(dyn Fn(usize) -> f64 + Sync)) -> RawPlane {
        let black_v = match self.adc {
            crate::Adc::Bits { black_level_dn, .. } => {
                self.adc.step_v(self.swing_v).map_or(0.0, |step_v| step_v * f64::from(black_level_dn))
            }
            crate::Adc::Analog => 0.0,
        };
        let out_v = |row: usize, v: f32| {
            let amplified = (f64::from(v) + self.offset_v) * gain_of(row);
            let clipped = amplified.clamp(-black_v, self.swing_v);
            // Below 0 the curve is continued by symmetry.
            self.response.apply(clipped.abs(), self.swing_v).copysign(clipped)
        };
        match (self.adc.step_v(self.swing_v), self.adc.top_dn()) {
            (Some(step_v), Some(top)) => {
                let code = |(row, _): (usize, usize), &v: &f32| {
                    ((out_v(row, v) + black_v) / step_v + 0.5).floor().clamp(0.0, f64::from(top)) as u16
                };
                RawPlane::Dn(ndarray::Zip::indexed(volts).par_map_collect(code))
            }
            _ => RawPlane::Volts(ndarray::Zip::indexed(volts).par_map_collect(|(row, _), &v| out_v(row, v) as f32)),
        }
    }
}

/// The readout of one plane of one frame.
struct Readout<'a> {
    noise: &'a Noise,
    plane: usize,
    /// For each column its volts an electron and its offset, V.
    columns: Vec<(f32, f32)>,
    read_noise_v: f64,
    reset_noise_v: f64,
    row_noise_v: f64,
    dsnu_v: f64,
    /// Volts an electron, and whether each pixel is read twice.
    telegraph: Option<(TelegraphNoise, f64, bool)>,
}

impl<'a> Readout<'a> {
    fn new(sensor: &Sensor, exposure: &Exposure, noise: &'a Noise, plane: usize, n_columns: usize) -> Self {
        let gain_v_per_e = sensor.conversion_gain_v_per_e(exposure.gain_mode);
        let on = |source: NoiseSource, rms: f64| if noise.has(source) { rms } else { 0.0 };
        let mut gain_rng = noise.rng(Kind::ColumnGain, plane, 0);
        let mut offset_rng = noise.rng(Kind::ColumnOffset, plane, 0);
        let column = |_| {
            let (g, o): (f64, f64) = (StandardNormal.sample(&mut gain_rng), StandardNormal.sample(&mut offset_rng));
            let gain = gain_v_per_e * (1.0 + on(NoiseSource::Column, sensor.column_gain_fraction) * g);
            (gain as f32, (on(NoiseSource::Column, sensor.column_offset_v) * o) as f32)
        };
        Self {
            noise,
            plane,
            columns: (0..n_columns).map(column).collect(),
            read_noise_v: on(NoiseSource::Read, sensor.read_noise_v(exposure.gain_mode)),
            reset_noise_v: if sensor.correlated_double_sampling {
                0.0
            } else {
                on(NoiseSource::Reset, sensor.reset_noise_v)
            },
            row_noise_v: on(NoiseSource::Row, sensor.row_noise_v),
            dsnu_v: on(NoiseSource::Dsnu, sensor.dsnu_v),
            telegraph: (noise.has(NoiseSource::Telegraph) && sensor.telegraph.rms_e(true) > 0.0).then_some((
                sensor.telegraph,
                gain_v_per_e,
                sensor.correlated_double_sampling,
            )),
        }
    }

    /// Turns a row of electrons into a row of volts.
    fn read_row(&self, row: usize, values: &mut [f32]) {
        for (value, (gain_v_per_e, offset_v)) in values.iter_mut().zip(&self.columns) {
            *value = *value * gain_v_per_e + offset_v;
        }
        self.add_gaussian(Kind::Read, self.read_noise_v, row, values);
        self.add_gaussian(Kind::Reset, self.reset_noise_v, row, values);
        self.add_gaussian(Kind::Dsnu, self.dsnu_v, row, values);
        self.add_telegraph(row, values);
        if self.row_noise_v > 0.0 {
            let g: f64 = StandardNormal.sample(&mut self.noise.rng(Kind::Row, self.plane, row));
            values.iter_mut().for_each(|v| *v += (self.row_noise_v * g) as f32);
        }
    }

    /// Adds what traps take from or give to some pixels.
    fn add_telegraph(&self, row: usize, values: &mut [f32]) {
        let Some((TelegraphNoise { fraction, mean_amplitude_e }, gain_v_per_e, is_read_twice)) = self.telegraph else {
            return;
        };
        let mut sites = self.noise.rng(Kind::TelegraphSites, self.plane, row);
        let mut states = self.noise.rng(Kind::Telegraph, self.plane, row);
        for value in values {
            let (lot, size): (f64, f64) = (sites.random(), Exp1.sample(&mut sites));
            let (first, second): (bool, bool) = (states.random(), states.random());
            if lot < fraction {
                let change = if is_read_twice {
                    f64::from(u8::from(first)) - f64::from(u8::from(second))
                } else {
                    0.5 - f64::from(u8::from(first))
                };
                *value += (change * size * mean_amplitude_e * gain_v_per_e) as f32;
            }
        }
    }

    fn add_gaussian(&self, kind: Kind, rms_v: f64, row: usize, values: &mut [f32]) {
        if rms_v > 0.0 {
            let mut rng = self.noise.rng(kind, self.plane, row);
            for value in values {
                let g: f64 = StandardNormal.sample(&mut rng);
                *value += (rms_v * g) as f32;
            }
        }
    }
}
