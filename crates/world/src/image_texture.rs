//! Pictures laid over surfaces.

use serde::{Deserialize, Serialize};
use std::{path::Path, sync::Arc};

use dioptric_spectrum::{SmoothReflectance, srgb_decode};
use glam::Vec2;

use crate::WorldError;

/// What lies beyond the edges of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// The picture again.
    Repeat,
    /// The picture again, every other time turned about its edge.
    Mirror,
    /// Its edge, drawn out.
    Clamp,
    /// Nothing: black.
    Black,
}

/// How the numbers of a picture of 8 or 16 bits stand for light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Encoding {
    /// By the sRGB curve.
    Srgb,
    /// In proportion.
    Linear,
    /// As a power: light = code^gamma.
    Gamma(f32),
}

/// A picture, looked up between its samples by bilinear interpolation of linear values.
///
/// Texture coordinates run from (0, 0) at its lower left to (1, 1) at its upper right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Reference", from = "Reference")]
pub struct ImageTexture {
    columns: usize,
    rows: usize,
    texels: Arc<Texels>,
    /// Along u and along v.
    wraps: [Wrap; 2],
    /// Whether a point has the color of its sample, with nothing between samples.
    is_stepped: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct Texels {
    rgb: Colors,
    /// None where all is opaque.
    alpha: Option<Alpha>,
}

#[derive(Clone, Debug, PartialEq)]
enum Colors {
    /// Codes and the light that each stands for.
    Bytes {
        rgb: Vec<[u8; 3]>,
        light: Box<[f32; 256]>,
    },
    Linear(Vec<[f32; 3]>),
}

#[derive(Clone, Debug, PartialEq)]
enum Alpha {
    Bytes(Vec<u8>),
    Linear(Vec<f32>),
}

/// The largest picture that is read, samples.
const MAX_SAMPLES: u64 = 1 << 28;

/// What a texel takes beside the sample of the file that it is made from, bytes.
const TEXEL_BYTES: u64 = 16;

/// A picture in a file that holds the pictures elsewhere.
#[derive(Serialize, Deserialize)]
struct Reference {
    /// Where its samples are in memory; the number of the picture, of which a picture that was read has so many columns and no rows.
    picture: usize,
    wraps: [Wrap; 2],
    is_stepped: bool,
}

impl From<ImageTexture> for Reference {
    fn from(image: ImageTexture) -> Self {
        Self { picture: image.texels_key(), wraps: image.wraps, is_stepped: image.is_stepped }
    }
}

impl From<Reference> for ImageTexture {
    fn from(Reference { picture, wraps, is_stepped }: Reference) -> Self {
        let texels = Arc::new(Texels { rgb: Colors::Linear(Vec::new()), alpha: None });
        Self { columns: picture, rows: 0, texels, wraps, is_stepped }
    }
}

/// Shared pictures as files hold them.
pub(crate) mod shared {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::ImageTexture;

    pub(crate) fn serialize<S: Serializer>(image: &Arc<ImageTexture>, to: S) -> Result<S::Ok, S::Error> {
        image.as_ref().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<ImageTexture>, D::Error> {
        ImageTexture::deserialize(from).map(Arc::new)
    }
}

impl ImageTexture {
    /// Reads a PNG, JPEG, TGA, TIFF or EXR file; EXR is linear whatever `encoding` is.
    ///
    /// # Errors
    /// When the file can't be read as a picture, or has more than 2²⁸ samples.
    pub fn read(path: &Path, encoding: Encoding, wrap: Wrap) -> Result<Self, WorldError> {
        let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
        let format = dioptric_pictures::format_of(path).map_err(|e| unreadable(e.to_string()))?;
        if format.is_none() {
            return Err(unreadable("expected a .png, .jpg, .tga, .tif or .exr picture".to_owned()));
        }
        if cfg!(not(feature = "jpeg")) && format == Some(image::ImageFormat::Jpeg) {
            return Err(WorldError::LacksFeature { file: path.to_owned(), feature: "jpeg" });
        }
        let picture = dioptric_pictures::read_within(path, TEXEL_BYTES).map_err(|e| unreadable(e.to_string()))?;
        Self::of_picture(&picture, encoding, wrap).map_err(unreadable)
    }

