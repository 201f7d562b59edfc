//! Color differences along edges (Pekkucuksen & Altunbasak, ICIP 2010), block by block.
//!
//! The green − red and green − blue differences are smooth where the colors themselves are not. They are estimated
//! along rows and along columns, averaged over four pixels to the north, south, west and east, and these four are
//! mixed by how little the differences change that way. Beside saturated colors the differences are not smooth
//! either, so every estimate is held to the values of its neighbors.

use ndarray::Array2;
use rayon::prelude::*;

use super::padded::Block;
use crate::Bayer;

/// How far a pixel looks: 2 (interpolation) + 1 (gradient) + 4 (window) + 3 (diagonal filter) + 1 (green pixels).
const MARGIN: usize = 12;
/// Rows and columns of a block; even, so that all blocks have the same phase, and small enough for the cache.
const BLOCK: (usize, usize) = (128, 256);
/// Keeps the weights finite where nothing changes: far below one digital number of a frame of 0 … 1.
const LEAST_GRADIENT: f32 = 1e-6;

/// How the estimates of four directions are mixed.
#[derive(Clone, Copy)]
pub(super) struct Mixing {
    /// Pixels of each direction that are averaged, at most 5: more are less noisy, fewer keep finer colors.
    pub(super) n_averaged: usize,
    /// The power of the change by which a direction counts less.
    pub(super) exponent: i32,
}

/// Returns one plane a channel, mixed as in the paper.
pub(super) fn demosaic(values: &Array2<f32>, bayer: Bayer, n_channels: usize) -> Vec<Array2<f32>> {
    demosaic_mixing(values, bayer, n_channels, Mixing { n_averaged: 5, exponent: 2 })
}

/// Returns one plane a channel.
pub(super) fn demosaic_mixing(
    values: &Array2<f32>,
    bayer: Bayer,
    n_channels: usize,
    mixing: Mixing,
) -> Vec<Array2<f32>> {
    let (n_rows, n_columns) = values.dim();
    let mut channels = vec![Array2::<f32>::zeros((n_rows, n_columns)); n_channels];
    let mut strips: Vec<Vec<&mut [f32]>> = (0..n_rows.div_ceil(BLOCK.0)).map(|_| Vec::new()).collect();
    for channel in &mut channels {
        let all = channel.as_slice_mut().expect("a new array is contiguous");
        all.chunks_mut(BLOCK.0 * n_columns).zip(&mut strips).for_each(|(chunk, strip)| strip.push(chunk));
    }
    strips.into_par_iter().enumerate().for_each_init(Planes::default, |planes, (number, mut out)| {
        let first_row = number * BLOCK.0;
        let n_strip_rows = out[0].len() / n_columns;
        for first_column in (0..n_columns).step_by(BLOCK.1) {
            let size = (n_strip_rows, BLOCK.1.min(n_columns - first_column));
            let block = Block::cut(values, (first_row, first_column), size, MARGIN);
            planes.fill(&block, bayer, mixing);
            for row in 0..size.0 {
                let from = (row + MARGIN) * block.width + MARGIN;
                let to = row * n_columns + first_column;
                for (channel, plane) in
                    [(bayer.green, &planes.green), (bayer.in_even_rows, &planes.even), (bayer.in_odd_rows, &planes.odd)]
                {
                    out[channel][to..to + size.1].copy_from_slice(&plane[from..from + size.1]);
                }
            }
        }
    });
    channels
}

/// The planes of one block, kept from block to block.
#[derive(Default)]
struct Planes {
    /// Green minus the other color of the row or column, estimated along rows and along columns.
    along_rows: Vec<f32>,
    along_columns: Vec<f32>,
    /// How much these change along their direction, summed over five pixels across it.
    change_along_rows: Vec<f32>,
    change_along_columns: Vec<f32>,
    scratch: Vec<f32>,
    /// Green minus the other color, at the pixels of the other colors.
    difference: Vec<f32>,
    green: Vec<f32>,
    even: Vec<f32>,
    odd: Vec<f32>,
}

impl Planes {
    fn fill(&mut self, block: &Block, bayer: Bayer, mixing: Mixing) {
        self.estimate_differences(block, bayer);
        self.sum_changes(block.width);
        self.mix_directions(block, bayer, mixing);
        self.other_colors(block, bayer);
    }

