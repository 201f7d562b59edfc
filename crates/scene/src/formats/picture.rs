//! Ordinary pictures, lifted to spectra through a display's primaries.

use std::{io::Read, path::Path};

use dioptric_pictures::{Curve, DynamicImage, ImageError, StatedColors, orientation_of, read_reduced, size_of};
use dioptric_spectrum::{Display, Quantity, SpectralImage, WavelengthGrid, srgb_decode, srgb_encode};
use image::metadata::Orientation;
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    contents::is_of,
    picture_parts::{note_on_exif, note_on_exif_colors, unknown_parts},
    primaries::into_srgb,
    spectral_exr::{NamedPlanes, notes_on_planes_exr, read_planes_and_primaries_exr},
    stated::{Noted, name_of, note_of},
    tiff_directory::is_tiff,
    tiff_file::{float_planes, notes_on_pages},
    unusable::{check_made, fault, unreadable},
};
use crate::SceneError;

/// Pixels that are lifted to spectra at a time.
const AT_ONCE: usize = 1 << 13;

/// What a pixel takes as codes of 16 bits while it is lifted to bands, bytes.
const CODES_BYTES: u64 = 6;
/// A color is beyond the display's gamut where it has less of a primary than this share of white below 0.
pub(super) const BEYOND: f64 = 0.01;
/// What a pixel takes as planes of single floats beside its codes, bytes.
const SAMPLES_BYTES: u64 = 15;

/// Reads a PNG, JPEG or TIFF picture of 8 or 16 bits as the radiance of a display that shows it.
///
/// The picture's white has the luminance `white_cd_m2`. Codes are those of the colors that the file states, of sRGB where it says nothing. A color
/// beyond the display's gamut is clipped at 0 in the bands where it would need negative light.
///
/// # Errors
/// When the file is no such picture, too large, or of colors that cannot be converted.
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
    let Oriented { picture, colors, .. } = oriented(path, None)?;
    Ok(lifted_codes(path, picture, colors.as_ref(), &display.srgb_basis(grid, white_cd_m2), grid)?.0)
}

/// Returns the light of a picture of codes: sums of the spectra of red, green and blue of sRGB, `basis`. What would need negative light is 0; the share
/// of pixels of which a band is below 0 by more than a hundredth of white comes with it.
pub(super) fn lifted_codes(
    path: &Path,
    picture: DynamicImage,
    colors: Option<&StatedColors>,
    basis: &[Vec<f64>; 3],
    grid: &WavelengthGrid,
) -> Result<(SpectralImage, f64), SceneError> {
    let n = u64::from(picture.width()) * u64::from(picture.height());
    check_made(path, (4 * grid.len() as u64 + CODES_BYTES).saturating_mul(n))?;
    let picture = picture.into_rgb16();
    let (columns, rows) = (picture.width() as usize, picture.height() as usize);
    let linear = [0, 1, 2].map(|channel| -> Vec<f64> {
        let light = |code| colors.map_or_else(|| srgb_light(code), |colors| colors.light(channel, code));
        (0..=u16::MAX).map(light).collect()
    });
    // The light of the file's own red, green and blue.
    let own_basis = colors.map(|colors| {
        [0, 1, 2].map(|own| -> Vec<f64> {
            let at = |band: usize| (0..3).map(|k| colors.to_srgb[k][own] * basis[k][band]).sum();
            (0..grid.len()).map(at).collect()
        })
    });
    let basis = own_basis.as_ref().unwrap_or(basis);
    let mut planes: Vec<Array2<f32>> = (0..grid.len()).map(|_| Array2::zeros((rows, columns))).collect();
    // A part of the picture in all bands before the next, while its colors are at hand.
    let mut parts: Vec<Vec<&mut [f32]>> = (0..(rows * columns).div_ceil(AT_ONCE)).map(|_| vec![]).collect();
    for plane in &mut planes {
        let samples = plane.as_slice_mut().expect("a new plane is in standard order");
        parts.iter_mut().zip(samples.chunks_mut(AT_ONCE)).for_each(|(part, samples)| part.push(samples));
    }
    let least: Vec<f64> = (0..grid.len()).map(|band| -BEYOND * (0..3).map(|k| basis[k][band]).sum::<f64>()).collect();
    let in_part = |(bands, codes): (Vec<&mut [f32]>, &[u16])| {
        let mut is_beyond = vec![false; codes.len() / 3];
        let colors = [0, 1, 2].map(|color| -> Vec<f64> {
            codes.iter().skip(color).step_by(3).map(|&code| linear[color][usize::from(code)]).collect()
        });
        for (band, samples) in bands.into_iter().enumerate() {
            lift(&colors, [0, 1, 2].map(|color| basis[color][band]), (samples, &mut is_beyond, least[band]));
        }
        is_beyond.into_iter().filter(|is_beyond| *is_beyond).count()
    };
    let n_beyond: usize = parts.into_par_iter().zip(picture.as_raw().par_chunks(3 * AT_ONCE)).map(in_part).sum();
    Ok((SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?, n_beyond as f64 / n.max(1) as f64))
}

