//! Light on 12 megapixels in 31 bands.

use std::borrow::Cow;

use dioptric_spectrum::{Bands, Quantity, SpectrumError, WavelengthGrid};
use ndarray::Array2;

/// Rows of pixels.
pub(crate) const ROWS: usize = 3024;
/// Columns of pixels.
pub(crate) const COLUMNS: usize = 4032;

/// 31 bands that share four planes, so that the input does not fill the memory.
pub(crate) struct FourPlanes {
    grid: WavelengthGrid,
    planes: Vec<Array2<f32>>,
}

impl FourPlanes {
    pub(crate) fn new() -> Self {
        let plane = |b: usize| {
            Array2::from_shape_fn((ROWS, COLUMNS), |(r, c)| 1e-4 * (20.0 + ((r + b * c) as f32 * 0.01).sin() * 19.0))
        };
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).expect("a valid range");
        Self { grid, planes: (0..4).map(plane).collect() }
    }
}

impl Bands for FourPlanes {
    fn quantity(&self) -> Quantity {
        Quantity::Irradiance
    }
    fn grid(&self) -> &WavelengthGrid {
        &self.grid
    }
    fn size(&self) -> (usize, usize) {
        (ROWS, COLUMNS)
    }
    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        Ok(Cow::Borrowed(&self.planes[band % 4]))
    }
}
