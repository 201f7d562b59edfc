//! Pictures as they are shown.

use ndarray::{Array3, Axis};

use crate::{ColorSpace, ToneCurve};

/// A picture of red, green and blue codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Codes of 0–1: rows × columns × (red, green, blue).
    pub codes: Array3<f32>,
    /// The primaries of the codes.
    pub space: ColorSpace,
}

impl Picture {
    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.codes.dim().0
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.codes.dim().1
    }

    /// Returns the codes of one pixel.
    pub fn rgb_at(&self, row: usize, column: usize) -> [f32; 3] {
        [0, 1, 2].map(|i| self.codes[(row, column, i)])
    }

    /// Returns the light that the codes stand for, linear sRGB, where they were made with this tone curve; rows × columns × 3.
    pub fn linear_srgb(&self, curve: ToneCurve) -> Array3<f32> {
        let mut light = self.codes.mapv(|code| curve.decode(f64::from(code)) as f32);
        for mut rgb in light.lanes_mut(Axis(2)) {
            let own = self.space.to_linear_srgb([rgb[0], rgb[1], rgb[2]]);
            rgb.iter_mut().zip(own).for_each(|(place, value)| *place = value);
        }
        light
    }

    /// Returns the picture turned as a number of Exif's `Orientation` says, 1 to 8; others leave it as it is.
    #[must_use]
    pub fn oriented(self, orientation: usize) -> Self {
        let mut codes = self.codes;
        if matches!(orientation, 5..=8) {
            codes.swap_axes(0, 1);
        }
        if matches!(orientation, 2 | 3 | 6 | 7) {
            codes.invert_axis(Axis(1));
        }
        if matches!(orientation, 3 | 4 | 7 | 8) {
            codes.invert_axis(Axis(0));
        }
        Self { codes: codes.as_standard_layout().into_owned(), space: self.space }
    }

    /// Returns 8-bit codes, row by row, red, green, blue.
    pub fn to_rgb8(&self) -> Vec<u8> {
        self.codes.iter().map(|&code| (code.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
    }

    /// Returns 16-bit codes, row by row, red, green, blue.
    pub fn to_rgb16(&self) -> Vec<u16> {
        self.codes.iter().map(|&code| (code.clamp(0.0, 1.0) * 65535.0).round() as u16).collect()
    }
}
