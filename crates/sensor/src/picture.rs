//! Pictures as they are shown.

use ndarray::Array3;

/// A picture of red, green and blue codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Codes of 0–1: rows × columns × (red, green, blue).
    pub codes: Array3<f32>,
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

    /// Returns 8-bit codes, row by row, red, green, blue.
    pub fn to_rgb8(&self) -> Vec<u8> {
        self.codes.iter().map(|&code| (code.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
    }

    /// Returns 16-bit codes, row by row, red, green, blue.
    pub fn to_rgb16(&self) -> Vec<u16> {
        self.codes.iter().map(|&code| (code.clamp(0.0, 1.0) * 65535.0).round() as u16).collect()
    }
}
