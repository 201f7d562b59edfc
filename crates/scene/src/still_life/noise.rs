//! Smooth noise, and points spread evenly: pure functions of where and which.

use glam::{DVec2, DVec3};

/// Mixes three numbers into a well-spread one.
pub(super) fn hash(x: i64, y: i64, z: i64) -> u32 {
    let mut h = (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (z as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    h = (h ^ (h >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    h = (h ^ (h >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    (h ^ (h >> 32)) as u32
}

/// Returns a number in 0–1 of three integers.
pub(super) fn unit(x: i64, y: i64, z: i64) -> f64 {
    f64::from(hash(x, y, z)) / 4_294_967_296.0
}

/// Smooth noise, 0–1, of unit scale.
pub(super) fn smooth(at: DVec3) -> f64 {
    let cell = at.floor();
    let (x, y, z) = (cell.x as i64, cell.y as i64, cell.z as i64);
    let f = at - cell;
    let s = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let edge = |dy: i64, dz: i64| lerp(unit(x, y + dy, z + dz), unit(x + 1, y + dy, z + dz), s.x);
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

/// Returns point `index` of a sequence that fills the square evenly (Roberts 2018), turned by an offset.
pub(super) fn spread(index: usize, offset: DVec2) -> DVec2 {
    const STEP: DVec2 = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_3);
    (offset + (index as f64) * STEP).fract()
}

/// Returns the offset of a pixel: neighbors differ as much as they can.
pub(super) fn pixel_offset(row: usize, column: usize, which: usize) -> DVec2 {
    let (x, y) = (column as f64 + 5.588 * which as f64, row as f64 + 3.171 * which as f64);
    let gradient = (52.982_918_9 * (0.067_110_56 * x + 0.005_837_15 * y).fract()).fract();
    DVec2::new(gradient, unit(column as i64, row as i64, 31 + which as i64))
}

/// Returns a point of the unit disc from one of the unit square, keeping areas.
pub(super) fn on_disc(u: DVec2) -> DVec2 {
    let (sin, cos) = (std::f64::consts::TAU * u.y).sin_cos();
    u.x.sqrt() * DVec2::new(cos, sin)
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

    #[test]
    fn points_fill_the_square_evenly() {
        let n = 64;
        let inside = (0..n).filter(|&i| spread(i, DVec2::new(0.3, 0.9)).max_element() < 0.5).count();
        assert!(inside.abs_diff(n / 4) <= 3, "{inside}");
    }
}
