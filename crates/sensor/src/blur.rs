//! Gaussian blur with mirrored borders.

use ndarray::Array2;
use rayon::prelude::*;

/// Returns the plane blurred by a Gaussian of this standard deviation in pixels, cut at four of them.
pub(crate) fn gaussian_blur(plane: &Array2<f32>, sigma_px: f64) -> Array2<f32> {
    let reach = (4.0 * sigma_px).ceil().max(1.0) as usize;
    let weight = |i: usize| (-0.5 * ((i as f64 - reach as f64) / sigma_px).powi(2)).exp();
    let sum: f64 = (0..=2 * reach).map(weight).sum();
    let taps: Vec<f32> = (0..=2 * reach).map(|i| (weight(i) / sum) as f32).collect();
    // Along the columns, turned, and once more: the second turn puts the picture upright again.
    blurred_down(&blurred_down(plane, &taps).reversed_axes(), &taps).reversed_axes()
}

fn blurred_down(plane: &Array2<f32>, taps: &[f32]) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    let reach = (taps.len() / 2) as isize;
    let mut blurred = Array2::zeros((rows, columns));
    blurred.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut to)| {
        for (i, &tap) in taps.iter().enumerate() {
            to.scaled_add(tap, &plane.row(mirrored(row as isize + i as isize - reach, rows)));
        }
    });
    blurred
}

/// Returns a place in 0..n, mirrored at the outer sides of the outermost pixels.
fn mirrored(place: isize, n: usize) -> usize {
    let n = n as isize;
    let place = place.rem_euclid(2 * n);
    (if place < n { place } else { 2 * n - 1 - place }) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_a_gaussian_and_a_constant_stays() {
        let mut point = Array2::zeros((41, 51));
        point[(20, 25)] = 1.0;
        let blurred = gaussian_blur(&point, 3.0);
        let expected = |dr: f64, dc: f64| (-(dr * dr + dc * dc) / 18.0).exp() / (18.0 * std::f64::consts::PI);
        for (r, c) in [(20, 25), (23, 25), (20, 21), (25, 30)] {
            let want = expected(r as f64 - 20.0, c as f64 - 25.0);
            assert!((f64::from(blurred[(r, c)]) - want).abs() < 1e-4 * expected(0.0, 0.0), "{r} {c}");
        }
        assert!(gaussian_blur(&Array2::from_elem((5, 9), 0.7), 6.0).iter().all(|v| (v - 0.7).abs() < 1e-6));
    }
}
