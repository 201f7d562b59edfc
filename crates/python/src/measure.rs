//! What a laboratory measures, of pictures, frames and arrays; `dioptric.measure` has the functions by name.

use std::{path::PathBuf, sync::Arc};

use dioptric_analysis::measure::{
    BenchRequest, ChartRequest, CodeCurve, CompareRequest, EdgeBatchRequest, EdgeMapRequest, EdgeRequest, FrameSeries,
    GridMeasurement, MeasuredPicture, PictureViewing, PixelRegion, PointRequest, RegionRequest, SeenPicture,
    ShadingMeasurement, StarRequest, Step, StepsRequest, TextureNoiseRequest, TextureRequest, measure_bench,
    measure_frames, measure_series, notes_on_picture,
};
use dioptric_pipeline::{PipelineError, SensorSpec, open_display};
use dioptric_scene::PictureSamples;
use dioptric_sensor::{Binning, Picture, Raw, ToneCurve};
use dioptric_spectrum::{Bands, Quantity, SpectralImage};
use ndarray::{Array2, Axis};
use pyo3::{prelude::*, types::PyDict};
use serde::Serialize;

use crate::{
    developed::Developed,
    errors::{exception, wrong, wrong_type},
    input::{number, owned_f32, type_name},
    options::{count, light, seed, word},
    sensor::Sensor,
    serial::to_python,
    shot::Shot,
    worker::run_apart,
};

/// The distance of a display where none is given, m.
const DISPLAY_DISTANCE_M: f64 = 0.6;
/// Pixels a degree of the viewer's field where none are given.
const PIXELS_PER_DEGREE: f64 = 60.0;

/// What is measured, before it is opened.
enum Subject {
    /// A file.
    File(PathBuf),
    /// Linear light that is here.
    Light(Box<MeasuredPicture>),
    /// A spectral image of a shot.
    Bands(Arc<SpectralImage>),
}

/// Options of a measurement by name.
struct Options<'a, 'py>(&'a Bound<'py, PyDict>);

impl<'py> Options<'_, 'py> {
    fn get<T>(&self, key: &str, read: impl Fn(&str, &Bound<'py, PyAny>) -> PyResult<T>) -> PyResult<Option<T>> {
        self.0.get_item(key)?.filter(|value| !value.is_none()).map(|value| read(key, &value)).transpose()
    }

    fn flag(&self, key: &str) -> PyResult<bool> {
        Ok(self.get(key, |_, value| value.is_truthy())?.unwrap_or(false))
    }

    fn curve(&self) -> PyResult<CodeCurve> {
        let curve = self.get("curve", |key, value| match word(key, value)?.as_str() {
            "by-file" => Ok(CodeCurve::ByFile),
            "linear" => Ok(CodeCurve::Linear),
            "srgb" => Ok(CodeCurve::Srgb),
            other => Err(wrong(key, format!("'{other}'"), "'by-file', 'linear' or 'srgb'")),
        })?;
        Ok(curve.unwrap_or_default())
    }

    fn subject(&self, key: &str, value: &Bound<'py, PyAny>) -> PyResult<Subject> {
        let of = self.get("of", word)?;
        subject_of((key, value), of.as_deref(), self.curve()?)
    }
}

