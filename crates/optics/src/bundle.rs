//! Object points, and bundles of rays from them.

use glam::{DVec2, DVec3};

use crate::RayBatch;

/// A point that light comes from, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectPoint {
    /// A point, mm.
    Finite(DVec3),
    /// A far point, by the unit direction in which its light travels.
    Infinite(DVec3),
}

impl ObjectPoint {
    /// Returns the far point seen under this angle from the axis, up to π, on the side that this direction of x and y
    /// points to.
    pub fn far(angle_rad: f64, direction: DVec2) -> Self {
        let across = direction.normalize_or_zero() * -angle_rad.sin();
        Self::Infinite(across.extend(angle_rad.cos()))
    }

    /// z of the plane that the point lies in, mm; −∞ for a far point.
    pub fn z_mm(&self) -> f64 {
        match self {
            Self::Finite(point) => point.z,
            Self::Infinite(_) => f64::NEG_INFINITY,
        }
    }

    /// Returns the unit direction from this point to another.
    #[inline]
    pub fn direction_to(&self, target_mm: DVec3) -> DVec3 {
        match *self {
            Self::Finite(point) => (target_mm - point).normalize(),
            Self::Infinite(direction) => direction,
        }
    }

    /// Returns by how much the path from this point to `a` is longer than that to `b`, mm.
    ///
    /// Computed without ever forming the paths, so that it stays exact for far points.
    #[inline]
    pub fn path_difference_mm(&self, a: DVec3, b: DVec3) -> f64 {
        match *self {
            Self::Finite(point) => {
                let (to_a, to_b) = (a - point, b - point);
                (a - b).dot(to_a + to_b) / (to_a.length() + to_b.length())
            }
            Self::Infinite(direction) => direction.dot(a - b),
        }
    }
}

/// How rays from an object point start, of path length 0 for the one aimed at the axis.
pub(crate) struct Aim<'a> {
    point: &'a ObjectPoint,
    z_mm: f64,
    start_z_mm: f64,
    reference_mm: DVec3,
    /// Of the medium that the rays start in.
    index: f64,
}

impl<'a> Aim<'a> {
    /// Aims at targets in the plane `z_mm`; rays start on the plane `start_z_mm`.
    pub(crate) fn new(point: &'a ObjectPoint, z_mm: f64, start_z_mm: f64) -> Self {
        let aim = Self { point, z_mm, start_z_mm, reference_mm: DVec3::ZERO, index: 1.0 };
        let (reference_mm, _) = aim.start(DVec2::ZERO);
        Self { reference_mm, ..aim }
    }

    /// The same in a medium of this index.
    pub(crate) fn within(self, index: f64) -> Self {
        Self { index, ..self }
    }

    /// Returns the start and the direction of the ray towards a target.
    #[inline(always)]
    fn start(&self, target_mm: DVec2) -> (DVec3, DVec3) {
        let target_mm = target_mm.extend(self.z_mm);
        let direction = self.point.direction_to(target_mm);
        // Where the pupil appears behind the object, light runs as though it came from the target.
        let direction = direction * 1.0_f64.copysign(direction.z);
        (target_mm + direction * ((self.start_z_mm - self.z_mm) / direction.z), direction)
    }

    /// Returns the start, the direction and the path length of the ray towards a target.
    #[inline(always)]
    pub(crate) fn ray(&self, target_mm: DVec2) -> (DVec3, DVec3, f64) {
        let (start_mm, direction) = self.start(target_mm);
        (start_mm, direction, self.index * self.point.path_difference_mm(start_mm, self.reference_mm))
    }
}

/// Returns rays from an object point aimed at targets in the plane `z_mm`, started on the plane `start_z_mm`.
///
/// Path lengths are those from the point, less that of the ray aimed at the axis in the same plane; so they are
/// small numbers, exact however far the point is. They are those of an object in air; for any lens's own object space
/// [`MonoLens::rays_towards`](crate::MonoLens::rays_towards) has them. Starting on the first vertex plane (`start_z_mm` = 0) keeps
/// positions exact too.
pub fn rays_towards(point: &ObjectPoint, targets_mm: &[DVec2], z_mm: f64, start_z_mm: f64) -> RayBatch {
    rays_within(1.0, point, targets_mm, [z_mm, start_z_mm])
}

/// Returns such rays in a medium of this index, from the plane of the targets and that of the starts.
pub(crate) fn rays_within(
    index: f64,
    point: &ObjectPoint,
    targets_mm: &[DVec2],
    [z_mm, start_z_mm]: [f64; 2],
) -> RayBatch {
    let aim = Aim::new(point, z_mm, start_z_mm).within(index);
    let mut rays = RayBatch::with_capacity(targets_mm.len());
    rays.object_z_mm = point.z_mm();
    for &target_mm in targets_mm {
        let (start_mm, direction, opl_mm) = aim.ray(target_mm);
        rays.push(start_mm, direction, opl_mm);
    }
    rays
}
