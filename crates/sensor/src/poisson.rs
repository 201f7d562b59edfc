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
