//! Raw frames as DNG files (Adobe Digital Negative 1.4): written, so that raw converters open them, and read.

mod area;
mod color;
mod corrections;
mod file_camera;
mod file_color;
mod file_look;
mod file_profile;
mod gain_table;
mod levels;
mod lossless_jpeg;
mod opcodes;
mod own_mosaic;
mod pictured;
mod predictor;
mod profile_file;
mod read;
#[cfg(test)]
mod read_tests;
mod samples;
mod tags;
mod tiff_file;
mod tiff_reader;

use std::path::Path;

use dioptric_spectrum::Illuminant;

use self::{
    color::{camera_from_xyz, color_codes, plane_order, xyz_d50_from_balanced},
    opcodes::opcode_list_3,
    tags::*,
    tiff_file::{Directory, Value},
};
pub use self::{
    file_color::{DngColor, DngLight},
    file_look::{ColorMap, DngLook, DngRendering},
    file_profile::{DngNoise, DngProfile},
    gain_table::GainTableMap,
    levels::MaskedSamples,
    own_mosaic::OwnMosaic,
    profile_file::ProfileFile,
    read::{DngBlack, DngFile, DngOpcodes, DngReading, DngShot, raw_format_by_name, raw_format_of},
};
use crate::{
    LensCorrections, LensTables, Picture, Raw, RawPlane, Sensor, SensorError, files::write_error,
    white_light::white_response,
};

/// The code of no light after a linearization table; room below it for noise.
const LINEARIZED_BLACK: f64 = 4096.0;
/// The longest side of a preview, pixels.
const PREVIEW_PX: usize = 512;

/// What a DNG file says besides the frame; what is not known is left out of it.
#[derive(Clone, Debug)]
pub struct DngDetails<'a> {
    /// The light whose white the file states as neutral.
    pub light: Illuminant,
    /// The f-number of the lens.
    pub f_number: Option<f64>,
    /// Its focal length, mm.
    pub focal_length_mm: Option<f64>,
    /// Its name.
    pub lens: Option<String>,
    /// What a reader has to know of the frame, in ASCII: that it is one of several, or that its rows differ (`ImageDescription`).
    pub description: Option<String>,
    /// The developed picture, shown small by programs that list files.
    pub picture: Option<&'a Picture>,
    /// What readers may undo of the lens, and the tables by which.
    pub corrections: Option<(LensCorrections, &'a LensTables)>,
}

impl DngDetails<'_> {
    /// Nothing but the light.
    pub fn of_light(light: Illuminant) -> Self {
        Self {
            light,
            f_number: None,
            focal_length_mm: None,
            lens: None,
            description: None,
            picture: None,
            corrections: None,
        }
    }
}

impl Sensor {
    /// Writes a frame as DNG: its digital numbers with mosaic, levels, noise, color matrices for A and D65, and the neutral of
    /// a light.
    ///
    /// A single filter and stacked filters are written without a mosaic (`LinearRaw`); a response that is not a straight
    /// line goes with a table that undoes it. With a picture the first directory is a preview, and the frame in a directory
    /// below it. The ISO speed is that of the sensor's data sheet, or else 78 lx s over the exposure that saturates.
    ///
    /// # Errors
    /// When the frame is in volts, or its filters are not one, three, or (in a mosaic) four of R, G, B, C, M, Y and W, or
    /// the tile is too large; the corrections are those of another frame or no function of the distance from a center; or the
    /// file cannot be written; then there is no file.
    pub fn write_dng(&self, raw: &Raw, details: &DngDetails<'_>, path: &Path) -> Result<(), SensorError> {
        raw.check()?;
        // Pixels in the dark go with the others, where nothing was taken off by them.
        let planes = raw.masked.as_ref().map_or(&raw.planes, |masked| &masked.planes);
        let planes: Option<Vec<_>> = planes.iter().map(RawPlane::dn).collect();
        let planes = planes.ok_or_else(|| raw.without_numbers("a DNG file"))?;
        let (rows, columns) = planes[0].dim();
        let codes: Vec<u8> = match planes.as_slice() {
            [plane] => plane.iter().flat_map(|dn| dn.to_le_bytes()).collect(),
            planes => (0..rows * columns)
                .flat_map(|i| planes.iter().flat_map(move |plane| plane[(i / columns, i % columns)].to_le_bytes()))
                .collect(),
        };
        let sheet = self.as_read(&raw.exposure)?;
        let tables = details.corrections.map(|(_, tables)| tables.as_read(self, &raw.exposure));
        let corrections = details.corrections.zip(tables.as_deref()).map(|((chosen, _), tables)| (chosen, tables));
        let details = DngDetails { corrections, ..details.clone() };
        let tags = Tags { sensor: &sheet, raw, details: &details, colors: color_codes(raw)? };
        let too_large = || write_error(path, "the frame is larger than a file of this kind can be, 4 GiB");
        let file = tags.directory(codes)?.into_file().ok_or_else(too_large)?;
        Ok(dioptric_files::write(path, &file)?)
    }

