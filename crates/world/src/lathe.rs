//! Surfaces of revolution: what a potter or a turner makes.

use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

use crate::WorldError;

/// A surface turned about the z axis, in bands on each of which radius² is a parabola of the height.
///
/// Spheres, cones and cylinders are such bands and other smooth profiles are followed closely by them, and a ray meets each where a
/// quadratic is 0. The outside is away from the axis; `u` runs about it from +x, `v` from the lower end to the upper one.
#[derive(Clone, Debug, PartialEq)]
pub struct Lathe {
    // Invariants: one band at least, of finite numbers, tops above bottoms, radius² not negative at their ends.
    bands: Vec<Band>,
    rings: Vec<Ring>,
    z_min_m: f64,
    z_max_m: f64,
    max_radius_m: f64,
}

/// A point of a quadric's surface, in the frame of its shape or its group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) dp_du: DVec3,
    pub(crate) dp_dv: DVec3,
    pub(crate) uv: DVec2,
}

/// radius² = c₀ + c₁ (z − bottom) + c₂ (z − bottom)² from `bottom` to `top`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Band {
    bottom: f64,
    top: f64,
    c: [f64; 3],
}

/// A flat ring across the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ring {
    z: f64,
    inner: f64,
    outer: f64,
    /// 1 where its outside is up, −1 where it is down.
    side: f64,
}

