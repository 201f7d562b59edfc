//! How alike two pictures are, code by code and structure by structure.

use ndarray::{Array2, Array3};
use rayon::prelude::*;

use crate::{Picture, SensorError, blur::gaussian_blur};

/// Returns the peak signal-to-noise ratio of codes, dB, the peak being 1; infinity for equal pictures.
///
/// # Errors
/// When the pictures differ in size.
pub fn psnr_db(first: &Picture, second: &Picture) -> Result<f64, SensorError> {
    check_sizes(&first.codes, &second.codes)?;
    let row_sums: Vec<f64> = (first.codes.outer_iter().into_par_iter())
        .zip(second.codes.outer_iter())
        .map(|(a, b)| a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum())
        .collect();
    Ok(-10.0 * (row_sums.iter().sum::<f64>() / first.codes.len() as f64).log10())
}

/// Returns the mean structural similarity of the luma codes, 1 for equal pictures.
///
/// Wang, Bovik, Sheikh & Simoncelli, IEEE Transactions on Image Processing 13 (2004): a Gaussian window of 1.5 pixels,
/// K₁ = 0.01, K₂ = 0.03, luma after ITU-R BT.601.
///
/// # Errors
/// When the pictures differ in size.
pub fn ssim(first: &Picture, second: &Picture) -> Result<f64, SensorError> {
    check_sizes(&first.codes, &second.codes)?;
    const WINDOW_PX: f64 = 1.5;
    let (c1, c2) = (0.01_f32.powi(2), 0.03_f32.powi(2));
    let (a, b) = (luma(&first.codes), luma(&second.codes));
    let mean = |plane: &Array2<f32>| gaussian_blur(plane, WINDOW_PX);
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let (aa, bb, ab) = (mean(&(&a * &a)), mean(&(&b * &b)), mean(&(&a * &b)));
    let rows: Vec<f64> = (0..a.nrows())
        .into_par_iter()
        .map(|row| {
            let similarity = |column: usize| {
                let at = (row, column);
                let (ma, mb) = (mean_a[at], mean_b[at]);
                let (va, vb, vab) = (aa[at] - ma * ma, bb[at] - mb * mb, ab[at] - ma * mb);
                f64::from((2.0 * ma * mb + c1) * (2.0 * vab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2)))
            };
            (0..a.ncols()).map(similarity).sum()
        })
        .collect();
    Ok(rows.iter().sum::<f64>() / a.len() as f64)
}

fn luma(codes: &Array3<f32>) -> Array2<f32> {
    let (rows, columns, _) = codes.dim();
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        0.299 * codes[(r, c, 0)] + 0.587 * codes[(r, c, 1)] + 0.114 * codes[(r, c, 2)]
    })
}

pub(crate) fn check_sizes(first: &Array3<f32>, second: &Array3<f32>) -> Result<(), SensorError> {
    let text = |codes: &Array3<f32>| format!("{} × {}", codes.dim().0, codes.dim().1);
    if first.dim() == second.dim() {
        return Ok(());
    }
    let (expected, found) = (text(first), text(second));
    Err(SensorError::Shape { what: "rows × columns of the second picture", expected, found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ColorSpace;
    use approx::assert_relative_eq;

    fn picture(code: impl Fn(usize, usize, usize) -> f32) -> Picture {
        Picture { codes: Array3::from_shape_fn((24, 32, 3), |(r, c, i)| code(r, c, i)), space: ColorSpace::Srgb }
    }

    #[test]
    fn a_constant_difference_has_its_psnr() {
        let (a, b) = (picture(|_, _, _| 0.5), picture(|_, _, _| 0.6));
        assert_relative_eq!(psnr_db(&a, &b).unwrap(), 20.0, max_relative = 1e-5);
        assert_eq!(psnr_db(&a, &a).unwrap(), f64::INFINITY);
        assert!(psnr_db(&a, &Picture { codes: Array3::zeros((2, 2, 3)), space: ColorSpace::Srgb }).is_err());
    }

    #[test]
    fn structure_counts_more_than_level() {
        let texture = |r: usize, c: usize| 0.5 + 0.2 * ((r * 7 + c * 3) as f32).sin();
        let (a, lighter, other) = (
            picture(|r, c, _| texture(r, c)),
            picture(|r, c, _| texture(r, c) + 0.05),
            picture(|r, c, _| 1.0 - texture(r, c)),
        );
        assert_relative_eq!(ssim(&a, &a).unwrap(), 1.0, max_relative = 1e-5);
        assert!(ssim(&a, &lighter).unwrap() > 0.9);
        assert!(ssim(&a, &other).unwrap() < 0.0);
        // Two flat pictures: (2 × 0.5 × 0.6 + C1) / (0.25 + 0.36 + C1).
        let flat = ssim(&picture(|_, _, _| 0.5), &picture(|_, _, _| 0.6)).unwrap();
        assert_relative_eq!(flat, 0.6001 / 0.6101, max_relative = 1e-3);
    }
}
