//! What cameras write beside their pictures: Exif data (CIPA DC-008), whose fields are those of TIFF.

use std::{io::BufReader, path::Path};

use image::{ImageDecoder, ImageFormat};
use tiff::{
    decoder::{Decoder, ifd::Value},
    tags::{IfdPointer, Tag},
};

use crate::{
    open::{PictureFile, open},
    xmp::{number_of, xmp_properties},
};

/// The fields of a TIFF file or of Exif data, which are one.
pub(crate) struct TiffFields<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

impl<'a> TiffFields<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Option<Self> {
        let is_big_endian = bytes.starts_with(b"MM\0*");
        (is_big_endian || bytes.starts_with(b"II*\0")).then_some(Self { bytes, is_big_endian })
    }

    pub(crate) fn number(&self, at: usize, n: usize) -> Option<usize> {
        let bytes = self.bytes.get(at..at.checked_add(n)?)?;
        let digits = |sum: usize, byte: &u8| sum << 8 | usize::from(*byte);
        Some(if self.is_big_endian { bytes.iter().fold(0, digits) } else { bytes.iter().rev().fold(0, digits) })
    }

    pub(crate) fn first_directory(&self) -> Option<usize> {
        self.number(4, 4)
    }

    /// Returns the place of the count of a field, behind which its value or the place of that lies.
    pub(crate) fn field(&self, directory: usize, tag: usize) -> Option<usize> {
        let n = self.number(directory, 2)?;
        (0..n).map(|i| directory + 2 + 12 * i).find(|at| self.number(*at, 2) == Some(tag)).map(|at| at + 4)
    }

    /// Returns the directory that a field of another leads to.
    fn directory(&self, directory: usize, tag: usize) -> Option<usize> {
        self.number(self.field(directory, tag)? + 4, 4)
    }

    /// Whether all fields of a directory are there, and what those lead to that count here.
    fn is_whole(&self, directory: usize) -> bool {
        const RATIONAL: usize = 5;
        const COUNTED: [u16; 5] = [FOCAL, FOCAL_ON_FILM, SUBJECT_DISTANCE, GAMMA, EXIF_DIRECTORY];
        let Some(n) = self.number(directory, 2) else { return false };
        (0..n).map(|i| directory + 2 + 12 * i).all(|at| {
            let (Some(tag), Some(kind), Some(place)) =
                (self.number(at, 2), self.number(at + 2, 2), self.number(at + 8, 4))
            else {
                return false;
            };
            let n_bytes = match kind {
                RATIONAL => 8,
                _ if tag == EXIF_DIRECTORY.into() => 2,
                _ => 0,
            };
            n_bytes == 0 || COUNTED.iter().all(|own| usize::from(*own) != tag) || self.number(place, n_bytes).is_some()
        })
    }

    /// Returns the number of a field of a whole number or of a ratio.
    fn value(&self, directory: usize, tag: usize) -> Option<f64> {
        const SHORT: usize = 3;
        const LONG: usize = 4;
        const RATIONAL: usize = 5;
        const FLOAT: usize = 11;
        const DOUBLE: usize = 12;
        let count = self.field(directory, tag)?;
        match self.number(count.checked_sub(2)?, 2)? {
            SHORT => self.number(count + 4, 2).map(|n| n as f64),
            LONG => self.number(count + 4, 4).map(|n| n as f64),
            RATIONAL => {
                let place = self.number(count + 4, 4)?;
                let (over, under) = (self.number(place, 4)? as f64, self.number(place.checked_add(4)?, 4)? as f64);
                (under > 0.0).then(|| over / under)
            }
            FLOAT => self.number(count + 4, 4).map(|bits| f64::from(f32::from_bits(bits as u32))),
            DOUBLE => self.number(self.number(count + 4, 4)?, 8).map(|bits| f64::from_bits(bits as u64)),
            _ => None,
        }
    }
}

/// What the Exif data of a picture state of its light and its geometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exif {
    /// The focal length of the lens, mm.
    pub focal_mm: Option<f64>,
    /// That of a lens with the same field of view on film of 36 mm × 24 mm, as the diagonals have it (CIPA DCG-001), mm.
    pub focal_on_film_mm: Option<f64>,
    /// How far the subject is, m.
    pub subject_distance_m: Option<f64>,
    /// The exponent of the curve from codes to light.
    pub gamma: Option<f64>,
    /// Its `ColorSpace` where that is not 1, sRGB, and no profile says what its colors are: 65 535 is uncalibrated.
    pub other_colors: Option<u16>,
    /// Whether there are such data, but no whole ones.
    pub is_damaged: bool,
    is_adobe_rgb: bool,
}

