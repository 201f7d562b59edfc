//! Values that vary over a surface.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use dioptric_spectrum::{SmoothReflectance, lanes};
use glam::{DVec3, Vec2};

use crate::{
    ImageTexture, PatternRef, Procedural, SpectralCurve, TextureId, UvMapping, pattern::MOST_SHARES, procedural::Found,
    uv::TexturePoint,
};

/// A value over a surface: a spectrum where a color is asked for, a number where a number is.
///
/// A spectrum asked for as a number is its mean over 400–700 nm; a picture, the mean of its three channels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Texture {
    /// The same spectrum everywhere.
    Curve(SpectralCurve),
    /// A picture, whose linear sRGB colors are lifted to smooth reflectances between 0 and 1.
    Image {
        /// The picture.
        #[serde(with = "crate::image_texture::shared")]
        image: Arc<ImageTexture>,
        /// Which point of the picture is where.
        mapping: UvMapping,
        /// What its values are multiplied by.
        scale: f32,
    },
    /// A board of two textures, each field 1 × 1 of the mapped coordinates; the field from (0, 0) is the first's.
    Checkerboard {
        /// What is in the fields of even numbers, and in the others.
        fields: [TextureId; 2],
        /// Which point of the board is where.
        mapping: UvMapping,
    },
    /// One channel of a picture, as a number: `scale · channel + offset`.
    Channel {
        /// The picture.
        #[serde(with = "crate::image_texture::shared")]
        image: Arc<ImageTexture>,
        /// 0 red, 1 green, 2 blue, 3 alpha, which is 1 in pictures without it.
        channel: usize,
        /// Which point of the picture is where.
        mapping: UvMapping,
        /// What its values are multiplied by.
        scale: f32,
        /// What is added to them.
        offset: f32,
    },
    /// The linear sRGB colors of the vertices as reflectances; white where a mesh has none.
    VertexColors,
    /// The alpha of the vertices; 1 where a mesh has none.
    VertexAlpha,
    /// 1 where a number is at least so large, else 0.
    Step {
        /// The number.
        of: TextureId,
        /// The least that counts.
        at_least: f32,
    },
    /// GGX's α of a roughness from 0 to 1, by the law of a version of pbrt.
    Alpha {
        /// The roughness.
        roughness: TextureId,
        /// Which law.
        by: RoughnessLaw,
    },
    /// A pattern by formula.
    Procedural(Box<Procedural>),
    /// One texture times another.
    Product([TextureId; 2]),
    /// Two textures mixed.
    Blend {
        /// The two.
        of: [TextureId; 2],
        /// The share of the second, 0–1.
        amount: TextureId,
    },
    /// Textures that share the surface by a formula of the place, in the frame of the shape.
    #[serde(skip)]
    Pattern {
        /// Up to 32 textures.
        of: Vec<TextureId>,
        /// What each counts where.
        by: PatternRef,
    },
}

/// How a roughness from 0 to 1 becomes GGX's α.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RoughnessLaw {
    /// α = √roughness: pbrt's 4th version.
    Root,
    /// The polynomial of log roughness of pbrt's 3rd version.
    LogPolynomial,
    /// The width of Blinn's lobe of exponent 1/roughness, which pbrt's 2nd version has: α² = 2/(1/roughness + 2).
    Blinn,
}

impl RoughnessLaw {
    /// Returns α.
    pub fn alpha(self, roughness: f32) -> f32 {
        let roughness = roughness.max(0.0);
        let alpha = match self {
            Self::Root => roughness.sqrt(),
            Self::LogPolynomial => {
                let x = roughness.max(1e-3).ln();
                1.62142 + x * (0.819_955 + x * (0.1734 + x * (0.017_120_1 + x * 0.000_640_711)))
            }
            Self::Blinn => (2.0 / (1.0 / roughness.max(1e-6) + 2.0)).sqrt(),
        };
        alpha.clamp(0.0, 1.0)
    }
}

/// The deepest that textures may be made of others.
pub(crate) const MAX_DEPTH: usize = 32;

impl Texture {
    /// The textures that this one is made of.
    pub(crate) fn parts(&self) -> Vec<TextureId> {
        match self {
            Self::Curve(_) | Self::Image { .. } | Self::Channel { .. } | Self::VertexColors | Self::VertexAlpha => {
                Vec::new()
            }
            Self::Procedural(procedural) => procedural.parts(),
            Self::Pattern { of, .. } => of.clone(),
            Self::Step { of, .. } | Self::Alpha { roughness: of, .. } => vec![*of],
            Self::Checkerboard { fields: of, .. } | Self::Product(of) => of.to_vec(),
            Self::Blend { of: [a, b], amount } => vec![*a, *b, *amount],
        }
    }
}

impl Texture {
    /// Whether it has reflectances that are lifted from colors.
    pub(crate) fn has_colors(&self) -> bool {
        match self {
            Self::Curve(curve) => curve.is_of_color(),
            Self::Image { .. } | Self::VertexColors => true,
            _ => false,
        }
    }
}

/// Looks textures up.
#[derive(Clone, Copy)]
pub(crate) struct Textures<'a>(pub(crate) &'a [Texture]);

