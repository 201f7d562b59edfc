//! Object points, and bundles of rays from them.

use glam::{DVec2, DVec3};

use crate::{MonoLens, RayBatch, beam::Aim};

/// A point that light comes from, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectPoint {
    /// A point, mm.
    Finite(DVec3),
    /// A far point, by the unit direction in which its light travels.
    Infinite(DVec3),
}

impl ObjectPoint {
    /// Returns the point seen from the paraxial entrance-pupil center of `lens` under these tangents of field angles,
    /// `dioptres` = 1/Z away (Z the axial distance from that center in metres; 0 is infinitely far).
    ///
    /// A telecentric lens has no such center; there the first vertex stands for it
    /// ([`MonoLens::projection_center_z_mm`]).
    pub fn from_field(lens: &MonoLens, field_tan: DVec2, dioptres: f64) -> Self {
        let center_z_mm = lens.projection_center_z_mm();
        if dioptres == 0.0 {
            return Self::Infinite(DVec3::new(-field_tan.x, -field_tan.y, 1.0).normalize());
        }
        let distance_mm = 1e3 / dioptres;
        Self::Finite((field_tan * distance_mm).extend(center_z_mm - distance_mm))
    }

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

/// Returns rays from an object point aimed at targets in the plane `z_mm`, started on the plane `start_z_mm`.
///
/// Path lengths are those from the point, less that of the ray aimed at the axis in the same plane; so they are
/// small numbers, exact however far the point is. They are those of an object in air; for any lens's own object space
/// [`MonoLens::rays_towards`] has them. Starting on the first vertex plane (`start_z_mm` = 0) keeps
/// positions exact too.
pub fn rays_towards(point: &ObjectPoint, targets_mm: &[DVec2], z_mm: f64, start_z_mm: f64) -> RayBatch {
    rays_within(1.0, point, targets_mm, [z_mm, start_z_mm])
}

/// Returns such rays in a medium of this index, from the plane of the targets and that of the starts.
fn rays_within(index: f64, point: &ObjectPoint, targets_mm: &[DVec2], [z_mm, start_z_mm]: [f64; 2]) -> RayBatch {
    let aim = Aim::new(point, z_mm, start_z_mm).within(index);
    let mut rays = RayBatch::with_capacity(targets_mm.len());
    rays.object_z_mm = point.z_mm();
    for &target_mm in targets_mm {
        let (start_mm, direction, opl_mm) = aim.ray(target_mm);
        rays.push(start_mm, direction, opl_mm);
    }
    rays
}

impl MonoLens {
    /// Returns rays as [`rays_towards`](crate::rays_towards) does, with path lengths in the medium that the object of
    /// this lens is in.
    pub fn rays_towards(&self, point: &ObjectPoint, targets_mm: &[DVec2], z_mm: f64, start_z_mm: f64) -> RayBatch {
        rays_within(self.object_index(), point, targets_mm, [z_mm, start_z_mm])
    }
}

/// Returns rays from an object point to a square grid of `n_across`² points, of which those in a disc are kept, on
/// the flat front disc of the lens: the paper's way of choosing rays.
///
/// The disc has the radius of the first surface's rim and lies in its vertex plane.
pub fn rays_over_front(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> RayBatch {
    let radius_mm = lens.semi_aperture_mm(0);
    let at = |i: usize| if n_across < 2 { 0.0 } else { 2.0 * i as f64 / (n_across - 1) as f64 - 1.0 };
    let grid = (0..n_across).flat_map(|row| (0..n_across).map(move |column| DVec2::new(at(column), at(row))));
    let targets: Vec<DVec2> = grid.filter(|p| p.length_squared() <= 1.0).map(|p| p * radius_mm).collect();
    lens.rays_towards(point, &targets, 0.0, 0.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{Lens, Vignetting};

    #[test]
    fn path_lengths_do_not_depend_on_the_start_plane() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let (film_distance_mm, z_mm) = (36.5, lens.first_order().entrance_pupil_z_mm);
        let targets = [DVec2::ZERO, DVec2::new(5.0, 2.0), DVec2::new(-3.0, 7.0)];
        // 1 km away and 20 degrees off, where paths are 4e8 waves of light long.
        for dioptres in [0.0, 1e-3, 2.0] {
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.2, 0.1), dioptres);
            let paths = |start_z_mm: f64| {
                let mut rays = rays_towards(&point, &targets, z_mm, start_z_mm);
                lens.trace(&mut rays, Vignetting::On);
                lens.to_film(&mut rays, film_distance_mm);
                [rays.opl_mm[1] - rays.opl_mm[0], rays.opl_mm[2] - rays.opl_mm[0]]
            };
            let (near, far) = (paths(0.0), paths(-100.0));
            for (a, b) in near.into_iter().zip(far) {
                assert!((a - b).abs() < 1e-6 * 550e-6, "{dioptres}: {a} {b}");
            }
        }
    }

    #[test]
    fn paper_mode_fills_the_front_disc_evenly() {
        let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.5);
        let rays = rays_over_front(&lens, &point, 201);
        assert!((rays.len() as f64 / 201_f64.powi(2) - PI / 4.0).abs() < 0.01);
        assert!(rays.z_mm.iter().all(|z| *z == 0.0));
        let widest = (0..rays.len()).map(|i| rays.x_mm[i].hypot(rays.y_mm[i])).fold(0.0, f64::max);
        assert!((widest - 12.5).abs() < 1e-9, "{widest}");
    }
}
