//! Raw frames of any camera, from files and arrays, developed.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use dioptric_analysis::DngReport;
use dioptric_pipeline::{
    DevelopedFile, DngBlack, DngReading, DngRendering, PipelineError, ProfileFile, SensorSpec, Staged, picture_png,
    write_json,
};
use dioptric_sensor::{
    ColorCorrection, Developed as DevelopedPicture, DngFile, Exposure, OwnMosaic, Picture, Processing, Raw,
    Sensor as SensorSheet, ToneCurve,
};
use ndarray::{Array2, Array3, Ix2};
use pyo3::{
    prelude::*,
    types::{PyBytes, PyDict, PyString},
};
use serde::Serialize;

use crate::{
    changes::changed_processing,
    errors::{exception, wrong},
    input::{array_f64, number},
    options::{light, word},
    save::{is_picture, write_picture},
    sensor::Sensor,
    serial::to_python,
    view::{plane_or_planes, raw_planes, rgb8, view},
    worker::{Follower, run, run_apart},
};

/// A raw frame and the picture that was made of it.
///
/// Arrays are read-only views of the results; they hold what they need, and outlive the object. Row 0 is the top.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Developed {
    of: Arc<Frame>,
    rgb: OnceLock<Arc<Array3<u8>>>,
}

/// A frame with its picture.
enum Frame {
    /// Of a DNG file, or of an array with what is known of its camera.
    File(Box<DevelopedFile>),
    /// Of an array of a sensor's numbers.
    Sensor(Box<SensorFrame>),
}

/// A frame of a sensor's numbers.
struct SensorFrame {
    sensor: SensorSheet,
    raw: Raw,
    processing: Processing,
    developed: DevelopedPicture,
}

/// What was made of a frame of a sensor's numbers.
#[derive(Serialize)]
struct SensorFrameReport<'a> {
    sensor: &'a str,
    /// Columns and rows.
    shown_px: (usize, usize),
    exposure_time_s: f64,
    analog_gain: f64,
    black: f64,
    white: f64,
    saturated_fraction: f64,
    white_balance: &'a [f64],
    color_matrix: &'a [Vec<f64>; 3],
    brightness: f64,
    processing: &'a Processing,
    notes: [String; 0],
}

impl Frame {
    fn raw(&self) -> &Raw {
        match self {
            Self::File(of) => &of.file.raw,
            Self::Sensor(of) => &of.raw,
        }
    }

    fn developed(&self) -> &DevelopedPicture {
        match self {
            Self::File(of) => &of.developed,
            Self::Sensor(of) => &of.developed,
        }
    }

    fn processing(&self) -> &Processing {
        match self {
            Self::File(of) => &of.processing,
            Self::Sensor(of) => &of.processing,
        }
    }

    fn write_report(&self, path: &Path) -> Result<(), PipelineError> {
        match self {
            Self::File(of) => write_json(path, &DngReport::new(of)),
            Self::Sensor(of) => write_json(path, &of.report()),
        }
    }
}

impl SensorFrame {
    fn report(&self) -> SensorFrameReport<'_> {
        let (rows, columns) = self.raw.size();
        SensorFrameReport {
            sensor: &self.sensor.name,
            shown_px: (columns, rows),
            exposure_time_s: self.raw.exposure.time_s,
            analog_gain: self.raw.exposure.analog_gain,
            black: self.raw.levels.black,
            white: self.raw.levels.white,
            saturated_fraction: self.raw.saturated_fraction(),
            white_balance: &self.developed.balance,
            color_matrix: &self.developed.color.rows,
            brightness: self.developed.brightness,
            processing: &self.processing,
            notes: [],
        }
    }
}

impl Developed {
    fn new(frame: Frame) -> Self {
        Self { of: Arc::new(frame), rgb: OnceLock::new() }
    }

    /// The raw frame.
    pub(crate) fn raw_frame(&self) -> &Raw {
        self.of.raw()
    }

    /// The picture, and the tone curve that it was made with.
    pub(crate) fn developed_picture(&self) -> (&Picture, ToneCurve) {
        (&self.of.developed().picture, self.of.processing().curve)
    }

