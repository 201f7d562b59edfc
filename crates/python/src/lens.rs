//! Lenses.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use dioptric_analysis::{LensData, LensDefaults, LensInfoRequest, built_in_lenses};
use dioptric_optics::{Layout, LensFile, MonoLens, ReadOptions, Vignetting};
use dioptric_pipeline::{
    Camera, CoatingSpec, DrawnEye, Given, GlassRange, Iris, KeptCamera, LensReadOptions, LensSpec, MissingGlass,
    REFERENCE_WAVELENGTH_NM, StopSpec, reference_nm_of,
};
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyDict, PyList, PyTuple},
};

use crate::{
    errors::{exception, guarded, wrong},
    input::{is_single, numbers},
    lens_requests::{PsfOptions, analysis_request},
    lens_rows::{lens_of, rows_of, with_surface},
    rays::{GivenRays, Rays, Traced, trace},
    restorer::restorer,
    serial::{from_python, to_python},
    worker::run_apart,
};

/// Rays of each fan of a drawing.
const DRAWN_RAYS: usize = 9;

/// A lens: a train of surfaces with a stop, read from a file, built in, or ideal. It never changes.
///
/// Lens frame: millimetres, +z the way light travels, origin at the first vertex; x to the right, y up. Wavelengths are
/// nanometres, angles degrees, distances of objects positive before the first vertex.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Lens {
    /// The lens with its stop set, and what its file says beside.
    file: LensFile,
    /// What a camera file says of it, where it can.
    choice: Option<(LensSpec, LensReadOptions)>,
    stop: StopSpec,
    /// The blades that it was given.
    iris: Option<Iris>,
    /// The lens at the wavelength of the last trace.
    mono: Mutex<Option<Arc<MonoLens>>>,
}

impl Lens {
    fn new(file: LensFile, choice: Option<(LensSpec, LensReadOptions)>) -> Self {
        Self { file, choice, stop: StopSpec::AsGiven, iris: None, mono: Mutex::default() }
    }

    fn of_choice(choice: LensSpec, reading: LensReadOptions) -> PyResult<Self> {
        let file = choice.open(&reading).map_err(exception)?;
        Ok(Self::new(file, Some((choice, reading))))
    }

    /// Returns the lens of a camera.
    pub(crate) fn of_camera(kept: &KeptCamera) -> PyResult<Self> {
        let camera = kept.camera();
        let lens = match &kept.given().lens {
            Some(file) => Self::new((**file).clone(), None),
            None => Self::of_choice(camera.lens.clone(), camera.lens_reading.clone())?,
        };
        let lens = if camera.iris.is_some() { lens.bladed(camera.iris)? } else { lens };
        lens.stopped(camera.stop)
    }

    fn bladed(&self, iris: Option<Iris>) -> PyResult<Self> {
        let lens = self.file.lens.clone().with_iris(iris).map_err(exception)?;
        Ok(Self {
            file: LensFile { lens, ..self.file.clone() },
            // What a file's own blades are taken from, no camera file says.
            choice: self.choice.clone().filter(|_| iris.is_some()),
            stop: self.stop,
            iris,
            mono: Mutex::default(),
        })
    }

    fn stopped(&self, stop: StopSpec) -> PyResult<Self> {
        let lens = stop.apply_at(self.file.lens.clone(), reference_nm_of(&self.file)).map_err(exception)?;
        let stop = if stop == StopSpec::AsGiven { self.stop } else { stop };
        Ok(Self {
            file: LensFile { lens, ..self.file.clone() },
            choice: self.choice.clone(),
            stop,
            iris: self.iris,
            mono: Mutex::default(),
        })
    }

    /// Returns a camera with this lens.
    pub(crate) fn put_into(&self, kept: &KeptCamera) -> KeptCamera {
        let Some((lens, reading)) = &self.choice else {
            return kept.with_given_lens(Given::new(self.file.clone()));
        };
        let mut given = kept.given().clone();
        given.lens = None;
        let camera = Camera {
            lens: lens.clone(),
            lens_reading: reading.clone(),
            stop: self.stop,
            iris: self.iris,
            ..kept.camera().clone()
        };
        kept.with_camera(camera, given)
    }

