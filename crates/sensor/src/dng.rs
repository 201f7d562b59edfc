//! Raw frames as DNG files (Adobe Digital Negative 1.4), which raw converters open.

use std::{io::Cursor, path::Path};

use dioptric_spectrum::Illuminant;
use tiff::{
    encoder::{
        Rational, SRational, TiffEncoder,
        colortype::{ColorType, Gray16, RGB16},
    },
    tags::Tag,
};

use crate::{
    Raw, RawPlane, Sensor, SensorError,
    balance::white_response,
    dng_color::{camera_from_xyz, color_codes, plane_order},
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
const LINEARIZATION_TABLE: u16 = 50712;
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
/// The code of no light after a linearization table; room below it for noise.
const LINEARIZED_BLACK: f64 = 4096.0;

impl Sensor {
    /// Writes a frame as DNG: its digital numbers with mosaic, levels, color matrices for A and D65, and the neutral of
    /// `light`.
    ///
    /// A single filter and stacked filters are written without a mosaic (`LinearRaw`); a response that is not a straight
    /// line goes with a table that undoes it.
    ///
    /// # Errors
    /// When the frame is in volts, or its filters are not one, three, or (in a mosaic) four of R, G, B, C, M, Y and W, or
    /// the tile is too large; or the file cannot be written; then there is no file.
    pub fn write_dng(&self, raw: &Raw, light: &Illuminant, path: &Path) -> Result<(), SensorError> {
        raw.check()?;
        let planes: Option<Vec<_>> = raw.planes.iter().map(RawPlane::dn).collect();
        let planes = planes.ok_or_else(|| raw.without_numbers("a DNG file"))?;
        let tags = Tags { sensor: self, raw, light, colors: color_codes(raw)? };
        let (rows, columns) = raw.size();
        let codes: Vec<u16> = match planes.as_slice() {
            [plane] => plane.iter().copied().collect(),
            planes => (0..rows * columns)
                .flat_map(|i| planes.iter().map(move |plane| plane[(i / columns, i % columns)]))
                .collect(),
        };
        let mut bytes = Cursor::new(Vec::new());
        let written = match planes.len() {
            1 => tags.encode::<Gray16>(&mut bytes, &codes),
            _ => tags.encode::<RGB16>(&mut bytes, &codes),
        };
        written.map_err(|e| write_error(path, e))?;
        write_beside_and_rename(path, bytes.get_ref())
    }
}

/// What is written about a frame.
struct Tags<'a> {
    sensor: &'a Sensor,
    raw: &'a Raw,
    light: &'a Illuminant,
    /// The number that DNG has for each filter; empty for a monochrome sensor.
    colors: Vec<u8>,
}

impl Tags<'_> {
    fn encode<C: ColorType<Inner = u16>>(
        &self,
        bytes: &mut Cursor<Vec<u8>>,
        codes: &[u16],
    ) -> Result<(), tiff::TiffError> {
        let (rows, columns) = self.raw.size();
        let mut encoder = TiffEncoder::new(bytes)?;
        let mut image = encoder.new_image::<C>(columns as u32, rows as u32)?;
        self.write(image.encoder())?;
        image.write_data(codes)
    }

    fn write<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let is_mosaic = !self.colors.is_empty() && self.raw.tile.is_some();
        let interpretation = if is_mosaic { COLOR_FILTER_ARRAY } else { LINEAR_RAW };
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
        self.write_levels(directory)?;
        if is_mosaic {
            self.write_mosaic(directory)?;
        }
        if self.colors.is_empty() { Ok(()) } else { self.write_color(directory) }
    }

    fn write_levels<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let levels = &self.raw.levels;
        let (mut black, mut white) = (levels.black, levels.white.round().min(levels.top));
        if !levels.is_linear() {
            let top = f64::from(u16::MAX);
            let straight = |dn: u32| LINEARIZED_BLACK + (top - LINEARIZED_BLACK) * levels.linear(f64::from(dn));
            let table: Vec<u16> =
                (0..=levels.top as u32).map(|dn| straight(dn).round().clamp(0.0, top) as u16).collect();
            directory.write_tag(Tag::Unknown(LINEARIZATION_TABLE), &table[..])?;
            (black, white) = (LINEARIZED_BLACK, top);
        }
        // One level for each plane.
        let n_planes = self.raw.planes.len();
        let blacks: Vec<Rational> = vec![Rational { n: (black * 1000.0).round().max(0.0) as u32, d: 1000 }; n_planes];
        directory.write_tag(Tag::Unknown(BLACK_LEVEL), &blacks[..])?;
        directory.write_tag(Tag::Unknown(WHITE_LEVEL), &vec![white as u32; n_planes][..])
    }

    fn write_mosaic<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let tile = self.raw.tile.as_ref().expect("only mosaics come here");
        directory.write_tag(Tag::Unknown(CFA_REPEAT_PATTERN_DIM), &[tile.rows() as u16, tile.columns() as u16][..])?;
        let pattern: Vec<u8> = (0..tile.rows()).flat_map(|row| tile.row(row)).map(|&f| self.colors[f]).collect();
        directory.write_tag(Tag::Unknown(CFA_PATTERN), &pattern[..])?;
        let planes: Vec<u8> =
            plane_order(&self.colors, self.raw.tile.as_ref()).iter().map(|&filter| self.colors[filter]).collect();
        directory.write_tag(Tag::Unknown(CFA_PLANE_COLOR), &planes[..])?;
        directory.write_tag(Tag::Unknown(CFA_LAYOUT), 1_u16)
    }

    fn write_color<W: std::io::Write + std::io::Seek>(
        &self,
        directory: &mut tiff::encoder::DirectoryEncoder<'_, W, tiff::encoder::TiffKindStandard>,
    ) -> Result<(), tiff::TiffError> {
        let order = plane_order(&self.colors, self.raw.tile.as_ref());
        for (matrix_tag, light_tag, light, number) in [
            (COLOR_MATRIX_1, CALIBRATION_ILLUMINANT_1, Illuminant::A, STANDARD_LIGHT_A),
            (COLOR_MATRIX_2, CALIBRATION_ILLUMINANT_2, Illuminant::D65, D65),
        ] {
            let rows = camera_from_xyz(self.sensor, &light);
            let matrix: Vec<SRational> = order
                .iter()
                .flat_map(|&filter| rows[filter])
                .map(|v| SRational { n: (v * 10_000.0).round() as i32, d: 10_000 })
                .collect();
            directory.write_tag(Tag::Unknown(matrix_tag), &matrix[..])?;
            directory.write_tag(Tag::Unknown(light_tag), number)?;
        }
        let white = white_response(self.sensor, self.light);
        let brightest = white.iter().copied().fold(0.0, f64::max);
        let neutral: Vec<Rational> = order
            .iter()
            .map(|&filter| white[filter])
            .map(|w| Rational { n: (w / brightest * 1e6).round().max(1.0) as u32, d: 1_000_000 })
            .collect();
        directory.write_tag(Tag::Unknown(AS_SHOT_NEUTRAL), &neutral[..])
    }
}
