//! Pictures and raw frames as PNG and TIFF files.

use std::path::Path;

use dioptric_files::WriteError;
use dioptric_pictures::{CodeSpace, DynamicImage, ImageFormat, encode, encode_in};
use image::ImageBuffer;

use crate::{Picture, Raw, RawPlane, SensorError};

/// What frames of digital numbers are written as.
const A_PICTURE: &str = "a 16-bit picture";

/// How many bits a file has for each code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8.
    Eight,
    /// 16.
    Sixteen,
}

impl Picture {
    /// Writes the picture as PNG or TIFF, by the path's extension, with the profile of its colors.
    ///
    /// # Errors
    /// When the extension is another or the file cannot be written; then there is no file.
    pub fn write(&self, path: &Path, depth: Depth) -> Result<(), SensorError> {
        let (width, height) = (self.columns() as u32, self.rows() as u32);
        let image = match depth {
            Depth::Eight => ImageBuffer::from_raw(width, height, self.to_rgb8()).map(DynamicImage::ImageRgb8),
            Depth::Sixteen => ImageBuffer::from_raw(width, height, self.to_rgb16()).map(DynamicImage::ImageRgb16),
        };
        write_image(path, &image.expect("three codes a pixel"), Some(self.space.of_file()))
    }
}

impl Raw {
    /// Writes the digital numbers of a mosaic or monochrome frame as 16-bit gray PNG or TIFF, by the path's extension.
    ///
    /// The codes are those of the converter, not stretched.
    ///
    /// # Errors
    /// When the frame is in volts or has stacked filters, the extension is another or the file cannot be written; then
    /// there is no file.
    pub fn write(&self, path: &Path) -> Result<(), SensorError> {
        match self.planes.as_slice() {
            [plane @ RawPlane::Dn(_)] => plane.write(path),
            _ => Err(self.without_numbers(A_PICTURE)),
        }
    }

    /// Returns the error of a frame that has no plane of digital numbers.
    pub(crate) fn without_numbers(&self, what: &'static str) -> SensorError {
        match self.planes.as_slice() {
            [plane] | [plane @ (RawPlane::Volts(_) | RawPlane::Evened(_)), ..] => plane.without_numbers(what),
            _ => needs_numbers(what, "several planes, from a sensor of stacked filters"),
        }
    }
}

impl RawPlane {
    /// Writes the digital numbers as [`Raw::write`] does those of a frame.
    ///
    /// # Errors
    /// When the samples are no digital numbers, the extension is another or the file cannot be written; then there is no file.
    pub fn write(&self, path: &Path) -> Result<(), SensorError> {
        let dn = self.dn().ok_or_else(|| self.without_numbers(A_PICTURE))?;
        let codes: Vec<u16> = dn.iter().copied().collect();
        let image = ImageBuffer::from_raw(dn.ncols() as u32, dn.nrows() as u32, codes).map(DynamicImage::ImageLuma16);
        write_image(path, &image.expect("one code a pixel"), None)
    }

    fn without_numbers(&self, what: &'static str) -> SensorError {
        let found = match self {
            Self::Volts(_) => "volts, from a sensor without converter",
            Self::Evened(_) => "numbers whose levels were evened out",
            Self::Dn(_) => "digital numbers",
        };
        needs_numbers(what, found)
    }
}

fn needs_numbers(what: &'static str, found: &str) -> SensorError {
    SensorError::Unsuitable { what, reason: format!("needs one plane of digital numbers, but the frame has {found}") }
}

/// Writes a picture of colors, or codes that are none.
fn write_image(path: &Path, image: &DynamicImage, space: Option<CodeSpace>) -> Result<(), SensorError> {
    let format = match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("png") => ImageFormat::Png,
        Some("tif" | "tiff") => ImageFormat::Tiff,
        _ => return Err(write_error(path, "the extension must be png, tif or tiff")),
    };
    let bytes = match space {
        Some(space) => encode_in(image, format, space),
        None => encode(image, format),
    };
    Ok(dioptric_files::write(path, &bytes.map_err(|e| write_error(path, e))?)?)
}

impl From<WriteError> for SensorError {
    fn from(WriteError { path, reason, .. }: WriteError) -> Self {
        Self::Write { path, reason }
    }
}

pub(crate) fn write_error(path: &Path, reason: impl std::fmt::Display) -> SensorError {
    SensorError::Write { path: path.to_owned(), reason: reason.to_string() }
}
