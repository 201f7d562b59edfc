//! Ordinary sRGB pictures, lifted to spectra through a display's primaries.

use std::path::Path;

use dioptric_spectrum::{Display, Quantity, SpectralImage, WavelengthGrid, srgb_decode};
use image::{DynamicImage, ImageReader, Limits};
use ndarray::Array2;
use rayon::prelude::*;

use super::beside::unreadable;
use crate::SceneError;

/// Reads a PNG, JPEG or TIFF picture of 8 or 16 bits as the radiance of a display that shows it.
///
/// The picture's white has the luminance `white_cd_m2`. A colour beyond the display's gamut is clipped at 0 in the
/// bands where it would need negative light.
///
/// # Errors
/// When the file is no such picture, or too large.
pub fn read_picture(
    path: &Path,
    display: &Display,
    grid: &WavelengthGrid,
    white_cd_m2: f64,
) -> Result<SpectralImage, SceneError> {
    if !(white_cd_m2.is_finite() && white_cd_m2 > 0.0) {
        return Err(SceneError::Setting {
            what: "the luminance of the picture's white",
            value: format!("{white_cd_m2} cd/m²"),
            expected: "a finite number above 0".to_owned(),
        });
    }
    let picture = decode(path)?.into_rgb16();
    let (columns, rows) = (picture.width() as usize, picture.height() as usize);
    let linear: Vec<f64> = (0..=u16::MAX).map(|code| srgb_decode(f64::from(code) / 65535.0)).collect();
    let basis = display.srgb_basis(grid, white_cd_m2);
    let pixels: Vec<[f64; 3]> = picture.pixels().map(|p| p.0.map(|code| linear[usize::from(code)])).collect();
    let planes = (0..grid.len())
        .into_par_iter()
        .map(|band| {
            let [r, g, b] = [0, 1, 2].map(|i| basis[i][band]);
            let samples = pixels.iter().map(|p| (r * p[0] + g * p[1] + b * p[2]).max(0.0) as f32).collect();
            Array2::from_shape_vec((rows, columns), samples).expect("a sample a pixel")
        })
        .collect();
    SpectralImage::new(Quantity::Radiance, grid.clone(), planes)
        .map_err(|source| SceneError::Values { file: path.to_owned(), source })
}

/// Decodes a picture of any kind that the file's content tells.
pub(crate) fn decode(path: &Path) -> Result<DynamicImage, SceneError> {
    let mut reader =
        ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(|error| unreadable(path, error))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(4 << 30);
    limits.max_image_width = Some(1 << 17);
    limits.max_image_height = Some(1 << 17);
    reader.limits(limits);
    reader.decode().map_err(|error| unreadable(path, error.to_string().replace('\n', " ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use dioptric_spectrum::{Observer, Xyz};
    use image::{ImageBuffer, Rgb};

    #[test]
    fn colours_survive_the_lift() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let codes = [[255_u8, 255, 255], [200, 120, 80], [0, 0, 0]];
        ImageBuffer::from_fn(3, 1, |x, _| Rgb(codes[x as usize])).save(&path).unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let lifted = read_picture(&path, &Display::apple_studio(), &grid, 80.0).unwrap();
        for (column, code) in codes.iter().enumerate() {
            let xyz = Observer::Cie1931.xyz(&grid, &lifted.spectrum_at(0, column));
            let rgb = Xyz(xyz.0.map(|v| v / 80.0)).to_linear_srgb();
            for i in 0..3 {
                // Samples are f32, and the sRGB matrices are each other's inverse to 1e-6.
                assert_abs_diff_eq!(rgb[i], srgb_decode(f64::from(code[i]) / 255.0), epsilon = 1e-5);
            }
        }
        assert!(read_picture(&path, &Display::apple_studio(), &grid, f64::NAN).is_err());
    }

    #[test]
    fn sixteen_bits_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        ImageBuffer::from_fn(2, 1, |x, _| Rgb([30_000_u16 + x as u16; 3])).save(&path).unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 50.0).unwrap();
        let lifted = read_picture(&path, &Display::apple_studio(), &grid, 100.0).unwrap();
        assert!(lifted.spectrum_at(0, 1)[3] > lifted.spectrum_at(0, 0)[3]);
    }

    #[test]
    fn a_broken_picture_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("broken.jpg");
        std::fs::write(&path, b"\xff\xd8\xff\xe0 no more").unwrap();
        let message = decode(&path).unwrap_err().to_string();
        assert!(message.contains("broken.jpg: cannot be read"), "{message}");
    }
}