    /// Returns the ISO speed of an exposure: that of the data sheet, or else the saturation-based one.
    fn iso_speed(&self, raw: &Raw, light: &Illuminant) -> f64 {
        match self.iso_at_unity_gain {
            Some(iso) => iso * raw.exposure.analog_gain,
            None => self.iso_by_saturation(light, &raw.exposure),
        }
    }
}

/// What is written about a frame.
struct Tags<'a> {
    sensor: &'a Sensor,
    raw: &'a Raw,
    details: &'a DngDetails<'a>,
    /// The number that DNG has for each filter; empty for a monochrome sensor.
    colors: Vec<u8>,
}

impl Tags<'_> {
    /// Returns the first directory: of the preview with that of the frame below it, or of the frame.
    fn directory(&self, codes: Vec<u8>) -> Result<Directory, SensorError> {
        let mut frame = Directory::default();
        self.write_frame(&mut frame, codes)?;
        let mut first = match self.details.picture {
            Some(picture) => {
                let mut preview = preview(picture);
                preview.set_child(SUB_DIRECTORIES, frame);
                preview
            }
            None => frame,
        };
        self.write_camera(&mut first);
        first.set_child(EXIF_DIRECTORY, self.exif());
        Ok(first)
    }

    /// Writes what is of the camera: in the first directory.
    fn write_camera(&self, first: &mut Directory) {
        let model = &self.sensor.name;
        first.set(MAKE, Value::Ascii(OWN_MAKE.to_owned()));
        first.set(MODEL, Value::Ascii(model.clone()));
        if let Some(description) = &self.details.description {
            first.set(IMAGE_DESCRIPTION, Value::Ascii(description.clone()));
        }
        first.set(ORIENTATION, Value::Short(vec![1]));
        first.set(X_RESOLUTION, Value::Rational(vec![(72, 1)]));
        first.set(Y_RESOLUTION, Value::Rational(vec![(72, 1)]));
        first.set(RESOLUTION_UNIT, Value::Short(vec![2]));
        first.set(SOFTWARE, Value::Ascii(format!("dioptric {}", env!("CARGO_PKG_VERSION"))));
        first.set(DNG_VERSION, Value::Byte(vec![1, 4, 0, 0]));
        first.set(DNG_BACKWARD_VERSION, Value::Byte(vec![1, 1, 0, 0]));
        first.set(UNIQUE_CAMERA_MODEL, Value::Ascii(format!("dioptric {model}")));
        if !self.colors.is_empty() {
            self.write_color(first);
        }
    }

    fn exif(&self) -> Directory {
        let mut exif = Directory::default();
        let DngDetails { light, f_number, focal_length_mm, lens, .. } = self.details;
        exif.set(EXIF_VERSION, Value::Undefined(b"0232".to_vec()));
        exif.set(EXPOSURE_TIME, Value::Rational(vec![exposure_time(self.raw.exposure.time_s)]));
        let iso = self.sensor.iso_speed(self.raw, light).round().clamp(1.0, f64::from(u16::MAX)) as u16;
        exif.set(PHOTOGRAPHIC_SENSITIVITY, Value::Short(vec![iso]));
        // Pixels a centimeter of the sensor.
        let per_cm = Value::fraction(1e4 / self.sensor.pixel_pitch_um, 10_000);
        exif.set(FOCAL_PLANE_X_RESOLUTION, Value::Rational(vec![per_cm]));
        exif.set(FOCAL_PLANE_Y_RESOLUTION, Value::Rational(vec![per_cm]));
        exif.set(FOCAL_PLANE_RESOLUTION_UNIT, Value::Short(vec![PER_CENTIMETER]));
        let known = |value: &Option<f64>| value.filter(|v| *v > 0.0 && *v < 1e6).map(|v| Value::fraction(v, 1000));
        if let Some(n) = known(f_number) {
            exif.set(F_NUMBER, Value::Rational(vec![n]));
        }
        if let Some(mm) = known(focal_length_mm) {
            exif.set(FOCAL_LENGTH, Value::Rational(vec![mm]));
        }
        if let Some(lens) = lens {
            exif.set(LENS_MODEL, Value::Ascii(lens.clone()));
        }
        exif
    }

    fn write_frame(&self, frame: &mut Directory, codes: Vec<u8>) -> Result<(), SensorError> {
        let is_mosaic = !self.colors.is_empty() && self.raw.tile.is_some();
        let interpretation = if is_mosaic { COLOR_FILTER_ARRAY } else { LINEAR_RAW };
        let n_planes = self.raw.planes.len();
        let (rows, columns) = self.raw.size();
        let (above, left) = self.raw.masked.as_ref().map_or((0, 0), |masked| (masked.rows, masked.columns));
        write_image(frame, (above + rows, left + columns), (16, n_planes), interpretation, codes);
        frame.set(NEW_SUBFILE_TYPE, Value::Long(vec![0]));
        if above + left > 0 {
            let corners = |all: [usize; 4]| all.map(|place| place as u32);
            let (bottom, right) = (above + rows, left + columns);
            // Top, left, bottom and right; the masked areas do not overlap.
            frame.set(ACTIVE_AREA, Value::Long(corners([above, left, bottom, right]).to_vec()));
            let dark = [[0, 0, above, right], [above, 0, bottom, left]]
                .into_iter()
                .filter(|[top, left, bottom, right]| top < bottom && left < right);
            frame.set(MASKED_AREAS, Value::Long(dark.flat_map(corners).collect()));
            frame.set(DEFAULT_CROP_ORIGIN, Value::Long(vec![0, 0]));
            frame.set(DEFAULT_CROP_SIZE, Value::Long(corners([columns, rows, 0, 0])[..2].to_vec()));
        }
        self.write_levels(frame);
        if is_mosaic {
            self.write_mosaic(frame);
        }
        // σ² = S x + O of the light x, 1 at the white level; frames that were merged follow no such line.
        let noise_e = self.sensor.noise_floor_e(self.raw);
        let saturation_e = self.raw.levels.saturation_e();
        if self.raw.merged.is_empty() && self.raw.levels.is_linear() {
            frame.set(NOISE_PROFILE, Value::Double(vec![1.0 / saturation_e, (noise_e / saturation_e).powi(2)]));
        }
        if let Some((corrections, tables)) = self.details.corrections.filter(|(corrections, _)| !corrections.is_none())
        {
            tables.check(self.raw.size(), self.sensor.filters.len())?;
            let order = plane_order(&self.colors, self.raw.tile.as_ref());
            let order = if order.is_empty() { vec![0] } else { order };
            frame.set(OPCODE_LIST_3, Value::Undefined(opcode_list_3(tables, corrections, &order)?));
        }
        Ok(())
    }

    fn write_levels(&self, frame: &mut Directory) {
        let levels = &self.raw.levels;
        let (mut black, mut white) = (levels.black, levels.white.round().min(levels.top));
        if !levels.is_linear() {
            let top = f64::from(u16::MAX);
            let straight = |dn: u32| LINEARIZED_BLACK + (top - LINEARIZED_BLACK) * levels.linear(f64::from(dn));
            let table: Vec<u16> =
                (0..=levels.top as u32).map(|dn| straight(dn).round().clamp(0.0, top) as u16).collect();
            frame.set(LINEARIZATION_TABLE, Value::Short(table));
            (black, white) = (LINEARIZED_BLACK, top);
        }
        // One level for each plane.
        let n_planes = self.raw.planes.len();
        frame.set(BLACK_LEVEL, Value::Rational(vec![Value::fraction(black.max(0.0), 1000); n_planes]));
        frame.set(WHITE_LEVEL, Value::Long(vec![white as u32; n_planes]));
    }

    fn write_mosaic(&self, frame: &mut Directory) {
        let tile = self.raw.tile.as_ref().expect("only mosaics come here");
        frame.set(CFA_REPEAT_PATTERN_DIM, Value::Short(vec![tile.rows() as u16, tile.columns() as u16]));
        let pattern = (0..tile.rows()).flat_map(|row| tile.row(row)).map(|&f| self.colors[f]).collect();
        frame.set(CFA_PATTERN, Value::Byte(pattern));
        let order = plane_order(&self.colors, self.raw.tile.as_ref());
        frame.set(CFA_PLANE_COLOR, Value::Byte(order.iter().map(|&filter| self.colors[filter]).collect()));
        frame.set(CFA_LAYOUT, Value::Short(vec![1]));
    }

    fn write_color(&self, first: &mut Directory) {
        let order = plane_order(&self.colors, self.raw.tile.as_ref());
        let signed = |v: f64| ((v * 10_000.0).round() as i32, 10_000);
        for (matrix_tag, forward_tag, light_tag, light, number) in [
            (COLOR_MATRIX_1, FORWARD_MATRIX_1, CALIBRATION_ILLUMINANT_1, Illuminant::A, STANDARD_LIGHT_A),
            (COLOR_MATRIX_2, FORWARD_MATRIX_2, CALIBRATION_ILLUMINANT_2, Illuminant::D65, D65),
        ] {
            let rows = camera_from_xyz(self.sensor, &light);
            let matrix = order.iter().flat_map(|&filter| rows[filter]).map(signed).collect();
            first.set(matrix_tag, Value::SignedRational(matrix));
            if let Some(rows) = xyz_d50_from_balanced(self.sensor, &light) {
                let matrix = rows.iter().flat_map(|row| order.iter().map(|&filter| signed(row[filter]))).collect();
                first.set(forward_tag, Value::SignedRational(matrix));
            }
            first.set(light_tag, Value::Short(vec![number]));
        }
        let white = white_response(self.sensor, &self.details.light);
        let brightest = white.iter().copied().fold(0.0, f64::max);
        let part = |filter: usize| Value::fraction((white[filter] / brightest).max(1e-6), 1_000_000);
        first.set(AS_SHOT_NEUTRAL, Value::Rational(order.into_iter().map(part).collect()));
    }
}

