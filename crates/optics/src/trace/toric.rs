//! Surfaces that bend differently along x and y: biconics and toroids, crossed by Newton's method.
//!
//! They are crossed one ray after another, by the same code in the tile and in its scalar twin.

use super::crossing::{Crossing, Ray, cross_sphere};
use crate::toric::{Sag, Toric};

/// Newton steps, and halvings of steps that leave the surface's domain, after which another way is tried.
const NEWTON_STEPS: usize = 48;
/// Places along a ray at which it is looked for where Newton's method does not find the crossing, and halvings by which it is then found.
const N_PLACES: usize = 64;
const HALVINGS: usize = 60;
/// How far a ray is followed, over the lesser radius of curvature or its distance from the axis.
const REACH: f64 = 8.0;

impl Toric {
    /// Crosses the surface with a ray, where it goes through it downstream.
    #[inline(never)]
    pub(super) fn cross(&self, ray: &Ray<f64>) -> Crossing<f64> {
        // Begin on the sphere between the two curvatures, else on the vertex plane, else where the axis is nearest.
        let [cx, cy] = self.vertex_curvatures();
        let sphere = cross_sphere(0.5 * (cx + cy), ray);
        let on_sphere = if sphere.is_front { sphere.t } else { f64::NAN };
        let across = ray.l * ray.l + ray.m * ray.m;
        let starts =
            [on_sphere, -ray.z / ray.n, -(ray.x * ray.l + ray.y * ray.m) / across, -ray.x / ray.l, -ray.y / ray.m];
        let Some(start) = starts.into_iter().find(|&t| self.place(ray, t).is_some()) else {
            return Crossing {
                t: f64::INFINITY,
                normal: [0.0, 0.0, 1.0],
                cos: f64::NAN,
                cos2: f64::NAN,
                is_front: false,
            };
        };
        let (t, is_converged) = self.newton(ray, start);
        let crossing = self.crossing(ray, t, is_converged);
        if crossing.is_front {
            return crossing;
        }
        // Newton's method may lead to where the ray leaves the surface again, or nowhere.
        self.searched(ray, start).map_or(crossing, |t| self.crossing(ray, t, true))
    }

    /// Returns the sag at a distance along a ray; `None` beyond the surface's domain.
    fn place(&self, ray: &Ray<f64>, t: f64) -> Option<Sag> {
        let sag = self.at(ray.x + ray.l * t, ray.y + ray.m * t);
        (sag.z + sag.slope_x + sag.slope_y).is_finite().then_some(sag)
    }

    /// How far a ray is behind the surface at a distance along it, along z; `None` beyond the surface's domain.
    fn behind(&self, ray: &Ray<f64>, t: f64) -> Option<f64> {
        self.place(ray, t).map(|sag| ray.z + ray.n * t - sag.z)
    }

    fn crossing(&self, ray: &Ray<f64>, t: f64, is_converged: bool) -> Crossing<f64> {
        let sag = self.at(ray.x + ray.l * t, ray.y + ray.m * t);
        let inverse = 1.0 / (sag.slope_x * sag.slope_x + sag.slope_y * sag.slope_y + 1.0).sqrt();
        let normal = [-sag.slope_x * inverse, -sag.slope_y * inverse, inverse];
        let cos = ray.l * normal[0] + ray.m * normal[1] + ray.n * normal[2];
        Crossing { t, normal, cos, cos2: cos * cos, is_front: is_converged & (cos > 0.0) }
    }

    /// Returns the distance that Newton's method comes to from a place inside the surface's domain, and whether it has converged.
    fn newton(&self, ray: &Ray<f64>, start: f64) -> (f64, bool) {
        let mut t = start;
        let mut sag = self.at(ray.x + ray.l * t, ray.y + ray.m * t);
        let mut step = f64::NAN;
        for _ in 0..NEWTON_STEPS {
            if step.is_nan() {
                let slope = ray.n - ray.l * sag.slope_x - ray.m * sag.slope_y;
                step = (ray.z + ray.n * t - sag.z) / slope;
            }
            let Some(next) = self.place(ray, t - step) else {
                step *= 0.5;
                if step.is_finite() { continue } else { break }
            };
            t -= step;
            sag = next;
            // Once a step is small the next would be of the order of its square: it has converged to rounding.
            if step.abs() <= 1e-9 * (1.0 + t.abs()) {
                return (t, true);
            }
            step = f64::NAN;
        }
        (t, false)
    }

