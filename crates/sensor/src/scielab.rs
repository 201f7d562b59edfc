//! Spatial CIELAB: color differences as the eye sees them at a distance, and the visual signal-to-noise ratio.
//!
//! Zhang & Wandell, "A spatial extension of CIELAB for digital color-image reproduction", SID Journal 5 (1997): the
//! picture is parted into light–dark, red–green and blue–yellow, each is blurred as the eye blurs it, and CIELAB is taken
//! of the result.

use dioptric_spectrum::{Lab, Xyz, delta_e_2000};
use ndarray::{Array2, Array3, ArrayView3};
use rayon::prelude::*;

use crate::{SensorError, blur::gaussian_blur, similarity::check_sizes};

/// Opponent colors from XYZ (the paper's equation for the 1931 observer).
const OPPONENT_FROM_XYZ: [[f64; 3]; 3] = [[0.279, 0.72, -0.107], [-0.449, 0.29, -0.077], [0.086, -0.59, 0.501]];
const XYZ_FROM_OPPONENT: [[f64; 3]; 3] = [
    [0.626_554_504, -1.867_177_598, -0.153_156_373],
    [1.369_855_450, 0.934_755_824, 0.436_229_005],
    [1.505_650_755, 1.421_323_772, 2.536_021_080],
];

/// The eye's blur of each opponent color: weights, and spreads s of exp(−r² / s²) in degrees (the paper's table 1).
const KERNELS: [&[(f64, f64)]; 3] = [
    &[(0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)],
    &[(0.531, 0.0392), (0.330, 0.494)],
    &[(0.488, 0.0536), (0.371, 0.386)],
];

/// Returns ΔE₀₀ at each pixel of two pictures in linear sRGB, as seen at a number of pixels a degree.
///
/// # Errors
/// When the pictures differ in size or the number is not above 0.
pub fn scielab_delta_e(
    first: &Array3<f32>,
    second: &Array3<f32>,
    pixels_per_degree: f64,
) -> Result<Array2<f32>, SensorError> {
    check_sizes(first, second)?;
    let (first, second) = (seen(first, pixels_per_degree)?, seen(second, pixels_per_degree)?);
    let (rows, columns) = first.dim();
    let row = |row: usize| {
        let (first, second) = (&first, &second);
        (0..columns).map(move |column| delta_e_2000(first[(row, column)], second[(row, column)]) as f32)
    };
    let delta_e = (0..rows).into_par_iter().flat_map_iter(row).collect();
    Ok(Array2::from_shape_vec((rows, columns), delta_e).expect("one difference a pixel"))
}

/// Returns the visual signal-to-noise ratio of an even patch in linear sRGB: one over the rms color difference (ΔE₀₀ of
/// S-CIELAB) of its pixels from their mean, as seen at a number of pixels a degree.
///
/// After Farrell, Okincha, Parmar & Wandell, "Using visible SNR (vSNR) to compare the image quality of pixel binning and
/// digital resizing", Proc. SPIE 7537 (2010). A patch without noise gives infinity.
///
/// # Errors
/// When the number is not above 0.
pub fn visual_snr(patch: &ArrayView3<'_, f32>, pixels_per_degree: f64) -> Result<f64, SensorError> {
    let seen = seen(&patch.to_owned(), pixels_per_degree)?;
    let n = seen.len() as f64;
    let mean = |part: fn(&Lab) -> f64| seen.iter().map(part).sum::<f64>() / n;
    let mean = Lab { l: mean(|lab| lab.l), a: mean(|lab| lab.a), b: mean(|lab| lab.b) };
    let square = seen.iter().map(|lab| delta_e_2000(*lab, mean).powi(2)).sum::<f64>() / n;
    Ok(1.0 / square.sqrt())
}

