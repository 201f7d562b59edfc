//! Which colors the codes of a picture stand for, as its file states them: an ICC profile, the chunks of PNG, or the Exif data of cameras.

use std::{
    fs::File,
    io::{BufReader, Read},
    path::Path,
};

use image::{ImageDecoder, ImageFormat};
use moxcms::{
    Chromaticity, CicpColorPrimaries, ColorPrimaries, ColorProfile, DataColorSpace, Matrix3d, ProfileText,
    ToneReprCurve, TransferCharacteristics, XyY,
};

use crate::{
    bmp::{BmpColors, colors_of_bmp},
    exif::Exif,
    open::{PictureFile, open},
};

/// How far curve and matrix of a profile may be from those of sRGB to be taken as these: four digits of a profile's fractions.
const SAME: f64 = 2e-3;
/// The highest code.
const TOP: f64 = 65535.0;

/// Colors that the codes of a picture stand for, where they are not those of sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedColors {
    /// What they are, by the file's own words.
    pub name: String,
    /// The light, 0 to 1, of each code of 16 bits of red, green and blue; none where samples are linear.
    curves: Option<Box<[Vec<f64>; 3]>>,
    /// The matrix from linear light of the file's primaries to linear sRGB (IEC 61966-2-1), white to white (Bradford).
    pub to_srgb: [[f64; 3]; 3],
}

impl StatedColors {
    /// Returns what a file states; `None` where it says sRGB, or nothing.
    ///
    /// Of BMP its header of version 4 or 5. Of PNG the chunk that counts is, as its third edition has it, the first of cICP, iCCP, sRGB, and gAMA with cHRM; of the other formats the
    /// ICC profile, or Adobe RGB by the Exif data of a camera (DCF 2.0).
    ///
    /// # Errors
    /// When the colors cannot be converted to linear light: the reason, which a sentence can go on with after the file's name.
    pub fn of(path: &Path) -> Result<Option<Self>, String> {
        Ok(Self::stated(path)?.filter(|own| !own.are_srgb()))
    }

