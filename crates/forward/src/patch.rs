//! Squares of the film and the knots around them.

use dioptric_psf::FilmMap;
use glam::DVec2;

use crate::geometry::FilmFrame;

/// A point of the film at which the PSF is computed: pixels to the right of the axis and below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Knot {
    pub(crate) right: i32,
    pub(crate) down: i32,
}

impl Knot {
    /// Returns the field at the knot.
    pub(crate) fn field_tan(self, map: &FilmMap, pitch_mm: f64) -> DVec2 {
        map.field_tan(DVec2::new(f64::from(self.right), -f64::from(self.down)) * pitch_mm)
    }
}

/// A square of the film, which may reach beyond its edges: `across` and `down` sides from the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Cell {
    pub(crate) down: i32,
    pub(crate) across: i32,
    /// Length of a side, pixels; even.
    pub(crate) size: usize,
}

/// Cells are not halved below this size, pixels.
const SMALLEST: usize = 16;

impl Cell {
    /// The knot of the cell, at its middle.
    pub(crate) fn knot(&self) -> Knot {
        let (size, half) = (self.size as i32, (self.size / 2) as i32);
        Knot { right: self.across * size + half, down: self.down * size + half }
    }

    /// Returns the cell so many places below and to the right.
    pub(crate) fn beside(&self, down: i32, across: i32) -> Self {
        Self { down: self.down + down, across: self.across + across, size: self.size }
    }

    pub(crate) fn parent(&self) -> Self {
        Self { down: self.down.div_euclid(2), across: self.across.div_euclid(2), size: 2 * self.size }
    }

    pub(crate) fn children(&self) -> [Self; 4] {
        let child =
            |down, across| Self { down: 2 * self.down + down, across: 2 * self.across + across, size: self.size / 2 };
        [child(0, 0), child(0, 1), child(1, 0), child(1, 1)]
    }

    /// Whether it may be halved: its quarters need a knot on whole pixels.
    pub(crate) fn is_divisible(&self) -> bool {
        self.size / 2 >= SMALLEST && self.size.is_multiple_of(4)
    }

    /// The row and column of the first pixel whose center lies in the cell.
    pub(crate) fn first_pixel(&self, frame: &FilmFrame) -> (i64, i64) {
        let (center_row, center_column) = frame.center();
        let size = self.size as f64;
        (
            (f64::from(self.down) * size + center_row).ceil() as i64,
            (f64::from(self.across) * size + center_column).ceil() as i64,
        )
    }

    /// Returns how far a pixel's center lies below and to the right of the middle, in parts of the cell.
    pub(crate) fn place_of(&self, frame: &FilmFrame, row: i64, column: i64) -> (f64, f64) {
        let (center_row, center_column) = frame.center();
        let size = self.size as f64;
        (
            (row as f64 - center_row) / size - f64::from(self.down) - 0.5,
            (column as f64 - center_column) / size - f64::from(self.across) - 0.5,
        )
    }
}

/// Returns the three polynomials at u, parts of a cell from its middle.
pub(crate) fn polynomials(u: f32) -> [f32; 3] {
    [1.0, u, u * u - 1.0 / 12.0]
}

/// The largest magnitude of each polynomial within a cell.
pub(crate) const LARGEST: [f64; 3] = [1.0, 0.5, 1.0 / 6.0];

/// A cell, and how the kernels of knots around it make up those of its samples.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Patch {
    pub(crate) cell: Cell,
    /// Whether it is spread together with those around it, knot by knot.
    pub(crate) is_by_knots: bool,
    /// The knots that take part, each with its share of the nine products of polynomials: down × across, row by row.
    pub(crate) shares: Vec<(Knot, [f32; 9])>,
}
