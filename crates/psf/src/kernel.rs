//! A point spread function on pixels.

use glam::IVec2;
use ndarray::{Array2, s};

/// Over how much of the radius of a window diffracted light fades out, in units of λN: what is spread beyond has no edge there then.
const FADE: f64 = 4.0;

/// A point spread function on square pixels: odd × odd, in the picture frame (row 0 is the top). The point of the film that it is about is the middle of a pixel:
/// of the middle one, or of another where the light lies far to one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// The share of the light of the window that falls on each pixel.
    pub samples: Array2<f32>,
    /// The share of the point's light that the window holds, fading at its borders: 1, or with diffraction some hundredths less.
    pub kept_share: f64,
    /// Side of a pixel, µm.
    pub pitch_um: f64,
    /// Where the middle pixel lies, pixels to the right of the one that the kernel is about and below it; mostly 0.
    pub middle_px: IVec2,
    /// λN of the light on the film, pixels; 0 without diffraction. The samples of diffracted light, which has no end at the borders, fade out before them:
    /// [`fade_px`](Self::fade_px).
    pub lambda_n_px: f64,
    /// The radius about the middle of the window at which they end, pixels; 0 without diffraction.
    pub edge_px: f64,
    /// What pixels add to the variance of the light, down and across, pixels²: 1/12 to light that is wider than they are, less than nothing to light that one of
    /// them holds, of which nothing is left; 0 where samples are to be taken as they are.
    pub excess_px2: [f64; 2],
}

impl Kernel {
    /// The share of a point's light that is not worth a sample.
    pub const NEGLIGIBLE: f64 = 1e-7;

    /// Returns the kernel of these samples, odd × odd, that is about the middle of the middle one.
    pub fn centered(samples: Array2<f32>, pitch_um: f64) -> Self {
        let (middle_px, excess_px2) = (IVec2::ZERO, [0.0; 2]);
        Self { samples, kept_share: 1.0, pitch_um, middle_px, lambda_n_px: 0.0, edge_px: 0.0, excess_px2 }
    }

    /// Returns the kernel that blurs nothing.
    pub fn identity(pitch_um: f64) -> Self {
        Self::centered(Array2::ones((1, 1)), pitch_um)
    }

    /// Returns the radii about the middle of the window between which the samples of diffracted light fade out linearly, pixels: over four λN, or from the
    /// middle on.
    pub fn fade_px(&self) -> [f64; 2] {
        [(self.edge_px - FADE * self.lambda_n_px).max(0.0), self.edge_px]
    }

    /// Returns the kernel of light with this λN, faded out for it up to a circle about the middle, or the pixels on that, in the square about it.
    pub(crate) fn faded_out(self, lambda_n_px: f64, edge_px: f64) -> Self {
        let mut kernel = Self { lambda_n_px, edge_px: edge_px + std::f64::consts::FRAC_1_SQRT_2, ..self };
        let beside = kernel.samples.nrows() / 2;
        let kept = beside.min((kernel.edge_px - 0.5).ceil() as usize);
        let within = beside - kept..=beside + kept;
        kernel.samples = kernel.samples.slice_move(s![within.clone(), within]);
        let [start, end] = kernel.fade_px();
        for ((row, column), sample) in kernel.samples.indexed_iter_mut() {
            let radius = (row as f64 - kept as f64).hypot(column as f64 - kept as f64);
            if radius > start {
                *sample *= ((end - radius) / (end - start)).max(0.0) as f32;
            }
        }
        kernel
    }

    /// The share of the energy that the window holds.
    pub fn sum(&self) -> f64 {
        self.samples.iter().map(|&e| f64::from(e)).sum()
    }

    /// Returns the pixels of the first sample and after the last one, to the right of the one that the kernel is about and below it.
    fn window_px(&self) -> (IVec2, IVec2) {
        let (rows, columns) = self.samples.dim();
        let first = self.middle_px - IVec2::new((columns / 2) as i32, (rows / 2) as i32);
        (first, first + IVec2::new(columns as i32, rows as i32))
    }

