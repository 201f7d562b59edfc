//! How pixels differ from each other: the spatial parameters of EMVA standard 1288.

use dioptric_fft::Planner;
use ndarray::{Array2, Axis, Zip};
use serde::Serialize;

use crate::{
    PhotonTransfer, SensorError,
    photon_transfer::{HIDDEN_BELOW_DN2, check_size},
};

/// Frames under equal light, added up one by one, so that no more than two are ever held.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameStack {
    n_frames: usize,
    mean: Array2<f64>,
    /// Sums of squares about the mean.
    scatter: Array2<f64>,
}

/// How pixels differ from each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonUniformity {
    /// Dark-signal non-uniformity, rms electrons.
    pub dsnu_e: f64,
    /// One standard error of it, electrons: what is below twice that is not told from noise.
    pub dsnu_error_e: f64,
    /// Photo-response non-uniformity, rms share.
    pub prnu_fraction: f64,
    /// One standard error of it.
    pub prnu_error_fraction: f64,
    /// Whether rounding hides the first: neither temporal noise nor the patterns themselves carry samples over its steps.
    pub dsnu_is_hidden: bool,
    /// Whether it hides the second.
    pub prnu_is_hidden: bool,
    /// What of the first is of rows, of columns and of single pixels, rms electrons: their squares sum to that of the whole.
    pub dsnu_parts_e: Parts,
    /// The same of the second, rms shares.
    pub prnu_parts_fraction: Parts,
}

/// What rows, columns and single pixels have of a quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Parts {
    /// Whole rows.
    pub row: f64,
    /// Whole columns.
    pub column: f64,
    /// Single pixels.
    pub pixel: f64,
}

impl Parts {
    fn map(self, of: impl Fn(f64) -> f64) -> Self {
        Self { row: of(self.row), column: of(self.column), pixel: of(self.pixel) }
    }
}

/// The power of spatial patterns along one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrogram {
    /// Frequencies, cycles a pixel, from one cycle a frame to a half.
    pub frequencies: Vec<f64>,
    /// The root of the power at each, DN; white patterns of a standard deviation have that everywhere.
    pub amplitude_dn: Vec<f64>,
}

impl Spectrogram {
    /// Returns the level of white noise in it: the median.
    pub fn white_dn(&self) -> f64 {
        let mut sorted = self.amplitude_dn.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
    }
}

impl FrameStack {
    /// Adds a frame.
    ///
    /// # Errors
    /// When the frame has another size than those before it.
    pub fn add(&mut self, frame: &Array2<f32>) -> Result<(), SensorError> {
        if self.n_frames == 0 {
            (self.mean, self.scatter) = (Array2::zeros(frame.dim()), Array2::zeros(frame.dim()));
        }
        check_size(self.mean.dim(), frame.dim())?;
        self.n_frames += 1;
        let n = self.n_frames as f64;
        // Welford's update keeps the squares small.
        Zip::from(&mut self.mean).and(&mut self.scatter).and(frame).par_for_each(|mean, scatter, &value| {
            let step = f64::from(value) - *mean;
            *mean += step / n;
            *scatter += step * (f64::from(value) - *mean);
        });
        Ok(())
    }

    /// The number of frames so far.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Returns the mean of all frames and pixels.
    pub fn mean(&self) -> f64 {
        self.mean.mean().unwrap_or(0.0)
    }

    /// Returns the variance over the pixels, without what temporal noise leaves in the mean of so many frames.
    ///
    /// # Errors
    /// When there are fewer than two frames, from which the temporal noise cannot be estimated.
    pub fn spatial_variance(&self) -> Result<f64, SensorError> {
        if self.n_frames < 2 || self.mean.len() < 2 {
            let (expected, found) = ("2 or more".to_owned(), self.n_frames.to_string());
            return Err(SensorError::Shape { what: "frames of a stack", expected, found });
        }
        let (n, n_pixels, mean) = (self.n_frames as f64, self.mean.len() as f64, self.mean());
        let variance = self.mean.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n_pixels - 1.0);
        Ok(variance - self.temporal_variance() / n)
    }
}