/// Returns an exposure time as a fraction: of whole microseconds, or of a second where it is shorter than a hundred.
fn exposure_time(time_s: f64) -> (u32, u32) {
    match time_s {
        short if short > 0.0 && short < 1e-4 => (1, (1.0 / short).round().min(f64::from(u32::MAX)) as u32),
        _ => Value::fraction(time_s, 1_000_000),
    }
}

fn write_image(
    directory: &mut Directory,
    (rows, columns): (usize, usize),
    (bits, n_planes): (u16, usize),
    interpretation: u16,
    samples: Vec<u8>,
) {
    directory.set(IMAGE_WIDTH, Value::Long(vec![columns as u32]));
    directory.set(IMAGE_LENGTH, Value::Long(vec![rows as u32]));
    directory.set(BITS_PER_SAMPLE, Value::Short(vec![bits; n_planes]));
    directory.set(COMPRESSION, Value::Short(vec![1]));
    directory.set(PHOTOMETRIC_INTERPRETATION, Value::Short(vec![interpretation]));
    directory.set(SAMPLES_PER_PIXEL, Value::Short(vec![n_planes as u16]));
    directory.set(ROWS_PER_STRIP, Value::Long(vec![rows as u32]));
    directory.set(PLANAR_CONFIGURATION, Value::Short(vec![1]));
    directory.set_strip(samples);
}

/// Returns the directory of a small picture: means of blocks of codes.
fn preview(picture: &Picture) -> Directory {
    let (rows, columns) = (picture.rows(), picture.columns());
    let step = rows.max(columns).div_ceil(PREVIEW_PX).max(1);
    let (few_rows, few_columns) = ((rows / step).max(1), (columns / step).max(1));
    let mut samples = Vec::with_capacity(3 * few_rows * few_columns);
    for row in 0..few_rows {
        for column in 0..few_columns {
            let down = row * step..((row + 1) * step).min(rows);
            let across = column * step..((column + 1) * step).min(columns);
            for channel in 0..3 {
                let block = picture.codes.slice(ndarray::s![down.clone(), across.clone(), channel]);
                let mean = block.sum() / block.len() as f32;
                samples.push((mean.clamp(0.0, 1.0) * 255.0).round() as u8);
            }
        }
    }
    let mut directory = Directory::default();
    write_image(&mut directory, (few_rows, few_columns), (8, 3), RGB, samples);
    directory.set(NEW_SUBFILE_TYPE, Value::Long(vec![1]));
    directory
}