    /// Returns the distance nearest to a place inside the surface's domain at which the ray comes from before the surface to
    /// behind it, by looking along all of the domain.
    fn searched(&self, ray: &Ray<f64>, start: f64) -> Option<f64> {
        let [low, high] = [-1.0, 1.0].map(|sign| self.end_of_domain(ray, start, sign));
        // Closer at the ends, where the surface may be steep.
        let at = |i: usize| {
            let share = (std::f64::consts::PI * i as f64 / (N_PLACES - 1) as f64).cos();
            0.5 * (low + high) - 0.5 * (high - low) * share
        };
        let looks: Vec<(f64, f64)> = (0..N_PLACES).filter_map(|i| Some((at(i), self.behind(ray, at(i))?))).collect();
        let mut brackets: Vec<[f64; 2]> = Vec::new();
        for pair in looks.windows(2) {
            if pair[0].1 < 0.0 && pair[1].1 >= 0.0 {
                brackets.push([pair[0].0, pair[1].0]);
            }
        }
        // Between places on the same side the ray may graze the surface.
        for three in looks.windows(3) {
            let [(before, a), (middle, b), (after, c)] = [three[0], three[1], three[2]];
            let side = b.signum();
            if a * side > 0.0 && c * side > 0.0 && b * side <= (a * side).min(c * side) {
                let Some((turn, depth)) = self.extreme(ray, [before, middle, after], side) else { continue };
                if depth * side < 0.0 {
                    brackets.push(if side < 0.0 { [before, turn] } else { [turn, after] });
                }
            }
        }
        let found = brackets.into_iter().filter_map(|bracket| self.halved(ray, bracket));
        found.min_by(|a, b| (a - start).abs().total_cmp(&(b - start).abs()))
    }

    /// Returns where the ray is nearest to the other side of the surface, and how far behind it is there.
    fn extreme(&self, ray: &Ray<f64>, [mut low, mut middle, mut high]: [f64; 3], side: f64) -> Option<(f64, f64)> {
        let mut least = self.behind(ray, middle)?;
        for _ in 0..HALVINGS {
            let is_upper = high - middle > middle - low;
            let t = if is_upper { middle + GOLDEN * (high - middle) } else { middle - GOLDEN * (middle - low) };
            let here = self.behind(ray, t)?;
            if here * side < least * side {
                *(if is_upper { &mut low } else { &mut high }) = middle;
                (middle, least) = (t, here);
            } else {
                *(if is_upper { &mut high } else { &mut low }) = t;
            }
            if least * side < 0.0 {
                break;
            }
        }
        Some((middle, least))
    }

    /// Halves the distance between a place before the surface and one behind it, and ends with Newton's method.
    fn halved(&self, ray: &Ray<f64>, [mut before, mut behind]: [f64; 2]) -> Option<f64> {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + behind);
            *(if self.behind(ray, middle)? < 0.0 { &mut before } else { &mut behind }) = middle;
        }
        let (polished, is_converged) = self.newton(ray, behind);
        Some(if is_converged && (polished - behind).abs() <= 1e-9 * (1.0 + behind.abs()) { polished } else { behind })
    }

    /// Returns how far along a ray, from a place inside, the surface's domain lasts in the direction of a sign.
    fn end_of_domain(&self, ray: &Ray<f64>, start: f64, sign: f64) -> f64 {
        let [cx, cy] = self.vertex_curvatures();
        let from_axis = (ray.x + ray.l * start).hypot(ray.y + ray.m * start);
        let radius = 1.0 / cx.abs().max(cy.abs());
        let reach = REACH * if radius.is_finite() { radius.max(from_axis) } else { from_axis.max(1.0) };
        if self.place(ray, start + sign * reach).is_some() {
            return start + sign * reach;
        }
        let (mut inside, mut outside) = (0.0, reach);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            *(if self.place(ray, start + sign * middle).is_some() { &mut inside } else { &mut outside }) = middle;
        }
        start + sign * inside
    }
}

