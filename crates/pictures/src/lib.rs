//! Files of pictures, read and written.
#![doc = include_str!("../README.md")]

mod bmp;
mod colors;
mod exif;
mod open;
mod reduced;
mod tagged;
mod xmp;

use std::{
    fs,
    io::{self, BufRead, Cursor, Seek},
    path::Path,
};

use dioptric_files::memory;
use image::{ExtendedColorType, ImageDecoder, ImageReader};

pub use colors::StatedColors;
pub use exif::Exif;
pub use image::{DynamicImage, ImageError, ImageFormat, Limits};
pub use open::{PictureFile, is_xyze, open, orientation_of};
pub use reduced::{Curve, read_reduced};
pub use tagged::{CodeSpace, encode_in};
pub use xmp::xmp_properties;

/// Returns the format of a file by its first bytes, or by the extension of its name where they say nothing.
///
/// # Errors
/// When the file cannot be read.
pub fn format_of(path: &Path) -> io::Result<Option<ImageFormat>> {
    Ok(open(path)?.format())
}

/// Returns the columns and rows of a picture from its header.
///
/// # Errors
/// When the file cannot be read or is no such picture.
pub fn size_of(path: &Path) -> Result<(usize, usize), ImageError> {
    let mut reader = open(path)?;
    // Whoever reads its samples checks what they take.
    reader.limits(Limits::no_limits());
    let (columns, rows) = reader.into_decoder()?.dimensions();
    Ok((columns as usize, rows as usize))
}

/// Reads a picture of any format that is compiled in, after its header was found to fit the memory that a file may take: its samples, and
/// `beside_bytes` for each pixel that its reader makes of them. X, Y and Z of a Radiance picture become linear red, green and blue of sRGB.
///
/// # Errors
/// When the file cannot be read, is no such picture, or takes more memory than it may.
pub fn read_within(path: &Path, beside_bytes: u64) -> Result<DynamicImage, ImageError> {
    let n_bytes = fs::metadata(path)?.len();
    check_numbers(path)?;
    let picture = decoded(open(path)?, n_bytes, beside_bytes)?;
    Ok(if is_xyze(path) { of_xyz(picture) } else { picture })
}

/// Makes linear sRGB of X, Y and Z, of which the white of D65 has a Y of 1 (IEC 61966-2-1).
fn of_xyz(picture: DynamicImage) -> DynamicImage {
    const SRGB_FROM_XYZ: [[f64; 3]; 3] = [
        [3.240_454_162_114_103, -1.537_138_512_797_716, -0.498_531_409_556_016],
        [-0.969_266_030_505_187, 1.876_010_845_446_694, 0.041_556_017_530_350],
        [0.055_643_430_959_115, -0.204_025_913_516_754, 1.057_225_188_223_179],
    ];
    let mut picture = picture.into_rgb32f();
    for pixel in picture.pixels_mut() {
        let xyz = pixel.0.map(f64::from);
        pixel.0 = SRGB_FROM_XYZ.map(|row| row.iter().zip(xyz).map(|(m, v)| m * v).sum::<f64>() as f32);
    }
    picture.into()
}

/// Refuses a TIFF file of colors of whole numbers of 32 bits, which what decodes it takes for floats.
fn check_numbers(path: &Path) -> Result<(), ImageError> {
    const WHOLE: u16 = 1;
    if format_of(path)? != Some(ImageFormat::Tiff) {
        return Ok(());
    }
    // Whoever decodes a broken file says what is wrong with it.
    let Ok(mut decoder) = tiff::decoder::Decoder::new(io::BufReader::new(PictureFile::open(path)?)) else {
        return Ok(());
    };
    let mut first =
        |tag| decoder.find_tag_unsigned_vec::<u16>(tag).ok().flatten().and_then(|list| list.first().copied());
    let (bits, format) = (first(tiff::tags::Tag::BitsPerSample), first(tiff::tags::Tag::SampleFormat));
    if bits == Some(32) && format.unwrap_or(WHOLE) == WHOLE {
        let reason = "its samples are whole numbers of 32 bits, expected those of 8 or 16 bits, or floats";
        return Err(ImageError::IoError(io::Error::other(reason)));
    }
    Ok(())
}

/// Reads a picture from the bytes of a file, as [`read_within`] does.
///
/// # Errors
/// When they are no such picture, or it takes more memory than it may.
pub fn decode_within(bytes: &[u8], beside_bytes: u64) -> Result<DynamicImage, ImageError> {
    decoded(ImageReader::new(Cursor::new(bytes)).with_guessed_format()?, bytes.len() as u64, beside_bytes)
}

fn decoded<R: BufRead + Seek>(
    mut reader: ImageReader<R>,
    n_bytes: u64,
    beside_bytes: u64,
) -> Result<DynamicImage, ImageError> {
    reader.limits(Limits::no_limits());
    let decoder = reader.into_decoder()?;
    let (columns, rows) = decoder.dimensions();
    let beside = beside_bytes.saturating_mul(u64::from(columns)).saturating_mul(u64::from(rows));
    let too_large = |error| ImageError::IoError(io::Error::other(error));
    memory::check(decoder.total_bytes().saturating_add(beside), n_bytes).map_err(too_large)?;
    DynamicImage::from_decoder(decoder)
}

/// Reads a picture of any format that is compiled in, whatever memory it takes within the limits: one of the program's own.
///
/// # Errors
/// When the file cannot be read, is no such picture, or is larger than the limits.
pub fn read(path: &Path, limits: Limits) -> Result<DynamicImage, ImageError> {
    let mut reader = open(path)?;
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

/// Returns codes of red, green and blue, pixel by pixel in rows, as the bytes of a PNG file of so many columns and rows, whose colors are those
/// of sRGB.
///
/// # Errors
/// When there is no pixel, or too many.
///
/// # Panics
/// When there are not three codes a pixel.
pub fn encode_rgb8_png(codes: &[u8], (columns, rows): (usize, usize)) -> Result<Vec<u8>, ImageError> {
    encode_rgb8_png_in(codes, (columns, rows), CodeSpace::Srgb)
}

/// Returns such codes of other colors as the bytes of a PNG file.
///
/// # Errors
/// When there is no pixel, or too many.
///
/// # Panics
/// When there are not three codes a pixel.
pub fn encode_rgb8_png_in(
    codes: &[u8],
    (columns, rows): (usize, usize),
    space: CodeSpace,
) -> Result<Vec<u8>, ImageError> {
    let size = (columns as u32, rows as u32);
    tagged::encode_samples(codes, size, ExtendedColorType::Rgb8, (ImageFormat::Png, space))
}

/// Writes a picture in the format of the path's extension.
///
/// # Errors
/// When the format is not known or has no such samples, or the file cannot be written.
pub fn save(picture: &DynamicImage, path: &Path) -> Result<(), ImageError> {
    let format = ImageFormat::from_path(path)?;
    let bytes = encode(picture, format)?;
    dioptric_files::write(path, &bytes).map_err(|error| ImageError::IoError(io::Error::other(error)))
}
