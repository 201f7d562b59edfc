//! What light does beside an edge: nothing, a fall to one side (shading), or another edge.

use super::unsuitable;
use crate::{SensorError, least_squares::Normal};

/// Light is looked at from so many standard deviations of the blur and so many pixels from the edge on, and over this many pixels at least.
const FROM_DEVIATIONS: f64 = 6.0;
const FROM_PX: f64 = 6.0;
const FEWEST_PX: usize = 10;
/// A step between means of so many pixels that has this share of the contrast, and of all that a side varies, is another edge.
const STEP_PX: usize = 3;
const ANOTHER_EDGE: f64 = 0.06;
const MOST_OF_ALL: f64 = 0.6;
/// The fall over a side, as a share of the contrast, from which on it is taken off, and beyond which it is refused.
const LEAST_FALL: f64 = 0.01;
const MOST_FALL: f64 = 0.3;
/// How many standard errors a step or a fall must have.
const ERRORS: f64 = 4.0;

/// One side of an edge.
pub(super) struct Side<'a> {
    /// The mean light between two distances from the edge, pixels.
    pub(super) mean: &'a dyn Fn(f64, f64) -> f64,
    /// How far the side reaches, pixels.
    pub(super) reach_px: f64,
    /// The standard deviation of the edge's blur, pixels.
    pub(super) blur_px: f64,
    /// The light of one side of the edge less that of the other.
    pub(super) contrast: f64,
    /// The standard error of the mean over one pixel of distance.
    pub(super) error: f64,
}

impl Side<'_> {
    /// Returns by how much light rises for each pixel away from the edge; 0 where that is not told from noise and the tails of diffraction.
    ///
    /// # Errors
    /// When there is another edge, or light falls so much that no correction holds.
    pub(super) fn rise_per_px(&self) -> Result<f64, SensorError> {
        let from = (FROM_DEVIATIONS * self.blur_px).max(FROM_PX);
        let n = (self.reach_px - from).floor().max(0.0) as usize;
        if n < FEWEST_PX {
            return Ok(0.0);
        }
        let values: Vec<f64> = (0..n).map(|i| (self.mean)(from + i as f64, from + i as f64 + 1.0)).collect();
        let means: Vec<f64> = values.windows(STEP_PX).map(|of| of.iter().sum::<f64>() / STEP_PX as f64).collect();
        let (least, most) = means.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let steps = means.iter().zip(&means[STEP_PX..]).map(|(a, b)| (b - a).abs()).enumerate();
        let (place, step) = steps.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
        let step_error = self.error * (2.0 / STEP_PX as f64).sqrt();
        if step > ANOTHER_EDGE * self.contrast && step > ERRORS * step_error && step > MOST_OF_ALL * (most - least) {
            return Err(unsuitable(format!(
                "has another edge {:.0} pixels beside it, of {:.0} % of its contrast, expected a region of one edge",
                from + (place + STEP_PX) as f64,
                100.0 * step / self.contrast
            )));
        }
        // A level, a line, and the tail of diffraction, which falls as one over the distance.
        let distance = |i: usize| from + i as f64 + 0.5;
        let terms = |i: usize| [1.0, distance(i) / self.reach_px, from / distance(i)];
        let fit = |first: &dyn Fn(usize) -> f64| {
            let mut normal = Normal::new(3);
            (0..n).for_each(|i| normal.add(&terms(i), first(i)));
            normal.solve(0.0)
        };
        let fall = fit(&|i| values[i])[1];
        // The fit is linear: what one pixel more at each place adds, one by one, gives the error.
        let weights = (0..n).map(|place| fit(&|i| f64::from(u8::from(i == place)))[1]);
        let fall_error = self.error * weights.map(|w| w * w).sum::<f64>().sqrt();
        let share = fall.abs() / self.contrast;
        if share < LEAST_FALL || fall.abs() < ERRORS * fall_error {
            return Ok(0.0);
        }
        if share > MOST_FALL {
            return Err(unsuitable(format!(
                "has light beside it that changes by {:.0} % of its contrast, expected at most {:.0} %: even light or a smaller region",
                100.0 * share,
                100.0 * MOST_FALL
            )));
        }
        Ok(fall / self.reach_px)
    }
}
