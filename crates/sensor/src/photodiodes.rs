//! Photodiodes that share the light below one microlens, each read by itself, and their sum.

use ndarray::Array2;

use crate::{
    Adc, DarkCurrent, Defects, ElectronRate, Electrons, Exposure, HighGain, Noise, Raw, RawPlane, Response, Sensor,
    SensorError, TelegraphNoise,
};

impl Sensor {
    /// Returns the data sheet of one of so many equal photodiodes below each microlens: each holds its part of the pixel's full well and gathers
    /// its part of the dark current. Gain, converter and noise are those of the pixel, since each is read by the same circuit.
    ///
    /// # Errors
    /// When pixels are split in a large and a small photodiode already, or the response is no straight line, so that the codes of parts do
    /// not add up.
    pub fn photodiode(&self, n_photodiodes: usize) -> Result<Self, SensorError> {
        let refused = |reason: String| Err(SensorError::Unsuitable { what: "dual_pixel", reason });
        if self.split_pixel.is_some() {
            return refused(format!("needs pixels of equal photodiodes, but {} states split_pixel", self.name));
        }
        self.check_all_lit("dual_pixel")?;
        if self.response != Response::Linear {
            return refused(format!("needs a linear response, which {} has not", self.name));
        }
        let part = (n_photodiodes as f64).recip();
        let dark_current = DarkCurrent { e_per_s: part * self.dark_current.e_per_s, ..self.dark_current };
        let defects = Defects { hot_e_per_s: part * self.defects.hot_e_per_s, ..self.defects };
        Ok(Self {
            name: format!("{}, one of {n_photodiodes} photodiodes", self.name),
            full_well_e: part * self.full_well_e,
            high_gain: self.high_gain.map(|high| HighGain { full_well_e: part * high.full_well_e, ..high }),
            dark_current,
            defects,
            ..self.clone()
        })
    }

    /// Returns the electrons of each photodiode of one exposure, from the rate of each.
    ///
    /// What a photodiode cannot hold goes to its neighbors below the same microlens while these have room, by the barrier between them that is
    /// lower than those to other pixels, so that the sum rises with light up to the pixel's full well.
    ///
    /// # Errors
    /// As [`photodiode`](Self::photodiode), or when the exposure makes no sense.
    pub fn photodiode_electrons(
        &self,
        rates: &[ElectronRate],
        exposure: &Exposure,
        noise: &Noise,
    ) -> Result<Vec<Electrons>, SensorError> {
        exposure.check_single("photodiodes of one pixel")?;
        let one = self.photodiode(rates.len())?;
        let well_e = one.full_well_e(exposure.gain_mode) as f32;
        let gathering = Self { full_well_e: self.full_well_e, high_gain: self.high_gain, ..one };
        let gathered =
            |(number, rate): (usize, &ElectronRate)| gathering.electrons(rate, exposure, &noise.of_photodiode(number));
        let mut electrons = rates.iter().enumerate().map(gathered).collect::<Result<Vec<_>, _>>()?;
        for number in 0..self.n_planes() {
            let mut planes: Vec<&mut Array2<f32>> = electrons.iter_mut().map(|of| &mut of.planes_e[number]).collect();
            let mut values: Vec<_> = planes.iter_mut().map(|plane| plane.iter_mut()).collect();
            while let Some(mut pixel) = values.iter_mut().map(Iterator::next).collect::<Option<Vec<&mut f32>>>() {
                overflow(&mut pixel, well_e);
            }
        }
        Ok(electrons)
    }

    /// Returns the data sheet of the sum of so many reads of a pixel: the noise of each read is in it, and each photodiode's own sensitivity.
    ///
    /// The rounding of the converter is counted once.
    #[must_use]
    pub fn of_summed_reads(&self, n_photodiodes: usize) -> Self {
        self.with_noise_of_reads((n_photodiodes as f64).sqrt())
    }

    /// Returns the data sheet of one of so many photodiodes, from that of the sum of their reads.
    ///
    /// # Errors
    /// As [`photodiode`](Self::photodiode).
    pub fn of_one_read(&self, n_photodiodes: usize) -> Result<Self, SensorError> {
        self.with_noise_of_reads((n_photodiodes as f64).sqrt().recip()).photodiode(n_photodiodes)
    }

    fn with_noise_of_reads(&self, root: f64) -> Self {
        Self {
            read_noise_v: root * self.read_noise_v,
            read_noise_e: self.read_noise_e.map(|electrons| root * electrons),
            high_gain: self.high_gain.map(|high| HighGain { read_noise_v: root * high.read_noise_v, ..high }),
            reset_noise_v: root * self.reset_noise_v,
            dsnu_v: root * self.dsnu_v,
            column_offset_v: root * self.column_offset_v,
            row_noise_v: root * self.row_noise_v,
            telegraph: TelegraphNoise { mean_amplitude_e: root * self.telegraph.mean_amplitude_e, ..self.telegraph },
            prnu_fraction: self.prnu_fraction / root,
            ..self.clone()
        }
    }

