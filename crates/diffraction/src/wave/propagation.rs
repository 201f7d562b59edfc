//! How rays on the film stand for waves.

use dioptric_optics::{MonoLens, RayBatch};
use glam::{DVec2, DVec3};

/// How the light gets from the lens to the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Propagation {
    /// Each ray stands for a plane wave along it (Debye): where the exit pupil is infinitely far, or so near the film
    /// that no sphere about the image goes through it.
    Debye,
    /// Each point of the sphere about the image through the middle of the exit pupil sends a spherical wave to the film
    /// (Huygens and Fresnel).
    Fresnel,
}

/// In a pupil of fewer Fresnel zones than this rays land elsewhere than the waves that they stand for.
const FEW_FRESNEL_ZONES: f64 = 30.0;

/// Whether the exit pupil is so small and far, or the lens so weak, that its waves are not gathered where its rays are.
pub(super) fn has_few_zones(lens: &MonoLens, film_mm: f64) -> bool {
    let first = lens.first_order();
    let (radius_mm, way_mm) = (0.5 * first.exit_pupil_diameter_mm, film_mm - first.exit_pupil_z_mm);
    let zones = first.image_index * radius_mm * radius_mm / (lens.wavelength_nm() * 1e-6 * way_mm.abs());
    // A telecentric lens has a pupil infinitely large and far: no reason for doubt.
    way_mm.is_finite() && (first.power_per_mm == 0.0 || zones < FEW_FRESNEL_ZONES)
}

/// Directions of waves, and optical paths along them to the reference point.
///
/// The directions are those by which phases grow along x and y of the lens frame on the film: of a tilted film not
/// only the waves' own x and y.
pub(super) struct Waves {
    pub(super) propagation: Propagation,
    pub(super) d: Vec<DVec2>,
    pub(super) phi_mm: Vec<f64>,
}

/// A film: where its vertex is in the lens frame, and how its z grows with x and y.
#[derive(Clone, Copy)]
struct Film {
    vertex_mm: DVec3,
    slope: DVec2,
}

impl Film {
    fn new(lens: &MonoLens, film_mm: f64) -> Self {
        let pose = lens.film_pose(film_mm);
        let normal = pose.rotation.z_axis;
        Self { vertex_mm: pose.vertex_mm, slope: -normal.truncate() / normal.z }
    }

    fn point_mm(&self, at_mm: DVec2) -> DVec3 {
        at_mm.extend(self.vertex_mm.z + self.slope.dot(at_mm - self.vertex_mm.truncate()))
    }

    fn along(&self, direction: DVec3) -> DVec2 {
        direction.truncate() + direction.z * self.slope
    }
}

impl Waves {
    /// Returns the waves that rays on the film stand for, with paths to a film point: spherical ones where that can be.
    pub(super) fn of(rays: &RayBatch, reference_mm: DVec2, lens: &MonoLens, film_mm: f64) -> Self {
        Self::from_exit_pupil(rays, reference_mm, lens, film_mm)
            .unwrap_or_else(|| Self::along_rays(rays, reference_mm, lens, film_mm))
    }

    /// Each ray as a plane wave.
    pub(super) fn along_rays(rays: &RayBatch, reference_mm: DVec2, lens: &MonoLens, film_mm: f64) -> Self {
        let film = Film::new(lens, film_mm);
        let wave = |i: usize| {
            let d = film.along(rays.direction(i));
            let q = rays.point_mm(i).truncate() - reference_mm;
            (d, rays.opl_mm[i] - lens.image_index() * q.dot(d))
        };
        let (d, phi_mm) = (0..rays.len()).map(wave).unzip();
        Self { propagation: Propagation::Debye, d, phi_mm }
    }

    /// Each ray as a spherical wave from where it crosses the sphere about the reference point through the middle of the
    /// exit pupil, if all do.
    ///
    /// To a place δ beside the reference they all go further by the same δ²/2R, which |U|² does not feel, and
    /// by d·δ: so they are summed like plane waves, and like Huygens' to the next order, δ² NA²/R.
    fn from_exit_pupil(rays: &RayBatch, reference_mm: DVec2, lens: &MonoLens, film_mm: f64) -> Option<Self> {
        let film = Film::new(lens, film_mm);
        let exit_z_mm = lens.first_order().exit_pupil_z_mm;
        if !exit_z_mm.is_finite() {
            return None;
        }
        let center_mm = film.point_mm(reference_mm);
        // A pupil behind the film is a virtual one: the waves run backwards to it.
        let pupil_mm = lens.film_pose(exit_z_mm).vertex_mm;
        let radius_mm = center_mm.distance(pupil_mm).copysign(film_mm - exit_z_mm);
        let wave = |i: usize| {
            let direction = rays.direction(i);
            let q = rays.point_mm(i) - center_mm;
            let along = q.dot(direction);
            let excess_mm = (along * along - q.length_squared()) / radius_mm;
            // How much further back than the radius the ray has crossed the sphere.
            let beyond_mm = along + excess_mm / (1.0 + (1.0 + excess_mm / radius_mm).sqrt());
            let d = film.along(direction + (direction * beyond_mm - q) / radius_mm);
            (d, rays.opl_mm[i] - lens.image_index() * beyond_mm)
        };
        let (d, phi_mm): (Vec<DVec2>, Vec<f64>) = (0..rays.len()).map(wave).unzip();
        phi_mm.iter().all(|phi| phi.is_finite()).then_some(Self { propagation: Propagation::Fresnel, d, phi_mm })
    }
}
