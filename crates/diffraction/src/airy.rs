//! The theory of a circular pupil in focus: Airy's pattern and what follows from it.
//!
//! Lengths on the film are in units of λN (N the working f-number) and frequencies in units of 1/(λN), so that one
//! set of functions serves every wavelength and lens.

use std::f64::consts::PI;

use dioptric_optics::quadrature::gauss_legendre_on;

/// Returns the irradiance `r` from the center for a point of unit energy, per (λN)².
pub fn psf(r: f64) -> f64 {
    let v = PI * r.abs();
    if v < 1e-4 {
        return PI / 4.0 * (1.0 - v * v / 4.0);
    }
    let amplitude = 2.0 * bessel_j(1, v) / v;
    PI / 4.0 * amplitude * amplitude
}

/// Returns the line spread `u` from the line, per λN: 4·H₁(2πu)/(2πu)² with Struve's H₁.
///
/// Its peak is 8/(3π) and its full width at half maximum 1.0017.
pub fn lsf(u: f64) -> f64 {
    let x = 2.0 * PI * u.abs();
    if x < 1e-3 {
        return 8.0 / (3.0 * PI) * (1.0 - x * x / 15.0);
    }
    4.0 * struve_h1(x) / (x * x)
}

/// Returns the modulation at the frequency `s`: 0 at and above the cut-off, s = 1.
pub fn mtf(s: f64) -> f64 {
    let s = s.abs();
    if s >= 1.0 {
        return 0.0;
    }
    2.0 / PI * (s.acos() - s * (1.0 - s * s).sqrt())
}

/// Returns the share of the energy within `r` of the center.
pub fn encircled_energy(r: f64) -> f64 {
    let v = PI * r.abs();
    1.0 - bessel_j(0, v).powi(2) - bessel_j(1, v).powi(2)
}

/// Returns Bessel's Jₙ(x) of small integer order.
///
/// By the trapezoid rule on Bessel's integral, whose error falls faster than exponentially once there are more
/// points than x.
pub fn bessel_j(n: u32, x: f64) -> f64 {
    let n_points = (0.6 * x.abs()) as usize + 24 + n as usize;
    let step = PI / n_points as f64;
    let ends = 0.5 * (1.0 + (f64::from(n) * PI).cos());
    let inner: f64 = (1..n_points)
        .map(|i| {
            let t = step * i as f64;
            (f64::from(n) * t - x * t.sin()).cos()
        })
        .sum();
    (ends + inner) / n_points as f64
}

/// Returns Struve's H₁(x) for x ≥ 0, by Gauss–Legendre quadrature of Poisson's integral.
pub fn struve_h1(x: f64) -> f64 {
    let n = (0.5 * x) as usize + 24;
    let integral: f64 =
        gauss_legendre_on(n, 0.0, PI / 2.0).iter().map(|(t, w)| w * (x * t.cos()).sin() * t.sin().powi(2)).sum();
    2.0 * x / PI * integral
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;
    use crate::width::full_width_at_half_maximum;

    #[test]
    fn special_functions_agree_with_tables() {
        // Abramowitz & Stegun, tables 9.1 and 12.1.
        assert_abs_diff_eq!(bessel_j(0, 1.0), 0.765_197_686_557_966_6, epsilon = 1e-14);
        assert_abs_diff_eq!(bessel_j(1, 10.0), 0.043_472_746_168_861_44, epsilon = 1e-14);
        assert_abs_diff_eq!(bessel_j(1, 100.0), -0.077_145_352_014_112_16, epsilon = 1e-13);
        assert_abs_diff_eq!(struve_h1(1.0), 0.198_457_3, epsilon = 1e-7);
        assert_abs_diff_eq!(struve_h1(5.0), 0.807_811_9, epsilon = 1e-7);
    }

    #[test]
    fn line_spread_has_the_peak_and_width_of_theory() {
        assert_abs_diff_eq!(lsf(0.0), 0.848_826, epsilon = 1e-6);
        assert_abs_diff_eq!(full_width_at_half_maximum(lsf, 2.0), 1.0017, epsilon = 1e-4);
    }

    #[test]
    fn line_spread_is_the_transform_of_the_modulation() {
        for u in [0.0, 0.3, 1.1, 4.7] {
            let transform: f64 =
                gauss_legendre_on(80, 0.0, 1.0).iter().map(|(s, w)| 2.0 * w * mtf(*s) * (2.0 * PI * s * u).cos()).sum();
            // The modulation falls like (1 − s)^1.5 at its end: quadrature error.
            assert_abs_diff_eq!(lsf(u), transform, epsilon = 2e-7);
        }
    }

    #[test]
    fn the_first_ring_is_one_and_three_quarters_percent() {
        assert_abs_diff_eq!(psf(1.6350) / psf(0.0), 0.0175, epsilon = 1e-5);
        assert!(psf(1.219_67) < 1e-10);
        assert_abs_diff_eq!(encircled_energy(1.219_67), 0.8378, epsilon = 1e-4);
    }
}