/// The golden section's lesser part.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use crate::{
        Glass, Interface, Lens, ObjectPoint, RayBatch, Shape, Surface, Vignetting, rays_towards,
        trace::tests::trace_one_by_one,
    };

    /// Where a ray first comes from before a cylinder of this curvature along y to behind it, on the half of the vertex.
    fn on_cylinder_mm(curvature_per_mm: f64, start: DVec3, direction: DVec3) -> Option<DVec3> {
        let radius = 1.0 / curvature_per_mm;
        let (from, along) = (DVec2::new(start.y, start.z - radius), DVec2::new(direction.y, direction.z));
        let (a, half_b, c) = (along.length_squared(), from.dot(along), from.length_squared() - radius * radius);
        let root = (half_b * half_b - a * c).sqrt();
        let crossings = [-1.0, 1.0].map(|sign: f64| (-half_b + sign * root) / a);
        let is_right = |point: &DVec3| {
            let normal = DVec2::new(-point.y, radius - point.z) * curvature_per_mm;
            normal.y > 1e-9 && normal.dot(along) > 1e-9
        };
        crossings.into_iter().filter(|t| t.is_finite()).map(|t| start + t * direction).find(is_right)
    }

    #[test]
    fn every_ray_meets_the_cylinder_that_it_meets() {
        let shapes = |c: f64| {
            let toroid =
                |curvature_x_per_mm: f64| Shape::Toroid { curvature_x_per_mm, conic: 0.0, coefficients: vec![] };
            [(toroid(0.0), c), (Shape::Biconic { conic: 0.0, curvature_x_per_mm: 0.0, conic_x: 0.0 }, c)]
        };
        let (mut n_met, mut n_missed) = (0, 0);
        for (shape, c) in [0.495, -0.3].into_iter().flat_map(shapes) {
            let surface = Surface { shape, ..Surface::sphere(1.0 / c, 0.999 / c.abs()) };
            let medium_after = Glass::Constant { index: 1.5 };
            let interface = Interface { surface, medium_after, thickness_after_mm: 0.0 };
            let lens = Lens::new("cylinder", "test", vec![interface], 0).unwrap().at(550.0).unwrap();
            for slope_deg in (-85..=85).step_by(5) {
                let tan = f64::from(slope_deg).to_radians().tan();
                let direction = DVec3::new(0.28 * tan, 0.96 * tan, 1.0).normalize();
                let starts: Vec<DVec3> =
                    (0..200).map(|i| DVec3::new(0.3, 0.05 * (f64::from(i) - 99.5), 0.2) - 3.0 * direction).collect();
                let mut rays = RayBatch::from_points(&starts, &vec![direction; starts.len()]);
                lens.trace(&mut rays, Vignetting::Off);
                for (i, start) in starts.iter().enumerate() {
                    let Some(expected) = on_cylinder_mm(c, *start, direction) else {
                        n_missed += 1;
                        continue;
                    };
                    n_met += 1;
                    assert!(rays.fate[i].is_in_flight(), "{c} {slope_deg} {start}: {:?}", rays.fate[i]);
                    assert!(rays.point_mm(i).distance(expected) < 1e-9, "{c} {slope_deg}: {expected}");
                }
            }
        }
        assert!(n_met > 10_000 && n_missed > 1000, "{n_met} {n_missed}");
    }

    #[test]
    fn tile_and_scalar_twin_agree_to_the_bit() {
        let shapes = [
            Shape::Biconic { conic: -0.8, curvature_x_per_mm: -0.04, conic_x: 1.5 },
            Shape::Toroid { curvature_x_per_mm: 0.08, conic: 0.4, coefficients: vec![1e-3, 2e-6] },
        ];
        for shape in shapes {
            let surface = Surface { shape, ..Surface::sphere(20.0, 9.0) };
            let medium_after = Glass::Constant { index: 1.6 };
            let interface = Interface { surface, medium_after, thickness_after_mm: 0.0 };
            let lens = Lens::new("toric", "test", vec![interface], 0).unwrap().at(550.0).unwrap();
            let targets: Vec<DVec2> =
                (0..203).map(|i| 0.7 * f64::from(i).sqrt() * DVec2::from_angle(2.4 * f64::from(i))).collect();
            let point = ObjectPoint::Infinite(DVec3::new(0.3, 0.1, 1.0).normalize());
            for rims in [Vignetting::On, Vignetting::Off] {
                let mut tiled = rays_towards(&point, &targets, 0.0, -3.0);
                let mut single = tiled.clone();
                lens.trace(&mut tiled, rims);
                trace_one_by_one(&lens, rims, &mut single);
                assert!(tiled.n_in_flight() > 100 && (rims == Vignetting::Off || tiled.n_in_flight() < 203));
                assert_eq!(tiled, single);
            }
        }
    }
}
