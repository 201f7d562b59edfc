//! Up to which field a lens gathers the light of a point to an image.
//!
//! Far beyond the fields that a lens is made for, rays of one point may land anywhere: a simple lens at 60° spreads them over more of the film than the picture of
//! all fields within takes up. Where such fields come in depends on single rays; no kernel stands between two of them. So models end before them.

use dioptric_optics::MonoLens;
use glam::DVec2;

use crate::{
    mesh::Mesh,
    pupil::Pupil,
    ray_map::{RayMapJob, RayMapMoments},
};

/// By how much of its image height the rms spread of a field may be larger than on the axis. Of an even disc as large 95 % of the energy lies within
/// half the image height.
const MOST_SPREAD: f64 = 1.0 / 3.0;

/// A mesh that is fine enough for an rms spread.
const MESH: Mesh = Mesh { n_rings: 8, n_azimuths: 32 };

/// Whether the light of a point is gathered to an image, by the moments of its ray map and of that of the axis.
pub(crate) fn is_gathered(here: &RayMapMoments, axial: &RayMapMoments) -> bool {
    here.rms_mm <= axial.rms_mm + MOST_SPREAD * here.centroid_mm.length()
}

/// How far beyond the last field of a model its end is looked for, as a part of it; and how far before the end a model of it stops.
pub(crate) const BEYOND_LAST: f64 = 2e-3;
const BEFORE_END: f64 = 5e-4;

/// Returns a field (tangent) just before the first whose light is not gathered to an image, or `last_tan` if that of all fields up to there is.
///
/// Light of a point is gathered where its rms spread is larger than that on the axis by at most a third of its image height. Models of the images of a lens
/// with an axis end there. `reference` is the lens at the wavelength whose entrance pupil fields and `dioptres` count from; the film lies `film_distance_mm` behind
/// the last vertex.
#[must_use]
pub fn last_gathered_tan(
    (lens, reference): (&MonoLens, &MonoLens),
    dioptres: f64,
    film_distance_mm: f64,
    last_tan: f64,
) -> f64 {
    /// Halvings of the range of fields.
    const STEPS: usize = 24;
    let moments = |tan: f64| {
        let job = RayMapJob { lens, reference, field_tan: DVec2::X * tan, dioptres, film_distance_mm, mesh: MESH };
        let pupil = Pupil::find(lens, &job.point(), MESH.n_azimuths)?;
        Some(job.trace(&pupil, false)?.summary)
    };
    let Some(axial) = moments(0.0) else { return last_tan };
    // Fields without light end a model by themselves.
    let is_within = |tan: f64| moments(tan).is_none_or(|here| is_gathered(&here, &axial));
    if is_within(last_tan) {
        return last_tan;
    }
    let (mut low, mut high) = (0.0, last_tan);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if is_within(middle) { low = middle } else { high = middle }
    }
    low * (1.0 - BEFORE_END)
}
