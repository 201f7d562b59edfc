//! The samples of a frame by their place in the tile of its mosaic.

use ndarray::Array2;
use rayon::prelude::*;

use crate::Tile;

/// Returns one plane for each place of the tile, row by row, or the planes of stacked filters as they are.
///
/// A tile that hangs over the edge of the frame takes its missing samples from the tile before it.
pub(crate) fn split(planes: &[Array2<f32>], tile: Option<&Tile>) -> Vec<Array2<f32>> {
    let Some(tile) = tile else { return planes.to_vec() };
    let frame = &planes[0];
    let (n_rows, n_columns) = frame.dim();
    let size = (n_rows.div_ceil(tile.rows()), n_columns.div_ceil(tile.columns()));
    let inside =
        |place: usize, period: usize, n: usize| if place < n { place } else { place.saturating_sub(period).min(n - 1) };
    (0..tile.rows() * tile.columns())
        .into_par_iter()
        .map(|phase| {
            let columns: Vec<usize> = (0..size.1)
                .map(|c| inside(c * tile.columns() + phase % tile.columns(), tile.columns(), n_columns))
                .collect();
            let mut plane = Array2::zeros(size);
            for (r, mut line) in plane.outer_iter_mut().enumerate() {
                let from = frame.row(inside(r * tile.rows() + phase / tile.columns(), tile.rows(), n_rows));
                line.iter_mut().zip(&columns).for_each(|(value, &c)| *value = from[c]);
            }
            plane
        })
        .collect()
}

/// Returns the planes of a frame of so many rows and columns from those of [`split`].
pub(crate) fn join(phases: Vec<Array2<f32>>, tile: Option<&Tile>, size: (usize, usize)) -> Vec<Array2<f32>> {
    let Some(tile) = tile else { return phases };
    let mut frame = Array2::zeros(size);
    frame.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
        for (column, value) in line.iter_mut().enumerate() {
            let phase = (row % tile.rows()) * tile.columns() + column % tile.columns();
            *value = phases[phase][(row / tile.rows(), column / tile.columns())];
        }
    });
    vec![frame]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cfa;

    #[test]
    fn splitting_and_joining_changes_nothing() {
        let tile = Cfa::two_by_two("RGGB").unwrap().resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        let frame = Array2::from_shape_fn((5, 7), |(r, c)| (10 * r + c) as f32);
        let phases = split(std::slice::from_ref(&frame), Some(&tile));
        assert_eq!((phases.len(), phases[3].dim()), (4, (3, 4)));
        // Blue's last row and column lie outside and are those before.
        assert_eq!((phases[3][(0, 0)], phases[3][(2, 3)]), (11.0, 35.0));
        assert_eq!(join(phases, Some(&tile), (5, 7)), [frame]);
    }
}
