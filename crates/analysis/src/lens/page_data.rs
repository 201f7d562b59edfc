//! What the page of a lens shows beside its analysis.

use dioptric_optics::Lens;

use super::{curves::ends_of, focus_spots::FocusSpot, footprint::Footprint};
use crate::{AnalysisRequest, LensAnalysis, LensCurves, LensData, LensDefaults, LensInfoRequest, LensModulation};
use dioptric_pipeline::PipelineError;

/// The widest field that third-order sums are shown of, degrees.
const MOST_FIELD_OF_SUMS_DEG: f64 = 45.0;

/// The lens that was analyzed, its first-order data and its modulation.
#[derive(Clone, Debug)]
pub struct LensPageData {
    /// The lens that was analyzed: an afocal one with an ideal lens behind it.
    pub lens: Lens,
    /// What the lens's file calls its surfaces; empty where it names none.
    pub surface_comments: Vec<String>,
    /// First- and third-order data of the lens itself, one each of the wavelengths.
    pub data: Vec<LensData>,
    /// The field that its third-order sums are of, degrees.
    pub sums_field_deg: f64,
    /// Curves over field, focus and wavelength.
    pub curves: LensCurves,
    /// Spots of each field on a film that goes through focus.
    pub focus_spots: Vec<Vec<FocusSpot>>,
    /// Where the light of each field meets the surfaces.
    pub footprints: Vec<Footprint>,
    /// The modulation, or why there is none.
    pub modulation: Result<LensModulation, String>,
}

impl LensPageData {
    /// Computes it for an analysis of a lens.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength.
    pub fn of(request: &AnalysisRequest, used: &LensDefaults, analysis: &LensAnalysis) -> Result<Self, PipelineError> {
        let lens = request.lens_with_image(&used.lens)?.0.into_owned();
        let field_deg = analysis.fields.iter().map(|row| row.place.field_deg).fold(0.0, f64::max);
        // Third-order sums say little of wide fields.
        let sums_field_deg = field_deg.min(MOST_FIELD_OF_SUMS_DEG);
        let distance_mm = Some(request.distance_mm).filter(|mm| mm.is_finite());
        let ends_nm = ends_of(&request.wavelengths_nm);
        let data = |&wavelength_nm: &f64| {
            let question = LensInfoRequest {
                wavelength_nm,
                distance_mm,
                field_deg: sums_field_deg,
                colors_nm: ends_nm,
                blur_um: None,
            };
            LensData::new(&used.lens, &question)
        };
        Ok(Self {
            data: request.wavelengths_nm.iter().map(data).collect::<Result<_, _>>()?,
            curves: analysis.lens_curves(&lens)?,
            focus_spots: analysis.focus_spots(&lens)?,
            footprints: analysis.footprints(&lens)?,
            modulation: analysis.modulation(&lens).map_err(|error| error.to_string()),
            surface_comments: used.surface_comments.clone(),
            sums_field_deg,
            lens,
        })
    }
}
