//! Where on a texture a point of a surface lies.

use serde::{Deserialize, Serialize};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Affine3A, Mat2, Vec2, Vec3};

use crate::{Hit, PatternPoint, patterned::OwnFrame};

/// Texture coordinates as a function of a point of the surface: `matrix · uv + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UvMapping {
    /// Turns and scales.
    pub matrix: Mat2,
    /// Moves.
    pub offset: Vec2,
    /// Where u and v come from.
    pub from: Coordinates,
}

/// Where the two coordinates of a texture come from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Coordinates {
    /// Those of the surface.
    First,
    /// The second ones of its vertices; (0, 0) where a mesh has none.
    Second,
    /// The polar angle over π and the azimuth over 2 π about the z axis of a frame, which this leads to from the world.
    Sphere(Affine3A),
    /// The azimuth about the z axis of a frame over 2 π, from −x, and the height along it.
    Cylinder(Affine3A),
    /// The x and y of a frame.
    Plane(Affine3A),
}

impl UvMapping {
    /// The coordinates of the surface.
    pub const IDENTITY: Self = Self { matrix: Mat2::IDENTITY, offset: Vec2::ZERO, from: Coordinates::First };

    /// Returns the mapping that scales each coordinate and then moves it.
    pub fn scaled(scale: Vec2, offset: Vec2) -> Self {
        Self { matrix: Mat2::from_diagonal(scale), offset, ..Self::IDENTITY }
    }

    pub(crate) fn at(&self, at: &TexturePoint<'_>) -> Vec2 {
        let uv = match &self.from {
            Coordinates::First => at.uv,
            Coordinates::Second => at.second_uv,
            Coordinates::Sphere(frame) => {
                let d = frame.transform_point3(at.point).normalize_or(Vec3::Z);
                Vec2::new(d.z.clamp(-1.0, 1.0).acos() * FRAC_1_PI, azimuth(d) / TAU)
            }
            Coordinates::Cylinder(frame) => {
                let p = frame.transform_point3(at.point);
                Vec2::new((PI + p.y.atan2(p.x)) / TAU, p.z)
            }
            Coordinates::Plane(frame) => frame.transform_point3(at.point).truncate(),
        };
        self.matrix * uv + self.offset
    }
}

/// The angle about the z axis from +x, 0 to 2 π.
fn azimuth(d: Vec3) -> f32 {
    let angle = d.y.atan2(d.x);
    if angle < 0.0 { angle + TAU } else { angle }
}

/// What textures can depend on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexturePoint<'a> {
    pub(crate) uv: Vec2,
    pub(crate) second_uv: Vec2,
    /// Linear sRGB and alpha of the vertices.
    pub(crate) color: [f32; 4],
    /// In the world, m.
    pub(crate) point: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) footprint_m: f32,
    /// The frame of the shape, in which patterns are asked.
    pub(crate) frame: OwnFrame<'a>,
}

impl<'a> TexturePoint<'a> {
    pub(crate) fn of(hit: &Hit, frame: OwnFrame<'a>) -> Self {
        Self {
            uv: hit.uv,
            second_uv: hit.second_uv,
            color: hit.color,
            point: hit.point,
            normal: hit.shading_normal,
            footprint_m: hit.footprint_m,
            frame,
        }
    }

    /// Returns the point in the frame of the shape.
    pub(crate) fn own(&self) -> PatternPoint {
        self.frame.own(self.point, self.normal, self.footprint_m)
    }

    /// Returns a point beside this one, so far along both coordinates.
    pub(crate) fn beside(&self, (du, dv): (f32, f32), [dp_du, dp_dv]: [Vec3; 2]) -> Self {
        let by = Vec2::new(du, dv);
        Self { uv: self.uv + by, second_uv: self.second_uv + by, point: self.point + du * dp_du + dv * dp_dv, ..*self }
    }
}
