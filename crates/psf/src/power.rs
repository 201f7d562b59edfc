//! Powers of 2 in single precision, with the same bits on all machines.

/// Returns 2^x to 3e-7 of itself, 0 below 2⁻¹²⁶ and 2¹²⁶ above that: quicker than the library's, and the same bits
/// everywhere.
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    const SHIFT: f32 = 12_582_912.0;
    let most = if x < 126.0 { x } else { 126.0 };
    let shifted = most + SHIFT;
    let t = most - (shifted - SHIFT);
    // Taylor's series of e^(t ln 2) over |t| < 0.5.
    let mut power = TERMS[0];
    for term in &TERMS[1..] {
        power = power * t + term;
    }
    // The whole number of doublings is in the last bits of the shifted sum; it goes to the exponent.
    let bits = power.to_bits().wrapping_add(shifted.to_bits() << 23);
    f32::from_bits(if x > -126.0 { bits } else { 0 })
}

/// The most products between two computations of a power: they carry its error, which grows to 5·10⁻⁵.
pub(crate) const MOST_PRODUCTS: usize = 32;

/// `(ln 2)^k / k!`, the highest first.
const TERMS: [f32; 7] = {
    let mut terms = [1.0_f32; 7];
    let mut term = 1.0;
    let mut k = 1;
    while k < 7 {
        term *= std::f64::consts::LN_2 / k as f64;
        terms[6 - k] = term as f32;
        k += 1;
    }
    terms
};

/// Powers whose exponents are a parabola's values at equal steps: each is the last times a ratio, which changes by a
/// constant factor.
#[derive(Clone, Copy, Default)]
pub(crate) struct Powers {
    pub(crate) value: f32,
    pub(crate) ratio: f32,
    pub(crate) change: f32,
}

impl Powers {
    /// Returns the value and moves to the next.
    #[inline(always)]
    pub(crate) fn next(&mut self) -> f32 {
        let value = self.value;
        self.value *= self.ratio;
        self.ratio *= self.change;
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_powers_are_the_librarys() {
        for i in -12_500..12_500 {
            let x = i as f32 * 0.01;
            let expected = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / expected - 1.0).abs() < 3e-7, "{x}: {} {expected}", exp2(x));
        }
    }
}
