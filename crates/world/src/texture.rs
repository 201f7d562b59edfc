//! Values that vary over a surface.

use std::sync::Arc;

use glam::{DVec3, Mat2, Vec2};

use crate::{ImageTexture, PatternPoint, PatternRef, SpectralCurve, TextureId, pattern::MOST_SHARES};

/// A value over a surface: a spectrum where a color is asked for, a number where a number is.
///
/// A spectrum asked for as a number is its mean over 400–700 nm; a picture, the mean of its three channels.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// The same spectrum everywhere.
    Curve(SpectralCurve),
    /// A picture, whose linear sRGB colors are lifted to smooth reflectances between 0 and 1.
    Image {
        /// The picture.
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
    Pattern {
        /// Up to 32 textures.
        of: Vec<TextureId>,
        /// What each counts where.
        by: PatternRef,
    },
}

/// Texture coordinates as a function of those of the surface: `matrix · uv + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMapping {
    /// Turns and scales.
    pub matrix: Mat2,
    /// Moves.
    pub offset: Vec2,
}

impl UvMapping {
    /// The coordinates of the surface.
    pub const IDENTITY: Self = Self { matrix: Mat2::IDENTITY, offset: Vec2::ZERO };

    /// Returns the mapping that scales each coordinate and then moves it.
    pub fn scaled(scale: Vec2, offset: Vec2) -> Self {
        Self { matrix: Mat2::from_diagonal(scale), offset }
    }

    fn at(&self, uv: Vec2) -> Vec2 {
        self.matrix * uv + self.offset
    }
}

/// The deepest that textures may be made of others.
pub(crate) const MAX_DEPTH: usize = 32;

impl Texture {
    /// The textures that this one is made of.
    pub(crate) fn parts(&self) -> impl Iterator<Item = TextureId> {
        let parts: [Option<TextureId>; 3] = match self {
            Self::Curve(_) | Self::Image { .. } | Self::Pattern { .. } => [None; 3],
            Self::Checkerboard { fields: [a, b], .. } | Self::Product([a, b]) => [Some(*a), Some(*b), None],
            Self::Blend { of: [a, b], amount } => [Some(*a), Some(*b), Some(*amount)],
        };
        let of_pattern = if let Self::Pattern { of, .. } = self { of.as_slice() } else { &[] };
        parts.into_iter().flatten().chain(of_pattern.iter().copied())
    }
}

/// Looks textures up; those by formula at a point.
#[derive(Clone, Copy)]
pub(crate) struct Textures<'a>(pub(crate) &'a [Texture], pub(crate) &'a PatternPoint);

impl Textures<'_> {
    /// Returns the spectrum at a point; not held to any range.
    pub(crate) fn spectral<const N: usize>(self, id: TextureId, uv: Vec2, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.0[id.0 as usize] {
            Texture::Curve(curve) => curve.at(wavelengths_nm),
            Texture::Image { image, mapping, scale } => {
                image.reflectance_at(mapping.at(uv)).at(wavelengths_nm).map(|v| v * scale)
            }
            Texture::Checkerboard { fields, mapping } => {
                self.spectral(fields[field(mapping.at(uv))], uv, wavelengths_nm)
            }
            Texture::Product([a, b]) => {
                let [a, b] = [*a, *b].map(|t| self.spectral(t, uv, wavelengths_nm));
                std::array::from_fn(|i| a[i] * b[i])
            }
            Texture::Blend { of: [a, b], amount } => {
                let [a, b] = [*a, *b].map(|t| self.spectral(t, uv, wavelengths_nm));
                let amount = self.number(*amount, uv).clamp(0.0, 1.0);
                std::array::from_fn(|i| a[i] + amount * (b[i] - a[i]))
            }
            Texture::Pattern { of, by } => {
                let mut sum = [0.0; N];
                for (share, part) in self.shares(of, by) {
                    let value = self.spectral(part, uv, wavelengths_nm);
                    sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += share * value);
                }
                sum
            }
        }
    }

    /// Returns the textures of a pattern that count at the point, each with its share.
    fn shares<'b>(self, of: &'b [TextureId], by: &PatternRef) -> impl Iterator<Item = (f32, TextureId)> + use<'b> {
        let mut shares = [0.0; MOST_SHARES];
        by.shares(self.1, &mut shares[..of.len()]);
        shares.into_iter().zip(of.iter().copied()).filter(|(share, _)| *share != 0.0)
    }

    /// Returns the relief of a pattern at the point: what is added to its normal.
    pub(crate) fn tilt(self, id: TextureId) -> DVec3 {
        match &self.0[id.0 as usize] {
            Texture::Pattern { by, .. } => by.tilt(self.1),
            _ => DVec3::ZERO,
        }
    }

    /// Returns the number at a point.
    pub(crate) fn number(self, id: TextureId, uv: Vec2) -> f32 {
        match &self.0[id.0 as usize] {
            Texture::Curve(curve) => curve.mean_visible(),
            Texture::Image { image, mapping, scale } => scale * image.rgb_at(mapping.at(uv)).iter().sum::<f32>() / 3.0,
            Texture::Checkerboard { fields, mapping } => self.number(fields[field(mapping.at(uv))], uv),
            Texture::Product([a, b]) => self.number(*a, uv) * self.number(*b, uv),
            Texture::Blend { of: [a, b], amount } => {
                let [a, b] = [*a, *b].map(|t| self.number(t, uv));
                a + self.number(*amount, uv).clamp(0.0, 1.0) * (b - a)
            }
            Texture::Pattern { of, by } => self.shares(of, by).map(|(share, part)| share * self.number(part, uv)).sum(),
        }
    }

    /// Returns the linear sRGB color at a point of a picture, or of the pictures a texture is made of, for normal maps.
    pub(crate) fn rgb(self, id: TextureId, uv: Vec2) -> [f32; 3] {
        match &self.0[id.0 as usize] {
            Texture::Image { image, mapping, .. } => image.rgb_at(mapping.at(uv)),
            _ => [self.number(id, uv); 3],
        }
    }
}

fn field(at: Vec2) -> usize {
    (at.x.floor() + at.y.floor()).rem_euclid(2.0) as usize
}
