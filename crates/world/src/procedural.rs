//! Patterns by formula: Perlin's noise and what pbrt makes of it (Pharr, Jakob & Humphreys, "Physically Based Rendering",
//! 3rd edition, 10.6).

use glam::{Affine3A, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::{TextureId, UvMapping, uv::TexturePoint};

/// A number or color over a surface or through space by formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Procedural {
    /// Sums of noise.
    Noise {
        /// Which.
        kind: NoiseKind,
        /// How many sizes of noise are summed up.
        octaves: u32,
        /// What each smaller size counts by the one before.
        roughness: f32,
        /// From the world to the frame in which noise has about a length of 1.
        frame: Affine3A,
    },
    /// Veins of marble.
    Marble {
        /// How many sizes of noise are summed up.
        octaves: u32,
        /// What each smaller size counts by the one before.
        roughness: f32,
        /// How much the veins are bent.
        variation: f32,
        /// From the world to the frame in which veins have about a length of 2 π along y.
        frame: Affine3A,
    },
    /// Round dots at random in fields of 1 × 1.
    Dots {
        /// What is inside, and outside.
        of: [TextureId; 2],
        /// Where the fields are.
        mapping: UvMapping,
    },
    /// Four textures in the corners of the unit square, bilinear between them: (0, 0), (0, 1), (1, 0), (1, 1).
    Corners {
        /// The four.
        of: [TextureId; 4],
        /// Where the square is.
        mapping: UvMapping,
    },
    /// The fractions of the coordinates as red and green.
    Coordinates {
        /// Which coordinates.
        mapping: UvMapping,
    },
    /// Blocks of 1 × 1 × 1 of two textures by turns.
    Blocks {
        /// What is in the blocks of even numbers, and in the others.
        of: [TextureId; 2],
        /// From the world to the frame of the blocks.
        frame: Affine3A,
    },
}

/// How noise is summed up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoiseKind {
    /// As it is: clouds.
    Fbm,
    /// Its magnitudes: wrinkles.
    Wrinkled,
    /// Waves on water, with gusts.
    Windy,
}

/// What a pattern is at a point.
pub(crate) enum Found {
    Number(f32),
    Color([f32; 3]),
    Texture(TextureId),
    /// Textures with what each counts.
    Mixture([(TextureId, f32); 4]),
}

impl Procedural {
    pub(crate) fn parts(&self) -> Vec<TextureId> {
        match self {
            Self::Noise { .. } | Self::Marble { .. } | Self::Coordinates { .. } => Vec::new(),
            Self::Dots { of, .. } | Self::Blocks { of, .. } => of.to_vec(),
            Self::Corners { of, .. } => of.to_vec(),
        }
    }

    pub(crate) fn at(&self, at: &TexturePoint<'_>) -> Found {
        match self {
            Self::Noise { kind, octaves, roughness, frame } => {
                let p = frame.transform_point3(at.point);
                Found::Number(match kind {
                    NoiseKind::Fbm => fbm(p, *roughness, *octaves),
                    NoiseKind::Wrinkled => turbulence(p, *roughness, *octaves),
                    NoiseKind::Windy => fbm(0.1 * p, 0.5, 3).abs() * fbm(p, 0.5, 6),
                })
            }
            Self::Marble { octaves, roughness, variation, frame } => {
                let p = frame.transform_point3(at.point);
                Found::Color(marble(0.5 + 0.5 * (p.y + variation * fbm(p, *roughness, *octaves)).sin()))
            }
            Self::Dots { of: [inside, outside], mapping } => {
                Found::Texture(if is_in_dot(mapping.at(at)) { *inside } else { *outside })
            }
            Self::Corners { of: [v00, v01, v10, v11], mapping } => {
                let Vec2 { x: u, y: v } = mapping.at(at);
                let (u1, v1) = (1.0 - u, 1.0 - v);
                Found::Mixture([(*v00, u1 * v1), (*v01, u1 * v), (*v10, u * v1), (*v11, u * v)])
            }
            Self::Coordinates { mapping } => {
                let uv = mapping.at(at);
                let part = uv - uv.floor();
                Found::Color([part.x, part.y, 0.0])
            }
            Self::Blocks { of, frame } => {
                let p = frame.transform_point3(at.point).floor();
                Found::Texture(of[(p.x + p.y + p.z).rem_euclid(2.0) as usize])
            }
        }
    }
}

