//! DNG files read: those written here, and those of cameras and converters.

use std::{fs, path::Path};

use dioptric_files::memory;

use serde::Serialize;

use super::{
    area::Area,
    color::FILTERS,
    file_camera,
    file_profile::DngProfile,
    levels::FileLevels,
    samples,
    tags::{
        BASELINE_EXPOSURE, CFA_LAYOUT, CFA_PATTERN, CFA_PLANE_COLOR, CFA_REPEAT_PATTERN_DIM, COLOR_FILTER_ARRAY,
        DEFAULT_SCALE, DNG_VERSION, EXIF_DIRECTORY, EXPOSURE_TIME, F_NUMBER, FOCAL_LENGTH, IMAGE_DESCRIPTION,
        IMAGE_LENGTH, IMAGE_WIDTH, LENS_MODEL, LINEAR_RAW, MAKE, MODEL, NEW_SUBFILE_TYPE, OPCODE_LIST_1, OPCODE_LIST_2,
        OPCODE_LIST_3, ORIENTATION, OWN_MAKE, PHOTOGRAPHIC_SENSITIVITY, PHOTOMETRIC_INTERPRETATION, SUB_DIRECTORIES,
    },
    tiff_reader::{Fields, TiffReader},
};
use crate::{Cfa, Developed, Exposure, Processing, Raw, SensorError, Tile, WhiteBalance, process::develop_linear};

/// The longest side of a mosaic's tile that is read.
const LONGEST_TILE: usize = 16;
/// The opcodes by their numbers from 1 on.
const OPCODES: [&str; 14] = [
    "WarpRectilinear",
    "WarpFisheye",
    "FixVignetteRadial",
    "FixBadPixelsConstant",
    "FixBadPixelsList",
    "TrimBounds",
    "MapTable",
    "MapPolynomial",
    "GainMap",
    "DeltaPerRow",
    "DeltaPerColumn",
    "ScalePerRow",
    "ScalePerColumn",
    "WarpRectilinear2",
];

/// A raw frame from a DNG file, with what the file states of it.
#[derive(Clone, Debug, PartialEq)]
pub struct DngFile {
    /// The part of the frame that is shown: the default crop of the active area. Its exposure time is 0 where the file has none.
    pub raw: Raw,
    /// The bits of a stored sample.
    pub bits: u32,
    /// Columns and rows that are stored.
    pub stored: (usize, usize),
    /// The column and row of the part that is shown.
    pub origin: (usize, usize),
    /// The colors and the noise of the camera.
    pub profile: DngProfile,
    /// What each filter gives of the white of the shot; `None` where the file does not say.
    pub neutral: Option<Vec<f64>>,
    /// How the picture is turned (Exif `Orientation`, 1 to 8).
    pub orientation: usize,
    /// The camera and how it was set.
    pub shot: DngShot,
    /// What the file asks for and is not done, a sentence each.
    pub notes: Vec<String>,
}

/// What a raw file states of the camera and of how it was set (Exif); `None` where it does not.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DngShot {
    /// The maker of the camera.
    pub make: Option<String>,
    /// Its model.
    pub model: Option<String>,
    /// What the file tells of its frame (`ImageDescription`).
    pub description: Option<String>,
    /// The name of the lens.
    pub lens: Option<String>,
    /// Exposure time, s.
    pub exposure_time_s: Option<f64>,
    /// The f-number.
    pub f_number: Option<f64>,
    /// The focal length, mm.
    pub focal_length_mm: Option<f64>,
    /// The ISO speed.
    pub iso_speed: Option<f64>,
}

impl DngFile {
    /// Reads a file: Bayer and other mosaics, single planes and stacked ones, of 8 to 16 bits, plain or as lossless JPEG.
    ///
    /// # Errors
    /// When the file cannot be read, is no DNG, or has samples of another kind.
    pub fn read(path: &Path) -> Result<Self, SensorError> {
        let wrong = |reason: String| SensorError::Read { path: path.to_owned(), reason };
        let length = fs::metadata(path).map_err(|e| wrong(e.to_string()))?.len();
        memory::check(length, length).map_err(|e| wrong(e.to_string()))?;
        let bytes = fs::read(path).map_err(|e| wrong(e.to_string()))?;
        Self::from_bytes(&bytes).map_err(wrong)
    }

