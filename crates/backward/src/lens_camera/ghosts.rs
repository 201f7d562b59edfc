//! Rays from the film that two surfaces of the lens reflect: the ghosts of the picture.
//!
//! Ghosts come to a place of the film from all of the last surface, not from the exit pupil alone. So each sample sends a ray of its own to a point
//! of a circle around that surface. It is followed by all pairs of surfaces, and one way out of the lens is drawn by its share of the light;
//! that way counts for all. The mean is that of all ways, without bias. Since all pairs take as long as ten rays straight through, a sample follows one
//! of its eight wavelengths, which counts for all of them. Light that surfaces reflect four times and more is left out.

use dioptric_optics::{
    FilmGhosts, MirrorFilm, RayBatchF32,
    glam::{DVec2, DVec3},
};

use super::LensCamera;
use crate::{
    BackwardError,
    camera::{CameraRays, PixelSample},
    packets::PACKET,
    sampler::on_disc,
};

/// The pairs of surfaces of a lens as they are met from the film.
#[derive(Clone, Debug)]
pub(super) struct Ghosts {
    /// At each wavelength node.
    lenses: Vec<FilmGhosts>,
    /// The radius of the circle in the last vertex plane that rays aim at, mm.
    radius_mm: f64,
}

/// The pair of numbers that chooses the way of a ghost, and its wavelength.
const WAY_PAIR: u32 = u32::MAX - 2;

impl LensCamera {
    /// Returns the camera with the light that two surfaces of its lens reflect to the film, which itself reflects a share of its light as a mirror
    /// does. A lens that loses no light at surfaces has none.
    ///
    /// Such light is not diffracted.
    ///
    /// # Errors
    /// When the lens is tilted or decentered or has mirrors or gratings, the film reaches into the last surface, or there is an array before the film.
    pub fn with_ghosts(self, film_reflectance: f64) -> Result<Self, BackwardError> {
        let wrong = |found: &str, expected| Err(BackwardError::setting("the reflections of the lens", found, expected));
        if self.micro_array.is_some() {
            return wrong("ghosts behind an array before the film", "none");
        }
        let lens = self.lenses[0].forward();
        if lens.is_lossless() {
            return Ok(self);
        }
        let film = MirrorFilm {
            distance_mm: self.settings.film_distance_mm,
            reflectance: film_reflectance,
            half_mm: 0.5 * self.settings.film_size_mm,
            center_mm: DVec2::ZERO,
        };
        let lenses: Vec<FilmGhosts> =
            self.lenses.iter().map(|lens| Ok(lens.ghosts(&film)?)).collect::<Result<_, BackwardError>>()?;
        let reach_mm = 0.5 * self.settings.film_size_mm.length();
        let Some(radius_mm) = lens.rear_circle_mm(self.settings.film_distance_mm, reach_mm) else {
            return wrong("a film within the hollow of the last surface", "a film behind that surface");
        };
        Ok(Self { ghosts: Some(Ghosts { lenses, radius_mm }), ..self })
    }

    /// Makes rays of a sample of some pixels that two surfaces reflect; none where they are not followed. Returns whether there are any.
    pub(crate) fn ghost_rays(&self, samples: &[PixelSample], nodes: &[usize; PACKET], out: &mut CameraRays) -> bool {
        let Some(Ghosts { lenses, radius_mm }) = &self.ghosts else { return false };
        out.rays.clear();
        out.weights.clear();
        out.is_shared = false;
        let middle = self.lenses[self.lenses.len() / 2].forward();
        let last_z_mm = middle.last_vertex_z_mm();
        let area_mm2 = std::f64::consts::PI * radius_mm * radius_mm;
        // Pixels take turns, from a wavelength on that is drawn once: for each of them all are as likely.
        let first = samples.first().map_or(0.0, |sample| sample.random.pair(WAY_PAIR)[1]);
        let turn = (first * PACKET as f32) as usize;
        let mut starts: [RayBatchF32; PACKET] = Default::default();
        let (mut weights, mut drawn) = (vec![], [const { Vec::new() }; PACKET]);
        for (i, &PixelSample { pixel, random }) in samples.iter().enumerate() {
            let [x, y, u, v] = random.camera();
            let site = middle.film_site(self.on_film_mm(pixel, [x, y]), self.settings.film_distance_mm);
            let point_mm: DVec3 = (*radius_mm * on_disc(u, v)).extend(last_z_mm);
            let (direction, weight) = site.map_or((DVec3::NEG_Z, 0.0), |site| {
                let between_mm = point_mm - site.point_mm;
                let direction = between_mm.normalize();
                let cosines = (direction.dot(site.normal) * direction.z).abs();
                (direction, PACKET as f64 * cosines * area_mm2 / between_mm.length_squared())
            });
            weights.push(weight);
            let own = (i + turn) % PACKET;
            starts[own].push(point_mm, direction);
            drawn[own].push(f64::from(random.pair(WAY_PAIR)[0]));
        }
        for (k, &node) in nodes.iter().enumerate() {
            let indices = {
                let lens = self.lenses[node % self.lenses.len()].forward();
                lens.image_index() / lens.object_index()
            };
            let mut ways = lenses[node % lenses.len()].trace(&mut starts[k], &drawn[k]).into_iter();
            for (i, weight) in weights.iter().enumerate() {
                let way = if (i + turn) % PACKET == k { ways.next().flatten() } else { None };
                let (point_mm, direction, share) =
                    way.map_or((DVec3::ZERO, DVec3::NEG_Z, 0.0), |way| (way.point_mm, way.direction, way.share));
                out.push(self.in_world(point_mm, direction), (weight * indices * indices * share) as f32);
            }
        }
        true
    }

    /// Whether light that surfaces reflect twice is followed.
    pub fn has_ghosts(&self) -> bool {
        self.ghosts.is_some()
    }
}
