//! Ordinary sRGB pictures, lifted to spectra through a display's primaries.

use std::path::Path;

use dioptric_pictures::{Curve, DynamicImage, ImageError, read_reduced, size_of};
use dioptric_spectrum::{Display, Quantity, SpectralImage, WavelengthGrid, srgb_decode, srgb_encode};
use image::{ImageDecoder, metadata::Orientation};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    stated::{name_of, note_of},
    unusable::{check_made, unreadable},
};
use crate::SceneError;

/// Pixels that are lifted to spectra at a time.
const AT_ONCE: usize = 1 << 13;

/// What a pixel takes as codes of 16 bits while it is lifted to bands, bytes.
const CODES_BYTES: u64 = 6;
/// What a pixel takes as planes of single floats beside its codes, bytes.
const SAMPLES_BYTES: u64 = 15;

/// Reads a PNG, JPEG or TIFF picture of 8 or 16 bits as the radiance of a display that shows it.
///
/// The picture's white has the luminance `white_cd_m2`. A color beyond the display's gamut is clipped at 0 in the
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
    lifted_codes(path, oriented(path, None)?.0, &display.srgb_basis(grid, white_cd_m2), grid)
}

/// Returns the light of a picture of sRGB codes: sums of the spectra of red, green and blue. What would need negative light is 0.
pub(super) fn lifted_codes(
    path: &Path,
    picture: DynamicImage,
    basis: &[Vec<f64>; 3],
    grid: &WavelengthGrid,
) -> Result<SpectralImage, SceneError> {
    let n = u64::from(picture.width()) * u64::from(picture.height());
    check_made(path, (4 * grid.len() as u64 + CODES_BYTES).saturating_mul(n))?;
    let picture = picture.into_rgb16();
    let (columns, rows) = (picture.width() as usize, picture.height() as usize);
    let linear: Vec<f64> = (0..=u16::MAX).map(|code| srgb_decode(f64::from(code) / 65535.0)).collect();
    let mut planes: Vec<Array2<f32>> = (0..grid.len()).map(|_| Array2::zeros((rows, columns))).collect();
    // A part of the picture in all bands before the next, while its colors are at hand.
    let mut parts: Vec<Vec<&mut [f32]>> = (0..(rows * columns).div_ceil(AT_ONCE)).map(|_| vec![]).collect();
    for plane in &mut planes {
        let samples = plane.as_slice_mut().expect("a new plane is in standard order");
        parts.iter_mut().zip(samples.chunks_mut(AT_ONCE)).for_each(|(part, samples)| part.push(samples));
    }
    parts.into_par_iter().zip(picture.as_raw().par_chunks(3 * AT_ONCE)).for_each(|(bands, codes)| {
        let colors = [0, 1, 2].map(|color| -> Vec<f64> {
            codes.iter().skip(color).step_by(3).map(|&code| linear[usize::from(code)]).collect()
        });
        for (band, samples) in bands.into_iter().enumerate() {
            lift(&colors, [0, 1, 2].map(|color| basis[color][band]), samples);
        }
    });
    Ok(SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?)
}

/// Puts the radiance of colors in a band into `samples`.
fn lift([red, green, blue]: &[Vec<f64>; 3], [r, g, b]: [f64; 3], samples: &mut [f32]) {
    for (((sample, red), green), blue) in samples.iter_mut().zip(red).zip(green).zip(blue) {
        *sample = (r * red + g * green + b * blue).max(0.0) as f32;
    }
}

/// Returns the light of linear sRGB colors, as [`lifted_codes`]; colors above 1 are brighter in proportion.
pub(super) fn lifted(
    rgb: &[Array2<f32>; 3],
    basis: &[Vec<f64>; 3],
    grid: &WavelengthGrid,
) -> Result<SpectralImage, SceneError> {
    let planes = (0..grid.len())
        .into_par_iter()
        .map(|band| {
            let mut sum = Array2::<f64>::zeros(rgb[0].dim());
            for (color, basis) in rgb.iter().zip(basis) {
                ndarray::Zip::from(&mut sum).and(color).for_each(|sum, &v| *sum += basis[band] * f64::from(v));
            }
            sum.mapv(|v| v.max(0.0) as f32)
        })
        .collect();
    Ok(SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?)
}

/// Returns the columns and rows of a picture.
pub(super) fn picture_size_of(path: &Path) -> Result<(usize, usize), SceneError> {
    size_of(path).map_err(|error| undecodable(path, &error))
}