/// Measures `subject` with a method of the name `kind`; `dioptric.measure` calls it.
#[pyfunction]
pub(crate) fn _measure<'py>(
    py: Python<'py>,
    kind: &str,
    subject: &Bound<'py, PyAny>,
    options: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = Options(options);
    let curve = options.curve()?;
    match kind {
        "noise" => return noise(py, subject),
        "bench" => return bench(py, subject, &options),
        _ => {}
    }
    if kind == "mtf_of_pictures" {
        let pictures: Vec<PathBuf> = subject.extract()?;
        let request = EdgeBatchRequest { edge: edge_request(&options)?, curve };
        let batch = run_apart(py, move |_| request.measure(&EdgeBatchRequest::pictures_of(&pictures)?))?;
        warn(py, &batch.notes)?;
        return to_python(py, &batch);
    }
    let picture = options.subject("picture", subject)?;
    if let Subject::File(path) = &picture {
        warn(py, &notes_on_picture(path, curve))?;
    }
    match kind {
        "mtf" => {
            let request = edge_request(&options)?;
            match options.flag("every")? {
                true => measured(py, move || EdgeMapRequest { edge: request }.measure(&picture.open(curve)?)),
                false => measured(py, move || request.measure(&picture.open(curve)?)),
            }
        }
        "texture" => {
            let reference = options.get("reference", |key, value| options.subject(key, value))?;
            let reference = reference.ok_or_else(|| wrong("reference", "missing", "a picture by an ideal camera"))?;
            let second = options.get("second_frame", |key, value| options.subject(key, value))?;
            let flat = options.get("flat", region)?;
            let (own, pixels_per_degree) = (options.get("region", region)?, options.get("pixels_per_degree", number)?);
            measured(py, move || {
                let noise = match (flat, second) {
                    (Some(patch), _) => TextureNoiseRequest::Flat(patch),
                    (None, Some(second)) => TextureNoiseRequest::SecondFrame(second.open(curve)?),
                    (None, None) => TextureNoiseRequest::None,
                };
                let request = TextureRequest { region: own, noise, pixels_per_degree };
                request.measure(&picture.open(curve)?, &reference.open(curve)?)
            })
        }
        "spot" => {
            let request = PointRequest {
                window: options.get("window", count)?,
                pixel_um: options.get("pixel_um", number)?.unwrap_or(1.0),
                background: options.get("background", number)?,
            };
            measured(py, move || request.measure(&picture.open(curve)?))
        }
        "star" => {
            let request = StarRequest {
                region: options.get("region", region)?,
                n_cycles: options.get("cycles", count)?,
                is_binary: options.flag("binary")?,
                modulation: options.get("modulation", number)?,
            };
            measured(py, move || request.measure(&picture.open(curve)?))
        }
        "grid" => measured(py, move || GridMeasurement::of(&picture.open(curve)?)),
        "shading" => measured(py, move || ShadingMeasurement::of(&picture.open(curve)?)),
        "steps" => {
            let steps = options.get("steps", steps)?.ok_or_else(|| wrong("steps", "missing", "a list of steps"))?;
            measured(py, move || StepsRequest { steps }.measure(&picture.open(curve)?))
        }
        "region" => {
            let request =
                RegionRequest { region: options.get("region", region)?, reference: options.get("reference", region)? };
            measured(py, move || match picture {
                // What is said of the file was told above.
                Subject::File(path) => Ok(request.measure_file(&path, curve)?.told_in(&mut vec![])),
                Subject::Light(picture) => request.measure(&picture),
                Subject::Bands(image) => request.measure_bands("the shot", &image),
            })
        }
        "color" => {
            let request =
                ChartRequest { corners: options.get("corners", corners)?, light: options.get("illuminant", light)? };
            measured(py, move || request.measure(&picture.open(curve)?))
        }
        "compare" => {
            let against = options.get("against", |key, value| options.subject(key, value))?;
            let against = against.ok_or_else(|| wrong("against", "missing", "another picture"))?;
            let viewing = viewing(py, &options)?;
            let request = CompareRequest { viewing, patch: options.get("patch", region)? };
            measured(py, move || {
                let seen = |subject: Subject| match subject {
                    Subject::File(path) => request.viewing.open(&path, curve),
                    other => Ok(SeenPicture::of_light(other.open(curve)?)),
                };
                request.compare(&seen(picture)?, &seen(against)?)
            })
        }
        other => Err(wrong("kind", format!("'{other}'"), "a measurement of dioptric.measure")),
    }
}

/// Measures apart from the interpreter; the numbers are those of the program's JSON.
fn measured<'py, M: Serialize + Send + 'static>(
    py: Python<'py>,
    work: impl FnOnce() -> Result<M, PipelineError> + Send + 'static,
) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &run_apart(py, |_| work())?)
}

/// Warns of what is to be said, a sentence each.
pub(crate) fn warn(py: Python<'_>, notes: &[String]) -> PyResult<()> {
    for note in notes {
        py.import("warnings")?.call_method1("warn", (note,))?;
    }
    Ok(())
}

impl Subject {
    fn open(self, curve: CodeCurve) -> Result<MeasuredPicture, PipelineError> {
        match self {
            Self::File(path) => MeasuredPicture::open(&path, curve),
            Self::Light(picture) => Ok(*picture),
            Self::Bands(_) => {
                let reason = "is spectral, of which measure.region alone takes bands".to_owned();
                Err(PipelineError::Unsuitable { what: "the irradiance", reason })
            }
        }
    }
}