    /// Reads the bytes of a file; the error is what is wrong with it.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let (file, first) = TiffReader::new(bytes)?;
        let first = file.fields_at(first)?;
        if !first.has(DNG_VERSION) {
            return Err("is a TIFF file, but no DNG, expected one with a DNGVersion".to_owned());
        }
        let frame = frame_directory(file, &first)?;
        let exif = match first.one_or(EXIF_DIRECTORY, 0)? {
            0 => None,
            place => Some(file.fields_at(place)?),
        };
        let stored = samples::read(file, &frame)?;
        let area = Area::read(&frame, (stored.rows, stored.columns))?;
        let (filter_names, tile) = mosaic(&frame, stored.n_planes, &area)?;
        let (color, neutral) = file_camera::color(&first, filter_names.len())?;
        let noise = file_camera::noise(&frame, &first, filter_names.len())?;
        let file_levels = FileLevels::read(&frame, &stored)?;
        let profile = DngProfile { filter_names: filter_names.clone(), color, noise };
        let saturation_e = profile.noise.first().map_or(f64::INFINITY, |noise| 1.0 / noise.scale);
        let (planes, levels) = file_levels.planes(&stored, &area, saturation_e);
        let number = |tag: u16| -> Result<Option<f64>, String> {
            let found = exif.as_ref().map_or(Ok(Vec::new()), |exif| exif.numbers(tag))?;
            Ok(found.first().copied().filter(|value| value.is_finite() && *value > 0.0))
        };
        let exposure_time_s = number(EXPOSURE_TIME)?;
        let raw = Raw {
            planes,
            tile,
            filter_names,
            levels,
            exposure: Exposure::seconds(exposure_time_s.unwrap_or(0.0)),
            row_time_us: 0.0,
            merged: Vec::new(),
        };
        Ok(Self {
            raw,
            bits: stored.bits,
            stored: (stored.columns, stored.rows),
            origin: (area.left, area.top),
            profile,
            neutral,
            orientation: Some(first.one_or(ORIENTATION, 1)?).filter(|n| (1..=8).contains(n)).unwrap_or(1),
            shot: DngShot {
                make: first.text(MAKE),
                model: first.text(MODEL),
                description: first.text(IMAGE_DESCRIPTION),
                lens: exif.as_ref().and_then(|exif| exif.text(LENS_MODEL)),
                exposure_time_s,
                f_number: number(F_NUMBER)?,
                focal_length_mm: number(FOCAL_LENGTH)?,
                iso_speed: number(PHOTOGRAPHIC_SENSITIVITY)?,
            },
            notes: notes(&first, &frame)?,
        })
    }

    /// Returns the picture of the frame, turned as the file says: the scene's white is that of the shot as the camera states it, and
    /// colors are those of the file's matrices.
    ///
    /// # Errors
    /// When a setting makes no sense, or asks for what the file does not hold: the lens, quantum efficiencies, or noise.
    pub fn develop(&self, processing: &Processing) -> Result<Developed, SensorError> {
        let white = match (&processing.white, &self.neutral) {
            (WhiteBalance::Scene, Some(neutral)) => {
                let largest = neutral.iter().copied().fold(0.0, f64::max);
                WhiteBalance::Gains(neutral.iter().map(|part| largest / part).collect())
            }
            (white, _) => white.clone(),
        };
        let processing = Processing { white, ..processing.clone() };
        self.profile.check_processing(&processing)?;
        let linear = develop_linear(&self.profile, &self.raw, &processing, None)?;
        let mut developed = linear.encode(processing.brightness, processing.curve, processing.space);
        developed.picture = developed.picture.oriented(self.orientation);
        Ok(developed)
    }
}

