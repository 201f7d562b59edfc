//! Means over pixels of something sampled evenly.

use ndarray::{Array2, Axis};

/// Samples beyond each border of a window that the means of its outermost pixels draw on.
const MARGIN: usize = 3;
/// By how much the differences of samples at 1, 3 and 5 half steps from a border count there.
///
/// They are Euler and Maclaurin's correction of the midpoint rule, `f′/24 − 7 f‴/5760 + 31 f⁗′/967680`, with the
/// derivatives at the border as central differences: exact for polynomials of degree 7.
const BORDER: [f64; MARGIN] = {
    const D1: [f64; 3] = [75.0 / 64.0, -25.0 / 384.0, 3.0 / 640.0];
    const D3: [f64; 3] = [-17.0 / 4.0, 13.0 / 8.0, -1.0 / 8.0];
    const D5: [f64; 3] = [10.0, -5.0, 1.0];
    let mut border = [0.0; 3];
    let mut i = 0;
    while i < 3 {
        border[i] = D1[i] / 24.0 - 7.0 / 5760.0 * D3[i] + 31.0 / 967_680.0 * D5[i];
        i += 1;
    }
    border
};

/// The mean over pixels of a function known at evenly spaced places, this many along the side of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelMean {
    samples_per_pixel: usize,
}

impl PixelMean {
    pub(crate) fn new(samples_per_pixel: usize) -> Self {
        Self { samples_per_pixel }
    }

    /// Returns how many samples along a line so many pixels need, symmetric about their middle.
    pub(crate) fn n_samples(self, n_pixels: usize) -> usize {
        n_pixels * self.samples_per_pixel + 2 * MARGIN
    }

    /// Returns the mean over each pixel, rows along y, from samples in lines along y.
    pub(crate) fn over(self, lines: &Array2<f64>, n_rows: usize, n_columns: usize) -> Array2<f64> {
        let mut narrow = Array2::zeros((lines.nrows(), n_rows));
        for (line, mut means) in lines.axis_iter(Axis(0)).zip(narrow.axis_iter_mut(Axis(0))) {
            if let (Some(line), Some(means)) = (line.as_slice(), means.as_slice_mut()) {
                self.along(line, means);
            }
        }
        // Now along x, whole lines at a time.
        let mut mean = Array2::zeros((n_columns, n_rows));
        let n = self.samples_per_pixel;
        for (pixel, mut means) in mean.axis_iter_mut(Axis(0)).enumerate() {
            let mut add = |line: usize, weight: f64| means.scaled_add(weight / n as f64, &narrow.row(line));
            for i in 0..n {
                add(MARGIN + pixel * n + i, 1.0);
            }
            for (border, sign) in [((pixel + 1) * n, 1.0), (pixel * n, -1.0)] {
                for (i, weight) in BORDER.iter().enumerate() {
                    add(border + MARGIN + i, sign * weight);
                    add(border + MARGIN - 1 - i, -sign * weight);
                }
            }
        }
        mean.reversed_axes()
    }

    fn along(self, samples: &[f64], means: &mut [f64]) {
        let n = self.samples_per_pixel;
        let per_pixel = 1.0 / n as f64;
        // The correction at the border before sample `MARGIN + at`.
        let border = |at: usize| -> f64 {
            (0..MARGIN).map(|i| BORDER[i] * (samples[at + MARGIN + i] - samples[at + MARGIN - 1 - i])).sum()
        };
        let mut before = border(0);
        for (pixel, mean) in means.iter_mut().enumerate() {
            let after = border((pixel + 1) * n);
            let sum: f64 = samples[MARGIN + pixel * n..][..n].iter().sum();
            *mean = (sum + after - before) * per_pixel;
            before = after;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_polynomials_up_to_degree_7_are_exact() {
        for (n_samples, degree) in [(1, 0), (1, 3), (2, 5), (3, 6), (4, 7)] {
            let mean = PixelMean::new(n_samples);
            let n_pixels = 5;
            let step = 1.0 / n_samples as f64;
            let n = mean.n_samples(n_pixels);
            let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * step;
            let samples = Array2::from_shape_fn((n, n), |(x, y)| at(x).powi(degree) + 2.0 * at(y).powi(degree));
            for ((row, column), found) in mean.over(&samples, n_pixels, n_pixels).indexed_iter() {
                let whole = |x: f64| x.powi(degree + 1) / f64::from(degree + 1);
                let mean = |pixel: usize| whole(pixel as f64 - 1.5) - whole(pixel as f64 - 2.5);
                let expected = mean(column) + 2.0 * mean(row);
                // Rounding of numbers up to 3.5⁷.
                assert!((found - expected).abs() < 1e-10, "{n_samples} {degree}: {found} {expected}");
            }
        }
    }
}
