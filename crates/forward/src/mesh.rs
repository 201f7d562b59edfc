//! Cells of several sizes over a layer, and the spline of kernels through their knots.
//!
//! Over a layer the kernel is a quadratic B-spline of the place on the film (docs/forward.md): each cell has a knot at its middle,
//! and the kernel at a place is a mean, with smooth weights that sum to 1, of those of the nine knots around it. Where that is
//! not near enough to the kernel of the lens, cells are halved and knots added; a coarser spline is a finer one as well
//! (Chaikin's subdivision), so cells of different size meet smoothly.

use std::collections::{BTreeMap, BTreeSet};

use crate::patch::{Cell, Knot, Shares};

/// Weights of three knots in a row at the middle of the second's cell.
const AT_MIDDLE: [f64; 3] = [0.125, 0.75, 0.125];

/// From the coefficients of three knots in a row to those of the polynomials 1, u and u² − 1/12 in the second's cell,
/// where u runs from −1/2 to 1/2.
const TO_POLYNOMIALS: [[f64; 3]; 3] = [[1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [-0.5, 0.0, 0.5], [0.5, -1.0, 0.5]];

/// A mesh of cells over a layer: those of one size, and halves of them where knots were added.
pub(crate) struct Mesh {
    pub(crate) size: usize,
    /// Smaller cells whose knot has a kernel of its own.
    pub(crate) added: BTreeSet<Cell>,
}

/// Knots with weights.
pub(crate) type Weights = BTreeMap<Knot, f64>;

impl Mesh {
    /// Returns the spline's coefficient at the knot of a cell: a kernel of its own, or what the coarser spline comes to.
    fn coefficient(&self, cell: &Cell) -> Weights {
        if cell.size == self.size || self.added.contains(cell) {
            return BTreeMap::from([(cell.knot(), 1.0)]);
        }
        // Three quarters of the coarser cell that it lies in, one of the next in its direction, each way.
        let parent = cell.parent();
        let toward = |place: i32| if place.rem_euclid(2) == 0 { -1 } else { 1 };
        let (down, across) = (toward(cell.down), toward(cell.across));
        let parents = [(0, 0, 9.0), (down, 0, 3.0), (0, across, 3.0), (down, across, 1.0)];
        let terms = parents.map(|(down, across, weight)| (parent.beside(down, across), weight / 16.0));
        self.sum(terms.into_iter())
    }

    /// Returns a weighted sum of coefficients.
    fn sum(&self, terms: impl Iterator<Item = (Cell, f64)>) -> Weights {
        let mut sum = Weights::new();
        for (cell, weight) in terms {
            for (knot, part) in self.coefficient(&cell) {
                *sum.entry(knot).or_default() += weight * part;
            }
        }
        sum
    }

    /// Returns the weights of knots in the kernel at the middle of a cell.
    pub(crate) fn at_middle(&self, cell: &Cell) -> Weights {
        self.sum(around(cell).map(|(cell, [down, across])| (cell, AT_MIDDLE[down] * AT_MIDDLE[across])))
    }

    /// Returns the weights of knots in the kernel at the corners of a cell.
    pub(crate) fn at_corners(&self, cell: &Cell) -> [Weights; 4] {
        [(-1, -1), (-1, 0), (0, -1), (0, 0)].map(|(down, across)| {
            let beside = [(0, 0), (0, 1), (1, 0), (1, 1)];
            self.sum(beside.into_iter().map(|(d, a)| (cell.beside(down + d, across + a), 0.25)))
        })
    }

    /// Returns the weights of knots in the kernel at a place in a cell that is whole, with its edges.
    pub(crate) fn at_place(&self, cell: &Cell, place: Knot) -> Weights {
        let weights = |place: i32, cell: i32, size: usize| {
            let u = f64::from(place) / size as f64 - f64::from(cell) - 0.5;
            [0.5 * (0.5 - u).powi(2), 0.75 - u * u, 0.5 * (0.5 + u).powi(2)]
        };
        let (down, across) = (weights(place.down, cell.down, cell.size), weights(place.right, cell.across, cell.size));
        let terms = around(cell).map(|(cell, [i, j])| (cell, down[i] * across[j]));
        self.sum(terms.filter(|(_, weight)| *weight != 0.0))
    }

    /// Whether knots were added whose weight is not zero all over a cell, so that it is no polynomial.
    fn is_divided(&self, cell: &Cell) -> bool {
        let quarter = cell.children()[0];
        let mut near = (-1..=2).flat_map(|down| (-1..=2).map(move |across| (down, across)));
        near.any(|(down, across)| self.added.contains(&quarter.beside(down, across)))
    }

    /// Puts a cell, or its parts, each with the shares of the knots around it, into `pieces`.
    pub(crate) fn pieces_of(&self, cell: Cell, pieces: &mut Vec<(Cell, Shares)>) {
        if cell.is_divisible() && self.is_divided(&cell) {
            cell.children().into_iter().for_each(|child| self.pieces_of(child, pieces));
            return;
        }
        let mut shares: BTreeMap<Knot, [f64; 9]> = BTreeMap::new();
        for (near, [down, across]) in around(&cell) {
            for (knot, part) in self.coefficient(&near) {
                let share = shares.entry(knot).or_default();
                for (i, share) in share.iter_mut().enumerate() {
                    *share += part * TO_POLYNOMIALS[i / 3][down] * TO_POLYNOMIALS[i % 3][across];
                }
            }
        }
        let shares = shares.into_iter().map(|(knot, share)| (knot, share.map(|s| s as f32))).collect();
        pieces.push((cell, shares));
    }
}

/// Returns a cell and those around it, each with its number down and across.
fn around(cell: &Cell) -> impl Iterator<Item = (Cell, [usize; 2])> {
    let cell = *cell;
    (0..9_usize).map(move |i| (cell.beside((i / 3) as i32 - 1, (i % 3) as i32 - 1), [i / 3, i % 3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patch::polynomials;

    /// A mesh of 64-pixel cells of which one is halved, and one of its quarters again.
    fn mesh() -> (Mesh, Vec<(Cell, Shares)>) {
        let marked = Cell { down: 0, across: 0, size: 64 };
        let again = marked.children()[3];
        let added = marked.children().into_iter().chain(again.children()).collect();
        let mesh = Mesh { size: 64, added };
        let mut pieces = vec![];
        for (down, across) in (-2..3).flat_map(|down| (-2..3).map(move |across| (down, across))) {
            mesh.pieces_of(Cell { down, across, size: 64 }, &mut pieces);
        }
        (mesh, pieces)
    }

    /// Returns the spline through values at knots, at a place in pixels below and to the right of the axis.
    fn spline(pieces: &[(Cell, Shares)], value_at: &dyn Fn(Knot) -> f64, down: f64, right: f64) -> f64 {
        let is_in = |(cell, _): &&(Cell, Shares)| {
            let size = cell.size as f64;
            let (u, v) = (right / size - f64::from(cell.across), down / size - f64::from(cell.down));
            (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)
        };
        let (cell, shares) = pieces.iter().find(is_in).unwrap();
        let size = cell.size as f64;
        let down = polynomials((down / size - f64::from(cell.down) - 0.5) as f32);
        let across = polynomials((right / size - f64::from(cell.across) - 0.5) as f32);
        let weight =
            |shares: &[f32; 9]| (0..9).map(|i| f64::from(shares[i] * down[i / 3] * across[i % 3])).sum::<f64>();
        shares.iter().map(|(knot, shares)| weight(shares) * value_at(*knot)).sum()
    }

    #[test]
    fn weights_of_knots_sum_to_one() {
        let (_, pieces) = mesh();
        for (cell, shares) in pieces {
            for product in 0..9 {
                let sum: f32 = shares.iter().map(|(_, shares)| shares[product]).sum();
                let expected = if product == 0 { 1.0 } else { 0.0 };
                assert!((sum - expected).abs() < 1e-6, "{sum} of {cell:?}");
            }
        }
    }

    #[test]
    fn patches_cover_cells_once() {
        let (_, pieces) = mesh();
        let area: usize = pieces.iter().map(|(cell, _)| cell.size.pow(2)).sum();
        assert_eq!(area, 25 * 64 * 64);
        assert_eq!(pieces.iter().map(|(cell, _)| cell.size).min(), Some(16));
    }

    #[test]
    fn places_of_a_cell_are_its_middle_and_its_corners() {
        let (mesh, _) = mesh();
        for cell in [Cell { down: 0, across: 1, size: 64 }, Cell { down: -1, across: 0, size: 32 }] {
            let near = |a: &Weights, b: &Weights| {
                let knots: BTreeSet<Knot> = a.keys().chain(b.keys()).copied().collect();
                let weight = |weights: &Weights, knot| weights.get(&knot).copied().unwrap_or(0.0);
                knots.into_iter().all(|knot| (weight(a, knot) - weight(b, knot)).abs() < 1e-12)
            };
            assert!(near(&mesh.at_place(&cell, cell.knot()), &mesh.at_middle(&cell)));
            let corners = cell.corners().into_iter().zip(mesh.at_corners(&cell));
            assert!(corners.into_iter().all(|(corner, weights)| near(&mesh.at_place(&cell, corner), &weights)));
        }
    }

    /// A plane is reproduced exactly, whatever the sizes of the cells.
    #[test]
    fn linear_kernels_are_met_everywhere() {
        let (_, pieces) = mesh();
        let plane = |knot: Knot| 3.0 + 0.02 * f64::from(knot.right) - 0.05 * f64::from(knot.down);
        for (down, right) in [(0.3, 0.7), (31.0, 33.0), (50.2, 47.9), (-40.0, 90.0), (64.1, 15.9)] {
            let value = spline(&pieces, &plane, down, right);
            // Single precision of the shares.
            assert!((value - (3.0 + 0.02 * right - 0.05 * down)).abs() < 1e-4, "{value} at {down}, {right}");
        }
    }

    /// Values and slopes have no steps across the borders of patches of any size.
    #[test]
    fn slopes_go_on_across_borders() {
        let (_, pieces) = mesh();
        let wild = |knot: Knot| (0.7 * f64::from(knot.right)).sin() + (0.3 * f64::from(knot.down * knot.right)).cos();
        let (near, far) = (1e-3, 0.5);
        for border in [-64.0, 0.0, 16.0, 32.0, 48.0, 64.0, 80.0] {
            for along in [-50.0, -10.0, 5.0, 20.0, 40.0, 70.0, 100.0] {
                for is_down in [true, false] {
                    let at = |by: f64| {
                        let (a, b) = (border + by, along);
                        if is_down { spline(&pieces, &wild, a, b) } else { spline(&pieces, &wild, b, a) }
                    };
                    assert!((at(near) - at(-near)).abs() < 1e-3, "a step at {border}, {along}");
                    let slopes = [at(far) - at(0.0), at(0.0) - at(-far)].map(|rise| rise / far);
                    // The curvature is at most the largest second difference of the values over the smallest cell's square.
                    assert!(
                        (slopes[0] - slopes[1]).abs() < 8.0 / 256.0 * far,
                        "a kink at {border}, {along}: {slopes:?}"
                    );
                }
            }
        }
    }
}
