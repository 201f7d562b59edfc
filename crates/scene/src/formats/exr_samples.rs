//! How samples are stored in OpenEXR files.

use std::{path::Path, str::FromStr};

use dioptric_spectrum::Quantity;
use exr::prelude::{Compression, FlatSamples, SampleType, f16};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::unusable::unwritable;
use crate::SceneError;

/// The largest half float.
const LARGEST_HALF: f32 = 65_504.0;

/// How the samples of an EXR file are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ExrSamples {
    /// Single floats, compressed without loss.
    #[default]
    Single,
    /// Half floats, compressed: a quarter of the size or less. A sample is off by at most .049 % of itself; one below a millionth of the largest,
    /// by at most 5e-10 of that. Light is in kW, W, mW, µW, nW or pW, whichever fits the largest sample. Depths of scenes and samples that half
    /// floats cannot hold, above 65504, stay single floats.
    Half,
    /// Single floats as they are: the quickest to write.
    Uncompressed,
}

impl FromStr for ExrSamples {
    type Err = SceneError;

    fn from_str(text: &str) -> Result<Self, SceneError> {
        let found = Self::NAMES.iter().find(|(name, _)| *name == text);
        found.map(|(_, samples)| *samples).ok_or_else(|| SceneError::Setting {
            what: "the way EXR files hold their samples",
            value: format!("'{text}'"),
            expected: Self::NAMES.map(|(name, _)| name).join(", "),
        })
    }
}

impl ExrSamples {
    /// Every choice with its name on the command line.
    pub const NAMES: [(&'static str, Self); 3] =
        [("single", Self::Single), ("half", Self::Half), ("uncompressed", Self::Uncompressed)];

    /// Of the methods without loss, wavelets (PIZ) make irradiance smallest: 75 % of its size where ZIP makes 94 %, and 24 % as half floats.
    pub(super) fn compression(self) -> Compression {
        match self {
            Self::Single | Self::Half => Compression::PIZ,
            Self::Uncompressed => Compression::Uncompressed,
        }
    }

    /// Returns how samples of a quantity, up to `largest`, are stored.
    pub(super) fn layout(self, quantity: Quantity, largest: f32) -> Stored {
        const POWERS: [(&str, f32); 6] =
            [("pW", 1e12), ("nW", 1e9), ("uW", 1e6), ("mW", 1e3), ("W", 1.0), ("kW", 1e-3)];
        let below = match quantity {
            Quantity::Radiance => ".m^-2.sr^-1",
            Quantity::Irradiance => ".m^-2",
            Quantity::Reflectance => return self.plain(largest),
        };
        let fits = |factor: f32| (LARGEST_HALF * 1e-3..=LARGEST_HALF).contains(&(largest * factor));
        let fitting = match self {
            Self::Half if largest > 0.0 => POWERS.into_iter().find(|&(_, factor)| fits(factor)),
            Self::Half => Some(("W", 1.0)),
            Self::Single | Self::Uncompressed => None,
        };
        let (power, factor) = fitting.unwrap_or(("W", 1.0));
        let unit = StoredUnit { text: Some(format!("{power}{below}")), factor };
        Stored { unit, is_half: fitting.is_some() }
    }

    /// Returns how numbers that are no light are stored.
    pub(super) fn plain(self, largest: f32) -> Stored {
        let is_half = self == Self::Half && largest <= LARGEST_HALF;
        Stored { unit: StoredUnit { text: None, factor: 1.0 }, is_half }
    }
}

/// The unit of samples in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StoredUnit {
    /// As its header states it; `None` for what has no unit.
    pub(super) text: Option<String>,
    /// What makes samples in watts those of the file.
    factor: f32,
}

/// How samples lie in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stored {
    pub(super) unit: StoredUnit,
    is_half: bool,
}

impl Stored {
    /// Single floats that are no light.
    pub(super) fn single() -> Self {
        ExrSamples::Single.plain(0.0)
    }

    pub(super) fn sample_type(&self) -> SampleType {
        if self.is_half { SampleType::F16 } else { SampleType::F32 }
    }

    fn half(&self, sample: f32) -> f16 {
        f16::from_f32(sample * self.unit.factor)
    }

    /// Returns the samples of a channel.
    pub(super) fn samples<'a>(&self, samples: impl Iterator<Item = &'a f32>) -> FlatSamples {
        if self.is_half {
            FlatSamples::F16(samples.map(|&sample| self.half(sample)).collect())
        } else {
            FlatSamples::F32(samples.copied().collect())
        }
    }

    /// Adds samples to a block of native bytes.
    pub(super) fn append(&self, samples: &[f32], block: &mut Vec<u8>) {
        if self.is_half {
            block.extend(samples.iter().flat_map(|&sample| self.half(sample).to_ne_bytes()));
        } else {
            block.extend(samples.iter().flat_map(|sample| sample.to_ne_bytes()));
        }
    }
}

/// Checks that the plane of a channel has as many rows and columns as the file.
pub(super) fn check_size(
    path: &Path,
    name: &str,
    plane: &Array2<f32>,
    (rows, columns): (usize, usize),
) -> Result<(), SceneError> {
    if plane.dim() == (rows, columns) {
        return Ok(());
    }
    let (found_rows, found_columns) = plane.dim();
    let reason = format!("channel '{name}' has {found_rows} × {found_columns} samples, expected {rows} × {columns}");
    Err(unwritable(path, reason))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_keep_three_digits_of_any_light() {
        for largest in [2e-9, 3.1e-7, 1e-4, 0.065, 0.066, 1.0, 66.0, 3e4, 1e6, 6e7] {
            let stored = ExrSamples::Half.layout(Quantity::Irradiance, largest);
            assert!(stored.is_half, "{largest}");
            for k in 0..200 {
                let sample = largest * 0.933_f32.powi(k);
                let found = f32::from(stored.half(sample)) / stored.unit.factor;
                assert!((found - sample).abs() <= 0.0005 * sample, "{sample} of {largest} became {found}");
            }
            let faint = 1e-9 * largest;
            let found = f32::from(stored.half(faint)) / stored.unit.factor;
            assert!((found - faint).abs() <= 5e-10 * largest, "{found} of {largest}");
        }
    }

    #[test]
    fn what_half_floats_cannot_hold_stays_single() {
        assert!(!ExrSamples::Half.layout(Quantity::Radiance, 1e9).is_half);
        assert!(!ExrSamples::Half.layout(Quantity::Radiance, 1e-12).is_half);
        assert!(!ExrSamples::Half.plain(1e5).is_half && ExrSamples::Half.plain(6e4).is_half);
        let dark = ExrSamples::Half.layout(Quantity::Radiance, 0.0);
        assert!(dark.is_half && dark.unit.text.as_deref() == Some("W.m^-2.sr^-1"));
        let single = ExrSamples::Single.layout(Quantity::Irradiance, 1e-9);
        assert!(!single.is_half && single.unit.text.as_deref() == Some("W.m^-2") && single.unit.factor == 1.0);
        assert_eq!(ExrSamples::Half.layout(Quantity::Reflectance, 1.0).unit.text, None);
    }
}
