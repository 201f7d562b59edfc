//! Smooth noise: pure functions of where.

use glam::DVec3;

/// Mixes three numbers into a well-spread one.
pub(super) fn hash(x: i64, y: i64, z: i64) -> u32 {
    mixed(times(x, X_FACTOR) ^ times(y, Y_FACTOR) ^ times(z, Z_FACTOR))
}

const X_FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;
const Y_FACTOR: u64 = 0xC2B2_AE3D_27D4_EB4F;
const Z_FACTOR: u64 = 0x1656_67B1_9E37_79F9;

fn times(number: i64, factor: u64) -> u64 {
    (number as u64).wrapping_mul(factor)
}

fn mixed(h: u64) -> u32 {
    let mut h = h;
    h = (h ^ (h >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    h = (h ^ (h >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    (h ^ (h >> 32)) as u32
}

fn in_unit(h: u32) -> f64 {
    f64::from(h) / 4_294_967_296.0
}

/// Returns a number in 0–1 of three integers.
pub(super) fn unit(x: i64, y: i64, z: i64) -> f64 {
    in_unit(hash(x, y, z))
}

/// Returns the whole number not above another, and how far that is from it.
fn floor(v: f64) -> (i64, f64) {
    let towards_zero = v as i64;
    let whole = towards_zero - i64::from(towards_zero as f64 > v);
    (whole, v - whole as f64)
}

/// Smooth noise, 0–1, of unit scale.
pub(super) fn smooth(at: DVec3) -> f64 {
    let ((x, fx), (y, fy), (z, fz)) = (floor(at.x), floor(at.y), floor(at.z));
    let f = DVec3::new(fx, fy, fz);
    let s = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    // The corners of the cell, as `unit` of them.
    let (x, y, z) = (
        [times(x, X_FACTOR), times(x + 1, X_FACTOR)],
        [times(y, Y_FACTOR), times(y + 1, Y_FACTOR)],
        [times(z, Z_FACTOR), times(z + 1, Z_FACTOR)],
    );
    let edge = |j: usize, k: usize| {
        let at = |i: usize| in_unit(mixed(x[i] ^ y[j] ^ z[k]));
        lerp(at(0), at(1), s.x)
    };
    lerp(lerp(edge(0, 0), edge(1, 0), s.y), lerp(edge(0, 1), edge(1, 1), s.y), s.z)
}

/// Smooth noise in three octaves, 0–1; octaves finer than `blur` are at their mean.
pub(super) fn cloudy(at: DVec3, blur: f64) -> f64 {
    let octave = |scale: f64, shift: f64| {
        let fade = (2.0 - 2.0 * blur * scale).clamp(0.0, 1.0);
        if fade == 0.0 { 0.5 } else { 0.5 + fade * (smooth(scale * at + DVec3::splat(shift)) - 0.5) }
    };
    (octave(1.0, 0.0) + 0.5 * octave(2.03, 7.1) + 0.25 * octave(4.1, 3.7)) / 1.75
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_fills_its_range() {
        let mut range = (1.0_f64, 0.0_f64);
        for i in 0..2000 {
            let at = DVec3::new(0.137 * f64::from(i), 0.71, -0.33 * f64::from(i));
            let value = smooth(at);
            range = (range.0.min(value), range.1.max(value));
            assert!((smooth(at + DVec3::splat(1e-4)) - value).abs() < 1e-3);
            assert!((0.0..=1.0).contains(&cloudy(at, 0.0)));
        }
        assert!(range.0 < 0.2 && range.1 > 0.8);
    }
}