    /// Reads a picture that is held within another file, of the kinds that [`read`](Self::read) takes.
    #[cfg(feature = "gltf")]
    pub(crate) fn of_bytes(bytes: &[u8], encoding: Encoding, wrap: Wrap) -> Result<Self, String> {
        if bytes.starts_with(b"\xabKTX 20\xbb") {
            return Self::of_ktx2(bytes, encoding, wrap);
        }
        let reader =
            image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
        match reader.format() {
            None => return Err("expected a PNG, JPEG, TGA, TIFF, WebP, KTX 2 or EXR picture".to_owned()),
            Some(image::ImageFormat::Jpeg) if cfg!(not(feature = "jpeg")) => {
                return Err("this build cannot read JPEG, expected one with the feature 'jpeg'".to_owned());
            }
            Some(_) => {}
        }
        let picture = dioptric_pictures::decode_within(bytes, TEXEL_BYTES).map_err(|e| e.to_string())?;
        Self::of_picture(&picture, encoding, wrap)
    }

    /// Reads a KTX 2 picture packed by Basis Universal.
    #[cfg(feature = "gltf")]
    fn of_ktx2(bytes: &[u8], encoding: Encoding, wrap: Wrap) -> Result<Self, String> {
        use basisu::{DecodeFlags, TargetFormat::Rgba32, Transcoder};
        let unread = "of KTX 2, expected one packed by Basis Universal as ETC1S or UASTC of 8 bits";
        let (columns, rows) = ktx2_size(bytes).ok_or(unread)?;
        let n_bytes = u64::from(columns) * u64::from(rows) * (4 + TEXEL_BYTES);
        dioptric_files::memory::check(n_bytes, bytes.len() as u64).map_err(|e| e.to_string())?;
        let texture = Transcoder::new(bytes).ok().filter(|texture| texture.supports(Rgba32) && !texture.is_video());
        let texture = texture.ok_or(unread)?;
        let rgba = texture.transcode(0, Rgba32, DecodeFlags::NONE).map_err(|_| unread)?;
        let rgba = image::DynamicImage::ImageRgba8(image::RgbaImage::from_raw(columns, rows, rgba).ok_or(unread)?);
        let picture = if texture.has_alpha() { rgba } else { rgba.to_rgb8().into() };
        Self::of_picture(&picture, encoding, wrap)
    }

    fn of_picture(picture: &image::DynamicImage, encoding: Encoding, wrap: Wrap) -> Result<Self, String> {
        use image::DynamicImage as D;
        let (columns, rows) = (picture.width() as usize, picture.height() as usize);
        if columns == 0 || rows == 0 || columns as u64 * rows as u64 > MAX_SAMPLES {
            return Err(format!("{columns} x {rows} samples: expected 1 to 2²⁸"));
        }
        let has_alpha = picture.color().has_alpha();
        let (rgb, alpha) = match picture {
            D::ImageRgb32F(_) | D::ImageRgba32F(_) => {
                let finite = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
                let rgb = Colors::Linear(picture.to_rgb32f().pixels().map(|p| p.0.map(finite)).collect());
                let alpha = || Alpha::Linear(picture.to_rgba32f().pixels().map(|p| finite(p.0[3])).collect());
                (rgb, has_alpha.then(alpha))
            }
            D::ImageLuma16(_) | D::ImageLumaA16(_) | D::ImageRgb16(_) | D::ImageRgba16(_) => {
                let light = |v: u16| encoding.light(f64::from(v) / 65535.0);
                let rgb = Colors::Linear(picture.to_rgb16().pixels().map(|p| p.0.map(light)).collect());
                let alpha =
                    || Alpha::Linear(picture.to_rgba16().pixels().map(|p| f32::from(p.0[3]) / 65535.0).collect());
                (rgb, has_alpha.then(alpha))
            }
            _ => {
                let rgb = Colors::Bytes {
                    rgb: picture.to_rgb8().pixels().map(|p| p.0).collect(),
                    light: Box::new(std::array::from_fn(|code| encoding.light(code as f64 / 255.0))),
                };
                let alpha = || Alpha::Bytes(picture.to_rgba8().pixels().map(|p| p.0[3]).collect());
                (rgb, has_alpha.then(alpha))
            }
        };
        let texels = Arc::new(Texels { rgb, alpha });
        Ok(Self { columns, rows, texels, wraps: [wrap; 2], is_stepped: false })
    }

