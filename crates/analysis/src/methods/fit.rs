//! What moves, enlarges and blurs one picture into another: weighted least squares on small changes of it.

use ndarray::Array2;
use serde::Serialize;

/// Changes that turn one picture into another, each with one standard error from the noise of the pixels; NaN where the picture does not tell a change from
/// those before it: gain, right, down, blur, magnification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Fit {
    /// Brighter by this share.
    pub gain: f64,
    /// Moved to the right, pixels.
    pub right_px: f64,
    /// Moved down, pixels.
    pub down_px: f64,
    /// Larger about the center, as a share.
    pub magnification: f64,
    /// Wider blur: its variance along one axis, px².
    pub blur_px2: f64,
    /// Standard errors of these, in the same order.
    pub errors: [f64; 5],
}

const N: usize = 5;

/// Fits what a picture is against another of which the standard errors are known, off the pixels to leave out.
///
/// A picture A moved by s changes by −s · ∇A, enlarged by m by −m r · ∇A, and blurred by a kernel of variance v by v/2 ∇²A.
/// The changes are made from the smoothed mean of the two.
pub(super) fn fit(
    picture: &Array2<f32>,
    (against, error): (&Array2<f32>, &Array2<f32>),
    is_left_out: &Array2<bool>,
) -> Fit {
    let (rows, columns) = against.dim();
    let mean = smoothed(&Array2::from_shape_fn((rows, columns), |at| 0.5 * f64::from(picture[at] + against[at])));
    let level = mean.iter().sum::<f64>() / mean.len() as f64;
    let (mut normal, mut right_side) = ([[0.0; N]; N], [0.0; N]);
    for row in 3..rows.saturating_sub(3) {
        for column in 3..columns.saturating_sub(3) {
            if is_left_out[(row, column)] {
                continue;
            }
            let at =
                |down: isize, right: isize| mean[(row.wrapping_add_signed(down), column.wrapping_add_signed(right))];
            let (by_x, by_y) = (0.5 * (at(0, 1) - at(0, -1)), 0.5 * (at(1, 0) - at(-1, 0)));
            let laplacian = at(0, 1) + at(0, -1) + at(1, 0) + at(-1, 0) - 4.0 * at(0, 0);
            let (x, y) = (column as f64 + 0.5 - 0.5 * columns as f64, row as f64 + 0.5 - 0.5 * rows as f64);
            let changes = [at(0, 0), -by_x, -by_y, 0.5 * laplacian, -(x * by_x + y * by_y)];
            // The noise of a pixel, smoothed so that a weight does not follow the pixel's own value.
            let variance = (-2..=2_isize)
                .flat_map(|down| (-2..=2_isize).map(move |right| (down, right)))
                .map(|(down, right)| error[(row.wrapping_add_signed(down), column.wrapping_add_signed(right))])
                .map(|error| f64::from(error).powi(2) / 25.0)
                .sum::<f64>()
                + (1e-3 * level).powi(2);
            let difference = f64::from(picture[(row, column)]) - f64::from(against[(row, column)]);
            for i in 0..N {
                right_side[i] += changes[i] * difference / variance;
                for j in 0..N {
                    normal[i][j] += changes[i] * changes[j] / variance;
                }
            }
        }
    }
    let [gain, right_px, down_px, blur_px2, magnification] = solved(normal, right_side);
    Fit {
        gain: gain.0,
        right_px: right_px.0,
        down_px: down_px.0,
        magnification: magnification.0,
        blur_px2: blur_px2.0,
        errors: [gain, right_px, down_px, magnification, blur_px2].map(|(_, error)| error),
    }
}

/// Returns a picture smoothed by the binomial kernel of five samples, each way.
fn smoothed(picture: &Array2<f64>) -> Array2<f64> {
    const KERNEL: [f64; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    let (rows, columns) = picture.dim();
    let clamped = |i: usize, k: usize, n: usize| (i + k).saturating_sub(2).min(n - 1);
    let along = Array2::from_shape_fn((rows, columns), |(r, c)| {
        (0..5).map(|k| KERNEL[k] * picture[(r, clamped(c, k, columns))]).sum::<f64>()
    });
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        (0..5).map(|k| KERNEL[k] * along[(clamped(r, k, rows), c)]).sum::<f64>()
    })
}

/// The least part of a change, in squares, that is not made by those before it: of less, it is not told from them. Along one straight edge a
/// move down is one to the right, and an enlargement about the middle is a blur.
const LEAST_OF_ITS_OWN: f64 = 0.1;

