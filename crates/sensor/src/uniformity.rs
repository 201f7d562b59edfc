//! How pixels differ from each other: the spatial parameters of EMVA standard 1288.

use ndarray::{Array2, Zip};

use crate::{SensorError, photon_transfer::check_size};

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
    /// Photo-response non-uniformity, rms share.
    pub prnu_fraction: f64,
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
        let temporal = self.scatter.sum() / (n - 1.0) / n_pixels;
        Ok(variance - temporal / n)
    }
}

impl NonUniformity {
    /// Returns the non-uniformities that stacks of dark frames and of frames at half saturation show.
    ///
    /// # Errors
    /// When a stack has fewer than two frames, or they differ in size.
    pub fn measure(dark: &FrameStack, bright: &FrameStack, gain_dn_per_e: f64) -> Result<Self, SensorError> {
        check_size(dark.mean.dim(), bright.mean.dim())?;
        let (dark_variance, bright_variance) = (dark.spatial_variance()?, bright.spatial_variance()?);
        Ok(Self {
            dsnu_e: dark_variance.max(0.0).sqrt() / gain_dn_per_e,
            prnu_fraction: (bright_variance - dark_variance).max(0.0).sqrt() / (bright.mean() - dark.mean()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ndarray::array;

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
