//! Ghosts on the film: drawn band by band, and added to what the lens images.

use std::sync::Arc;

use dioptric_forward::{GhostDetail, GhostFilm, GhostSources, ImagingPlan, Source};
use dioptric_optics::{GhostRequest, Lens, ObjectPoint, glam::DVec2};
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
    film_reflectance: f64,
    /// The share of it that is counted: all, or that of a photodiode.
    share: f32,
}

impl Ghosts {
    /// Returns those of a scene that a plan was made for. Each of `n_photodiodes` gets as much of them as the others.
    pub(super) fn of(
        plan: &ImagingPlan,
        scene: &Scene,
        (lens, place, film_reflectance): (Arc<ResolvedLens>, Arc<FilmPlace>, f64),
        (quality, n_photodiodes): (Quality, usize),
    ) -> Result<Self, PipelineError> {
        let sources = GhostSources::of_scene(plan, &Source::of_scene(scene)?, detail(quality))?;
        Ok(Self { sources, lens, place, film_reflectance, share: (n_photodiodes as f32).recip() })
    }

    /// Adds those of a band to what the film gets; returns their mean.
    pub(super) fn add(
        &self,
        (band, wavelength_nm): (usize, f64),
        plane: &mut Array2<f32>,
        cancel: &Cancel,
    ) -> Result<f64, PipelineError> {
        let lens = self.lens.lens.at(wavelength_nm)?;
        let on = GhostFilm { lens: &lens, mirror: self.place.mirror(self.film_reflectance), film: self.place.film() };
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
const VEIL_RAYS: usize = 400;
const VEIL_PLACES: [f64; 3] = [0.0, 0.5, 0.9];

/// Returns what surfaces reflect to a film over what the lens images there, for far points of equal brightness in three fields, at the wavelengths
/// that halve the thirds of a range; none where ghosts of the lens are not followed.
pub(super) fn veil(
    lens: &Lens,
    place: &FilmPlace,
    film_reflectance: f64,
    (first_nm, last_nm): (f64, f64),
) -> Option<f64> {
    let half_diagonal_mm = place.film().half_diagonal_mm();
    // A square about the image wherever that lies.
    let film_half_mm = Some(DVec2::splat(half_diagonal_mm));
    let mut sums = [0.0; 2];
    for third in 0..3 {
        let lens = lens.at(first_nm + (last_nm - first_nm) * (f64::from(third) + 0.5) / 3.0).ok()?;
        let (film_distance_mm, rim_z_mm) = (place.film_distance_mm, lens.front_rim_z_mm());
        for share in VEIL_PLACES {
            let angle_rad = (share * half_diagonal_mm / lens.first_order().efl_mm.abs()).atan();
            let point = ObjectPoint::far(angle_rad, DVec2::Y);
            let request = GhostRequest {
                point,
                film_distance_mm,
                n_rays: VEIL_RAYS,
                rim_z_mm,
                film_half_mm,
                film_reflectance,
                most_bounces: 2,
            };
            let found = lens.ghosts(&request).ok()?;
            sums[0] += found.pairs.iter().map(|ghost| ghost.light.power_on_film).fold(0.0, |sum, power| sum + power);
            sums[1] += found.direct.power;
        }
    }
    (sums[1] > 0.0).then_some(sums[0] / sums[1])
}
