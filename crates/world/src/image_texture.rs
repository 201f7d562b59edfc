//! Pictures laid over surfaces.

use std::path::Path;

use dioptric_spectrum::srgb_decode;
use glam::Vec2;

use crate::{WorldError, upsample::SmoothReflectance};

/// What lies beyond the edges of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    Repeat,
    /// Its edge, drawn out.
    Clamp,
    /// Nothing: black.
    Black,
}

/// How the numbers of a picture of 8 or 16 bits stand for light.
#[derive(Clone, Copy, Debug, PartialEq)]
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
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTexture {
    columns: usize,
    rows: usize,
    texels: Texels,
    wrap: Wrap,
}

#[derive(Clone, Debug, PartialEq)]
enum Texels {
    /// Codes and the light that each stands for.
    Bytes {
        rgb: Vec<[u8; 3]>,
        light: Box<[f32; 256]>,
    },
    Linear(Vec<[f32; 3]>),
}

/// The largest picture that is read, samples.
const MAX_SAMPLES: u64 = 1 << 28;

/// What a texel takes beside the sample of the file that it is made from, bytes.
const TEXEL_BYTES: u64 = 12;

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
        let (columns, rows) = (picture.width() as usize, picture.height() as usize);
        if columns == 0 || rows == 0 || columns as u64 * rows as u64 > MAX_SAMPLES {
            return Err(unreadable(format!("{columns} x {rows} samples: expected 1 to 2²⁸")));
        }
        let texels = match picture {
            image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_) => {
                let finite = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
                Texels::Linear(picture.to_rgb32f().pixels().map(|p| p.0.map(finite)).collect())
            }
            image::DynamicImage::ImageLuma16(_)
            | image::DynamicImage::ImageLumaA16(_)
            | image::DynamicImage::ImageRgb16(_)
            | image::DynamicImage::ImageRgba16(_) => {
                let light = |v: u16| encoding.light(f64::from(v) / 65535.0);
                Texels::Linear(picture.to_rgb16().pixels().map(|p| p.0.map(light)).collect())
            }
            _ => Texels::Bytes {
                rgb: picture.to_rgb8().pixels().map(|p| p.0).collect(),
                light: Box::new(std::array::from_fn(|code| encoding.light(code as f64 / 255.0))),
            },
        };
        Ok(Self { columns, rows, texels, wrap })
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
        Ok(Self { columns, rows: rgb.len() / columns, texels: Texels::Linear(rgb), wrap })
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// Returns the linear sRGB color at texture coordinates.
    pub fn rgb_at(&self, uv: Vec2) -> [f32; 3] {
        if !uv.is_finite() {
            return [0.0; 3];
        }
        let x = uv.x * self.columns as f32 - 0.5;
        let y = (1.0 - uv.y) * self.rows as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let at = |dx: i64, dy: i64| self.texel(x0 as i64 + dx, y0 as i64 + dy);
        let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        std::array::from_fn(|k| (1.0 - fy) * ((1.0 - fx) * a[k] + fx * b[k]) + fy * ((1.0 - fx) * c[k] + fx * d[k]))
    }

    pub(crate) fn reflectance_at(&self, uv: Vec2) -> SmoothReflectance {
        SmoothReflectance::of_rgb(self.rgb_at(uv))
    }

    fn texel(&self, x: i64, y: i64) -> [f32; 3] {
        let (columns, rows) = (self.columns as i64, self.rows as i64);
        let (x, y) = match self.wrap {
            Wrap::Repeat => (x.rem_euclid(columns), y.rem_euclid(rows)),
            Wrap::Clamp => (x.clamp(0, columns - 1), y.clamp(0, rows - 1)),
            Wrap::Black if !(0..columns).contains(&x) || !(0..rows).contains(&y) => return [0.0; 3],
            Wrap::Black => (x, y),
        };
        let index = (y * columns + x) as usize;
        match &self.texels {
            Texels::Bytes { rgb, light } => rgb[index].map(|code| light[usize::from(code)]),
            Texels::Linear(rgb) => rgb[index],
        }
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
}