/// Returns the directory of the largest raw frame: the first or one below it.
fn frame_directory<'a>(file: TiffReader<'a>, first: &Fields<'a>) -> Result<Fields<'a>, String> {
    let mut best: Option<(usize, Fields<'a>)> = None;
    let below = first.whole(SUB_DIRECTORIES)?;
    let directories = std::iter::once(Ok(first.clone())).chain(below.into_iter().map(|place| file.fields_at(place)));
    for fields in directories {
        let fields = fields?;
        let interpretation = fields.one_or(PHOTOMETRIC_INTERPRETATION, 0)?;
        let is_raw = [COLOR_FILTER_ARRAY, LINEAR_RAW].map(usize::from).contains(&interpretation);
        if !is_raw || fields.one_or(NEW_SUBFILE_TYPE, 0)? != 0 {
            continue;
        }
        let n_pixels = fields.one_or(IMAGE_WIDTH, 0)?.saturating_mul(fields.one_or(IMAGE_LENGTH, 0)?);
        if best.as_ref().is_none_or(|(most, _)| n_pixels > *most) {
            best = Some((n_pixels, fields));
        }
    }
    best.map(|(_, fields)| fields)
        .ok_or_else(|| "has no raw frame, expected one as a mosaic or as linear planes".to_owned())
}

/// Returns the names of the filters in the order of the file's planes, and the mosaic from the first pixel that is shown.
fn mosaic(frame: &Fields<'_>, n_planes: usize, area: &Area) -> Result<(Vec<String>, Option<Tile>), String> {
    let is_mosaic = frame.one_or(PHOTOMETRIC_INTERPRETATION, 0)? == usize::from(COLOR_FILTER_ARRAY);
    let name = |code: usize| match FILTERS.get(code) {
        Some(name) => Ok((*name).to_owned()),
        None => Err(format!("has a filter of number {code}, expected 0 to 6")),
    };
    let planes = frame.whole(CFA_PLANE_COLOR)?;
    let planes = if planes.is_empty() { vec![0, 1, 2] } else { planes };
    match (is_mosaic, n_planes) {
        (false, 1) => return Ok((vec!["Y".to_owned()], Some(Tile::single(0)))),
        (false, 3) => return Ok((FILTERS[..3].iter().map(|name| (*name).to_owned()).collect(), None)),
        (false, n) => return Err(format!("has {n} linear planes, expected 1 or 3")),
        (true, 1) => {}
        (true, n) => return Err(format!("has {n} samples a pixel of a mosaic, expected 1")),
    }
    let (size, pattern) = (frame.whole(CFA_REPEAT_PATTERN_DIM)?, frame.whole(CFA_PATTERN)?);
    let (rows, columns) = match size.as_slice() {
        &[rows, columns] if (1..=LONGEST_TILE).contains(&rows) && (1..=LONGEST_TILE).contains(&columns) => {
            (rows, columns)
        }
        _ => {
            return Err(format!("has a mosaic of the size {size:?}, expected rows and columns of 1 to {LONGEST_TILE}"));
        }
    };
    if pattern.len() != rows * columns {
        return Err(format!("has {} filters in a mosaic of {rows} × {columns}", pattern.len()));
    }
    if frame.one_or(CFA_LAYOUT, 1)? != 1 {
        return Err(
            "has a mosaic whose rows or columns are shifted, expected a rectangular one (CFALayout 1)".to_owned()
        );
    }
    let names = planes.iter().map(|&code| name(code)).collect::<Result<Vec<_>, _>>()?;
    if !(3..=4).contains(&names.len()) {
        return Err(format!("has {} filters in its mosaic, expected 3 or 4", names.len()));
    }
    let of_row = |row: &[usize]| row.iter().map(|&code| name(code)).collect::<Result<Vec<_>, _>>();
    let tile = pattern.chunks_exact(columns).map(of_row).collect::<Result<Vec<_>, _>>()?;
    let (down, right) = area.places_before();
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let tile = Cfa::Mosaic(tile).from_pixel(down, right).resolve("the file", &known).map_err(|e| e.to_string())?;
    Ok((names, tile))
}

/// Returns what the file asks for and is not done.
fn notes(first: &Fields<'_>, frame: &Fields<'_>) -> Result<Vec<String>, String> {
    let mut notes = Vec::new();
    // Cameras write names and captions there; frames of this program what the frame lacks.
    if let (Some(OWN_MAKE), Some(description)) = (first.text(MAKE).as_deref(), first.text(IMAGE_DESCRIPTION)) {
        notes.push(description);
    }
    for tag in [OPCODE_LIST_1, OPCODE_LIST_2, OPCODE_LIST_3] {
        let names = frame.bytes(tag).map(opcodes).unwrap_or_default();
        if !names.is_empty() {
            notes.push(format!("the file asks for {}, which is not done", names.join(", ")));
        }
    }
    let stops = first.numbers(BASELINE_EXPOSURE)?.first().copied().unwrap_or(0.0);
    if stops != 0.0 {
        notes.push(format!(
            "the file asks for {stops} stops more brightness (BaselineExposure), which is left to `brightness`"
        ));
    }
    if frame.numbers(DEFAULT_SCALE)?.iter().any(|scale| *scale != 1.0) {
        notes.push("the file's pixels are not square (DefaultScale), which is left as it is".to_owned());
    }
    Ok(notes)
}

/// Returns the names of the opcodes of a list.
fn opcodes(list: &[u8]) -> Vec<String> {
    let number = |at: usize| Some(u32::from_be_bytes(list.get(at..at.checked_add(4)?)?.try_into().ok()?) as usize);
    let (mut names, mut at) = (Vec::new(), 4);
    for _ in 0..number(0).unwrap_or(0) {
        let (Some(opcode), Some(length)) = (number(at), number(at.saturating_add(12))) else { break };
        let name = opcode.checked_sub(1).and_then(|i| OPCODES.get(i));
        names.push(name.map_or_else(|| format!("opcode {opcode}"), |name| (*name).to_owned()));
        at = at.saturating_add(16).saturating_add(length);
    }
    names
}