impl Textures<'_> {
    /// Returns the spectrum at a point; not held to any range.
    pub(crate) fn spectral<const N: usize>(
        self,
        id: TextureId,
        at: &TexturePoint<'_>,
        wavelengths_nm: &[f32; N],
    ) -> [f32; N] {
        match &self.0[id.0 as usize] {
            Texture::Curve(curve) => curve.at(wavelengths_nm),
            Texture::Image { image, mapping, scale } => {
                let reflectance = image.reflectance_at(mapping.at(at)).at(wavelengths_nm);
                lanes(|lane| reflectance[lane] * scale)
            }
            Texture::Checkerboard { fields, mapping } => {
                self.spectral(fields[field(mapping.at(at))], at, wavelengths_nm)
            }
            Texture::Channel { .. } | Texture::VertexAlpha | Texture::Step { .. } | Texture::Alpha { .. } => {
                [self.number(id, at); N]
            }
            Texture::Procedural(procedural) => match procedural.at(at) {
                Found::Number(value) => [value; N],
                Found::Color(rgb) => SmoothReflectance::of_rgb(rgb).at(wavelengths_nm),
                Found::Texture(of) => self.spectral(of, at, wavelengths_nm),
                Found::Mixture(parts) => {
                    let mut sum = [0.0; N];
                    for (part, counts) in parts {
                        let value = self.spectral(part, at, wavelengths_nm);
                        sum = lanes(|i| sum[i] + counts * value[i]);
                    }
                    sum
                }
            },
            Texture::VertexColors => {
                let [r, g, b, _] = at.color;
                SmoothReflectance::of_rgb([r, g, b]).at(wavelengths_nm)
            }
            Texture::Product([a, b]) => {
                let [a, b] = [*a, *b].map(|t| self.spectral(t, at, wavelengths_nm));
                lanes(|i| a[i] * b[i])
            }
            Texture::Blend { of: [a, b], amount } => {
                let [a, b] = [*a, *b].map(|t| self.spectral(t, at, wavelengths_nm));
                let amount = self.number(*amount, at).clamp(0.0, 1.0);
                lanes(|i| a[i] + amount * (b[i] - a[i]))
            }
            Texture::Pattern { of, by } => {
                let mut sum = [0.0; N];
                for (share, part) in shares(of, by, at) {
                    let value = self.spectral(part, at, wavelengths_nm);
                    sum = lanes(|i| sum[i] + share * value[i]);
                }
                sum
            }
        }
    }

    /// Returns the relief of a pattern at the point: what is added to its normal.
    pub(crate) fn tilt(self, id: TextureId, at: &TexturePoint<'_>) -> DVec3 {
        match &self.0[id.0 as usize] {
            Texture::Pattern { by, .. } => by.tilt(&at.own()),
            _ => DVec3::ZERO,
        }
    }

    /// Returns the number at a point.
    pub(crate) fn number(self, id: TextureId, at: &TexturePoint<'_>) -> f32 {
        match &self.0[id.0 as usize] {
            Texture::Curve(curve) => curve.mean_visible(),
            Texture::Image { image, mapping, scale } => scale * image.rgb_at(mapping.at(at)).iter().sum::<f32>() / 3.0,
            Texture::Checkerboard { fields, mapping } => self.number(fields[field(mapping.at(at))], at),
            Texture::Channel { image, channel, mapping, scale, offset } => {
                let at = mapping.at(at);
                let value = if *channel < 3 { image.rgb_at(at)[*channel] } else { image.alpha_at(at) };
                scale * value + offset
            }
            Texture::VertexColors => at.color[..3].iter().sum::<f32>() / 3.0,
            Texture::VertexAlpha => at.color[3],
            Texture::Alpha { roughness, by } => by.alpha(self.number(*roughness, at)),
            Texture::Procedural(procedural) => match procedural.at(at) {
                Found::Number(value) => value,
                Found::Color(rgb) => rgb.iter().sum::<f32>() / 3.0,
                Found::Texture(of) => self.number(of, at),
                Found::Mixture(parts) => parts.iter().map(|(part, counts)| counts * self.number(*part, at)).sum(),
            },
            Texture::Step { of, at_least } => f32::from(self.number(*of, at) >= *at_least),
            Texture::Product([a, b]) => self.number(*a, at) * self.number(*b, at),
            Texture::Blend { of: [a, b], amount } => {
                let [a, b] = [*a, *b].map(|t| self.number(t, at));
                a + self.number(*amount, at).clamp(0.0, 1.0) * (b - a)
            }
            Texture::Pattern { of, by } => shares(of, by, at).map(|(share, part)| share * self.number(part, at)).sum(),
        }
    }

    /// Returns the linear sRGB color at a point of a picture, or of the pictures a texture is made of, for normal maps.
    pub(crate) fn rgb(self, id: TextureId, at: &TexturePoint<'_>) -> [f32; 3] {
        match &self.0[id.0 as usize] {
            Texture::Image { image, mapping, .. } => image.rgb_at(mapping.at(at)),
            _ => [self.number(id, at); 3],
        }
    }
}

/// Returns the textures of a pattern that count at the point, each with its share.
fn shares<'b>(
    of: &'b [TextureId],
    by: &PatternRef,
    at: &TexturePoint<'_>,
) -> impl Iterator<Item = (f32, TextureId)> + use<'b> {
    let mut shares = [0.0; MOST_SHARES];
    by.shares(&at.own(), &mut shares[..of.len()]);
    shares.into_iter().zip(of.iter().copied()).filter(|(share, _)| *share != 0.0)
}

fn field(at: Vec2) -> usize {
    (at.x.floor() + at.y.floor()).rem_euclid(2.0) as usize
}