    /// Estimates green minus the other color at each pixel, along rows and along columns.
    fn estimate_differences(&mut self, block: &Block, bayer: Bayer) {
        let (v, w) = (&block.values, block.width);
        for plane in [&mut self.along_rows, &mut self.along_columns] {
            plane.clear();
            plane.resize(v.len(), 0.0);
        }
        // The missing color is the mean of the neighbors plus half the curvature of the pixel's own color.
        let estimate = |i: usize, step: usize| {
            let own = v[i];
            let missing = 0.5 * (v[i - step] + v[i + step]) + 0.25 * (2.0 * own - v[i - 2 * step] - v[i + 2 * step]);
            missing - own
        };
        for row in 2..v.len() / w - 2 {
            for column in 2..w - 2 {
                let i = row * w + column;
                let sign = if bayer.is_green(row, column) { -1.0 } else { 1.0 };
                self.along_rows[i] = sign * estimate(i, 1);
                self.along_columns[i] = sign * estimate(i, w);
            }
        }
    }

    /// Sums how much the differences change over five pixels across their direction.
    fn sum_changes(&mut self, w: usize) {
        let n = self.along_rows.len();
        for (changes, plane, step, across) in [
            (&mut self.change_along_rows, &self.along_rows, 1, w),
            (&mut self.change_along_columns, &self.along_columns, w, 1),
        ] {
            self.scratch.clear();
            self.scratch.resize(n, 0.0);
            for i in step..n - step {
                self.scratch[i] = (plane[i - step] - plane[i + step]).abs();
            }
            changes.clear();
            changes.resize(n, 0.0);
            let s = &self.scratch;
            for i in 2 * across..n - 2 * across {
                changes[i] = s[i - 2 * across] + s[i - across] + s[i] + s[i + across] + s[i + 2 * across];
            }
        }
    }

    /// Mixes the means of the four directions into one difference, and gives green.
    fn mix_directions(&mut self, block: &Block, bayer: Bayer, mixing: Mixing) {
        let (v, w) = (&block.values, block.width);
        let Mixing { n_averaged, exponent } = mixing;
        let share = 1.0 / n_averaged as f32;
        self.difference.clear();
        self.difference.resize(v.len(), 0.0);
        self.green.clone_from(v);
        for row in 7..v.len() / w - 7 {
            // Greens alternate along a row: the first pixel of another color, then every second.
            let first = 7 + usize::from(bayer.is_green(row, 7));
            for column in (first..w - 7).step_by(2) {
                let i = row * w + column;
                let (mut sum, mut weights) = (0.0, 0.0);
                for (plane, changes, step) in [
                    (&self.along_rows, &self.change_along_rows, 1),
                    (&self.along_columns, &self.change_along_columns, w),
                ] {
                    let five = |first: usize| {
                        let c = changes;
                        c[first] + c[first + step] + c[first + 2 * step] + c[first + 3 * step] + c[first + 4 * step]
                    };
                    for (first_change, first) in [(i - 4 * step, i - (n_averaged - 1) * step), (i, i)] {
                        let weight = (five(first_change) + LEAST_GRADIENT).powi(exponent).recip();
                        let estimates: f32 = (0..n_averaged).map(|k| plane[first + k * step]).sum();
                        sum += weight * share * estimates;
                        weights += weight;
                    }
                }
                let same = [v[i - 2], v[i + 2], v[i - 2 * w], v[i + 2 * w]];
                let near = [v[i - 1], v[i + 1], v[i - w], v[i + w]];
                self.green[i] = held(v[i] + sum / weights, near, v[i], same);
                self.difference[i] = self.green[i] - v[i];
            }
        }
    }

    /// Gives the other two colors from green and the differences.
    fn other_colors(&mut self, block: &Block, bayer: Bayer) {
        let (v, w) = (&block.values, block.width);
        let d = &self.difference;
        for plane in [&mut self.even, &mut self.odd] {
            plane.clear();
            plane.resize(v.len(), 0.0);
        }
        for row in 11..v.len() / w - 11 {
            // The color of this row's own pixels, and that of the rows above and below.
            let (own, other) =
                if row % 2 == 0 { (&mut self.even, &mut self.odd) } else { (&mut self.odd, &mut self.even) };
            for column in 11..w - 11 {
                let i = row * w + column;
                let g = &self.green;
                let (beside, across) = ([i - 1, i + 1], [i - w, i + w]);
                let corners = [i - w - 1, i - w + 1, i + w - 1, i + w + 1];
                if bayer.is_green(row, column) {
                    // Both neighbors along the row are of this row's color; above and below lie the other's.
                    let (left, right) = (d[i - 1], d[i + 1]);
                    let (above, below) = (d[i - w], d[i + w]);
                    let row_difference = 0.25 * (left + right + diagonal(d, i - w, w) + diagonal(d, i + w, w));
                    let column_difference = 0.25 * (above + below + diagonal(d, i - 1, w) + diagonal(d, i + 1, w));
                    own[i] = held(v[i] - row_difference, beside.map(|j| v[j]), v[i], beside.map(|j| g[j]));
                    other[i] = held(v[i] - column_difference, across.map(|j| v[j]), v[i], across.map(|j| g[j]));
                } else {
                    own[i] = v[i];
                    other[i] = held(g[i] - diagonal(d, i, w), corners.map(|j| v[j]), g[i], corners.map(|j| g[j]));
                }
            }
        }
    }
}

