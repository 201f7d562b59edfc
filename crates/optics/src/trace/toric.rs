//! Surfaces that bend differently along x and y: biconics and toroids, crossed by Newton's method.
//!
//! They are crossed one ray after another, by the same code in the tile and in its scalar twin.

use super::crossing::{Crossing, Ray, cross_sphere};
use crate::toric::{Sag, Toric};

/// Newton steps, and halvings of steps that leave the surface's domain, after which a ray is held to miss it.
const NEWTON_STEPS: usize = 48;

impl Toric {
    /// Crosses the surface with a ray.
    #[inline(never)]
    pub(super) fn cross(&self, ray: &Ray<f64>) -> Crossing<f64> {
        let place = |t: f64| self.at(ray.x + ray.l * t, ray.y + ray.m * t);
        let is_inside = |sag: &Sag| (sag.z + sag.slope_x + sag.slope_y).is_finite();
        let miss =
            Crossing { t: f64::INFINITY, normal: [0.0, 0.0, 1.0], cos: f64::NAN, cos2: f64::NAN, is_front: false };
        // Begin on the sphere between the two curvatures, else on the vertex plane, else where the axis is nearest.
        let [cx, cy] = self.vertex_curvatures();
        let sphere = cross_sphere(0.5 * (cx + cy), ray);
        let on_sphere = if sphere.is_front { sphere.t } else { f64::NAN };
        let across = ray.l * ray.l + ray.m * ray.m;
        let starts = [on_sphere, -ray.z / ray.n, -(ray.x * ray.l + ray.y * ray.m) / across];
        let Some(mut t) = starts.into_iter().find(|&t| is_inside(&place(t))) else { return miss };
        let mut sag = place(t);
        let mut step = f64::NAN;
        let mut is_converged = false;
        for _ in 0..NEWTON_STEPS {
            if step.is_nan() {
                let slope = ray.n - ray.l * sag.slope_x - ray.m * sag.slope_y;
                step = (ray.z + ray.n * t - sag.z) / slope;
            }
            let next = place(t - step);
            if !is_inside(&next) {
                step *= 0.5;
                if step.is_finite() { continue } else { break }
            }
            t -= step;
            sag = next;
            // Once a step is small the next would be of the order of its square: it has converged to rounding.
            if step.abs() <= 1e-9 * (1.0 + t.abs()) {
                is_converged = true;
                break;
            }
            step = f64::NAN;
        }
        let inverse = 1.0 / (sag.slope_x * sag.slope_x + sag.slope_y * sag.slope_y + 1.0).sqrt();
        let normal = [-sag.slope_x * inverse, -sag.slope_y * inverse, inverse];
        let cos = ray.l * normal[0] + ray.m * normal[1] + ray.n * normal[2];
        Crossing { t, normal, cos, cos2: cos * cos, is_front: is_converged & (cos > 0.0) }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use crate::{
        Glass, Interface, Lens, ObjectPoint, Shape, Surface, Vignetting, rays_towards, trace::tests::trace_one_by_one,
    };

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