/// Returns linear sRGB of a picture of codes; what lies beyond sRGB is below 0 or above 1.
pub(super) fn linear_srgb(picture: DynamicImage, colors: Option<&StatedColors>) -> [Array2<f32>; 3] {
    let picture = picture.into_rgb16();
    let size = (picture.height() as usize, picture.width() as usize);
    let plane = |channel: usize| {
        let light = |code| colors.map_or_else(|| srgb_light(code), |colors| colors.light(channel, code)) as f32;
        let table: Vec<f32> = (0..=u16::MAX).map(light).collect();
        let codes = picture.as_raw().iter().skip(channel).step_by(3);
        let samples = codes.map(|&code| table[usize::from(code)]).collect();
        Array2::from_shape_vec(size, samples).expect("a sample a pixel")
    };
    let mut planes = [plane(0), plane(1), plane(2)];
    if let Some(colors) = colors {
        into_srgb(&mut planes, &colors.to_srgb);
    }
    planes
}

fn srgb_light(code: u16) -> f64 {
    srgb_decode(f64::from(code) / 65535.0)
}

/// Puts the radiance of colors in a band into samples, and marks those that would need less than `least`.
fn lift(
    [red, green, blue]: &[Vec<f64>; 3],
    [r, g, b]: [f64; 3],
    (samples, is_beyond, least): (&mut [f32], &mut [bool], f64),
) {
    let places = samples.iter_mut().zip(is_beyond);
    for ((((sample, is_beyond), red), green), blue) in places.zip(red).zip(green).zip(blue) {
        let light = r * red + g * green + b * blue;
        *is_beyond |= light < least;
        *sample = light.max(0.0) as f32;
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

/// A picture as the photographer sees it.
pub(super) struct Oriented {
    pub(super) picture: DynamicImage,
    /// What its codes are, where they are not those of sRGB.
    pub(super) colors: Option<StatedColors>,
    /// Whether it lies otherwise than in its file.
    pub(super) is_turned: bool,
    /// What else it states, a sentence each.
    pub(super) notes: Vec<String>,
}

/// Reads a picture upright, as its orientation says, with the colors that it states; of means over blocks where it has more pixels than `size`,
/// columns and rows.
///
/// # Errors
/// As [`decode`], and when its colors cannot be converted.
pub(super) fn oriented(path: &Path, size: Option<(usize, usize)>) -> Result<Oriented, SceneError> {
    let colors = stated_colors(path)?;
    let mut picture = match size {
        Some(size) => {
            let own = colors.as_ref();
            let curve = Curve {
                to_light: &|code| own.map_or_else(|| srgb_light(code), |own| own.light(1, code)),
                to_code: &|light| {
                    own.map_or_else(|| (65535.0 * srgb_encode(light)).round() as u16, |own| own.code(light))
                },
            };
            read_reduced(path, size, &curve).map_err(|error| undecodable(path, &error))?
        }
        None => decode(path, CODES_BYTES)?,
    };
    let mut notes = vec![];
    let orientation = orientation_of(path);
    let is_turned = orientation != Orientation::NoTransforms;
    if is_turned {
        picture.apply_orientation(orientation);
        notes.push(format!("{}: it is turned upright, as its orientation says", name_of(path)));
    }
    notes.extend(colors.as_ref().map(|colors| {
        format!("{}: its codes are converted to light by what it states, {}", name_of(path), colors.name)
    }));
    notes.extend(note_on_exif_colors(path, colors.as_ref()));
    if has_holes(&picture) {
        notes.extend(note_of(path, "channel", &["opacity".to_owned()]));
    }
    Ok(Oriented { picture, colors, is_turned, notes })
}

/// Whether a pixel of a picture is not opaque.
pub(super) fn has_holes(picture: &DynamicImage) -> bool {
    match picture {
        DynamicImage::ImageLumaA8(p) => p.pixels().any(|p| p.0[1] < u8::MAX),
        DynamicImage::ImageRgba8(p) => p.pixels().any(|p| p.0[3] < u8::MAX),
        DynamicImage::ImageLumaA16(p) => p.pixels().any(|p| p.0[1] < u16::MAX),
        DynamicImage::ImageRgba16(p) => p.pixels().any(|p| p.0[3] < u16::MAX),
        other => other.color().has_alpha(),
    }
}

/// Returns the note on colors that a display cannot show, a share of all pixels.
pub(super) fn note_beyond(path: &Path, share: f64) -> Option<String> {
    (share > 0.0).then(|| {
        format!(
            "{}: {:.2} % of its pixels have colors beyond the display's gamut, which ends before sRGB's in blue, and sooner on few bands: \
             they are held at its edge",
            name_of(path),
            100.0 * share
        )
    })
}

/// Returns the colors that a picture states; `None` for sRGB.
fn stated_colors(path: &Path) -> Result<Option<StatedColors>, SceneError> {
    StatedColors::of(path).map_err(|reason| unreadable(path, reason))
}

/// Returns what a picture's samples are, in words.
pub(super) fn kind_of(picture: &DynamicImage, colors: Option<&StatedColors>) -> String {
    let color = picture.color();
    let bits = 8 * u16::from(color.bytes_per_pixel()) / u16::from(color.channel_count());
    let what = match (color.has_color(), colors) {
        (false, _) => "gray",
        (true, None) => "sRGB",
        (true, Some(_)) => "RGB",
    };
    format!("{what} of {bits} bits")
}

/// The samples of a picture as they stand in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureSamples {
    /// Each channel with its name: `Y` for gray, `R`, `G` and `B`, or what an EXR file calls it.
    pub planes: NamedPlanes,
    /// The highest code of a file of whole numbers, 255 or 65 535; `None` for floating-point samples.
    pub top: Option<u16>,
    /// What the samples of red, green and blue, or of gray, are, where they are not those of sRGB, or of floats in its primaries; the reason where they
    /// cannot be converted to light.
    pub colors: Result<Option<StatedColors>, String>,
}

/// Reads the samples of a PNG, JPEG, TIFF or EXR file, neither scaled nor decoded; opacity is left out.
///
/// # Errors
/// When the file is no such picture, or too large.
pub fn read_picture_samples(path: &Path) -> Result<Noted<PictureSamples>, SceneError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        return Ok(read_planes_and_primaries_exr(path)?.map(|(planes, to_srgb)| {
            let colors = to_srgb.map(|matrix| StatedColors::linear("chromaticities of its header".to_owned(), matrix));
            PictureSamples { planes, top: None, colors: Ok(colors) }
        }));
    }
    let colors = StatedColors::of(path);
    let mut notes = notes_on_samples(path)?;
    let floats = if is_tiff(path) { float_planes(path)? } else { None };
    if let Some(planes) = floats {
        // As of scenes: floats of a profile have its curve, be it that of sRGB.
        let colors = StatedColors::of_floats(path);
        let planes = planes.told_in(&mut notes);
        let names: &[&str] = match planes.len() {
            1 => &["Y"],
            3 => &["R", "G", "B"],
            n => {
                return Err(unreadable(
                    path,
                    format!("it has {n} samples a pixel, expected gray or red, green and blue"),
                ));
            }
        };
        let planes = names.iter().map(|name| (*name).to_owned()).zip(planes).collect();
        return Ok(Noted::new(PictureSamples { planes, top: None, colors }, notes));
    }
    let picture = decode(path, SAMPLES_BYTES)?;
    if has_holes(&picture) {
        notes.extend(note_of(path, "channel", &["opacity".to_owned()]));
    }
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
    Ok(Noted::new(PictureSamples { planes, top, colors }, notes))
}

