//! Whether a data sheet makes sense.

use crate::{Adc, Response, Sensor, SensorError};

/// The most pixels that a sensor may have: a gigapixel.
const MAX_PIXELS: usize = 1 << 30;

impl Sensor {
    /// Checks that every number makes sense and that the mosaic names filters that are there.
    ///
    /// # Errors
    /// Names the first field that does not, its value and what was expected.
    pub fn check(&self) -> Result<(), SensorError> {
        self.check_pixels()?;
        self.check_numbers()?;
        self.check_converter()?;
        self.check_tables()?;
        self.check_stack()?;
        self.check_masked()?;
        self.tile().map(drop)
    }

    fn check_pixels(&self) -> Result<(), SensorError> {
        for (key, count) in [("rows", self.rows), ("columns", self.columns)] {
            if count == 0 || count > MAX_PIXELS / self.rows.max(1) && key == "columns" {
                return Err(SensorError::value(&self.name, key, count as f64, "1 or more, and at most 2^30 pixels"));
            }
        }
        if self.filters.is_empty() {
            return Err(SensorError::value(&self.name, "the number of filters", 0.0, "1 or more"));
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), SensorError> {
        let positive = [
            ("pixel_pitch_um", self.pixel_pitch_um),
            ("fill_factor", self.fill_factor),
            ("conversion_gain_v_per_e", self.conversion_gain_v_per_e),
            ("full_well_e", self.full_well_e),
            ("swing_v", self.swing_v),
            ("dark_current.doubling_k", self.dark_current.doubling_k),
            ("iso_at_unity_gain", self.iso_at_unity_gain.unwrap_or(1.0)),
            ("binned_well_e", self.binned_well_e.unwrap_or(1.0)),
            ("high_gain.conversion_gain_v_per_e", self.high_gain.map_or(1.0, |h| h.conversion_gain_v_per_e)),
            ("high_gain.full_well_e", self.high_gain.map_or(1.0, |h| h.full_well_e)),
            ("split_pixel.conversion_gain_v_per_e", self.split_pixel.map_or(1.0, |s| s.conversion_gain_v_per_e)),
            ("split_pixel.full_well_e", self.split_pixel.map_or(1.0, |s| s.full_well_e)),
        ];
        let not_negative = [
            ("read_noise_v", self.read_noise_v),
            ("read_noise_e", self.read_noise_e.unwrap_or(0.0)),
            ("reset_noise_v", self.reset_noise_v),
            ("dark_current.e_per_s", self.dark_current.e_per_s),
            ("prnu_fraction", self.prnu_fraction),
            ("dsnu_v", self.dsnu_v),
            ("column_offset_v", self.column_offset_v),
            ("column_gain_fraction", self.column_gain_fraction),
            ("row_noise_v", self.row_noise_v),
            ("row_time_us", self.row_time_us),
            ("defects.hot_e_per_s", self.defects.hot_e_per_s),
            ("telegraph.mean_amplitude_e", self.telegraph.mean_amplitude_e),
            ("high_gain.read_noise_v", self.high_gain.map_or(0.0, |h| h.read_noise_v)),
            ("split_pixel.read_noise_e", self.split_pixel.map_or(0.0, |s| s.read_noise_e)),
        ];
        let shares = [
            ("fill_factor", self.fill_factor),
            ("blooming_fraction", self.blooming_fraction),
            ("defects.hot_fraction", self.defects.hot_fraction),
            ("telegraph.fraction", self.telegraph.fraction),
            ("defects.dead_fraction", self.defects.dead_fraction),
        ];
        let finite = [("offset_v", self.offset_v), ("dark_current.at_c", self.dark_current.at_c)];
        if self.read_noise_e.is_some() && self.read_noise_v != 0.0 {
            let expected = "0, or none, where read_noise_e is given";
            return Err(SensorError::value(&self.name, "read_noise_v", self.read_noise_v, expected));
        }
        let wrong = |fields: &[(&str, f64)], right: fn(f64) -> bool, expected| {
            let found = fields.iter().find(|&&(_, value)| !(value.is_finite() && right(value)));
            found.map_or(Ok(()), |&(key, value)| Err(SensorError::value(&self.name, key, value, expected)))
        };
        for filter in &self.filters {
            let share = [("exposure_fraction", filter.exposure_fraction)];
            wrong(&share, |v| v > 0.0 && v <= 1.0, "a share above 0 and at most 1")?;
        }
        let area_ratio = [("split_pixel.area_ratio", self.split_pixel.map_or(2.0, |s| s.area_ratio))];
        wrong(&area_ratio, |v| v > 1.0, "a number above 1")?;
        wrong(&positive, |v| v > 0.0, "a number above 0")?;
        wrong(&not_negative, |v| v >= 0.0, "a number of 0 or more")?;
        wrong(&shares, |v| (0.0..=1.0).contains(&v), "a share from 0 to 1")?;
        wrong(&finite, |_| true, "a finite number")
    }

    fn check_converter(&self) -> Result<(), SensorError> {
        if let Adc::Bits { bits, black_level_dn, step_v } = self.adc {
            if !(1..=16).contains(&bits) {
                return Err(SensorError::value(&self.name, "adc.bits", f64::from(bits), "1 to 16"));
            }
            if u32::from(black_level_dn) >= (1 << bits) - 1 {
                let value = f64::from(black_level_dn);
                return Err(SensorError::value(&self.name, "adc.black_level_dn", value, "a code below the highest"));
            }
            if let Some(step_v) = step_v.filter(|&v| !(v > 0.0 && v.is_finite())) {
                return Err(SensorError::value(&self.name, "adc.step_v", step_v, "a number above 0"));
            }
        }
        let wrong = |key, value, expected| Err(SensorError::value(&self.name, key, value, expected));
        match &self.response {
            Response::Linear => Ok(()),
            Response::Logarithmic { knee_v } if *knee_v > 0.0 && knee_v.is_finite() => Ok(()),
            Response::Logarithmic { knee_v } => wrong("response.knee_v", *knee_v, "a number above 0"),
            Response::Companding { knees_v } => {
                let mut last = (0.0, 0.0);
                for &(input_v, output_v) in knees_v {
                    if !(input_v > last.0 && output_v > last.1 && input_v < self.swing_v && output_v < self.swing_v) {
                        return wrong("response.knees_v", input_v, "pairs that ascend from 0 to below the swing");
                    }
                    last = (input_v, output_v);
                }
                Ok(())
            }
        }
    }

    fn check_stack(&self) -> Result<(), SensorError> {
        let Some(stack) = &self.pixel_stack else { return Ok(()) };
        if !self.chief_ray_response.is_empty() {
            let reason = format!(
                "of {} states the response to angles that its chief_ray_response states too, expected one of them",
                self.name
            );
            return Err(SensorError::Unsuitable { what: "pixel_stack", reason });
        }
        stack.check(&self.name, self.pixel_pitch_um, self.opening_um())
    }

    fn check_tables(&self) -> Result<(), SensorError> {
        let shares = "shares from 0 to 1";
        let spectra = self
            .filters
            .iter()
            .map(|f| (&f.name, &f.quantum_efficiency))
            .chain(self.filter_stack.iter().map(|l| (&l.name, &l.transmittance)));
        for (name, spectrum) in spectra {
            if let Some(&value) = spectrum.values().iter().find(|v| !(0.0..=1.0).contains(*v)) {
                return Err(SensorError::value(&self.name, &format!("the spectrum of '{name}'"), value, shares));
            }
        }
        for (key, kernel) in
            [("optical_crosstalk", &self.optical_crosstalk), ("electrical_crosstalk", &self.electrical_crosstalk)]
        {
            let values = || kernel.iter().flatten().flatten().copied();
            if let Some(value) = values().find(|v| !(0.0..=1.0).contains(v)) {
                return Err(SensorError::value(&self.name, key, value, shares));
            }
            // Nine rounded shares may add up to a little over 1.
            if values().sum::<f64>() > 1.0 + 1e-9 {
                return Err(SensorError::value(&self.name, key, values().sum(), "shares that sum to at most 1"));
            }
        }
        let mut last = f64::NEG_INFINITY;
        for &(angle_deg, share) in &self.chief_ray_response {
            if !(angle_deg > last && share >= 0.0 && share.is_finite()) {
                let expected = "ascending angles with a share of 0 or more";
                return Err(SensorError::value(&self.name, "chief_ray_response", angle_deg, expected));
            }
            last = angle_deg;
        }
        Ok(())
    }
}