/// Returns the solution of normal equations and its standard errors, by Cholesky's factors; both are NaN of what those before it make up.
fn solved(matrix: [[f64; N]; N], right_side: [f64; N]) -> [(f64, f64); N] {
    // Scaled to a unit diagonal, so that what is left of each can be judged.
    let scale: [f64; N] = std::array::from_fn(|i| matrix[i][i].sqrt());
    let mut factor = [[0.0; N]; N];
    let mut is_told = [false; N];
    for i in 0..N {
        let dot = |j: usize, factor: &[[f64; N]; N]| (0..i).map(|k| factor[j][k] * factor[i][k]).sum::<f64>();
        let own = 1.0 - dot(i, &factor);
        is_told[i] = scale[i] > 0.0 && scale[i].is_finite() && own >= LEAST_OF_ITS_OWN;
        if is_told[i] {
            factor[i][i] = own.sqrt();
            for j in i + 1..N {
                let part = matrix[j][i] / (scale[i] * scale[j]);
                factor[j][i] = if part.is_finite() { (part - dot(j, &factor)) / factor[i][i] } else { 0.0 };
            }
        } else {
            factor[i] = [0.0; N];
        }
    }
    let told: Vec<usize> = (0..N).filter(|&i| is_told[i]).collect();
    let solution_of = |mut values: [f64; N]| {
        for &i in &told {
            let sum: f64 = told.iter().filter(|&&k| k < i).map(|&k| factor[i][k] * values[k]).sum();
            values[i] = (values[i] - sum) / factor[i][i];
        }
        for &i in told.iter().rev() {
            let sum: f64 = told.iter().filter(|&&k| k > i).map(|&k| factor[k][i] * values[k]).sum();
            values[i] = (values[i] - sum) / factor[i][i];
        }
        values
    };
    let solution = solution_of(std::array::from_fn(|i| right_side[i] / scale[i]));
    std::array::from_fn(|i| {
        let unit = std::array::from_fn(|j| f64::from(u8::from(i == j)));
        let told = |value: f64| if is_told[i] { value / scale[i] } else { f64::NAN };
        (told(solution[i]), told(solution_of(unit)[i].max(0.0).sqrt()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth picture of waves, moved, enlarged and blurred as asked.
    fn waves((right, down): (f64, f64), magnification: f64, blur_px2: f64, gain: f64) -> Array2<f32> {
        let lines = [(0.21, 0.13, 0.4), (-0.17, 0.23, 1.3), (0.05, -0.29, 2.2)];
        Array2::from_shape_fn((60, 80), |(row, column)| {
            let (x, y) = (column as f64 + 0.5 - 40.0 - right, row as f64 + 0.5 - 30.0 - down);
            let (x, y) = (x / (1.0 + magnification), y / (1.0 + magnification));
            let wave = |&(kx, ky, phase): &(f64, f64, f64)| {
                (kx * x + ky * y + phase).sin() * (-0.5 * blur_px2 * (kx * kx + ky * ky)).exp()
            };
            ((1.0 + gain) * (2.0 + 0.4 * lines.iter().map(wave).sum::<f64>())) as f32
        })
    }

    #[test]
    fn small_changes_are_found() {
        let (plain, error) = (waves((0.0, 0.0), 0.0, 0.0, 0.0), Array2::from_elem((60, 80), 0.01_f32));
        let all = Array2::from_elem((60, 80), false);
        let found = fit(&waves((0.05, -0.03), 0.001, 0.2, 0.004), (&plain, &error), &all);
        let pairs = [
            (found.gain, 0.004),
            (found.right_px, 0.05),
            (found.down_px, -0.03),
            (found.magnification, 0.001),
            (found.blur_px2, 0.2),
        ];
        for (found, expected) in pairs {
            // Smoothing and differences over two pixels weaken waves of 20 pixels by 4 % at the most.
            assert!((found / expected - 1.0).abs() < 0.12, "{found} {expected}");
        }
    }

    /// Along one edge through the middle a move and an enlargement are as well another move and a blur.
    #[test]
    fn an_edge_tells_what_it_can() {
        let edge = |shift_px: f64, width_px: f64| {
            Array2::from_shape_fn((60, 80), |(row, column)| {
                let beside = column as f64 - 39.5 - 0.1 * (row as f64 - 29.5) - shift_px;
                (2.0 + (beside / width_px).tanh()) as f32
            })
        };
        let (error, all) = (Array2::from_elem((60, 80), 0.01_f32), Array2::from_elem((60, 80), false));
        // Wider than what it is smoothed by, so that the change is a small one.
        let found = fit(&edge(0.1, 3.1), (&edge(0.0, 3.0), &error), &all);
        // The variance of this edge's slope is π²/12 of its width's square.
        let blur_px2 = std::f64::consts::PI.powi(2) / 12.0 * (3.1_f64.powi(2) - 9.0);
        assert!((found.right_px - 0.1).abs() < 0.01 && (found.blur_px2 / blur_px2 - 1.0).abs() < 0.2, "{found:?}");
        assert!(found.down_px.is_nan() && found.magnification.is_nan() && found.errors[3].is_nan(), "{found:?}");
    }

    #[test]
    fn equal_pictures_need_no_change() {
        let (plain, error) = (waves((0.0, 0.0), 0.0, 0.0, 0.0), Array2::from_elem((60, 80), 0.01_f32));
        let found = fit(&plain, (&plain, &error), &Array2::from_elem((60, 80), false));
        let changes = [found.gain, found.right_px, found.down_px, found.magnification, found.blur_px2];
        assert_eq!(changes, [0.0; 5]);
    }
}