/// Returns what of a picture's statements [`read_picture_samples`] does not use, a sentence each.
///
/// # Errors
/// When the file cannot be opened, or ends too early.
pub fn notes_on_samples(path: &Path) -> Result<Vec<String>, SceneError> {
    if is_of(path, &["exr"]) {
        return notes_on_planes_exr(path);
    }
    let is_turned = orientation_of(path) != Orientation::NoTransforms;
    let note = || format!("{}: its pixels are counted as stored, not turned as its orientation says", name_of(path));
    let parts = note_of(path, "part", &unknown_parts(path)?);
    let pages = if is_tiff(path) { notes_on_pages(path) } else { vec![] };
    let colors = StatedColors::of(path).ok().and_then(|colors| note_on_exif_colors(path, colors.as_ref()));
    Ok(is_turned
        .then(note)
        .into_iter()
        .chain(parts)
        .chain(pages)
        .chain(colors)
        .chain((!is_tiff(path)).then(|| note_on_exif(path, false)).flatten())
        .collect())
}

/// Decodes a picture of any kind that is recognized by the file's content, of which `beside_bytes` are made for each pixel.
pub(crate) fn decode(path: &Path, beside_bytes: u64) -> Result<DynamicImage, SceneError> {
    dioptric_pictures::read_within(path, beside_bytes).map_err(|error| undecodable(path, &error))
}

