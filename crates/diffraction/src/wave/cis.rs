//! Sines and cosines of phases counted in turns, and exponentials, the same bits on every machine.

use std::f64::consts::FRAC_PI_2;

/// Returns cos and sin of `2π turns`.
///
/// Turns make the reduction exact: only the fraction counts. Taylor's series then run over an eighth of a turn, where
/// their first left-out terms are below 1e-17.
#[inline(always)]
pub(crate) fn cis(turns: f64) -> (f64, f64) {
    let quarters = 4.0 * turns;
    let whole = round(quarters);
    let x = (quarters - whole) * FRAC_PI_2;
    let x2 = x * x;
    let (mut c, mut s) = (COS[0], SIN[0]);
    for k in 1..COS.len() {
        c = c * x2 + COS[k];
        s = s * x2 + SIN[k];
    }
    s *= x;
    // The remainder of the quarters by 4, again without a library call.
    let quadrant = whole - 4.0 * round(0.25 * whole);
    let (c, s) = if quadrant == 1.0 || quadrant == -1.0 { (-s * quadrant, c * quadrant) } else { (c, s) };
    if quadrant == 2.0 || quadrant == -2.0 { (-c, -s) } else { (c, s) }
}

/// Returns e^x for |x| < 700, to 1e-12 of itself.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    let doublings = round(x * std::f64::consts::LOG2_E);
    let t = (x - doublings * LN_2_HIGH) - doublings * LN_2_LOW;
    // Taylor's series over |t| < 0.35: the first left-out term is below 1e-14.
    let mut power = EXP[0];
    for term in &EXP[1..] {
        power = power * t + term;
    }
    // The whole number is in the last bits of the shifted one; it goes to the exponent.
    f64::from_bits(power.to_bits().wrapping_add((doublings + SHIFT).to_bits() << 52))
}

/// ln 2 as a number of few bits, and what it lacks.
const LN_2_HIGH: f64 = 0.693_147_182_464_599_6;
const LN_2_LOW: f64 = -1.904_654_299_957_768e-9;

/// 1/k!, the highest first.
const EXP: [f64; 13] = {
    let mut terms = [1.0; 13];
    let mut k = 1;
    while k < 13 {
        terms[12 - k] = terms[13 - k] / k as f64;
        k += 1;
    }
    terms
};

const SHIFT: f64 = 6_755_399_441_055_744.0;

/// Rounds to the nearest whole number by way of the mantissa's end; exact for |x| < 2⁵¹.
#[inline(always)]
fn round(x: f64) -> f64 {
    (x + SHIFT) - SHIFT
}

/// Coefficients of cos x in x², highest first: ±1/(2k)!.
const COS: [f64; 9] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
    1.0,
];

/// Coefficients of sin x / x in x², highest first: ±1/(2k + 1)!.
const SIN: [f64; 9] = [
    1.0 / 355_687_428_096_000.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_over_many_turns() {
        for i in -4000..4000 {
            let turns = f64::from(i) * 0.012_345_678_9;
            let (c, s) = cis(turns);
            let (s0, c0) = (std::f64::consts::TAU * (turns - turns.round())).sin_cos();
            assert!((c - c0).abs() < 4e-16 && (s - s0).abs() < 4e-16, "{turns}: {c} {c0}, {s} {s0}");
        }
    }

    #[test]
    fn the_exponential_is_the_librarys() {
        for i in -6900..6900 {
            let x = f64::from(i) * 0.1;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-12, "{x}: {} {}", exp(x), x.exp());
        }
    }

    #[test]
    fn quarters_are_exact() {
        let of = |i: i32| cis(0.25 * f64::from(i));
        assert_eq!(
            [of(0), of(1), of(2), of(3), of(-1)],
            [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.0, -1.0)]
        );
    }
}