    /// Returns a picture of linear sRGB colors, row by row from the top.
    ///
    /// # Errors
    /// When the list has not one finite color a sample, 1 × 1 at least.
    pub fn from_linear(columns: usize, rgb: Vec<[f32; 3]>, wrap: Wrap) -> Result<Self, WorldError> {
        let is_sound = columns > 0 && !rgb.is_empty() && rgb.len().is_multiple_of(columns);
        if !is_sound || !rgb.iter().flatten().all(|v| v.is_finite()) {
            return Err(WorldError::Setting {
                what: "the samples of a texture",
                value: format!("{} in rows of {columns}", rgb.len()),
                expected: "whole rows of finite colors",
            });
        }
        let rows = rgb.len() / columns;
        let texels = Arc::new(Texels { rgb: Colors::Linear(rgb), alpha: None });
        Ok(Self { columns, rows, texels, wraps: [wrap; 2], is_stepped: false })
    }

    /// Returns the same picture with these edges along u and v, between its samples or in steps.
    #[must_use]
    pub(crate) fn sampled(&self, wraps: [Wrap; 2], is_stepped: bool) -> Self {
        Self { wraps, is_stepped, ..self.clone() }
    }

    /// Returns the picture as files hold it, and how its numbers stand for light: those of 8 bits by the sRGB curve or in proportion, all
    /// others in proportion as floats.
    pub(crate) fn as_picture(&self) -> (image::DynamicImage, Encoding) {
        use image::DynamicImage as D;
        let (columns, rows) = (self.columns as u32, self.rows as u32);
        let table =
            |encoding: Encoding| -> [f32; 256] { std::array::from_fn(|code| encoding.light(code as f64 / 255.0)) };
        let known = |light: &[f32; 256]| [Encoding::Srgb, Encoding::Linear].into_iter().find(|e| table(*e) == *light);
        let alpha_is_bytes = !matches!(self.texels.alpha, Some(Alpha::Linear(_)));
        if let Colors::Bytes { rgb, light } = &self.texels.rgb
            && let Some(encoding) = known(light)
            && alpha_is_bytes
        {
            let picture = match &self.texels.alpha {
                Some(Alpha::Bytes(alpha)) => {
                    let bytes = rgb.iter().zip(alpha).flat_map(|([r, g, b], a)| [*r, *g, *b, *a]).collect();
                    image::RgbaImage::from_raw(columns, rows, bytes).map(D::ImageRgba8)
                }
                _ => image::RgbImage::from_raw(columns, rows, rgb.as_flattened().to_vec()).map(D::ImageRgb8),
            };
            return (picture.expect("as many samples as its size says"), encoding);
        }
        let rgb: Vec<[f32; 3]> = match &self.texels.rgb {
            Colors::Bytes { rgb, light } => {
                rgb.iter().map(|codes| codes.map(|code| light[usize::from(code)])).collect()
            }
            Colors::Linear(rgb) => rgb.clone(),
        };
        let alpha: Option<Vec<f32>> = self.texels.alpha.as_ref().map(|alpha| match alpha {
            Alpha::Bytes(codes) => codes.iter().map(|code| f32::from(*code) / 255.0).collect(),
            Alpha::Linear(values) => values.clone(),
        });
        let picture = match alpha {
            Some(alpha) => {
                let samples = rgb.iter().zip(alpha).flat_map(|([r, g, b], a)| [*r, *g, *b, a]).collect();
                image::Rgba32FImage::from_raw(columns, rows, samples).map(D::ImageRgba32F)
            }
            None => image::Rgb32FImage::from_raw(columns, rows, rgb.into_flattened()).map(D::ImageRgb32F),
        };
        (picture.expect("as many samples as its size says"), Encoding::Linear)
    }

