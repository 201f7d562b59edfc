//! The watertight intersection of a ray with triangles (Woop, Benthin & Wald 2013), four at a time.

use glam::{Vec3, Vec4};

/// Triangles that are tried together.
pub(crate) const LANES: usize = 4;

/// Up to four triangles, a lane each; lanes without one hold NaN, which no ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FourTriangles {
    /// Of each axis, the coordinates of the first, second and third corners.
    corners: [[Vec4; 3]; 3],
}

/// What the triangle test needs to know of a ray, computed once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    /// The axis of the largest direction component last, the two others in an order that keeps the winding.
    axes: [usize; 3],
    /// The origin, its components in the order of the axes, each in all lanes.
    origin: [Vec4; 3],
    /// Shear that turns the direction into the last axis, and the scale along it.
    shear: [Vec4; 3],
}

/// Where a ray meets a triangle: the distance and the weights of the second and the third vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    pub(crate) lane: usize,
    pub(crate) t: f32,
    pub(crate) b1: f32,
    pub(crate) b2: f32,
}

impl FourTriangles {
    pub(crate) const NONE: Self = Self { corners: [[Vec4::NAN; 3]; 3] };

    pub(crate) fn set(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (axis, of_axis) in self.corners.iter_mut().enumerate() {
            for (of_corner, corner) in of_axis.iter_mut().zip(corners) {
                of_corner[lane] = corner[axis];
            }
        }
    }

    pub(crate) fn get(&self, lane: usize) -> [Vec3; 3] {
        let [x, y, z] = &self.corners;
        std::array::from_fn(|corner| Vec3::new(x[corner][lane], y[corner][lane], z[corner][lane]))
    }
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
        let axes = [kx, ky, kz];
        let shear = [direction[kx] * scale, direction[ky] * scale, scale];
        Self { axes, origin: axes.map(|k| Vec4::splat(origin[k])), shear: shear.map(Vec4::splat) }
    }

    /// Returns where the ray first meets one of the triangles with `0 < t < t_max`, from either side.
    ///
    /// Rays through a shared edge or vertex meet at least one of the triangles that share it: the edge functions of
    /// both sides are computed from the same products, and are computed again in f64 where one of them is 0.
    #[inline(always)]
    pub(crate) fn meets(&self, triangles: &FourTriangles, t_max: f32) -> Option<TriangleHit> {
        let [sx, sy, sz] = self.shear;
        // Move the corners into the frame in which the ray runs along the third axis.
        let [x, y, z]: [[Vec4; 3]; 3] =
            std::array::from_fn(|i| triangles.corners[self.axes[i]].map(|of_corner| of_corner - self.origin[i]));
        let (ax, ay) = (x[0] - sx * z[0], y[0] - sy * z[0]);
        let (bx, by) = (x[1] - sx * z[1], y[1] - sy * z[1]);
        let (cx, cy) = (x[2] - sx * z[2], y[2] - sy * z[2]);
        // Edge functions: twice the signed areas that the origin spans with each edge.
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if (u.cmpeq(Vec4::ZERO) | v.cmpeq(Vec4::ZERO) | w.cmpeq(Vec4::ZERO)).any() {
            u = cross_in_f64(cx, cy, bx, by);
            v = cross_in_f64(ax, ay, cx, cy);
            w = cross_in_f64(bx, by, ax, ay);
        }
        let is_left = u.cmplt(Vec4::ZERO) | v.cmplt(Vec4::ZERO) | w.cmplt(Vec4::ZERO);
        let is_right = u.cmpgt(Vec4::ZERO) | v.cmpgt(Vec4::ZERO) | w.cmpgt(Vec4::ZERO);
        let is_outside = is_left & is_right;
        if is_outside.all() {
            return None;
        }
        // Scaled distance along the ray; the division comes last. Where the determinant is 0, t is infinite or no number.
        let scaled_t = u * (sz * z[0]) + v * (sz * z[1]) + w * (sz * z[2]);
        let inverse = Vec4::ONE / (u + v + w);
        let t = scaled_t * inverse;
        let is_met = t.cmpgt(Vec4::ZERO) & t.cmplt(Vec4::splat(t_max)) & !is_outside;
        let mut lanes = is_met.bitmask();
        let mut nearest = lanes.trailing_zeros() as usize;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            if t[lane] < t[nearest] {
                nearest = lane;
            }
            lanes &= lanes - 1;
        }
        (nearest < LANES).then(|| TriangleHit {
            lane: nearest,
            t: t[nearest],
            b1: (v * inverse)[nearest],
            b2: (w * inverse)[nearest],
        })
    }
}

/// Returns `px qy − py qx`, rounded once.
#[cold]
fn cross_in_f64(px: Vec4, py: Vec4, qx: Vec4, qy: Vec4) -> Vec4 {
    let [px, py, qx, qy] = [px, py, qx, qy].map(|v| v.as_dvec4());
    (px * qy - py * qx).as_vec4()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [Vec3; 3] = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 3.0)];

    fn alone(lane: usize, triangle: [Vec3; 3]) -> FourTriangles {
        let mut four = FourTriangles::NONE;
        four.set(lane, triangle);
        assert_eq!(four.get(lane), triangle);
        four
    }

    #[test]
    fn both_sides_are_met_with_weights() {
        for side in [1.0, -1.0] {
            let ray = ShearedRay::new(Vec3::new(0.25, 0.5, 2.5 - 4.0 * side), Vec3::Z * side);
            for lane in 0..LANES {
                let hit = ray.meets(&alone(lane, TRIANGLE), f32::INFINITY).unwrap();
                assert_eq!(hit, TriangleHit { lane, t: 4.0, b1: 0.25, b2: 0.5 });
                assert!(ray.meets(&alone(lane, TRIANGLE), 3.9).is_none());
            }
        }
        assert!(ShearedRay::new(Vec3::new(0.6, 0.6, 0.0), Vec3::Z).meets(&alone(0, TRIANGLE), 9.0).is_none());
        assert!(ShearedRay::new(Vec3::new(0.2, 0.2, 5.0), Vec3::Z).meets(&alone(0, TRIANGLE), 9.0).is_none());
    }

    #[test]
    fn nearest_of_four_is_met() {
        let mut four = FourTriangles::NONE;
        for (lane, z) in [3.0, 1.0, -1.0, 2.0].into_iter().enumerate() {
            four.set(lane, TRIANGLE.map(|corner| corner.with_z(z)));
        }
        let ray = ShearedRay::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);
        assert_eq!(ray.meets(&four, f32::INFINITY).unwrap().lane, 1);
        let ray = ShearedRay::new(Vec3::new(0.25, 0.25, 1.5), Vec3::Z);
        assert_eq!(ray.meets(&four, f32::INFINITY).unwrap().lane, 3);
    }

    #[test]
    fn slivers_and_points_are_missed() {
        let point = [Vec3::ONE; 3];
        let sliver = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
        let direction = Vec3::ONE.normalize();
        assert!(ShearedRay::new(Vec3::ZERO, direction).meets(&alone(0, point), 9.0).is_none());
        assert!(ShearedRay::new(-Vec3::Y, Vec3::Y).meets(&alone(0, sliver), 9.0).is_none());
    }
}
