//! What developing needs to know of the camera that took a frame.

use dioptric_spectrum::{Illuminant, Spectrum, color_checker_reflectances};
use ndarray::Array2;

use crate::{
    ColorCorrection, ColorMatrix, Raw, Sensor, SensorError,
    denoise::SampleNoise,
    hdr::merged_noise,
    white_light::{light_of_gains, white_response},
};

/// The camera of a frame: a sensor whose quantum efficiencies are known, or one of which a file states matrices and noise.
pub(crate) trait CameraProfile {
    /// The channels of a pixel.
    fn n_channels(&self) -> usize;

    /// The name of a channel's filter.
    fn filter_name(&self, channel: usize) -> &str;

    /// Returns what each channel sees of a perfect white under a light, up to a common factor.
    fn white_response(&self, light: &Illuminant) -> Vec<f64>;

    /// Returns the matrix from channels that were balanced so to linear sRGB, for the corrections that depend on the camera;
    /// `roots_weight` is how far noise lets automatic ones take roots.
    ///
    /// # Errors
    /// When the matrices of the camera have no inverse.
    fn fitted_matrix(
        &self,
        color: &ColorCorrection,
        balance: &[f64],
        roots_weight: f64,
    ) -> Result<ColorMatrix, SensorError>;

    /// Returns the noise of a frame in the dark, standard deviation as a share of saturation.
    fn noise_floor(&self, raw: &Raw) -> f64;

    /// Returns the noise of a frame's samples in units of saturation, for each channel.
    fn sample_noise(&self, raw: &Raw) -> Vec<SampleNoise>;

    /// Returns demosaiced channels, which were balanced so, as the camera itself wants them corrected.
    fn corrected(&self, channels: Vec<Array2<f32>>, balance: &[f64]) -> Vec<Array2<f32>> {
        let _ = balance;
        channels
    }
}

impl dyn CameraProfile + '_ {
    /// Returns the matrix from channels that were balanced so to linear sRGB; `roots_weight` is how far noise lets automatic ones take roots.
    ///
    /// # Errors
    /// When the matrices of the camera have no inverse.
    pub(crate) fn color_matrix(
        &self,
        color: &ColorCorrection,
        balance: &[f64],
        roots_weight: f64,
    ) -> Result<ColorMatrix, SensorError> {
        match color {
            ColorCorrection::None => Ok(ColorMatrix::identity(self.n_channels())),
            ColorCorrection::Matrix(rows) => {
                Ok(ColorMatrix { rows: rows.clone(), has_roots: false, delta_e: Vec::new() })
            }
            _ => self.fitted_matrix(color, balance, roots_weight),
        }
    }

    /// Returns the share of saturation from which on a sample is taken to be saturated: three deviations of noise below it.
    pub(crate) fn saturated_from(&self, raw: &Raw) -> f32 {
        (0.998 - 3.0 * self.noise_floor(raw)).max(0.9) as f32
    }
}

impl CameraProfile for Sensor {
    fn n_channels(&self) -> usize {
        self.filters.len()
    }

    fn filter_name(&self, channel: usize) -> &str {
        &self.filters[channel].name
    }

    fn white_response(&self, light: &Illuminant) -> Vec<f64> {
        white_response(self, light)
    }

    fn fitted_matrix(
        &self,
        color: &ColorCorrection,
        balance: &[f64],
        roots_weight: f64,
    ) -> Result<ColorMatrix, SensorError> {
        let chart: Vec<Spectrum> = color_checker_reflectances().into_iter().map(|(_, s)| s).collect();
        Ok(match color {
            ColorCorrection::Roots => ColorMatrix::fit_roots(self, &light_of_gains(self, balance), &chart),
            ColorCorrection::Fitted(light) => ColorMatrix::fit(self, light, &chart),
            ColorCorrection::FittedRoots(light) => ColorMatrix::fit_roots(self, light, &chart),
            ColorCorrection::AutoUnder(light) => ColorMatrix::fit_mixed(self, light, &chart, roots_weight),
            _ => ColorMatrix::fit_mixed(self, &light_of_gains(self, balance), &chart, roots_weight),
        })
    }

    fn noise_floor(&self, raw: &Raw) -> f64 {
        self.noise_floor_e(raw) / raw.levels.saturation_e()
    }

    fn sample_noise(&self, raw: &Raw) -> Vec<SampleNoise> {
        let noise = match raw.merged.is_empty() {
            true => {
                SampleNoise::Frame { electrons_per_unit: raw.levels.saturation_e(), floor_e: self.noise_floor_e(raw) }
            }
            false => merged_noise(&raw.merged),
        };
        vec![noise; self.filters.len()]
    }
}
