//! Directions and points drawn from numbers in [0, 1).

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

/// Returns a point of the unit disc, evenly spread, neighbors staying neighbors (Shirley & Chiu 1997).
pub(crate) fn on_disc(u: [f32; 2]) -> Vec2 {
    let [x, y] = u.map(|u| 2.0 * u - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    let (r, angle) = if x.abs() > y.abs() { (x, FRAC_PI_4 * y / x) } else { (y, FRAC_PI_2 - FRAC_PI_4 * x / y) };
    r * Vec2::from_angle(angle)
}

/// Returns a direction about +z whose density is its cosine over π.
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = on_disc(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// Returns a direction within an angle of +z, evenly spread over solid angle; 1 − cos of the angle is given.
pub(crate) fn cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u[0] * one_minus_cos_max;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    (sin * Vec2::from_angle(TAU * u[1])).extend(1.0 - one_minus_cos)
}

/// Returns the weights of the second and third corner of a triangle, evenly spread over its area (Heitz 2019).
pub(crate) fn on_triangle(u: [f32; 2]) -> [f32; 2] {
    let [a, b] = u;
    if a < b { [0.5 * a, b - 0.5 * a] } else { [a - 0.5 * b, 0.5 * b] }
}

/// An orthonormal frame about a normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) x: Vec3,
    pub(crate) y: Vec3,
    pub(crate) z: Vec3,
}

impl Frame {
    pub(crate) fn about(z: Vec3) -> Self {
        let (x, y) = z.any_orthonormal_pair();
        Self { x, y, z }
    }

    /// Returns the frame about `z` whose x axis is as near as can be to a direction.
    pub(crate) fn about_with(z: Vec3, towards: Vec3) -> Self {
        let x = (towards - z * z.dot(towards)).normalize_or_zero();
        if x == Vec3::ZERO { Self::about(z) } else { Self { x, y: z.cross(x), z } }
    }

    /// Returns it turned about its z axis, counterclockwise.
    pub(crate) fn turned(self, rad: f32) -> Self {
        let (sin, cos) = rad.sin_cos();
        Self { x: cos * self.x + sin * self.y, y: cos * self.y - sin * self.x, z: self.z }
    }

    pub(crate) fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    pub(crate) fn to_world(self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// Weights to pick one of several things by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Distribution {
    /// Sums of the weights up to and including each, the last being 1.
    cumulative: Vec<f64>,
    total: f64,
}

impl Distribution {
    /// Returns the distribution of these weights; even where all of them are 0 or there is something wrong with them.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let is_even = !(total > 0.0 && total.is_finite());
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = weights
            .iter()
            .map(|weight| {
                sum += if is_even { 1.0 / weights.len() as f64 } else { weight / total };
                sum
            })
            .collect();
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        Self { cumulative, total: if is_even { 0.0 } else { total } }
    }

    /// The sum of the weights.
    pub(crate) fn total(&self) -> f64 {
        self.total
    }

    /// How many things there are.
    pub(crate) fn len(&self) -> usize {
        self.cumulative.len()
    }

    /// Returns a thing, and what is left of the number, again in [0, 1).
    pub(crate) fn pick(&self, u: f32) -> (usize, f32) {
        let (index, rest) = self.pick_f64(f64::from(u));
        (index, (rest as f32).clamp(0.0, ONE_MINUS_EPSILON))
    }

    /// Returns the same of a number in double precision.
    pub(crate) fn pick_f64(&self, u: f64) -> (usize, f64) {
        let index = self.cumulative.partition_point(|&sum| sum <= u).min(self.len() - 1);
        let below = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        (index, (u - below) / (self.cumulative[index] - below))
    }

    /// Returns the probability of a thing.
    pub(crate) fn probability(&self, index: usize) -> f32 {
        let below = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        (self.cumulative[index] - below) as f32
    }
}

/// The largest number below 1.
pub(crate) const ONE_MINUS_EPSILON: f32 = 1.0 - 0.5 * f32::EPSILON;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_follow_weights() {
        let distribution = Distribution::new(&[1.0, 0.0, 3.0]);
        assert_eq!(distribution.total(), 4.0);
        let counts = (0..1000).fold([0; 3], |mut counts, i| {
            counts[distribution.pick(i as f32 / 1000.0).0] += 1;
            counts
        });
        assert_eq!(counts, [250, 0, 750]);
        assert_eq!([0, 1, 2].map(|i| distribution.probability(i)), [0.25, 0.0, 0.75]);
        assert_eq!(distribution.pick(0.625), (2, 0.5));
        assert_eq!(Distribution::new(&[0.0, 0.0]).probability(1), 0.5);
    }

    #[test]
    fn disc_points_are_even() {
        let n = 64;
        let (mut inside, mut sum) = (0, Vec2::ZERO);
        for i in 0..n * n {
            let u = [((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32];
            let p = on_disc(u);
            inside += i32::from(p.length() < 0.5);
            sum += p;
        }
        // A quarter of the area within half the radius; the grid's own coarseness is 1 in 64.
        assert!((f64::from(inside) / f64::from(n * n) - 0.25).abs() < 0.01);
        assert!(sum.length() < 0.1);
    }
}
