//! Files of pictures, read and written.
#![doc = include_str!("../README.md")]

use std::{
    io::{self, Cursor},
    path::Path,
};

use image::{ExtendedColorType, ImageEncoder, ImageReader, codecs::png::PngEncoder};

pub use image::{DynamicImage, ImageError, ImageFormat, Limits};

/// Returns the format of a file by its first bytes, or by the extension of its name where they say nothing.
///
/// # Errors
/// When the file cannot be read.
pub fn format_of(path: &Path) -> io::Result<Option<ImageFormat>> {
    Ok(ImageReader::open(path)?.with_guessed_format()?.format())
}

/// Reads a picture of any format that is compiled in.
///
/// # Errors
/// When the file cannot be read, is no such picture, or is larger than the limits.
pub fn read(path: &Path, limits: Limits) -> Result<DynamicImage, ImageError> {
    let mut reader = ImageReader::open(path)?.with_guessed_format()?;
    reader.limits(limits);
    reader.decode()
}

/// Returns a picture as the bytes of a file.
///
/// # Errors
/// When the format is not compiled in, or has no such samples.
pub fn encode(picture: &DynamicImage, format: ImageFormat) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format)?;
    Ok(bytes.into_inner())
}

/// Returns codes of red, green and blue, pixel by pixel in rows, as the bytes of a PNG file of so many columns and rows.
///
/// # Errors
/// When there is no pixel, or too many.
///
/// # Panics
/// When there are not three codes a pixel.
pub fn encode_rgb8_png(codes: &[u8], (columns, rows): (usize, usize)) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(codes, columns as u32, rows as u32, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

/// Writes a picture in the format of the path's extension.
///
/// # Errors
/// When the format is not known or has no such samples, or the file cannot be written; what was written of it stays.
pub fn save(picture: &DynamicImage, path: &Path) -> Result<(), ImageError> {
    let format = ImageFormat::from_path(path)?;
    Ok(std::fs::write(path, encode(picture, format)?)?)
}
