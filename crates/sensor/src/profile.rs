//! What developing needs to know of the camera that took a frame: its sensor, or what a file states of it.

use dioptric_spectrum::{Illuminant, Spectrum, color_checker_reflectances};

use crate::{
    ColorCorrection, ColorMatrix, Processing, Raw, Sensor, SensorError,
    balance::{light_of_gains, white_response},
    denoise::SampleNoise,
    dng::DngProfile,
    hdr::merged_noise,
};

/// The camera of a frame.
#[derive(Clone, Copy)]
pub(crate) enum Profile<'a> {
    /// A sensor whose quantum efficiencies are known.
    Sensor(&'a Sensor),
    /// One of which a file states color matrices and noise.
    File(&'a DngProfile),
}

impl Profile<'_> {
    /// The channels of a pixel.
    pub(crate) fn n_channels(self) -> usize {
        match self {
            Self::Sensor(sensor) => sensor.filters.len(),
            Self::File(file) => file.filter_names.len(),
        }
    }

    pub(crate) fn filter_name(self, channel: usize) -> String {
        match self {
            Self::Sensor(sensor) => sensor.filters[channel].name.clone(),
            Self::File(file) => file.filter_names[channel].clone(),
        }
    }

    /// Returns what each channel sees of a perfect white under a light, up to a common factor.
    pub(crate) fn white_response(self, light: &Illuminant) -> Vec<f64> {
        match self {
            Self::Sensor(sensor) => white_response(sensor, light),
            Self::File(file) => file.white_response(light),
        }
    }

    /// Returns the matrix from channels that were balanced so to linear sRGB.
    pub(crate) fn color_matrix(self, color: &ColorCorrection, balance: &[f64]) -> Result<ColorMatrix, SensorError> {
        let sensor = match (color, self) {
            (ColorCorrection::None, _) => return Ok(ColorMatrix::identity(self.n_channels())),
            (ColorCorrection::Matrix(rows), _) => {
                return Ok(ColorMatrix { rows: rows.clone(), has_roots: false, delta_e: Vec::new() });
            }
            (_, Self::File(file)) => return file.color_matrix(color, balance),
            (_, Self::Sensor(sensor)) => sensor,
        };
        let chart: Vec<Spectrum> = color_checker_reflectances().into_iter().map(|(_, s)| s).collect();
        Ok(match color {
            ColorCorrection::Roots => ColorMatrix::fit_roots(sensor, &light_of_gains(sensor, balance), &chart),
            ColorCorrection::Fitted(light) => ColorMatrix::fit(sensor, light, &chart),
            ColorCorrection::FittedRoots(light) => ColorMatrix::fit_roots(sensor, light, &chart),
            _ => ColorMatrix::fit(sensor, &light_of_gains(sensor, balance), &chart),
        })
    }

    /// Returns the share of saturation from which on a sample is taken to be saturated: three deviations of noise below it.
    pub(crate) fn saturated_from(self, raw: &Raw) -> f32 {
        let noise = match self {
            Self::Sensor(sensor) => sensor.noise_floor_e(raw) / raw.levels.saturation_e(),
            Self::File(file) => file.largest_floor(),
        };
        (0.998 - 3.0 * noise).max(0.9) as f32
    }

    /// Returns the noise of a frame's samples in units of saturation, for each channel.
    pub(crate) fn sample_noise(self, raw: &Raw) -> Vec<SampleNoise> {
        match self {
            Self::Sensor(sensor) => {
                let noise = if raw.merged.is_empty() {
                    SampleNoise::Frame {
                        electrons_per_unit: raw.levels.saturation_e(),
                        floor_e: sensor.noise_floor_e(raw),
                    }
                } else {
                    merged_noise(&raw.merged)
                };
                vec![noise; sensor.filters.len()]
            }
            Self::File(file) => file.sample_noise(),
        }
    }

    /// Checks what this camera cannot do.
    pub(crate) fn check_processing(self, processing: &Processing) -> Result<(), SensorError> {
        match self {
            Self::Sensor(_) => Ok(()),
            Self::File(file) => file.check_processing(processing),
        }
    }
}