    fn mono(&self, wavelength_nm: f64) -> PyResult<Arc<MonoLens>> {
        let mut kept = self.mono.lock().unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some(mono) if mono.wavelength_nm() == wavelength_nm => Ok(mono.clone()),
            _ => {
                let mono = Arc::new(self.file.lens.at(wavelength_nm).map_err(exception)?);
                *kept = Some(mono.clone());
                Ok(mono)
            }
        }
    }

    /// Returns the lens as a part of a camera.
    pub(crate) fn given(&self) -> Given<LensFile> {
        Given::new(self.file.clone())
    }

    /// Returns the lens of a text, and of what a camera file says of it.
    pub(crate) fn restored(
        file: LensFile,
        choice: Option<(LensSpec, LensReadOptions)>,
        (stop, iris): (StopSpec, Option<Iris>),
    ) -> Self {
        Self { file, choice, stop, iris, mono: Mutex::default() }
    }

    fn used(&self) -> LensDefaults {
        LensDefaults::of(self.file.clone())
    }

    fn wavelength_or_usual(&self, wavelength_nm: Option<f64>) -> f64 {
        wavelength_nm.unwrap_or_else(|| self.used().wavelength_or_usual())
    }
}

/// Returns what a word means for wavelengths outside the range in which a glass is known.
fn range_of(glass_range: &str) -> PyResult<GlassRange> {
    match glass_range {
        "refuse" => Ok(GlassRange::Refuse),
        "extend" => Ok(GlassRange::Extend),
        other => Err(wrong("glass_range", format!("'{other}'"), "'refuse' or 'extend'")),
    }
}

