//! A frame with its border mirrored, and blocks of it.

use ndarray::Array2;

/// A part of a frame with a margin, row by row; beyond the frame it is mirrored about the outermost pixels, which
/// keeps the phase of a 2 × 2 mosaic.
pub(super) struct Block {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

impl Block {
    /// Returns `rows` × `columns` pixels from (`row`, `column`) on, with a margin on all sides.
    pub(super) fn cut(
        frame: &Array2<f32>,
        (row, column): (usize, usize),
        (rows, columns): (usize, usize),
        margin: usize,
    ) -> Self {
        let (n_rows, n_columns) = frame.dim();
        let width = columns + 2 * margin;
        let mut values = Vec::with_capacity(width * (rows + 2 * margin));
        let places = mirrored_places(column, columns, margin, n_columns);
        for r in mirrored_places(row, rows, margin, n_rows) {
            let from = frame.row(r);
            values.extend(places.iter().map(|&c| from[c]));
        }
        Self { width, values }
    }
}

/// Returns the places in 0..n of `n_cut` places from `first` on with a margin on both sides, mirrored as a block is.
pub(super) fn mirrored_places(first: usize, n_cut: usize, margin: usize, n: usize) -> Vec<usize> {
    (0..n_cut + 2 * margin).map(|i| mirrored(first + i, margin, n)).collect()
}

/// Returns the place in 0..n of place `shifted` − `margin`, mirrored about 0 and n − 1; n is at least 2.
fn mirrored(shifted: usize, margin: usize, n: usize) -> usize {
    let period = 2 * (n - 1);
    // The multiple of the period that is added makes the difference positive.
    let place = (shifted + period * margin.div_ceil(period) - margin) % period;
    place.min(period - place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_is_mirrored_without_repeating_the_edge() {
        let places: Vec<usize> = (0..12).map(|shifted| mirrored(shifted, 4, 5)).collect();
        assert_eq!(places, [4, 3, 2, 1, 0, 1, 2, 3, 4, 3, 2, 1]);
        assert!((0..20).all(|shifted| mirrored(shifted, 9, 2) == (shifted + 1) % 2));
    }

    #[test]
    fn a_block_is_a_part_of_the_frame() {
        let frame = Array2::from_shape_fn((4, 5), |(r, c)| (10 * r + c) as f32);
        let block = Block::cut(&frame, (1, 2), (2, 2), 1);
        assert_eq!(block.width, 4);
        assert_eq!(block.values, [1., 2., 3., 4., 11., 12., 13., 14., 21., 22., 23., 24., 31., 32., 33., 34.]);
    }
}
