//! What moves, enlarges and blurs one picture into another: weighted least squares on small changes of it.

use ndarray::Array2;
use serde::Serialize;

/// Changes that turn one picture into another, each with one standard error from the noise of the pixels.
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
            let changes = [at(0, 0), -by_x, -by_y, -(x * by_x + y * by_y), 0.5 * laplacian];
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
    let Some(inverse) = inverted(normal) else { return Fit::default() };
    let solution: [f64; N] = std::array::from_fn(|i| (0..N).map(|j| inverse[i][j] * right_side[j]).sum());
    let [gain, right_px, down_px, magnification, blur_px2] = solution;
    let errors = std::array::from_fn(|i| inverse[i][i].max(0.0).sqrt());
    Fit { gain, right_px, down_px, magnification, blur_px2, errors }
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

/// Returns the inverse of a positive definite matrix by Gauss and Jordan, or `None` where it is singular.
fn inverted(matrix: [[f64; N]; N]) -> Option<[[f64; N]; N]> {
    // Scaled to a unit diagonal, so that pivots can be judged.
    let scale: [f64; N] = std::array::from_fn(|i| matrix[i][i].sqrt());
    if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
        return None;
    }
    let mut left: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| matrix[i][j] / scale[i] / scale[j]));
    let mut right: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for pivot in 0..N {
        let by = left[pivot][pivot];
        if by.abs() < 1e-10 {
            return None;
        }
        (left[pivot], right[pivot]) = (left[pivot].map(|v| v / by), right[pivot].map(|v| v / by));
        for row in (0..N).filter(|row| *row != pivot) {
            let factor = left[row][pivot];
            for column in 0..N {
                left[row][column] -= factor * left[pivot][column];
                right[row][column] -= factor * right[pivot][column];
            }
        }
    }
    Some(std::array::from_fn(|i| std::array::from_fn(|j| right[i][j] / scale[i] / scale[j])))
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

    #[test]
    fn equal_pictures_need_no_change() {
        let (plain, error) = (waves((0.0, 0.0), 0.0, 0.0, 0.0), Array2::from_elem((60, 80), 0.01_f32));
        let found = fit(&plain, (&plain, &error), &Array2::from_elem((60, 80), false));
        assert_eq!([found.gain, found.right_px, found.magnification, found.blur_px2], [0.0; 4]);
    }
}