/// The fields of Exif data that count here.
const FOCAL: u16 = 0x920A;
const FOCAL_ON_FILM: u16 = 0xA405;
const SUBJECT_DISTANCE: u16 = 0x9206;
const GAMMA: u16 = 0xA500;
const COLOR_SPACE: u16 = 0xA001;
const EXIF_DIRECTORY: u16 = 0x8769;
/// The tag of XMP data in TIFF files.
const XMP: u16 = 700;

/// The diagonal of a frame of 36 mm × 24 mm, mm.
const FILM_DIAGONAL_MM: f64 = 43.266_615;

impl Exif {
    /// Returns what the Exif data of a PNG, JPEG, TIFF or WebP file state, or else its XMP data; nothing of other files.
    pub fn of(path: &Path) -> Self {
        let Ok(reader) = open(path) else { return Self::default() };
        let is_tiff = reader.format() == Some(ImageFormat::Tiff);
        let of_fields = if is_tiff { Self::of_tiff(path) } else { None };
        // What of a TIFF file is no picture has fields all the same.
        let Ok(mut decoder) = reader.into_decoder() else { return of_fields.unwrap_or_default() };
        let has_profile = decoder.icc_profile().ok().flatten().is_some_and(|profile| !profile.is_empty());
        let bytes = decoder.exif_metadata().ok().flatten();
        let own = of_fields.or_else(|| bytes.map(|bytes| Self::of_bytes(&bytes))).unwrap_or_default();
        let xmp = decoder.xmp_metadata().ok().flatten();
        let own = own.or(&xmp.map_or_else(Self::default, |bytes| Self::of_xmp(&bytes)));
        Self { other_colors: own.other_colors.filter(|_| !has_profile), ..own }
    }

    /// Returns what Exif data of these bytes state.
    pub(crate) fn of_bytes(bytes: &[u8]) -> Self {
        const INTEROPERABILITY_DIRECTORY: usize = 0xA005;
        let damaged = Self { is_damaged: true, ..Self::default() };
        let Some(fields) = TiffFields::new(bytes) else { return damaged };
        let Some(first) = fields.first_directory() else { return damaged };
        let own = fields.directory(first, EXIF_DIRECTORY.into());
        // Some writers put all fields into the first directory.
        let number =
            |tag: u16| own.and_then(|own| fields.value(own, tag.into())).or_else(|| fields.value(first, tag.into()));
        // Interoperability R03 (DCF 2.0, 2010, 4.2).
        let interoperability = own.and_then(|own| fields.directory(own, INTEROPERABILITY_DIRECTORY));
        let index = interoperability.and_then(|directory| fields.field(directory, 1));
        let is_r03 = index.is_some_and(|at| bytes.get(at + 4..at + 7) == Some(b"R03"));
        let is_whole = fields.is_whole(first) && own.is_none_or(|own| fields.is_whole(own));
        Self { is_damaged: !is_whole, ..Self::of_numbers(number, is_r03) }
    }

    /// Returns what the fields of a TIFF file state that are those of Exif, and those that it leads to; `None` where it has neither.
    fn of_tiff(path: &Path) -> Option<Self> {
        let mut decoder = Decoder::new(BufReader::new(PictureFile::open(path).ok()?)).ok()?;
        let number = |value: Option<Value>| match value? {
            Value::Rational(over, under) => (under > 0).then(|| f64::from(over) / f64::from(under)),
            Value::Float(number) => Some(number.into()),
            Value::Double(number) => Some(number),
            whole => whole.into_u32().ok().map(f64::from),
        };
        let wanted = [FOCAL, FOCAL_ON_FILM, SUBJECT_DISTANCE, GAMMA, COLOR_SPACE];
        let mut found = wanted.map(|tag| number(decoder.find_tag(Tag::Unknown(tag)).ok().flatten()));
        let mut is_damaged = false;
        let xmp =
            decoder.get_tag_u8_vec(Tag::Unknown(XMP)).map_or_else(|_| Self::default(), |bytes| Self::of_xmp(&bytes));
        if let Ok(Some(place)) = decoder.find_tag_unsigned::<u64>(Tag::Unknown(EXIF_DIRECTORY)) {
            match decoder.read_directory(IfdPointer(place)) {
                Ok(directory) => {
                    let mut fields = decoder.read_directory_tags(&directory);
                    for (tag, own) in wanted.into_iter().zip(&mut found) {
                        let field = fields.find_tag(Tag::Unknown(tag));
                        is_damaged |= field.is_err();
                        *own = number(field.ok().flatten()).or(*own);
                    }
                }
                Err(_) => is_damaged = true,
            }
        }
        let of = |tag: u16| wanted.into_iter().zip(found).find(|(own, _)| *own == tag).and_then(|(_, own)| own);
        let own = Self { is_damaged, ..Self::of_numbers(of, false) }.or(&xmp);
        (own != Self::default()).then_some(own)
    }

