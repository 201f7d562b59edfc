//! DNG files read: those written here, and those of cameras and converters.

use std::{fs, path::Path};

use dioptric_files::memory;
use ndarray::Array2;
use serde::Serialize;

use super::{
    area::{Area, masked_areas},
    color::FILTERS,
    corrections::{Corrections, Place},
    file_camera,
    file_look::{self, DngLook, DngRendering},
    file_profile::{ChannelCorrections, DngProfile},
    gain_table::GainTableMap,
    levels::{FileLevels, MaskedSamples},
    profile_file::ProfileFile,
    samples::{self, Codes, Samples},
    tags::{
        BLACK_LEVEL, CFA_LAYOUT, CFA_PATTERN, CFA_PLANE_COLOR, CFA_REPEAT_PATTERN_DIM, COLOR_FILTER_ARRAY,
        DEFAULT_SCALE, DNG_VERSION, EXIF_DIRECTORY, EXPOSURE_TIME, F_NUMBER, FOCAL_LENGTH, IMAGE_DESCRIPTION,
        IMAGE_LENGTH, IMAGE_WIDTH, LENS_MODEL, LINEAR_RAW, MAKE, MODEL, NEW_SUBFILE_TYPE, OPCODE_LIST_1, OPCODE_LIST_2,
        OPCODE_LIST_3, ORIENTATION, OWN_MAKE, PHOTOGRAPHIC_SENSITIVITY, PHOTOMETRIC_INTERPRETATION,
        PROFILE_GAIN_TABLE_MAP, PROFILE_GAIN_TABLE_MAP_2, RGB_TABLES, SUB_DIRECTORIES,
    },
    tiff_reader::{Fields, TiffReader},
};
use crate::{
    Cfa, ColorCorrection, Developed, Exposure, Levels, LinearPicture, Processing, Raw, RawPlane, SensorError, Tile,
    WhiteBalance, process::develop_linear,
};

/// The longest side of a mosaic's tile that is read.
const LONGEST_TILE: usize = 16;
/// Whether the corrections that a file asks for, its opcodes, are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DngOpcodes {
    /// They are, each in its place.
    #[default]
    Applied,
    /// The frame is taken as the sensor gave it.
    Ignored,
}

/// What stands for darkness in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DngBlack {
    /// The black level that the file states; the mean of its masked pixels where it states none.
    #[default]
    Stated,
    /// The mean of its masked pixels, which have dark current too (`MaskedAreas`).
    Masked,
}

impl DngBlack {
    /// Returns the choice of a word: `stated` or `masked`.
    ///
    /// # Errors
    /// When the word is another.
    pub fn parse(word: &str) -> Result<Self, SensorError> {
        match word.to_ascii_lowercase().as_str() {
            "stated" => Ok(Self::Stated),
            "masked" => Ok(Self::Masked),
            _ => Err(SensorError::Word {
                what: "what stands for darkness",
                found: word.to_owned(),
                expected: "stated, masked".to_owned(),
            }),
        }
    }
}

