//! A quick look at a spectral image as an sRGB picture.

use std::path::Path;

use dioptric_pictures::encode_rgb8_png;
use dioptric_spectrum::{Observer, SpectralImage, Xyz, adapt_bradford, srgb_encode};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{SceneError, formats::unwritable};

/// Returns an image as sRGB codes, the color `white` becoming white and what is brighter being clipped.
///
/// The eye's observer stands in for a camera here: this is a look at the data, not a simulated picture.
pub fn srgb_preview(image: &SpectralImage, white: Xyz) -> Array2<[u8; 3]> {
    let weights = Observer::Cie1931.weights(image.grid());
    let luminance = white.luminance_cd_m2();
    let relative_white = Xyz(white.0.map(|v| v / luminance));
    let columns = image.columns();
    let codes: Vec<[u8; 3]> = (0..image.rows())
        .into_par_iter()
        .flat_map_iter(|row| {
            let weights = &weights;
            (0..columns).map(move |column| {
                let mut xyz = [0.0; 3];
                for (band, plane) in image.planes().iter().enumerate() {
                    let value = f64::from(plane[(row, column)]) / luminance;
                    (0..3).for_each(|i| xyz[i] += weights[i][band] * value);
                }
                let rgb = adapt_bradford(Xyz(xyz), relative_white, Xyz::D65).to_linear_srgb();
                rgb.map(|v| (255.0 * srgb_encode(v)).round() as u8)
            })
        })
        .collect();
    Array2::from_shape_vec((image.rows(), columns), codes).expect("a code a sample")
}

/// Writes [`srgb_preview`] as a PNG.
///
/// # Errors
/// When the file cannot be written; it is then not there.
pub fn write_preview_png(path: &Path, image: &SpectralImage, white: Xyz) -> Result<(), SceneError> {
    let codes: Vec<u8> = srgb_preview(image, white).into_iter().flatten().collect();
    let png = encode_rgb8_png(&codes, (image.columns(), image.rows())).map_err(|error| unwritable(path, error))?;
    Ok(dioptric_files::write(path, &png)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pattern, Target, TargetLight};
    use dioptric_spectrum::{Illuminant, WavelengthGrid};

    #[test]
    fn white_is_white_and_half_of_it_is_code_188() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let target = Target {
            pattern: Pattern::Checkerboard { check_px: 4 },
            dark: 0.5,
            light: TargetLight::Illuminant(Illuminant::A),
            ..Target::paper_checkerboard()
        };
        let scene = target.scene(&grid).unwrap();
        let white = Observer::Cie1931.xyz(&grid, &scene.radiance.spectrum_at(0, 4));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_preview_png(&path, &scene.radiance, white).unwrap();
        let back = dioptric_pictures::read(&path, dioptric_pictures::Limits::no_limits()).unwrap().into_rgb8();
        // sRGB 1.055 × 0.5^(1/2.4) − 0.055 = 0.7354.
        assert_eq!((back.get_pixel(4, 0).0, back.get_pixel(0, 0).0), ([255; 3], [188; 3]));
        assert!(write_preview_png(&path.join("no/a.png"), &scene.radiance, white).is_err());
    }
}
