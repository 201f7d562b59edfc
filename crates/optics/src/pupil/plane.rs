//! The plane that a pupil is a region of.

use glam::{DMat3, DQuat, DVec2, DVec3};

use crate::{MonoLens, ObjectPoint, Placement, RayBatch};

/// The least cosine between light and axis for which the pupil is looked at in a plane across the axis.
const LEAST_COSINE: f64 = 0.01;
/// The same for a pupil's whole region: in a plane across steeper light a pupil is long and narrow, and its edge hard to sample.
const LEAST_COSINE_OF_REGION: f64 = 0.3;

/// The plane in which the pupil of a point is a region.
///
/// It is that of the paraxial entrance pupil, at [`MonoLens::projection_center_z_mm`], as long as light comes in from the
/// front. Where it comes in across the axis (within 0.6° of 90°) or from behind, which some fisheyes accept, it is the
/// plane through the first vertex that faces the point, and its x and y are those of the lens, turned from the axis to the
/// light by the shortest turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PupilPlane {
    placement: Placement,
    is_across_axis: bool,
}

impl PupilPlane {
    /// Returns the plane for a point.
    pub fn of(lens: &MonoLens, point: &ObjectPoint) -> Self {
        Self::with_least_cosine(lens, point, LEAST_COSINE)
    }

    /// Returns the plane for the whole region of a pupil: the same, but facing the point from 72.5° on.
    pub fn of_region(lens: &MonoLens, point: &ObjectPoint) -> Self {
        Self::with_least_cosine(lens, point, LEAST_COSINE_OF_REGION)
    }

    fn with_least_cosine(lens: &MonoLens, point: &ObjectPoint, least_cosine: f64) -> Self {
        let z_mm = lens.projection_center_z_mm();
        let is_in_front = match *point {
            ObjectPoint::Infinite(direction) => direction.z > least_cosine,
            ObjectPoint::Finite(place) => {
                place.z < 0.0 && (place.z - z_mm).abs() > least_cosine * place.distance(DVec3::Z * z_mm)
            }
        };
        if is_in_front {
            return Self::across_axis(z_mm);
        }
        Self::facing(point)
    }

    /// Returns the plane through the first vertex that faces a point.
    pub fn facing(point: &ObjectPoint) -> Self {
        let rotation = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, point.direction_to(DVec3::ZERO)));
        Self { placement: Placement { vertex_mm: DVec3::ZERO, rotation }, is_across_axis: false }
    }

    /// Returns the plane across the axis at this z from the first vertex, mm.
    pub fn across_axis(z_mm: f64) -> Self {
        Self { placement: Placement::centered(z_mm), is_across_axis: true }
    }

    /// Whether it lies across the axis, as it does for all light from the front.
    pub fn is_across_axis(&self) -> bool {
        self.is_across_axis
    }

    /// z of its origin from the first vertex, mm.
    pub fn z_mm(&self) -> f64 {
        self.placement.vertex_mm.z
    }

    /// Its normal, along which light runs.
    pub fn normal(&self) -> DVec3 {
        self.placement.rotation.z_axis
    }

    /// Returns rays from a point towards these places of the plane, mm, before the lens; path lengths are those of
    /// [`MonoLens::rays_towards`], of length 0 for the ray to the plane's origin.
    pub fn rays(&self, lens: &MonoLens, point: &ObjectPoint, targets_mm: &[DVec2]) -> RayBatch {
        if self.is_across_axis {
            return lens.rays_towards(point, targets_mm, self.z_mm(), 0.0);
        }
        let mut rays = RayBatch::with_capacity(targets_mm.len());
        rays.object_z_mm = point.z_mm();
        for target_mm in targets_mm {
            let start_mm = self.placement.lens_from_surface(target_mm.extend(0.0));
            let opl_mm = lens.object_index() * point.path_difference_mm(start_mm, self.placement.vertex_mm);
            rays.push(start_mm, point.direction_to(start_mm), opl_mm);
        }
        rays
    }

    /// Returns the point of the lens frame of a place of the plane, mm.
    pub fn in_lens_mm(&self, place_mm: DVec2) -> DVec3 {
        self.placement.lens_from_surface(place_mm.extend(0.0))
    }

    /// Returns where the line through a point of the lens frame, mm, with this direction meets the plane, mm.
    pub fn meets_mm(&self, on_line_mm: DVec3, direction: DVec3) -> DVec2 {
        let (own_mm, along) =
            (self.placement.surface_from_lens(on_line_mm), self.placement.rotation.transpose() * direction);
        (own_mm - along * (own_mm.z / along.z)).truncate()
    }
}