/// How a file is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DngReading {
    /// Whether its corrections are made.
    pub opcodes: DngOpcodes,
    /// How far its profile makes its picture.
    pub rendering: DngRendering,
    /// What stands for darkness.
    pub black: DngBlack,
    /// A camera profile in place of the file's own.
    pub profile: Option<ProfileFile>,
}

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
    /// How far its profile makes its picture.
    pub rendering: DngRendering,
    /// What its masked pixels hold; `None` where it has none.
    pub masked: Option<MaskedSamples>,
    /// The corrections that the file asks for and that are made, by the names of their opcodes: to the frame, or to its picture.
    pub opcodes: Vec<String>,
    /// What the file asks for and is not done, a sentence each.
    pub notes: Vec<String>,
    /// All pixels that see light, where the picture takes some from beyond those that are shown.
    pub(super) with_border: Option<Raw>,
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
    /// Reads a file: Bayer and other mosaics, single planes and stacked ones, of 8 to 16 bits or floats, plain, deflated or as lossless JPEG.
    ///
    /// # Errors
    /// When the file cannot be read, is no DNG, or has samples of another kind.
    pub fn read(path: &Path) -> Result<Self, SensorError> {
        Self::read_with(path, &DngReading::default())
    }

    /// Reads a file as [`read`](Self::read) does, in another way.
    ///
    /// # Errors
    /// As there, and when it has no masked pixels that are asked for, or a profile is for another number of filters.
    pub fn read_with(path: &Path, reading: &DngReading) -> Result<Self, SensorError> {
        let wrong = |reason: String| SensorError::Read { path: path.to_owned(), reason };
        let length = fs::metadata(path).map_err(|e| wrong(e.to_string()))?.len();
        memory::check(length, length).map_err(|e| wrong(e.to_string()))?;
        let bytes = fs::read(path).map_err(|e| wrong(e.to_string()))?;
        Self::from_bytes_with(&bytes, reading).map_err(|reason| match raw_format_of(&bytes).or_else(|| raw_format_by_name(path)) {
            Some(format) => wrong(format!(
                "is {format}, which is not read, expected a DNG file; Adobe's DNG Converter and `dnglab convert` make one of it"
            )),
            None => wrong(reason),
        })
    }

    /// Returns whether bytes begin as a DNG file does.
    pub fn is_dng(bytes: &[u8]) -> bool {
        let first = TiffReader::new(bytes).and_then(|(file, first)| file.fields_at(first));
        first.is_ok_and(|first| first.has(DNG_VERSION))
    }

    /// Reads the bytes of a file; the error is what is wrong with it.
    #[cfg(test)]
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes_with(bytes, &DngReading::default())
    }

    pub(super) fn from_bytes_with(bytes: &[u8], reading: &DngReading) -> Result<Self, String> {
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
        let mut stored = samples::read(file, &frame)?;
        let area = Area::read(&frame, (stored.rows, stored.columns))?;
        let whole = area.whole();
        let (filter_names, tile) = mosaic(&frame, stored.n_planes, &area)?;
        let (_, whole_tile) = mosaic(&frame, stored.n_planes, &whole)?;
        let lists = Lists::read(&frame, reading.opcodes)?;
        lists.correct_codes(&mut stored, whole_tile.as_ref(), &area);
        if reading.profile.is_some() && filter_names.len() == 1 {
            return Err("has one filter, of which a camera profile says nothing, expected none".to_owned());
        }
        let other = reading.profile.as_ref().map(ProfileFile::fields).transpose()?;
        let profile = other.as_ref().unwrap_or(&first);
        let (color, neutral) = file_camera::color(&first, profile, filter_names.len())?;
        let noise = file_camera::noise(&frame, &first, filter_names.len())?;
        let file_levels = FileLevels::read(&frame, &stored)?;
        let areas = masked_areas(&frame, (stored.rows, stored.columns))?;
        let masked = file_levels.masked(&stored, &areas, &area);
        let is_by_masked = reading.black == DngBlack::Masked || !frame.has(BLACK_LEVEL);
        let file_levels = match &masked {
            Some(masked) if is_by_masked => file_levels.raised_to(masked)?,
            None if reading.black == DngBlack::Masked => {
                return Err(
                    "has no masked pixels to take for black, expected MaskedAreas or the black level".to_owned()
                );
            }
            _ => file_levels,
        };
        let saturation_e = noise.first().map_or(f64::INFINITY, |noise| 1.0 / noise.scale);
        let number = |tag: u16| -> Result<Option<f64>, String> {
            let found = exif.as_ref().map_or(Ok(Vec::new()), |exif| exif.numbers(tag))?;
            Ok(found.first().copied().filter(|value| value.is_finite() && *value > 0.0))
        };
        let exposure_time_s = number(EXPOSURE_TIME)?;
        let frame_of = |area: &Area, tile: Option<Tile>| {
            let (planes, levels) = file_levels.planes(&stored, area, saturation_e);
            let raw = Raw {
                planes,
                tile,
                filter_names: filter_names.clone(),
                levels,
                exposure: Exposure::seconds(exposure_time_s.unwrap_or(0.0)),
                row_time_us: 0.0,
                merged: Vec::new(),
                masked: None,
            };
            lists.correct_light(raw, area, saturation_e)
        };
        let raw = frame_of(&area, tile);
        let needs_border =
            lists.third.moves() && (area != whole || lists.third.trimmed(whole.size()) != whole.corners());
        let with_border = needs_border.then(|| frame_of(&whole, whole_tile));
        let shown = needs_border.then(|| area.shown_corners());
        let corrections = (!lists.third.is_empty()).then(|| {
            let place = if needs_border { whole.place() } else { area.place() };
            ChannelCorrections { list: lists.third.clone(), place, shown }
        });
        // The map of the file's own profile lies with the frame.
        let own_map = if reading.profile.is_none() && frame.has(PROFILE_GAIN_TABLE_MAP) { &frame } else { profile };
        let gains = GainTableMap::read(own_map, PROFILE_GAIN_TABLE_MAP, &area)?;
        let look = DngLook { gains, ..DngLook::read(&first, profile)? };
        let mut notes = notes(&first, profile, &frame)?;
        notes.extend(masked.as_ref().filter(|_| !is_by_masked).and_then(MaskedSamples::note));
        notes.extend(reading.profile.as_ref().and_then(|profile| profile.note(&first)));
        notes.extend(lists.notes.iter().cloned());
        if let Some(color) = &color
            && color.lights.len() > 1
            && color.lights.iter().any(|light| light.kelvin().is_none())
        {
            notes.push("a color matrix of the file is for a light that it does not tell, and is not used".to_owned());
        }
        Ok(Self {
            raw,
            bits: stored.bits,
            stored: (stored.columns, stored.rows),
            origin: (area.left, area.top),
            profile: DngProfile { filter_names, color, look, noise, corrections },
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
            rendering: reading.rendering,
            masked,
            opcodes: lists.names,
            notes,
            with_border,
        })
    }

    /// Returns the picture of the frame, turned as the file says: the scene's white is that of the shot as the camera states it, and
    /// colors are those of the file's matrices.
    ///
    /// # Errors
    /// When a setting makes no sense, or asks for what the file does not hold: the lens, quantum efficiencies, or noise.
    pub fn develop(&self, processing: &Processing) -> Result<Developed, SensorError> {
        let linear = self.develop_linear(processing)?;
        let mut developed = linear.encode(processing.brightness, processing.curve, processing.space);
        developed.picture = developed.picture.oriented(self.orientation);
        Ok(developed)
    }

    /// Returns the linear light of the frame, as [`develop`](Self::develop) has it before brightness and tone curve, not turned.
    ///
    /// # Errors
    /// As [`develop`](Self::develop).
    pub fn develop_linear(&self, processing: &Processing) -> Result<LinearPicture, SensorError> {
        let white = match (&processing.white, &self.neutral) {
            (WhiteBalance::Scene, Some(neutral)) => {
                let largest = neutral.iter().copied().fold(0.0, f64::max);
                WhiteBalance::Gains(neutral.iter().map(|part| largest / part).collect())
            }
            (white, _) => white.clone(),
        };
        // A patch counts from the first pixel that is shown.
        let white = match (white, &self.with_border, self.profile.corrections.as_ref().and_then(|c| c.shown)) {
            (WhiteBalance::Patch { left, top, width, height }, Some(_), Some([down, right, ..])) => {
                WhiteBalance::Patch { left: left + right, top: top + down, width, height }
            }
            (white, ..) => white,
        };
        let has_map = self.rendering == DngRendering::Look && self.profile.look.gains.is_some();
        if has_map && processing.perspective.is_some() {
            let reason =
                "moves what the file's local map of gains is for, expected none, or another rendering than look";
            return Err(SensorError::Unsuitable { what: "perspective", reason: reason.to_owned() });
        }
        let processing = Processing { white, ..processing.clone() };
        self.profile.check_processing(&processing)?;
        let raw = self.with_border.as_ref().unwrap_or(&self.raw);
        let mut linear = develop_linear(&self.profile, raw, &processing, None)?;
        // A matrix of one's own, or none, is no part of the profile.
        if matches!(
            processing.color,
            ColorCorrection::Auto | ColorCorrection::AutoUnder(_) | ColorCorrection::Fitted(_)
        ) {
            self.render(&mut linear);
        }
        Ok(linear)
    }
}