impl FrameStack {
    /// Returns the variances of rows, columns and single pixels, whose sum is [`spatial_variance`](Self::spatial_variance) (EMVA 1288,
    /// release 4.0, 8.2: what single pixels leave in the means of rows and columns is taken off).
    ///
    /// # Errors
    /// As [`spatial_variance`](Self::spatial_variance), and when there are fewer than three rows or columns.
    pub fn variance_parts(&self) -> Result<Parts, SensorError> {
        let whole = self.spatial_variance()?;
        let (n_rows, n_columns) = self.mean.dim();
        if n_rows < 3 || n_columns < 3 {
            let (expected, found) = ("3 × 3 or more".to_owned(), format!("{n_rows} × {n_columns}"));
            return Err(SensorError::Shape { what: "rows × columns of a flat frame", expected, found });
        }
        let (rows, columns) = (n_rows as f64, n_columns as f64);
        let of_means = |axis: usize| {
            let means = self.mean.mean_axis(Axis(axis)).expect("frames have pixels");
            let mean = means.sum() / means.len() as f64;
            means.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (means.len() as f64 - 1.0)
        };
        let (of_rows, of_columns) = (of_means(1), of_means(0));
        let temporal = self.temporal_variance() / self.n_frames as f64;
        // With p of pixels and noise: all = r + c + p, means of rows r + p / columns, means of columns c + p / rows.
        let pixels = (whole + temporal - of_rows - of_columns) / (1.0 - 1.0 / columns - 1.0 / rows);
        Ok(Parts { row: of_rows - pixels / columns, column: of_columns - pixels / rows, pixel: pixels - temporal })
    }

    /// Returns one standard error of the spatial variance: that of a variance of so many independent pixels, noise and patterns together.
    fn spatial_variance_error(&self) -> f64 {
        let n_pixels = self.mean.len() as f64;
        let mean = self.mean();
        let all = self.mean.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n_pixels - 1.0);
        all * (2.0 / (n_pixels - 1.0)).sqrt()
    }

    /// Returns whether rounding hides patterns: temporal noise is below that of rounding (EMVA 1288, 6.5), and patterns are below a step.
    fn is_hidden(&self, spatial_variance: f64) -> bool {
        self.temporal_variance() < HIDDEN_BELOW_DN2 && spatial_variance < 1.0
    }

    /// Returns the mean variance of a pixel from frame to frame.
    fn temporal_variance(&self) -> f64 {
        self.scatter.sum() / (self.n_frames as f64 - 1.0) / self.mean.len() as f64
    }

    /// Returns the spectrum of the mean frame along its rows, or along its columns, the mean over the other direction (EMVA 1288, 8.6).
    ///
    /// What temporal noise leaves in the mean frame is in it.
    pub fn spectrogram(&self, is_along_rows: bool) -> Spectrogram {
        let lines = if is_along_rows { self.mean.view() } else { self.mean.t() };
        let (n_lines, n) = lines.dim();
        let mean = self.mean();
        let plan = Planner::new().real_forward(n);
        let (mut input, mut output) = (plan.make_input_vec(), plan.make_output_vec());
        let mut power = vec![0.0; n / 2];
        for line in lines.outer_iter() {
            input.iter_mut().zip(line).for_each(|(sample, value)| *sample = (value - mean) as f32);
            plan.process(&mut input, &mut output).expect("the vectors are those of the plan");
            power.iter_mut().zip(&output[1..]).for_each(|(sum, c)| *sum += f64::from(c.norm_sqr()));
        }
        // White noise of a variance has that at each frequency.
        let scale = 1.0 / (n as f64 * n_lines as f64);
        Spectrogram {
            frequencies: (1..=power.len()).map(|k| k as f64 / n as f64).collect(),
            amplitude_dn: power.into_iter().map(|sum| (sum * scale).sqrt()).collect(),
        }
    }

    /// Returns how far the mean of each pixel is from that of all, DN.
    pub fn deviations_dn(&self) -> Vec<f64> {
        let mean = self.mean();
        self.mean.iter().map(|value| value - mean).collect()
    }
}

impl NonUniformity {
    /// Returns the signal-to-noise ratio of one frame, with what differs from pixel to pixel, for a number of electrons (EMVA 1288, equation
    /// 29).
    pub fn total_snr(&self, transfer: &PhotonTransfer, electrons: f64) -> f64 {
        let spatial = self.dsnu_e.powi(2) + (self.prnu_fraction * electrons).powi(2);
        electrons / (transfer.variance_e2(electrons) + spatial).sqrt()
    }

