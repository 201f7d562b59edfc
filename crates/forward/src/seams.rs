//! Where small cells would leave seams on a uniform plane.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    knot_kernels::{KnotKernel, edge_spread_peak},
    neighbors::Neighbors,
    patch::{Knot, Patch},
};

/// Length of a side from which on a cell leaves none: where a spline is within one hundredth of the kernel at its middle, its second derivative is less than a
/// twelfth over the square of that length, and what that changes by between two cells as well.
const FIRST_WITHOUT: usize = 64;

/// Largest step of the second derivative of a uniform plane's irradiance that is left as it is, 1/px²: half of what no picture may have.
const LARGEST_STEP: f64 = 8e-5;

/// Largest change of edge spread functions where smoothed weights end.
const LARGEST_CHANGE: f64 = 2.5e-5;

/// Whether the kernels of a patch are on the film's pixels, and its cell is small enough to leave a seam.
pub(crate) fn may_have_seams(patch: &Patch) -> bool {
    patch.cell.size < FIRST_WITHOUT && patch.elsewhere.is_empty()
}

/// The second derivatives of the kernel in the middle of a patch, along rows and along columns, 1/px².
pub(crate) struct Bend {
    width: usize,
    across: Vec<f32>,
    down: Vec<f32>,
}

impl Bend {
    /// Takes the kernels at the knots of a patch on the film's pixels.
    pub(crate) fn of(patch: &Patch, kernels: &BTreeMap<Knot, KnotKernel>) -> Self {
        // Numbers of the products 1 × (u² − 1/12) and the other way around.
        const ACROSS: usize = 2;
        const DOWN: usize = 6;
        let width = patch.shares.iter().map(|(knot, _)| kernels[knot].width).max().unwrap_or(1);
        // The second derivative of u², u in parts of the cell.
        let scale = 2.0 / (patch.cell.size * patch.cell.size) as f32;
        let sum = |product: usize| {
            let mut samples = vec![0.0; width * width];
            let terms = patch.shares.iter().map(|(knot, shares)| (&kernels[knot], shares[product]));
            terms.for_each(|(kernel, share)| kernel.add_to(&mut samples, width, share * scale));
            samples
        };
        Self { width, across: sum(ACROSS), down: sum(DOWN) }
    }

    /// Returns the step of the second derivative of a uniform plane's irradiance from one patch to another beside it, or below it.
    fn step_to(&self, other: &Self, is_beside: bool) -> f64 {
        let (wide, narrow) = if self.width >= other.width { (self, other) } else { (other, self) };
        let along = |bend: &Self| if is_beside { bend.across.clone() } else { bend.down.clone() };
        let narrow = KnotKernel { width: narrow.width, samples: along(narrow) };
        let mut difference = along(wide);
        narrow.add_to(&mut difference, wide.width, -1.0);
        edge_spread_peak(&difference, wide.width)
    }

    /// Returns by how much edge spread functions change where weights are smoothed over a length: means of a second derivative.
    fn change_by_smoothing(&self, length_px: usize) -> f64 {
        let variance = (length_px * length_px + 2) as f64 / 12.0;
        let both: Vec<f32> = self.across.iter().zip(&self.down).map(|(across, down)| across + down).collect();
        0.5 * variance * edge_spread_peak(&both, self.width)
    }
}

