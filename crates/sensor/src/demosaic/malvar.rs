//! Malvar, He & Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images",
//! ICASSP 2004: bilinear interpolation with a Laplacian of the pixel's own color added.

use ndarray::Array2;
use rayon::prelude::*;

use super::padded::Block;
use crate::Bayer;

/// Half the width of the filters.
const MARGIN: usize = 2;

pub(super) fn demosaic(values: &Array2<f32>, bayer: Bayer, n_channels: usize) -> Vec<Array2<f32>> {
    let (n_rows, n_columns) = values.dim();
    let mut channels = vec![Array2::<f32>::zeros((n_rows, n_columns)); n_channels];
    let mut rows: Vec<Vec<&mut [f32]>> = (0..n_rows).map(|_| Vec::with_capacity(n_channels)).collect();
    for channel in &mut channels {
        let all = channel.as_slice_mut().expect("a new array is contiguous");
        all.chunks_mut(n_columns).zip(&mut rows).for_each(|(chunk, row)| row.push(chunk));
    }
    rows.into_par_iter().enumerate().for_each(|(row, mut out)| {
        let block = Block::cut(values, (row, 0), (1, n_columns), MARGIN);
        let (own, other) = (bayer.other_of_row(row), bayer.other_of_row(row + 1));
        (0..n_columns).for_each(|column| {
            let at = Neighbors::new(&block, column);
            if bayer.is_green(row, column) {
                out[bayer.green][column] = at.center;
                // The other color of this row lies left and right, that of the next rows above and below.
                out[own][column] = at.beside_green(at.left_right, at.left_right_2, at.up_down_2);
                out[other][column] = at.beside_green(at.up_down, at.up_down_2, at.left_right_2);
            } else {
                let far = at.left_right_2 + at.up_down_2;
                out[own][column] = at.center;
                out[bayer.green][column] = (4.0 * at.center + 2.0 * (at.left_right + at.up_down) - far) / 8.0;
                out[other][column] = (6.0 * at.center + 2.0 * at.diagonal - 1.5 * far) / 8.0;
            }
        });
    });
    channels
}

/// Sums of the neighbors of a pixel.
struct Neighbors {
    center: f32,
    left_right: f32,
    up_down: f32,
    left_right_2: f32,
    up_down_2: f32,
    diagonal: f32,
}

impl Neighbors {
    fn new(block: &Block, column: usize) -> Self {
        let at = |row: usize, column: usize| block.values[row * block.width + column];
        let c = column + MARGIN;
        Self {
            center: at(2, c),
            left_right: at(2, c - 1) + at(2, c + 1),
            up_down: at(1, c) + at(3, c),
            left_right_2: at(2, c - 2) + at(2, c + 2),
            up_down_2: at(0, c) + at(4, c),
            diagonal: at(1, c - 1) + at(1, c + 1) + at(3, c - 1) + at(3, c + 1),
        }
    }

    /// Returns the color whose samples lie next to a green pixel: `near` on both sides, and green two pixels away
    /// along and across that direction.
    fn beside_green(&self, near: f32, along_2: f32, across_2: f32) -> f32 {
        (5.0 * self.center + 4.0 * near - along_2 - self.diagonal + 0.5 * across_2) / 8.0
    }
}
