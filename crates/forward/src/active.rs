//! The cells of the film in which layers have anything.

use std::collections::BTreeSet;

use dioptric_psf::FilmMap;
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{Film, geometry::FilmFrame, patch::Cell};

/// Returns the cells of a film and of a border of `pad_px` around it.
pub(crate) fn cells_over(film: &Film, pad_px: usize, size: usize) -> Vec<Cell> {
    let reach = |n: usize| ((0.5 * n as f64 + pad_px as f64) / size as f64).ceil() as i32;
    let (columns, rows) = (reach(film.columns), reach(film.rows));
    (-rows..rows).flat_map(|down| (-columns..columns).map(move |across| Cell { down, across, size })).collect()
}

/// Cells are not joined to larger ones than this, pixels of the raster that their kernels are on.
pub(crate) const LARGEST_JOINED: usize = 512;

/// Returns the cells that hold these, at least as wide as a blur: of smaller ones, transforms are mostly border. `factor` is that of the
/// coarsest raster.
pub(crate) fn joined_for(blur_px: f64, factor: usize, mut cells: Vec<Cell>) -> Vec<Cell> {
    while cells.first().is_some_and(|cell| (cell.size as f64) < blur_px && 2 * cell.size <= LARGEST_JOINED * factor) {
        let parents: BTreeSet<Cell> = cells.iter().map(Cell::parent).collect();
        cells = parents.into_iter().collect();
    }
    cells
}

/// What the cells of a film see.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub(crate) view: &'a View,
    pub(crate) frame: &'a FilmFrame,
    /// How far pixels with centers in a cell reach beyond it, pixels of the film.
    pub(crate) margin_px: f64,
}

/// Returns, for each layer, the cells in which the scene has anything at its depth.
pub(crate) fn active_cells(
    cells: &[Cell],
    seen: Seen<'_>,
    maps: &[FilmMap],
    surfaces: &[&Array2<f32>],
    n_layers: usize,
    cancel: &Cancel,
) -> Result<Vec<Vec<Cell>>, Cancelled> {
    let found: Vec<Vec<bool>> = cells
        .par_iter()
        .map(|cell| {
            cancel.check()?;
            Ok(layers_in(cell, seen, maps, surfaces, n_layers))
        })
        .collect::<Result<_, Cancelled>>()?;
    let of_layer =
        |layer| cells.iter().zip(&found).filter(move |(_, found): &(_, &Vec<bool>)| found[layer]).map(|(&c, _)| c);
    Ok((0..n_layers).map(|layer| of_layer(layer).collect()).collect())
}

fn layers_in(cell: &Cell, seen: Seen<'_>, maps: &[FilmMap], surfaces: &[&Array2<f32>], n_layers: usize) -> Vec<bool> {
    const STEPS: usize = 4;
    let (rows, columns) = surfaces[0].dim();
    let (mut top, mut bottom, mut left, mut right) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
    let Seen { view, frame, margin_px } = seen;
    let pixels = cell.pixels(frame);
    let along = |first: i64, n: usize, k: usize| {
        first as f64 - 0.5 - margin_px + (n as f64 + 2.0 * margin_px) * k as f64 / STEPS as f64
    };
    for (map, k) in maps.iter().flat_map(|map| (0..(STEPS + 1) * (STEPS + 1)).map(move |k| (map, k))) {
        let place_mm = frame.place_mm(
            along(pixels.first_row, pixels.rows, k / (STEPS + 1)),
            along(pixels.first_column, pixels.columns, k % (STEPS + 1)),
        );
        let tan = map.field_tan(place_mm);
        let (row, column) = view.position_of(tan.x, tan.y);
        (top, bottom) = (top.min(row), bottom.max(row));
        (left, right) = (left.min(column), right.max(column));
    }
    // Beyond the edge the scene goes on in the dark at the depth of the edge; two samples of slack for curved maps.
    let clamp = |low: f64, high: f64, n: usize| {
        let last = (n - 1) as f64;
        (low.floor() - 2.0).clamp(0.0, last) as usize..=(high.ceil() + 2.0).clamp(0.0, last) as usize
    };
    let mut found = vec![false; n_layers];
    for row in clamp(top, bottom, rows) {
        for column in clamp(left, right, columns) {
            for surface in surfaces {
                let place = surface[(row, column)];
                if !place.is_nan() {
                    let below = place as usize;
                    found[below] = true;
                    found[(below + usize::from(place.fract() > 0.0)).min(n_layers - 1)] = true;
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rectangle::Rectangle;

    #[test]
    fn cells_cover_the_film_and_its_border_once() {
        for (rows, columns) in [(100, 151), (128, 64)] {
            let film = Film::centered(rows, columns, 1.0);
            let frame = FilmFrame::new(&film, 1);
            let mut hits = Array2::<u8>::zeros((rows + 20, columns + 20));
            for cell in cells_over(&film, 10, 32) {
                let Rectangle { first_row: row, first_column: column, .. } = cell.pixels(&frame);
                for r in row..row + 32 {
                    for c in column..column + 32 {
                        if let (Ok(r), Ok(c)) = (usize::try_from(r + 10), usize::try_from(c + 10))
                            && let Some(hit) = hits.get_mut((r, c))
                        {
                            *hit += 1;
                        }
                    }
                }
            }
            assert!(hits.iter().all(|&hit| hit == 1));
        }
    }
}