    fn of_numbers(number: impl Fn(u16) -> Option<f64>, is_r03: bool) -> Self {
        let above_0 = |tag| number(tag).filter(|v| v.is_finite() && *v > 0.0);
        // No sRGB (`ColorSpace` 65535), and interoperability R03; or 2, as many cameras have it.
        let color_space = number(COLOR_SPACE);
        Self {
            focal_mm: above_0(FOCAL),
            focal_on_film_mm: above_0(FOCAL_ON_FILM),
            subject_distance_m: above_0(SUBJECT_DISTANCE),
            gamma: above_0(GAMMA),
            other_colors: color_space.filter(|own| *own != 1.0).map(|own| own as u16),
            is_damaged: false,
            is_adobe_rgb: color_space == Some(2.0) || color_space == Some(65_535.0) && is_r03,
        }
    }

    /// Returns what XMP data state in the words of Exif ("XMP Specification Part 2", 2016, 3.2).
    fn of_xmp(bytes: &[u8]) -> Self {
        let all = xmp_properties(bytes);
        let number = |name: &str| {
            let own =
                all.iter().find(|(own, _)| own.strip_prefix("exif:").or(own.strip_prefix("exifEX:")) == Some(name));
            own.and_then(|(_, text)| number_of(text)).filter(|v| *v > 0.0)
        };
        Self {
            focal_mm: number("FocalLength"),
            focal_on_film_mm: number("FocalLengthIn35mmFilm"),
            subject_distance_m: number("SubjectDistance"),
            gamma: number("Gamma"),
            other_colors: number("ColorSpace").filter(|own| *own != 1.0).map(|own| own as u16),
            is_damaged: false,
            is_adobe_rgb: false,
        }
    }

    /// Takes from another what it does not state itself.
    fn or(self, other: &Self) -> Self {
        Self {
            focal_mm: self.focal_mm.or(other.focal_mm),
            focal_on_film_mm: self.focal_on_film_mm.or(other.focal_on_film_mm),
            subject_distance_m: self.subject_distance_m.or(other.subject_distance_m),
            gamma: self.gamma.or(other.gamma),
            other_colors: self.other_colors.or(other.other_colors),
            is_damaged: self.is_damaged,
            is_adobe_rgb: self.is_adobe_rgb,
        }
    }

    /// Whether the codes are those of Adobe RGB.
    pub fn is_adobe_rgb(self) -> bool {
        self.is_adobe_rgb
    }

    /// Returns how wide a picture of so many columns and rows is by the focal length on film, degrees.
    pub fn horizontal_fov_deg(self, columns: usize, rows: usize) -> Option<f64> {
        let (columns, rows) = (columns as f64, rows as f64);
        let width_mm = FILM_DIAGONAL_MM * columns / columns.hypot(rows);
        self.focal_on_film_mm.map(|focal_mm| 2.0 * (0.5 * width_mm / focal_mm).atan().to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_camera_are_read_in_either_order() {
        // A first directory with a pointer to the second at 26, which has a short, a ratio at 56 and a short again.
        for big in [false, true] {
            let n = |value: u32, n: usize| {
                let all = value.to_be_bytes();
                let mut bytes = all[4 - n..].to_vec();
                if !big {
                    bytes.reverse();
                }
                bytes
            };
            let short = |tag: u32, value: u32| [n(tag, 2), n(3, 2), n(1, 4), n(value, 2), n(0, 2)].concat();
            let long = |tag: u32, kind: u32, value: u32| [n(tag, 2), n(kind, 2), n(1, 4), n(value, 4)].concat();
            let head = if big { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
            let bytes = [
                head,
                n(8, 4),
                n(1, 2),
                long(0x8769, 4, 26),
                n(0, 4),
                n(2, 2),
                long(0x920A, 5, 56),
                short(0xA405, 50),
                n(0, 4),
                n(333, 4),
                n(10, 4),
            ]
            .concat();
            let exif = Exif::of_bytes(&bytes);
            assert_eq!((exif.focal_mm, exif.focal_on_film_mm, exif.gamma), (Some(33.3), Some(50.0), None));
            // 36 mm at 50 mm.
            let fov_deg = exif.horizontal_fov_deg(3000, 2000).unwrap();
            assert!((fov_deg - 39.5978).abs() < 1e-3 && !exif.is_adobe_rgb(), "{fov_deg}");
            for (space, other, is_adobe) in [(1, None, false), (2, Some(2), true), (65_535, Some(65_535), false)] {
                let bytes = [&bytes[..8], &n(1, 2), &short(0xA001, space), &n(0, 4)].concat();
                let exif = Exif::of_bytes(&bytes);
                assert_eq!((exif.other_colors, exif.is_adobe_rgb()), (other, is_adobe), "{space}");
            }
            assert!(!exif.is_damaged);
            for end in 0..bytes.len() {
                assert!(Exif::of_bytes(&bytes[..end]).is_damaged, "{end}");
            }
        }
    }
}