    /// Returns what a file of floats states, be it sRGB: `None` where it says nothing, and its numbers go with light.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn of_floats(path: &Path) -> Result<Option<Self>, String> {
        Self::stated(path)
    }

    fn stated(path: &Path) -> Result<Option<Self>, String> {
        let Ok(reader) = open(path) else { return Ok(None) };
        let format = reader.format();
        if format == Some(ImageFormat::Png) {
            return of_png(path);
        }
        if format == Some(ImageFormat::Bmp) {
            return of_bmp(path);
        }
        let jpeg = if format == Some(ImageFormat::Jpeg) { JpegHead::of(path) } else { JpegHead::default() };
        if jpeg.n_colors == Some(4) {
            return Err("holds inks (CMYK), expected gray or red, green and blue; convert it to sRGB".to_owned());
        }
        let of_tiff = if format == Some(ImageFormat::Tiff) { profile_of_tiff(path)? } else { None };
        // Whoever reads the picture says what is wrong with it; one of gray floats is read elsewhere.
        let Ok(mut decoder) = reader.into_decoder() else {
            return of_tiff.map_or(Ok(None), |profile| Self::of_icc(&profile));
        };
        let profile = of_tiff.or_else(|| decoder.icc_profile().ok().flatten()).filter(|profile| !profile.is_empty());
        match profile {
            Some(profile) => Self::of_icc(&profile),
            None if jpeg.states_profile => Err(damaged("an ICC profile")),
            None => {
                let exif = decoder.exif_metadata().ok().flatten();
                let is_adobe = exif.as_deref().is_some_and(|bytes| Exif::of_bytes(bytes).is_adobe_rgb());
                is_adobe
                    .then(|| {
                        Self::of_profile(&ColorProfile::new_adobe_rgb(), "Adobe RGB, as its Exif data says".to_owned())
                    })
                    .transpose()
                    .map(Option::flatten)
            }
        }
    }

    /// Whether a file is a PNG whose chunks say what its colors are, be it sRGB: they count before its Exif data.
    pub fn are_in_chunks(path: &Path) -> bool {
        let Ok(file) = File::open(path) else { return false };
        let Ok(reader) = png::Decoder::new(BufReader::new(file)).read_info() else { return false };
        let info = reader.info();
        let is_named = info.srgb.is_some() || info.coding_independent_code_points.is_some();
        is_named || info.icc_profile.is_some() || info.gama_chunk.is_some() || info.chrm_chunk.is_some()
    }

    /// Returns colors of samples that are linear: the matrix to linear sRGB is given.
    pub fn linear(name: String, to_srgb: [[f64; 3]; 3]) -> Self {
        Self { name, curves: None, to_srgb }
    }

    /// Returns the light of a code of 16 bits in a channel, 0 red, 1 green, 2 blue.
    pub fn light(&self, channel: usize, code: u16) -> f64 {
        self.curves.as_ref().map_or(f64::from(code) / TOP, |curves| curves[channel][usize::from(code)])
    }

    /// Makes samples of a channel, 0 to 1 or beyond, light: below 0 as above it, above 1 by the power that the curve ends with.
    pub fn make_light(&self, channel: usize, samples: &mut [f32]) {
        let Some(curve) = self.curves.as_ref().map(|curves| &curves[channel]) else { return };
        const LAST: usize = 65_535;
        /// What the power is taken over, codes.
        const STEP: usize = 655;
        let power = (curve[LAST] / curve[LAST - STEP]).ln() / (TOP / (LAST - STEP) as f64).ln();
        for sample in samples.iter_mut().filter(|sample| sample.is_finite()) {
            let size = f64::from(sample.abs());
            let at = TOP * size.min(1.0);
            let below = (at as usize).min(LAST - 1);
            let within = curve[below] + (at - below as f64) * (curve[below + 1] - curve[below]);
            *sample = (within * size.max(1.0).powf(power)).copysign(f64::from(*sample)) as f32;
        }
    }

    /// Returns the code whose light in the green channel is nearest.
    pub fn code(&self, light: f64) -> u16 {
        let Some(curves) = &self.curves else { return (TOP * light.clamp(0.0, 1.0)).round() as u16 };
        let next = curves[1].partition_point(|own| *own < light).min(usize::from(u16::MAX));
        let below = next.saturating_sub(1);
        (if light - curves[1][below] < curves[1][next] - light { below } else { next }) as u16
    }

    fn of_icc(bytes: &[u8]) -> Result<Option<Self>, String> {
        let profile = ColorProfile::new_from_slice(bytes).map_err(|_| damaged("an ICC profile"))?;
        let name = profile.description.as_ref().and_then(text_of).filter(|name| !name.trim().is_empty());
        let name = name.map_or_else(
            || "an ICC profile without a name".to_owned(),
            |name| format!("ICC profile '{}'", name.trim()),
        );
        Self::of_profile(&profile, name)
    }

    fn of_profile(profile: &ColorProfile, name: String) -> Result<Option<Self>, String> {
        let is_hdr = |curve: TransferCharacteristics| {
            matches!(curve, TransferCharacteristics::Smpte2084 | TransferCharacteristics::Hlg)
        };
        if profile.cicp.is_some_and(|cicp| is_hdr(cicp.transfer_characteristics)) {
            return Err(hdr(&name));
        }
        let (curves, matrix) = match profile.color_space {
            DataColorSpace::Gray => (profile.gray_trc.as_ref().map(|gray| [gray; 3]), Matrix3d::IDENTITY),
            DataColorSpace::Rgb if profile.is_matrix_shaper() => {
                let curves = [&profile.red_trc, &profile.green_trc, &profile.blue_trc];
                let all: Vec<&ToneReprCurve> = curves.into_iter().flatten().collect();
                (all.try_into().ok(), profile.transform_matrix(&ColorProfile::new_srgb()))
            }
            _ => (None, Matrix3d::IDENTITY),
        };
        let Some(curves) = curves else {
            let kind = format!("{:?}", profile.color_space).to_uppercase();
            return Err(format!(
                "has {name} of {kind} colors without a matrix and curves, expected one of gray or of three primaries; convert it to sRGB"
            ));
        };
        let tables = curves.map(table);
        let [Ok(r), Ok(g), Ok(b)] = tables else { return Err(format!("has {name} with a curve that cannot be read")) };
        Self::made(name, [r, g, b], matrix)
    }

    /// Returns colors of these curves.
    fn made(name: String, curves: [Vec<f64>; 3], matrix: Matrix3d) -> Result<Option<Self>, String> {
        let is_finite = matrix.v.iter().flatten().chain(curves.iter().flatten()).all(|v| v.is_finite());
        if !is_finite {
            return Err(format!("has {name} that leads to no colors"));
        }
        Ok(Some(Self { name, curves: Some(Box::new(curves)), to_srgb: matrix.v }))
    }

    /// Whether they are those of sRGB, as far as a profile's fractions tell.
    fn are_srgb(&self) -> bool {
        let m = &self.to_srgb;
        let is_unit = (0..3).all(|i| (0..3).all(|j| (m[i][j] - f64::from(u8::from(i == j))).abs() < SAME));
        let is_curve = |curve: &Vec<f64>| {
            let mut lights = curve.iter().enumerate().step_by(257);
            lights.all(|(code, light)| (light - srgb_light(code as f64 / TOP)).abs() < SAME)
        };
        is_unit && self.curves.as_ref().is_some_and(|curves| curves.iter().all(is_curve))
    }
}