    /// A number that two pictures share where their samples are the same in memory.
    pub(crate) fn texels_key(&self) -> usize {
        Arc::as_ptr(&self.texels) as usize
    }

    /// Returns one channel of it, 3 for alpha, as a gray picture of the same edges.
    pub(crate) fn channel(&self, channel: usize) -> Self {
        let gray = |v: f32| [v; 3];
        let rgb = match (&self.texels.rgb, &self.texels.alpha) {
            (_, Some(Alpha::Bytes(alpha))) if channel == 3 => Colors::Bytes {
                rgb: alpha.iter().map(|a| [*a; 3]).collect(),
                light: Box::new(std::array::from_fn(|code| Encoding::Linear.light(code as f64 / 255.0))),
            },
            (_, Some(Alpha::Linear(alpha))) if channel == 3 => Colors::Linear(alpha.iter().map(|a| gray(*a)).collect()),
            (_, None) if channel == 3 => Colors::Linear(vec![gray(1.0); self.columns * self.rows]),
            (Colors::Bytes { rgb, light }, _) => {
                Colors::Bytes { rgb: rgb.iter().map(|codes| [codes[channel]; 3]).collect(), light: light.clone() }
            }
            (Colors::Linear(rgb), _) => Colors::Linear(rgb.iter().map(|rgb| gray(rgb[channel])).collect()),
        };
        Self { texels: Arc::new(Texels { rgb, alpha: None }), ..self.clone() }
    }

    /// What lies beyond its edges along u and v, and whether it is looked up in steps.
    pub(crate) fn sampling(&self) -> ([Wrap; 2], bool) {
        (self.wraps, self.is_stepped)
    }

    /// Returns the picture with its light multiplied by a color.
    pub(crate) fn tinted(&self, by: [f32; 3]) -> Self {
        let times = |rgb: [f32; 3]| std::array::from_fn(|k| rgb[k] * by[k]);
        let rgb = match &self.texels.rgb {
            Colors::Bytes { rgb, light } => {
                rgb.iter().map(|codes| times(codes.map(|code| light[usize::from(code)]))).collect()
            }
            Colors::Linear(rgb) => rgb.iter().map(|rgb| times(*rgb)).collect(),
        };
        let texels = Arc::new(Texels { rgb: Colors::Linear(rgb), alpha: self.texels.alpha.clone() });
        Self { texels, ..self.clone() }
    }

