//! The numbers of Zernike's polynomials: degrees, orders and radial parts.

/// How many polynomials the Fringe set has.
pub const FRINGE_TERMS: usize = 37;

/// Returns the radial degree n and the azimuthal order m of the `j`-th polynomial of OSA and ANSI Z80.28 (from 0): m > 0 goes with
/// cos mθ, m < 0 with sin |m|θ.
pub fn osa_degrees(j: usize) -> (u32, i32) {
    let mut n = 0;
    while (n + 1) * (n + 2) / 2 <= j {
        n += 1;
    }
    (n as u32, 2 * (j - n * (n + 1) / 2) as i32 - n as i32)
}

/// Returns the radial degree n and the azimuthal order m of Noll's `j`-th polynomial (from 1): m > 0 goes with
/// cos mθ, m < 0 with sin |m|θ.
pub fn noll_degrees(j: usize) -> (u32, i32) {
    let j = j.max(1);
    let mut n = 0;
    while (n + 1) * (n + 2) / 2 < j {
        n += 1;
    }
    // Within a degree the orders ascend, each above 0 in a pair; even j take the cosine.
    let place = j - n * (n + 1) / 2 - 1;
    let m = if n.is_multiple_of(2) { 2 * place.div_ceil(2) } else { 2 * (place / 2) + 1 };
    let m = m as i32;
    (n as u32, if j.is_multiple_of(2) { m } else { -m })
}

/// Returns the radial degree n and the azimuthal order m of the `j`-th polynomial of the Fringe set (from 1, at most 37): m > 0 goes
/// with cos mθ, m < 0 with sin |m|θ.
///
/// The set goes by n + |m|, those of each from the largest |m| down (Wyant and Creath 1992, Basic wavefront aberration theory,
/// table III; the 37th is the spherical aberration of degree 12).
pub fn fringe_degrees(j: usize) -> (u32, i32) {
    let j = j.clamp(1, FRINGE_TERMS);
    if j == FRINGE_TERMS {
        return (12, 0);
    }
    let group = (j - 1).isqrt();
    let place = j - 1 - group * group;
    let m = (group - place / 2) as i32;
    (2 * group as u32 - m as u32, if place % 2 == 1 { -m } else { m })
}

/// Returns the coefficients of the radial polynomial of degree n and order m over ρᵐ, of ρ⁰, ρ² and on (Born and Wolf, 9.2.1): exact up
/// to degree 20.
pub fn radial_coefficients(n: u32, m: u32) -> Vec<f64> {
    let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
    let most = (n - m) / 2;
    (0..=most)
        .map(|k| {
            let s = most - k;
            let sign = if s.is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * factorial(n - s) / (factorial(s) * factorial((n + m) / 2 - s) * factorial(most - s))
        })
        .collect()
}
