//! Raw frames as DNG files (Adobe Digital Negative 1.4), which raw converters open.

use std::{io::Cursor, path::Path};

use dioptric_spectrum::{Illuminant, Observer, Spectrum, Xyz, adapt_bradford, color_checker_reflectances};
use tiff::{
    encoder::{Rational, SRational, TiffEncoder, colortype::Gray16},
    tags::Tag,
};

use crate::{
    ColorMatrix, Raw, Sensor, SensorError,
    balance::{fine_grid, white_response},
    files::{write_beside_and_rename, write_error},
};

const NEW_SUBFILE_TYPE: u16 = 254;
const PHOTOMETRIC_INTERPRETATION: u16 = 262;
const MAKE: u16 = 271;
const MODEL: u16 = 272;
const ORIENTATION: u16 = 274;
const SOFTWARE: u16 = 305;
const CFA_REPEAT_PATTERN_DIM: u16 = 33421;
const CFA_PATTERN: u16 = 33422;
const EXPOSURE_TIME: u16 = 33434;
const DNG_VERSION: u16 = 50706;
const DNG_BACKWARD_VERSION: u16 = 50707;
const UNIQUE_CAMERA_MODEL: u16 = 50708;
const CFA_PLANE_COLOR: u16 = 50710;
const CFA_LAYOUT: u16 = 50711;
const BLACK_LEVEL: u16 = 50714;
const WHITE_LEVEL: u16 = 50717;
const COLOR_MATRIX_1: u16 = 50721;
const COLOR_MATRIX_2: u16 = 50722;
const AS_SHOT_NEUTRAL: u16 = 50728;
const CALIBRATION_ILLUMINANT_1: u16 = 50778;
const CALIBRATION_ILLUMINANT_2: u16 = 50779;

/// Values of the tag `PhotometricInterpretation`.
const COLOR_FILTER_ARRAY: u16 = 32803;
const LINEAR_RAW: u16 = 34892;
/// Values of the calibration illuminants (EXIF light sources).
const STANDARD_LIGHT_A: u16 = 17;
const D65: u16 = 21;

impl Sensor {
    /// Writes a frame as DNG: its digital numbers with mosaic, levels, colour matrices for A and D65, and the neutral of
    /// `light`.
    ///
    /// # Errors
    /// When the frame is in volts, has stacked filters or other filters than one, or three of R, G, B, C, M and Y; or the
    /// file cannot be written; then there is no file.
    pub fn write_dng(&self, raw: &Raw, light: Illuminant, path: &Path) -> Result<(), SensorError> {
        let dn = raw.dn().ok_or_else(|| raw.without_numbers("a DNG file"))?;
        let colors = if raw.filter_names.len() == 1 { Vec::new() } else { dng_colors(&raw.filter_names)? };
        let tags = Tags { sensor: self, raw, light, colors };
        let mut bytes = Cursor::new(Vec::new());
        let codes: Vec<u16> = dn.iter().copied().collect();
        let mut write = || {
            let mut encoder = TiffEncoder::new(&mut bytes)?;
            let mut image = encoder.new_image::<Gray16>(dn.ncols() as u32, dn.nrows() as u32)?;
            tags.write(image.encoder())?;
            image.write_data(&codes)
        };
        write().map_err(|e| write_error(path, e))?;
        write_beside_and_rename(path, bytes.get_ref())
    }

    /// Returns the matrix from XYZ (white of luminance 1) to the channels of a neutral light's own scale, as DNG wants it.
    fn camera_from_xyz(&self, light: Illuminant) -> [[f64; 3]; 3] {
        let chart: Vec<Spectrum> = color_checker_reflectances().into_iter().map(|(_, s)| s).collect();
        let fitted = ColorMatrix::fit(self, light, &chart);
        let srgb_from_balanced = fitted.rows.each_ref().map(|row| [row[0], row[1], row[2]]);
        let balanced_from_srgb = inverse(srgb_from_balanced);
        let white = white_response(self, light);
        let brightest = white.iter().copied().fold(0.0, f64::max);
        let grid = fine_grid();
        let light_xyz = Observer::Cie1931.xyz(&grid, &light.spectrum().sample_held(&grid));
        let light_xyz = Xyz(light_xyz.0.map(|v| v / light_xyz.0[1]));
        // Column by column: what the camera gives for X, Y and Z alone.
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| {
            let rgb = adapt_bradford(Xyz(unit), light_xyz, Xyz::D65).to_linear_srgb();
            let balanced = balanced_from_srgb.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]);
            [0, 1, 2].map(|i| balanced[i] * white[i] / brightest)
        });
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i]))
    }
}