/// Returns CIELAB of a picture in linear sRGB as the eye sees it.
fn seen(linear: &Array3<f32>, pixels_per_degree: f64) -> Result<Array2<Lab>, SensorError> {
    if !(pixels_per_degree > 0.0 && pixels_per_degree.is_finite()) {
        return Err(SensorError::value("the view", "pixels_per_degree", pixels_per_degree, "a number above 0"));
    }
    let (rows, columns, _) = linear.dim();
    let xyz_at = |r: usize, c: usize| Xyz::from_linear_srgb([0, 1, 2].map(|i| f64::from(linear[(r, c, i)]))).0;
    let blurred = [0, 1, 2].map(|opponent| {
        let weights = OPPONENT_FROM_XYZ[opponent];
        let plane = Array2::from_shape_fn((rows, columns), |(r, c)| {
            xyz_at(r, c).iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() as f32
        });
        // The weights are made to sum to 1, so that an even picture keeps its color.
        let total: f64 = KERNELS[opponent].iter().map(|(weight, _)| weight).sum();
        let mut sum = Array2::<f32>::zeros((rows, columns));
        for (weight, spread_deg) in KERNELS[opponent] {
            let sigma_px = spread_deg * pixels_per_degree / std::f64::consts::SQRT_2;
            sum.scaled_add((weight / total) as f32, &gaussian_blur(&plane, sigma_px));
        }
        sum
    });
    Ok(Array2::from_shape_fn((rows, columns), |at| {
        let opponent = [0, 1, 2].map(|i| f64::from(blurred[i][at]));
        let xyz = XYZ_FROM_OPPONENT.map(|row| row.iter().zip(opponent).map(|(m, o)| m * o).sum::<f64>());
        Xyz(xyz).to_lab(Xyz::D65)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_matrices_are_inverse() {
        for (i, row) in OPPONENT_FROM_XYZ.iter().enumerate() {
            for j in [0, 1, 2] {
                let product: f64 = row.iter().zip(XYZ_FROM_OPPONENT).map(|(m, inverse)| m * inverse[j]).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-6, "{i} {j}: {product}");
            }
        }
    }

    #[test]
    fn even_pictures_differ_by_delta_e_and_fine_patterns_fade_with_distance() {
        let even = |rgb: [f32; 3]| Array3::from_shape_fn((40, 40, 3), |(_, _, i)| rgb[i]);
        let (a, b) = (even([0.5, 0.4, 0.3]), even([0.5, 0.45, 0.3]));
        let lab = |rgb: [f64; 3]| Xyz::from_linear_srgb(rgb).to_lab(Xyz::D65);
        let wanted = delta_e_2000(lab([0.5, 0.4, 0.3]), lab([0.5, 0.45, 0.3]));
        for value in scielab_delta_e(&a, &b, 60.0).unwrap() {
            assert!((f64::from(value) - wanted).abs() < 1e-2, "{value} instead of {wanted}");
        }
        let checkered = Array3::from_shape_fn((40, 40, 3), |(r, c, _)| if (r + c) % 2 == 0 { 0.7 } else { 0.3 });
        let gray = even([0.5; 3]);
        let mean = |ppd| f64::from(scielab_delta_e(&checkered, &gray, ppd).unwrap().mean().unwrap());
        assert!(mean(10.0) > 5.0 && mean(100.0) < 0.5, "{} {}", mean(10.0), mean(100.0));
        assert!(scielab_delta_e(&a, &b, 0.0).is_err());
    }

    #[test]
    fn noise_is_seen_less_from_farther_away() {
        let noisy = Array3::from_shape_fn((64, 64, 3), |(r, c, i)| {
            0.5 + 0.05 * ((r * 31 + c * 17 + i * 7) as f32 * 12.9).sin()
        });
        let snr = |ppd| visual_snr(&noisy.view(), ppd).unwrap();
        assert!(snr(100.0) > 2.0 * snr(20.0));
        // Rounding in the blur is all that is left of an even patch.
        assert!(visual_snr(&Array3::from_elem((16, 16, 3), 0.5).view(), 50.0).unwrap() > 1e3);
    }
}