#[pymethods]
impl Lens {
    /// Returns the names of the built-in lenses, relaxed eyes among them.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        dioptric_optics::Lens::built_in_names().chain(dioptric_optics::SchematicEye::NAMES).collect()
    }

    /// Returns the built-in lenses as a list of dictionaries: ``name``, ``efl_mm`` and ``f_number`` at 550 nm wide open,
    /// ``surfaces``, ``source``.
    #[staticmethod]
    fn library(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        guarded(|| to_python(py, &built_in_lenses().map_err(exception)?))
    }

    /// Returns a built-in lens, or an ideal one by its numbers: "thin:50mm:f2", "thin:50mm:25mm", "pinhole:0.1mm", or a schematic
    /// eye, accommodated by dioptres: "eye:navarro", "eye:navarro:4D", "eye:arizona:2.5D", "eye:legrand", "eye:legrand:7.05D".
    #[staticmethod]
    fn built_in(name: &str) -> PyResult<Self> {
        guarded(|| Self::of_choice(LensSpec::BuiltIn(name.to_owned()), LensReadOptions::default()))
    }

    /// Reads a lens file: ``.ron`` (our own), ``.dat``, ``.json`` (ISET's or DeepLens's), ``.zmx`` (Zemax), ``.seq`` (CODE V) or
    /// ``.len`` (OSLO).
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    /// glasses : list of paths, optional
    ///     Glass catalogues (``.agf``, ``.yml``) to look in before the built-in one.
    /// missing_glass : {"refuse", "nd-vd", "nearest"}
    ///     What to do with a glass that no catalogue has.
    /// glass_range : {"refuse", "extend"}
    ///     What becomes of a wavelength outside the range in which a glass is known: an error, or the glass is continued
    ///     and `notes_at` states how far its index may be off.
    /// slope_per_nm : float, optional
    ///     Change of index a nanometre of media of which the file states one index alone.
    /// configuration : int, optional
    ///     Which configuration of a file that has several, as the positions of a zoom lens, counted from 1; without it the one that the file
    ///     has in use.
    /// lens_scale : float, optional
    ///     How many times as large the lens is as the file has it, in all its lengths.
    #[staticmethod]
    #[pyo3(signature = (path, *, glasses=None, missing_glass="refuse", glass_range="refuse", slope_per_nm=None, configuration=None, lens_scale=None))]
    fn read(
        path: PathBuf,
        glasses: Option<Vec<PathBuf>>,
        missing_glass: &str,
        glass_range: &str,
        slope_per_nm: Option<f64>,
        configuration: Option<usize>,
        lens_scale: Option<f64>,
    ) -> PyResult<Self> {
        let missing_glass = match missing_glass {
            "refuse" => MissingGlass::Refuse,
            "nd-vd" => MissingGlass::FromNdVd,
            "nearest" => MissingGlass::Nearest,
            other => return Err(wrong("missing_glass", format!("'{other}'"), "'refuse', 'nd-vd' or 'nearest'")),
        };
        let glass_range = range_of(glass_range)?;
        let glasses = glasses.unwrap_or_default();
        let reading = LensReadOptions {
            glasses,
            missing_glass,
            glass_range,
            slope_per_nm,
            configuration,
            lens_scale,
            ..LensReadOptions::default()
        };
        guarded(|| Self::of_choice(LensSpec::File(path), reading))
    }

    /// Returns the lens of a file's text.
    ///
    /// Parameters
    /// ----------
    /// text : str
    /// name : str
    ///     What to call it; its ending tells the format, as of `Lens.read`.
    #[staticmethod]
    #[pyo3(signature = (text, name="lens.ron"))]
    fn parse(text: &str, name: &str) -> PyResult<Self> {
        guarded(|| {
            let file =
                LensFile::from_bytes(name.as_ref(), text.as_bytes(), &ReadOptions::default()).map_err(exception)?;
            let file = LensReadOptions::default().coated(file).map_err(exception)?;
            Ok(Self::new(file, None))
        })
    }

    /// Returns an ideal thin lens, free of aberrations.
    ///
    /// Parameters
    /// ----------
    /// focal_length_mm : float
    /// diameter_mm : float
    ///     Of its rim, which is the stop.
    #[staticmethod]
    fn thin(focal_length_mm: f64, diameter_mm: f64) -> PyResult<Self> {
        guarded(|| Self::of_choice(LensSpec::Thin { focal_length_mm, diameter_mm }, LensReadOptions::default()))
    }

    /// Returns a hole without a lens; a camera with it needs its film's place, ``film_mm``.
    #[staticmethod]
    fn pinhole(diameter_mm: f64) -> PyResult<Self> {
        guarded(|| Self::of_choice(LensSpec::Pinhole { diameter_mm }, LensReadOptions::default()))
    }

    /// Returns an eye that is known by the coefficients of its wavefront: an ideal lens right behind its pupil, and the retina.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     Coefficients of the terms of OSA, µm: ``.csv``; with their statistics ``.json``, or ``.mat`` as of ISETCam.
    /// pupil_mm : float
    ///     Diameter of the pupil that they are of.
    /// number, seed : int
    ///     Which eye is drawn from the statistics; without a number it is the mean.
    #[staticmethod]
    #[pyo3(signature = (path, pupil_mm, *, number=None, seed=0))]
    fn measured_eye(path: PathBuf, pupil_mm: f64, number: Option<u64>, seed: u64) -> PyResult<Self> {
        let drawn = number.map(|number| DrawnEye { number, seed });
        let eye = LensSpec::MeasuredEye { file: path, pupil_mm, drawn };
        guarded(|| Self::of_choice(eye, LensReadOptions::default()))
    }

    /// Returns the lens with wavelengths outside the range in which a glass is known refused ("refuse") or its glasses
    /// continued ("extend"); `notes_at` states how far an index may be off.
    fn with_glass_range(&self, glass_range: &str) -> PyResult<Self> {
        let glass_range = range_of(glass_range)?;
        let lens = self.file.lens.clone().with_glass_range(glass_range);
        let of_range = |(lens, reading): &(LensSpec, LensReadOptions)| {
            (lens.clone(), LensReadOptions { glass_range, ..reading.clone() })
        };
        Ok(Self {
            file: LensFile { lens, ..self.file.clone() },
            choice: self.choice.as_ref().map(of_range),
            stop: self.stop,
            iris: self.iris,
            mono: Mutex::default(),
        })
    }

    /// Returns the lens with this on all surfaces between air and glass: "bare", "mgf2", "vcoat", "bbar", a file, or "ideal" for no loss of
    /// light at all; None for what its file states, else "mgf2".
    #[pyo3(signature = (coating=None))]
    fn with_coating(&self, coating: Option<&str>) -> PyResult<Self> {
        let coating = coating.map(CoatingSpec::named);
        guarded(|| {
            let Some((lens, reading)) = &self.choice else {
                let reading = LensReadOptions { coating, ..LensReadOptions::default() };
                let file = reading.coated(self.file.clone()).map_err(exception)?;
                return Ok(Self { stop: self.stop, iris: self.iris, ..Self::new(file, None) });
            };
            let lens = Self::of_choice(lens.clone(), LensReadOptions { coating, ..reading.clone() })?;
            let lens = if self.iris.is_some() { lens.bladed(self.iris)? } else { lens };
            lens.stopped(self.stop)
        })
    }

    /// Returns notes on the lens at these wavelengths, a list of sentences: `notes`, and which glasses are
    /// continued beyond the range in which they are known.
    fn notes_at(&self, wavelengths_nm: Vec<f64>) -> Vec<String> {
        let of_glasses = self.file.lens.notes_on_ranges(&wavelengths_nm);
        self.file.notes.iter().cloned().chain(of_glasses).collect()
    }

    /// Returns the lens with its stop set: to an f-number (for a far object at 550 nm) or to a diameter in mm.
    #[pyo3(signature = (*, f_number=None, diameter_mm=None))]
    fn with_stop(&self, f_number: Option<f64>, diameter_mm: Option<f64>) -> PyResult<Self> {
        let stop = match (f_number, diameter_mm) {
            (Some(n), None) => StopSpec::FNumber(n),
            (None, Some(mm)) => StopSpec::DiameterMm(mm),
            (None, None) => return Err(wrong("the stop", "not given", "f_number or diameter_mm")),
            _ => return Err(wrong("the stop", "given twice", "f_number or diameter_mm")),
        };
        guarded(|| self.stopped(stop))
    }

    /// Returns the lens with its stop closed by blades, 3 to 64, or by none: round only where it is fully open.
    ///
    /// `rotation_deg` turns the opening from one with a corner at its top; `curvature` is that of the blades' edges, 0 for straight ones to
    /// 1 for the rim's.
    #[pyo3(signature = (blades, *, rotation_deg=0.0, curvature=0.0))]
    fn with_iris(&self, blades: Option<u32>, rotation_deg: f64, curvature: f64) -> PyResult<Self> {
        guarded(|| self.bladed(blades.map(|blades| Iris { blades, rotation_deg, curvature })))
    }

    /// What the lens is called.
    #[getter]
    fn name(&self) -> &str {
        self.file.lens.name()
    }

    /// Where its prescription comes from.
    #[getter]
    fn source(&self) -> &str {
        self.file.lens.source()
    }

    /// What its file says and dioptric does otherwise or not at all, a sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.file.notes.clone()
    }

    /// What the lens's file calls its configurations, as the positions of a zoom lens, "" where it does not; empty of a file with one.
    #[getter]
    fn configurations(&self) -> Vec<&str> {
        self.file.configuration_names()
    }

    /// Which of them is in use, counted from 1.
    #[getter]
    fn configuration(&self) -> usize {
        self.file.configuration
    }

    /// The number of surfaces, the stop included.
    #[getter]
    fn n_surfaces(&self) -> usize {
        self.file.lens.interfaces().len()
    }

    /// Whether it is centered and rotationally symmetric.
    #[getter]
    fn is_rotational(&self) -> bool {
        self.file.lens.is_rotational()
    }

    /// Effective focal length, mm, at 550 nm, or at the main wavelength of a lens not known there.
    #[getter]
    fn efl_mm(&self) -> PyResult<f64> {
        guarded(|| Ok(self.mono(self.wavelength_or_usual(None))?.first_order().efl_mm))
    }

    /// f-number for a far object, at the wavelength of `efl_mm`.
    #[getter]
    fn f_number(&self) -> PyResult<f64> {
        guarded(|| Ok(self.mono(self.wavelength_or_usual(None))?.first_order().f_number))
    }

    /// f-number of a lens without losses that has as much light for a far object, at the wavelength of `efl_mm`; None where no light gets through.
    #[getter]
    fn t_number(&self) -> PyResult<Option<f64>> {
        guarded(|| Ok(self.mono(self.wavelength_or_usual(None))?.t_number(f64::INFINITY)))
    }

    /// Returns first-order data and third-order sums: focal lengths, principal planes, pupils, f-number, Seidel sums.
    ///
    /// Parameters
    /// ----------
    /// wavelengths_nm : float or list of float, optional
    ///     The lens's main wavelength, else 550.
    /// distance_mm : float, optional
    ///     Of an object before the first vertex, of which ``image_distance_mm``, ``magnification`` and ``working_f_number``
    ///     are in the result too.
    /// field_deg : float
    ///     Half field of the third-order sums.
    /// blur_um : float, optional
    ///     The diameter of the blur that is taken to be sharp: adds ``hyperfocal_mm``, and with ``distance_mm`` in focus
    ///     ``sharp_from_mm`` and ``sharp_to_mm``.
    ///
    /// Returns
    /// -------
    /// dict, or a list of them for a list of wavelengths, with the keys of ``dioptric lens info --json``.
    #[pyo3(signature = (wavelengths_nm=None, *, distance_mm=None, field_deg=10.0, blur_um=None))]
    fn info<'py>(
        &self,
        py: Python<'py>,
        wavelengths_nm: Option<&Bound<'py, PyAny>>,
        distance_mm: Option<f64>,
        field_deg: f64,
        blur_um: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let list = wavelengths_nm.map(|list| numbers("wavelengths_nm", list)).transpose()?;
        let list = list.unwrap_or_else(|| vec![self.wavelength_or_usual(None)]);
        guarded(|| {
            let (first, last) = list.iter().fold((f64::INFINITY, 0.0), |(a, b), nm| (nm.min(a), nm.max(b)));
            let colors_nm = (first < last).then_some([first, last]);
            let data = |&wavelength_nm: &f64| {
                let request = LensInfoRequest { wavelength_nm, distance_mm, field_deg, colors_nm, blur_um };
                LensData::new(&self.file.lens, &request)
            };
            let rows: Vec<LensData> = list.iter().map(data).collect::<Result<_, _>>().map_err(exception)?;
            match wavelengths_nm.is_none_or(is_single) {
                true => to_python(py, &rows[0]),
                false => to_python(py, &rows),
            }
        })
    }

    /// Returns the surfaces as a list of dictionaries, copies that may be changed and given to `from_surfaces`; the keys are those of its
    /// rows.
    fn surfaces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        guarded(|| rows_of(py, &self.file))
    }

    /// Returns the lens with entries of a surface changed, as ``lens.with_surface(2, radius_mm=40, medium="N-SF6")``.
    ///
    /// Parameters
    /// ----------
    /// surface : int
    ///     Its number from 0.
    /// radius_mm, thickness_mm, semi_aperture_mm, medium, stop, conic, coefficients, shape, mirror, comment
    ///     As of `from_surfaces`. Rims and all else stay as they are.
    #[pyo3(signature = (surface, **changes), text_signature = "($self, surface, *, radius_mm=None, thickness_mm=None, \