    /// Whether it says how opaque its samples are.
    pub fn has_alpha(&self) -> bool {
        self.texels.alpha.is_some()
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// Returns the linear sRGB color at texture coordinates.
    pub fn rgb_at(&self, uv: Vec2) -> [f32; 3] {
        self.between(uv, |index| match &self.texels.rgb {
            Colors::Bytes { rgb, light } => rgb[index].map(|code| light[usize::from(code)]),
            Colors::Linear(rgb) => rgb[index],
        })
    }

    /// Returns how opaque it is at texture coordinates, 0–1; 1 of pictures without alpha.
    pub fn alpha_at(&self, uv: Vec2) -> f32 {
        let Some(alpha) = &self.texels.alpha else { return 1.0 };
        let of = |index: usize| match alpha {
            Alpha::Bytes(codes) => f32::from(codes[index]) / 255.0,
            Alpha::Linear(values) => values[index],
        };
        self.between(uv, |index| [of(index)])[0]
    }

    /// Returns the value between samples, which are given by number.
    fn between<const K: usize>(&self, uv: Vec2, sample: impl Fn(usize) -> [f32; K]) -> [f32; K] {
        if !uv.is_finite() {
            return [0.0; K];
        }
        let at = |x: i64, y: i64| self.index(x, y).map_or([0.0; K], &sample);
        let (x, y) = (uv.x * self.columns as f32, (1.0 - uv.y) * self.rows as f32);
        if self.is_stepped {
            return at(x.floor() as i64, y.floor() as i64);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i64, y0 as i64);
        let [a, b, c, d] = [
            at(x0, y0),
            at(x0.saturating_add(1), y0),
            at(x0, y0.saturating_add(1)),
            at(x0.saturating_add(1), y0.saturating_add(1)),
        ];
        std::array::from_fn(|k| (1.0 - fy) * ((1.0 - fx) * a[k] + fx * b[k]) + fy * ((1.0 - fx) * c[k] + fx * d[k]))
    }

    pub(crate) fn reflectance_at(&self, uv: Vec2) -> SmoothReflectance {
        SmoothReflectance::of_rgb(self.rgb_at(uv))
    }

    /// Returns the number of the sample at a column and row that may lie beyond the edges; none where it is black there.
    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let along = |at: i64, n: usize, wrap: Wrap| {
            let n = n as i64;
            Some(match wrap {
                Wrap::Repeat => at.rem_euclid(n),
                Wrap::Mirror => {
                    let at = at.rem_euclid(2 * n);
                    at.min(2 * n - 1 - at)
                }
                Wrap::Clamp => at.clamp(0, n - 1),
                Wrap::Black if !(0..n).contains(&at) => return None,
                Wrap::Black => at,
            })
        };
        let (x, y) = (along(x, self.columns, self.wraps[0])?, along(y, self.rows, self.wraps[1])?);
        Some(y as usize * self.columns + x as usize)
    }
}

impl Encoding {
    fn light(self, code: f64) -> f32 {
        (match self {
            Self::Srgb => srgb_decode(code),
            Self::Linear => code,
            Self::Gamma(gamma) => code.powf(f64::from(gamma)),
        }) as f32
    }
}

/// Returns the size of a KTX 2 picture whose parts lie within it and are no larger than that size needs, which the transcoder
/// takes for granted; none of other models than ETC1S and UASTC, and of other supercompressions than that of Basis and Zstandard.
#[cfg(feature = "gltf")]
fn ktx2_size(bytes: &[u8]) -> Option<(u32, u32)> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?));
    let long = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?));
    let is_within = |at: u64, length: u64| at.checked_add(length).is_some_and(|end| end <= bytes.len() as u64);
    let (columns, rows, n_levels) = (word(20)?, word(24)?, word(40)?);
    let n_samples = u64::from(columns) * u64::from(rows);
    let is_flat = word(28)? == 0 && word(32)? <= 1 && word(36)? == 1 && (1..=16).contains(&n_levels);
    let (scheme, descriptor) = (word(44)?, word(48)?);
    let model = word(usize::try_from(descriptor).ok()?.checked_add(12)?)? & 255;
    if word(12)? != 0
        || !is_flat
        || scheme > 2
        || ![163, 166].contains(&model)
        || !(1..=MAX_SAMPLES).contains(&n_samples)
    {
        return None;
    }
    let mut is_sound = is_within(descriptor.into(), word(52)?.into()) && is_within(word(56)?.into(), word(60)?.into());
    is_sound &= is_within(long(64)?, long(72)?);
    // Sixteen bytes for each block of four by four.
    let most = u64::from(columns.div_ceil(4)) * u64::from(rows.div_ceil(4)) * 16;
    for level in 0..n_levels as usize {
        is_sound &= is_within(long(80 + 24 * level)?, long(88 + 24 * level)?) && long(96 + 24 * level)? <= most;
    }
    // Of UASTC the first level has them all.
    is_sound &= model == 163 || most == if scheme == 0 { long(88)? } else { long(96)? };
    is_sound.then_some((columns, rows))
}

