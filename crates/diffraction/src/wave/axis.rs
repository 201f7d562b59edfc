//! The places along one axis of a window at which the wave is sampled.

use dioptric_optics::quadrature::gauss_legendre;

/// Places along one axis, symmetric about 0: `n_points` Gauss–Legendre points in each of `n_pixels` pixels.
#[derive(Clone, Debug)]
pub(crate) struct SampleAxis {
    pub(crate) n_pixels: usize,
    pub(crate) pitch_mm: f64,
    /// Places in a pixel from its middle, mm, and weights of sum 1.
    points: Vec<(f64, f64)>,
}

impl SampleAxis {
    pub(crate) fn new(n_pixels: usize, pitch_mm: f64, n_points: usize) -> Self {
        let nodes = gauss_legendre(n_points);
        // Exactly symmetric, so that a place and its mirror image share one phase.
        let place = |i: usize| 0.5 * (nodes[i].0 - nodes[n_points - 1 - i].0);
        let points = (0..n_points).map(|i| (0.5 * pitch_mm * place(i), 0.5 * nodes[i].1)).collect();
        Self { n_pixels, pitch_mm, points }
    }

    /// The number of points in a pixel.
    pub(crate) fn n_points(&self) -> usize {
        self.points.len()
    }

    fn n_samples(&self) -> usize {
        self.n_pixels * self.n_points()
    }

    /// The number of places at 0 and above.
    pub(crate) fn n_half(&self) -> usize {
        self.n_samples().div_ceil(2)
    }

    /// Whether the first of the places at 0 and above is 0 itself, its own mirror image.
    pub(crate) fn has_middle(&self) -> bool {
        self.n_samples() % 2 == 1
    }

    /// Returns the pixel, and the point in it, of one of the places at 0 and above.
    pub(crate) fn locate(&self, half: usize) -> (usize, usize) {
        let sample = self.n_samples() / 2 + half;
        (sample / self.n_points(), sample % self.n_points())
    }

    /// Returns one of the places at 0 and above, mm.
    pub(crate) fn at_mm(&self, half: usize) -> f64 {
        let (pixel, point) = self.locate(half);
        (pixel as f64 - 0.5 * (self.n_pixels as f64 - 1.0)) * self.pitch_mm + self.points[point].0
    }

    /// The weight of a point of a pixel.
    pub(crate) fn weight(&self, point: usize) -> f64 {
        self.points[point].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_ascend_from_the_middle_and_weights_fill_the_pixels() {
        for (n_pixels, n_points) in [(4, 1), (5, 1), (5, 2), (5, 3), (4, 3), (1, 1), (1, 4)] {
            let axis = SampleAxis::new(n_pixels, 2.0, n_points);
            let places: Vec<f64> = (0..axis.n_half()).map(|i| axis.at_mm(i)).collect();
            assert!(
                places.is_sorted()
                    && places[0] >= 0.0
                    && places.iter().all(|x| *x < 0.5 * n_pixels as f64 * axis.pitch_mm)
            );
            assert_eq!(axis.has_middle(), places[0] == 0.0);
            let sum: f64 = (0..n_points).map(|i| axis.weight(i)).sum();
            // Rounding of a few weights.
            assert!((sum - 1.0).abs() < 1e-14);
        }
    }
}
