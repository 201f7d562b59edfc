//! Gauss–Legendre quadrature.

use std::{f64::consts::PI, sync::OnceLock};

/// Rules of fewer nodes than this are computed once: each takes some 10 n² operations.
const KEPT: usize = 256;

/// Returns `n` nodes and weights on [−1, 1]: exact for polynomials of degree 2n − 1.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    static RULES: [OnceLock<Vec<(f64, f64)>>; KEPT] = [const { OnceLock::new() }; KEPT];
    match RULES.get(n) {
        Some(rule) => rule.get_or_init(|| computed(n)).clone(),
        None => computed(n),
    }
}

fn computed(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = -((i as f64 + 0.75) / (n as f64 + 0.5) * PI).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (value, derivative) = legendre(n, x);
                slope = derivative;
                let step = value / derivative;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Returns `n` nodes and weights on [`from`, `to`].
pub fn gauss_legendre_on(n: usize, from: f64, to: f64) -> Vec<(f64, f64)> {
    let half = 0.5 * (to - from);
    gauss_legendre(n).into_iter().map(|(x, w)| (from + half * (1.0 + x), half * w)).collect()
}

fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut here) = (1.0, x);
    if n == 0 {
        return (1.0, 0.0);
    }
    for k in 2..=n {
        let k = k as f64;
        let next = ((2.0 * k - 1.0) * x * here - (k - 1.0) * before) / k;
        before = here;
        here = next;
    }
    (here, n as f64 * (x * here - before) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_degree_2n_minus_1_are_exact() {
        for n in 1..40 {
            let degree = 2 * n - 2;
            let sum: f64 = gauss_legendre(n).iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
            // Rounding over n terms.
            assert!((sum - 2.0 / (degree as f64 + 1.0)).abs() < 1e-13, "{n}: {sum}");
        }
    }

    #[test]
    fn the_interval_is_moved() {
        let sum: f64 = gauss_legendre_on(5, 1.0, 3.0).iter().map(|(x, w)| w * x * x).sum();
        assert!((sum - 26.0 / 3.0).abs() < 1e-13);
    }
}
