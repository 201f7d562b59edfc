//! The laboratory bench of EMVA standard 1288, simulated: which flat and dark frames are taken, and the frames.

use std::borrow::Cow;

use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

use crate::{Adc, BinningKind, Cfa, ElectronRate, Exposure, Illumination, Noise, Raw, Sensor, SensorError};

/// The bits of the converter that the bench gives to a sensor without one.
const BENCH_BITS: u32 = 16;
/// How far the black level lies above 0 at least, rms noise of the dark: 3e-5 of the samples are cut off, where the standard allows
/// half a percent, and the rest has the noise of all to 1e-3.
const LEAST_BLACK: f64 = 4.0;
/// How far beyond saturation the brightest level lies.
const BEYOND_SATURATION: f64 = 1.1;
/// Exposure times at which dark current is measured.
const DARK_TIMES: u32 = 6;
/// The width of the light's band, nm.
const BAND_NM: f64 = 1.0;
/// Planck's constant × the speed of light, J m.
const HC_J_M: f64 = 6.626_070_15e-34 * 299_792_458.0;

/// What is set on the bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchSettings {
    /// Rows and columns of the frames.
    pub side: usize,
    /// Levels of light, evenly from darkness to a little beyond saturation.
    pub n_levels: usize,
    /// Frames of each stack from which the non-uniformities follow.
    pub n_stacked: usize,
    /// The wavelength of the light, nm.
    pub wavelength_nm: f64,
    /// The exposure of all frames but those that show the dark current.
    pub exposure: Exposure,
    /// The seed of all noise.
    pub seed: u64,
}

impl Default for BenchSettings {
    /// 512 × 512 pixels, 40 levels, stacks of 64, 550 nm, 10 ms, seed 1.
    fn default() -> Self {
        Self {
            side: 512,
            n_levels: 40,
            n_stacked: 64,
            wavelength_nm: 550.0,
            exposure: Exposure::seconds(0.01),
            seed: 1,
        }
    }
}

/// Frames that are taken under equal light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchSeries {
    /// The exposure time, s.
    pub time_s: f64,
    /// The photons that fall on a pixel, or on all that are read as one, in that time; 0 in the dark.
    pub photons: f64,
    /// The number of frames: 2 for a point of the photon transfer, more for a stack.
    pub n_frames: usize,
}

/// A sensor on the bench.
#[derive(Clone, Debug)]
pub struct Bench {
    sensor: Sensor,
    settings: BenchSettings,
    /// Electrons a photon on the pixel's whole area.
    quantum_efficiency: f64,
    filter: String,
    raised_black_dn: u16,
}

impl Bench {
    /// Puts the pixels behind one filter of a sensor on the bench: the one named, or the one that sees the light best.
    ///
    /// A sensor without a converter is given one of 16 bits over its swing, and one whose black level cuts off the noise of
    /// darkness a higher one, as a laboratory would ([`raised_black_dn`](Self::raised_black_dn)).
    ///
    /// # Errors
    /// When the sensor or a setting makes no sense, no filter has that name or the filter sees none of the light.
    pub fn new(sensor: &Sensor, settings: BenchSettings, filter: Option<&str>) -> Result<Self, SensorError> {
        sensor.check()?;
        settings.exposure.check()?;
        let wrong = |key, value, expected| Err(SensorError::value("the bench", key, value, expected));
        for (key, n, least) in [
            ("side", settings.side, 16),
            ("the number of levels", settings.n_levels, 5),
            ("the number of stacked frames", settings.n_stacked, 3),
        ] {
            if n < least || n > 8192 {
                return wrong(key, n as f64, "16 to 8192 pixels, 5 to 8192 levels and 3 to 8192 stacked frames");
            }
        }
        if settings.exposure.time_s <= 0.0 {
            return wrong("time_s", settings.exposure.time_s, "a number above 0");
        }
        let efficiency = |i: usize| sensor.quantum_efficiency(i, settings.wavelength_nm);
        let chosen = match filter {
            Some(name) => sensor.filters.iter().position(|f| f.name == name).ok_or_else(|| SensorError::Cfa {
                owner: sensor.name.clone(),
                reason: format!("has no filter '{name}', expected one of {}", names_of(sensor)),
            })?,
            None => (0..sensor.filters.len())
                .max_by(|&a, &b| efficiency(a).total_cmp(&efficiency(b)).then(b.cmp(&a)))
                .expect("a sensor has a filter"),
        };
        if efficiency(chosen) <= 0.0 {
            let reason = format!("sees nothing of {} nm", settings.wavelength_nm);
            return Err(SensorError::Unsuitable { what: "the pixel on the bench", reason });
        }
        let filter = sensor.filters[chosen].clone();
        let adc = match sensor.adc {
            Adc::Analog => Adc::Bits { bits: BENCH_BITS, black_level_dn: 0, step_v: None },
            bits => bits,
        };
        let name = filter.name.clone();
        let n = settings.exposure.binning.map_or(1, |binning| binning.pixels);
        let sensor = Sensor {
            cfa: Cfa::Mosaic(vec![vec![name.clone()]]),
            filters: vec![filter],
            adc,
            ..sensor.with_size(n * settings.side, n * settings.side)
        };
        sensor.as_read(&settings.exposure)?;
        let mut bench = Self { sensor, settings, quantum_efficiency: 1.0, filter: name, raised_black_dn: 0 };
        let one_photon = bench.rate(1.0, 1.0)?;
        // The middle of the array, away from the border's crosstalk.
        let middle = n * settings.side / 2;
        // The photon is shared by all pixels that are read as one.
        bench.quantum_efficiency = (n * n) as f64 * f64::from(one_photon.planes_e_per_s[0][(middle, middle)]);
        bench.raise_black()?;
        Ok(bench)
    }

