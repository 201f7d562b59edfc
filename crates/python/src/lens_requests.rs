//! What is asked of a lens, from keyword arguments.

use std::sync::Arc;

use dioptric_analysis::{
    AfocalView, AnalysisFields, AnalysisFilm, AnalysisRequest, FilmUse, LensDefaults, PsfRequest, PsfRow, PsfSampling,
    PsfSet,
};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_pipeline::{Diffraction, PsfFile, REFERENCE_WAVELENGTH_NM};
use ndarray::{ArrayD, IxDyn};
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    errors::{exception, wrong},
    input::{array_f64, is_single, number, numbers, path},
    options::{count, diffraction, each_option, seed, with_gamma},
    view::view,
    worker::run_apart,
};

/// Wavelengths of an analysis where neither the caller nor the lens's file names some, nm.
const USUAL_NM: [f64; 3] = [450.0, 550.0, 650.0];

/// Returns the analysis that is asked for; what is left out is that of the lens's file.
pub(crate) fn analysis_request(used: &LensDefaults, options: Option<&Bound<'_, PyDict>>) -> PyResult<AnalysisRequest> {
    let mut request = AnalysisRequest {
        fields: AnalysisFields::ByLight,
        main_wavelength_nm: used.reference_nm,
        wavelength_weights: Vec::new(),
        field_weights: Vec::new(),
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
            main_nm: used.reference_nm,
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
            "film_xy_mm",
            "distance_mm",
            "wavelengths_nm",
            "focus_mm",
            "film_mm",
            "pixel_um",
            "shape",
            "diffraction",
            "gamma",
            "psfs",
            "rays",
            "exact_grid",
            "seed",
            "mtf_per_mm",
        ];
        let (mut is_exact_grid, mut is_stated, mut stored) = (false, false, None);
        let (mut fields_deg, mut fields_y_deg, mut film) = (None, None, None);
        let mut film_xy_mm: Option<Vec<[f64; 2]>> = None;
        each_option(function, options, &known, |key, value| {
            match key {
                "field_deg" => {
                    single[0] &= is_single(value);
                    fields_deg = Some(numbers(key, value)?);
                }
                "field_y_deg" => {
                    single[0] &= is_single(value);
                    fields_y_deg = Some(numbers(key, value)?);
                }
                "film_xy_mm" => {
                    let places = places_mm(key, value)?;
                    single[0] = places.1;
                    film_xy_mm = Some(places.0);
                }
                "distance_mm" => (request.distances_mm, single[1]) = (numbers(key, value)?, is_single(value)),
                "wavelengths_nm" => (request.wavelengths_nm, single[2]) = (numbers(key, value)?, is_single(value)),
                "focus_mm" => film = Some(AnalysisFilm::FocusMm(number(key, value)?)),
                "film_mm" => film = Some(AnalysisFilm::FilmMm(number(key, value)?)),
                "pixel_um" => request.pixel_um = number(key, value)?,
                "shape" => request.size = Some(count(key, value)?),
                "diffraction" => (request.diffraction, is_stated) = (diffraction(key, value)?, true),
                "psfs" => stored = Some(PsfFile::read(&path(key, value)?).map_err(exception)?.array),
                "gamma" => request.diffraction = with_gamma(request.diffraction, number(key, value)?)?,
                "rays" => request.sampling = PsfSampling::Paper { n_across: count(key, value)?, jitter: true },
                "exact_grid" => is_exact_grid = value.extract()?,
                "seed" => request.seed = seed(key, value)?,
                _ => request.mtf_per_mm = numbers(key, value)?,
            }
            Ok(())
        })?;
        if let PsfSampling::Paper { jitter, .. } = &mut request.sampling {
            *jitter = !is_exact_grid;
        }
        if let Some(array) = stored {
            if matches!(request.sampling, PsfSampling::Paper { .. }) {
                return Err(wrong("rays", "a number".to_owned(), "none, with psfs of a file"));
            }
            request.sampling = PsfSampling::Stored(array);
            // They have that of their own.
            request.diffraction = if is_stated { request.diffraction } else { Diffraction::None };
        }
        if film_xy_mm.is_none() {
            request.fields_deg = pairs(fields_deg.as_deref(), fields_y_deg.as_deref())?;
        } else if fields_deg.is_some() || fields_y_deg.is_some() {
            return Err(wrong("film_xy_mm", "given beside field_deg", "places on the film or angles"));
        }
        request.film = match (film, used.film(), request.distances_mm.first()) {
            (Some(film), ..) | (None, film @ AnalysisFilm::OfFile(_), _) => film,
            (None, _, Some(&distance_mm)) => {
                let film = AnalysisFilm::FocusMm(distance_mm);
                let of = FilmUse {
                    main_nm: request.main_nm,
                    wavelengths_nm: &request.wavelengths_nm,
                    weights: &request.spectral_weights,
                    distance_mm,
                };
                let view = AfocalView::of(&used.lens, AnalysisFilm::BestFocus, &of).map_err(exception)?;
                view.map_or(film, |_| AnalysisFilm::Afocal)
            }
            (None, film, None) => film,
        };
        if let Some(places_mm) = film_xy_mm {
            request.fields_deg = fields_of(&request, &used.lens, &places_mm)?;
        }
        Ok(Self { request, is_single: single })
    }

    /// Returns the pictures as an array of Python's class `Psf`, with what is known of each.
    pub(crate) fn pictures<'py>(&self, py: Python<'py>, lens: &Lens) -> PyResult<Bound<'py, PyAny>> {
        let set = self.compute(py, lens)?;
        let (n, n_points) = (self.request.size.unwrap_or(1), set.pictures.len());
        let of_rows = |pick: fn(&PsfRow) -> f64| -> Vec<f64> { set.rows.iter().map(pick).collect() };
        let columns = [of_rows(|row| row.energy), of_rows(|row| row.centroid_x_mm), of_rows(|row| row.centroid_y_mm)];
        let mut samples: Vec<f32> = Vec::with_capacity(n_points * n * n);
        for picture in &set.pictures {
            samples.extend(picture.iter());
        }
        let request = &self.request;
        let lists = [request.fields_deg.len(), request.distances_mm.len(), request.wavelengths_nm.len()];
        let kept = lists.iter().zip(self.is_single).filter(|(_, is_single)| !is_single).map(|(n, _)| *n);
        let points: Vec<usize> = kept.collect();
        let shape = [&points[..], &[n, n]].concat();
        let array =
            ArrayD::from_shape_vec(IxDyn(&shape), samples).map_err(|_| wrong("shape", n, "pictures of equal size"))?;
        let array = view(py, &Arc::new(array), |array| array.view())?;
        let mut arguments = vec![array];
        for column in columns {
            let column = ArrayD::from_shape_vec(IxDyn(&points), column).expect("a number a picture");
            arguments.push(view(py, &Arc::new(column), |column| column.view())?);
        }
        arguments.push(set.pixel_um.into_bound_py_any(py)?);
        arguments.push(set.film_distance_mm.into_bound_py_any(py)?);
        py.import("dioptric._psf")?.getattr("Psf")?.call1(PyTuple::new(py, arguments)?)
    }

    pub(crate) fn compute(&self, py: Python<'_>, lens: &Lens) -> PyResult<PsfSet> {
        let (request, lens) = (self.request.clone(), lens.clone());
        run_apart(py, move |cancel| request.compute_until(&lens, cancel))
    }
}

