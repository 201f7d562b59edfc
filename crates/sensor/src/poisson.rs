//! Exact Poisson draws at any mean.
//!
//! Below 10 the cumulative distribution is searched from 0; from 10 on transformed rejection with squeeze is used
//! (PTRS of Hörmann, "The transformed rejection method for generating Poisson random variables", Insurance:
//! Mathematics and Economics 12, 1993). Neither rounds a Gaussian.

use rand::{Rng, RngExt};

/// Where the search ends and the rejection begins; PTRS holds from 10 on.
const SEARCH_BELOW: f64 = 10.0;

/// Returns a Poisson draw of a mean of 0 or more; means that are not numbers or not above 0 give 0.
pub(crate) fn poisson(mean: f64, rng: &mut impl Rng) -> f64 {
    if mean.is_nan() || mean <= 0.0 {
        0.0
    } else if mean < SEARCH_BELOW {
        by_search(mean, rng)
    } else {
        by_rejection(mean, rng)
    }
}

/// 1 / k, for the search: at a mean of 10, 2⁻⁵³ of the distribution lies beyond 47.
const RECIPROCALS: [f64; 64] = {
    let mut table = [0.0; 64];
    let mut k = 1;
    while k < 64 {
        table[k] = 1.0 / k as f64;
        k += 1;
    }
    table
};

fn by_search(mean: f64, rng: &mut impl Rng) -> f64 {
    let uniform: f64 = rng.random();
    let mut probability = (-mean).exp();
    let mut cumulative = probability;
    let mut k = 0;
    while uniform >= cumulative && k < RECIPROCALS.len() - 1 {
        k += 1;
        probability *= mean * RECIPROCALS[k];
        cumulative += probability;
    }
    k as f64
}

fn by_rejection(mean: f64, rng: &mut impl Rng) -> f64 {
    // The constants are those of the paper's algorithm PTRS.
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.024_83 * b;
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let v_r = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let u: f64 = rng.random::<f64>() - 0.5;
        let v: f64 = rng.random();
        let us = 0.5 - u.abs();
        let k = ((2.0 * a / us + b) * u + mean + 0.43).floor();
        if us >= 0.07 && v <= v_r {
            return k;
        }
        if k < 0.0 || (us < 0.013 && v > us) {
            continue;
        }
        if (v * inverse_alpha / (a / (us * us) + b)).ln() <= ln_probability(k, mean) {
            return k;
        }
    }
}