impl DngFile {
    /// Changes colors as far as the profile is to be followed.
    fn render(&self, linear: &mut LinearPicture) {
        let Some(color) = self.profile.color.as_ref().filter(|_| self.rendering != DngRendering::Matrices) else {
            return;
        };
        let neutral: Vec<f64> = linear.balance.iter().map(|gain| 1.0 / gain).collect();
        let none = DngLook::default();
        let look = if self.rendering == DngRendering::Look { &self.profile.look } else { &none };
        file_look::render(&mut linear.light, color.map(&neutral).as_ref(), look);
    }

    /// Returns what its profile has and its rendering leaves out, a sentence each.
    pub fn left_out(&self) -> Vec<String> {
        let look = &self.profile.look;
        let maps = self.profile.color.iter().flat_map(|color| &color.lights).any(|light| light.map.is_some());
        let (no_map, no_look) = (self.rendering == DngRendering::Matrices, self.rendering != DngRendering::Look);
        let parts = [
            (maps && no_map, "a map of hues and saturations".to_owned()),
            (
                look.exposure_stops != 0.0 && no_look,
                format!("{} stops more brightness (BaselineExposure)", look.exposure_stops),
            ),
            (look.gains.is_some() && no_look, "a local map of gains".to_owned()),
            (look.table.is_some() && no_look, "a look table".to_owned()),
            (look.curve.is_some() && no_look, "a tone curve".to_owned()),
        ];
        let parts: Vec<String> = parts.into_iter().filter_map(|(is_left, part)| is_left.then_some(part)).collect();
        if parts.is_empty() {
            return Vec::new();
        }
        vec![format!("the file's profile has {}, left out as the rendering is not `look`", parts.join(", "))]
    }
}

