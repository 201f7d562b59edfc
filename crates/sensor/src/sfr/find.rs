//! Slanted edges, found in a picture.

use ndarray::{Array2, ArrayView2};

use super::SLANTS_DEG;
use crate::SensorError;

/// A square counts as an edge where its score has this share of that of the best.
const LEAST_OF_BEST: f64 = 0.02;

/// Returns the corner of the square that most looks like a single slanted edge.
///
/// # Errors
/// When the picture is smaller than the square, or no square holds a single slanted edge.
pub fn find_edge(picture: &Array2<f32>, side: usize) -> Result<(usize, usize), SensorError> {
    let (rows, columns) = picture.dim();
    if side < 16 || rows < side || columns < side {
        let (expected, found) = (format!("{side} × {side}, and 16 × 16"), format!("{rows} × {columns}"));
        return Err(SensorError::Shape {
            what: "rows × columns of a picture with an edge (at least)",
            expected,
            found,
        });
    }
    let best = scored(picture, side).into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, corner)| corner).ok_or_else(nowhere)
}

/// Returns the corners of all squares that look like a single slanted edge and do not overlap, most like one first.
///
/// # Errors
/// As [`find_edge`].
pub fn find_edges(picture: &Array2<f32>, side: usize) -> Result<Vec<(usize, usize)>, SensorError> {
    let best = find_edge(picture, side)?;
    let mut squares = scored(picture, side);
    squares.sort_by(|a, b| b.0.total_cmp(&a.0));
    let most = squares.first().map_or(0.0, |(score, _)| *score);
    let mut kept: Vec<(usize, usize)> = vec![best];
    for (score, corner) in squares {
        let is_beside = |other: &(usize, usize)| corner.0.abs_diff(other.0) < side && corner.1.abs_diff(other.1) < side;
        if score >= LEAST_OF_BEST * most && !kept.iter().any(is_beside) {
            kept.push(corner);
        }
    }
    Ok(kept)
}

fn nowhere() -> SensorError {
    SensorError::Unsuitable { what: "the slanted edge", reason: "is nowhere in the picture".to_owned() }
}

/// Returns the squares that look like edges, with how much they do.
fn scored(picture: &Array2<f32>, side: usize) -> Vec<(f64, (usize, usize))> {
    let (rows, columns) = picture.dim();
    let step = (side / 4).max(1);
    let corners = (0..=rows - side).step_by(step).flat_map(|r| (0..=columns - side).step_by(step).map(move |c| (r, c)));
    let score = |(r, c): (usize, usize)| Tensor::of(&picture.slice(ndarray::s![r..r + side, c..c + side])).edge_score();
    corners.map(|corner| (score(corner), corner)).filter(|(score, _)| *score > 0.0).collect()
}

/// The structure tensor of a region: the mean products of its slopes, and where the slopes are.
struct Tensor {
    xx: f64,
    xy: f64,
    yy: f64,
    /// How far that is from the region's middle, as a share of its height and width.
    off_center: f64,
}

impl Tensor {
    fn of(region: &ArrayView2<'_, f32>) -> Self {
        let (rows, columns) = region.dim();
        let (mut xx, mut xy, mut yy, mut x_mean, mut y_mean) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for row in 1..rows - 1 {
            for column in 1..columns - 1 {
                let at = |r: usize, c: usize| f64::from(region[(r, c)]);
                // Sobel's slopes are the same in all directions to a few degrees.
                let smooth = |a: f64, b: f64, c: f64| 0.25 * (a + 2.0 * b + c);
                let (r, c) = (row, column);
                let dx = smooth(at(r - 1, c + 1), at(r, c + 1), at(r + 1, c + 1))
                    - smooth(at(r - 1, c - 1), at(r, c - 1), at(r + 1, c - 1));
                let dy = smooth(at(r + 1, c - 1), at(r + 1, c), at(r + 1, c + 1))
                    - smooth(at(r - 1, c - 1), at(r - 1, c), at(r - 1, c + 1));
                let square = dx * dx + dy * dy;
                (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
                x_mean += square * (c as f64 / (columns - 1) as f64 - 0.5);
                y_mean += square * (r as f64 / (rows - 1) as f64 - 0.5);
            }
        }
        let energy = (xx + yy).max(f64::MIN_POSITIVE);
        let (down, right) = (y_mean / energy, x_mean / energy);
        Self { xx, xy, yy, off_center: down.hypot(right) }
    }

    /// Returns the direction in which the light changes, radians from the rows.
    fn direction_rad(&self) -> Option<f64> {
        (self.xx + self.yy > 0.0).then(|| 0.5 * (2.0 * self.xy).atan2(self.xx - self.yy))
    }

    /// Returns how much a region looks like one slanted edge through its middle; 0 where the slant does not do.
    fn edge_score(&self) -> f64 {
        let Some(direction_rad) = self.direction_rad() else { return 0.0 };
        let slant_deg = ((direction_rad.to_degrees().rem_euclid(90.0) + 45.0).rem_euclid(90.0) - 45.0).abs();
        if !SLANTS_DEG.contains(&slant_deg) {
            return 0.0;
        }
        let energy = self.xx + self.yy;
        // 1 where all slopes point the same way; a corner or a texture has much less.
        let coherence = (self.xx - self.yy).hypot(2.0 * self.xy) / energy;
        energy.sqrt() * coherence.powi(8) * (-(self.off_center / 0.1).powi(2)).exp()
    }
}