/// Returns the largest code that the header of a PNM picture (`.pgm`, `.ppm`) states; `None` of other files.
pub(super) fn pnm_top(path: &Path) -> Option<u32> {
    if dioptric_pictures::format_of(path).ok()? != Some(dioptric_pictures::ImageFormat::Pnm) {
        return None;
    }
    let file = std::io::BufReader::new(std::fs::File::open(path).ok()?);
    let (_, header) = image::codecs::pnm::PnmDecoder::new(file).ok()?.into_inner();
    Some(header.maximal_sample())
}

fn undecodable(path: &Path, error: &ImageError) -> SceneError {
    let said = error.to_string();
    let ending = path.extension().map(|own| own.to_string_lossy().to_uppercase()).unwrap_or_default();
    let is_decoding = matches!(error, ImageError::Decoding(_));
    let reason = match error {
        ImageError::Decoding(_) if said.contains("critical chunk") => {
            let name = said.split("type: ").nth(1).and_then(|rest| rest.split([',', ' ', '}']).next()).unwrap_or("one");
            format!(
                "its chunk {name} is one that a reader must know, and is not read here: expected a PNG without it (save it anew)"
            )
        }
        _ if is_decoding && is_of(path, &["hdr"]) => match first_line(path) {
            Some(line) if line.starts_with("#?RADIANCE") => {
                fault("Radiance picture", error, None)
            }
            line => format!(
                "its first line is '{}', expected '#?RADIANCE' of a Radiance picture, or 'ENVI' of the header of a cube",
                super::stated::short(&line.unwrap_or_default())
            ),
        },
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            fault(&ending, "unexpected EOF", None)
        }
        ImageError::Decoding(_) => fault(&ending, error, None),
        ImageError::Unsupported(_) if said.contains("Orientation ") => format!(
            "its rows and columns are in the order {}, expected -Y +X (save it anew)",
            said.split("Orientation ").nth(1).unwrap_or_default()
        ),
        ImageError::Unsupported(_) if said.contains("color type `Unknown") => {
            "its samples are of other bits or channels than those of pictures: expected gray, or red, green and blue with or without \
             opacity, of 8 or 16 bits, or bands of a TIFF, which --scene-wavelengths-nm tells"
                .to_owned()
        }
        ImageError::Unsupported(_) => format!(
            "it is of a kind that is not read ({said}): expected gray or red, green and blue as .png, .jpg, .tif, .webp, .bmp, .ppm or .hdr, or \
             numbers as .exr, .pfm, .npy, .npz, .mat, .h5 or .txt"
        ),
        _ => said,
    };
    unreadable(path, reason)
}