/// Returns ln(mean^k e^−mean / k!), accurate also where the three parts are huge and cancel.
fn ln_probability(k: f64, mean: f64) -> f64 {
    if k < 16.0 {
        let ln_factorial: f64 = (2..=k as u32).map(|i| f64::from(i).ln()).sum();
        return k * mean.ln() - mean - ln_factorial;
    }
    // Stirling's series for k!, and the rest as −mean × ((1 + d) ln(1 + d) − d) with d = k / mean − 1.
    let d = (k - mean) / mean;
    let deviance = if d.abs() < 0.01 {
        d * d * (1.0 / 2.0 - d * (1.0 / 6.0 - d * (1.0 / 12.0 - d * (1.0 / 20.0 - d * (1.0 / 30.0 - d / 42.0)))))
    } else {
        (1.0 + d) * d.ln_1p() - d
    };
    let k2 = k * k;
    let correction = (1.0 / 12.0 - (1.0 / 360.0 - 1.0 / (1260.0 * k2)) / k2) / k;
    -mean * deviance - 0.5 * (std::f64::consts::TAU * k).ln() - correction
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rayon::prelude::*;

    use super::*;

    /// The exact distribution about its mode, by the ratio of neighbors and normalised: none of the code under test.
    fn exact(mean: f64) -> (usize, Vec<f64>) {
        let mode = mean.floor() as usize;
        // Ten standard deviations and 40 more hold all but 1e-20.
        let reach = 40 + (10.0 * mean.sqrt()) as usize;
        let first = mode.saturating_sub(reach);
        let mut p = vec![0.0; mode - first + reach + 1];
        p[mode - first] = 1.0;
        for k in (first..mode).rev() {
            p[k - first] = p[k + 1 - first] * (k + 1) as f64 / mean;
        }
        for k in mode + 1..=mode + reach {
            p[k - first] = p[k - 1 - first] * mean / k as f64;
        }
        let sum: f64 = p.iter().sum();
        p.iter_mut().for_each(|v| *v /= sum);
        (first, p)
    }

    /// The tail of the Kolmogorov distribution; for whole numbers it is an upper bound of p, so the test is fair.
    fn kolmogorov_p(x: f64) -> f64 {
        let terms =
            (1..100).map(f64::from).map(|j| (-2.0 * j * j * x * x).exp() * if j % 2.0 == 1.0 { 2.0 } else { -2.0 });
        if x < 0.2 { 1.0 } else { terms.sum::<f64>().clamp(0.0, 1.0) }
    }

    /// The tail of χ² by Wilson and Hilferty's cube root, good to a few per cent of p at 1e-3.
    fn chi_square_p(x: f64, freedom: f64) -> f64 {
        let z = ((x / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
        0.5 * erfc(z / std::f64::consts::SQRT_2)
    }

    /// Abramowitz & Stegun 7.1.26, good to 1.5e-7.
    fn erfc(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
        let polynomial =
            t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
        let tail = polynomial * (-x * x).exp();
        if x >= 0.0 { tail } else { 2.0 - tail }
    }

    /// Returns the two p-values of a million draws.
    fn p_values(mean: f64, seed: u64) -> (f64, f64) {
        const N: usize = 1_000_000;
        let (first, p) = exact(mean);
        let mut counts = vec![0_u32; p.len()];
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for _ in 0..N {
            let k = poisson(mean, &mut rng);
            assert!(k >= 0.0 && k.fract() == 0.0);
            counts[k as usize - first] += 1;
        }
        let (mut drawn, mut expected, mut largest) = (0.0, 0.0, 0.0_f64);
        let (mut chi_square, mut n_bins, mut bin) = (0.0, 0.0, (0.0, 0.0));
        let mut left = N as f64;
        for (&count, &p) in counts.iter().zip(&p) {
            drawn += f64::from(count) / N as f64;
            expected += p;
            largest = largest.max((drawn - expected).abs());
            bin = (bin.0 + f64::from(count), bin.1 + p * N as f64);
            // Bins of at least 20 expected draws, so that χ² is close to its limit; the last takes what is left.
            if bin.1 >= 20.0 && left - bin.1 >= 20.0 {
                chi_square += (bin.0 - bin.1).powi(2) / bin.1;
                n_bins += 1.0;
                left -= bin.1;
                bin = (0.0, 0.0);
            }
        }
        chi_square += (bin.0 - bin.1).powi(2) / bin.1;
        (kolmogorov_p(largest * (N as f64).sqrt()), chi_square_p(chi_square, n_bins))
    }

    #[test]
    fn draws_are_exactly_poisson() {
        let means = [0.1, 1.0, 5.0, 9.99, 10.0, 30.0, 100.0, 1_000.0, 100_000.0];
        let cases: Vec<(f64, u64)> = means.iter().flat_map(|&mean| (1..=5).map(move |seed| (mean, seed))).collect();
        let wrong: Vec<String> = cases
            .par_iter()
            .map(|&(mean, seed)| (mean, seed, p_values(mean, seed)))
            .filter(|(_, _, (ks, chi))| *ks <= 1e-3 || *chi <= 1e-3)
            .map(|(mean, seed, p)| format!("mean {mean}, seed {seed}: p {p:?}"))
            .collect();
        assert!(wrong.is_empty(), "{wrong:?}");
    }

    #[test]
    fn the_test_finds_a_rounded_gaussian() {
        // The p-values are worth something only if they are tiny for what is nearly right: mean 100, rounded Gaussian.
        assert!(kolmogorov_p(0.0066 * 1e3) < 1e-12 && kolmogorov_p(0.5) > 0.9);
        assert!((chi_square_p(149.449, 100.0) / 1e-3 - 1.0).abs() < 0.05);
    }

    #[test]
    fn tiny_huge_and_impossible_means() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        assert_eq!([0.0, -1.0, f64::NAN].map(|mean| poisson(mean, &mut rng)), [0.0; 3]);
        let tiny: f64 = (0..1_000_000).map(|_| poisson(1e-4, &mut rng)).sum();
        // 100 are expected, give or take 10.
        assert!((tiny - 100.0).abs() < 50.0, "{tiny}");
        for mean in [1e6, 1e9, 1e12, 1e15] {
            let n = 40_000.0;
            let z: Vec<f64> = (0..n as usize).map(|_| (poisson(mean, &mut rng) - mean) / mean.sqrt()).collect();
            let (first, second) = (z.iter().sum::<f64>() / n, z.iter().map(|z| z * z).sum::<f64>() / n);
            // Five standard errors of the mean and of the variance.
            assert!(
                first.abs() < 5.0 / n.sqrt() && (second - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
                "{mean}: {first} {second}"
            );
        }
    }

    #[test]
    fn logarithms_of_probabilities_join() {
        // Across the change from sums to Stirling's series and from the series in d to the logarithm.
        for (mean, k) in [(12.0, 15.0), (12.0, 16.0), (1e4, 10_099.0), (1e4, 10_101.0), (1e4, 9_899.0)] {
            let (first, p) = exact(mean);
            let expected = p[k as usize - first].ln();
            assert!((ln_probability(k, mean) - expected).abs() < 1e-8, "{mean} {k}");
        }
    }
}