/// Reads a picture upright, as its orientation says, with notes of what else it states of its colors; of means over blocks where it has
/// more pixels than `size`, columns and rows.
///
/// # Errors
/// As [`decode`].
pub(super) fn oriented(path: &Path, size: Option<(usize, usize)>) -> Result<(DynamicImage, Vec<String>), SceneError> {
    let mut picture = match size {
        Some(size) => {
            let curve = Curve {
                to_light: &|code| srgb_decode(f64::from(code) / 65535.0),
                to_code: &|light| (65535.0 * srgb_encode(light)).round() as u16,
            };
            read_reduced(path, size, &curve).map_err(|error| undecodable(path, &error))?
        }
        None => decode(path, CODES_BYTES)?,
    };
    let (orientation, mut notes) = stated_beside(path);
    if orientation != Orientation::NoTransforms {
        picture.apply_orientation(orientation);
        notes.insert(0, format!("{}: it is turned upright, as its orientation says", name_of(path)));
    }
    if picture.color().has_alpha() {
        let opaque = match &picture {
            DynamicImage::ImageLumaA8(p) => p.pixels().all(|p| p.0[1] == u8::MAX),
            DynamicImage::ImageRgba8(p) => p.pixels().all(|p| p.0[3] == u8::MAX),
            DynamicImage::ImageLumaA16(p) => p.pixels().all(|p| p.0[1] == u16::MAX),
            DynamicImage::ImageRgba16(p) => p.pixels().all(|p| p.0[3] == u16::MAX),
            _ => false,
        };
        if !opaque {
            notes.extend(note_of(path, "channel", &["opacity".to_owned()]));
        }
    }
    Ok((picture, notes))
}

/// Returns the orientation that a picture states, and notes of its color space.
fn stated_beside(path: &Path) -> (Orientation, Vec<String>) {
    let reader = image::ImageReader::open(path).ok().and_then(|reader| reader.with_guessed_format().ok());
    let Some(mut decoder) = reader.and_then(|reader| reader.into_decoder().ok()) else {
        return (Orientation::NoTransforms, vec![]);
    };
    // The name of the usual profile stands in its text, of one byte a letter or of two.
    let profile = decoder.icc_profile().ok().flatten();
    let says_srgb = |profile: &Vec<u8>| {
        [&b"sRGB"[..], b"s\0R\0G\0B"].iter().any(|name| profile.windows(name.len()).any(|at| at == *name))
    };
    let mut notes = vec![];
    if profile.is_some_and(|profile| !profile.is_empty() && !says_srgb(&profile)) {
        let own = ["ICC profile".to_owned()];
        notes.extend(note_of(path, "color space", &own).map(|note| note + ": its codes are taken as sRGB"));
    }
    (decoder.orientation().unwrap_or(Orientation::NoTransforms), notes)
}

/// Returns what of a picture's statements [`read_picture_samples`] does not use, a sentence each.
pub fn notes_on_samples(path: &Path) -> Vec<String> {
    let (orientation, mut notes) = stated_beside(path);
    if orientation != Orientation::NoTransforms {
        notes.push(format!("{}: its pixels are counted as stored, not turned as its orientation says", name_of(path)));
    }
    notes
}

/// Returns what a picture's samples are, in words.
pub(super) fn kind_of(picture: &DynamicImage) -> String {
    let color = picture.color();
    let bits = 8 * u16::from(color.bytes_per_pixel()) / u16::from(color.channel_count());
    let what = if color.has_color() { "sRGB" } else { "gray" };
    format!("{what} of {bits} bits")
}

/// The samples of a picture as they stand in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureSamples {
    /// Each channel with its name: `Y` for gray, `R`, `G` and `B`, or what an EXR file calls it.
    pub planes: Vec<(String, Array2<f32>)>,
    /// The highest code of a file of whole numbers, 255 or 65 535; `None` for floating-point samples.
    pub top: Option<u16>,
}

