//! Surfaces that bend differently along x and y: biconics and toroids, crossed by Newton's method.
//!
//! They are crossed one ray after another, by the same code in the tile and in its scalar twin.

use super::crossing::{Crossing, Ray, cross_sphere};

/// Newton steps, and halvings of steps that leave the surface's domain, after which a ray is held to miss it.
const NEWTON_STEPS: usize = 48;

/// A surface with two curvatures, with its vertex at the origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Toric {
    /// `z = (c_x x² + c_y y²) / (1 + √(1 − (1 + k_x) c_x² x² − (1 + k_y) c_y² y²))`.
    Biconic {
        /// Curvatures along x and y.
        c: [f64; 2],
        /// Conic constants along x and y.
        k: [f64; 2],
    },
    /// The curve `z = f(y)`, a conic with added even powers of y, turned about the axis parallel to y through the
    /// center of curvature along x.
    Toroid {
        /// Curvatures along x and y.
        c: [f64; 2],
        /// The conic constant of the curve.
        conic: f64,
        /// From y² on.
        coefficients: Vec<f64>,
    },
}

/// The sag at a place, and its slopes along x and y; not finite beyond the surface's domain.
#[derive(Clone, Copy)]
pub(crate) struct Sag {
    pub(crate) z: f64,
    pub(crate) slope_x: f64,
    pub(crate) slope_y: f64,
}

impl Toric {
    /// Returns the sag and its slopes at a place.
    pub(crate) fn at(&self, x: f64, y: f64) -> Sag {
        match self {
            Self::Biconic { c: [cx, cy], k: [kx, ky] } => {
                let (ex, ey) = ((1.0 + kx) * cx * cx * x, (1.0 + ky) * cy * cy * y);
                let root = (1.0 - ex * x - ey * y).sqrt();
                let inverse = 1.0 / (1.0 + root);
                let z = (cx * x * x + cy * y * y) * inverse;
                let slope = |linear: f64, e: f64| (2.0 * linear + z * e / root) * inverse;
                Sag { z, slope_x: slope(cx * x, ex), slope_y: slope(cy * y, ey) }
            }
            Self::Toroid { c: [cx, cy], conic, coefficients } => {
                let (f, slope) = curve(*cy, *conic, coefficients, y);
                // Distance from the axis of rotation over the radius of rotation.
                let h = 1.0 - cx * f;
                let s = (h * h - cx * cx * x * x).sqrt();
                let z = f + cx * x * x / (h + s);
                // Beyond the axis of rotation lies the other side of the ring.
                let is_near = h > 0.0;
                Sag { z: if is_near { z } else { f64::NAN }, slope_x: cx * x / s, slope_y: h * slope / s }
            }
        }
    }

    /// Curvature at the vertex along x, and along y with the square term of the curve, 1/mm.
    pub(crate) fn vertex_curvatures(&self) -> [f64; 2] {
        match self {
            Self::Biconic { c, .. } => *c,
            Self::Toroid { c: [cx, cy], coefficients, .. } => {
                [*cx, cy + 2.0 * coefficients.first().copied().unwrap_or(0.0)]
            }
        }
    }

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

/// Returns the height of a conic with added even powers of y, and its slope.
fn curve(c: f64, conic: f64, coefficients: &[f64], y: f64) -> (f64, f64) {
    let y2 = y * y;
    let root = (1.0 - (1.0 + conic) * c * c * y2).sqrt();
    let (mut bump, mut slope) = (0.0, 0.0);
    for (i, a) in coefficients.iter().enumerate().rev() {
        bump = bump * y2 + a;
        slope = slope * y2 + (2 * i + 2) as f64 * a;
    }
    (c * y2 / (1.0 + root) + bump * y2, (c / root + slope) * y)
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
