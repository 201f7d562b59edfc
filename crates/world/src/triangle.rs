//! The watertight intersection of a ray with a triangle (Woop, Benthin & Wald 2013).

use glam::Vec3;

/// What the triangle test needs to know of a ray, computed once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: Vec3,
    /// The axis of the largest direction component, and the two others in an order that keeps the winding.
    axes: [usize; 3],
    /// Shear that turns the direction into the axis `axes[2]`, and the scale along it.
    shear: [f32; 3],
}

/// Where a ray meets a triangle: the distance and the weights of the second and the third vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    pub(crate) t: f32,
    pub(crate) b1: f32,
    pub(crate) b2: f32,
}

impl ShearedRay {
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Self {
        let d = direction.abs();
        let kz = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        // A negative axis would mirror the triangle; swapping the other two keeps its winding.
        let (kx, ky) = if direction[kz] < 0.0 { (ky, kx) } else { (kx, ky) };
        let scale = 1.0 / direction[kz];
        Self { origin, axes: [kx, ky, kz], shear: [direction[kx] * scale, direction[ky] * scale, scale] }
    }

    /// Returns where the ray meets the triangle with `0 < t < t_max`, from either side.
    ///
    /// Rays through a shared edge or vertex meet at least one of the triangles that share it: the edge functions of
    /// both sides are computed from the same products, and are computed again in f64 where one of them is 0.
    #[inline(always)]
    pub(crate) fn meets(&self, vertices: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.shear;
        // Move the vertices into the frame in which the ray runs along the third axis.
        let [a, b, c] = vertices.map(|vertex| vertex - self.origin);
        let (ax, ay) = (a[kx] - sx * a[kz], a[ky] - sy * a[kz]);
        let (bx, by) = (b[kx] - sx * b[kz], b[ky] - sy * b[kz]);
        let (cx, cy) = (c[kx] - sx * c[kz], c[ky] - sy * c[kz]);
        // Edge functions: twice the signed areas that the origin spans with each edge.
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let cross = |px: f32, py: f32, qx: f32, qy: f32| {
                (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
            };
            u = cross(cx, cy, bx, by);
            v = cross(ax, ay, cx, cy);
            w = cross(bx, by, ax, ay);
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        // Scaled distance along the ray; the division comes last.
        let scaled_t = u * (sz * a[kz]) + v * (sz * b[kz]) + w * (sz * c[kz]);
        let inverse = 1.0 / determinant;
        let t = scaled_t * inverse;
        (t > 0.0 && t < t_max).then_some(TriangleHit { t, b1: v * inverse, b2: w * inverse })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [Vec3; 3] = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 3.0)];

    #[test]
    fn both_sides_are_met_with_weights() {
        for side in [1.0, -1.0] {
            let ray = ShearedRay::new(Vec3::new(0.25, 0.5, 2.5 - 4.0 * side), Vec3::Z * side);
            let hit = ray.meets(&TRIANGLE, f32::INFINITY).unwrap();
            assert_eq!((hit.t, hit.b1, hit.b2), (4.0, 0.25, 0.5));
            assert!(ray.meets(&TRIANGLE, 3.9).is_none());
        }
        assert!(ShearedRay::new(Vec3::new(0.6, 0.6, 0.0), Vec3::Z).meets(&TRIANGLE, 9.0).is_none());
        assert!(ShearedRay::new(Vec3::new(0.2, 0.2, 5.0), Vec3::Z).meets(&TRIANGLE, 9.0).is_none());
    }

    #[test]
    fn slivers_and_points_are_missed() {
        let point = [Vec3::ONE; 3];
        let sliver = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
        let direction = Vec3::ONE.normalize();
        assert!(ShearedRay::new(Vec3::ZERO, direction).meets(&point, 9.0).is_none());
        assert!(ShearedRay::new(-Vec3::Y, Vec3::Y).meets(&sliver, 9.0).is_none());
    }
}