/// The three lists of opcodes of a frame.
#[derive(Default)]
struct Lists {
    first: Corrections,
    second: Corrections,
    third: Corrections,
    /// The names of all that are applied.
    names: Vec<String>,
    notes: Vec<String>,
}

impl Lists {
    fn read(frame: &Fields<'_>, opcodes: DngOpcodes) -> Result<Self, String> {
        let list = |tag: u16| frame.bytes(tag).map_or(Ok(Corrections::default()), Corrections::read);
        let first = list(OPCODE_LIST_1)?.without_trimming();
        let (second, third) = (list(OPCODE_LIST_2)?.without_trimming(), list(OPCODE_LIST_3)?);
        let of = |names: fn(&Corrections) -> &Vec<String>| -> Vec<String> {
            [&first, &second, &third].into_iter().flat_map(names).cloned().collect()
        };
        let (names, unknown) = (of(|list| &list.names), of(|list| &list.unknown));
        if opcodes == DngOpcodes::Ignored {
            let all: Vec<String> = names.into_iter().chain(unknown).collect();
            let notes =
                (!all.is_empty()).then(|| format!("the file asks for {}, which was left out as asked", all.join(", ")));
            return Ok(Self { notes: notes.into_iter().collect(), ..Self::default() });
        }
        let notes =
            (!unknown.is_empty()).then(|| format!("the file asks for {}, which is not done", unknown.join(", ")));
        Ok(Self { first, second, third, names, notes: notes.into_iter().collect() })
    }

    /// Applies the first list to the codes as they are stored.
    fn correct_codes(&self, stored: &mut Samples, tile: Option<&Tile>, area: &Area) {
        if self.first.is_empty() {
            return;
        }
        let (rows, columns, n) = (stored.rows, stored.columns, stored.n_planes);
        // Floats are light of 1 already.
        let top = if matches!(stored.codes, Codes::Whole(_)) { f32::from(u16::MAX) } else { 1.0 };
        let plane = |plane: usize| Array2::from_shape_fn((rows, columns), |(r, c)| stored.at(r, c, plane) / top);
        let planes = (0..n).map(plane).collect();
        let place = Place { rows, columns, top: 0, left: 0 };
        let is_same = same_filter(tile, (area.active_top, area.active_left));
        let changed = self.first.apply(planes, place, (&[], 1.0), &is_same);
        let highest = stored.top() as f32;
        for (plane, values) in changed.iter().enumerate() {
            for ((r, c), value) in values.indexed_iter() {
                let place = (r * columns + c) * n + plane;
                match &mut stored.codes {
                    Codes::Whole(codes) => codes[place] = (value * top).round().clamp(0.0, highest) as u16,
                    Codes::Floats(floats) => floats[place] = *value,
                }
            }
        }
    }

    /// Applies the second list to the light of a frame.
    fn correct_light(&self, raw: Raw, area: &Area, saturation_e: f64) -> Raw {
        if self.second.is_empty() {
            return raw;
        }
        let planes = self.second.apply(raw.linear(), area.place(), (&[], 1.0), &same_filter(raw.tile.as_ref(), (0, 0)));
        Raw {
            planes: planes.into_iter().map(|plane| RawPlane::Evened(plane.as_standard_layout().into_owned())).collect(),
            levels: Levels::of_file((0.0, 1.0, 1.0), saturation_e, None),
            ..raw
        }
    }
}