    /// Raises the black level until it cuts off next to none of the noise of darkness; the step stays what it is.
    fn raise_black(&mut self) -> Result<(), SensorError> {
        // What clips is the number of one pixel, where numbers are summed.
        let whole = self.settings.exposure.binning.take_if(|binning| binning.kind == BinningKind::Digital);
        let dark = self.frame(&BenchSeries { time_s: self.settings.exposure.time_s, photons: 0.0, n_frames: 1 }, 0)?;
        let sheet = self.sensor.as_read(&dark.exposure)?;
        let floor_dn = sheet.noise_floor_e(&dark) * dark.levels.volts_per_electron / dark.levels.step_v;
        self.settings.exposure.binning = whole.or(self.settings.exposure.binning);
        let least_dn = (LEAST_BLACK * floor_dn).ceil();
        if let Adc::Bits { bits, black_level_dn, .. } = self.sensor.adc
            && f64::from(black_level_dn) < least_dn
            && least_dn < 0.5 * f64::from((1_u32 << bits) - 1)
        {
            self.raised_black_dn = least_dn as u16 - black_level_dn;
            self.sensor.adc = Adc::Bits {
                bits,
                black_level_dn: least_dn as u16,
                step_v: self.sensor.adc.step_v(self.sensor.swing_v),
            };
        }
        Ok(())
    }

    /// By how much the black level was raised, DN.
    pub fn raised_black_dn(&self) -> u16 {
        self.raised_black_dn
    }

    /// The sensor as it stands on the bench: one filter, and a converter.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The data sheet of its frames: that of the pixels as they are read.
    pub fn sheet(&self) -> Cow<'_, Sensor> {
        self.sensor.as_read(&self.settings.exposure).expect("the binning was checked when the sensor was put there")
    }

    /// The name of the filter.
    pub fn filter(&self) -> &str {
        &self.filter
    }

    /// What is set.
    pub fn settings(&self) -> &BenchSettings {
        &self.settings
    }

    /// Electrons a photon that falls on the whole area of a pixel, by the data sheet.
    pub fn quantum_efficiency(&self) -> f64 {
        self.quantum_efficiency
    }

    /// Returns the series of frames in order: the dark point, the levels, a dark stack, one at half saturation, and dark
    /// points of rising time where the sensor has a dark current.
    pub fn series(&self) -> Vec<BenchSeries> {
        let BenchSettings { n_levels, n_stacked, exposure, .. } = self.settings;
        let sheet = self.sheet();
        let saturation_photons = sheet.saturation_e(&exposure) / self.quantum_efficiency;
        let at = |time_s, photons, n_frames| BenchSeries { time_s, photons, n_frames };
        let mut series = vec![at(exposure.time_s, 0.0, 2)];
        let brightest = BEYOND_SATURATION * saturation_photons;
        series.extend((1..=n_levels).map(|i| at(exposure.time_s, brightest * i as f64 / n_levels as f64, 2)));
        series.push(at(exposure.time_s, 0.0, n_stacked));
        series.push(at(exposure.time_s, 0.5 * saturation_photons, n_stacked));
        let dark_e_per_s = sheet.dark_current.at(exposure.temperature_c);
        if dark_e_per_s > 0.0 {
            // Long enough that dark electrons dominate the dark noise, and half the well holds them.
            let gain_v_per_e = sheet.conversion_gain_v_per_e(exposure.gain_mode);
            let read_e = sheet.read_noise_v(exposure.gain_mode) / gain_v_per_e;
            let most_e = (10.0 * read_e.powi(2)).max(1000.0).min(0.5 * sheet.saturation_e(&exposure));
            let longest_s = (most_e / dark_e_per_s).max(2.0 * exposure.time_s);
            let step_s = (longest_s - exposure.time_s) / f64::from(DARK_TIMES - 1);
            series.extend((1..DARK_TIMES).map(|i| at(exposure.time_s + step_s * f64::from(i), 0.0, 2)));
        }
        series
    }

    /// Returns a frame of a series; `number` is its place among all frames of the bench and makes its noise its own.
    ///
    /// # Errors
    /// When a stage of the sensor fails.
    pub fn frame(&self, series: &BenchSeries, number: u64) -> Result<Raw, SensorError> {
        let rate = self.rate(series.photons, series.time_s)?;
        let exposure = Exposure { time_s: series.time_s, ..self.settings.exposure };
        let noise = Noise::all(self.settings.seed).frame(number);
        let electrons = self.sensor.electrons(&rate, &exposure, &noise)?;
        self.sensor.digitize(&self.sensor.volts(&electrons, &exposure, &noise)?, &exposure)
    }

    /// Returns the rate of photo-electrons of photons a pixel in a time.
    fn rate(&self, photons: f64, time_s: f64) -> Result<ElectronRate, SensorError> {
        let n = self.settings.exposure.binning.map_or(1, |binning| binning.pixels);
        let area_m2 = 1e-12 * (n as f64 * self.sensor.pixel_pitch_um).powi(2);
        let wavelength_nm = self.settings.wavelength_nm;
        let watts_per_m2_nm = photons * HC_J_M / (1e-9 * wavelength_nm) / (area_m2 * time_s * BAND_NM);
        let grid = WavelengthGrid::uniform(wavelength_nm, wavelength_nm, BAND_NM)?;
        let plane = Array2::from_elem((n * self.settings.side, n * self.settings.side), watts_per_m2_nm as f32);
        let light = SpectralImage::new(Quantity::Irradiance, grid, vec![plane])?;
        self.sensor.electron_rate(&Illumination::on_pixels(&light))
    }
}

