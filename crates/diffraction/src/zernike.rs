//! Zernike's polynomials on the unit disc, in Noll's order and normalisation, and in those of the Fringe set.
//!
//! Each of Noll's has mean square 1 over the disc, so that the coefficients of a wavefront are the rms of its parts. The order
//! (from 1): piston, tilt x, tilt y, defocus, astigmatism at 45°, astigmatism along the axes, coma y, coma x,
//! trefoil y, trefoil x, spherical aberration, …

use dioptric_optics::zernike::{fringe_degrees, noll_degrees};
use glam::DVec2;

/// Returns Noll's `j`-th polynomial (from 1) at a point, in units of the disc's radius.
pub fn noll(j: usize, at: DVec2) -> f64 {
    let (n, m) = noll_degrees(j);
    let order = m.unsigned_abs();
    let (rho, theta) = (at.length(), at.y.atan2(at.x));
    let norm = f64::from(n + 1).sqrt();
    let angular = f64::from(order) * theta;
    match m {
        0 => norm * radial(n, 0, rho),
        1.. => norm * std::f64::consts::SQRT_2 * radial(n, order, rho) * angular.cos(),
        _ => norm * std::f64::consts::SQRT_2 * radial(n, order, rho) * angular.sin(),
    }
}

/// Returns the `j`-th polynomial of the Fringe set (from 1, at most 37) at a point, in units of the disc's radius: at most 1 at the edge.
pub fn fringe(j: usize, at: DVec2) -> f64 {
    let (n, m) = fringe_degrees(j);
    let (rho, theta) = (at.length(), at.y.atan2(at.x));
    let angular = f64::from(m.unsigned_abs()) * theta;
    radial(n, m.unsigned_abs(), rho) * if m < 0 { angular.sin() } else { angular.cos() }
}

/// The radial polynomial, by its recurrence in the degree: stable, unlike the sum of factorials.
fn radial(n: u32, m: u32, rho: f64) -> f64 {
    let (mut below, mut here) = (0.0, rho.powi(m as i32));
    let mut degree = m;
    let m = f64::from(m);
    while degree < n {
        // R(n+2) from R(n) and R(n−2), all of one m.
        let k = f64::from(degree);
        let next = if degree == m as u32 {
            ((m + 2.0) * rho * rho - (m + 1.0)) * here
        } else {
            let a = 4.0 * (k + 1.0) * (k + 2.0) * k * rho * rho;
            let b = 2.0 * (k + 1.0) * (m * m + k * (k + 2.0));
            let c = (k + m) * (k - m) * (k + 2.0);
            ((a - b) * here - c * below) / ((k + m + 2.0) * (k - m + 2.0) * k)
        };
        (below, here) = (here, next);
        degree += 2;
    }
    here
}

/// Returns the coefficients of the first `n_terms` polynomials that fit the values best, by weighted least squares.
///
/// The points need not fill the disc, but must determine the polynomials; a polynomial that they do not distinguish from
/// those before it gets the coefficient 0. Weights are those of a quadrature: some may be negative, where a hole is
/// taken away from a whole.
pub fn fit(
    polynomial: fn(usize, DVec2) -> f64,
    points: &[DVec2],
    values: &[f64],
    weights: &[f64],
    n_terms: usize,
) -> Vec<f64> {
    // Gram and Schmidt, each column made orthogonal twice, which is as good as Householder.
    let dot = |a: &[f64], b: &[f64]| -> f64 { weights.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum() };
    let mut rest = values.to_vec();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(n_terms);
    let mut upper = vec![vec![0.0; n_terms]; n_terms];
    let mut along = vec![0.0; n_terms];
    for term in 0..n_terms {
        let mut column: Vec<f64> = points.iter().map(|p| polynomial(term + 1, *p)).collect();
        let length = dot(&column, &column).max(0.0).sqrt();
        for _ in 0..2 {
            for (row, q) in basis.iter().enumerate() {
                let share = dot(q, &column);
                upper[row][term] += share;
                subtract(&mut column, q, share);
            }
        }
        let left = dot(&column, &column).max(0.0).sqrt();
        let is_new = left > 1e-10 * length;
        upper[term][term] = if is_new { left } else { 0.0 };
        column.iter_mut().for_each(|c| *c = if is_new { *c / left } else { 0.0 });
        along[term] = dot(&column, &rest);
        subtract(&mut rest, &column, along[term]);
        basis.push(column);
    }
    let mut coefficients = vec![0.0; n_terms];
    for term in (0..n_terms).rev() {
        let above: f64 = (term + 1..n_terms).map(|k| upper[term][k] * coefficients[k]).sum();
        coefficients[term] = if upper[term][term] > 0.0 { (along[term] - above) / upper[term][term] } else { 0.0 };
    }
    coefficients
}