/// Returns whether two pixels of a plane whose mosaic begins at a row and column have the same filter.
fn same_filter(tile: Option<&Tile>, (top, left): (usize, usize)) -> impl Fn([usize; 2], [usize; 2]) -> bool + Sync {
    let filter = move |[row, column]: [usize; 2]| {
        let counted = |i: usize, first: usize, n: usize| (i + n * first.div_ceil(n) - first) % n;
        tile.map(|tile| tile.filter_at(counted(row, top, tile.rows()), counted(column, left, tile.columns())))
    };
    move |a, b| filter(a) == filter(b)
}

/// Returns the name of a raw format that is no DNG, by the first bytes of a file and the maker that it names.
pub fn raw_format_of(bytes: &[u8]) -> Option<&'static str> {
    let begins = |at: usize, with: &[u8]| bytes.get(at..at + with.len()) == Some(with);
    let by_bytes = [
        (8, &b"CR"[..], "a Canon CR2 file"),
        (4, b"ftypcrx", "a Canon CR3 file"),
        (0, b"FUJIFILMCCD-RAW", "a Fujifilm RAF file"),
        (0, b"IIU\0", "a Panasonic RW2 file"),
        (0, b"IIRO", "an Olympus ORF file"),
        (0, b"IIRS", "an Olympus ORF file"),
        (0, b"MMOR", "an Olympus ORF file"),
        (0, b"FOVb", "a Sigma X3F file"),
        (0, b"\0MRM", "a Minolta MRW file"),
    ];
    if let Some((.., name)) = by_bytes.into_iter().find(|(at, with, _)| begins(*at, with)) {
        return Some(name);
    }
    let (file, first) = TiffReader::new(bytes).ok()?;
    let first = file.fields_at(first).ok()?;
    let make = first.text(MAKE)?.to_ascii_uppercase();
    // Pictures of these makers are TIFF files too; raw ones have their frame in a directory below the first.
    let is_raw = !first.has(DNG_VERSION) && first.has(SUB_DIRECTORIES);
    let by_maker = [("NIKON", "a Nikon NEF file"), ("SONY", "a Sony ARW file"), ("PENTAX", "a Pentax PEF file")];
    by_maker.into_iter().find(|(maker, _)| is_raw && make.starts_with(maker)).map(|(_, name)| name)
}

/// Returns the name of a raw format that is no DNG, by the extension of a file's name.
pub fn raw_format_by_name(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
    Some(match extension.as_str() {
        "nef" | "nrw" => "a Nikon NEF file",
        "arw" | "sr2" | "srf" => "a Sony ARW file",
        "pef" => "a Pentax PEF file",
        "cr2" => "a Canon CR2 file",
        "cr3" => "a Canon CR3 file",
        "raf" => "a Fujifilm RAF file",
        "rw2" => "a Panasonic RW2 file",
        "orf" => "an Olympus ORF file",
        "x3f" => "a Sigma X3F file",
        "3fr" | "fff" => "a Hasselblad 3FR file",
        "iiq" => "a Phase One IIQ file",
        "srw" => "a Samsung SRW file",
        "dcr" | "kdc" => "a Kodak DCR file",
        _ => return None,
    })
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
fn notes(first: &Fields<'_>, profile: &Fields<'_>, frame: &Fields<'_>) -> Result<Vec<String>, String> {
    let mut notes = Vec::new();
    // Cameras write names and captions there; frames of this program what the frame lacks.
    if let (Some(OWN_MAKE), Some(description)) = (first.text(MAKE).as_deref(), first.text(IMAGE_DESCRIPTION)) {
        notes.push(description);
    }
    if frame.numbers(DEFAULT_SCALE)?.iter().any(|scale| *scale != 1.0) {
        notes.push("the file's pixels are not square (DefaultScale), which is left as it is".to_owned());
    }
    let look = [(PROFILE_GAIN_TABLE_MAP_2, "local gains of a second kind"), (RGB_TABLES, "tables of colors")];
    let look: Vec<&str> =
        look.into_iter().filter(|(tag, _)| profile.has(*tag) || frame.has(*tag)).map(|(_, name)| name).collect();
    if !look.is_empty() {
        notes.push(format!("the profile has {}, which is left out", look.join(", ")));
    }
    Ok(notes)
}
