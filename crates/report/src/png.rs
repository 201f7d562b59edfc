//! Pictures as PNG.

use dioptric_pipeline::PipelineError;
use image::RgbImage;

/// Returns a picture as the bytes of a PNG file.
pub(crate) fn png_bytes(picture: &RgbImage) -> Result<Vec<u8>, PipelineError> {
    dioptric_pictures::encode_rgb8_png(picture, (picture.width() as usize, picture.height() as usize))
        .map_err(|e| PipelineError::Png { reason: e.to_string() })
}

/// Returns the picture enlarged by a whole number, samples staying sharp.
pub(crate) fn enlarged(picture: &RgbImage, factor: u32) -> RgbImage {
    RgbImage::from_fn(picture.width() * factor, picture.height() * factor, |x, y| {
        *picture.get_pixel(x / factor, y / factor)
    })
}