fn subtract(from: &mut [f64], what: &[f64], times: f64) {
    for (from, what) in from.iter_mut().zip(what) {
        *from -= times * what;
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;
    use dioptric_optics::{quadrature::gauss_legendre_on, zernike::FRINGE_TERMS};

    fn disc() -> (Vec<DVec2>, Vec<f64>) {
        let radii = gauss_legendre_on(16, 0.0, 1.0);
        let ring = |i: i32| TAU * f64::from(i) / 40.0;
        let points = (0..40).flat_map(|i| radii.iter().map(move |(r, w)| (DVec2::from_angle(ring(i)) * *r, r * w)));
        points.map(|(p, w)| (p, w * TAU / 40.0 / PI)).unzip()
    }

    #[test]
    fn order_is_that_of_noll() {
        let expected = [
            (0, 0),
            (1, 1),
            (1, -1),
            (2, 0),
            (2, -2),
            (2, 2),
            (3, -1),
            (3, 1),
            (3, -3),
            (3, 3),
            (4, 0),
            (4, 2),
            (4, -2),
            (4, 4),
            (4, -4),
            (5, 1),
            (5, -1),
            (5, 3),
            (5, -3),
            (5, 5),
            (5, -5),
            (6, 0),
        ];
        for (i, degrees) in expected.into_iter().enumerate() {
            assert_eq!(noll_degrees(i + 1), degrees, "Z{}", i + 1);
        }
    }

    #[test]
    fn polynomials_are_those_of_the_books() {
        let at = DVec2::new(0.3, -0.5);
        let r2: f64 = 0.34;
        let expected = [
            (4, 3f64.sqrt() * (2.0 * r2 - 1.0)),
            (5, 6f64.sqrt() * 2.0 * 0.3 * -0.5),
            (6, 6f64.sqrt() * (0.09 - 0.25)),
            (7, 8f64.sqrt() * (3.0 * r2 - 2.0) * -0.5),
            (8, 8f64.sqrt() * (3.0 * r2 - 2.0) * 0.3),
            (11, 5f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0)),
            (22, 7f64.sqrt() * (20.0 * r2.powi(3) - 30.0 * r2 * r2 + 12.0 * r2 - 1.0)),
        ];
        for (j, value) in expected {
            assert!((noll(j, at) - value).abs() < 1e-14, "Z{j}: {} {value}", noll(j, at));
        }
    }

    #[test]
    fn fringe_set_is_that_of_the_table() {
        let expected =
            [(0, 0), (1, 1), (1, -1), (2, 0), (2, 2), (2, -2), (3, 1), (3, -1), (4, 0), (3, 3), (3, -3), (4, 2)];
        for (i, degrees) in expected.into_iter().enumerate() {
            assert_eq!(fringe_degrees(i + 1), degrees, "Z{}", i + 1);
        }
        assert_eq!([16, 25, 36, 37].map(fringe_degrees), [(6, 0), (8, 0), (10, 0), (12, 0)]);
        assert_eq!([26, 27, 35].map(fringe_degrees), [(5, 5), (5, -5), (9, -1)]);
        let (at, r2): (DVec2, f64) = (DVec2::new(0.3, -0.5), 0.34);
        for (j, value) in [
            (4, 2.0 * r2 - 1.0),
            (5, 0.09 - 0.25),
            (8, (3.0 * r2 - 2.0) * -0.5),
            (9, 6.0 * r2 * r2 - 6.0 * r2 + 1.0),
            (11, 3.0 * 0.09 * -0.5 + 0.125),
        ] {
            assert!((fringe(j, at) - value).abs() < 1e-14, "Z{j}");
        }
        // Each is Noll's of its degrees, over Noll's norm.
        for j in 1..=FRINGE_TERMS {
            let (n, m) = fringe_degrees(j);
            let same = (1..200).find(|&k| noll_degrees(k) == (n, m)).unwrap();
            let norm = (f64::from(n + 1) * if m == 0 { 1.0 } else { 2.0 }).sqrt();
            assert!((noll(same, at) / norm - fringe(j, at)).abs() < 1e-13, "Z{j}");
        }
    }

    #[test]
    fn polynomials_are_orthonormal_over_the_disc() {
        let (points, weights) = disc();
        for a in 1..=37 {
            for b in 1..=a {
                let product: f64 = points.iter().zip(&weights).map(|(p, w)| w * noll(a, *p) * noll(b, *p)).sum();
                assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12, "Z{a}, Z{b}: {product}");
            }
        }
    }

    #[test]
    fn a_fit_finds_the_coefficients_even_on_a_part_of_the_disc() {
        let (points, weights) = disc();
        let given: Vec<f64> = (0..21).map(|i| (f64::from(i) * 1.7).sin()).collect();
        let value = |p: &DVec2| given.iter().enumerate().map(|(i, c)| c * noll(i + 1, *p)).sum::<f64>();
        for cut in [1.1, 0.2] {
            let weights: Vec<f64> =
                points.iter().zip(&weights).map(|(p, w)| if p.x < cut { *w } else { 0.0 }).collect();
            let values: Vec<f64> = points.iter().map(value).collect();
            let found = fit(noll, &points, &values, &weights, 21);
            for (found, given) in found.iter().zip(&given) {
                assert!((found - given).abs() < 1e-9, "{found} {given}");
            }
        }
    }
}