/// Returns what is measured of an object: its picture, or what `of` says; an array by its type, as files are.
fn subject_of((key, value): (&str, &Bound<'_, PyAny>), of: Option<&str>, curve: CodeCurve) -> PyResult<Subject> {
    let wrong_part = |part: &str, known: &str| wrong("of", format!("'{part}'"), known);
    if let Ok(shot) = value.cast::<Shot>() {
        let capture = shot.get().capture();
        return match of.unwrap_or("picture") {
            "picture" => of_picture(&capture.developed.picture, capture.processing.curve, curve),
            "raw" => Ok(of_raw(&capture.frames.exposed.raw)),
            "irradiance" => Ok(Subject::Bands(Arc::new(irradiance_of(shot)?))),
            other => Err(wrong_part(other, "'picture', 'raw' or 'irradiance'")),
        };
    }
    if let Ok(developed) = value.cast::<Developed>() {
        let developed = developed.get();
        return match of.unwrap_or("picture") {
            "picture" => {
                let (picture, tone) = developed.developed_picture();
                of_picture(picture, tone, curve)
            }
            "raw" => Ok(of_raw(developed.raw_frame())),
            other => Err(wrong_part(other, "'picture' or 'raw'")),
        };
    }
    if let Some(part) = of {
        return Err(wrong_part(part, "it for shots and developed frames alone"));
    }
    if value.is_instance_of::<pyo3::types::PyString>() || value.hasattr("__fspath__")? {
        return Ok(Subject::File(value.extract()?));
    }
    let samples = samples_of(key, value)?;
    let picture = MeasuredPicture::of_samples("the array", samples, curve).map_err(exception)?;
    Ok(Subject::Light(Box::new(picture)))
}

fn of_raw(raw: &Raw) -> Subject {
    Subject::Light(Box::new(MeasuredPicture::of_raw("the raw frame".to_owned(), raw)))
}

/// Returns the light of a picture by the tone curve that it was made with, or as its codes are asked to be read.
fn of_picture(picture: &Picture, own: ToneCurve, curve: CodeCurve) -> PyResult<Subject> {
    let light = picture.linear_srgb(match curve {
        CodeCurve::ByFile => own,
        CodeCurve::Linear => ToneCurve::Linear,
        CodeCurve::Srgb => ToneCurve::Srgb,
    });
    let plane = |k: usize| light.index_axis(Axis(2), k).to_owned();
    let planes = ["R", "G", "B"].iter().enumerate().map(|(k, name)| ((*name).to_owned(), plane(k))).collect();
    let samples = PictureSamples { planes, top: None, colors: Ok(None) };
    let picture = MeasuredPicture::of_samples("the picture", samples, CodeCurve::Linear).map_err(exception)?;
    Ok(Subject::Light(Box::new(picture)))
}

fn irradiance_of(shot: &Bound<'_, Shot>) -> PyResult<SpectralImage> {
    let irradiance = &shot.get().capture().irradiance;
    let bands = 0..irradiance.grid().len();
    let planes = bands.map(|band| irradiance.band(band).map(|plane| plane.into_owned()).map_err(exception));
    let planes = planes.collect::<PyResult<Vec<_>>>()?;
    SpectralImage::new(Quantity::Irradiance, irradiance.grid().clone(), planes).map_err(exception)
}

/// Returns an array as a file would hold it: codes of 8 or 16 bits, or floats; rows × columns, or with red, green and blue last.
fn samples_of(key: &str, value: &Bound<'_, PyAny>) -> PyResult<PictureSamples> {
    let kind = value.getattr("dtype").map_or_else(|_| String::new(), |dtype| dtype.to_string());
    let top = match kind.as_str() {
        "uint8" => Some(u16::from(u8::MAX)),
        "uint16" => Some(u16::MAX),
        _ if kind.starts_with("int") || kind.starts_with("uint") => {
            let expected = "uint8 or uint16, whose highest code is white, or floats of light";
            return Err(wrong_type(key, format!("an array of {kind}"), expected));
        }
        _ => None,
    };
    let array = owned_f32(key, value, "(rows, columns) or (rows, columns, 3)", &[2, 3])?;
    let planes = match array.shape() {
        &[rows, columns] => vec![("Y".to_owned(), array.into_shape_with_order((rows, columns)).expect("two axes"))],
        &[_, _, 3] => {
            let plane = |k: usize| array.index_axis(Axis(2), k).into_dimensionality().expect("two axes").to_owned();
            ["R", "G", "B"].iter().enumerate().map(|(k, name)| ((*name).to_owned(), plane(k))).collect()
        }
        shape => {
            return Err(wrong(
                key,
                format!("of shape {shape:?}"),
                "an array of shape (rows, columns) or (rows, columns, 3)",
            ));
        }
    };
    Ok(PictureSamples { planes, top, colors: Ok(None) })
}

fn region(key: &str, value: &Bound<'_, PyAny>) -> PyResult<PixelRegion> {
    const EXPECTED: &str = "four whole numbers: the first column and row, columns and rows";
    let (column, row, columns, rows) = value.extract().map_err(|_| wrong_type(key, type_name(value), EXPECTED))?;
    match columns > 0 && rows > 0 {
        true => Ok(PixelRegion { column, row, columns, rows }),
        false => Err(wrong(key, format!("of {columns} × {rows} pixels"), EXPECTED)),
    }
}

fn corners(key: &str, value: &Bound<'_, PyAny>) -> PyResult<dioptric_sensor::ChartCorners> {
    let expected = "four pairs of column and row, clockwise from the corner beside dark skin";
    let corners: [(f64, f64); 4] = value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?;
    Ok(corners.map(|(column, row)| (row, column)))
}

/// Reads steps: a table's path, or a list of pairs of region and luminance.
fn steps(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Step>> {
    if value.is_instance_of::<pyo3::types::PyString>() || value.hasattr("__fspath__")? {
        let path: PathBuf = value.extract()?;
        return StepsRequest::read_steps(&path).map_err(exception);
    }
    let expected = "a list of pairs, (x, y, columns, rows) and the luminance";
    let step = |step: PyResult<Bound<'_, PyAny>>| {
        let (place, luminance): (Bound<'_, PyAny>, f64) =
            step?.extract().map_err(|_| wrong_type(key, type_name(value), expected))?;
        match luminance > 0.0 && luminance.is_finite() {
            true => Ok(Step { region: region(key, &place)?, luminance }),
            false => Err(wrong(key, luminance, "luminances above 0")),
        }
    };
    value.try_iter().map_err(|_| wrong_type(key, type_name(value), expected))?.map(step).collect()
}

fn viewing(py: Python<'_>, options: &Options<'_, '_>) -> PyResult<PictureViewing> {
    let (display, distance_m) = (options.get("display", word)?, options.get("distance_m", number)?);
    match display {
        Some(name) => {
            let (display, notes) = open_display(&name).map_err(exception)?;
            warn(py, &notes)?;
            Ok(PictureViewing::Display {
                display: Box::new(display),
                distance_m: distance_m.unwrap_or(DISPLAY_DISTANCE_M),
            })
        }
        None => {
            Ok(PictureViewing::PixelsPerDegree(options.get("pixels_per_degree", number)?.unwrap_or(PIXELS_PER_DEGREE)))
        }
    }
}

/// Measures frames: a descriptor's path or a folder, or a list of (exposure_s, photons, frames).
fn noise<'py>(py: Python<'py>, frames: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if frames.is_instance_of::<pyo3::types::PyString>() || frames.hasattr("__fspath__")? {
        let path: PathBuf = frames.extract()?;
        return measured(py, move || measure_frames(&path));
    }
    let expected =
        "a list of (exposure_s, photons, frames): photons 0 of dark frames, None where they were not counted";
    let of_series = |series: PyResult<Bound<'py, PyAny>>| -> PyResult<FrameSeries> {
        let (time_s, photons, taken): (Option<f64>, Option<f64>, Bound<'py, PyAny>) =
            series?.extract().map_err(|_| wrong_type("frames", type_name(frames), expected))?;
        for (key, value) in [("exposure_s", time_s), ("photons", photons)] {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
                return Err(wrong(key, value, "a number of 0 or more"));
            }
        }
        let taken = taken.try_iter().map_err(|_| wrong_type("frames", type_name(&taken), expected))?;
        let plane = |frame: PyResult<Bound<'py, PyAny>>| -> PyResult<Array2<f32>> {
            let frame = owned_f32("frames", &frame?, "(rows, columns) each", &[2])?;
            Ok(frame.into_dimensionality().expect("two axes were checked"))
        };
        Ok(FrameSeries { time_s, photons, frames: taken.map(plane).collect::<PyResult<_>>()? })
    };
    let series = frames.try_iter().map_err(|_| wrong_type("frames", type_name(frames), expected))?;
    let series = series.map(of_series).collect::<PyResult<Vec<_>>>()?;
    measured(py, move || measure_series("the frames", series))
}

