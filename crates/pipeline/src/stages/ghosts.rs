//! Ghosts on the film: drawn band by band, and added to what the lens images.

use std::sync::Arc;

use dioptric_forward::{GhostDetail, GhostFilm, GhostSources, ImagingPlan, Source};
use dioptric_optics::{GhostRequest, MonoLens, ObjectPoint, glam::DVec2};
use dioptric_scene::Scene;
use dioptric_spectrum::Cancel;
use ndarray::Array2;

use super::{film::FilmPlace, lens::ResolvedLens};
use crate::{PipelineError, Quality};

/// The light that surfaces of the lens reflect to the film, of a scene.
pub(super) struct Ghosts {
    sources: GhostSources,
    lens: Arc<ResolvedLens>,
    place: Arc<FilmPlace>,
    /// The share of it that is counted: all, or that of a photodiode.
    share: f32,
}

impl Ghosts {
    /// Returns those of a scene that a plan was made for. Each of `n_photodiodes` gets as much of them as the others.
    pub(super) fn of(
        plan: &ImagingPlan,
        scene: &Scene,
        (lens, place): (Arc<ResolvedLens>, Arc<FilmPlace>),
        (quality, n_photodiodes): (Quality, usize),
    ) -> Result<Self, PipelineError> {
        // A lens whose ghosts are not followed is told before the work.
        lens.reference.ghost_beams(place.film_distance_mm)?;
        let sources = GhostSources::of_scene(plan, &Source::of_scene(scene)?, detail(quality))?;
        Ok(Self { sources, lens, place, share: (n_photodiodes as f32).recip() })
    }

    /// Adds those of a band to what the film gets; returns their mean.
    pub(super) fn add(
        &self,
        (band, wavelength_nm): (usize, f64),
        plane: &mut Array2<f32>,
        cancel: &Cancel,
    ) -> Result<f64, PipelineError> {
        let lens = self.lens.lens.at(wavelength_nm)?;
        let on = GhostFilm { lens: &lens, film_distance_mm: self.place.film_distance_mm, film: self.place.film() };
        let ghosts = self.sources.irradiance(band, &on, cancel)? * self.share;
        *plane += &ghosts;
        Ok(ghosts.iter().map(|value| f64::from(*value)).sum::<f64>() / ghosts.len() as f64)
    }
}

/// Cells of the scene, and rays a band, for each quality: of 45 pairs of surfaces 2 µs a ray.
fn detail(quality: Quality) -> GhostDetail {
    let (n_cells, n_rays) = match quality {
        Quality::Sketch => (16, 4_000),
        Quality::Preview => (48, 12_000),
        Quality::Draft => (128, 48_000),
        Quality::Full => (256, 128_000),
    };
    GhostDetail { n_cells, n_rays }
}

/// Rays of each point of the estimate of what is left out, and where on the film its images lie, of the half diagonal.
const VEIL_RAYS: usize = 800;
const VEIL_PLACES: [f64; 3] = [0.0, 0.5, 0.9];

/// Returns what surfaces reflect to a film over what the lens images there, for far points of equal brightness in three fields; none where
/// ghosts of the lens are not followed.
pub(super) fn veil(lens: &MonoLens, place: &FilmPlace) -> Option<f64> {
    let film = place.film();
    // A square about the image wherever that lies: as much as a film's length beside it each way.
    let film_half_mm = Some(DVec2::splat(film.half_diagonal_mm()));
    let focal_mm = lens.first_order().efl_mm.abs();
    let at = |share: f64| -> Option<[f64; 2]> {
        let point = ObjectPoint::far((share * film.half_diagonal_mm() / focal_mm).atan(), DVec2::Y);
        let film_distance_mm = place.film_distance_mm;
        let rim_z_mm = lens.front_rim_z_mm();
        let request = GhostRequest { point, film_distance_mm, n_rays: VEIL_RAYS, rim_z_mm, film_half_mm };
        let found = lens.ghosts(&request).ok()?;
        Some([found.pairs.iter().map(|ghost| ghost.light.power_on_film).sum(), found.direct.power])
    };
    let sums = VEIL_PLACES.iter().map(|&share| at(share)).collect::<Option<Vec<_>>>()?;
    let [ghosts, direct] = [0, 1].map(|i| sums.iter().map(|sum| sum[i]).sum::<f64>());
    (direct > 0.0).then_some(ghosts / direct)
}
