//! Pictures as PNG.

use dioptric_pipeline::PipelineError;
use image::{ImageEncoder, RgbImage, codecs::png::PngEncoder};

/// Returns a picture as the bytes of a PNG file.
pub(crate) fn png_bytes(picture: &RgbImage) -> Result<Vec<u8>, PipelineError> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8)
        .map_err(|e| PipelineError::Png { reason: e.to_string() })?;
    Ok(bytes)
}

/// Returns the picture enlarged by a whole number, samples staying sharp.
pub(crate) fn enlarged(picture: &RgbImage, factor: u32) -> RgbImage {
    RgbImage::from_fn(picture.width() * factor, picture.height() * factor, |x, y| {
        *picture.get_pixel(x / factor, y / factor)
    })
}
