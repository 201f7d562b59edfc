//! The kernel's scalar twin: one ray after another, for the tests that hold the tile to it.

use super::{
    Kind, Rims, Step,
    asphere::{Asphere, Powers},
    crossing::{Ray, cross_conic, cross_plane, cross_sphere, refract, thin_lens},
    fate_of,
};
use crate::{RayBatch, RayFate, trace::Refracting};

/// Traces each ray of a batch by itself through a whole lens.
pub(super) fn trace_one_by_one(steps: &[Step], rims: Rims, rays: &mut RayBatch) {
    for i in 0..rays.len() {
        let (x, y, z) = rays.point_mm(i).into();
        let (l, m, n) = rays.direction(i).into();
        let t = -(x * l + y * m + z * n);
        let opl = rays.opl_mm[i] + steps[0].index_before * t;
        let near = Ray { x: x + l * t, y: y + m * t, z: z + n * t, l, m, n, opl };
        let (ray, fate) = trace_one(steps, rims, near);
        (rays.x_mm[i], rays.y_mm[i], rays.z_mm[i]) = (ray.x, ray.y, ray.z);
        (rays.l[i], rays.m[i], rays.n[i]) = (ray.l, ray.m, ray.n);
        (rays.opl_mm[i], rays.fate[i]) = (ray.opl, fate);
    }
}

fn trace_one(steps: &[Step], rims: Rims, mut ray: Ray) -> (Ray, RayFate) {
    let mut vertex_z = 0.0;
    for (surface, step) in steps.iter().enumerate() {
        ray.z -= step.vertex_z - vertex_z;
        vertex_z = step.vertex_z;
        let limit_mm2 = if rims == Rims::Clip { step.semi_aperture * step.semi_aperture } else { f64::MAX };
        let refracting = Refracting::new(step, limit_mm2);
        let passed = match &step.kind {
            Kind::Window => cross_plane(step.index_before, limit_mm2, ray),
            Kind::Sphere => refract(&refracting, ray, cross_sphere(step.curvature, ray)),
            Kind::Conic { conic } => refract(&refracting, ray, cross_conic(step.curvature, *conic, ray)),
            Kind::EvenAsphere { conic, a2, coefficients } => {
                let powers = Powers::Even { a2: *a2, rest: coefficients };
                let [crossing] = Asphere { curvature: step.curvature, conic: *conic, powers }.cross([ray], [true]);
                refract(&refracting, ray, crossing)
            }
            Kind::OddAsphere { conic, coefficients } => {
                let powers = Powers::All(coefficients);
                let [crossing] = Asphere { curvature: step.curvature, conic: *conic, powers }.cross([ray], [true]);
                refract(&refracting, ray, crossing)
            }
            Kind::ThinLens { power, object_z } => thin_lens(step, *power, *object_z, limit_mm2, ray),
            Kind::Toric(toric) => refract(&refracting, ray, toric.cross(ray)),
        };
        if !passed.goes_on {
            let (fate, ended) = fate_of(surface as u16, ray, passed);
            return (Ray { z: ended.z + vertex_z, ..ended }, fate);
        }
        ray = passed.ray;
    }
    (Ray { z: ray.z + vertex_z, ..ray }, RayFate::InFlight)
}
