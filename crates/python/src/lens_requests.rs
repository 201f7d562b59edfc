//! What is asked of a lens, from keyword arguments.

use dioptric_analysis::{
    AfocalView, AnalysisFields, AnalysisFilm, AnalysisRequest, FilmUse, LensDefaults, PsfRequest, PsfSampling, PsfSet,
};
use dioptric_optics::Lens;
use dioptric_pipeline::{Diffraction, PipelineError, REFERENCE_WAVELENGTH_NM};
use pyo3::{prelude::*, types::PyDict};

use crate::{
    errors::exception,
    input::{is_single, number, numbers},
    options::{count, diffraction, each_option, with_gamma},
    worker::{Follower, run},
};

/// Wavelengths of an analysis where neither the caller nor the lens's file names some, nm.
const USUAL_NM: [f64; 3] = [450.0, 550.0, 650.0];

/// Returns the analysis that is asked for; what is left out is that of the lens's file.
pub(crate) fn analysis_request(used: &LensDefaults, options: Option<&Bound<'_, PyDict>>) -> PyResult<AnalysisRequest> {
    let mut request = AnalysisRequest {
        fields: AnalysisFields::ByLight,
        main_wavelength_nm: used.reference_nm,
        wavelengths_nm: used.wavelengths_or(&USUAL_NM),
        distance_mm: used.distance_mm,
        film: used.film(),
        n_rings: 6,
    };
    let (mut has_fields, mut has_distance) = (false, false);
    let known = ["fields_deg", "wavelengths_nm", "distance_mm", "film_mm", "focus_mm", "rings"];
    each_option("analyze", options, &known, |key, value| {
        match key {
            "fields_deg" => {
                request.fields = AnalysisFields::above_axis_deg(&numbers(key, value)?);
                has_fields = true;
            }
            "wavelengths_nm" => {
                request.wavelengths_nm = numbers(key, value)?;
                request.main_wavelength_nm = None;
            }
            "distance_mm" => {
                request.distance_mm = number(key, value)?;
                has_distance = true;
            }
            "film_mm" => request.film = AnalysisFilm::FilmMm(number(key, value)?),
            "focus_mm" => request.film = AnalysisFilm::FocusMm(number(key, value)?),
            _ => request.n_rings = count(key, value)?,
        }
        Ok(())
    })?;
    let of_file = used.analysis_fields(request.reference_nm());
    // Places of an object elsewhere are not those of this one.
    let fits = |fields: &AnalysisFields| !(has_distance && matches!(fields, AnalysisFields::HeightsMm(_)));
    if let Some(fields) = of_file.filter(fits).filter(|_| !has_fields) {
        request.fields = fields;
    }
    Ok(request)
}

/// What is asked of point spread functions.
pub(crate) struct PsfOptions {
    pub(crate) request: PsfRequest,
    /// Whether field, distance and wavelength are single numbers.
    pub(crate) is_single: [bool; 3],
}

impl PsfOptions {
    /// Reads what is asked for of a lens; what is left out of the film and the object is that of its file.
    pub(crate) fn read(function: &str, options: Option<&Bound<'_, PyDict>>, used: &LensDefaults) -> PyResult<Self> {
        let mut request = PsfRequest {
            fields_deg: Vec::new(),
            distances_mm: vec![used.distance_mm],
            wavelengths_nm: vec![REFERENCE_WAVELENGTH_NM],
            film: AnalysisFilm::BestFocus,
            focus_nm: Vec::new(),
            diffraction: Diffraction::Hurb { gamma: 1.0 },
            pixel_um: 1.0,
            size: Some(65),
            sampling: PsfSampling::Pupil,
            mtf_per_mm: Vec::new(),
            seed: 1,
            spectral_weights: Vec::new(),
        };
        let mut single = [true; 3];
        let known = [
            "field_deg",
            "field_y_deg",
            "distance_mm",
            "wavelengths_nm",
            "focus_mm",
            "film_mm",
            "pixel_um",
            "shape",
            "diffraction",
            "gamma",
            "rays",
            "exact_grid",
            "seed",
            "mtf_per_mm",
        ];
        let mut is_exact_grid = false;
        let (mut fields_deg, mut field_y_deg, mut film) = (vec![0.0], 0.0, None);
        each_option(function, options, &known, |key, value| {
            match key {
                "field_deg" => (fields_deg, single[0]) = (numbers(key, value)?, is_single(value)),
                "field_y_deg" => field_y_deg = number(key, value)?,
                "distance_mm" => (request.distances_mm, single[1]) = (numbers(key, value)?, is_single(value)),
                "wavelengths_nm" => (request.wavelengths_nm, single[2]) = (numbers(key, value)?, is_single(value)),
                "focus_mm" => film = Some(AnalysisFilm::FocusMm(number(key, value)?)),
                "film_mm" => film = Some(AnalysisFilm::FilmMm(number(key, value)?)),
                "pixel_um" => request.pixel_um = number(key, value)?,
                "shape" => request.size = Some(count(key, value)?),
                "diffraction" => request.diffraction = diffraction(key, value)?,
                "gamma" => request.diffraction = with_gamma(request.diffraction, number(key, value)?)?,
                "rays" => request.sampling = PsfSampling::Paper { n_across: count(key, value)?, jitter: true },
                "exact_grid" => is_exact_grid = value.extract()?,
                "seed" => request.seed = count(key, value)? as u64,
                _ => request.mtf_per_mm = numbers(key, value)?,
            }
            Ok(())
        })?;
        if let PsfSampling::Paper { jitter, .. } = &mut request.sampling {
            *jitter = !is_exact_grid;
        }
        request.fields_deg = fields_deg.into_iter().map(|field_deg| [field_deg, field_y_deg]).collect();
        request.film = match (film, used.film(), request.distances_mm.first()) {
            (Some(film), ..) | (None, film @ AnalysisFilm::OfFile(_), _) => film,
            (None, _, Some(&distance_mm)) => {
                let film = AnalysisFilm::FocusMm(distance_mm);
                let reference_nm = request.reference_nm(&used.lens).map_err(exception)?;
                let of = FilmUse { wavelengths_nm: &request.wavelengths_nm, reference_nm, distance_mm };
                let view = AfocalView::of(&used.lens, AnalysisFilm::BestFocus, &of).map_err(exception)?;
                view.map_or(film, |_| AnalysisFilm::Afocal)
            }
            (None, film, None) => film,
        };
        Ok(Self { request, is_single: single })
    }

    pub(crate) fn compute(&self, py: Python<'_>, lens: &Lens) -> PyResult<PsfSet> {
        run(py, &Follower::nobody(), |_, _| -> Result<PsfSet, PipelineError> { self.request.compute(lens) })
    }
}