/// Returns the light of a code of 0–1 (IEC 61966-2-1).
fn srgb_light(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Returns what is said of colors that a file states but nobody can read there.
fn damaged(what: &str) -> String {
    format!("has {what} that is damaged, or of which parts are missing: save it anew, or as sRGB without")
}

fn hdr(name: &str) -> String {
    format!(
        "has {name} for high dynamic range (PQ or HLG), expected colors of a usual display; convert it to linear EXR or to sRGB"
    )
}

fn text_of(text: &ProfileText) -> Option<String> {
    match text {
        ProfileText::PlainString(text) => Some(text.clone()),
        ProfileText::Localizable(texts) => texts.first().map(|text| text.value.clone()),
        ProfileText::Description(text) => Some(text.ascii_string.clone()),
    }
}

/// Returns the light of every code of 16 bits by a profile's curve.
fn table(curve: &ToneReprCurve) -> Result<Vec<f64>, moxcms::CmsError> {
    let curve = curve.make_linear_evaluator()?;
    Ok((0..=u16::MAX).map(|code| f64::from(curve.evaluate_value(f32::from(code) / f32::from(u16::MAX)))).collect())
}

/// Returns what the header of a BMP file states.
fn of_bmp(path: &Path) -> Result<Option<StatedColors>, String> {
    match colors_of_bmp(path) {
        BmpColors::Usual => Ok(None),
        BmpColors::Linked => {
            Err("names an ICC profile in another file, expected it within or none; convert it to sRGB".to_owned())
        }
        BmpColors::Profile(profile) => StatedColors::of_icc(&profile),
        BmpColors::Calibrated { primaries: [red, green, blue], white, gammas } => {
            let curve =
                |gamma: f64| (0..=u16::MAX).map(|code| (f64::from(code) / TOP).powf(gamma)).collect::<Vec<f64>>();
            let point = |[x, y]: [f32; 2]| Chromaticity::new(x, y);
            let primaries = ColorPrimaries { red: point(red), green: point(green), blue: point(blue) };
            let name =
                format!("primaries and gammas of {:.3}, {:.3}, {:.3} of its header", gammas[0], gammas[1], gammas[2]);
            StatedColors::made(name, gammas.map(curve), matrix_of(XyY::new(white[0], white[1], 1.0), primaries))
        }
    }
}

/// Returns what the chunks of a PNG file state.
fn of_png(path: &Path) -> Result<Option<StatedColors>, String> {
    let Ok(file) = File::open(path) else { return Ok(None) };
    let Ok(reader) = png::Decoder::new(BufReader::new(file)).read_info() else { return Ok(None) };
    let info = reader.info();
    // What reads the file leaves out what it cannot read of its chunks.
    let kinds = chunks_of_png(path);
    let has_icc = info.icc_profile.is_some();
    let whole = [
        (b"cICP", info.coding_independent_code_points.is_some()),
        (b"iCCP", has_icc),
        // A profile counts before it, and what reads the file knows so.
        (b"sRGB", info.srgb.is_some() || has_icc),
        (b"gAMA", info.gama_chunk.is_some()),
        (b"cHRM", info.chrm_chunk.is_some()),
    ];
    for (kind, is_read) in whole {
        if !is_read && kinds.contains(kind) {
            return Err(damaged(&format!("a chunk {} of its colors", String::from_utf8_lossy(kind))));
        }
        if is_read && kind != b"gAMA" {
            break;
        }
    }
    if let Some(points) = &info.coding_independent_code_points {
        return of_code_points(points);
    }
    if let Some(profile) = &info.icc_profile {
        return StatedColors::of_icc(profile);
    }
    if info.srgb.is_some() || (info.gama_chunk.is_none() && info.chrm_chunk.is_none()) {
        return Ok(None);
    }
    let (curve, mut name) = match info.gama_chunk.map(|gamma| f64::from(gamma.into_value())) {
        Some(gamma) if gamma > 0.0 => {
            let curve = (0..=u16::MAX).map(|code| (f64::from(code) / TOP).powf(1.0 / gamma)).collect();
            (curve, format!("a gamma of {gamma:.5} (gAMA)"))
        }
        Some(gamma) => return Err(format!("has a gamma of {gamma} (gAMA), expected a number above 0")),
        None => (
            (0..=u16::MAX).map(|code| srgb_light(f64::from(code) / TOP)).collect::<Vec<f64>>(),
            "sRGB's curve".to_owned(),
        ),
    };
    let matrix = match &info.chrm_chunk {
        Some(own) => {
            let point =
                |(x, y): (png::ScaledFloat, png::ScaledFloat)| Chromaticity::new(x.into_value(), y.into_value());
            let (white_x, white_y) = (own.white.0.into_value(), own.white.1.into_value());
            name += &format!(
                " and primaries of x, y {:.4}, {:.4}; {:.4}, {:.4}; {:.4}, {:.4} (cHRM)",
                own.red.0.into_value(),
                own.red.1.into_value(),
                own.green.0.into_value(),
                own.green.1.into_value(),
                own.blue.0.into_value(),
                own.blue.1.into_value()
            );
            let primaries = ColorPrimaries { red: point(own.red), green: point(own.green), blue: point(own.blue) };
            matrix_of(XyY::new(f64::from(white_x), f64::from(white_y), 1.0), primaries)
        }
        None => Matrix3d::IDENTITY,
    };
    StatedColors::made(name, [curve.clone(), curve.clone(), curve], matrix)
}

/// Returns the kinds of the chunks of a PNG file before its pixels.
fn chunks_of_png(path: &Path) -> Vec<[u8; 4]> {
    const SIGNATURE: u64 = 8;
    const MOST: usize = 10_000;
    let mut kinds = vec![];
    let Ok(file) = File::open(path) else { return kinds };
    let mut file = BufReader::new(file);
    let mut next = SIGNATURE as i64;
    while file.seek_relative(next).is_ok() && kinds.len() < MOST {
        let mut head = [0; 8];
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let [a, b, c, d, kind @ ..] = head;
        if kind == *b"IDAT" {
            break;
        }
        kinds.push(kind);
        // Behind the content stands its checksum.
        next = i64::from(u32::from_be_bytes([a, b, c, d])) + 4;
    }
    kinds
}

/// Returns the matrix from linear light of primaries and a white to linear sRGB.
fn matrix_of(white: XyY, primaries: ColorPrimaries) -> Matrix3d {
    let mut profile = ColorProfile::new_srgb();
    profile.update_rgb_colorimetry(white, primaries);
    profile.transform_matrix(&ColorProfile::new_srgb())
}

/// Returns what numbers of Rec. ITU-T H.273 state.
fn of_code_points(points: &png::CodingIndependentCodePoints) -> Result<Option<StatedColors>, String> {
    let name = format!("cICP {}, {}", points.color_primaries, points.transfer_function);
    let unknown = || format!("has {name}, which names no primaries or no curve");
    let primaries = CicpColorPrimaries::try_from(points.color_primaries).map_err(|_| unknown())?;
    let transfer = TransferCharacteristics::try_from(points.transfer_function).map_err(|_| unknown())?;
    if matches!(transfer, TransferCharacteristics::Smpte2084 | TransferCharacteristics::Hlg) {
        return Err(hdr(&name));
    }
    if points.matrix_coefficients != 0 || !points.is_video_full_range_image {
        return Err(format!(
            "has {name} of video levels or of luma and chroma, expected full levels of red, green and blue"
        ));
    }
    let white = match primaries {
        CicpColorPrimaries::Bt470M | CicpColorPrimaries::GenericFilm => (0.310, 0.316),
        CicpColorPrimaries::Xyz => (1.0 / 3.0, 1.0 / 3.0),
        CicpColorPrimaries::Smpte431 => (0.314, 0.351),
        _ => (0.3127, 0.3290),
    };
    let primaries = ColorPrimaries::try_from(primaries).map_err(|_| unknown())?;
    let curve = ToneReprCurve::make_cicp_linear_evaluator(transfer).map_err(|_| unknown())?;
    let light = |code: u16| f64::from(curve.evaluate_value(f32::from(code) / f32::from(u16::MAX)));
    let curve: Vec<f64> = (0..=u16::MAX).map(light).collect();
    StatedColors::made(
        name,
        [curve.clone(), curve.clone(), curve],
        matrix_of(XyY::new(white.0, white.1, 1.0), primaries),
    )
}

/// Returns the profile of a TIFF file, whose field is of bytes, or of bytes of no kind.
fn profile_of_tiff(path: &Path) -> Result<Option<Vec<u8>>, String> {
    let decoder = PictureFile::open(path).ok().and_then(|file| tiff::decoder::Decoder::new(BufReader::new(file)).ok());
    let Some(decoder) = decoder else { return Ok(None) };
    let mut limits = tiff::decoder::Limits::default();
    limits.ifd_value_size = 1 << 26;
    let mut decoder = decoder.with_limits(limits);
    let profile = decoder.find_tag(tiff::tags::Tag::IccProfile).map_err(|_| damaged("an ICC profile"))?;
    profile.map(|own| own.into_u8_vec().map_err(|_| damaged("an ICC profile"))).transpose()
}

/// What stands in a JPEG file before its pixels.
#[derive(Default)]
struct JpegHead {
    /// How many colors it has, by the head of its frame (ITU-T T.81, B.2.2).
    n_colors: Option<usize>,
    /// Whether a segment is a part of a profile (ICC.1:2022, B.4).
    states_profile: bool,
}

impl JpegHead {
    fn of(path: &Path) -> Self {
        let (bytes, mut head, mut at) = (std::fs::read(path).unwrap_or_default(), Self::default(), 2);
        while let Some(&[0xFF, marker, high, low]) = bytes.get(at..at + 4) {
            let content = bytes.get(at + 4..).unwrap_or_default();
            head.states_profile |= marker == 0xE2 && content.starts_with(b"ICC_PROFILE\0");
            // Heads of frames are C0 to CF but for tables of codes and arithmetic (C4, C8, CC).
            if (0xC0..=0xCF).contains(&marker) && ![0xC4, 0xC8, 0xCC].contains(&marker) {
                head.n_colors = head.n_colors.or(content.get(5).map(|n| usize::from(*n)));
            }
            if marker == 0xDA {
                break;
            }
            at += 2 + (usize::from(high) << 8 | usize::from(low));
        }
        head
    }
}
