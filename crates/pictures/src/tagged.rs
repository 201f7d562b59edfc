//! Pictures that say which colors their codes stand for: with an ICC profile, which PNG and TIFF both carry.

use std::{
    io::{self, Cursor},
    sync::LazyLock,
};

use image::{
    DynamicImage, ExtendedColorType, ImageEncoder, ImageError, ImageFormat,
    codecs::{png::PngEncoder, tiff::TiffEncoder},
};
use moxcms::ColorProfile;

/// The colors of a picture's codes; both have the curve of sRGB and white D65.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CodeSpace {
    /// sRGB (IEC 61966-2-1).
    #[default]
    Srgb,
    /// The primaries of Display P3.
    DisplayP3,
}

/// Where a profile has the date at which it was made (ICC.1:2022, 7.2), and the one that ours have, so that equal pictures are equal files:
/// the first of January 2026.
const DATE: std::ops::Range<usize> = 24..36;
const DATE_BYTES: [u8; 12] = [7, 234, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0];

impl CodeSpace {
    /// Returns the ICC profile of the space.
    pub fn icc_profile(self) -> Vec<u8> {
        static PROFILES: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
            [ColorProfile::new_srgb(), ColorProfile::new_display_p3()].map(|mut profile| {
                // Its numbers name the white of cinemas for Display P3; primaries and curve say all.
                profile.cicp = None;
                let mut bytes = profile.encode().expect("the profiles of the crate can be written");
                bytes[DATE].copy_from_slice(&DATE_BYTES);
                bytes
            })
        });
        PROFILES[usize::from(self == Self::DisplayP3)].clone()
    }
}

/// Returns a picture as the bytes of a PNG or TIFF file that says which colors its codes are.
///
/// # Errors
/// When the format is another, or has no such samples.
pub fn encode_in(picture: &DynamicImage, format: ImageFormat, space: CodeSpace) -> Result<Vec<u8>, ImageError> {
    let (samples, size) = (picture.as_bytes(), (picture.width(), picture.height()));
    encode_samples(samples, size, picture.color().into(), (format, space))
}

/// Returns samples in the order of the machine's bytes as such a file.
pub(crate) fn encode_samples(
    samples: &[u8],
    (columns, rows): (u32, u32),
    color: ExtendedColorType,
    (format, space): (ImageFormat, CodeSpace),
) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    let other = |reason: String| ImageError::IoError(io::Error::other(reason));
    match format {
        ImageFormat::Png => {
            let mut encoder = PngEncoder::new(&mut bytes);
            encoder.set_icc_profile(space.icc_profile()).map_err(|error| other(error.to_string()))?;
            encoder.write_image(samples, columns, rows, color)?;
        }
        ImageFormat::Tiff => {
            let mut encoder = TiffEncoder::new(&mut bytes);
            encoder.set_icc_profile(space.icc_profile()).map_err(|error| other(error.to_string()))?;
            encoder.write_image(samples, columns, rows, color)?;
        }
        _ => return Err(other("only PNG and TIFF files say here which colors they have".to_owned())),
    }
    Ok(bytes.into_inner())
}
