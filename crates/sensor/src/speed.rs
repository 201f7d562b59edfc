//! ISO speeds after ISO 12232: by saturation and by noise.

use std::f64::consts::PI;

use dioptric_spectrum::Illuminant;

use crate::{Exposure, Sensor, white_light::fine_grid};

impl Sensor {
    /// Returns the electrons that an exposure of one lux second on the sensor makes behind each filter.
    pub fn electrons_per_lux_second(&self, light: &Illuminant) -> Vec<f64> {
        let grid = fine_grid();
        // A white diffuser in 1 lx sends out as much as falls on a sensor in 1 lx.
        let irradiance: Vec<f64> = light.white_radiance(&grid, 1.0).iter().map(|radiance| PI * radiance).collect();
        self.electron_weights(&grid).iter().map(|w| w.iter().zip(&irradiance).map(|(w, e)| w * e).sum()).collect()
    }

    /// Returns the saturation-based ISO speed, 78 lx s over the exposure at which the first filter saturates.
    pub fn iso_by_saturation(&self, light: &Illuminant, exposure: &Exposure) -> f64 {
        78.0 * self.most_sensitive(light) / self.saturation_e(exposure)
    }

    /// Returns the noise-based ISO speed, 10 lx s over the exposure at which the most sensitive filter reaches a ratio
    /// of signal to noise (40 for excellent, 10 for acceptable pictures); `None` when PRNU never lets it.
    ///
    /// Noise is that of one pixel: shot, read, rounding, DSNU and PRNU. The standard's weighting of colors, which
    /// depends on the processing, is left out.
    pub fn iso_by_noise(&self, light: &Illuminant, exposure: &Exposure, snr: f64) -> Option<f64> {
        let gain_v_per_e = self.conversion_gain_v_per_e(exposure.gain_mode);
        let rounding_v = self.adc.step_v(self.swing_v).map_or(0.0, |step_v| step_v / 12.0_f64.sqrt());
        let floor_v = self.read_noise_v(exposure.gain_mode).hypot(self.dsnu_v).hypot(rounding_v / exposure.analog_gain);
        let floor_e2 = (floor_v / gain_v_per_e).powi(2);
        // n² = snr² (n + floor² + PRNU² n²), solved for n.
        let a = 1.0 - (snr * self.prnu_fraction).powi(2);
        let s2 = snr * snr;
        let electrons = (s2 + (s2 * s2 + 4.0 * a * s2 * floor_e2).sqrt()) / (2.0 * a);
        (a > 0.0).then(|| 10.0 * self.most_sensitive(light) / electrons)
    }

    fn most_sensitive(&self, light: &Illuminant) -> f64 {
        self.electrons_per_lux_second(light).into_iter().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_lux_second_on_a_square_micrometer_is_thousands_of_photons() {
        // Every photon counted: an equal-energy light of 1 lx carries 1 / (683 × 106.856 nm) W m⁻² nm⁻¹ (the area under
        // V(λ) is 106.856 nm), so that over the grid's 360 to 830 nm the photons are Σ λ E / (h c).
        let sensor = Sensor { pixel_pitch_um: 1.0, ..Sensor::built_in("ideal-mono").unwrap() };
        let watts = 1.0 / (683.002 * 106.857);
        let photons: f64 =
            (180..=415).map(|i| 2.0 * f64::from(i)).map(|nm| 2.0 * watts * nm * 1e-9 / 1.986_445_857e-25).sum();
        assert_relative_eq!(sensor.electrons_per_lux_second(&Illuminant::E)[0], photons * 1e-12, max_relative = 1e-3);
    }

    #[test]
    fn speeds_follow_gain_and_noise() {
        let sensor = Sensor { read_noise_v: 1e-4, ..Sensor::built_in("ideal-mono").unwrap() };
        let exposure = Exposure::seconds(0.01);
        let doubled = Exposure { analog_gain: 2.0, ..exposure };
        let light = Illuminant::D55;
        let speed = |exposure| sensor.iso_by_saturation(&light, exposure);
        assert_relative_eq!(speed(&doubled), 2.0 * speed(&exposure), max_relative = 1e-12);
        // At the noise-based speed the ratio is what was asked for.
        let iso = sensor.iso_by_noise(&light, &exposure, 40.0).unwrap();
        let electrons = 10.0 / iso * sensor.electrons_per_lux_second(&light)[0];
        assert_relative_eq!(electrons / (electrons + 100.0).sqrt(), 40.0, max_relative = 1e-9);
        let uneven = Sensor { prnu_fraction: 0.03, ..sensor };
        assert!(uneven.iso_by_noise(&light, &exposure, 40.0).is_none());
    }
}
