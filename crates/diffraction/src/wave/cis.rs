//! Sines and cosines of phases counted in turns, the same bits on every machine.

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

/// Rounds to the nearest whole number by way of the mantissa's end; exact for |x| < 2⁵¹.
#[inline(always)]
fn round(x: f64) -> f64 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
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
    fn quarters_are_exact() {
        let of = |i: i32| cis(0.25 * f64::from(i));
        assert_eq!(
            [of(0), of(1), of(2), of(3), of(-1)],
            [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.0, -1.0)]
        );
    }
}