semi_aperture_mm=None, medium=None, stop=None, conic=None, coefficients=None, shape=None, mirror=None, coating=None, comment=None)")]
    fn with_surface(&self, py: Python<'_>, surface: usize, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let none = PyDict::new(py);
        let changes = changes.unwrap_or(&none);
        guarded(|| Ok(Self::new(with_surface(&self.file, surface, changes)?, None)))
    }

    /// Returns a lens of surfaces in the order in which light meets them.
    ///
    /// Parameters
    /// ----------
    /// surfaces : list of dict, or dict of lists
    ///     A row a surface, or a column an entry: ``radius_mm`` (``inf`` or left out for a plane; positive where the center lies behind),
    ///     ``thickness_mm`` to the next vertex (0 of the last), ``semi_aperture_mm``, ``medium`` behind it (``None`` for air; the name of
    ///     a glass, ``"N-BK7"``; an index; index and Abbe number, ``(1.5168, 64.17)``), ``stop``, ``conic``, ``coefficients`` of r⁴,
    ///     r⁶, … in mm, ``mirror``, ``comment``; ``shape`` for any other shape, in the words of the lens file.
    /// name : str
    /// stop : int, optional
    ///     The surface that is the stop, from 0, in place of an entry ``stop``.
    /// film_mm : float, optional
    ///     Where the film stands behind the last vertex.
    #[staticmethod]
    #[pyo3(signature = (surfaces, *, name="lens", stop=None, film_mm=None))]
    fn from_surfaces(
        surfaces: &Bound<'_, PyAny>,
        name: &str,
        stop: Option<usize>,
        film_mm: Option<f64>,
    ) -> PyResult<Self> {
        guarded(|| Ok(Self::new(lens_of(surfaces, (name, stop, film_mm))?, None)))
    }

    /// Returns the lens as a dictionary with the keys of our own lens file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.file)
    }

    /// Returns the lens of a dictionary as `to_dict` makes it.
    #[staticmethod]
    fn from_dict(data: &Bound<'_, PyDict>) -> PyResult<Self> {
        guarded(|| {
            let file = from_python("the lens", data.as_any())?;
            Ok(Self::new(LensReadOptions::default().coated(file).map_err(exception)?, None))
        })
    }

    /// Traces rays through all surfaces.
    ///
    /// Parameters
    /// ----------
    /// origins : array_like, (n, 3), (3,) or (..., 3)
    ///     Points before the lens, mm in the lens frame.
    /// directions : array_like, (n, 3), (3,) or (..., 3)
    ///     Directions; those not of unit length are made so.
    /// wavelength_nm : float or array_like
    ///     Of all rays, or one each. Axes before the last of points and directions, and those of the wavelengths, go together as NumPy
    ///     broadcasts: a point of shape (3,) with directions (n, 3) is a fan.
    /// film_mm : float, optional
    ///     Follows the rays on to a film this far behind the last vertex; else they end on the last surface.
    /// clip : bool
    ///     Whether rims and the stop end rays.
    ///
    /// Returns
    /// -------
    /// Rays
    #[pyo3(signature = (origins, directions, wavelength_nm=None, *, film_mm=None, clip=true),
        text_signature = "($self, origins, directions, wavelength_nm=550.0, *, film_mm=None, clip=True)")]
    fn trace(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        wavelength_nm: Option<&Bound<'_, PyAny>>,
        film_mm: Option<f64>,
        clip: bool,
    ) -> PyResult<Rays> {
        let given = GivenRays::read(origins, directions, wavelength_nm, REFERENCE_WAVELENGTH_NM)?;
        if let Some(film_mm) = film_mm.filter(|mm| !mm.is_finite()) {
            return Err(wrong("film_mm", film_mm, "a finite number"));
        }
        let rims = if clip { Vignetting::On } else { Vignetting::Off };
        trace(py, &given, &Traced { lens: &self.file.lens, film_mm, rims }, |nm| self.mono(nm))
    }

    /// Returns point spread functions, upright as the picture shows them: the energy on each pixel about the centroid.
    ///
    /// Parameters
    /// ----------
    /// field_deg : float or list of float
    ///     Angles at the entrance pupil, to the right of the picture. Default 0.
    /// field_y_deg : float or list of float
    ///     How far above the axis they lie, one number or one each. Default 0.
    /// film_xy_mm : (float, float) or list of them
    ///     In place of angles the places on the film that the chief rays of the points go to, mm to the right of the axis and above it, as
    ///     the picture shows them.
    /// distance_mm : float or list of float
    ///     Of the points before the first vertex; ``inf`` for a star. Default: that of the lens's file, else ``inf``.
    /// wavelengths_nm : float or list of float
    ///     Default 550.
    /// focus_mm, film_mm : float
    ///     The film: in focus for an object at this distance, or this far behind the last vertex. Default: where the lens's file has it,
    ///     else in focus for the first of ``distance_mm``. Of a lens that sends light off in parallel it is behind an ideal lens of
    ///     1000 mm: 1 µm is then 1 µrad.
    /// pixel_um : float
    ///     Side of a pixel. Default 1.
    /// shape : int
    ///     Pixels along a side. Default 65; the centroid is the middle of the middle pixel of an odd number.
    /// diffraction : {"hurb", "none", "hurb-scene3d", "hurb-calibrated", "wave"}
    /// gamma : float
    ///     Strength of HURB.
    /// psfs : path
    ///     A file of point spread functions (``.npz``) in place of those of the lens.
    /// rays : int
    ///     Counts this many rays along the side of a grid over the front rim, as the paper does, in place of exact energies.
    /// seed : int
    ///     Of the diffraction of counted rays.
    ///
    /// Returns
    /// -------
    /// Psf, an array of float32, (fields, distances, wavelengths, shape, shape); an axis whose argument is a single number is left out.
    /// Each picture has a sum of 1, less what lies beyond its pixels. Its ``energy``, of the axes before the last two, is the light of
    /// each point over that of one on the axis: ``psf * psf.energy[..., None, None]`` has fields as bright as the lens shows them. ``x_mm``
    /// and ``y_mm`` are the centroids in the picture, from the axis.
    #[pyo3(signature = (**options), text_signature = "($self, *, field_deg=None, field_y_deg=None, film_xy_mm=None, distance_mm=None, wavelengths_nm=None, focus_mm=None, film_mm=None, \
