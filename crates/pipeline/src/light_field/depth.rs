//! Depth from the disparity of views: for each sample the disparity at which all views agree best.

use dioptric_spectrum::Cancel;
use ndarray::{Array2, Array3, Axis};
use rayon::prelude::*;

use super::{LightField, View, shift::shifted};
use crate::PipelineError;

/// Where depth is sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthSearch {
    /// The least depth, m.
    pub near_m: f64,
    /// The greatest depth, m; may be infinite.
    pub far_m: f64,
    /// Samples around each that are compared with it, each way: more for noise, fewer for small objects.
    pub radius_px: usize,
}

/// Depth as the middle viewpoint sees it, rows × columns.
#[derive(Clone, Debug)]
pub struct DepthEstimate {
    /// How far apart neighboring views show each sample, pixels.
    pub disparity_px: Array2<f32>,
    /// Depth from the center of the entrance pupil, m.
    pub depth_m: Array2<f32>,
    /// How much better the views agree there than at other depths, 0 to 1; near 0 where nothing has a structure.
    pub confidence: Array2<f32>,
}

/// The most that the outermost views move from one disparity that is tried to the next, pixels.
const STEP_PX: f64 = 0.25;
/// The most disparities that are tried.
const MOST_STEPS: usize = 512;

impl LightField {
    /// Estimates the depth of each sample of the middle view.
    ///
    /// Views are smoothed a little, since those that are moved by half a sample lose their finest detail and would agree better
    /// for it. For each of a series of disparities all views that count are moved onto the middle one, and their variance, summed
    /// over channels, is averaged over a window; where it is least a parabola through it and its neighbors tells between them.
    ///
    /// # Errors
    /// When the range of depths makes no sense, there is but one view, or the work is cancelled.
    pub fn depth(&self, search: &DepthSearch, cancel: &Cancel) -> Result<DepthEstimate, PipelineError> {
        let wrong = |reason: String| PipelineError::Unsuitable { what: "the range of depths", reason };
        let geometry = self.geometry();
        let (most, least) = (geometry.disparity_px(search.near_m), geometry.disparity_px(search.far_m));
        if !(search.near_m > 0.0 && search.near_m < search.far_m && most > least) {
            let reason = format!("it is {} to {} m, expected the nearer one first", search.near_m, search.far_m);
            return Err(wrong(reason));
        }
        let soft: Vec<SoftView> = self.whole_views().map(|(view, place)| SoftView::of(view, place)).collect();
        let middle = &self.views[self.rows / 2 * self.columns + self.columns / 2];
        let middle = SoftView::of(middle, [0.0; 2]);
        let reach = soft.iter().flat_map(|view| &view.place).fold(0.0_f64, |most, place| most.max(place.abs()));
        if reach == 0.0 {
            return Err(wrong("there is but one view that counts, expected two at least".to_owned()));
        }
        let n_steps = (((most - least) * reach / STEP_PX).ceil() as usize).clamp(2, MOST_STEPS);
        let step = (most - least) / n_steps as f64;
        let disparity = |i: f64| least + step * i;
        let costs: Vec<Array2<f32>> = (0..=n_steps)
            .into_par_iter()
            .map(|i| {
                cancel.check()?;
                Ok(averaged(&disagreement(&soft, &middle, disparity(i as f64)), search.radius_px))
            })
            .collect::<Result<_, PipelineError>>()?;
        let views: Vec<_> = costs.iter().map(|cost| cost.view()).collect();
        let costs: Array3<f32> = ndarray::stack(Axis(0), &views).expect("planes of one size");
        let (rows, columns) = self.size();
        let best = |row: usize, column: usize| {
            let cost = |i: usize| f64::from(costs[(i, row, column)]);
            let least = (0..=n_steps).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(0);
            let mean = (0..=n_steps).map(cost).sum::<f64>() / (n_steps + 1) as f64;
            let mut between = 0.0;
            if (1..n_steps).contains(&least) {
                let (before, at, after) = (cost(least - 1), cost(least), cost(least + 1));
                let curvature = before - 2.0 * at + after;
                between = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
            }
            let confidence = if mean > 0.0 { 1.0 - cost(least) / mean } else { 0.0 };
            (disparity(least as f64 + between), confidence)
        };
        let found = Array2::from_shape_fn((rows, columns), |(row, column)| best(row, column));
        Ok(DepthEstimate {
            disparity_px: found.map(|(disparity_px, _)| *disparity_px as f32),
            depth_m: found.map(|(disparity_px, _)| geometry.depth_m(*disparity_px) as f32),
            confidence: found.map(|(_, confidence)| *confidence as f32),
        })
    }
}

/// A view without its finest detail.
struct SoftView {
    planes: Vec<Array2<f32>>,
    weight: f32,
    /// How far its viewpoint lies to the right of the middle and above it, in steps between neighbors.
    place: [f64; 2],
}

impl SoftView {
    fn of(view: &View, place: [f64; 2]) -> Self {
        let along = |plane: &Array2<f32>| {
            let (rows, columns) = plane.dim();
            Array2::from_shape_fn((rows, columns), |(row, column)| {
                let beside = plane[(row, column.saturating_sub(1))] + plane[(row, (column + 1).min(columns - 1))];
                0.5 * plane[(row, column)] + 0.25 * beside
            })
        };
        let soft = |plane: &Array2<f32>| along(&along(plane).reversed_axes()).reversed_axes();
        Self { planes: view.planes.iter().map(soft).collect(), weight: view.weight, place }
    }
}

/// Returns the variance of all views that count, moved onto the middle one for a disparity, summed over channels.
fn disagreement(views: &[SoftView], middle: &SoftView, disparity_px: f64) -> Array2<f32> {
    let mut variance = Array2::zeros(middle.planes[0].dim());
    let total: f32 = views.iter().map(|view| view.weight).sum();
    for (channel, about) in middle.planes.iter().enumerate() {
        let (mut sum, mut squares) = (Array2::<f32>::zeros(about.dim()), Array2::<f32>::zeros(about.dim()));
        for SoftView { planes, weight, place: [right, up] } in views {
            // About the middle view, so that squares do not cancel.
            let off = shifted(&planes[channel], disparity_px * right, -disparity_px * up) - about;
            squares.scaled_add(weight / total, &off.map(|v| v * v));
            sum.scaled_add(weight / total, &off);
        }
        variance += &(squares - sum.map(|v| v * v));
    }
    variance
}

/// Returns the mean over a square of this many samples each way, less of it at the border.
fn averaged(plane: &Array2<f32>, radius: usize) -> Array2<f32> {
    let along = |plane: &Array2<f32>| {
        let mut mean = Array2::zeros(plane.dim());
        for (row, mut out) in plane.outer_iter().zip(mean.outer_iter_mut()) {
            let n = row.len();
            for (i, value) in out.iter_mut().enumerate() {
                let part = row.slice(ndarray::s![i.saturating_sub(radius)..(i + radius + 1).min(n)]);
                *value = part.mean().unwrap_or(0.0);
            }
        }
        mean
    };
    along(&along(plane).reversed_axes().as_standard_layout().to_owned()).reversed_axes()
}