    /// Returns the non-uniformities that stacks of dark frames and of frames at half saturation show.
    ///
    /// # Errors
    /// When a stack has fewer than two frames, or they differ in size.
    pub fn measure(dark: &FrameStack, bright: &FrameStack, gain_dn_per_e: f64) -> Result<Self, SensorError> {
        check_size(dark.mean.dim(), bright.mean.dim())?;
        let (dark_variance, bright_variance) = (dark.spatial_variance()?, bright.spatial_variance()?);
        let (dark_parts, bright_parts) = (dark.variance_parts()?, bright.variance_parts()?);
        let signal = bright.mean() - dark.mean();
        let root = |variance: f64| variance.max(0.0).sqrt();
        // The rise of the root by one standard error of what stands under it, which is finite at 0 too.
        let rise = |variance: f64, error: f64| root(variance.max(0.0) + error) - root(variance);
        let (dark_error, bright_error) = (dark.spatial_variance_error(), bright.spatial_variance_error());
        let beyond = Parts {
            row: bright_parts.row - dark_parts.row,
            column: bright_parts.column - dark_parts.column,
            pixel: bright_parts.pixel - dark_parts.pixel,
        };
        Ok(Self {
            dsnu_e: root(dark_variance) / gain_dn_per_e,
            dsnu_error_e: rise(dark_variance, dark_error) / gain_dn_per_e,
            prnu_fraction: root(bright_variance - dark_variance) / signal,
            prnu_error_fraction: rise(bright_variance - dark_variance, bright_error.hypot(dark_error)) / signal,
            dsnu_is_hidden: dark.is_hidden(dark_variance),
            prnu_is_hidden: bright.is_hidden(bright_variance),
            dsnu_parts_e: dark_parts.map(|variance| root(variance) / gain_dn_per_e),
            prnu_parts_fraction: beyond.map(|variance| root(variance) / signal),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ndarray::array;

    #[test]
    fn rows_columns_and_pixels_are_told_apart() {
        // Patterns of known deviations, and temporal noise that must not count; twelve even numbers sum to a normal one of variance 1.
        let mut state = 5_u64;
        let mut normal = || {
            let uniform = |state: &mut u64| {
                *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (*state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform(&mut state)).sum::<f64>() - 6.0
        };
        const N: usize = 160;
        let rows: Vec<f64> = (0..N).map(|_| 0.3 * normal()).collect();
        let columns: Vec<f64> = (0..N).map(|_| 0.5 * normal()).collect();
        let fixed = Array2::from_shape_fn((N, N), |(r, c)| 100.0 + rows[r] + columns[c] + normal());
        let mut stack = FrameStack::default();
        for _ in 0..8 {
            stack.add(&fixed.mapv(|v| (v + 2.0 * normal()) as f32)).unwrap();
        }
        let parts = stack.variance_parts().unwrap().map(f64::sqrt);
        let of = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / N as f64;
            (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (N as f64 - 1.0)).sqrt()
        };
        // The lines that were drawn are known; means of 160 pixels of 1.2 DN leave a tenth of one in each.
        assert_relative_eq!(parts.row, of(&rows), max_relative = 0.06);
        assert_relative_eq!(parts.column, of(&columns), max_relative = 0.04);
        assert_relative_eq!(parts.pixel, 1.0, max_relative = 0.02);
        let sum = parts.row.powi(2) + parts.column.powi(2) + parts.pixel.powi(2);
        assert_relative_eq!(sum, stack.spatial_variance().unwrap(), max_relative = 1e-9);
        // Along a row pixels, columns and noise are white: √(1 + 0.25 + 4 / 8).
        let spectrogram = stack.spectrogram(true);
        assert_relative_eq!(spectrogram.white_dn(), 1.75_f64.sqrt(), max_relative = 0.1);
    }

    #[test]
    fn a_wave_stands_out_of_the_spectrogram() {
        let mut stack = FrameStack::default();
        let wave = |c: usize| (10.0 + (std::f64::consts::TAU * 0.125 * c as f64).sin()) as f32;
        stack.add(&Array2::from_shape_fn((16, 64), |(_, c)| wave(c))).unwrap();
        let spectrogram = stack.spectrogram(true);
        let place =
            (0..32).max_by(|&a, &b| spectrogram.amplitude_dn[a].total_cmp(&spectrogram.amplitude_dn[b])).unwrap();
        assert_relative_eq!(spectrogram.frequencies[place], 0.125);
        // A sine of amplitude 1 over n samples: n / 2 of n.
        assert_relative_eq!(spectrogram.amplitude_dn[place], 0.5 * 64.0_f64.sqrt(), max_relative = 1e-4);
        assert!(stack.spectrogram(false).amplitude_dn.iter().all(|v| *v < 5.7));
    }

    #[test]
    fn a_stack_parts_what_changes_from_what_stays() {
        // Pixels at 10, 20 and 30 that flicker by ± 1 about themselves: a temporal variance of 2 from two frames.
        let mut stack = FrameStack::default();
        stack.add(&array![[11.0, 21.0, 31.0]]).unwrap();
        assert!(stack.spatial_variance().is_err());
        stack.add(&array![[9.0, 19.0, 29.0]]).unwrap();
        assert_eq!((stack.n_frames(), stack.mean()), (2, 20.0));
        assert_relative_eq!(stack.spatial_variance().unwrap(), 100.0 - 2.0 / 2.0, max_relative = 1e-12);
        assert!(stack.add(&array![[1.0]]).unwrap_err().to_string().contains("1 × 3"));
    }
}
