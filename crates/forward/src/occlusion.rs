//! Layers laid one behind the other until every pixel is covered.

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::{Array2, Zip};

/// A blurred layer: its light and its cover, and the part of each row that it touches.
pub(crate) struct BlurredLayer {
    light: Array2<f32>,
    cover: Array2<f32>,
    touched: Vec<(usize, usize)>,
}

impl BlurredLayer {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        let zeros = || Array2::zeros((rows, columns));
        Self { light: zeros(), cover: zeros(), touched: vec![(columns, 0); rows] }
    }

    /// Adds a part of a row of light and of cover, the latter where it is wanted.
    pub(crate) fn add_row(&mut self, row: usize, first_column: usize, light: &[f32], cover: Option<&[f32]>) {
        let add = |plane: &mut Array2<f32>, values: &[f32]| {
            let mut line = plane.row_mut(row);
            let line = line.as_slice_mut().expect("planes are in standard order");
            for (sum, value) in line[first_column..][..values.len()].iter_mut().zip(values) {
                *sum += value;
            }
        };
        add(&mut self.light, light);
        if let Some(cover) = cover {
            add(&mut self.cover, cover);
        }
        let (start, end) = &mut self.touched[row];
        *start = (*start).min(first_column);
        *end = (*end).max(first_column + light.len());
    }

    /// Wipes the layer for the next.
    fn clear(&mut self) {
        let columns = self.light.ncols();
        for (row, (start, end)) in self.touched.iter_mut().enumerate() {
            for plane in [&mut self.light, &mut self.cover] {
                if let Some(line) = plane.row_mut(row).as_slice_mut() {
                    line[*start..(*end).max(*start)].fill(0.0);
                }
            }
            (*start, *end) = (columns, 0);
        }
    }
}

/// The picture so far, and the share of each pixel that no layer has covered yet.
///
/// "Saturating coverage": a layer may add cover until a pixel is full, and adds light in proportion. A continuous
/// surface that spans many layers covers each pixel just once, so that no seams show.
pub(crate) struct Composite {
    light: Array2<f32>,
    uncovered: Array2<f32>,
}

/// A pixel with less cover than this, which is rounding error of the transforms, has none.
const LEAST_COVER: f32 = 1e-5;

impl Composite {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        Self { light: Array2::zeros((rows, columns)), uncovered: Array2::ones((rows, columns)) }
    }

    /// Lays a layer behind those before it, and wipes it.
    pub(crate) fn composite_under(&mut self, layer: &mut BlurredLayer, cancel: &Cancel) -> Result<(), Cancelled> {
        for (row, &(start, end)) in layer.touched.iter().enumerate() {
            cancel.check()?;
            for column in start..end {
                let cover = layer.cover[(row, column)];
                let uncovered = &mut self.uncovered[(row, column)];
                if cover <= 0.0 || *uncovered <= 0.0 {
                    continue;
                }
                let taken = cover.min(*uncovered);
                self.light[(row, column)] += layer.light[(row, column)] * (taken / cover);
                *uncovered -= taken;
            }
        }
        layer.clear();
        Ok(())
    }

    /// Adds a layer's light as if it hid nothing, and wipes it.
    pub(crate) fn add(&mut self, layer: &mut BlurredLayer) {
        self.light += &layer.light;
        layer.clear();
    }

    /// Returns the picture, each pixel scaled to full cover.
    pub(crate) fn finish(self) -> Array2<f32> {
        let mut light = self.light;
        Zip::from(&mut light).and(&self.uncovered).for_each(|light, &uncovered| {
            let covered = 1.0 - uncovered;
            *light = if covered > LEAST_COVER { (*light / covered).max(0.0) } else { 0.0 };
        });
        light
    }

    /// Returns the sum of the light that was added.
    pub(crate) fn finish_sum(self) -> Array2<f32> {
        self.light.mapv_into(|light| light.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(light: f32, cover: f32) -> BlurredLayer {
        let mut layer = BlurredLayer::new(1, 1);
        layer.add_row(0, 0, &[light], Some(&[cover]));
        layer
    }

    fn composite(layers: &[(f32, f32)]) -> f32 {
        let mut picture = Composite::new(1, 1);
        for &(light, cover) in layers {
            picture.composite_under(&mut layer(light, cover), &Cancel::new()).unwrap();
        }
        picture.finish()[(0, 0)]
    }

    #[test]
    fn full_cover_hides_what_is_behind() {
        assert_eq!(composite(&[(3.0, 1.0), (7.0, 1.0)]), 3.0);
    }

    #[test]
    fn half_cover_lets_half_of_what_is_behind_through() {
        assert_eq!(composite(&[(0.5 * 3.0, 0.5), (7.0, 1.0)]), 5.0);
    }

    #[test]
    fn a_surface_in_two_layers_covers_once() {
        assert_eq!(composite(&[(0.4 * 3.0, 0.4), (0.6 * 3.0, 0.6), (9.0, 0.5)]), 3.0);
    }

    #[test]
    fn a_thin_cover_is_scaled_to_a_full_one() {
        assert!((composite(&[(0.9 * 3.0, 0.9)]) - 3.0).abs() < 1e-6);
        assert_eq!(composite(&[]), 0.0);
    }
}