/// Returns field angles to the right and upwards: as many as one of the lists has, where the other has one number for all.
fn pairs(right_deg: Option<&[f64]>, up_deg: Option<&[f64]>) -> PyResult<Vec<[f64; 2]>> {
    let (right_deg, up_deg) = (right_deg.unwrap_or(&[0.0]), up_deg.unwrap_or(&[0.0]));
    let n = right_deg.len().max(up_deg.len());
    if [right_deg, up_deg].iter().any(|list| ![1, n].contains(&list.len())) {
        let found = format!("of {} angles", up_deg.len());
        return Err(wrong("field_y_deg", found, &format!("one, or {}, as field_deg has", right_deg.len())));
    }
    let at = |list: &[f64], i: usize| list[i.min(list.len() - 1)];
    Ok((0..n).map(|i| [at(right_deg, i), at(up_deg, i)]).collect())
}

/// Reads places on the film, and whether it is a single one.
fn places_mm(key: &str, value: &Bound<'_, PyAny>) -> PyResult<(Vec<[f64; 2]>, bool)> {
    let array = array_f64(key, value)?;
    let array = array.as_array();
    let is_single = array.ndim() == 1;
    match array.shape() {
        [2] | [_, 2] if !array.is_empty() => {
            let flat: Vec<f64> = array.iter().copied().collect();
            Ok((flat.chunks_exact(2).map(|xy| [xy[0], xy[1]]).collect(), is_single))
        }
        shape => Err(wrong(key, format!("of shape {shape:?}"), "a place (x, y) in mm, or a list of them")),
    }
}

/// Returns the field angles of points whose chief rays go to these places on the film, as the picture shows them.
fn fields_of(request: &PsfRequest, lens: &Lens, places_mm: &[[f64; 2]]) -> PyResult<Vec<[f64; 2]>> {
    let &[distance_mm] = request.distances_mm.as_slice() else {
        let found = format!("given with {} distances", request.distances_mm.len());
        return Err(wrong("film_xy_mm", found, "one distance_mm: field angles are others at each"));
    };
    if request.film == AnalysisFilm::Afocal {
        return Err(wrong("film_xy_mm", "given for a lens without an image", "field_deg"));
    }
    let film_mm = request.film_place(lens).map_err(exception)?.distance_mm;
    let mono = lens.at(request.reference_nm(lens).map_err(exception)?).map_err(exception)?;
    let dioptres = 1e3 / (distance_mm + mono.projection_center_z_mm());
    let field = |&[x_mm, y_mm]: &[f64; 2]| {
        // The picture is turned before the film.
        let tan = mono.field_tan_of_image(-DVec2::new(x_mm, y_mm), film_mm, dioptres).ok_or_else(|| {
            wrong("film_xy_mm", format!("({x_mm}, {y_mm})"), "a place on the film that a chief ray goes to")
        })?;
        // Not −0.
        Ok(tan.to_array().map(|tan| tan.atan().to_degrees() + 0.0))
    };
    places_mm.iter().map(field).collect()
}