/// Which part of the surface a point lies on.
#[derive(Clone, Copy)]
enum Part<'a> {
    Band(&'a Band),
    Ring(&'a Ring),
}

/// Slices of a band by which points are drawn in proportion to area.
const SLICES: usize = 8;

impl Band {
    fn height(&self) -> f64 {
        self.top - self.bottom
    }

    /// Returns radius² and half its slope at a height.
    fn at(&self, z: f64) -> (f64, f64) {
        let ([c0, c1, c2], up) = (self.c, z - self.bottom);
        (c0 + up * (c1 + up * c2), 0.5 * c1 + up * c2)
    }

    /// The area of a unit of height and of azimuth (rad), m.
    fn area_density(&self, z: f64) -> f64 {
        let (squared, half_slope) = self.at(z);
        (squared.max(0.0) + half_slope * half_slope).sqrt()
    }

    /// The heights of a slice's ends.
    fn slice(&self, slice: usize) -> (f64, f64) {
        let step = self.height() / SLICES as f64;
        (self.bottom + step * slice as f64, step)
    }

    /// The area of a slice, m², by Simpson's rule.
    fn slice_area(&self, slice: usize) -> f64 {
        let (from, step) = self.slice(slice);
        let at = |share: f64| self.area_density(from + share * step);
        TAU * step * (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0
    }
}

impl Lathe {
    /// Returns the smooth surface through [height, radius] points, m, heights ascending; open where its ends have a radius.
    ///
    /// Radius² follows a curve of continuous slope that keeps between neighboring points: a parabola on each half of
    /// each interval, with slopes limited as Fritsch and Butland (1984) do.
    ///
    /// # Errors
    /// When there are fewer than two points, heights do not ascend, or a radius is below 0 or not finite.
    pub fn smooth(profile_m: &[[f64; 2]]) -> Result<Self, WorldError> {
        check(profile_m)?;
        let squared: Vec<[f64; 2]> = profile_m.iter().map(|[z, r]| [*z, r * r]).collect();
        let slopes = limited_slopes(&squared);
        let mut bands = Vec::new();
        for (i, pair) in squared.windows(2).enumerate() {
            let ([z0, f0], [z1, f1]) = (pair[0], pair[1]);
            let (h, d0, d1) = (z1 - z0, slopes[i], slopes[i + 1]);
            // The slope at the middle that makes both parabolas meet.
            let middle = 2.0 * (f1 - f0) / h - 0.5 * (d0 + d1);
            let half = 0.5 * h;
            bands.push(Band { bottom: z0, top: z0 + half, c: [f0, d0, (middle - d0) / h] });
            let f_middle = f0 + half * 0.5 * (d0 + middle);
            bands.push(Band { bottom: z0 + half, top: z1, c: [f_middle, middle, (d1 - middle) / h] });
        }
        Ok(Self::of(bands, Vec::new()))
    }

    /// Returns cones through [height, radius] points, m, heights ascending, with flat ends.
    ///
    /// # Errors
    /// As [`smooth`](Self::smooth).
    pub fn cones(profile_m: &[[f64; 2]]) -> Result<Self, WorldError> {
        check(profile_m)?;
        let band = |pair: &[[f64; 2]]| {
            let ([z0, r0], [z1, r1]) = (pair[0], pair[1]);
            let k = (r1 - r0) / (z1 - z0);
            Band { bottom: z0, top: z1, c: [r0 * r0, 2.0 * r0 * k, k * k] }
        };
        let ends = [(profile_m[0], -1.0), (profile_m[profile_m.len() - 1], 1.0)];
        let lid = |([z, outer], side): ([f64; 2], f64)| Ring { z, inner: 0.0, outer, side };
        let rings = ends.into_iter().map(lid).filter(|ring| ring.outer > 0.0).collect();
        Ok(Self::of(profile_m.windows(2).map(band).collect(), rings))
    }

    /// Adds a flat ring whose outside is up: a rim, or what a bowl is filled with.
    ///
    /// # Errors
    /// When the radii are not finite or the outer one is not the larger.
    pub fn with_ring(mut self, z_m: f64, inner_m: f64, outer_m: f64) -> Result<Self, WorldError> {
        if !(z_m.is_finite() && inner_m >= 0.0 && outer_m > inner_m && outer_m.is_finite()) {
            return Err(WorldError::Setting {
                what: "a ring of a surface of revolution",
                value: format!("radii {inner_m} and {outer_m} m at {z_m} m"),
                expected: "a finite height, and an outer radius above the inner one",
            });
        }
        self.rings.push(Ring { z: z_m, inner: inner_m, outer: outer_m, side: 1.0 });
        Ok(Self::of(self.bands, self.rings))
    }

    /// Opens the ends of [`cones`](Self::cones).
    #[must_use]
    pub fn without_lids(self) -> Self {
        Self::of(self.bands, Vec::new())
    }

    fn of(bands: Vec<Band>, rings: Vec<Ring>) -> Self {
        let zs = bands.iter().flat_map(|band| [band.bottom, band.top]).chain(rings.iter().map(|ring| ring.z));
        let (z_min_m, z_max_m) =
            zs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
        let widest = |band: &Band| {
            let vertex = if band.c[2] < 0.0 { -0.5 * band.c[1] / band.c[2] } else { 0.0 };
            let heights = [band.bottom, band.bottom + vertex.clamp(0.0, band.height()), band.top];
            heights.map(|z| band.at(z).0).into_iter().fold(0.0, f64::max).sqrt()
        };
        let radii = bands.iter().map(widest).chain(rings.iter().map(|ring| ring.outer));
        let max_radius_m = radii.fold(0.0, f64::max);
        Self { bands, rings, z_min_m, z_max_m, max_radius_m }
    }

    /// Returns the corners of a box around it.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let r = self.max_radius_m;
        (DVec3::new(-r, -r, self.z_min_m), DVec3::new(r, r, self.z_max_m))
    }

    /// Returns the first `t` in (0, `t_max`) at which `o + t d` meets it.
    pub(crate) fn meets(&self, o: DVec3, d: DVec3, t_max: f64) -> Option<f64> {
        // Heights over which the ray is within the largest radius.
        let across = d.x * d.x + d.y * d.y;
        let half_b = o.x * d.x + o.y * d.y;
        let from_axis = o.x * o.x + o.y * o.y;
        let discriminant = half_b * half_b - across * (from_axis - self.max_radius_m.powi(2) * (1.0 + 1e-9));
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        // Straight up and down the heights are not numbers, and bound nothing.
        let (low, high) = if across > 0.0 {
            let [a, b] = [-half_b - root, -half_b + root].map(|t| o.z + d.z * t / across);
            (a.min(b), a.max(b))
        } else {
            (f64::MIN, f64::MAX)
        };
        let mut nearest = t_max;
        for ring in &self.rings {
            let t = (ring.z - o.z) / d.z;
            if t > 0.0 && t < nearest {
                let r = (o + t * d).truncate().length();
                nearest = if r <= ring.outer && r >= ring.inner { t } else { nearest };
            }
        }
        for band in self.bands.iter().filter(|band| band.bottom <= high && band.top >= low) {
            let z = o.z - band.bottom;
            let [c0, c1, c2] = band.c;
            let a = across - c2 * d.z * d.z;
            let half_b = half_b - 0.5 * c1 * d.z - c2 * z * d.z;
            let c = from_axis - c0 - z * (c1 + c2 * z);
            for t in roots(a, half_b, c) {
                let up = z + t * d.z;
                if up >= 0.0 && up <= band.height() && t > 0.0 && t < nearest {
                    nearest = t;
                }
            }
        }
        (nearest < t_max).then_some(nearest)
    }

    /// Returns the part that a point lies on or nearest to.
    fn part_at(&self, p: DVec3) -> Part<'_> {
        let r = p.truncate().length();
        let off_band = |band: &Band| {
            let z = p.z.clamp(band.bottom, band.top);
            let (squared, half_slope) = band.at(z);
            (r * r - squared).abs() / (2.0 * r.hypot(half_slope)).max(1e-12) + (p.z - z).abs()
        };
        let off_ring = |ring: &Ring| (p.z - ring.z).hypot(r - r.clamp(ring.inner, ring.outer));
        let bands = self.bands.iter().map(|band| (off_band(band), Part::Band(band)));
        let rings = self.rings.iter().map(|ring| (off_ring(ring), Part::Ring(ring)));
        let nearest = bands.chain(rings).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or(Part::Band(&self.bands[0]), |(_, part)| part)
    }

    /// Returns the outward normal where a point lies, of length 1.
    pub(crate) fn normal_at(&self, p: DVec3) -> DVec3 {
        match self.part_at(p) {
            Part::Ring(ring) => DVec3::Z * ring.side,
            Part::Band(band) => band.normal_at(p),
        }
    }

    /// Returns the surface where a point close to it lies, the point put on it; in its own frame.
    pub(crate) fn surface_at(&self, p: DVec3) -> SurfacePoint {
        let turned = |p: DVec3| TAU * DVec3::new(-p.y, p.x, 0.0);
        let angle = p.y.atan2(p.x);
        let u = if angle < 0.0 { angle + TAU } else { angle } / TAU;
        let height = (self.z_max_m - self.z_min_m).max(f64::MIN_POSITIVE);
        let outwards = p.truncate().normalize_or(DVec2::X);
        let (point, normal, dp_dv) = match self.part_at(p) {
            Part::Ring(ring) => {
                let on = DVec3::new(p.x, p.y, ring.z);
                (on, DVec3::Z * ring.side, outwards.extend(0.0) * height)
            }
            Part::Band(band) => {
                // A step of Newton's along the normal.
                let (squared, half_slope) = band.at(p.z);
                let gradient = DVec3::new(p.x, p.y, -half_slope);
                let off = 0.5 * (p.truncate().length_squared() - squared);
                let on = p - gradient * (off / gradient.length_squared().max(1e-18));
                // Along the meridian the radius changes by half the slope of its square over itself.
                let (_, half_slope) = band.at(on.z);
                let r = on.truncate().length().max(1e-9);
                (on, band.normal_at(on), (outwards * (half_slope / r)).extend(1.0) * height)
            }
        };
        let dp_du = if turned(point) == DVec3::ZERO { DVec3::Y * 1e-9 } else { turned(point) };
        SurfacePoint { point, normal, dp_du, dp_dv, uv: DVec2::new(u, (point.z - self.z_min_m) / height) }
    }

    /// Its area, m².
    pub(crate) fn area(&self) -> f64 {
        self.areas().map(|(area, _)| area).sum()
    }

    /// Slices of bands, then rings, with their areas, m².
    fn areas(&self) -> impl Iterator<Item = (f64, (Part<'_>, usize))> {
        let of_band = |band| (0..SLICES).map(move |slice| (Band::slice_area(band, slice), (Part::Band(band), slice)));
        let of_ring = |ring: &Ring| PI * (ring.outer * ring.outer - ring.inner * ring.inner);
        let rings = self.rings.iter().map(move |ring| (of_ring(ring), (Part::Ring(ring), 0)));
        self.bands.iter().flat_map(of_band).chain(rings)
    }

    /// Returns a point of the surface, in proportion to area within 1 % or so; [`density_at`](Self::density_at) is exact.
    pub(crate) fn sample(&self, u: [f32; 2]) -> DVec3 {
        let around = DVec2::from_angle(TAU * f64::from(u[1]));
        let mut rest = f64::from(u[0]) * self.area();
        let mut point = DVec3::ZERO;
        for (area, (part, slice)) in self.areas() {
            let share = (rest / area).clamp(0.0, 1.0);
            point = match part {
                Part::Band(band) => {
                    let (from, step) = band.slice(slice);
                    let z = from + share * step;
                    (around * band.at(z).0.max(0.0).sqrt()).extend(z)
                }
                Part::Ring(ring) => {
                    let (inner, outer) = (ring.inner * ring.inner, ring.outer * ring.outer);
                    (around * (inner + share * (outer - inner)).sqrt()).extend(ring.z)
                }
            };
            if rest < area {
                break;
            }
            rest -= area;
        }
        point
    }

    /// Returns the density of [`sample`](Self::sample) at a point of the surface, 1/m².
    pub(crate) fn density_at(&self, p: DVec3) -> f64 {
        match self.part_at(p) {
            Part::Ring(_) => 1.0 / self.area(),
            Part::Band(band) => {
                let step = band.height() / SLICES as f64;
                let slice = (((p.z - band.bottom) / step).max(0.0) as usize).min(SLICES - 1);
                band.slice_area(slice) / (self.area() * TAU * step * band.area_density(p.z))
            }
        }
    }
}

impl Band {
    fn normal_at(&self, p: DVec3) -> DVec3 {
        let (_, half_slope) = self.at(p.z);
        DVec3::new(p.x, p.y, -half_slope).try_normalize().unwrap_or(DVec3::Z)
    }
}

fn check(profile_m: &[[f64; 2]]) -> Result<(), WorldError> {
    let ascends = profile_m.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    let is_sound = |[z, r]: &[f64; 2]| z.is_finite() && *r >= 0.0 && r.is_finite();
    if profile_m.len() >= 2 && ascends && profile_m.iter().all(is_sound) {
        return Ok(());
    }
    Err(WorldError::Setting {
        what: "the profile of a surface of revolution",
        value: format!("{profile_m:?}"),
        expected: "two or more points of ascending height, with radii of 0 m or more",
    })
}

/// Returns the slopes at the points of a table, 0 at its hills and valleys.
fn limited_slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let secants: Vec<f64> = points.windows(2).map(|p| (p[1][1] - p[0][1]) / (p[1][0] - p[0][0])).collect();
    let n = points.len();
    let slope = |i: usize| match i {
        // At the ends the slope goes on as the curve's own parabola would; a closed end is then round.
        0 if n > 2 => end_slope(secants[0], secants[1]),
        _ if i == n - 1 && n > 2 => end_slope(secants[n - 2], secants[n - 3]),
        0 => secants[0],
        _ if i == n - 1 => secants[n - 2],
        _ => {
            let (a, b) = (secants[i - 1], secants[i]);
            if a * b <= 0.0 { 0.0 } else { 2.0 * a * b / (a + b) }
        }
    };
    (0..n).map(slope).collect()
}

