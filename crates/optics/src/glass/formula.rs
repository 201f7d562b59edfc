//! The dispersion formulas of refractiveindex.info.

/// Returns the index by a formula of refractiveindex.info; NaN where it has none.
pub(super) fn formula_index(formula: u8, coefficients: &[f64], um: f64) -> f64 {
    let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
    let pairs = || (1..coefficients.len()).step_by(2).map(|i| (c(i), c(i + 1)));
    let w2 = um * um;
    match formula {
        1 => pairs().fold(1.0 + c(0), |n2, (b, r)| n2 + b * w2 / (w2 - r * r)).sqrt(),
        2 => pairs().fold(1.0 + c(0), |n2, (b, r)| n2 + b * w2 / (w2 - r)).sqrt(),
        3 => pairs().fold(c(0), |n2, (b, power)| n2 + b * um.powf(power)).sqrt(),
        4 => {
            let resonance = |i: usize| match c(i) {
                0.0 => 0.0,
                b => b * um.powf(c(i + 1)) / (w2 - c(i + 2).powf(c(i + 3))),
            };
            let tail = (9..coefficients.len()).step_by(2).map(|i| c(i) * um.powf(c(i + 1)));
            (c(0) + resonance(1) + resonance(5) + tail.sum::<f64>()).sqrt()
        }
        5 => pairs().fold(c(0), |n, (b, power)| n + b * um.powf(power)),
        6 => pairs().fold(1.0 + c(0), |n, (b, r)| n + b / (r - 1.0 / w2)),
        7 => {
            let l = 1.0 / (w2 - 0.028);
            c(0) + c(1) * l + c(2) * l * l + c(3) * w2 + c(4) * w2 * w2 + c(5) * w2 * w2 * w2
        }
        8 => {
            let k = c(0) + c(1) * w2 / (w2 - c(2)) + c(3) * w2;
            ((1.0 + 2.0 * k) / (1.0 - k)).sqrt()
        }
        9 => (c(0) + c(1) / (w2 - c(2)) + c(3) * (um - c(4)) / ((um - c(4)).powi(2) + c(5))).sqrt(),
        _ => f64::NAN,
    }
}
