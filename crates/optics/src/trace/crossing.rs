//! Where one ray crosses a surface, and what becomes of it there.
//!
//! These few lines are the whole geometry. The tile runs them lane by lane, as vectors; the scalar twin one by one.

use super::{Passed, Refracting, Step};

/// Newton steps after which a ray is held to miss an asphere.
const NEWTON_STEPS: usize = 24;

/// A ray: its point from the vertex at hand, its direction and its path so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) l: f64,
    pub(crate) m: f64,
    pub(crate) n: f64,
    pub(crate) opl: f64,
}

/// A ray's crossing of a surface. Where there is none, the distance is not finite.
#[derive(Clone, Copy)]
pub(crate) struct Crossing {
    /// Distance along the ray.
    t: f64,
    /// Unit normal there, pointing downstream.
    normal: [f64; 3],
    /// Cosine of the angle of incidence, and its square.
    cos: f64,
    cos2: f64,
    /// Whether the crossing lies on the sheet of the vertex.
    is_front: bool,
}

/// Crosses a sphere where the ray goes through it downstream.
///
/// Written in curvature, so that it stays accurate as the sphere flattens to a plane; the cosine of incidence comes
/// with it, and the normal is already of unit length. Beyond the equator the sphere is no longer the surface.
#[inline(always)]
pub(crate) fn cross_sphere(c: f64, ray: Ray) -> Crossing {
    let Ray { x, y, z, l, m, n, .. } = ray;
    let f = c * (x * x + y * y + z * z) - 2.0 * z;
    let g = n - c * (x * l + y * m + z * n);
    let cos2 = g * g - c * f;
    let cos = cos2.sqrt();
    // Both quotients are the same number; each is free of cancellation on its side.
    let is_ahead = g >= 0.0;
    let numerator = if is_ahead { f } else { g - cos };
    let denominator = if is_ahead { g + cos } else { c };
    let t = numerator / denominator;
    let normal = [-c * (x + l * t), -c * (y + m * t), 1.0 - c * (z + n * t)];
    Crossing { t, normal, cos, cos2, is_front: normal[2] > 0.0 }
}

/// Crosses a conic of revolution where the ray goes through it downstream.
#[inline(always)]
pub(crate) fn cross_conic(c: f64, conic: f64, ray: Ray) -> Crossing {
    let Ray { x, y, z, l, m, n, .. } = ray;
    let k1 = 1.0 + conic;
    let a = c * (1.0 + conic * n * n);
    let f = c * (x * x + y * y + k1 * z * z) - 2.0 * z;
    let g = n - c * (x * l + y * m + k1 * z * n);
    let s = (g * g - a * f).sqrt();
    let is_ahead = g >= 0.0;
    let numerator = if is_ahead { f } else { g - s };
    let denominator = if is_ahead { g + s } else { a };
    let t = numerator / denominator;
    let gradient = [-c * (x + l * t), -c * (y + m * t), 1.0 - c * k1 * (z + n * t)];
    let square = gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2];
    let inverse = 1.0 / square.sqrt();
    let cos = s * inverse;
    Crossing { t, normal: gradient.map(|v| v * inverse), cos, cos2: cos * cos, is_front: gradient[2] > 0.0 }
}

/// Crosses a conic with even powers of r added, by Newton's method from the conic.
///
/// A step that small has converged to rounding, for the next would be of the order of its square.
#[inline(always)]
pub(crate) fn cross_even_asphere(c: f64, conic: f64, coefficients: &[f64], ray: Ray) -> Crossing {
    let Ray { x, y, z, l, m, n, .. } = ray;
    let start = cross_conic(c, conic, ray);
    let is_start = start.is_front & (start.t.abs() < f64::INFINITY);
    let mut t = if is_start { start.t } else { -z / n };
    // Sag and gradient below the point at t.
    let surface = |t: f64| {
        let (x1, y1) = (x + l * t, y + m * t);
        let r2 = x1 * x1 + y1 * y1;
        let root = (1.0 - (1.0 + conic) * c * c * r2).sqrt();
        let (mut high, mut slope) = (0.0, 0.0);
        for (i, a) in coefficients.iter().enumerate().rev() {
            high = high * r2 + a;
            slope = slope * r2 + a * (i + 2) as f64;
        }
        let sag = c * r2 / (1.0 + root) + high * r2 * r2;
        let along = c / root + 2.0 * slope * r2;
        (sag, -along * x1, -along * y1)
    };
    let mut is_converged = false;
    for _ in 0..NEWTON_STEPS {
        let (sag, gx, gy) = surface(t);
        let step = (z + n * t - sag) / (l * gx + m * gy + n);
        t = if is_converged { t } else { t - step };
        is_converged |= step.abs() <= 1e-9 * (1.0 + t.abs());
        if is_converged {
            break;
        }
    }
    let (_, gx, gy) = surface(t);
    let inverse = 1.0 / (gx * gx + gy * gy + 1.0).sqrt();
    let cos = (l * gx + m * gy + n) * inverse;
    let normal = [gx * inverse, gy * inverse, inverse];
    Crossing { t, normal, cos, cos2: cos * cos, is_front: is_converged & (cos > 0.0) }
}

