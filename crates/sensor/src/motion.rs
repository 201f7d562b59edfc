//! Irradiance that has moved on the sensor.

use std::borrow::Cow;

use dioptric_spectrum::{Bands, Quantity, SpectrumError, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;

/// An irradiance image moved by a fraction of its samples, as between two frames of a camera that is held by hand.
///
/// Samples are interpolated by cubic splines through them (Keys, "Cubic convolution interpolation for digital image processing",
/// IEEE Transactions on Acoustics, Speech and Signal Processing 29, 1981), cut at 0; beyond the image its outermost samples go on.
#[derive(Clone, Copy)]
pub struct Moved<'a> {
    /// The image at rest.
    pub irradiance: &'a dyn Bands,
    /// How far its content moves, samples: down, to the right.
    pub shift_px: [f64; 2],
}

impl Bands for Moved<'_> {
    fn quantity(&self) -> Quantity {
        self.irradiance.quantity()
    }

    fn grid(&self) -> &WavelengthGrid {
        self.irradiance.grid()
    }

    fn size(&self) -> (usize, usize) {
        self.irradiance.size()
    }

    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        let still = self.irradiance.band(band)?;
        if self.shift_px == [0.0; 2] {
            return Ok(still);
        }
        let [down, right] = self.shift_px;
        Ok(Cow::Owned(
            moved_down(&moved_down(&still, down).reversed_axes(), right)
                .reversed_axes()
                .as_standard_layout()
                .into_owned(),
        ))
    }
}

fn moved_down(plane: &Array2<f32>, shift: f64) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    // The sample at row r is that which was at r − shift.
    let whole = (-shift).floor();
    let taps = keys(-shift - whole);
    let from = |row: usize, tap: usize| {
        (row as isize + whole as isize + tap as isize - 1).clamp(0, rows as isize - 1) as usize
    };
    let mut moved = Array2::<f32>::zeros((rows, columns));
    moved.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
        taps.iter().enumerate().for_each(|(tap, &weight)| line.scaled_add(weight, &plane.row(from(row, tap))));
        line.mapv_inplace(|v| v.max(0.0));
    });
    moved
}

/// Returns the weights of the samples before, at, after and two after a place that lies a fraction behind a sample.
pub(crate) fn keys(t: f64) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)]
        .map(|w| w as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::SpectralImage;

    #[test]
    fn a_parabola_moves_exactly() {
        let height = |r: f64, c: f64| 9.0 + 0.02 * (r - 8.0).powi(2) - 0.01 * (c - 10.0).powi(2);
        let plane = Array2::from_shape_fn((20, 24), |(r, c)| height(r as f64, c as f64) as f32);
        let grid = WavelengthGrid::uniform(500.0, 510.0, 10.0).unwrap();
        let image = SpectralImage::new(Quantity::Irradiance, grid, vec![plane.clone(), plane]).unwrap();
        let shift_px = [2.3, -1.6];
        let moved = Moved { irradiance: &image, shift_px };
        let band = moved.band(1).unwrap();
        // Cubic convolution is exact for parabolas, away from the border.
        for (r, c) in [(6, 5), (10, 10), (15, 18)] {
            let want = height(r as f64 - shift_px[0], c as f64 - shift_px[1]);
            assert!((f64::from(band[(r, c)]) - want).abs() < 1e-5, "{r} {c}");
        }
    }
}
