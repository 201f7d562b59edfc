//! Layers laid one behind the other until every pixel is covered.

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::{Array2, Zip};

/// A blurred layer: its light and its alpha, and the part of each row that it touches.
pub(crate) struct BlurredLayer {
    light: Array2<f32>,
    alpha: Array2<f32>,
    touched: Vec<(usize, usize)>,
}

impl BlurredLayer {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        let zeros = || Array2::zeros((rows, columns));
        Self { light: zeros(), alpha: zeros(), touched: vec![(columns, 0); rows] }
    }

    /// Adds a part of a row of light and of alpha, the latter where it is wanted.
    pub(crate) fn add_row(&mut self, row: usize, first_column: usize, light: &[f32], alpha: Option<&[f32]>) {
        let add = |plane: &mut Array2<f32>, values: &[f32]| {
            let mut line = plane.row_mut(row);
            let line = line.as_slice_mut().expect("planes are in standard order");
            for (sum, value) in line[first_column..][..values.len()].iter_mut().zip(values) {
                *sum += value;
            }
        };
        add(&mut self.light, light);
        if let Some(alpha) = alpha {
            add(&mut self.alpha, alpha);
        }
        let (start, end) = &mut self.touched[row];
        *start = (*start).min(first_column);
        *end = (*end).max(first_column + light.len());
    }

    /// Adds a layer on pixels `factor` times as wide, about the same middle, interpolated between their centers.
    pub(crate) fn add_magnified(&mut self, coarse: &Self, factor: usize, cancel: &Cancel) -> Result<(), Cancelled> {
        let (rows, columns) = self.light.dim();
        let (coarse_rows, coarse_columns) = coarse.light.dim();
        // A pixel's place among those of the coarse layer: the first of two, and the share of the second.
        let place = |index: usize, n: usize, n_coarse: usize| {
            let at = (index as f64 - 0.5 * (n as f64 - 1.0)) / factor as f64 + 0.5 * (n_coarse as f64 - 1.0);
            let first = (at as usize).min(n_coarse - 2);
            (first, (at - first as f64) as f32)
        };
        let across: Vec<(usize, f32)> = (0..columns).map(|column| place(column, columns, coarse_columns)).collect();
        let line = |plane: &Array2<f32>, (top, down): (usize, f32)| -> Vec<f32> {
            let between = |&(left, right): &(usize, f32)| {
                let at = |row: usize| plane[(row, left)] + right * (plane[(row, left + 1)] - plane[(row, left)]);
                at(top) + down * (at(top + 1) - at(top))
            };
            across.iter().map(between).collect()
        };
        for row in 0..rows {
            cancel.check()?;
            let at = place(row, rows, coarse_rows);
            let (light, alpha) = (line(&coarse.light, at), line(&coarse.alpha, at));
            self.add_row(row, 0, &light, Some(&alpha));
        }
        Ok(())
    }

    /// Wipes the layer for the next.
    fn clear(&mut self) {
        let columns = self.light.ncols();
        for (row, (start, end)) in self.touched.iter_mut().enumerate() {
            for plane in [&mut self.light, &mut self.alpha] {
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
/// "Saturating coverage": a layer may add alpha until a pixel is full, and adds light in proportion. A continuous
/// surface that spans many layers covers each pixel just once, so that no seams show.
pub(crate) struct Composite {
    light: Array2<f32>,
    uncovered: Array2<f32>,
}

/// A pixel with less alpha than this, which is rounding error of the transforms, has none.
const LEAST_ALPHA: f32 = 1e-5;

impl Composite {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        Self { light: Array2::zeros((rows, columns)), uncovered: Array2::ones((rows, columns)) }
    }

    /// Lays a layer behind those before it, and wipes it.
    pub(crate) fn composite_under(&mut self, layer: &mut BlurredLayer, cancel: &Cancel) -> Result<(), Cancelled> {
        for (row, &(start, end)) in layer.touched.iter().enumerate() {
            cancel.check()?;
            for column in start..end {
                let alpha = layer.alpha[(row, column)];
                let uncovered = &mut self.uncovered[(row, column)];
                if alpha <= 0.0 || *uncovered <= 0.0 {
                    continue;
                }
                let taken = alpha.min(*uncovered);
                self.light[(row, column)] += layer.light[(row, column)] * (taken / alpha);
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

    /// Returns the picture, each pixel scaled to full alpha.
    pub(crate) fn finish(self) -> Array2<f32> {
        let mut light = self.light;
        Zip::from(&mut light).and(&self.uncovered).for_each(|light, &uncovered| {
            let covered = 1.0 - uncovered;
            *light = if covered > LEAST_ALPHA { (*light / covered).max(0.0) } else { 0.0 };
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

    fn layer(light: f32, alpha: f32) -> BlurredLayer {
        let mut layer = BlurredLayer::new(1, 1);
        layer.add_row(0, 0, &[light], Some(&[alpha]));
        layer
    }

    fn composite(layers: &[(f32, f32)]) -> f32 {
        let mut picture = Composite::new(1, 1);
        for &(light, alpha) in layers {
            picture.composite_under(&mut layer(light, alpha), &Cancel::new()).unwrap();
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
