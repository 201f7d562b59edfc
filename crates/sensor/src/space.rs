//! The primaries of a picture.

use dioptric_pictures::CodeSpace;
use serde::{Deserialize, Serialize};

use crate::SensorError;

/// The primaries in which a picture is coded; white is D65 in all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ColorSpace {
    /// sRGB, those of ITU-R BT.709.
    #[default]
    Srgb,
    /// Display P3.
    DisplayP3,
}

/// Linear Display P3 from linear sRGB, both with a white of D65: from their primaries' chromaticities.
const P3_FROM_SRGB: [[f32; 3]; 3] =
    [[0.822_461_96, 0.177_538_04, 0.0], [0.033_194_2, 0.966_805_8, 0.0], [0.017_082_63, 0.072_397_44, 0.910_519_93]];

/// Linear sRGB from linear Display P3: the inverse of [`P3_FROM_SRGB`].
const SRGB_FROM_P3: [[f32; 3]; 3] = [
    [1.224_940_2, -0.224_940_18, 0.0],
    [-0.042_056_955, 1.042_056_9, 0.0],
    [-0.019_637_555, -0.078_636_05, 1.098_273_6],
];

impl ColorSpace {
    /// Returns linear sRGB of linear light in these primaries; what lies outside its gamut is below 0 or above 1.
    #[inline]
    pub fn to_linear_srgb(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Srgb => rgb,
            Self::DisplayP3 => SRGB_FROM_P3.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]),
        }
    }

    /// Reads `srgb` or `display-p3`.
    ///
    /// # Errors
    /// When the text is neither.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        match text.to_ascii_lowercase().as_str() {
            "srgb" => Ok(Self::Srgb),
            "display-p3" => Ok(Self::DisplayP3),
            _ => Err(SensorError::Word {
                what: "the primaries",
                found: text.to_owned(),
                expected: "srgb, display-p3".to_owned(),
            }),
        }
    }

    /// Returns what files of pictures say of them.
    pub fn of_file(self) -> CodeSpace {
        match self {
            Self::Srgb => CodeSpace::Srgb,
            Self::DisplayP3 => CodeSpace::DisplayP3,
        }
    }

    /// Returns linear light in these primaries, of linear sRGB.
    #[inline]
    pub fn from_linear_srgb(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Srgb => rgb,
            Self::DisplayP3 => P3_FROM_SRGB.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::Xyz;

    #[test]
    fn primaries_there_and_back_are_the_same() {
        for rgb in [[0.2, 0.5, 0.9], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3]] {
            let back = ColorSpace::DisplayP3.to_linear_srgb(ColorSpace::DisplayP3.from_linear_srgb(rgb));
            assert!(back.iter().zip(rgb).all(|(a, b)| (a - b).abs() < 2e-6), "{back:?}");
        }
    }

    #[test]
    fn white_stays_and_the_primaries_of_p3_are_its_own() {
        for value in ColorSpace::DisplayP3.from_linear_srgb([1.0; 3]) {
            assert!((value - 1.0).abs() < 1e-6);
        }
        // Display P3: red (0.680, 0.320), green (0.265, 0.690), blue (0.150, 0.060). Linear sRGB of each, by its
        // chromaticity, must give that primary alone.
        for (index, (x, y)) in [(0.680, 0.320), (0.265, 0.690), (0.150, 0.060)].into_iter().enumerate() {
            let rgb = Xyz([x / y, 1.0, (1.0 - x - y) / y]).to_linear_srgb();
            let p3 = ColorSpace::DisplayP3.from_linear_srgb(rgb.map(|v| v as f32));
            for (i, value) in p3.iter().enumerate() {
                assert!(i == index || value.abs() < 1e-3 * p3[index], "{index}: {p3:?}");
            }
        }
    }
}
