//! Rays, and where they meet a world.

use glam::{Vec2, Vec3};

use crate::{InstanceId, MaterialId, ShapeId};

/// A half line: the points `origin + t · direction` with `t > 0`.
///
/// Origins are in metres, in the frame of the world; directions have length 1, so that `t` is a distance in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts, m.
    pub origin: Vec3,
    /// Where it goes, of length 1.
    pub direction: Vec3,
}

/// Where a ray first meets a surface.
///
/// Normals point to the outside of the shape (for a triangle: the side from which its vertices run counterclockwise in
/// a right-handed frame), whichever side the ray comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, m.
    pub distance_m: f32,
    /// The point, m, in the frame of the world; placed on the surface, hence more exact than `origin + t · direction`.
    pub point: Vec3,
    /// How far `point` can be from the true surface because of rounding, m.
    pub point_error_m: f32,
    /// The normal of the surface itself, of length 1.
    pub geometric_normal: Vec3,
    /// The normal interpolated between vertices, of length 1, on the same side as the geometric one.
    pub shading_normal: Vec3,
    /// The direction in which `u` grows, ∂p/∂u, m; not of length 1.
    pub dp_du: Vec3,
    /// The direction in which `v` grows, ∂p/∂v, m.
    pub dp_dv: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// The second texture coordinates of the vertices, or (0, 0).
    pub second_uv: Vec2,
    /// Linear sRGB and alpha of the vertices, or white.
    pub color: [f32; 4],
    /// Which shape.
    pub shape: ShapeId,
    /// Which triangle of a mesh; 0 for shapes that have no parts.
    pub primitive: u32,
    /// What it is made of.
    pub material: MaterialId,
    /// The instance through which it was met, if any.
    pub instance: Option<InstanceId>,
    /// The size of details of patterns that are to be blurred away, m; 0, which rays give, for none.
    pub footprint_m: f32,
}

/// A point that light is to fall on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// The point, m.
    pub point: Vec3,
    /// The normal of the side from which light counts, of length 1; `None` where it does from all around.
    pub normal: Option<Vec3>,
}

impl From<Vec3> for Receiver {
    /// A point that light can come to from all around.
    fn from(point: Vec3) -> Self {
        Self { point, normal: None }
    }
}

impl Hit {
    /// Returns a ray that leaves the surface in a direction of length 1, starting just off it on the side it leaves to.
    ///
    /// The start is moved along the geometric normal by more than the rounding error of the point, so that the ray
    /// doesn't meet the same surface again (after pbrt, 4th edition, 6.8).
    pub fn ray_towards(&self, direction: Vec3) -> Ray {
        Ray { origin: self.origin_towards(direction), direction }
    }

    /// Returns where a ray that leaves in this direction starts: just off the surface.
    pub fn origin_towards(&self, direction: Vec3) -> Vec3 {
        let n = self.geometric_normal;
        let offset = n * (self.point_error_m * n.abs().element_sum());
        let offset = if n.dot(direction) < 0.0 { -offset } else { offset };
        let moved = self.point + offset;
        // Round each coordinate away from the surface, so that the sum doesn't fall back onto it.
        let away = |coordinate: f32, by: f32| match by {
            by if by > 0.0 => coordinate.next_up(),
            by if by < 0.0 => coordinate.next_down(),
            _ => coordinate,
        };
        Vec3::new(away(moved.x, offset.x), away(moved.y, offset.y), away(moved.z, offset.z))
    }
}
