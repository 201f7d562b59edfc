//! The search for the layers that blocks of pixels may have a part of.

use dioptric_psf::FilmMap;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::{Array2, Axis, parallel::prelude::*};

use crate::{
    block_layers::{BLOCK, BlockLayers},
    patch::Cell,
    sampler::{LayerCoordinates, Sampler},
};

/// Samples of the scene around a block that count as its own: maps are curved.
const SLACK: f64 = 2.0;

/// Rows and columns of the scene, first and last, as numbers that need not be whole.
#[derive(Clone, Copy)]
struct Box2 {
    rows: (f64, f64),
    columns: (f64, f64),
}

impl Box2 {
    const EMPTY: Self = Self { rows: (f64::MAX, f64::MIN), columns: (f64::MAX, f64::MIN) };

    fn take(&mut self, (row, column): (f64, f64)) {
        self.rows = (self.rows.0.min(row), self.rows.1.max(row));
        self.columns = (self.columns.0.min(column), self.columns.1.max(column));
    }
}

impl BlockLayers {
    /// Finds the layers over the rectangle that cells lie in; `maps` are those at the ends of all that is imaged.
    pub(crate) fn find(
        sampler: &Sampler,
        cells: &[Cell],
        maps: &[FilmMap],
        surfaces: &[&LayerCoordinates],
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let pixels = || cells.iter().map(|cell| cell.pixels(&sampler.frame));
        let first =
            (pixels().map(|at| at.first_row).min().unwrap_or(0), pixels().map(|at| at.first_column).min().unwrap_or(0));
        let n_blocks = |end: i64, first: i64| ((end - first) as usize).div_ceil(BLOCK);
        let last_row = pixels().map(|at| at.first_row + at.rows as i64).max().unwrap_or(0);
        let last_column = pixels().map(|at| at.first_column + at.columns as i64).max().unwrap_or(0);
        let size = (n_blocks(last_row, first.0), n_blocks(last_column, first.1));
        let mut ranges = Array2::from_elem(size, (u16::MAX, 0));
        let edge = |first: i64, block: usize| first as f64 - 0.5 + (BLOCK * block) as f64;
        ranges.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each(|(row, mut line)| {
            cancel.check()?;
            let places = |row: usize| -> Vec<Vec<Option<(f64, f64)>>> {
                let place = |map: &FilmMap, column: usize| {
                    let (tan, _) = map.at(sampler.frame.place_mm(edge(first.0, row), edge(first.1, column)))?;
                    Some(sampler.scene.view.position_of(tan.x, tan.y))
                };
                maps.iter().map(|map| (0..=size.1).map(|column| place(map, column)).collect()).collect()
            };
            let (above, below) = (places(row), places(row + 1));
            for (column, range) in line.iter_mut().enumerate() {
                let (mut all, mut widest, mut is_seen) = (Box2::EMPTY, (0.0_f64, 0.0_f64), true);
                for (above, below) in above.iter().zip(&below) {
                    let mut own = Box2::EMPTY;
                    for place in [above[column], above[column + 1], below[column], below[column + 1]] {
                        is_seen &= place.is_some();
                        place.into_iter().for_each(|place| own.take(place));
                    }
                    all.take((own.rows.0, own.columns.0));
                    all.take((own.rows.1, own.columns.1));
                    widest = (widest.0.max(own.rows.1 - own.rows.0), widest.1.max(own.columns.1 - own.columns.0));
                }
                if !is_seen {
                    // At the end of what the lens sees.
                    *range = (0, u16::MAX);
                    continue;
                }
                for surface in surfaces {
                    let (low, high) = range_in(surface, &all, widest);
                    *range = (range.0.min(low), range.1.max(high));
                }
            }
            Ok(())
        })?;
        Ok(Self { first, ranges })
    }
}

/// Returns the first and last layer of a surface in a box and around it: by as much more as its places at several ends lie apart,
/// since those between may lie beyond.
fn range_in(surface: &LayerCoordinates, all: &Box2, widest: (f64, f64)) -> (u16, u16) {
    let (rows, columns) = surface.samples().dim();
    let span = |(low, high): (f64, f64), widest: f64, n: usize| {
        let (slack, last) = (SLACK + 0.25 * (high - low - widest), (n - 1) as f64);
        (low - slack).floor().clamp(0.0, last) as usize..(high + slack).ceil().clamp(0.0, last) as usize + 1
    };
    let across = span(all.columns, widest.1, columns);
    let mut range = (u16::MAX, 0);
    for row in span(all.rows, widest.0, rows) {
        for &(first, last) in &surface.ranges_of_row(row)[across.clone()] {
            range = (range.0.min(first), range.1.max(last));
        }
    }
    range
}

#[cfg(test)]
mod tests {
    use dioptric_psf::LensImage;
    use dioptric_scene::View;

    use super::*;
    use crate::{DiscLens, Film, active::cells_over, rectangle::Rectangle};

    /// What is passed over has nothing: sampled with and without the blocks, a layer is the same to the bit.
    #[test]
    fn samples_passed_over_are_empty() {
        let (film, size) = (Film::centered(40, 56, 10.0), (90, 110));
        let lens = DiscLens { focal_mm: 50.0, ..DiscLens::default() };
        let map = lens.film_map(0.5, 550.0, 2.0);
        let view = View { focal_px: 9000.0, center_x_px: 54.5, center_y_px: 44.5 };
        let sampler = Sampler::new((view, size), (&film, 1), &map, 16);
        let cancel = Cancel::new();
        let coordinate = |(row, column): (usize, usize)| match (row / 20 + column / 30) % 3 {
            0 => 0.25,
            1 => 3.5,
            _ => 7.0,
        };
        let depths = LayerCoordinates::new(Array2::from_shape_fn(size, coordinate), &cancel).unwrap();
        let blocks =
            BlockLayers::find(&sampler, &cells_over(&film, 8, 32), std::slice::from_ref(&map), &[&depths], &cancel)
                .unwrap();
        let surfaces = [depths.surface(None)];
        let rectangle = Rectangle { first_row: -6, first_column: -9, rows: 52, columns: 70 };
        let mut n_passed = 0;
        for layer in 0..8 {
            let sampled =
                |blocks: &BlockLayers| sampler.sample(rectangle, &map, layer, &surfaces, blocks, &cancel).unwrap();
            let everything = BlockLayers::of_everything();
            assert_eq!(sampled(&blocks), sampled(&everything), "{layer}");
            let row = blocks.of_row(10).unwrap();
            n_passed += (0..56).filter(|column| !row.may_have(*column, layer)).count();
        }
        assert!(n_passed > 200, "{n_passed}");
        // A surface at the two ends of the layers only has others between them nowhere but at its edges.
        assert!(!blocks.of_row(10).unwrap().may_have(20, 5));
        assert!(blocks.of_row(-1000).is_none() && blocks.of_row(10).unwrap().may_have(-1000, 5));
    }
}