    /// Returns the sum of the reads of a pixel's photodiodes: a frame like that of a whole pixel, its black level counted once.
    ///
    /// # Errors
    /// When there are no reads, or they differ in size, mosaic or exposure.
    pub fn sum_reads(&self, reads: &[Raw]) -> Result<Raw, SensorError> {
        self.check_merge(reads)?;
        let first = &reads[0];
        if let Some(other) = reads.iter().find(|read| read.exposure != first.exposure) {
            let (expected, found) = (first.exposure.time_s.to_string(), other.exposure.time_s.to_string());
            return Err(SensorError::Shape { what: "exposure of the reads of a pixel", expected, found });
        }
        let levels = crate::raw::Levels::new(self, &first.exposure);
        let surplus = levels.black * (reads.len() - 1) as f64;
        let plane = |number: usize| {
            let sums = |codes: fn(&RawPlane) -> Array2<f64>| {
                let mut planes = reads.iter().map(|read| codes(&read.planes[number]));
                let own = planes.next().expect("there is a first read");
                planes.fold(own, |sum, plane| sum + plane) - surplus
            };
            let total = sums(|plane| plane.samples().mapv(f64::from));
            match self.adc {
                Adc::Bits { .. } => RawPlane::Dn(total.mapv(|dn| dn.round().clamp(0.0, levels.top) as u16)),
                Adc::Analog => RawPlane::Volts(total.mapv(|v| v.min(levels.top) as f32)),
            }
        };
        let planes = (0..first.planes.len()).map(plane).collect();
        Ok(Raw { planes, levels, ..first.clone() })
    }
}

/// Gives what is above a well to the other photodiodes of a pixel, in proportion to their room; what finds none is drained.
fn overflow(pixel: &mut [&mut f32], well_e: f32) {
    let excess: f32 = pixel.iter().map(|e| (**e - well_e).max(0.0)).sum();
    if excess == 0.0 {
        return;
    }
    let room: f32 = pixel.iter().map(|e| (well_e - **e).max(0.0)).sum();
    let taken = if room > 0.0 { (excess / room).min(1.0) } else { 0.0 };
    for e in pixel {
        **e = if **e >= well_e { well_e } else { **e + taken * (well_e - **e) };
    }
}