/// Holds an estimate of one color to the values of its neighbors.
///
/// It may leave their range only as far as `guide`, a color known here, is from the mean of its values there
/// (`guides`), and by less where the guide is the brighter color: an edge of a saturated color is no evidence of
/// colors that are absent.
#[inline]
fn held<const N: usize>(estimate: f32, neighbors: [f32; N], guide: f32, guides: [f32; N]) -> f32 {
    let mean = |values: &[f32; N]| values.iter().sum::<f32>() / N as f32;
    let low = neighbors.iter().copied().fold(f32::INFINITY, f32::min);
    let high = neighbors.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let level = (mean(&neighbors) / mean(&guides).max(LEAST_GRADIENT)).clamp(0.0, 1.0);
    let slack = level * (guide - mean(&guides)).abs();
    estimate.clamp(low - slack, high + slack)
}

/// Returns the other color's difference at a pixel of a non-green color, from the diagonals about it.
#[inline]
fn diagonal(d: &[f32], i: usize, w: usize) -> f32 {
    let near = d[i - w - 1] + d[i - w + 1] + d[i + w - 1] + d[i + w + 1];
    let far = d[i - 3 * w - 1]
        + d[i - 3 * w + 1]
        + d[i + 3 * w - 1]
        + d[i + 3 * w + 1]
        + d[i - w - 3]
        + d[i - w + 3]
        + d[i + w - 3]
        + d[i + w + 3];
    (10.0 * near - far) / 32.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const BAYER: Bayer = Bayer { green: 1, in_even_rows: 0, in_odd_rows: 2, green_first: false };

    /// Takes a mosaic of three planes and returns the largest error of each channel.
    fn worst_errors(planes: &[Array2<f32>; 3]) -> [f32; 3] {
        let channel = |(r, c): (usize, usize)| if BAYER.is_green(r, c) { BAYER.green } else { BAYER.other_of_row(r) };
        let mosaic = Array2::from_shape_fn(planes[0].dim(), |at| planes[channel(at)][at]);
        let found = demosaic(&mosaic, BAYER, 3);
        std::array::from_fn(|i| (&found[i] - &planes[i]).into_iter().map(f32::abs).fold(0.0, f32::max))
    }

    /// A disc of light of one level, with an edge whose width is about four times `softness_px`.
    fn disc(softness_px: f32) -> Array2<f32> {
        Array2::from_shape_fn((96, 96), |(r, c)| {
            let distance = (r as f32 - 47.3).hypot(c as f32 - 47.6) - 30.0;
            0.03 + 0.87 / (1.0 + (distance / softness_px).exp())
        })
    }

    #[test]
    fn no_dots_line_a_saturated_edge() {
        let ground = Array2::from_elem((96, 96), 0.03);
        for softness_px in [0.2, 0.5, 1.0] {
            for lit in 0..3 {
                let mut planes = [0; 3].map(|_| ground.clone());
                planes[lit] = disc(softness_px);
                let errors = worst_errors(&planes);
                // What is absent may at most double; estimates that are not held reach nine times its level.
                for absent in (0..3).filter(|&channel| channel != lit) {
                    assert!(errors[absent] < 0.03, "{softness_px} px, channel {lit} lit: {errors:?}");
                }
            }
        }
    }

    #[test]
    fn a_gray_edge_stays_sharp_and_gray() {
        // Of a step of 0.87: a twentieth of it where the edge is as sharp as pixels allow.
        for (softness_px, most) in [(0.2, 0.05), (0.5, 0.005), (1.0, 0.002)] {
            let gray = disc(softness_px);
            let errors = worst_errors(&[gray.clone(), gray.clone(), gray]);
            assert!(errors.iter().all(|&error| error < most), "{softness_px} px: {errors:?}");
        }
    }
}
