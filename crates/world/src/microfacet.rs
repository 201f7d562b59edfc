//! Rough boundaries as small mirrors of random tilt: GGX (Trowbridge & Reitz 1975; Walter et al. 2007).

use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// The distribution of tilts, by its roughness along x and y.
///
/// All directions are in the local frame whose +z is the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ggx {
    alpha: Vec2,
}

/// Below this roughness a surface is a mirror.
const SMOOTH: f32 = 1e-4;

impl Ggx {
    /// Returns the distribution; `None` for a surface that is smooth.
    pub(crate) fn new(alpha_x: f32, alpha_y: f32) -> Option<Self> {
        let is_rough = alpha_x.max(alpha_y) >= SMOOTH;
        is_rough.then(|| Self { alpha: Vec2::new(alpha_x, alpha_y).clamp(Vec2::splat(SMOOTH), Vec2::ONE) })
    }

    /// The density of tilts `m`, 1/sr, whose projected areas sum to 1.
    pub(crate) fn density(&self, m: Vec3) -> f32 {
        let slope = (m.truncate() / self.alpha).length_squared();
        let root = slope + m.z * m.z;
        if root > 0.0 { 1.0 / (PI * self.alpha.x * self.alpha.y * root * root) } else { 0.0 }
    }

    /// Smith's Λ of a direction.
    fn lambda(&self, v: Vec3) -> f32 {
        let tan2 = (v.truncate() * self.alpha).length_squared() / (v.z * v.z);
        if tan2.is_finite() { 0.5 * ((1.0 + tan2).sqrt() - 1.0) } else { f32::INFINITY }
    }

    /// The share of small mirrors that are seen from one side and lit from another.
    pub(crate) fn seen_and_lit(&self, o: Vec3, i: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(o) + self.lambda(i))
    }

    /// The density of tilts as seen from a direction, 1/sr; they sum to 1.
    pub(crate) fn seen_density(&self, o: Vec3, m: Vec3) -> f32 {
        self.density(m) * o.dot(m).abs() / ((1.0 + self.lambda(o)) * o.z.abs())
    }

    /// Draws a tilt as seen from a direction of z > 0 (Dupuy & Benyoub 2023: spherical caps).
    pub(crate) fn sample_seen(&self, o: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch until the surface is a hemisphere of roughness 1.
        let stretched = (o.truncate() * self.alpha).extend(o.z).normalize();
        // A cap of the sphere of reflected directions, evenly spread.
        let z = (1.0 - u[1]) * (1.0 + stretched.z) - stretched.z;
        let around = (1.0 - z * z).max(0.0).sqrt() * Vec2::from_angle(TAU * u[0]);
        let half = around.extend(z) + stretched;
        // Shrink back.
        (half.truncate() * self.alpha).extend(half.z.max(1e-9)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hemisphere(n: usize) -> impl Iterator<Item = (Vec3, f32)> {
        (0..n * n).map(move |index| {
            let cos = ((index / n) as f32 + 0.5) / n as f32;
            let azimuth = TAU * ((index % n) as f32 + 0.5) / n as f32;
            let m = ((1.0 - cos * cos).sqrt() * Vec2::from_angle(azimuth)).extend(cos);
            (m, TAU / (n * n) as f32)
        })
    }

    #[test]
    fn projected_areas_sum_to_one() {
        for (x, y) in [(0.2, 0.2), (0.5, 0.15), (1.0, 1.0)] {
            let ggx = Ggx::new(x, y).unwrap();
            let total: f64 = hemisphere(600).map(|(m, dw)| f64::from(ggx.density(m) * m.z * dw)).sum();
            assert!((total - 1.0).abs() < 5e-3, "{total}");
            let o = Vec3::new(0.6, 0.3, 0.5).normalize();
            let seen: f64 = hemisphere(600)
                .filter(|(m, _)| o.dot(*m) > 0.0)
                .map(|(m, dw)| f64::from(ggx.seen_density(o, m) * dw))
                .sum();
            assert!((seen - 1.0).abs() < 5e-3, "{seen}");
        }
    }

    /// The mean of drawn tilts is that of the density.
    #[test]
    fn draws_follow_the_density() {
        let ggx = Ggx::new(0.5, 0.2).unwrap();
        let o = Vec3::new(0.7, -0.2, 0.4).normalize();
        let wanted: Vec3 =
            hemisphere(600).filter(|(m, _)| o.dot(*m) > 0.0).map(|(m, dw)| m * ggx.seen_density(o, m) * dw).sum();
        let n = 200;
        let drawn: Vec3 = (0..n * n)
            .map(|i| ggx.sample_seen(o, [((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32]))
            .sum::<Vec3>()
            / (n * n) as f32;
        assert!(drawn.abs_diff_eq(wanted, 5e-3), "{drawn} {wanted}");
    }
}