impl Noise {
    /// Returns the noises of a photodiode of the same frame: other draws than those of its neighbors, and a fixed pattern of its own.
    #[must_use]
    pub fn of_photodiode(self, number: usize) -> Self {
        // Odd constants, far from those that tell frames apart.
        let spread = |constant: u64| (number as u64).wrapping_mul(constant);
        Self {
            seed: self.seed ^ spread(0xd6e8_feb8_6659_fd93),
            fixed_pattern_seed: self.fixed_pattern_seed ^ spread(0xa076_1d64_78bd_642f),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseSource;

    const SIZE: (usize, usize) = (200, 200);

    fn sensor() -> Sensor {
        Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() }
    }

    fn reads(sensor: &Sensor, rates: &[f32], noise: &Noise) -> Vec<Raw> {
        let (sheet, exposure) = (sensor.photodiode(rates.len()).unwrap(), Exposure::seconds(0.01));
        let rate = |&rate: &f32| ElectronRate { planes_e_per_s: vec![Array2::from_elem(SIZE, rate)] };
        let rates: Vec<ElectronRate> = rates.iter().map(rate).collect();
        let electrons = sensor.photodiode_electrons(&rates, &exposure, noise).unwrap();
        let read = |(number, electrons): (usize, &Electrons)| {
            let noise = noise.of_photodiode(number);
            sheet.digitize(&sheet.volts(electrons, &exposure, &noise).unwrap(), &exposure).unwrap()
        };
        electrons.iter().enumerate().map(read).collect()
    }

    fn electrons(raw: &Raw) -> Array2<f64> {
        raw.linear()[0].mapv(|x| f64::from(x) * raw.levels.saturation_e())
    }

    /// Photons of both halves are those of the whole; each read adds its own read noise and rounding.
    #[test]
    fn noise_of_the_sum_is_that_of_two_reads() {
        let sensor = sensor();
        let (left, right) = (1.2e5_f32, 0.7e5_f32);
        let read = reads(&sensor, &[left, right], &Noise::all(3));
        let sum = electrons(&sensor.sum_reads(&read).unwrap());
        let each: Vec<Array2<f64>> = read.iter().map(electrons).collect();
        let variance = |plane: &Array2<f64>| plane.var(1.0);
        let light_e = 0.01 * f64::from(left + right);
        assert!((sum.mean().unwrap() / light_e - 1.0).abs() < 2e-3, "{}", sum.mean().unwrap());
        // 40,000 pixels: a standard error of .7 % of a variance. The reads are independent, so their variances add up.
        let parts = variance(&each[0]) + variance(&each[1]);
        assert!((variance(&sum) / parts - 1.0).abs() < 0.02, "{} {parts}", variance(&sum));
        let levels = &read[0].levels;
        let rounding_e2 = (levels.step_v / levels.volts_per_electron).powi(2) / 12.0;
        let read_e = sensor.read_noise_v(crate::GainMode::Low) / sensor.conversion_gain_v_per_e;
        let row_e = sensor.row_noise_v / sensor.conversion_gain_v_per_e;
        let expected = light_e + 2.0 * (read_e * read_e + row_e * row_e + rounding_e2);
        assert!((variance(&sum) / expected - 1.0).abs() < 0.03, "{} {expected}", variance(&sum));
        let covariance = ((&each[0] - each[0].mean().unwrap()) * (&each[1] - each[1].mean().unwrap())).mean().unwrap();
        assert!(covariance.abs() < 0.02 * parts, "{covariance}");
        // In the dark the read noise alone is left, and the sheet of the sum tells it.
        let dark = reads(&sensor, &[0.0; 2], &Noise::only(3, &[NoiseSource::Read]));
        let dark_e = electrons(&sensor.sum_reads(&dark).unwrap()).std(1.0);
        let told_e = sensor.of_summed_reads(2).read_noise_v(crate::GainMode::Low) / sensor.conversion_gain_v_per_e;
        // 1 % of the standard error, and the rounding of each read.
        assert!((dark_e / (told_e * told_e + 2.0 * rounding_e2).sqrt() - 1.0).abs() < 0.03, "{dark_e} {told_e}");
    }

    #[test]
    fn a_sum_of_reads_is_the_frame_of_the_whole_pixel() {
        let sensor = sensor();
        let exposure = Exposure::seconds(0.01);
        let whole = ElectronRate { planes_e_per_s: vec![Array2::from_elem(SIZE, 2.1e5)] };
        let whole_e = sensor.electrons(&whole, &exposure, &Noise::none()).unwrap();
        let raw = sensor.digitize(&sensor.volts(&whole_e, &exposure, &Noise::none()).unwrap(), &exposure).unwrap();
        let sum = sensor.sum_reads(&reads(&sensor, &[0.8e5, 1.3e5], &Noise::none())).unwrap();
        assert_eq!((&sum.levels, &sum.exposure), (&raw.levels, &raw.exposure));
        // Each read is rounded to a code.
        let apart = (sum.planes[0].sample(5, 5).unwrap() - raw.planes[0].sample(5, 5).unwrap()).abs();
        assert!(apart <= 1.0, "{apart}");
    }

    /// A blurred lamp lights one half of the pupil alone: its photodiode is full at half the well, and what it cannot hold goes to the other.
    #[test]
    fn a_full_photodiode_overflows_into_its_neighbor() {
        let sensor = Sensor { swing_v: 10.0, adc: Adc::Analog, ..sensor() };
        let well_e = sensor.full_well_e;
        let check = |shares: &[f64], expected: &[f64]| {
            let rates: Vec<f32> = shares.iter().map(|share| (100.0 * share * well_e) as f32).collect();
            let found = reads(&sensor, &rates, &Noise::none());
            let sum = electrons(&sensor.sum_reads(&found).unwrap())[(3, 3)] / well_e;
            let parts: Vec<f64> = found.iter().map(|read| electrons(read)[(3, 3)] / well_e).collect();
            // Single floats, and the dark current of a hundredth of a second.
            assert!(parts.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{parts:?} {expected:?}");
            assert!((sum - expected.iter().sum::<f64>()).abs() < 1e-3, "{sum}");
        };
        check(&[0.4, 0.3], &[0.4, 0.3]);
        check(&[0.7, 0.1], &[0.5, 0.3]);
        check(&[0.9, 0.4], &[0.5, 0.5]);
        check(&[0.45, 0.05, 0.15, 0.15], &[0.25, 0.15, 0.2, 0.2]);
    }

    #[test]
    fn one_read_has_the_noise_of_the_sheet() {
        let sensor = Sensor::built_in("imx363").unwrap();
        let (found, expected) = (sensor.of_summed_reads(4).of_one_read(4).unwrap(), sensor.photodiode(4).unwrap());
        assert_eq!((found.full_well_e, found.read_noise_e, &found.name), (1500.0, None, &expected.name));
        assert!((found.read_noise_v / expected.read_noise_v - 1.0).abs() < 1e-12);
    }

    #[test]
    fn pixels_that_cannot_be_divided_are_named() {
        let log = Sensor { response: Response::Logarithmic { knee_v: 0.1 }, ..sensor() };
        assert!(log.photodiode(2).unwrap_err().to_string().contains("linear response"));
    }
}
