//! The profile of an edge: a cubic B-spline with a knot every quarter of a pixel, fitted to all pixels by least squares.
//!
//! ISO 12233 takes means over quarters of a pixel and differences between them. Where the edge's slope is rational, pixels fall on few
//! distances, so that means are not those of the middle of their quarter and some quarters are empty. A spline takes each pixel at its own
//! distance; a slight penalty on its third differences (P-splines: Eilers & Marx, Stat. Sci. 11, 1996) carries it over gaps.

use ndarray::{Array2, ArrayView2};

/// Distance of the knots, pixels.
const KNOT_PX: f64 = 0.25;
/// The weight of squared third differences, pixels a knot: at half a cycle a pixel the response falls by 2e-5.
const SMOOTHNESS: f64 = 1e-4;
/// Entries of a row of a banded matrix, from the diagonal on.
const BAND: usize = 4;

/// A symmetric matrix of rows with as many entries from the diagonal on.
pub(super) type Banded = Vec<[f64; BAND]>;

/// A spline over distances from an edge.
pub(super) struct EdgeProfile {
    first_px: f64,
    coefficients: Vec<f64>,
    /// The decomposition of the normal equations: unit lower triangle and diagonal.
    factors: Banded,
}

impl EdgeProfile {
    /// Returns the profile of the pixels that are used; `None` where there are none.
    pub(super) fn fit(region: &ArrayView2<'_, f32>, distances: &Array2<f64>, used: &Array2<bool>) -> Option<Self> {
        let (first_px, last_px) =
            distances.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &d| (a.min(d), b.max(d)));
        let n = ((last_px - first_px) / KNOT_PX).floor() as usize + BAND;
        let mut matrix: Banded = vec![[0.0; BAND]; n];
        let mut right = vec![0.0; n];
        let mut n_used = 0.0;
        for ((&value, &distance), _) in region.iter().zip(distances).zip(used).filter(|(_, is_used)| **is_used) {
            let (knot, weights) = basis(distance - first_px);
            for i in 0..BAND {
                right[knot + i] += weights[i] * f64::from(value);
                for j in i..BAND {
                    matrix[knot + i][j - i] += weights[i] * weights[j];
                }
            }
            n_used += 1.0;
        }
        let penalty = SMOOTHNESS * n_used / n as f64;
        let third = [-1.0, 3.0, -3.0, 1.0];
        for knot in 0..=n - BAND {
            for i in 0..BAND {
                for j in i..BAND {
                    matrix[knot + i][j - i] += penalty * third[i] * third[j];
                }
            }
        }
        let factors = decomposed(matrix);
        let coefficients = solved(&factors, right);
        (n_used > 0.0 && coefficients.iter().all(|c| c.is_finite())).then_some(Self { first_px, coefficients, factors })
    }

    /// Returns the value and the slope (per pixel) at a distance within those of the pixels.
    pub(super) fn at(&self, distance: f64) -> [f64; 2] {
        let (knot, weights) = basis(distance - self.first_px);
        let slopes = slope_basis(distance - self.first_px);
        let own = &self.coefficients[knot..knot + BAND];
        let sum = |weights: [f64; BAND]| own.iter().zip(weights).map(|(c, w)| c * w).sum();
        [sum(weights), sum(slopes)]
    }

    /// Returns Σ wᵢ wⱼ σ² of pixels of these variances over the coefficients.
    pub(super) fn noise_matrix(&self, variances: impl Iterator<Item = (f64, f64)>) -> Banded {
        let mut matrix: Banded = vec![[0.0; BAND]; self.coefficients.len()];
        for (distance, variance) in variances {
            let (knot, weights) = basis(distance - self.first_px);
            for i in 0..BAND {
                for j in i..BAND {
                    matrix[knot + i][j - i] += variance * weights[i] * weights[j];
                }
            }
        }
        matrix
    }

    /// Returns the sum of slopes at places with weights, and its variance for pixels of a noise matrix.
    pub(super) fn sum_of_slopes(&self, places: impl Iterator<Item = (f64, f64)>, noise: &Banded) -> (f64, f64) {
        let n = self.coefficients.len();
        let mut of_coefficients = vec![0.0; n];
        for (distance, weight) in places {
            let (knot, _) = basis(distance - self.first_px);
            let slopes = slope_basis(distance - self.first_px);
            (0..BAND).for_each(|i| of_coefficients[knot + i] += weight * slopes[i]);
        }
        let sum = of_coefficients.iter().zip(&self.coefficients).map(|(q, c)| q * c).sum();
        // What each pixel adds to the sum is its weights times this.
        let influence = solved(&self.factors, of_coefficients);
        let mut variance = 0.0;
        for (i, row) in noise.iter().enumerate() {
            variance += row[0] * influence[i] * influence[i];
            for k in (1..BAND).take_while(|k| i + k < n) {
                variance += 2.0 * row[k] * influence[i] * influence[i + k];
            }
        }
        (sum, variance)
    }
}

/// Returns the first coefficient that counts at a distance from the first pixel, and the weights of it and the next three.
fn basis(from_first_px: f64) -> (usize, [f64; BAND]) {
    let place = (from_first_px / KNOT_PX).max(0.0);
    let knot = place.floor();
    let (u, v) = (place - knot, 1.0 - (place - knot));
    let weights = [
        v * v * v / 6.0,
        (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
        (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
        u * u * u / 6.0,
    ];
    (knot as usize, weights)
}

/// Returns the slopes of these weights, per pixel.
fn slope_basis(from_first_px: f64) -> [f64; BAND] {
    let place = (from_first_px / KNOT_PX).max(0.0);
    let (u, v) = (place.fract(), 1.0 - place.fract());
    [-0.5 * v * v, 1.5 * u * u - 2.0 * u, 2.0 * v - 1.5 * v * v, 0.5 * u * u].map(|slope| slope / KNOT_PX)
}

/// Returns the triangle and the diagonal of a positive matrix: L D Lᵀ, D in place of the ones of L.
fn decomposed(mut matrix: Banded) -> Banded {
    let n = matrix.len();
    for i in 0..n {
        let row = matrix[i];
        let pivot = row[0].max(f64::MIN_POSITIVE);
        for k in (1..BAND).take_while(|k| i + k < n) {
            let factor = row[k] / pivot;
            for j in k..BAND {
                matrix[i + k][j - k] -= factor * row[j];
            }
            matrix[i][k] = factor;
        }
    }
    matrix
}

fn solved(factors: &Banded, mut right: Vec<f64>) -> Vec<f64> {
    let n = right.len();
    for i in 0..n {
        for k in (1..BAND).take_while(|k| i + k < n) {
            right[i + k] -= factors[i][k] * right[i];
        }
    }
    for i in (0..n).rev() {
        let above: f64 = (1..BAND).take_while(|k| i + k < n).map(|k| factors[i][k] * right[i + k]).sum();
        right[i] = right[i] / factors[i][0].max(f64::MIN_POSITIVE) - above;
    }
    right
}