fn is_in_dot(uv: Vec2) -> bool {
    const RADIUS: f32 = 0.35;
    let cell = (uv + 0.5).floor();
    let noise = |du: f32, dv: f32| noise(Vec3::new(cell.x + du, cell.y + dv, 0.5));
    if noise(0.5, 0.5) <= 0.0 {
        return false;
    }
    let center = cell + (0.5 - RADIUS) * Vec2::new(noise(1.5, 2.8), noise(4.5, 9.8));
    (uv - center).length_squared() < RADIUS * RADIUS
}

/// Returns a color of pbrt's marble, which runs through nine of them by pieces of cubic curves.
fn marble(along: f32) -> [f32; 3] {
    const COLORS: [[f32; 3]; 9] = [
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.5, 0.5, 0.5],
        [0.6, 0.59, 0.58],
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.2, 0.2, 0.33],
        [0.58, 0.58, 0.6],
    ];
    const PIECES: usize = 5;
    let first = ((along * PIECES as f32) as usize).min(PIECES - 1);
    let t = along * PIECES as f32 - first as f32;
    let s = 1.0 - t;
    let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    std::array::from_fn(|k| 1.5 * (0..4).map(|i| weights[i] * COLORS[first + i][k]).sum::<f32>())
}

/// The factor between the sizes of noise: not 2, so that its zeros don't fall together.
const LACUNARITY: f32 = 1.99;

fn fbm(p: Vec3, roughness: f32, octaves: u32) -> f32 {
    let (mut sum, mut size, mut counts) = (0.0, 1.0, 1.0);
    for _ in 0..octaves {
        sum += counts * noise(size * p);
        (size, counts) = (size * LACUNARITY, counts * roughness);
    }
    sum
}

fn turbulence(p: Vec3, roughness: f32, octaves: u32) -> f32 {
    let (mut sum, mut size, mut counts) = (0.0, 1.0, 1.0);
    for _ in 0..octaves {
        sum += counts * noise(size * p).abs();
        (size, counts) = (size * LACUNARITY, counts * roughness);
    }
    // The mean of what is smaller still.
    sum + 0.2 * counts
}

/// Returns Perlin's noise (2002), from −1 to 1 and 0 at whole coordinates.
pub(crate) fn noise(p: Vec3) -> f32 {
    if !(p.is_finite() && p.abs().max_element() < 1e9) {
        return 0.0;
    }
    let cell = p.floor();
    let d = p - cell;
    let [x, y, z] = cell.to_array().map(|v| (v as i64).rem_euclid(256) as usize);
    let hash = |dx: usize, dy: usize, dz: usize| {
        let of = |i: usize| usize::from(PERMUTATION[i % 256]);
        let corner = of(of(of((x + dx) % 256) + (y + dy) % 256) + (z + dz) % 256);
        let d = d - Vec3::new(dx as f32, dy as f32, dz as f32);
        // One of twelve directions, four of them twice.
        let h = corner & 15;
        let u = if h < 8 || h == 12 || h == 13 { d.x } else { d.y };
        let v = if h < 4 || h == 12 || h == 13 { d.y } else { d.z };
        (if h & 1 == 1 { -u } else { u }) + (if h & 2 == 2 { -v } else { v })
    };
    let w = d * d * d * (d * (d * 6.0 - 15.0) + 10.0);
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let along_x = |dy, dz| mix(hash(0, dy, dz), hash(1, dy, dz), w.x);
    let along_y = |dz| mix(along_x(0, dz), along_x(1, dz), w.y);
    mix(along_y(0), along_y(1), w.z)
}

/// Returns how fast the noise changes along x, y and z, by differences as pbrt takes them.
pub(crate) fn noise_vector(p: Vec3) -> Vec3 {
    const STEP: f32 = 0.01;
    let here = noise(p);
    Vec3::from_array(Vec3::AXES.map(|axis| (noise(p + STEP * axis) - here) / STEP))
}

/// Perlin's permutation of 0 to 255 (2002).
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216,
    80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17,
    182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129,
    22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238,
    210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184,
    84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutation_has_every_number_once() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, n)| i == usize::from(*n)));
    }

    /// Perlin's reference gives 0.13691995878400012 at (3.14, 42, 7).
    #[test]
    fn noise_is_perlins() {
        assert!((noise(Vec3::new(3.0 + 0.14, 42.0, 7.0)) - 0.136_919_96).abs() < 1e-5);
        assert_eq!(noise(Vec3::new(-3.0, 5.0, 260.0)), 0.0);
        let n = 20_000;
        let values: Vec<f32> =
            (0..n).map(|i| noise(Vec3::new(0.37 * i as f32, 0.11 * i as f32, -0.53 * i as f32))).collect();
        assert!(values.iter().all(|v| v.abs() <= 1.0) && values.iter().sum::<f32>().abs() < 0.02 * n as f32);
    }
}