    fn save_into(&self, folder: &Path) -> Result<Vec<String>, PipelineError> {
        let staged = Staged::folder(folder)?;
        dioptric_files::write(&staged.path().join("picture.png"), &picture_png(&self.of.developed().picture)?)?;
        self.of.write_report(&staged.path().join("report.json"))?;
        staged.commit()?;
        Ok(vec!["picture.png".to_owned(), "report.json".to_owned()])
    }
}

/// Develops a raw frame: of a raw file (DNG) of any camera, as ``dioptric develop`` does, or of an array.
///
/// Parameters
/// ----------
/// source : str, path or array_like (rows, columns)
///     A DNG file, or digital numbers, whole numbers of 0 to 65535.
/// cfa : str, optional
///     Of an array the mosaic, a letter a filter from the top left pixel on: ``"RGGB"``, ``"RG/GB"``, ``"W"`` for a single filter.
/// black : float or str, optional
///     With ``cfa`` the digital number of no light (0). Of a file ``"stated"`` (its black level, the default) or ``"masked"``, the mean of
///     its masked pixels, which have dark current too.
/// saturation : float, optional
///     With ``cfa`` the digital number at which a pixel is saturated (65535).
/// color_matrix : array_like, (filters, 3), optional
///     With ``cfa`` the signal of X, Y and Z of each filter, as ``ColorMatrix`` of a DNG file for D65. Without it colors are those of
///     the filters, which a note says.
/// sensor : Sensor, name or path, optional
///     In place of ``cfa`` and levels the sensor whose numbers they are, its tile from the top left pixel on.
/// exposure_s, analog_gain : float, optional
///     With ``sensor`` how the frame was exposed (1 s, 1).
/// illuminant : str, optional
///     With ``sensor`` the light on the scene, as ``"D65"``; without it white is the mean of the frame.
/// rendering : str, optional
///     How far the profile of a file makes its picture: ``"matrices"``, ``"colors"`` (also its map of hues and saturations; the default)
///     or ``"look"`` (also its exposure, look table and tone curve).
/// profile : path, optional
///     Of a file the camera profile in place of its own: a DCP file, or a DNG file whose profile is taken.
/// white, demosaic, denoise, highlights, color, sharpen_px, local_tone, perspective, brightness, curve, space, defect_threshold
///     As of `Camera.with_`. ``lens_corrections`` need a simulated lens and are refused.
///
/// Returns
/// -------
/// Developed
///
/// Raises
/// ------
/// OSError
///     The file cannot be read, or is no DNG file that is known.
/// ValueError
///     The processing asks for what the frame does not hold.
#[pyfunction]
#[pyo3(signature = (source, *, cfa=None, black=None, saturation=None, color_matrix=None, sensor=None, exposure_s=None,
    analog_gain=None, illuminant=None, rendering=None, profile=None, **options), text_signature = "(source, *, cfa=None, black=None, saturation=None, \
color_matrix=None, sensor=None, exposure_s=None, analog_gain=None, illuminant=None, rendering=None, profile=None, white=None, demosaic=None, denoise=None, \
highlights=None, lens_corrections=None, color=None, sharpen_px=None, local_tone=None, perspective=None, brightness=None, curve=None, \
space=None, defect_threshold=None)")]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub(crate) fn develop(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    cfa: Option<&str>,
    black: Option<&Bound<'_, PyAny>>,
    saturation: Option<f64>,
    color_matrix: Option<&Bound<'_, PyAny>>,
    sensor: Option<&Bound<'_, PyAny>>,
    exposure_s: Option<f64>,
    analog_gain: Option<f64>,
    illuminant: Option<&Bound<'_, PyAny>>,
    rendering: Option<&str>,
    profile: Option<PathBuf>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Developed> {
    let processing = changed_processing("develop", options)?;
    let is_file = source.is_instance_of::<PyString>() || source.hasattr("__fspath__")?;
    let of_mosaic = [
        ("black", !is_file && black.is_some()),
        ("saturation", saturation.is_some()),
        ("color_matrix", color_matrix.is_some()),
    ];
    let of_sensor = [
        ("exposure_s", exposure_s.is_some()),
        ("analog_gain", analog_gain.is_some()),
        ("illuminant", illuminant.is_some()),
    ];
    let given = |list: &[(&'static str, bool)]| list.iter().find(|(_, is_given)| *is_given).map(|(key, _)| *key);
    let beside = |key: Option<&str>, expected: &str| match key {
        Some(key) => Err(wrong(key, "given", expected)),
        None => Ok(()),
    };
    if is_file {
        let with = [("cfa", cfa.is_some()), ("sensor", sensor.is_some())];
        beside(given(&with).or(given(&of_mosaic)).or(given(&of_sensor)), "it for arrays alone: a file states its own")?;
        let path: PathBuf = source.extract()?;
        let reading = DngReading {
            rendering: rendering.map_or(Ok(DngRendering::default()), rendering_of)?,
            black: match black {
                Some(black) => DngBlack::parse(&word("black", black)?).map_err(exception)?,
                None => DngBlack::default(),
            },
            profile: profile.as_deref().map(ProfileFile::read).transpose().map_err(exception)?,
            ..DngReading::default()
        };
        let of = run_apart(py, move |_| DevelopedFile::read_with(&path, processing, &reading))?;
        return Ok(Developed::new(Frame::File(Box::new(of))));
    }
    let of_file = [("rendering", rendering.is_some()), ("profile", profile.is_some())];
    beside(given(&of_file), "it for files, which have profiles")?;
    let black = black.map(|black| number("black", black)).transpose()?;
    match (cfa, sensor) {
        (Some(_), Some(_)) => Err(wrong("sensor", "given beside cfa", "either of them")),
        (None, None) => Err(wrong("cfa", "missing", "the mosaic of the array, as 'RGGB', or sensor")),
        (Some(cfa), None) => {
            beside(given(&of_sensor), "sensor with it")?;
            let mosaic = OwnMosaic {
                dn: digital_numbers(source)?,
                tile: tile_rows(cfa)?,
                black: black.unwrap_or(0.0),
                white: saturation.unwrap_or(f64::from(u16::MAX)),
                camera_from_xyz: color_matrix.map(matrix_rows).transpose()?,
            };
            let has_color = options.is_some_and(|options| options.contains("color").unwrap_or(false));
            let of = run_apart(py, move |_| of_mosaic_frame(mosaic, processing, has_color))?;
            Ok(Developed::new(Frame::File(Box::new(of))))
        }
        (None, Some(sensor)) => {
            beside(given(&of_mosaic), "cfa with it: the sensor has its own")?;
            let sheet = match sensor.cast::<Sensor>() {
                Ok(sensor) => sensor.get().sheet().clone(),
                Err(_) => SensorSpec::named(&word("sensor", sensor)?).open().map_err(exception)?,
            };
            let exposure =
                Exposure { analog_gain: analog_gain.unwrap_or(1.0), ..Exposure::seconds(exposure_s.unwrap_or(1.0)) };
            let light = illuminant.map(|value| light("illuminant", value)).transpose()?;
            let processing = processing.under(light.as_ref());
            let dn = digital_numbers(source)?;
            let of = run_apart(py, move |_| {
                let raw = sheet.frame_of(dn, &exposure)?;
                let developed = sheet.develop(&raw, &processing)?;
                Ok(SensorFrame { sensor: sheet, raw, processing, developed })
            })?;
            Ok(Developed::new(Frame::Sensor(Box::new(of))))
        }
    }
}

/// Develops an array as the frame of a file; without a matrix colors are those of the filters, unless others are asked for.
fn rendering_of(name: &str) -> PyResult<DngRendering> {
    let known = DngRendering::NAMES;
    let found = known.iter().find(|(word, _)| *word == name).map(|(_, rendering)| *rendering);
    found.ok_or_else(|| wrong("rendering", format!("'{name}'"), &known.map(|(word, _)| word).join(", ")))
}

fn of_mosaic_frame(
    mosaic: OwnMosaic,
    mut processing: Processing,
    has_color: bool,
) -> Result<DevelopedFile, PipelineError> {
    let mut file = DngFile::of_mosaic(mosaic)?;
    let is_plain = file.profile.color.is_none() && file.raw.filter_names.len() > 1;
    if is_plain && !has_color {
        processing.color = ColorCorrection::None;
        file.notes.push("no color matrix was given: colors are those of the filters".to_owned());
    }
    DevelopedFile::of(file, processing)
}

/// Reads whole numbers of 16 bits.
fn digital_numbers(source: &Bound<'_, PyAny>) -> PyResult<Array2<u16>> {
    let array = array_f64("source", source)?;
    let array = array.as_array();
    let shape = array.shape().to_vec();
    let plane = array.into_dimensionality::<Ix2>();
    let plane =
        plane.map_err(|_| wrong("source", format!("of shape {shape:?}"), "an array of shape (rows, columns)"))?;
    let is_dn = |v: f64| v.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&v);
    match plane.indexed_iter().find(|(_, v)| !is_dn(**v)) {
        Some(((row, column), v)) => {
            let found = format!("{v} in row {row}, column {column}");
            Err(wrong("source", found, "digital numbers, whole numbers of 0 to 65535: round and clip them"))
        }
        None => Ok(plane.mapv(|v| v as u16)),
    }
}

/// Reads a tile: rows parted by slashes, or the letters of a square.
fn tile_rows(cfa: &str) -> PyResult<Vec<String>> {
    if cfa.contains('/') {
        return Ok(cfa.split('/').map(str::to_owned).collect());
    }
    let letters: Vec<char> = cfa.chars().collect();
    let side = (1..=16).find(|n| n * n == letters.len()).filter(|_| letters.iter().all(|c| c.is_alphanumeric()));
    match side {
        Some(side) => Ok(letters.chunks(side).map(|row| row.iter().collect()).collect()),
        None => {
            Err(wrong("cfa", format!("'{cfa}'"), "the letters of a square tile, as 'RGGB', or its rows, as 'RG/GB'"))
        }
    }
}

fn matrix_rows(matrix: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    let array = array_f64("color_matrix", matrix)?;
    let array = array.as_array();
    match array.shape() {
        [_, 3] => {
            let flat: Vec<f64> = array.iter().copied().collect();
            Ok(flat.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect())
        }
        shape => Err(wrong("color_matrix", format!("of shape {shape:?}"), "an array of shape (filters, 3)")),
    }
}

#[pymethods]
impl Developed {
    /// Rows and columns of the picture.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let picture = &self.of.developed().picture;
        (picture.rows(), picture.columns())
    }

    /// The raw samples that are shown; (rows, columns) uint16, a tuple of planes where every pixel has several filters.
    #[getter]
    fn raw<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, raw_planes(py, &self.of, |of| of.raw())?)
    }

    /// The picture's codes, 0 to 1; (rows, columns, 3) float32.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.of, |of| of.developed().picture.codes.view())
    }

    /// The picture's 8-bit codes; (rows, columns, 3) uint8, rounded at the first access.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rgb = self.rgb.get_or_init(|| rgb8(&self.of.developed().picture));
        view(py, rgb, |rgb| rgb.view())
    }

    /// What the file asks for and was not done, or what is not known of an array, a sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        match &*self.of {
            Frame::File(of) => DngReport::new(of).notes,
            Frame::Sensor(_) => Vec::new(),
        }
    }

    /// Returns what the frame holds and what was made of it; the keys of ``report.json`` of ``dioptric develop``.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &*self.of {
            Frame::File(of) => to_python(py, &DngReport::new(of)),
            Frame::Sensor(of) => to_python(py, &of.report()),
        }
    }

    /// Returns the picture as the bytes of a PNG file, equal to the ``picture.png`` of ``dioptric develop``.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let png = run(py, &Follower::nobody(), |_, _| picture_png(&self.of.developed().picture))?;
        Ok(PyBytes::new(py, &png))
    }

    /// Writes the picture to a path that ends in ``.png``, else ``picture.png`` and ``report.json`` into a folder. Files appear whole or not at all.
    ///
    /// Returns
    /// -------
    /// list of str, the names of the files.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<String>> {
        let is_picture = is_picture(&path)?;
        run(py, &Follower::nobody(), |_, _| match is_picture {
            true => write_picture(&self.of.developed().picture, &path),
            false => self.save_into(&path),
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.png(py)
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        let name = match &*self.of {
            Frame::File(of) => {
                let shot = &of.file.shot;
                let words: Vec<&str> = [&shot.make, &shot.model].into_iter().flatten().map(String::as_str).collect();
                if words.is_empty() { "array".to_owned() } else { words.join(" ") }
            }
            Frame::Sensor(of) => of.sensor.name.clone(),
        };
        format!("<Developed {name}: {columns} × {rows} pixels>")
    }
}
