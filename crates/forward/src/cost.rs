//! What the ways of spreading a patch take.

use std::collections::BTreeMap;

use crate::{
    convolve::{LANES, fast_size},
    knot_kernels::Symmetry,
    patch::{Cell, Knot, Patch},
};

/// Multiplications that take about as long as the transform of a sample.
const COST_OF_TRANSFORM: usize = 64;

/// What decides how long a patch takes by itself; costs are in multiplications.
pub(crate) struct Cost {
    pub(crate) n_terms: usize,
    /// The number of polynomials across the cell.
    pub(crate) n_across: usize,
    /// Rows and columns of the kernels.
    pub(crate) kernel_size: (usize, usize),
}

impl Cost {
    fn direct(&self, (rows, columns): (usize, usize)) -> usize {
        let (height, width) = self.kernel_size;
        // Fetching a kernel's samples takes as long as the products of another group of lanes.
        let lanes = (columns + width - 1).next_multiple_of(LANES) + LANES;
        self.n_across * height * width * rows * lanes
    }

    fn by_transform(&self, size: (usize, usize)) -> usize {
        (2 * self.n_terms + 1) * of_transform(size, self.kernel_size)
    }

    /// Whether a sum over a rectangle takes less time than transforms.
    pub(crate) fn is_better_direct(&self, size: (usize, usize)) -> bool {
        self.direct(size) <= self.by_transform(size)
    }

    /// Returns what a patch takes by itself, the terms of its expansion included: nine kernels for each of nine, and their edge spread functions.
    fn alone(&self, size: (usize, usize)) -> usize {
        const OF_EXPANSION: usize = 128;
        self.direct(size).min(self.by_transform(size)) + OF_EXPANSION * self.kernel_size.0 * self.kernel_size.1
    }
}

/// Returns what the transform of a rectangle takes that is spread by kernels of so many rows and columns.
fn of_transform((rows, columns): (usize, usize), (height, width): (usize, usize)) -> usize {
    fast_size(rows + height - 1) * fast_size(columns + width - 1) * COST_OF_TRANSFORM
}

/// Returns what a knot takes whose weights are over a rectangle of this size.
fn of_knot(symmetry: Symmetry, size: (usize, usize), kernel_size: (usize, usize)) -> usize {
    let n_halves = match symmetry {
        // One forth and one back, and half of one for weighing and mirroring; eight knots share that of the kernel.
        Symmetry::Octants => 5,
        Symmetry::None => 7,
    };
    n_halves * of_transform(size, kernel_size) / 2
}

/// A knot, and the patches in which it has weight.
struct AroundKnot {
    /// First and last of their cells' sides, pixels of the film: down, then across.
    reach: [(i64, i64); 2],
    kernel_size: (usize, usize),
    n_patches: usize,
}

impl AroundKnot {
    fn add(&mut self, cell: &Cell, (height, width): (usize, usize)) {
        let size = cell.size as i64;
        for ((first, last), at) in self.reach.iter_mut().zip([cell.down, cell.across]) {
            (*first, *last) = ((*first).min(i64::from(at) * size), (*last).max((i64::from(at) + 1) * size));
        }
        self.kernel_size = (self.kernel_size.0.max(height), self.kernel_size.1.max(width));
        self.n_patches += 1;
    }

    fn cost(&self, factor: usize, symmetry: Symmetry) -> f64 {
        let [rows, columns] = self.reach.map(|(first, last)| ((last - first) as usize).div_ceil(factor));
        of_knot(symmetry, (rows, columns), self.kernel_size) as f64
    }
}

/// Returns which patches are spread by knots: those that take less time so than by themselves, each knot shared by the patches in
/// which it has weight. Their raster has pixels `factor` times as wide as the film's.
pub(crate) fn patches_by_knots(patches: &[Patch], costs: &[Cost], factor: usize, symmetry: Symmetry) -> Vec<bool> {
    /// Patches that leave make those that stay dearer; few are left to leave after these rounds.
    const ROUNDS: usize = 8;
    let alone = |(patch, cost): (&Patch, &Cost)| {
        let side = patch.cell.size.div_ceil(factor);
        cost.alone((side, side)) as f64
    };
    let alone: Vec<f64> = patches.iter().zip(costs).map(alone).collect();
    let mut chosen = vec![true; patches.len()];
    for _ in 0..ROUNDS {
        let mut knots: BTreeMap<Knot, AroundKnot> = BTreeMap::new();
        for ((patch, cost), _) in patches.iter().zip(costs).zip(&chosen).filter(|(_, chosen)| **chosen) {
            for (knot, _) in &patch.shares {
                let nowhere = AroundKnot { reach: [(i64::MAX, i64::MIN); 2], kernel_size: (1, 1), n_patches: 0 };
                knots.entry(*knot).or_insert(nowhere).add(&patch.cell, cost.kernel_size);
            }
        }
        let shares: BTreeMap<Knot, f64> = knots
            .into_iter()
            .map(|(knot, around)| (knot, around.cost(factor, symmetry) / around.n_patches as f64))
            .collect();
        let mut has_changed = false;
        for ((patch, alone), chosen) in patches.iter().zip(&alone).zip(&mut chosen).filter(|(_, chosen)| **chosen) {
            *chosen = patch.shares.iter().map(|(knot, _)| shares[knot]).sum::<f64>() < *alone;
            has_changed |= !*chosen;
        }
        if !has_changed {
            break;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Square patches of 16 pixels, each with weights of the knots of its own cell and of those around it.
    fn patches(cells: impl Iterator<Item = (i32, i32)>) -> Vec<Patch> {
        let patch = |(down, across)| {
            let around = (-1..2).flat_map(|d| (-1..2).map(move |a| (down + d, across + a)));
            let knot = |(down, across)| Cell { down, across, size: 16 }.knot();
            let shares = around.map(|at| (knot(at), [1.0; 9])).collect();
            Patch { cell: Cell { down, across, size: 16 }, is_by_knots: false, around: None, shares, elsewhere: vec![] }
        };
        cells.map(patch).collect()
    }

    fn chosen(patches: &[Patch], n_terms: usize, width: usize) -> Vec<bool> {
        let n_across = if n_terms == 1 { 1 } else { 3 };
        let costs: Vec<Cost> =
            patches.iter().map(|_| Cost { n_terms, n_across, kernel_size: (width, width) }).collect();
        patches_by_knots(patches, &costs, 1, Symmetry::Octants)
    }

    #[test]
    fn patches_with_neighbors_share_knots() {
        let field = patches((-8..8).flat_map(|down| (-8..8).map(move |across| (down, across))));
        assert!(chosen(&field, 9, 45).iter().all(|by_knots| *by_knots));
        // Kernels that are the same all over a cell need one transform forth and one back.
        assert!(chosen(&field, 1, 45).iter().all(|by_knots| !by_knots));
        // Of small kernels, sums take less time.
        assert!(chosen(&field, 9, 3).iter().all(|by_knots| !by_knots));
    }

    #[test]
    fn a_patch_alone_is_spread_alone() {
        assert_eq!(chosen(&patches([(3, -4)].into_iter()), 9, 45), [false]);
        let row = patches((0..40).map(|across| (0, 3 * across)));
        assert!(chosen(&row, 9, 45).iter().all(|by_knots| !by_knots));
    }
}
