//! Where cells would leave seams on a uniform plane, and where the weights of knots are smoothed therefore.

use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    knot_kernels::{KnotKernel, LayerKernels, corner_spread_peak},
    neighbors::Neighbors,
    patch::{Around, Cell, Patch},
    rectangle::Rectangle,
};

/// Largest step of the second derivative of a uniform plane's irradiance that is left as it is, 1/px²: four fifths of what a picture may have.
const LARGEST_STEP: f64 = 8e-5;

/// Steps from which on weights are smoothed over twice the length: over the usual one they are a fifth or less of what they were.
const LARGE_STEP: f64 = 4e-4;

/// Largest change of a uniform plane's irradiance, at sides and corners, where smoothed weights end.
const LARGEST_CHANGE: f64 = 1.5e-5;

/// What kernels on the film's pixels do at the sides of patches, whatever the band.
pub(crate) struct Seams {
    neighbors: Neighbors,
    /// The largest step of the second derivative at a patch's sides, 1/px².
    largest_step: Vec<f64>,
    /// The largest second derivative of corner spread functions, along rows and columns together, 1/px².
    largest_bend: Vec<f64>,
}

impl Seams {
    /// Begins with none, between patches of one raster.
    pub(crate) fn between(patches: &[Patch]) -> Self {
        let n = patches.len();
        Self { neighbors: Neighbors::of(patches), largest_step: vec![0.0; n], largest_bend: vec![0.0; n] }
    }

    /// Adds those in another band.
    pub(crate) fn add_band(
        &mut self,
        patches: &[Patch],
        kernels: &LayerKernels,
        cancel: &Cancel,
    ) -> Result<(), Cancelled> {
        // Where knots have kernels on other rasters too, these alone are not the spline.
        let bend = |patch: &Patch| {
            cancel.check()?;
            Ok(patch.elsewhere.is_empty().then(|| Bend::of(patch, kernels)))
        };
        let bends: Vec<Option<Bend>> = patches.par_iter().map(bend).collect::<Result<_, Cancelled>>()?;
        // Each side once, for the patches on both.
        let steps_from = |number: usize| -> Vec<(usize, f64)> {
            let step_to = |&other: &u32| {
                let other = other as usize;
                let side = Side::between(&patches[number].cell, &patches[other].cell).filter(|_| other > number)?;
                Some((other, bends[number].as_ref()?.step_to(bends[other].as_ref()?, side)))
            };
            self.neighbors.of_patch(number).iter().filter_map(step_to).collect()
        };
        let steps: Vec<Vec<(usize, f64)>> = (0..patches.len()).into_par_iter().map(steps_from).collect();
        for (number, (other, step)) in
            steps.iter().enumerate().flat_map(|(i, steps)| steps.iter().map(move |s| (i, *s)))
        {
            for patch in [number, other] {
                self.largest_step[patch] = step.max(self.largest_step[patch]);
            }
        }
        for (largest, bend) in self.largest_bend.iter_mut().zip(&bends) {
            *largest = bend.as_ref().map_or(0.0, Bend::peak).max(*largest);
        }
        Ok(())
    }

    /// Returns the length over which weights are to be smoothed, `length_px` or twice that where steps are large, and the patches over which they are, with
    /// what lies around them: those with seams, and those beside them where an end of the smoothing would be seen.
    pub(crate) fn smoothed(self, patches: &[Patch], length_px: usize) -> (usize, Vec<(usize, Around)>) {
        let largest_step = self.largest_step.iter().copied().fold(0.0, f64::max);
        let length_px = if largest_step > LARGE_STEP { 2 * length_px } else { length_px };
        let change_per_bend = change_per_bend(length_px);
        let mut chosen: Vec<bool> = self.largest_step.iter().map(|step| *step > LARGEST_STEP).collect();
        let mut border: Vec<usize> = (0..patches.len()).filter(|&number| chosen[number]).collect();
        while let Some(number) = border.pop() {
            for &other in self.neighbors.of_patch(number) {
                let other = other as usize;
                if !chosen[other] && change_per_bend * self.largest_bend[other] > LARGEST_CHANGE {
                    chosen[other] = true;
                    border.push(other);
                }
            }
        }
        let around = |number: usize| (number, self.neighbors.around(patches, number, length_px / 2));
        (length_px, (0..patches.len()).filter(|&number| chosen[number]).map(around).collect())
    }
}

