//! Tiles of the film, between whose corners kernels are interpolated.

use crate::{
    Film,
    raster::{Level, Raster},
    rectangle::Rectangle,
    symmetry::{Mirror, Node, Symmetry},
};

/// A square of the film: its upper left corner and its side, pixels from the film's middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Tile {
    pub(crate) right: i32,
    pub(crate) down: i32,
    pub(crate) size: i32,
}

impl Tile {
    /// Returns the tiles of a size that cover a film.
    pub(crate) fn over(film: &Film, size: i32) -> Vec<Self> {
        let reach = |n: usize| (n as i32).div_euclid(2 * size) + 1;
        let (rows, columns) = (reach(film.rows), reach(film.columns));
        let all = (-rows..rows).flat_map(|down| (-columns..columns).map(move |right| (right, down)));
        let tile = |(right, down)| Self { right: right * size, down: down * size, size };
        all.map(tile).filter(|tile| tile.pixels(film).is_some()).collect()
    }

    /// The corners: upper left, upper right, lower left, lower right.
    pub(crate) fn corners(&self) -> [Node; 4] {
        let Self { right, down, size } = *self;
        [(0, 0), (size, 0), (0, size), (size, size)].map(|(x, y)| Node { right: right + x, down: down + y })
    }

    pub(crate) fn center(&self) -> Node {
        Node { right: self.right + self.size / 2, down: self.down + self.size / 2 }
    }

    pub(crate) fn quarters(&self) -> [Self; 4] {
        let size = self.size / 2;
        [(0, 0), (size, 0), (0, size), (size, size)].map(|(x, y)| Self {
            right: self.right + x,
            down: self.down + y,
            size,
        })
    }

    /// Returns the mirror image of the tile among those that mirror each other whose kernels are computed, and what takes this one to it.
    pub(crate) fn canonical(&self, symmetry: Symmetry) -> (Self, Mirror) {
        let center = self.center();
        let Node { right, down } = symmetry.canonical(center);
        let half = self.size / 2;
        (Self { right: right - half, down: down - half, size: self.size }, symmetry.mirror(center))
    }

    /// Returns the pixels of the film with their middles in the tile, counted from the film's middle; `None` if there are none.
    pub(crate) fn pixels(&self, film: &Film) -> Option<Rectangle> {
        let pixels = Raster::new(film, Level::PIXEL);
        let before = |px: i32| f64::from(px) - 1e-6;
        let row = |px: i32| pixels.row_before(before(px)) + 1;
        let column = |px: i32| pixels.column_before(before(px)) + 1;
        let (first_row, first_column) = (row(self.down), column(self.right));
        let at = Rectangle {
            first_row,
            first_column,
            rows: (row(self.down + self.size) - first_row) as usize,
            columns: (column(self.right + self.size) - first_column) as usize,
        };
        at.intersection(&film_pixels(film))
    }
}

/// Tiles that mirror each other: one set of kernels serves them all.
#[derive(Debug)]
pub(crate) struct TileGroup {
    pub(crate) level: Level,
    pub(crate) canonical: Tile,
    /// Those with anything to gather, and what takes each to the canonical one.
    pub(crate) members: Vec<(Tile, Mirror)>,
}

/// Returns the pixels of a film, counted from its middle.
pub(crate) fn film_pixels(film: &Film) -> Rectangle {
    let first = |n: usize| -((n / 2) as i64);
    let (first_row, first_column) = (first(film.rows), first(film.columns));
    Rectangle { first_row, first_column, rows: film.rows, columns: film.columns }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_the_film_once() {
        for (rows, columns) in [(100, 151), (128, 64), (1, 1), (33, 300)] {
            let film = Film::centered(rows, columns, 1.0);
            let all = film_pixels(&film);
            let mut hits = vec![0; rows * columns];
            for tile in Tile::over(&film, 32) {
                let pixels = tile.pixels(&film).unwrap();
                for row in 0..pixels.rows {
                    let first = pixels.offset_in(&all) + row * columns;
                    hits[first..first + pixels.columns].iter_mut().for_each(|hit| *hit += 1);
                }
            }
            assert!(hits.iter().all(|&hit| hit == 1));
        }
    }

    #[test]
    fn mirror_images_share_a_canonical_tile() {
        let tile = Tile { right: 64, down: -32, size: 32 };
        for (right, down) in [(64, 0), (-96, 0), (-96, -32), (0, 64), (-32, 64), (0, -96), (-32, -96)] {
            assert_eq!(Tile { right, down, size: 32 }.canonical(Symmetry::Octants).0, tile, "{right} {down}");
        }
        assert_eq!(tile.canonical(Symmetry::None).0, tile);
    }
}