fn end_slope(secant: f64, next: f64) -> f64 {
    let slope = 1.5 * secant - 0.5 * next;
    if slope * secant <= 0.0 { 0.0 } else { slope }
}

/// Returns the roots of a t² + 2 b t + c, or as many as there are.
fn roots(a: f64, half_b: f64, c: f64) -> [f64; 2] {
    let discriminant = half_b * half_b - a * c;
    let q = if discriminant < 0.0 { f64::NAN } else { -half_b - half_b.signum() * discriminant.sqrt() };
    // A comparison with NaN is false: what is no root is never on a band.
    [q / a, c / q]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const FORWARD: (DVec3, DVec3) = (DVec3::new(0.0, -3.0, 0.0), DVec3::Y);

    #[test]
    fn turned_sphere_is_one() {
        // A parabola of radius² through three points of a sphere is the sphere itself.
        let profile = [-1.0, 0.0, 1.0].map(|z: f64| [z, (1.0 - z * z).sqrt()]);
        let ball = Lathe::smooth(&profile).unwrap();
        for i in 0..200 {
            let aim = DVec3::new(0.2 * (0.7 * f64::from(i)).sin(), 1.0, 0.2 * (1.3 * f64::from(i)).cos()).normalize();
            let b = FORWARD.0.dot(aim);
            let expected = -b - (b * b - 8.0).sqrt();
            let t = ball.meets(FORWARD.0, aim, 10.0).unwrap();
            assert_abs_diff_eq!(t, expected, epsilon = 1e-12);
            let at = ball.surface_at(FORWARD.0 + t * aim);
            assert!(at.normal.abs_diff_eq(at.point, 1e-9));
        }
        assert_abs_diff_eq!(ball.meets(DVec3::ZERO, DVec3::Y, 10.0).unwrap(), 1.0, epsilon = 1e-12);
        assert!(ball.meets(DVec3::new(5.0, -3.0, 0.0), DVec3::Y, 10.0).is_none());
        assert!(ball.meets(FORWARD.0, FORWARD.1, 1.9).is_none());
        assert_abs_diff_eq!(ball.area(), 2.0 * TAU, epsilon = 1e-6);
    }

    #[test]
    fn vase_passes_through_its_points_and_derivatives_follow() {
        let vase = Lathe::smooth(&[[0.0, 0.3], [0.4, 0.8], [0.9, 0.35], [1.2, 0.5]]).unwrap();
        let at = |z: f64| 3.0 - vase.meets(FORWARD.0 + DVec3::Z * z, FORWARD.1, 10.0).unwrap();
        for [z, r] in [[1e-6, 0.3], [0.4, 0.8], [0.9, 0.35], [1.2 - 1e-6, 0.5]] {
            // The slope at the ends is about 4.
            assert_abs_diff_eq!(at(z), r, epsilon = 1e-5);
        }
        for z in [0.1, 0.3, 0.6, 0.8, 1.0] {
            let slope = (at(z + 1e-5) - at(z - 1e-5)) / 2e-5;
            let on = vase.surface_at(DVec3::new(0.0, -at(z), z));
            assert_abs_diff_eq!(on.normal.z / -on.normal.y, -slope, epsilon = 1e-4);
            for (along, expected) in [(on.dp_du, DVec2::X), (on.dp_dv, DVec2::Y)] {
                assert_abs_diff_eq!(on.normal.dot(along), 0.0, epsilon = 1e-9);
                let moved = vase.surface_at(on.point + 1e-6 * along).uv - on.uv;
                assert!((moved / 1e-6).abs_diff_eq(expected, 1e-3), "{moved}");
            }
        }
    }

    #[test]
    fn cylinder_has_lids() {
        let pencil = Lathe::cones(&[[0.0, 0.1], [1.0, 0.1]]).unwrap();
        let down = (DVec3::new(0.05, 0.0, 4.0), DVec3::NEG_Z);
        assert_abs_diff_eq!(pencil.meets(down.0, down.1, 10.0).unwrap(), 3.0, epsilon = 1e-12);
        assert_eq!(pencil.surface_at(DVec3::new(0.05, 0.0, 1.0)).normal, DVec3::Z);
        assert_eq!(pencil.surface_at(DVec3::new(0.05, 0.0, 0.0)).normal, DVec3::NEG_Z);
        assert!(pencil.clone().without_lids().meets(down.0, down.1, 10.0).is_none());
        assert_abs_diff_eq!(pencil.area(), 0.2 * PI + 0.02 * PI, epsilon = 1e-9);
    }

    /// The mean of 1 / density over drawn points is the area, and of a height's slice its part of it.
    #[test]
    fn points_are_drawn_with_the_density_stated() {
        let bowl = Lathe::smooth(&[[0.0, 0.045], [0.01, 0.05], [0.045, 0.105], [0.075, 0.128]]).unwrap();
        let bowl = bowl.with_ring(0.068, 0.0, 0.12).unwrap();
        let n = 200;
        let (mut area, mut ring) = (0.0, 0.0);
        for i in 0..n * n {
            let u = [(i % n) as f32, (i / n) as f32].map(|v| (v + 0.5) / n as f32);
            let p = bowl.sample(u);
            let weight = 1.0 / (bowl.density_at(p) * f64::from(n * n));
            area += weight;
            ring += if p.z == 0.068 { weight } else { 0.0 };
        }
        assert_abs_diff_eq!(area / bowl.area(), 1.0, epsilon = 2e-3);
        assert_abs_diff_eq!(ring / (PI * 0.12 * 0.12), 1.0, epsilon = 1e-2);
    }

    #[test]
    fn bad_profiles_are_refused() {
        for bad in
            [&[[0.0, 1.0]][..], &[[0.0, 1.0], [0.0, 2.0]], &[[0.0, 1.0], [1.0, -1.0]], &[[0.0, f64::NAN], [1.0, 1.0]]]
        {
            assert!(Lathe::smooth(bad).is_err() && Lathe::cones(bad).is_err(), "{bad:?}");
        }
        assert!(Lathe::cones(&[[0.0, 1.0], [1.0, 1.0]]).unwrap().with_ring(0.5, 1.0, 1.0).is_err());
    }
}