/// Returns the first line of a file, as far as it is text.
fn first_line(path: &Path) -> Option<String> {
    let mut start = vec![];
    std::fs::File::open(path).ok()?.take(40).read_to_end(&mut start).ok()?;
    let line = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    Some(line.iter().filter(|byte| byte.is_ascii_graphic() || **byte == b' ').map(|byte| char::from(*byte)).collect())
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

    /// Floats of a profile are what codes of it are: editors write both by its curve.
    #[test]
    fn floats_are_in_the_colors_of_their_profile() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        for profile in [dioptric_pictures::CodeSpace::DisplayP3, dioptric_pictures::CodeSpace::Srgb] {
            let profile = profile.icc_profile();
            let scene = |write: &dyn Fn(&mut tiff::encoder::TiffEncoder<std::fs::File>)| {
                write(&mut tiff::encoder::TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap());
                let scene = crate::read_scene(&path, &crate::ReadOptions::default()).unwrap();
                assert!(!scene.notes.iter().any(|note| note.contains("34675")), "{:?}", scene.notes);
                scene.radiance.spectrum_at(0, 0)
            };
            let tag = tiff::tags::Tag::Unknown(34_675);
            let codes = scene(&|encoder| {
                let mut page = encoder.new_image::<tiff::encoder::colortype::RGB16>(1, 1).unwrap();
                page.encoder().write_tag(tag, &profile[..]).unwrap();
                page.write_data(&[40_000, 30_000, 20_000]).unwrap();
            });
            let floats = scene(&|encoder| {
                let mut page = encoder.new_image::<tiff::encoder::colortype::RGB32Float>(1, 1).unwrap();
                page.encoder().write_tag(tag, &profile[..]).unwrap();
                page.write_data(&[40_000.0, 30_000.0, 20_000.0].map(|code: f32| code / 65_535.0)).unwrap();
            });
            for (a, b) in codes.iter().zip(&floats) {
                // A profile's fractions.
                assert_abs_diff_eq!(*a, *b, epsilon = 2e-3 * codes.iter().copied().fold(0.0, f64::max));
            }
        }
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
    fn what_is_not_read_is_called_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            crate::read_scene(&path, &crate::ReadOptions::default()).unwrap_err().to_string()
        };
        let radiance = b"FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x80";
        let message = refused("a.hdr", &[&b"#?RGBE\n"[..], radiance].concat());
        assert!(message.contains("'#?RGBE', expected '#?RADIANCE'"), "{message}");
        let mut png = vec![];
        image::GrayImage::from_pixel(1, 1, image::Luma([9]))
            .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
            .unwrap();
        // Behind the signature and the header, with the checksum of no content.
        let chunk = [&[0; 4][..], b"ABCD", &crc(b"ABCD").to_be_bytes()].concat();
        png.splice(33..33, chunk);
        let message = refused("a.png", &png);
        assert!(message.contains("chunk ABCD") && !message.contains('{'), "{message}");
        let mut file = std::io::Cursor::new(vec![]);
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
        let mut page = encoder.new_image::<tiff::encoder::colortype::Gray16>(2, 1).unwrap();
        page.encoder().write_tag(tiff::tags::Tag::PhotometricInterpretation, 51_177_u16).unwrap();
        page.write_data(&[1, 2]).unwrap();
        let message = refused("a.tif", file.get_ref());
        assert!(message.contains("depth map (DNG)") && !message.contains("develop"), "{message}");
    }

    /// The checksum of a chunk (PNG, third edition, annex D).
    fn crc(bytes: &[u8]) -> u32 {
        let step = |c: u32, byte: &u8| {
            (0..8).fold(c ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        };
        !bytes.iter().fold(u32::MAX, step)
    }

    #[test]
    fn samples_are_those_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let check = |name: &str, picture: DynamicImage, names: &[&str], first: &[f32], top: Option<u16>| {
            let path = folder.path().join(name);
            save(&picture, &path).unwrap();
            let read = read_picture_samples(&path).unwrap().of_own_file();
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