/// Returns by how much corner spread functions change where weights are smoothed over a length, over their second derivative: half the variance of that line
/// and of straight lines between pixels.
fn change_per_bend(length_px: usize) -> f64 {
    0.5 * (length_px * length_px + 2) as f64 / 12.0
}

/// Where a patch lies from another that touches it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Beside,
    Below,
}

impl Side {
    /// Returns the side that two cells have in common; `None` for a corner.
    fn between(a: &Cell, b: &Cell) -> Option<Self> {
        let ends = |place: i32, size: usize| (i64::from(place) * size as i64, (i64::from(place) + 1) * size as i64);
        let overlap = |(a, a_end): (i64, i64), (b, b_end): (i64, i64)| a_end.min(b_end) > a.max(b);
        if overlap(ends(a.down, a.size), ends(b.down, b.size)) {
            return Some(Self::Beside);
        }
        overlap(ends(a.across, a.size), ends(b.across, b.size)).then_some(Self::Below)
    }
}

/// The second derivatives of the kernel in the middle of a patch, 1/px².
struct Bend {
    across: KnotKernel,
    down: KnotKernel,
}

impl Bend {
    /// Takes the kernels at the knots of a patch.
    fn of(patch: &Patch, kernels: &LayerKernels) -> Self {
        // Numbers of the products 1 × (u² − 1/12) and the other way around.
        const ACROSS: usize = 2;
        const DOWN: usize = 6;
        // The second derivative of u², u in parts of the cell.
        let scale = 2.0 / (patch.cell.size * patch.cell.size) as f32;
        let at = patch.shares.iter().map(|(knot, _)| kernels.window_at(*knot));
        let at = Rectangle::around(at).unwrap_or(Rectangle::PIXEL);
        let nothing = KnotKernel { at, samples: vec![0.0; at.len()] };
        let mut bend = Self { across: nothing.clone(), down: nothing };
        for (knot, shares) in &patch.shares {
            let kernel = kernels.at(*knot);
            kernel.add_to(&mut bend.across.samples, &at, scale * shares[ACROSS]);
            kernel.add_to(&mut bend.down.samples, &at, scale * shares[DOWN]);
        }
        bend
    }

    /// Returns the step of the second derivative of a uniform plane's irradiance over a side to another patch, at its ends too.
    fn step_to(&self, other: &Self, side: Side) -> f64 {
        let [a, b] = [self, other].map(|bend| if side == Side::Beside { &bend.across } else { &bend.down });
        let difference = KnotKernel::sum_of(&[(a, 1.0), (b, -1.0)]);
        corner_spread_peak(&difference.samples, difference.at.columns)
    }