    /// Returns the L1 difference from another kernel of the same pixels, about the same point, over the other's energy: 0
    /// where they are equal, 2 where they hold as much and share no pixel.
    pub fn difference_from(&self, other: &Self) -> f64 {
        let ((first, end), (other_first, other_end)) = (self.window_px(), other.window_px());
        let (low, high) = (first.min(other_first), end.max(other_end));
        let at = |kernel: &Self, first: IVec2, place: IVec2| {
            let (row, column) = (usize::try_from(place.y - first.y), usize::try_from(place.x - first.x));
            let place = row.ok().zip(column.ok());
            place.and_then(|place| kernel.samples.get(place)).map_or(0.0, |e| f64::from(*e))
        };
        let places = (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| IVec2::new(x, y)));
        let differences = places.map(|place| (at(self, first, place) - at(other, other_first, place)).abs());
        differences.sum::<f64>() / other.sum()
    }

    /// Returns the kernel with the sum 1, and what the sum was as the share that it keeps; one without energy becomes that which blurs nothing.
    #[must_use]
    pub fn normalized(mut self) -> Self {
        let sum = self.sum();
        if sum.is_nan() || sum <= 0.0 {
            return Self::identity(self.pitch_um);
        }
        let scale = (1.0 / sum) as f32;
        self.samples.mapv_inplace(|e| e * scale);
        self.kept_share *= sum.min(1.0);
        self
    }
}

/// Returns the smallest odd square about the middle that holds at least `share` of what the picture holds.
pub(crate) fn trim(energy: &Array2<f64>, share: f64) -> Array2<f32> {
    let energy = energy.as_standard_layout();
    let middle = energy.nrows() / 2;
    let mut by_ring = vec![0.0; middle + 1];
    for (row, energies) in energy.rows().into_iter().enumerate() {
        // Of a row so far from the middle, as many samples on both sides of it lie in its own ring.
        let ring = row.abs_diff(middle);
        by_ring[ring] += energies.slice(s![middle - ring..=middle + ring]).sum();
        let energies = energies.to_slice().expect("rows are in standard order");
        let (left, right) = (&energies[..middle - ring], &energies[middle + ring + 1..]);
        let beyond = by_ring[ring + 1..].iter_mut().zip(left.iter().rev().zip(right));
        beyond.for_each(|(sum, (left, right))| *sum += left + right);
    }
    let wanted = share * by_ring.iter().sum::<f64>();
    let mut held = 0.0;
    let reach = by_ring
        .iter()
        .position(|e| {
            held += e;
            held >= wanted
        })
        .unwrap_or(middle);
    let (first, end) = (middle - reach, middle + reach + 1);
    energy.slice(s![first..end, first..end]).mapv(|e| e as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same light in windows about two pixels, and as much beside it.
    #[test]
    fn differences_are_those_of_pixels_about_one_point() {
        let mut wide = Array2::zeros((5, 5));
        (wide[(1, 4)], wide[(2, 4)]) = (0.75, 0.25);
        let mut narrow = Array2::zeros((3, 3));
        (narrow[(0, 1)], narrow[(1, 1)]) = (0.75, 0.25);
        let wide = Kernel::centered(wide, 1.0);
        let aside = Kernel { middle_px: IVec2::new(2, 0), ..Kernel::centered(narrow, 1.0) };
        assert_eq!((wide.difference_from(&aside), aside.difference_from(&wide)), (0.0, 0.0));
        let elsewhere = Kernel { middle_px: IVec2::new(-2, 3), ..aside.clone() };
        assert_eq!(elsewhere.difference_from(&aside), 2.0);
    }

    #[test]
    fn trimming_keeps_the_share_and_the_middle() {
        let mut energy = Array2::zeros((9, 9));
        energy[(4, 4)] = 0.9;
        energy[(3, 5)] = 0.0995;
        energy[(0, 0)] = 0.0005;
        let kernel = trim(&energy, 0.999);
        assert_eq!(kernel.dim(), (3, 3));
        assert_eq!(kernel[(1, 1)], 0.9);
        assert_eq!(trim(&energy, 1.0).dim(), (9, 9));
    }
}
