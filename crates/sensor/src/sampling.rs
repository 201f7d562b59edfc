//! Averages of an image's samples over the apertures of pixels that lie on another grid.

use ndarray::Array2;
use rayon::prelude::*;

/// The shares of samples that a row (or column) of pixel apertures sees, both grids being centered on the axis.
pub(crate) struct Overlaps {
    /// For each pixel the first sample it sees, and the share of its aperture that each sample covers.
    pixels: Vec<(usize, Vec<f32>)>,
}

impl Overlaps {
    /// Returns the overlaps of `n_pixels` apertures with samples that are constant over their pitch.
    ///
    /// What lies outside the samples is dark.
    pub(crate) fn new(
        n_samples: usize,
        sample_pitch_um: f64,
        n_pixels: usize,
        pixel_pitch_um: f64,
        side_um: f64,
    ) -> Self {
        let start_um = -0.5 * n_samples as f64 * sample_pitch_um;
        let pixel = |i: usize| {
            let center_um = (i as f64 + 0.5 - 0.5 * n_pixels as f64) * pixel_pitch_um;
            let edge = |side: f64| (center_um + side * 0.5 * side_um - start_um) / sample_pitch_um;
            let (low, high) = (edge(-1.0).max(0.0), edge(1.0).min(n_samples as f64));
            if high <= low {
                return (0, Vec::new());
            }
            let first = low.floor() as usize;
            let last = (high.ceil() as usize).min(n_samples);
            let share = |j: usize| (high.min((j + 1) as f64) - low.max(j as f64)).max(0.0) * sample_pitch_um / side_um;
            (first, (first..last).map(|j| share(j) as f32).collect())
        };
        Self { pixels: (0..n_pixels).map(pixel).collect() }
    }
}

/// Returns the averages of samples over the apertures of pixels.
pub(crate) fn average(samples: &Array2<f32>, rows: &Overlaps, columns: &Overlaps) -> Array2<f32> {
    let samples = samples.as_standard_layout();
    let (n_samples, n_pixels) = (samples.ncols(), columns.pixels.len());
    let mut pixels = Array2::zeros((rows.pixels.len(), n_pixels));
    let out_rows = pixels.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(n_pixels);
    out_rows.zip(&rows.pixels).for_each_init(
        || vec![0.0_f32; n_samples],
        |line, (out, (first, shares))| {
            line.fill(0.0);
            for (share, row) in shares.iter().zip(*first..) {
                let row = samples.row(row);
                line.iter_mut().zip(&row).for_each(|(sum, sample)| *sum += share * sample);
            }
            for (pixel, (first, shares)) in out.iter_mut().zip(&columns.pixels) {
                *pixel = shares.iter().zip(&line[*first..]).map(|(share, sum)| share * sum).sum();
            }
        },
    );
    pixels
}

/// Returns what arrives at each pixel when every pixel hands its value on by the shares of a 3 × 3 kernel.
pub(crate) fn spread(values: &Array2<f32>, kernel: &[[f64; 3]; 3]) -> Array2<f32> {
    let (n_rows, n_columns) = values.dim();
    let values = values.as_standard_layout();
    let mut spread = Array2::<f32>::zeros((n_rows, n_columns));
    let out_rows = spread.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(n_columns);
    out_rows.enumerate().for_each(|(row, out)| {
        for (kernel_row, shares) in kernel.iter().enumerate() {
            // The value of the pixel above arrives by the share that goes down.
            let Some(from) = (row + 1).checked_sub(kernel_row).filter(|&r| r < n_rows) else { continue };
            let from = values.row(from);
            for (kernel_column, &share) in shares.iter().enumerate() {
                let share = share as f32;
                let first = kernel_column.saturating_sub(1);
                let last = (n_columns + kernel_column).saturating_sub(1).min(n_columns);
                for column in first..last {
                    out[column] += share * from[column + 1 - kernel_column];
                }
            }
        }
    });
    spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn equal_grids_give_the_samples_back() {
        let samples = Array2::from_shape_fn((3, 4), |(r, c)| (10 * r + c) as f32);
        let (rows, columns) = (Overlaps::new(3, 2.0, 3, 2.0, 2.0), Overlaps::new(4, 2.0, 4, 2.0, 2.0));
        assert_eq!(average(&samples, &rows, &columns), samples);
    }

    #[test]
    fn coarse_pixels_average_and_keep_the_flux() {
        let samples = Array2::from_shape_fn((6, 6), |(r, c)| (r * r + 3 * c) as f32);
        let overlaps = || Overlaps::new(6, 1.0, 4, 1.5, 1.5);
        let pixels = average(&samples, &overlaps(), &overlaps());
        assert_relative_eq!(pixels.sum() * 2.25, samples.sum(), max_relative = 1e-6);
        // The first pixel sees sample 0 and half of sample 1 in each direction.
        let expected = (samples[(0, 0)] + 0.5 * (samples[(0, 1)] + samples[(1, 0)]) + 0.25 * samples[(1, 1)]) / 2.25;
        assert_relative_eq!(pixels[(0, 0)], expected, max_relative = 1e-6);
    }

    #[test]
    fn a_small_aperture_sees_its_own_middle_and_the_outside_is_dark() {
        let samples = Array2::from_shape_fn((1, 4), |(_, c)| c as f32);
        let row = Overlaps::new(1, 1.0, 1, 1.0, 1.0);
        // Pixels 2 wide about samples {0, 1} and {2, 3}, with apertures of half a sample about the boundaries.
        let columns = Overlaps::new(4, 1.0, 2, 2.0, 0.5);
        assert_eq!(average(&samples, &row, &columns).as_slice().unwrap(), [0.5, 2.5]);
        let wide = Overlaps::new(4, 1.0, 8, 1.0, 1.0);
        assert_eq!(average(&samples, &row, &wide).as_slice().unwrap(), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0]);
    }

    #[test]
    fn crosstalk_goes_where_the_kernel_says() {
        let mut one = Array2::zeros((4, 5));
        one[(1, 2)] = 1.0;
        let kernel = [[0.01, 0.02, 0.03], [0.04, 0.70, 0.05], [0.06, 0.07, 0.02]];
        let out = spread(&one, &kernel);
        for (r, row) in kernel.iter().enumerate() {
            for (c, &share) in row.iter().enumerate() {
                assert_eq!(out[(r, 1 + c)], share as f32);
            }
        }
        let mut corner = Array2::zeros((4, 5));
        corner[(3, 4)] = 1.0;
        let out = spread(&corner, &kernel);
        assert_relative_eq!(out.sum(), 0.01 + 0.02 + 0.04 + 0.70, max_relative = 1e-6);
    }
}