/// What is written about a frame.
struct Tags<'a> {
    sensor: &'a Sensor,
    raw: &'a Raw,
    light: Illuminant,
    /// The number that DNG has for each filter; empty for a monochrome sensor.
    colors: Vec<u8>,
}

impl Tags<'_> {
    fn write<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let interpretation = if self.colors.is_empty() { LINEAR_RAW } else { COLOR_FILTER_ARRAY };
        directory.write_tag(Tag::Unknown(NEW_SUBFILE_TYPE), 0_u32)?;
        directory.write_tag(Tag::from_u16_exhaustive(PHOTOMETRIC_INTERPRETATION), interpretation)?;
        directory.write_tag(Tag::from_u16_exhaustive(MAKE), "dioptric")?;
        // TIFF text is ASCII.
        let model: String = self.sensor.name.chars().map(|c| if c.is_ascii() { c } else { '?' }).collect();
        directory.write_tag(Tag::from_u16_exhaustive(MODEL), model.as_str())?;
        directory.write_tag(Tag::from_u16_exhaustive(ORIENTATION), 1_u16)?;
        directory.write_tag(Tag::from_u16_exhaustive(SOFTWARE), "dioptric")?;
        let microseconds = (self.raw.exposure.time_s * 1e6).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        directory.write_tag(Tag::Unknown(EXPOSURE_TIME), Rational { n: microseconds, d: 1_000_000 })?;
        directory.write_tag(Tag::Unknown(DNG_VERSION), &[1_u8, 4, 0, 0][..])?;
        directory.write_tag(Tag::Unknown(DNG_BACKWARD_VERSION), &[1_u8, 1, 0, 0][..])?;
        directory.write_tag(Tag::Unknown(UNIQUE_CAMERA_MODEL), format!("dioptric {model}").as_str())?;
        directory.write_tag(Tag::Unknown(BLACK_LEVEL), Rational { n: thousandths(self.raw.levels.black), d: 1000 })?;
        directory
            .write_tag(Tag::Unknown(WHITE_LEVEL), self.raw.levels.white.round().min(self.raw.levels.top) as u32)?;
        if self.colors.is_empty() { Ok(()) } else { self.write_color(directory) }
    }

    fn write_color<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let tile = self.raw.tile.as_ref().expect("a frame of one plane and several filters is a mosaic");
        directory.write_tag(Tag::Unknown(CFA_REPEAT_PATTERN_DIM), &[tile.rows() as u16, tile.columns() as u16][..])?;
        let pattern: Vec<u8> = (0..tile.rows()).flat_map(|row| tile.row(row)).map(|&f| self.colors[f]).collect();
        directory.write_tag(Tag::Unknown(CFA_PATTERN), &pattern[..])?;
        directory.write_tag(Tag::Unknown(CFA_PLANE_COLOR), &self.colors[..])?;
        directory.write_tag(Tag::Unknown(CFA_LAYOUT), 1_u16)?;
        for (matrix_tag, light_tag, light, number) in [
            (COLOR_MATRIX_1, CALIBRATION_ILLUMINANT_1, Illuminant::A, STANDARD_LIGHT_A),
            (COLOR_MATRIX_2, CALIBRATION_ILLUMINANT_2, Illuminant::D65, D65),
        ] {
            let matrix: Vec<SRational> = self
                .sensor
                .camera_from_xyz(light)
                .iter()
                .flatten()
                .map(|v| SRational { n: (v * 10_000.0).round() as i32, d: 10_000 })
                .collect();
            directory.write_tag(Tag::Unknown(matrix_tag), &matrix[..])?;
            directory.write_tag(Tag::Unknown(light_tag), number)?;
        }
        let white = white_response(self.sensor, self.light);
        let brightest = white.iter().copied().fold(0.0, f64::max);
        let neutral: Vec<Rational> =
            white.iter().map(|w| Rational { n: (w / brightest * 1e6).round().max(1.0) as u32, d: 1_000_000 }).collect();
        directory.write_tag(Tag::Unknown(AS_SHOT_NEUTRAL), &neutral[..])
    }
}

fn thousandths(value: f64) -> u32 {
    (value * 1000.0).round().max(0.0) as u32
}

/// Returns the numbers that DNG has for three filters.
fn dng_colors(names: &[String]) -> Result<Vec<u8>, SensorError> {
    let number = |name: &String| ["R", "G", "B", "C", "M", "Y"].iter().position(|known| known == name);
    let colors: Vec<u8> = names.iter().filter_map(number).map(|n| n as u8).collect();
    if colors.len() == names.len() && colors.len() == 3 {
        return Ok(colors);
    }
    let reason = format!("needs one filter, or three of R, G, B, C, M and Y, but the sensor has {}", names.join(", "));
    Err(SensorError::Unsuitable { what: "a DNG file", reason })
}

/// Returns the inverse of a matrix.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant))
}