#[cfg(test)]
mod tests {
    use dioptric_pictures::save;

    use super::*;

    #[test]
    fn picture_stands_upright() {
        let colors = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        let image = ImageTexture::from_linear(2, colors, Wrap::Clamp).unwrap();
        assert_eq!(image.rgb_at(Vec2::new(0.25, 0.75)), [1.0, 0.0, 0.0]);
        assert_eq!(image.rgb_at(Vec2::new(0.75, 0.25)), [1.0; 3]);
        assert_eq!(image.rgb_at(Vec2::new(0.5, 0.75)), [0.5, 0.5, 0.0]);
        assert_eq!(image.rgb_at(Vec2::new(-3.0, 5.0)), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn edges_are_wrapped() {
        let image = |wrap| ImageTexture::from_linear(2, vec![[0.2; 3], [0.6; 3]], wrap).unwrap();
        let at = |wrap, x: f32| image(wrap).rgb_at(Vec2::new(x, 0.5))[0];
        assert!((at(Wrap::Repeat, 1.25) - 0.2).abs() < 1e-6 && (at(Wrap::Repeat, 0.0) - 0.4).abs() < 1e-6);
        assert_eq!((at(Wrap::Clamp, 1.25), at(Wrap::Black, 1.25)), (0.6, 0.0));
        assert_eq!(image(Wrap::Repeat).rgb_at(Vec2::new(f32::NAN, 0.0)), [0.0; 3]);
    }

    #[test]
    fn files_are_read_by_their_encoding() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.tga"] {
            let path = folder.path().join(name);
            save(&image::RgbImage::from_pixel(1, 1, image::Rgb([0, 128, 255])).into(), &path).unwrap();
            for (encoding, middle) in
                [(Encoding::Srgb, 0.215_86), (Encoding::Linear, 0.501_96), (Encoding::Gamma(2.2), 0.219_52)]
            {
                let [r, g, b] = ImageTexture::read(&path, encoding, Wrap::Repeat).unwrap().rgb_at(Vec2::ZERO);
                assert!(r == 0.0 && b == 1.0 && (g - middle).abs() < 1e-5, "{g}");
            }
        }
        let path = folder.path().join("b.exr");
        save(&image::Rgb32FImage::from_pixel(1, 1, image::Rgb([0.25, 0.5, 7.0])).into(), &path).unwrap();
        assert_eq!(
            ImageTexture::read(&path, Encoding::Srgb, Wrap::Repeat).unwrap().rgb_at(Vec2::ZERO),
            [0.25, 0.5, 7.0]
        );
        let path = folder.path().join("c.png");
        std::fs::write(&path, b"no picture").unwrap();
        assert!(ImageTexture::read(&path, Encoding::Srgb, Wrap::Repeat).unwrap_err().to_string().contains("c.png"));
    }

    /// Changed copies of pictures packed by Basis Universal are pictures or not, and no more.
    #[cfg(feature = "gltf")]
    #[test]
    fn broken_packed_pictures_do_no_harm() {
        for (name, seed) in [
            ("etc1s.ktx2", &include_bytes!("../tests/corpus/etc1s.ktx2")[..]),
            ("uastc.ktx2", &include_bytes!("../tests/corpus/uastc.ktx2")[..]),
        ] {
            let n_read = (0..400).filter(|number| {
                let bytes = dioptric_golden::mutant(seed, *number);
                ImageTexture::of_bytes(&bytes, Encoding::Srgb, Wrap::Repeat).is_ok()
            });
            assert!(n_read.count() > 0, "{name}");
        }
    }
}