pixel_um=None, shape=None, diffraction=None, gamma=None, psfs=None, rays=None, exact_grid=None, seed=None)")]
    fn psf<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        PsfOptions::read("psf", options, &self.used())?.pictures(py, &self.file.lens)
    }

    /// Returns what is measured of point spread functions, a dictionary each: centroid, widths, encircled energy, energy and, where
    /// ``mtf_per_mm`` lists spatial frequencies, the MTF. Arguments as of `psf`; fields outermost, then distances, then wavelengths.
    #[pyo3(signature = (**options), text_signature = "($self, *, field_deg=None, field_y_deg=None, film_xy_mm=None, distance_mm=None, wavelengths_nm=None, focus_mm=None, film_mm=None, \
pixel_um=None, shape=None, diffraction=None, gamma=None, psfs=None, rays=None, exact_grid=None, seed=None, \
mtf_per_mm=None)")]
    fn psf_table<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let set = PsfOptions::read("psf_table", options, &self.used())?.compute(py, &self.file.lens)?;
        to_python(py, &set.rows)
    }

    /// Analyzes the lens by real rays: foci, spots, fans, distortion, astigmatism, color, wavefront over the field.
    ///
    /// Parameters
    /// ----------
    /// fields_deg : list of float, optional
    ///     Angles above the axis; else those of the lens's file, else 0, 0.5, 0.7 and 1 of where the light falls to a quarter.
    /// wavelengths_nm : list of float, optional
    ///     Those of the lens's file, else 450, 550, 650.
    /// distance_mm : float, optional
    ///     Of the object; that of the lens's file, else ``inf``.
    /// film_mm, focus_mm : float, optional
    ///     The film's place behind the last vertex, or the distance in paraxial focus; else where the axial spot is smallest.
    /// rings : int
    ///     Of rays in a spot. Default 6.
    ///
    /// Returns
    /// -------
    /// dict, with the keys of ``dioptric lens analyze --json``.
    #[pyo3(signature = (**options), text_signature = "($self, *, fields_deg=None, wavelengths_nm=None, distance_mm=None, film_mm=None, \