    /// Returns the largest second derivative of corner spread functions, along rows and columns together.
    fn peak(&self) -> f64 {
        let both = KnotKernel::sum_of(&[(&self.across, 1.0), (&self.down, 1.0)]);
        corner_spread_peak(&both.samples, both.at.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{knot_kernels::Symmetry, patch::Knot};

    fn cell(across: usize) -> Cell {
        Cell { down: 0, across: across as i32, size: 16 }
    }

    /// Kernels along a row of cells of 16 pixels that have moved these parts of their light from the middle pixel to the one on the right.
    fn kernels(parts: &[f32]) -> LayerKernels {
        let kernel = |(i, part): (usize, &f32)| {
            let mut samples = vec![0.0; 9];
            (samples[4], samples[5]) = (1.0 - part, *part);
            (cell(i).knot(), KnotKernel { at: Rectangle::PIXEL.grown(1), samples })
        };
        LayerKernels::new(Symmetry::None, parts.iter().enumerate().map(kernel).collect())
    }

    /// Patches with knots in so many cells, but for the first and the last cell.
    fn patches(n_cells: usize) -> Vec<Patch> {
        let patch = |i: usize| {
            // The second difference of the knots around it, as half of it is the share of u².
            let shares: [(usize, f32); 3] = [(i - 1, 0.5), (i, -1.0), (i + 1, 0.5)];
            let of_knot = |(i, share)| (cell(i).knot(), [0.0, 0.0, share, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            let shares: Vec<(Knot, [f32; 9])> = shares.map(of_knot).to_vec();
            Patch { cell: cell(i), is_by_knots: false, around: None, shares, elsewhere: vec![] }
        };
        (1..n_cells - 1).map(patch).collect()
    }

    /// Returns the numbers of the patches that are smoothed where kernels in some bands have moved so, over a length that is as expected.
    fn smoothed(bands: &[&[f32]], expected_px: usize) -> Vec<usize> {
        let patches = patches(bands[0].len());
        let mut seams = Seams::between(&patches);
        for parts in bands {
            seams.add_band(&patches, &kernels(parts), &Cancel::new()).unwrap();
        }
        let (length_px, smoothed) = seams.smoothed(&patches, 4);
        assert_eq!(length_px, expected_px);
        smoothed.into_iter().map(|(number, _)| number).collect()
    }

    #[test]
    fn the_step_is_the_third_difference_over_the_square_of_a_cell() {
        let parts = [0.0, 0.0, 0.1, 0.3, 0.7];
        let (patches, kernels) = (patches(parts.len()), kernels(&parts));
        let bends: Vec<Bend> = patches.iter().map(|patch| Bend::of(patch, &kernels)).collect();
        for (pair, third) in bends.windows(2).zip([0.0, 0.1]) {
            assert!((pair[0].step_to(&pair[1], Side::Beside) - third / 256.0).abs() < 1e-8);
            assert!(pair[0].step_to(&pair[1], Side::Below) < 1e-8);
        }
        for (bend, second) in bends.iter().zip([0.1, 0.1, 0.2]) {
            assert!((bend.peak() - second / 256.0).abs() < 1e-8);
        }
        // The variance of a line of 4 pixels, and of straight lines between pixels: 18 / 12.
        assert_eq!(change_per_bend(4), 0.75);
    }

    #[test]
    fn sides_and_corners_are_told_apart() {
        let at = |down: i32, across: i32, size: usize| Cell { down, across, size };
        assert_eq!(Side::between(&at(0, 0, 32), &at(1, 2, 16)), Some(Side::Beside));
        assert_eq!(Side::between(&at(0, 0, 32), &at(-1, 1, 16)), Some(Side::Below));
        assert_eq!(Side::between(&at(0, 0, 32), &at(2, 2, 16)), None);
    }

    #[test]
    fn seams_are_smoothed_as_far_as_an_end_would_be_seen() {
        // Second differences of 0, 0, .01, .01, .05, 0, 0 and 0: steps of 1.6e-4 and 2e-4 on both sides of the fifth patch, and .01 is 2.9e-5 of an edge.
        assert_eq!(smoothed(&[&[0.0, 0.001, 0.002, 0.003, 0.014, 0.035, 0.106, 0.177, 0.248, 0.319]], 4), [2, 3, 4, 5]);
        // Five times as large: the step of 2e-4 before them is a seam as well, and the length is twice as large.
        assert_eq!(smoothed(&[&[0.0, 0.005, 0.01, 0.015, 0.07, 0.175, 0.53, 0.885, 1.24, 1.595]], 8), [1, 2, 3, 4, 5]);
        // Cells without seams at their sides are left alone however their kernels bend.
        assert!(smoothed(&[&[0.0, 0.0, 0.01, 0.03, 0.06, 0.10]], 4).is_empty());
    }

    /// Where one band has a seam, smoothing goes as far as another shows its end.
    #[test]
    fn bands_count_together() {
        let seam = [0.0, 0.0, 0.03, 0.06, 0.09, 0.12, 0.15];
        let bent = [0.0, 0.01, 0.03, 0.06, 0.10, 0.15, 0.21];
        assert_eq!(smoothed(&[&seam], 4), [0, 1]);
        assert!(smoothed(&[&bent], 4).is_empty());
        assert_eq!(smoothed(&[&seam, &bent], 4), [0, 1, 2, 3, 4]);
        assert_eq!(smoothed(&[&bent, &seam], 4), [0, 1, 2, 3, 4]);
    }
}