fn edge_request(options: &Options<'_, '_>) -> PyResult<EdgeRequest> {
    Ok(EdgeRequest {
        region: options.get("region", region)?,
        side: options.get("size", count)?,
        mosaic: options.get("mosaic", word)?,
        pixel_um: options.get("pixel_um", number)?,
        pixels_per_degree: options.get("pixels_per_degree", number)?,
    })
}

/// Puts a sensor on the simulated bench.
fn bench<'py>(py: Python<'py>, sensor: &Bound<'py, PyAny>, options: &Options<'_, 'py>) -> PyResult<Bound<'py, PyAny>> {
    let sensor = match sensor.cast::<Sensor>() {
        Ok(sensor) => sensor.get().sheet().clone(),
        Err(_) => SensorSpec::named(&word("sensor", sensor)?).open().map_err(exception)?,
    };
    let request = BenchRequest {
        sensor,
        filter: options.get("filter", word)?,
        side: options.get("size", count)?,
        n_levels: options.get("levels", count)?,
        n_stacked: options.get("stack", count)?,
        wavelength_nm: options.get("wavelength_nm", number)?,
        time_s: options.get("exposure_s", number)?,
        analog_gain: options.get("analog_gain", number)?,
        binning: match options.get("binning", word)? {
            Some(word) => Binning::parse(&word).map_err(exception)?,
            None => None,
        },
        temperature_c: options.get("temperature_c", number)?,
        seed: options.get("seed", seed)?.unwrap_or(1),
    };
    measured(py, move || measure_bench(&request, None))
}