focus_mm=None, rings=None)")]
    fn analyze<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let request = analysis_request(&self.used(), options)?;
        let lens = self.file.lens.clone();
        let analysis = run_apart(py, move |cancel| request.compute_until(&lens, cancel))?;
        to_python(py, &analysis)
    }

    /// Draws the lens with rays, to scale.
    ///
    /// Parameters
    /// ----------
    /// fields_deg : float or list of float
    ///     A fan of rays each. Default: 0 and 0.7 of where the light falls to half.
    /// distance_mm : float
    ///     Of the object, ``inf`` for a far one.
    /// wavelengths_nm : float or list of float, optional
    ///     Of the rays; focus is that of the first.
    /// film_mm : float, optional
    ///     The film's place behind the last vertex; else that of the lens's file for its own object, else where the object is in focus.
    ///
    /// Returns
    /// -------
    /// str, an SVG document.
    #[pyo3(signature = (*, fields_deg=None, distance_mm=f64::INFINITY, wavelengths_nm=None, film_mm=None))]
    fn draw(
        &self,
        fields_deg: Option<&Bound<'_, PyAny>>,
        distance_mm: f64,
        wavelengths_nm: Option<&Bound<'_, PyAny>>,
        film_mm: Option<f64>,
    ) -> PyResult<String> {
        let fields_deg = fields_deg.map(|list| numbers("fields_deg", list)).transpose()?;
        let wavelengths_nm = wavelengths_nm.map(|list| numbers("wavelengths_nm", list)).transpose()?;
        let wavelengths_nm = wavelengths_nm.unwrap_or_else(|| vec![self.wavelength_or_usual(None)]);
        guarded(|| {
            let lens = &self.file.lens;
            let reference = lens.at(wavelengths_nm[0]).map_err(exception)?;
            let film_mm = film_mm.map_or_else(|| reference.film_distance_mm_for(distance_mm), Ok).map_err(exception)?;
            let fields_deg = fields_deg.unwrap_or_else(|| {
                let widest = dioptric_optics::analysis::field_limit_deg(&reference, 0.5);
                widest.map_or_else(|| vec![0.0], |angle| vec![0.0, 0.7 * angle])
            });
            if let Some(field) = fields_deg.iter().find(|field| !Layout::WIDEST_FIELDS_DEG.contains(*field)) {
                return Err(wrong("fields_deg", field, "angles of up to 120 degrees"));
            }
            let layout = Layout {
                film_distance_mm: film_mm,
                object_distance_mm: distance_mm,
                film_label: "film".to_owned(),
                fields_deg,
                wavelengths_nm,
                n_rays: DRAWN_RAYS,
                width_px: 800.0,
            };
            lens.draw(&layout).map_err(exception)
        })
    }

    /// Returns the distance of the film behind the last vertex, mm, at which an object is in paraxial focus.
    #[pyo3(signature = (distance_mm, wavelength_nm=None))]
    fn film_mm_for(&self, distance_mm: f64, wavelength_nm: Option<f64>) -> PyResult<f64> {
        guarded(|| {
            self.mono(self.wavelength_or_usual(wavelength_nm))?.film_distance_mm_for(distance_mm).map_err(exception)
        })
    }

    /// Returns the lens as the text of our own lens file.
    fn to_ron(&self) -> String {
        self.file.to_ron()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.file.lens == other.file.lens
    }

    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("<Lens {}: f = {:.2} mm, f/{:.2}>", self.name(), self.efl_mm()?, self.f_number()?))
    }

    fn _repr_html_(&self) -> PyResult<String> {
        self.draw(None, f64::INFINITY, None, None)
    }

    /// Copies by the text of the lens file and the name or path that a camera file has for it, so that lenses can be sent to other
    /// processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let choice = self.choice.as_ref().map(|(lens, reading)| (lens, reading, self.stop, self.iris));
        let lens = &self.file.lens;
        let open = lens.with_stop_diameter_mm(2.0 * lens.full_stop_semi_aperture_mm()).map_err(exception)?;
        let stop_mm = 2.0 * lens.stop_semi_aperture_mm();
        let arguments = [
            LensFile { lens: open, ..self.file.clone() }.to_ron().into_bound_py_any(py)?,
            stop_mm.into_bound_py_any(py)?,
            to_python(py, &lens.glass_range())?,
            to_python(py, &lens.other_coating())?,
            self.file.notes.clone().into_bound_py_any(py)?,
            to_python(py, &choice)?,
        ];
        Ok((restorer(py, "_restore_lens")?, PyTuple::new(py, arguments)?))
    }

    fn __copy__(own: Py<Self>) -> Py<Self> {
        own
    }

    fn __deepcopy__(own: Py<Self>, memo: &Bound<'_, PyAny>) -> Py<Self> {
        let _ = memo;
        own
    }
}