/// Reads the samples of a PNG, JPEG, TIFF or EXR file, neither scaled nor decoded; opacity is left out.
///
/// # Errors
/// When the file is no such picture, or too large.
pub fn read_picture_samples(path: &Path) -> Result<PictureSamples, SceneError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        return Ok(PictureSamples { planes: super::spectral_exr::read_planes_exr(path)?, top: None });
    }
    let picture = decode(path, SAMPLES_BYTES)?;
    let (columns, rows) = (picture.width() as usize, picture.height() as usize);
    let parted = |samples: Vec<f32>, names: &[&str]| {
        let n = names.len();
        let plane = |k: usize| {
            let values = samples.iter().skip(k).step_by(n).copied().collect();
            Array2::from_shape_vec((rows, columns), values).expect("a sample a pixel")
        };
        names.iter().enumerate().map(|(k, name)| ((*name).to_owned(), plane(k))).collect()
    };
    const RGB: [&str; 3] = ["R", "G", "B"];
    let bytes = |samples: Vec<u8>| samples.into_iter().map(f32::from).collect();
    let words = |samples: Vec<u16>| samples.into_iter().map(f32::from).collect();
    let (planes, top) = match picture {
        DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) => {
            (parted(bytes(picture.into_luma8().into_raw()), &["Y"]), Some(u16::from(u8::MAX)))
        }
        DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_) => {
            (parted(words(picture.into_luma16().into_raw()), &["Y"]), Some(u16::MAX))
        }
        DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_) => {
            (parted(bytes(picture.into_rgb8().into_raw()), &RGB), Some(u16::from(u8::MAX)))
        }
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            (parted(words(picture.into_rgb16().into_raw()), &RGB), Some(u16::MAX))
        }
        other => (parted(other.into_rgb32f().into_raw(), &RGB), None),
    };
    Ok(PictureSamples { planes, top })
}

/// Decodes a picture of any kind that is recognized by the file's content, of which `beside_bytes` are made for each pixel.
pub(crate) fn decode(path: &Path, beside_bytes: u64) -> Result<DynamicImage, SceneError> {
    dioptric_pictures::read_within(path, beside_bytes).map_err(|error| undecodable(path, &error))
}

fn undecodable(path: &Path, error: &ImageError) -> SceneError {
    unreadable(path, error.to_string().replace('\n', " "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use dioptric_pictures::save;
    use dioptric_spectrum::{Observer, Xyz};
    use image::{ImageBuffer, Rgb};

    #[test]
    fn colors_survive_the_lift() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let codes = [[255_u8, 255, 255], [200, 120, 80], [0, 0, 0]];
        save(&ImageBuffer::from_fn(3, 1, |x, _| Rgb(codes[x as usize])).into(), &path).unwrap();
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
        save(&ImageBuffer::from_fn(2, 1, |x, _| Rgb([30_000_u16 + x as u16; 3])).into(), &path).unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 50.0).unwrap();
        let lifted = read_picture(&path, &Display::apple_studio(), &grid, 100.0).unwrap();
        assert!(lifted.spectrum_at(0, 1)[3] > lifted.spectrum_at(0, 0)[3]);
    }

    #[test]
    fn a_broken_picture_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("broken.jpg");
        std::fs::write(&path, b"\xff\xd8\xff\xe0 no more").unwrap();
        let message = decode(&path, 0).unwrap_err().to_string();
        assert!(message.contains("broken.jpg: cannot be read"), "{message}");
    }

    #[test]
    fn samples_are_those_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let check = |name: &str, picture: DynamicImage, names: &[&str], first: &[f32], top: Option<u16>| {
            let path = folder.path().join(name);
            save(&picture, &path).unwrap();
            let read = read_picture_samples(&path).unwrap();
            let found: Vec<_> = read.planes.iter().map(|(name, plane)| (name.as_str(), plane[(1, 2)])).collect();
            let expected: Vec<_> = names.iter().copied().zip(first.iter().copied()).collect();
            assert_eq!((found, read.top), (expected, top), "{name}");
        };
        let rgb8 = image::RgbImage::from_fn(4, 3, |x, y| image::Rgb([x as u8, y as u8, 7]));
        check("a.png", rgb8.into(), &["R", "G", "B"], &[2.0, 1.0, 7.0], Some(255));
        let gray16 =
            image::ImageBuffer::<image::Luma<u16>, _>::from_fn(4, 3, |x, y| image::Luma([(1000 * x + y) as u16]));
        check("b.png", gray16.clone().into(), &["Y"], &[2001.0], Some(65535));
        check("c.tif", gray16.into(), &["Y"], &[2001.0], Some(65535));
        assert!(read_picture_samples(&folder.path().join("none.png")).unwrap_err().to_string().contains("none.png"));
    }
}
