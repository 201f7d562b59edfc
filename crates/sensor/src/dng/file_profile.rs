//! What a DNG file states of its camera, as far as developing needs it.

use dioptric_spectrum::Illuminant;
use ndarray::{Array2, s};
use serde::Serialize;

use super::{
    corrections::{Corrections, Place},
    file_color::DngColor,
    file_look::DngLook,
};
use crate::{
    ColorCorrection, ColorMatrix, Processing, Raw, SensorError, WhiteBalance, denoise::SampleNoise,
    profile::CameraProfile,
};

/// The camera of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DngProfile {
    /// The filters of the mosaic, or of the planes.
    pub filter_names: Vec<String>,
    /// Its colors; `None` of a single filter, and where the file states none.
    pub color: Option<DngColor>,
    /// What it adds to colors for a look.
    pub look: DngLook,
    /// Its noise: none where the file states none, one for all filters, or one each.
    pub noise: Vec<DngNoise>,
    /// What is done to demosaiced channels.
    #[serde(skip)]
    pub(super) corrections: Option<ChannelCorrections>,
}

/// The third list of opcodes, with where the channels lie in the image that it is for, and the part of them that is shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChannelCorrections {
    pub(super) list: Corrections,
    pub(super) place: Place,
    /// Top, left, bottom and right of what is shown, in the image of the list; `None` where the channels are that.
    pub(super) shown: Option<[usize; 4]>,
}

impl ChannelCorrections {
    fn apply(&self, channels: Vec<Array2<f32>>, balance: &[f64]) -> Vec<Array2<f32>> {
        let scales: Vec<f32> = balance.iter().map(|gain| *gain as f32).collect();
        let channels = self.list.apply(channels, self.place, (&scales, f32::INFINITY), &|_, _| true);
        let Some(shown) = self.shown else { return channels };
        let [top, left, bottom, right] = self.list.trimmed((self.place.rows, self.place.columns));
        let cut = [shown[0].max(top), shown[1].max(left), shown[2].min(bottom), shown[3].min(right)];
        // What is trimmed to nothing is left as it is.
        let [top, left, bottom, right] = if cut[0] < cut[2] && cut[1] < cut[3] { cut } else { shown };
        channels.into_iter().map(|channel| channel.slice(s![top..bottom, left..right]).to_owned()).collect()
    }
}

/// The variance of a sample, `scale` × x + `offset`, of light x that is 1 at saturation (`NoiseProfile`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DngNoise {
    /// The variance a unit of light: one over the electrons at saturation.
    pub scale: f64,
    /// The variance in the dark.
    pub offset: f64,
}

/// The least of variance that counts a unit of light; noise is none for wells beyond a thousand million electrons.
const LEAST_SCALE: f64 = 1e-9;

impl DngNoise {
    fn of_samples(self) -> SampleNoise {
        let electrons_per_unit = 1.0 / self.scale.max(LEAST_SCALE);
        SampleNoise::Frame { electrons_per_unit, floor_e: self.offset.max(0.0).sqrt() * electrons_per_unit }
    }
}

impl CameraProfile for DngProfile {
    fn n_channels(&self) -> usize {
        self.filter_names.len()
    }

    fn filter_name(&self, channel: usize) -> &str {
        &self.filter_names[channel]
    }

    fn white_response(&self, light: &Illuminant) -> Vec<f64> {
        match &self.color {
            Some(color) => color.neutral_of(light.chromaticity()),
            None => vec![1.0; self.filter_names.len()],
        }
    }

    fn fitted_matrix(&self, color: &ColorCorrection, balance: &[f64], _: f64) -> Result<ColorMatrix, SensorError> {
        let Some(matrices) = &self.color else { return Ok(ColorMatrix::identity(self.filter_names.len())) };
        let neutral = match color {
            ColorCorrection::AutoUnder(light) | ColorCorrection::Fitted(light) => {
                matrices.neutral_of(light.chromaticity())
            }
            _ => balance.iter().map(|gain| 1.0 / gain).collect(),
        };
        let unsuitable = || SensorError::Unsuitable {
            what: "the color matrix of the file",
            reason: "has no inverse, expected one, or color: None".to_owned(),
        };
        matrices.matrix(&neutral).ok_or_else(unsuitable)
    }

    /// The largest of all filters.
    fn noise_floor(&self, _: &Raw) -> f64 {
        self.noise.iter().map(|noise| noise.offset.max(0.0).sqrt()).fold(0.0, f64::max)
    }

    /// Next to none where it is not known.
    fn sample_noise(&self, _: &Raw) -> Vec<SampleNoise> {
        let none = DngNoise { scale: LEAST_SCALE, offset: 0.0 };
        let of = |filter: usize| self.noise.get(filter).or(self.noise.first()).copied().unwrap_or(none);
        (0..self.filter_names.len()).map(|filter| of(filter).of_samples()).collect()
    }

    fn corrected(&self, channels: Vec<Array2<f32>>, balance: &[f64]) -> Vec<Array2<f32>> {
        match &self.corrections {
            Some(corrections) => corrections.apply(channels, balance),
            None => channels,
        }
    }
}

impl DngProfile {
    /// Refuses what a file does not hold.
    pub(super) fn check_processing(&self, processing: &Processing) -> Result<(), SensorError> {
        let refused = |what, reason: &str| Err(SensorError::Unsuitable { what, reason: reason.to_owned() });
        let has_colors = self.color.is_some() || self.filter_names.len() == 1;
        let is_known = |white: &WhiteBalance| has_colors || !matches!(white, WhiteBalance::Light(_));
        match &processing.color {
            ColorCorrection::Roots | ColorCorrection::FittedRoots(_) => {
                refused("color: Roots", "needs quantum efficiencies, which a DNG file does not hold, expected Auto")
            }
            ColorCorrection::Auto | ColorCorrection::AutoUnder(_) | ColorCorrection::Fitted(_) if !has_colors => {
                refused("color", "needs color matrices, which the file does not have, expected None or Matrix")
            }
            _ if !is_known(&processing.white) => {
                refused("white", "of a light needs color matrices, which the file does not have, expected GrayWorld")
            }
            _ if self.noise.is_empty() && processing.denoise.is_some_and(|strength| strength > 0.0) => refused(
                "denoise",
                "needs the noise of the frame, of which the file has none (NoiseProfile), expected 0",
            ),
            _ => Ok(()),
        }
    }
}
