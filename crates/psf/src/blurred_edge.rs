//! What pixels in a row hold of an edge blurred by a Gaussian: the table from which narrow Gaussians are drawn (`docs/hurb.md`,
//! eqs. 13 to 15).

use std::sync::LazyLock;

/// Pixels that are drawn together.
pub(crate) const LANES: usize = 8;
/// Bits of a place within a pixel.
pub(crate) const PLACE_BITS: u32 = 16;
/// Bits of sixteenths: of a pixel by which a profile's rows are distinguished, between which it is read in proportion, and of a doubling of variances
/// by which profiles are, a hundred kilobytes. What a stroke has above its profile widens its even part.
pub(crate) const ROW_BITS: u32 = 4;

/// For places of a step from one side of a pixel to the other, sixteenths apart: the share of what lies beyond it on three times as many pixels in a row as are drawn
/// together, where the step is a normal distribution's. It begins in the last pixel before their middle.
pub(crate) struct BlurredEdgeTable([[f32; 3 * LANES]; (1 << ROW_BITS) + 1]);

/// A share that no picture shows. Products with less are soon below the least of normal numbers, which takes many times as long.
const NOTHING: f64 = 1e-12;

/// Profiles by variance, up to 1 pixel².
static PROFILES: LazyLock<Vec<BlurredEdgeTable>> =
    LazyLock::new(|| (0..=profile_number(1.0)).map(|number| BlurredEdgeTable::new(variance_of(number))).collect());

/// What is added to variances before they are compared, pixels²: of the narrowest Gaussians, pixels see little.
const PART_OF_A_PIXEL: f32 = 0.0625;

/// Returns the leading bits of a sum of a variance and that part, which are those of its logarithm.
#[inline(always)]
const fn leading_bits(sum: f32) -> u32 {
    sum.to_bits() >> dropped_bits()
}

const fn dropped_bits() -> u32 {
    f32::MANTISSA_DIGITS - 1 - ROW_BITS
}

pub(crate) fn profiles() -> &'static [BlurredEdgeTable] {
    &PROFILES
}

/// Returns the variance of the next profile below one in pixels².
#[inline(always)]
pub(crate) fn variance_below(variance: f32) -> f32 {
    let sum = variance.clamp(0.0, 1.0) + PART_OF_A_PIXEL;
    f32::from_bits(leading_bits(sum) << dropped_bits()) - PART_OF_A_PIXEL
}

/// Returns the number of the profile of a variance that there is.
#[inline(always)]
pub(crate) fn profile_number(variance: f32) -> usize {
    (leading_bits(variance + PART_OF_A_PIXEL) - leading_bits(PART_OF_A_PIXEL)) as usize
}

/// Returns the variance of the profile of a number.
fn variance_of(number: usize) -> f32 {
    f32::from_bits((leading_bits(PART_OF_A_PIXEL) + number as u32) << dropped_bits()) - PART_OF_A_PIXEL
}

impl BlurredEdgeTable {
    fn new(variance: f32) -> Self {
        let row_px = 1.0 / f64::from(1 << ROW_BITS);
        // Reading between two rows widens a little. The sharpest step is next to none for a row.
        let sigma = (f64::from(variance) - row_px * row_px / 6.0).max(1e-4).sqrt();
        Self(std::array::from_fn(|row| {
            let step = f64::from(step_begins()) + row as f64 * row_px;
            let beyond = |pixel: usize| sigma * normal_integral((pixel as f64 - step) / sigma);
            let held = |pixel: usize| Some(beyond(pixel + 1) - beyond(pixel)).filter(|held| *held > NOTHING);
            std::array::from_fn(|pixel| held(pixel).unwrap_or_default() as f32)
        }))
    }

    /// Adds to eight pixels, from `base` on, what they hold between two places, of so much a pixel. The places are a
    /// whole number of rows apart.
    #[inline(always)]
    pub(crate) fn add_between(&self, (near, far): (i32, i32), base: i32, value: f32, pixels: &mut [f32; LANES]) {
        // Both sides are as far behind a row.
        let row = 1 << (PLACE_BITS - ROW_BITS);
        let after = value * ((near & (row - 1)) as f32 * (1.0 / row as f32));
        let before = value - after;
        let ((n0, n1), (f0, f1)) = (self.rows(near, base), self.rows(far, base));
        for i in 0..LANES {
            pixels[i] += (n0[i] - f0[i]) * before + (n1[i] - f1[i]) * after;
        }
    }

    /// Returns what eight pixels, from `base` on, hold of steps at the row before a place and at that after.
    #[inline(always)]
    fn rows(&self, place: i32, base: i32) -> (&[f32], &[f32]) {
        let row = ((place >> (PLACE_BITS - ROW_BITS)) as usize) % (1 << ROW_BITS);
        let first = ((base - (place >> PLACE_BITS) + step_begins()) as usize) % (2 * LANES);
        (&self.0[row][first..first + LANES], &self.0[row + 1][first..first + LANES])
    }
}

/// The pixel of a profile in which its step begins.
const fn step_begins() -> i32 {
    (3 * LANES / 2) as i32 - 1
}

/// Returns the integral of the normal distribution's share below z, up to z: z Φ(z) + φ(z), by functions that have the same
/// bits everywhere.
fn normal_integral(z: f64) -> f64 {
    0.5 * z * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2) + libm::exp(-0.5 * z * z) / std::f64::consts::TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sharp_step_covers_what_is_beyond_it_and_a_soft_one_as_much() {
        for number in [0, 30, profiles().len() - 1] {
            let profile = &profiles()[number];
            for place in [0, 1 << 14, 3 << 14] {
                let (row, _) = profile.rows(place, -3);
                let beyond = 5.0 - f64::from(place) / f64::from(1 << PLACE_BITS);
                let sum: f64 = row.iter().map(|&share| f64::from(share)).sum();
                // The widest reaches past the eight pixels: ∫Φ up to −3 is 3.82e-4.
                assert!((sum - beyond).abs() < 3.9e-4, "{number} {place}: {sum} {beyond}");
            }
        }
        // ∫Φ up to 0 is the density there; up to 1 it is Φ(1) + φ(1).
        assert!((normal_integral(0.0) - 0.398_942_280).abs() < 1e-9);
        assert!((normal_integral(1.0) - (0.841_344_746 + 0.241_970_725)).abs() < 1e-8);
        assert!((normal_integral(-5.4)).abs() < 1e-7 && (normal_integral(5.4) - 5.4).abs() < 1e-7);
    }

    /// Products with numbers below the least of normal ones take many times as long.
    #[test]
    fn shares_are_nothing_or_far_above_the_least_number() {
        let shares = || profiles().iter().flat_map(|profile| profile.0.iter().flatten());
        assert!(shares().all(|&share| share == 0.0 || f64::from(share) > 0.5 * NOTHING));
    }

    #[test]
    fn a_variance_finds_the_profile_below_it() {
        assert_eq!((variance_of(0), variance_of(profiles().len() - 1)), (0.0, 1.0));
        for variance in [0.0f32, 0.004, 0.01, 0.1, 0.5, 0.72, 0.99, 1.0] {
            let below = variance_below(variance);
            assert!((0.0..=(variance + PART_OF_A_PIXEL) / 16.0).contains(&(variance - below)), "{variance} {below}");
            assert_eq!(variance_of(profile_number(below)), below);
        }
        assert_eq!((variance_below(-1.0), variance_below(7.0)), (0.0, 1.0));
    }
}