fn names_of(sensor: &Sensor) -> String {
    sensor.filters.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn small() -> BenchSettings {
        BenchSettings { side: 32, n_levels: 5, n_stacked: 3, ..BenchSettings::default() }
    }

    #[test]
    fn photons_on_the_bench_become_electrons_of_the_data_sheet() {
        let sensor = Sensor { fill_factor: 0.8, ..Sensor::built_in("machine-vision-mono").unwrap() };
        let bench = Bench::new(&sensor, small(), None).unwrap();
        // Within the band of 1 nm the efficiency bends by less than this.
        let expected = 0.8 * sensor.quantum_efficiency(0, 550.0);
        assert_relative_eq!(bench.quantum_efficiency(), expected, max_relative = 1e-3);
    }

    #[test]
    fn the_series_hold_darkness_levels_stacks_and_dark_times() {
        let bench = Bench::new(&Sensor::built_in("imx363").unwrap(), small(), None).unwrap();
        assert_eq!(bench.filter(), "G");
        let series = bench.series();
        assert_eq!((series[0].photons, series[0].n_frames), (0.0, 2));
        assert!(series[1..=5].windows(2).all(|pair| pair[0].photons < pair[1].photons));
        assert_eq!((series[6].n_frames, series[7].n_frames), (3, 3));
        let dark_times: Vec<f64> = series[8..].iter().map(|s| s.time_s).collect();
        assert!(dark_times.windows(2).all(|pair| pair[0] < pair[1]), "{dark_times:?}");
        let saturated = bench.frame(&series[5], 5).unwrap();
        assert!(saturated.saturated_fraction() > 0.9);
    }

    /// Half of the noise about a black level of 0 is cut off: the rest has .58 of its deviation.
    #[test]
    fn noise_of_darkness_is_not_cut_off() {
        let sensor = Sensor::built_in("nikon-d5100").unwrap();
        let bench = Bench::new(&sensor, BenchSettings { side: 128, ..small() }, None).unwrap();
        let dark = bench.frame(&bench.series()[0], 0).unwrap();
        let samples: Vec<f64> = dark.planes[0].dn().unwrap().iter().map(|&dn| f64::from(dn)).collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let rms_dn = (samples.iter().map(|dn| (dn - mean).powi(2)).sum::<f64>() / samples.len() as f64).sqrt();
        let floor_dn = bench.sensor().noise_floor_e(&dark) * dark.levels.volts_per_electron / dark.levels.step_v;
        // 128 × 128 samples know their deviation to half a percent.
        assert_relative_eq!(rms_dn, floor_dn, max_relative = 0.02);
        assert!(bench.raised_black_dn() > 0 && (mean - f64::from(bench.raised_black_dn())).abs() < 0.1 * floor_dn);
        // A black level that is high enough stays.
        let bench = Bench::new(&Sensor::built_in("imx363").unwrap(), small(), None).unwrap();
        assert_eq!((bench.raised_black_dn(), bench.sensor().adc), (0, Sensor::built_in("imx363").unwrap().adc));
    }

    #[test]
    fn what_cannot_stand_on_the_bench_is_refused() {
        let sensor = Sensor::built_in("imx363").unwrap();
        let error = |settings, filter| Bench::new(&sensor, settings, filter).unwrap_err().to_string();
        assert!(error(small(), Some("X")).contains("R, G, B"));
        assert!(error(BenchSettings { side: 0, ..small() }, None).contains("side"));
        assert!(error(BenchSettings { wavelength_nm: 2000.0, ..small() }, None).contains("2000 nm"));
        // Figure 4's sensor has no converter of its own.
        let bench = Bench::new(&Sensor::built_in("nikon-d100").unwrap(), small(), None).unwrap();
        assert_eq!(bench.sensor().adc.top_dn(), Some(65535));
    }
}
