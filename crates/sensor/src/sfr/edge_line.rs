//! Where a slanted edge lies: the line, or the arc, by which one profile explains the whole region best.

use ndarray::{Array2, ArrayView2};

use super::edge_profile::EdgeProfile;
use crate::least_squares::Normal;

/// The side of the blocks' picture in which a line is looked for, pixels, and the fewest blocks a side.
const COARSE_SIDE: f64 = 128.0;
const FEWEST_BLOCKS: usize = 8;
/// Steps of the angles that are tried, degrees, and how many lie on each side of the best one in the second round.
const ANGLE_STEP_DEG: f64 = 1.0;
const FINE_STEPS: i32 = 10;
/// Rounds of the fit, and the last movement of the line's ends that counts, pixels.
const MOST_ROUNDS: usize = 20;
const LEAST_MOVE_PX: f64 = 1e-5;
/// An edge is taken as bent where its arc is more than this many standard errors high, and this many pixels.
const BENT_ERRORS: f64 = 4.0;
const BENT_PX: f64 = 0.02;

/// An edge that crosses a region's rows: `slope` × row + `bend` × row² columns right of a place in the middle row, rows counted from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgeLine {
    /// Columns per row.
    pub(super) slope: f64,
    /// Columns per squared row.
    pub(super) bend: f64,
}

impl EdgeLine {
    /// Returns how far each pixel of a region lies to the right of the line through the region's middle, along the normal, pixels.
    pub(super) fn distances(self, (rows, columns): (usize, usize)) -> Array2<f64> {
        let cos = 1.0 / self.slope.hypot(1.0);
        let (y0, x0) = (0.5 * (rows - 1) as f64, 0.5 * (columns - 1) as f64);
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let down = row as f64 - y0;
            (column as f64 - x0 - self.slope * down - self.bend * down * down) * cos
        })
    }

    /// Returns the line of a region whose edge is nearer to a column than to a row, from a first guess of its slope; `None` where
    /// no line is found. Pixels that are not `used` do not count.
    ///
    /// Newton's method (Gauss) for what is left of the pixels when their common profile is taken off. The profile's slopes are the
    /// weights, so that noise far from the edge does not count.
    pub(super) fn refined(region: &ArrayView2<'_, f32>, used: &Array2<bool>, first_slope: f64) -> Option<Self> {
        let (straight, _) = Self { slope: first_slope, bend: 0.0 }.descend(region, used, false)?;
        let half = 0.5 * (region.nrows() - 1) as f64;
        let is_bent = |(line, error): &(Self, f64)| {
            let height = line.bend.abs() * half * half;
            height > BENT_PX && height > BENT_ERRORS * error * half * half
        };
        let bent = straight.descend(region, used, true).filter(is_bent);
        Some(bent.map_or(straight, |(line, _)| line))
    }

    /// Returns a better line and the standard error of its bend.
    fn descend(self, region: &ArrayView2<'_, f32>, used: &Array2<bool>, is_bent: bool) -> Option<(Self, f64)> {
        let (rows, columns) = region.dim();
        let y0 = 0.5 * (rows - 1) as f64;
        // The mean square of the rows: the profile takes up any shift.
        let mean = (rows * rows - 1) as f64 / 12.0;
        let n = if is_bent { 2 } else { 1 };
        let (mut line, mut bend_error) = (self, 0.0);
        for _ in 0..MOST_ROUNDS {
            let distances = line.distances((rows, columns));
            let profile = EdgeProfile::fit(region, &distances, used)?;
            let cos = 1.0 / line.slope.hypot(1.0);
            let mut normal = Normal::new(n);
            let (mut squares, mut of_bend) = (0.0, 0.0);
            for ((((row, _), &value), &distance), &is_used) in region.indexed_iter().zip(&distances).zip(used) {
                if !is_used {
                    continue;
                }
                let down = row as f64 - y0;
                let [fitted, slope] = profile.at(distance);
                let left = f64::from(value) - fitted;
                let slopes = [-slope * cos * down, -slope * cos * (down * down - mean)];
                normal.add(&slopes[..n], left);
                squares += left * left;
                of_bend += slopes[1] * slopes[1];
            }
            let step = normal.solve(0.0);
            let bend_step = step.get(1).copied().unwrap_or(0.0);
            line = Self { slope: line.slope + step[0], bend: line.bend + bend_step };
            bend_error = (squares / (rows * columns) as f64 / of_bend.max(f64::MIN_POSITIVE)).sqrt();
            // An edge nearer to a column leans by 45° at most: one that turns further is lost.
            if !(line.slope.abs() < 1.5 && line.bend.is_finite()) {
                return None;
            }
            if step[0].abs() * y0 + bend_step.abs() * y0 * y0 < LEAST_MOVE_PX {
                break;
            }
        }
        Some((line, bend_error))
    }
}

/// Returns the direction in which the light changes, radians from the rows: that along which means explain most of the variance.
/// `None` where all pixels are equal.
pub(super) fn direction_rad(region: &ArrayView2<'_, f32>) -> Option<f64> {
    let blocks = blocks(region);
    let (rows, columns) = blocks.dim();
    let n = blocks.len() as f64;
    let mean = blocks.sum() / n;
    let variance = blocks.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    if !(variance > 1e-12 * mean * mean && variance > 0.0) {
        return None;
    }
    let (y0, x0) = (0.5 * (rows - 1) as f64, 0.5 * (columns - 1) as f64);
    let reach = y0.hypot(x0).ceil() + 1.0;
    let mut bins = vec![(0.0, 0.0); 2 * reach as usize + 2];
    let mut explained = |angle_deg: f64| {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        bins.fill((0.0, 0.0));
        for ((row, column), value) in blocks.indexed_iter() {
            let distance = (column as f64 - x0) * cos + (row as f64 - y0) * sin;
            let bin: &mut (f64, f64) = &mut bins[(distance + reach) as usize];
            *bin = (bin.0 + 1.0, bin.1 + value - mean);
        }
        bins.iter().filter(|bin| bin.0 > 0.0).map(|(n, sum)| sum * sum / n).sum::<f64>()
    };
    let mut best = |angles: &mut dyn Iterator<Item = f64>| {
        angles.map(|deg| (explained(deg), deg)).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, deg)| deg)
    };
    let rough = best(&mut (0..180).map(|i| f64::from(i) * ANGLE_STEP_DEG - 90.0))?;
    let finer = |i: i32| rough + ANGLE_STEP_DEG * f64::from(i) / f64::from(FINE_STEPS);
    Some(best(&mut (-FINE_STEPS..=FINE_STEPS).map(finer))?.to_radians())
}

/// Returns means of square blocks of pixels: single pixels in a small region.
fn blocks(region: &ArrayView2<'_, f32>) -> Array2<f64> {
    let (rows, columns) = region.dim();
    let wanted = ((rows as f64 * columns as f64).sqrt() / COARSE_SIDE).ceil() as usize;
    let step = wanted.clamp(1, rows.min(columns) / FEWEST_BLOCKS);
    Array2::from_shape_fn((rows / step, columns / step), |(row, column)| {
        let block = region.slice(ndarray::s![row * step..(row + 1) * step, column * step..(column + 1) * step]);
        block.iter().map(|v| f64::from(*v)).sum::<f64>() / (step * step) as f64
    })
}
