//! Squares of the film and the knots around them.

use std::collections::BTreeMap;

use dioptric_psf::FilmMap;
use glam::DVec2;

use crate::{geometry::FilmFrame, rectangle::Rectangle};

/// A point of the film at which the PSF is computed: pixels of the film to the right of the axis and below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Knot {
    pub(crate) right: i32,
    pub(crate) down: i32,
}

impl Knot {
    /// Returns the knot nearest to a place of the film, mm from its middle, to the right and upwards.
    pub(crate) fn nearest(place_mm: DVec2, pitch_mm: f64) -> Self {
        let place = (place_mm / pitch_mm).round();
        Self { right: place.x as i32, down: -place.y as i32 }
    }

    /// Returns the field at the knot, of pixels of the film.
    pub(crate) fn field_tan(self, map: &FilmMap, pitch_mm: f64) -> DVec2 {
        map.field_tan(DVec2::new(f64::from(self.right), -f64::from(self.down)) * pitch_mm)
    }
}

/// A square of the film, which may reach beyond its edges: `across` and `down` sides from the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Cell {
    pub(crate) down: i32,
    pub(crate) across: i32,
    /// Length of a side, pixels of the film; even.
    pub(crate) size: usize,
}

/// Cells are not halved below this size, pixels.
pub(crate) const SMALLEST: usize = 16;

impl Cell {
    /// The knot of the cell, at its middle.
    pub(crate) fn knot(&self) -> Knot {
        let (size, half) = (self.size as i32, (self.size / 2) as i32);
        Knot { right: self.across * size + half, down: self.down * size + half }
    }

    /// Returns its corners: row by row.
    pub(crate) fn corners(&self) -> [Knot; 4] {
        let corner = |down: i32, across: i32| {
            let size = self.size as i32;
            Knot { right: (self.across + across) * size, down: (self.down + down) * size }
        };
        [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)]
    }

    /// Whether a place is in it or on its edges.
    pub(crate) fn holds(&self, place: Knot) -> bool {
        let size = self.size as i32;
        let is_along = |cell: i32, place: i32| (cell * size..=(cell + 1) * size).contains(&place);
        is_along(self.down, place.down) && is_along(self.across, place.right)
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
        self.is_divisible_to(SMALLEST)
    }

    /// Whether it may be halved to cells of no less than a size, pixels of the film.
    pub(crate) fn is_divisible_to(&self, size: usize) -> bool {
        self.size / 2 >= size.max(SMALLEST) && self.size.is_multiple_of(4)
    }

    /// The pixels of a raster whose centers lie in the cell: none of wide ones may.
    pub(crate) fn pixels(&self, frame: &FilmFrame) -> Rectangle {
        let (center_row, center_column) = frame.center();
        let size = self.size_in(frame);
        let first = |place: i32, center: f64| (f64::from(place) * size + center).ceil() as i64;
        let (first_row, first_column) = (first(self.down, center_row), first(self.across, center_column));
        Rectangle {
            first_row,
            first_column,
            rows: (first(self.down + 1, center_row) - first_row) as usize,
            columns: (first(self.across + 1, center_column) - first_column) as usize,
        }
    }

    /// Returns the length of a side in pixels of a raster.
    pub(crate) fn size_in(&self, frame: &FilmFrame) -> f64 {
        self.size as f64 / frame.factor() as f64
    }

    /// Returns how far a pixel's center lies below and to the right of the middle, in parts of the cell.
    pub(crate) fn place_of(&self, frame: &FilmFrame, row: i64, column: i64) -> (f64, f64) {
        let (center_row, center_column) = frame.center();
        let size = self.size_in(frame);
        (
            (row as f64 - center_row) / size - f64::from(self.down) - 0.5,
            (column as f64 - center_column) / size - f64::from(self.across) - 0.5,
        )
    }
}

/// Nine numbers for the products of polynomials, down × across, row by row: what a function over a cell is made of.
pub(crate) type Products = [f32; 9];

/// What is 1 all over a cell.
pub(crate) const ONE: Products = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Returns the three polynomials at u, parts of a cell from its middle.
pub(crate) fn polynomials(u: f32) -> [f32; 3] {
    [1.0, u, u * u - 1.0 / 12.0]
}

/// Returns a function over a cell where the polynomials have these values.
pub(crate) fn value_of(products: &Products, down: &[f32; 3], across: &[f32; 3]) -> f32 {
    (0..3).map(|i| down[i] * (0..3).map(|j| products[3 * i + j] * across[j]).sum::<f32>()).sum()
}

/// The largest magnitude of each polynomial within a cell.
pub(crate) const LARGEST: [f64; 3] = [1.0, 0.5, 1.0 / 6.0];

/// Knots, each with its share of the products of polynomials.
pub(crate) type Shares = Vec<(Knot, Products)>;

/// The patches around one whose weights of knots are smoothed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Around {
    /// Numbers of those of the same raster that it touches, and its own.
    pub(crate) patches: Vec<u32>,
    /// Whether they surround it, and have all their knots on their raster.
    pub(crate) is_whole: bool,
}

/// A cell, and how the kernels of knots around it make up those of its samples, as far as these kernels are on one raster.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Patch {
    pub(crate) cell: Cell,
    /// Whether it is spread together with those around it, knot by knot.
    pub(crate) is_by_knots: bool,
    /// The patches around it, if the weights of knots are smoothed over it and them.
    pub(crate) around: Option<Around>,
    /// The knots with kernels on this raster.
    pub(crate) shares: Shares,
    /// Those with kernels on rasters of other factors, and these factors.
    pub(crate) elsewhere: Vec<(usize, Shares)>,
}

impl Patch {
    /// Returns the patches of a cell, one for each factor of the rasters that the kernels of its knots are on.
    pub(crate) fn by_factor(cell: Cell, shares: Shares, factor_of: impl Fn(Knot) -> usize) -> Vec<(usize, Self)> {
        let mut by_factor: BTreeMap<usize, Shares> = BTreeMap::new();
        for share in shares {
            by_factor.entry(factor_of(share.0)).or_default().push(share);
        }
        let elsewhere = |own: usize| {
            let others = by_factor.iter().filter(|(factor, _)| **factor != own);
            others.map(|(factor, shares)| (*factor, shares.clone())).collect()
        };
        let patch = |(&factor, shares): (&usize, &Shares)| {
            (
                factor,
                Self { cell, is_by_knots: false, around: None, shares: shares.clone(), elsewhere: elsewhere(factor) },
            )
        };
        by_factor.iter().map(patch).collect()
    }

    /// Returns the sum of the weights of its knots on this raster: 1, but for the weights of those elsewhere.
    pub(crate) fn total(&self) -> Products {
        if self.elsewhere.is_empty() {
            return ONE;
        }
        std::array::from_fn(|i| self.shares.iter().map(|(_, shares)| shares[i]).sum())
    }

    /// The bytes of memory that it takes.
    pub(crate) fn size_bytes(&self) -> usize {
        let of = |shares: &Shares| size_of_val(shares.as_slice());
        let beside = self.around.as_ref().map_or(0, |around| size_of_val(around.patches.as_slice()));
        size_of::<Self>()
            + beside
            + of(&self.shares)
            + self.elsewhere.iter().map(|(_, shares)| of(shares)).sum::<usize>()
    }
}
