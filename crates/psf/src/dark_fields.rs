//! What stands for fields of a grid that see no light.

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    Diffraction, PsfError,
    gathering::BEFORE_DARK,
    general::GeneralBank,
    lit_fields::LitFields,
    ray_map::{RayMapJob, Sample},
};

/// The image of a lit field that stands for that of a dark one.
#[derive(Debug)]
pub(crate) struct StandIn {
    pub(crate) sample: Sample,
    /// Where the dark field would land, mm, if the image went on straight.
    pub(crate) centroid_mm: DVec2,
}

impl StandIn {
    /// Returns for each dark sample of a bank the image of the last lit field on the way to it; none where light does not end within its fields.
    ///
    /// # Errors
    /// When the work was cancelled.
    pub(crate) fn of_dark(bank: &GeneralBank, cancel: &Cancel) -> Result<Vec<Option<Self>>, PsfError> {
        let Some(lit_fields) = &bank.lit_fields else { return Ok(vec![]) };
        let (x, y) = (bank.x.knots(), bank.y.knots());
        let fields: Vec<DVec2> = y.iter().flat_map(|&y| x.iter().map(move |&x| DVec2::new(x, y))).collect();
        let has_stop = bank.settings().diffraction != Diffraction::None;
        let found = bank.with_planes(|planes| {
            let stand_in = |(at, sample): (usize, &Option<Sample>)| {
                cancel.check()?;
                let (plane, field_tan) = (at / fields.len(), fields[at % fields.len()]);
                let find = || Self::find(planes[plane], &lit_fields[plane], field_tan, has_stop);
                Ok(if sample.is_none() { find() } else { None })
            };
            bank.samples.par_iter().enumerate().map(stand_in).collect::<Result<_, Cancelled>>()
        })?;
        Ok(found?)
    }

    /// Looks for the last field on the way to a dark one whose image is found.
    fn find(job: RayMapJob<'_>, lit_fields: &LitFields, field_tan: DVec2, has_stop: bool) -> Option<Self> {
        let share = lit_fields.share_of(field_tan);
        let at = |lit: f64| {
            let job = RayMapJob { field_tan: lit_fields.field_at(lit, field_tan), ..job };
            let traced = job.trace(&job.pupil()?, has_stop)?;
            Some(Sample { record: traced.record(job.mesh, has_stop), summary: traced.summary })
        };
        // Where a pupil is too narrow to be found, the next field within.
        let within = (1..=8).map(|steps| (1.0 - BEFORE_DARK * f64::from(steps)).min(share));
        let (lit, sample) = within.into_iter().find_map(|lit| Some((lit, at(lit)?)))?;
        let inner = at(lit - BEFORE_DARK)?;
        let away_tan = |share: f64| lit_fields.field_at(share, field_tan).distance(lit_fields.middle_tan());
        let slope_mm =
            (sample.summary.centroid_mm - inner.summary.centroid_mm) / (away_tan(lit) - away_tan(lit - BEFORE_DARK));
        let centroid_mm = sample.summary.centroid_mm + slope_mm * (away_tan(share) - away_tan(lit));
        Some(Self { sample, centroid_mm })
    }
}