/// Returns the patches over which weights are to be smoothed, of those whose bends are known: those with seams at their sides, and those beside them where
/// an end of the smoothing would be seen.
pub(crate) fn smoothed_patches(
    patches: &[Patch],
    neighbors: &Neighbors,
    bends: &BTreeMap<u32, Bend>,
    length_px: usize,
) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    for (&number, bend) in bends {
        let own = &patches[number as usize];
        for &other in neighbors.of_patch(number as usize).iter().filter(|other| **other > number) {
            let (Some(next), beside) = (bends.get(&other), &patches[other as usize]) else { continue };
            if !may_have_seams(own) && !may_have_seams(beside) {
                continue;
            }
            let ends = |place: i32, size: usize| (place as i64 * size as i64, (place as i64 + 1) * size as i64);
            let overlap = |a: (i64, i64), b: (i64, i64)| a.1.min(b.1) > a.0.max(b.0);
            let (a, b) = (&own.cell, &beside.cell);
            let is_beside = overlap(ends(a.down, a.size), ends(b.down, b.size));
            let is_below = overlap(ends(a.across, a.size), ends(b.across, b.size));
            if (is_beside || is_below) && bend.step_to(next, is_beside) > LARGEST_STEP {
                found.extend([number, other]);
            }
        }
    }
    let mut border: Vec<u32> = found.iter().copied().collect();
    while let Some(number) = border.pop() {
        for other in neighbors.of_patch(number as usize) {
            let is_seen = |bend: &Bend| bend.change_by_smoothing(length_px) > LARGEST_CHANGE;
            if !found.contains(other) && bends.get(other).is_some_and(is_seen) {
                found.insert(*other);
                border.push(*other);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patch::Cell;

    /// A point whose light moves from the middle pixel to the one on the right, along a row of cells of 16 pixels, by these parts of it.
    fn row_of(parts: &[f32]) -> (Vec<Patch>, BTreeMap<u32, Bend>) {
        let knot = |i: usize| Cell { down: 0, across: i as i32, size: 16 }.knot();
        let kernel = |(i, part): (usize, &f32)| {
            let mut samples = vec![0.0; 9];
            (samples[4], samples[5]) = (1.0 - part, *part);
            (knot(i), KnotKernel { width: 3, samples })
        };
        let kernels: BTreeMap<Knot, KnotKernel> = parts.iter().enumerate().map(kernel).collect();
        let patch = |i: usize| {
            // The second difference of the knots around it, as half of it is the share of u².
            let shares = [(i - 1, 0.5), (i, -1.0), (i + 1, 0.5)];
            Patch {
                cell: Cell { down: 0, across: i as i32, size: 16 },
                is_by_knots: false,
                around: None,
                shares: shares.map(|(i, share)| (knot(i), [0.0, 0.0, share, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])).to_vec(),
                elsewhere: vec![],
            }
        };
        let patches: Vec<Patch> = (1..parts.len() - 1).map(patch).collect();
        let bends = patches.iter().zip(0..).map(|(patch, number)| (number, Bend::of(patch, &kernels))).collect();
        (patches, bends)
    }

    #[test]
    fn the_step_is_the_third_difference_over_the_square_of_a_cell() {
        let (patches, bends) = row_of(&[0.0, 0.0, 0.1, 0.3, 0.6]);
        let (second, third) = ([0.1, 0.1, 0.1], [0.0, 0.0]);
        for (number, third) in (0..2).zip(third) {
            assert!((bends[&number].step_to(&bends[&(number + 1)], true) - third / 256.0).abs() < 1e-8);
        }
        for (number, second) in (0..3).zip(second) {
            // The variance of a line of 4 pixels, and of the straight lines between pixels around it: 18 / 12.
            let expected = 0.5 * 1.5 * second / 256.0;
            assert!((bends[&number].change_by_smoothing(4) - expected).abs() < 1e-8);
        }
        assert!(smoothed_patches(&patches, &Neighbors::of(&patches), &bends, 4).is_empty());
    }

    #[test]
    fn seams_are_smoothed_as_far_as_an_end_would_be_seen() {
        // Second differences of 0, 0, .01, .01, .05, 0, 0 and 0: steps of 1.6e-4 and 2e-4 on both sides of the fifth patch, and .01 is 2.9e-5 of an edge.
        let (patches, bends) = row_of(&[0.0, 0.001, 0.002, 0.003, 0.014, 0.035, 0.106, 0.177, 0.248, 0.319]);
        let found = smoothed_patches(&patches, &Neighbors::of(&patches), &bends, 4);
        assert_eq!(found.into_iter().collect::<Vec<_>>(), [2, 3, 4, 5]);
        // Cells without seams at their sides are left alone however their kernels bend.
        let (patches, bends) = row_of(&[0.0, 0.0, 0.05, 0.15, 0.3, 0.5]);
        assert!(smoothed_patches(&patches, &Neighbors::of(&patches), &bends, 4).is_empty());
    }
}