/// Moves a ray to its crossing and refracts it there.
#[inline(always)]
pub(crate) fn refract(surface: &Refracting, ray: Ray, crossing: Crossing) -> Passed {
    let Crossing { t, normal, cos, cos2, is_front } = crossing;
    let Refracting { ratio, ratio2, index_before, limit_mm2 } = *surface;
    let (x, y, z) = (ray.x + ray.l * t, ray.y + ray.m * t, ray.z + ray.n * t);
    let r2 = x * x + y * y;
    let after2 = 1.0 - ratio2 * (1.0 - cos2);
    let bend = after2.sqrt() - ratio * cos;
    let refracted = Ray {
        x,
        y,
        z,
        l: ratio * ray.l + bend * normal[0],
        m: ratio * ray.m + bend * normal[1],
        n: ratio * ray.n + bend * normal[2],
        opl: ray.opl + index_before * t,
    };
    // A ray without a crossing has no finite r2, so that it is not within.
    let is_within = r2 <= limit_mm2;
    let goes_on = is_within & is_front & (after2 >= 0.0);
    Passed { ray: refracted, goes_on, is_hit: is_front & (t.abs() < f64::INFINITY), is_within }
}

/// Moves a ray to the vertex plane, where nothing bends it.
#[inline(always)]
pub(crate) fn cross_plane(index_before: f64, limit_mm2: f64, ray: Ray) -> Passed {
    let t = -ray.z / ray.n;
    let (x, y) = (ray.x + ray.l * t, ray.y + ray.m * t);
    let is_within = x * x + y * y <= limit_mm2;
    let is_ahead = ray.n > 0.0;
    let moved = Ray { x, y, z: 0.0, opl: ray.opl + index_before * t, ..ray };
    Passed { ray: moved, goes_on: is_within & is_ahead, is_hit: is_ahead & (t.abs() < f64::INFINITY), is_within }
}

/// Moves a ray to an ideal lens in the vertex plane, and turns it there.
#[inline(always)]
pub(crate) fn thin_lens(step: &Step, power: f64, object_z: f64, limit_mm2: f64, ray: Ray) -> Passed {
    let (n1, n2) = (step.index_before, step.index_after);
    let passed = cross_plane(n1, limit_mm2, ray);
    let Ray { x, y, l, m, n, opl, .. } = passed.ray;
    let (tx, ty) = (l / n, m / n);
    let (sx, sy) = ((n1 * tx - power * x) / n2, (n1 * ty - power * y) / n2);
    // The path from the object point, and on to its image, is made that of the ray through the centre.
    let reduced = n1 / object_z + power;
    let before = path_difference([x, y], [tx, ty], object_z);
    let after = path_difference([x, y], [sx, sy], n2 / reduced);
    let n_after = 1.0 / (1.0 + sx * sx + sy * sy).sqrt();
    let opl = opl + (n2 * after - n1 * before);
    Passed { ray: Ray { l: sx * n_after, m: sy * n_after, n: n_after, opl, ..passed.ray }, ..passed }
}

/// Returns by how much the ray of these slopes through `height` has further to go from its point in the plane `z`
/// than the ray through the lens centre has; the plane may be infinitely far.
#[inline(always)]
fn path_difference(height: [f64; 2], slopes: [f64; 2], z: f64) -> f64 {
    let (ux, uy) = (slopes[0] + height[0] / z, slopes[1] + height[1] / z);
    let along = 1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1];
    let center = 1.0 + ux * ux + uy * uy;
    let sum = (slopes[0] + ux) * height[0] + (slopes[1] + uy) * height[1];
    sum / (along.sqrt() + center.sqrt())
}
