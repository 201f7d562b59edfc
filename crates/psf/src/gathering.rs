//! Up to which field a lens gathers the light of a point to an image.
//!
//! Far beyond the fields that a lens is made for, rays of one point may land anywhere: a simple lens at 60° spreads them over more of the film than the picture of
//! all fields within takes up. Where such fields come in depends on single rays; no kernel stands between two of them. So models end before them.

use dioptric_optics::MonoLens;
use glam::DVec2;

use crate::{
    lit_fields::LitFields,
    mesh::Mesh,
    pupil::Pupil,
    ray_map::{RayMapJob, RayMapMoments},
};

/// By how much of its image height the rms spread of a field may be larger than on the axis. Of an even disc as large 95 % of the energy lies within
/// half the image height.
const MOST_SPREAD: f64 = 1.0 / 3.0;

/// A mesh that is fine enough for an rms spread.
const MESH: Mesh = Mesh { n_rings: 8, n_azimuths: 32 };

/// Whether the light of a point is gathered to an image that lies `radius_mm` from that of the middle of all fields, by the rms spreads of both.
pub(crate) fn is_gathered(rms_mm: f64, middle_rms_mm: f64, radius_mm: f64) -> bool {
    rms_mm <= middle_rms_mm + MOST_SPREAD * radius_mm
}

/// How far beyond the last field of a model its end is looked for, as a part of it; and how far before the end a model of it stops.
pub(crate) const BEYOND_LAST: f64 = 2e-3;
const BEFORE_END: f64 = 5e-4;

/// How far before the last field that sees light a model stops, where the pupil is not yet so narrow that whether it is found depends on how finely it is looked
/// for; and how far beyond the last field of a model it must be dark where no light is taken to come from farther out.
pub(crate) const BEFORE_DARK: f64 = 0.03;

/// The fields whose light a lens gathers to an image, at one wavelength and depth: those whose rms spread is larger than that of a field in their middle by at
/// most a third of the distance between both images. Models of the images of a lens with an axis end there.
#[derive(Clone, Copy, Debug)]
pub struct GatheredFields<'a> {
    job: RayMapJob<'a>,
    middle: RayMapMoments,
}

impl<'a> GatheredFields<'a> {
    /// Looks about a field (tangents), where light gets through. `reference` is the lens at the wavelength whose entrance pupil fields and `dioptres` count
    /// from; the film lies `film_distance_mm` behind the last vertex.
    #[must_use]
    pub fn about(
        middle_tan: DVec2,
        (lens, reference): (&'a MonoLens, &'a MonoLens),
        dioptres: f64,
        film_distance_mm: f64,
    ) -> Option<Self> {
        let job = RayMapJob { lens, reference, field_tan: middle_tan, dioptres, film_distance_mm, mesh: MESH };
        Some(Self { job, middle: moments(job)? })
    }

    /// Whether a field is one of them, or without light: such fields end a model by themselves.
    #[must_use]
    pub fn holds(&self, field_tan: DVec2) -> bool {
        moments(RayMapJob { field_tan, ..self.job }).is_none_or(|here| {
            is_gathered(here.rms_mm, self.middle.rms_mm, here.centroid_mm.distance(self.middle.centroid_mm))
        })
    }

    /// Returns the largest share, from 0 to 1, at which all fields of a family are held; just less than that where it is not 1.
    #[must_use]
    pub fn largest_share<const N: usize>(&self, fields: impl Fn(f64) -> [DVec2; N]) -> f64 {
        Self::largest(|share| fields(share).into_iter().all(|field_tan| self.holds(field_tan)))
    }

    /// Returns the largest share, from 0 to 1, of a field that is held and sees light; a little less than that where it is not 1.
    #[must_use]
    pub fn largest_lit_share(&self, field_tan: DVec2) -> f64 {
        let held = Self::largest(|share| self.holds(share * field_tan));
        let lit = self.lit_share(held * field_tan);
        if lit < 1.0 { held * lit * (1.0 - BEFORE_DARK) } else { held }
    }

    /// Returns the share of a field up to which light gets through, each pupil being looked for about the last: narrow ones are not found from nothing.
    fn lit_share(&self, field_tan: DVec2) -> f64 {
        /// Steps to the field, and halvings of the one in which the light ends.
        const STEPS: u32 = 16;
        const HALVINGS: usize = 10;
        let at = |share: f64| RayMapJob { field_tan: share * field_tan, ..self.job };
        let lit = |pupil: &Pupil, share: f64| {
            let found = pupil.near(self.job.lens, &at(share).point())?;
            at(share).trace(&found, false).is_some().then_some(found)
        };
        let Some(mut pupil) = Pupil::find(self.job.lens, &at(0.0).point(), MESH.n_azimuths) else { return 1.0 };
        let mut low = 0.0;
        for step in 1..=STEPS {
            let share = f64::from(step) / f64::from(STEPS);
            match lit(&pupil, share) {
                Some(found) => (pupil, low) = (found, share),
                None => break,
            }
        }
        let mut half = 0.5 / f64::from(STEPS);
        for _ in 0..if low < 1.0 { HALVINGS } else { 0 } {
            if let Some(found) = lit(&pupil, low + half) {
                (pupil, low) = (found, low + half);
            }
            half *= 0.5;
        }
        low
    }

    /// Returns the fields about the middle that see light, as far as `reach_tan` from it, gathered to an image or not; their end to a thousandth of the
    /// angle of that.
    #[must_use]
    pub fn lit_fields(&self, reach_tan: f64) -> Option<LitFields> {
        LitFields::about(self.job, reach_tan)
    }

    fn largest(holds: impl Fn(f64) -> bool) -> f64 {
        /// Halvings of the range.
        const STEPS: usize = 24;
        if holds(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..STEPS {
            let middle = 0.5 * (low + high);
            if holds(middle) { low = middle } else { high = middle }
        }
        low * (1.0 - BEFORE_END)
    }
}

fn moments(job: RayMapJob<'_>) -> Option<RayMapMoments> {
    let pupil = Pupil::find(job.lens, &job.point(), MESH.n_azimuths)?;
    Some(job.trace(&pupil, false)?.summary)
}
