//! How rays on the film stand for waves: equations 1 to 4 of `docs/wave.md`.

use dioptric_optics::{ImageSurface, MonoLens, RayBatch};
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

impl Propagation {
    /// Returns the waves that rays on the film stand for by this propagation.
    pub(super) fn waves_of(self, rays: &FilmRays, reference_mm: DVec2) -> Waves {
        match self {
            Self::Debye => Waves::along_rays(rays, reference_mm),
            Self::Fresnel => Waves::each_from_exit_pupil(rays, reference_mm),
        }
    }
}

/// In a pupil of fewer Fresnel zones than this rays land elsewhere than the waves that they stand for.
const FEW_FRESNEL_ZONES: f64 = 30.0;

/// Whether the exit pupil is so small and far, or the lens so weak, that its waves are not gathered where its rays are.
pub(super) fn has_few_zones(lens: &MonoLens, film_distance_mm: f64) -> bool {
    let first = lens.first_order();
    let (radius_mm, way_mm) = (0.5 * first.exit_pupil_diameter_mm, film_distance_mm - first.exit_pupil_z_mm);
    let zones = first.image_index * radius_mm * radius_mm / (lens.wavelength_nm() * 1e-6 * way_mm.abs());
    // A telecentric lens has a pupil infinitely large and far: no reason for doubt.
    way_mm.is_finite() && (first.power_per_mm == 0.0 || zones < FEW_FRESNEL_ZONES)
}

/// Rays where they meet the film, in the film's own frame: z is 0 on a flat film.
pub(crate) struct FilmRays {
    /// Where the rays meet the film, mm.
    pub(crate) points_mm: Vec<DVec3>,
    /// Unit directions.
    pub(crate) directions: Vec<DVec3>,
    /// Optical paths from the object, mm.
    pub(crate) opl_mm: Vec<f64>,
    /// The middle of the exit pupil, mm; `None` where it is infinitely far.
    pub(crate) exit_pupil_mm: Option<DVec3>,
    shape: ImageSurface,
    image_index: f64,
}

impl FilmRays {
    /// Takes rays that are on the film, `film_distance_mm` behind the last vertex, into its frame.
    pub(crate) fn new(rays: &RayBatch, lens: &MonoLens, film_distance_mm: f64) -> Self {
        let placement = lens.film_placement(film_distance_mm);
        let exit_z_mm = lens.first_order().exit_pupil_z_mm;
        Self {
            points_mm: (0..rays.len()).map(|i| placement.surface_from_lens(rays.point_mm(i))).collect(),
            directions: (0..rays.len()).map(|i| placement.direction_to_own(rays.direction(i))).collect(),
            opl_mm: rays.opl_mm.clone(),
            exit_pupil_mm: exit_z_mm
                .is_finite()
                .then(|| placement.surface_from_lens(lens.film_placement(exit_z_mm).vertex_mm)),
            shape: lens.image_surface(),
            image_index: lens.image_index(),
        }
    }

    /// Adds rays of the same lens on the same film.
    pub(crate) fn append(&mut self, mut more: Self) {
        self.points_mm.append(&mut more.points_mm);
        self.directions.append(&mut more.directions);
        self.opl_mm.append(&mut more.opl_mm);
    }

    /// Returns where a ray lies on the film, mm from its vertex.
    pub(crate) fn place_mm(&self, ray: usize) -> DVec2 {
        self.points_mm[ray].truncate()
    }

    /// Returns the point of the film over a place.
    pub(crate) fn film_point_mm(&self, place_mm: DVec2) -> DVec3 {
        place_mm.extend(self.shape.sag_at_mm(place_mm))
    }

    /// Returns by how much the path of a wave of this direction grows with the place on the film, along x and y, about a
    /// place.
    pub(crate) fn along_film(&self, direction: DVec3, about_mm: DVec2) -> DVec2 {
        direction.truncate() + direction.z * self.shape.slope_at(about_mm)
    }
}

/// Directions of waves, and optical paths along them to the reference point.
///
/// The directions are those by which phases grow along the film's own x and y: of a curved film not only the waves' own x
/// and y.
pub(super) struct Waves {
    pub(super) propagation: Propagation,
    pub(super) d: Vec<DVec2>,
    pub(super) phi_mm: Vec<f64>,
}

impl Waves {
    /// Returns the waves that rays on the film stand for, with paths to a film point: spherical ones where that can be.
    pub(super) fn of(rays: &FilmRays, reference_mm: DVec2) -> Self {
        let spherical = Self::each_from_exit_pupil(rays, reference_mm).if_finite();
        spherical.unwrap_or_else(|| Self::along_rays(rays, reference_mm))
    }

    /// Returns the waves if the paths of all are numbers.
    pub(super) fn if_finite(self) -> Option<Self> {
        self.phi_mm.iter().all(|phi| phi.is_finite()).then_some(self)
    }

    /// Each ray as a plane wave (eq. 2).
    fn along_rays(rays: &FilmRays, reference_mm: DVec2) -> Self {
        let center_mm = rays.film_point_mm(reference_mm);
        let wave = |i: usize| {
            let direction = rays.directions[i];
            let q = rays.points_mm[i] - center_mm;
            (rays.along_film(direction, reference_mm), rays.opl_mm[i] - rays.image_index * q.dot(direction))
        };
        let (d, phi_mm) = (0..rays.points_mm.len()).map(wave).unzip();
        Self { propagation: Propagation::Debye, d, phi_mm }
    }

    /// Each ray as a spherical wave from where it crosses the sphere about the reference point through the middle of the
    /// exit pupil; of one that does not cross it the path is no number.
    ///
    /// To a place δ beside the reference they all go further by the same δ²/2R, which |U|² does not feel, and
    /// by d·δ: so they are summed like plane waves, and like Huygens' to the next order, δ² NA²/R.
    fn each_from_exit_pupil(rays: &FilmRays, reference_mm: DVec2) -> Self {
        let pupil_mm = rays.exit_pupil_mm.unwrap_or(DVec3::NAN);
        let center_mm = rays.film_point_mm(reference_mm);
        // A pupil behind the film is a virtual one: the waves run backwards to it.
        let radius_mm = center_mm.distance(pupil_mm).copysign(-pupil_mm.z);
        let wave = |i: usize| {
            let direction = rays.directions[i];
            let q = rays.points_mm[i] - center_mm;
            let along = q.dot(direction);
            let excess_mm = (along * along - q.length_squared()) / radius_mm;
            // How much further back than the radius the ray has crossed the sphere (eq. 3), and the way from there (eq. 4).
            let beyond_mm = along + excess_mm / (1.0 + (1.0 + excess_mm / radius_mm).sqrt());
            let d = rays.along_film(direction + (direction * beyond_mm - q) / radius_mm, reference_mm);
            (d, rays.opl_mm[i] - rays.image_index * beyond_mm)
        };
        let (d, phi_mm): (Vec<DVec2>, Vec<f64>) = (0..rays.points_mm.len()).map(wave).unzip();
        Self { propagation: Propagation::Fresnel, d, phi_mm }
    }
}
