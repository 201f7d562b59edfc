//! Light from pictures of the whole sky.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use glam::{DMat3, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::{ImageTexture, SpectralCurve, sampling::Distribution};

/// A picture of all directions, whose linear sRGB colors are radiances in the unit of
/// [`SpectralCurve::from_rgb_light`], times `scale`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SkyImage {
    /// The picture.
    #[serde(with = "crate::image_texture::shared")]
    pub image: Arc<ImageTexture>,
    /// Which direction is where in it.
    pub mapping: SkyMapping,
    /// Turns the directions of the picture into those of the world; orthonormal.
    pub world_from_sky: DMat3,
    /// What its colors are multiplied by.
    pub scale: f32,
}

impl SkyImage {
    /// Returns the illuminance by the picture, before `scale`, of a surface that faces its +z: ∫ Y cos θ dΩ over the upper half of the sky, in the unit of its
    /// colors, Y the luminance.
    pub(crate) fn image_illuminance(&self) -> f64 {
        let (columns, rows) = self.image.size();
        let mut sum = 0.0;
        for y in 0..rows {
            let down = (y as f32 + 0.5) / rows as f32;
            for x in 0..columns {
                let at = Vec2::new((x as f32 + 0.5) / columns as f32, down);
                let (cos, solid_angle) = match self.mapping {
                    SkyMapping::LatLong => {
                        let (sin, cos) = (PI * down).sin_cos();
                        (cos, TAU * PI * sin)
                    }
                    SkyMapping::EqualArea => (sphere_of_square(at).z, 2.0 * TAU),
                };
                if cos > 0.0 {
                    sum += luminance(self.image.rgb_at(Vec2::new(at.x, 1.0 - down))) * f64::from(cos * solid_angle);
                }
            }
        }
        sum / (columns * rows) as f64
    }
}

/// The luminance of a linear sRGB color, 1 of white.
pub(crate) fn luminance([r, g, b]: [f32; 3]) -> f64 {
    f64::from(0.2126 * r + 0.7152 * g + 0.0722 * b)
}

/// How the directions are laid out on a picture of the sky, in whose frame +z is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SkyMapping {
    /// Columns by azimuth from +x to +y, rows by polar angle from +z at the top.
    LatLong,
    /// A square of equal areas folded from an octahedron (Clarberg 2008), as pbrt's 4th version has it.
    EqualArea,
}

impl SkyMapping {
    /// Returns the direction, of length 1, that lies at a place of the picture: 0 to 1 to the right, and down.
    pub fn direction_at(self, [s, t]: [f64; 2]) -> Vec3 {
        match self {
            Self::LatLong => {
                let (sin, cos) = (std::f64::consts::PI * t).sin_cos();
                let (y, x) = (std::f64::consts::TAU * s).sin_cos();
                glam::DVec3::new(sin * x, sin * y, cos).as_vec3()
            }
            Self::EqualArea => sphere_of_square(glam::DVec2::new(s, t).as_vec2()),
        }
    }

    /// Returns the texture coordinates at which a direction, of length 1, lies.
    pub(crate) fn uv_of(self, d: Vec3) -> Vec2 {
        match self {
            Self::LatLong => {
                let azimuth = d.y.atan2(d.x);
                let azimuth = if azimuth < 0.0 { azimuth + TAU } else { azimuth };
                // By the arc tangent, which is exact near the poles too.
                Vec2::new(azimuth / TAU, 1.0 - d.truncate().length().atan2(d.z) / PI)
            }
            Self::EqualArea => {
                let at = square_of_sphere(d);
                Vec2::new(at.x, 1.0 - at.y)
            }
        }
    }

    /// Returns the mean over all directions of a picture's channels.
    pub(crate) fn mean_of(self, image: &ImageTexture) -> f64 {
        let (columns, rows) = image.size();
        let (mut sum, mut weights) = (0.0, 0.0);
        for y in 0..rows {
            let down = (y as f32 + 0.5) / rows as f32;
            let weight = if self == Self::LatLong { f64::from((PI * down).sin()) } else { 1.0 };
            for x in 0..columns {
                let rgb = image.rgb_at(Vec2::new((x as f32 + 0.5) / columns as f32, 1.0 - down));
                sum += weight * f64::from(rgb.iter().sum::<f32>() / 3.0);
                weights += weight;
            }
        }
        sum / weights
    }
}

/// A picture of the sky with the shares that its parts have of the light.
#[derive(Clone, Debug)]
pub(crate) struct SampledSky {
    sky: SkyImage,
    columns: usize,
    rows: Distribution,
    in_row: Vec<Distribution>,
}

impl SampledSky {
    pub(crate) fn new(sky: SkyImage) -> Self {
        let (columns, rows) = sky.image.size();
        let luminance_of = |x: usize, y: usize| {
            luminance(
                sky.image.rgb_at(Vec2::new((x as f32 + 0.5) / columns as f32, 1.0 - (y as f32 + 0.5) / rows as f32)),
            )
        };
        let weights: Vec<f64> = (0..rows * columns).map(|i| luminance_of(i % columns, i / columns)).collect();
        let around = |x: usize, y: usize| {
            // Interpolation spreads a sample's light over its neighbors: each gets a share of what is around it.
            let mut sum = 0.0;
            for dy in [rows - 1, 0, 1] {
                for dx in [columns - 1, 0, 1] {
                    sum += weights[(y + dy) % rows * columns + (x + dx) % columns];
                }
            }
            let area = match sky.mapping {
                SkyMapping::LatLong => (std::f64::consts::PI * (y as f64 + 0.5) / rows as f64).sin(),
                SkyMapping::EqualArea => 1.0,
            };
            sum * area
        };
        let in_row: Vec<Distribution> =
            (0..rows).map(|y| Distribution::new(&(0..columns).map(|x| around(x, y)).collect::<Vec<_>>())).collect();
        let totals: Vec<f64> = in_row.iter().map(Distribution::total).collect();
        Self { columns, rows: Distribution::new(&totals), in_row, sky }
    }

    /// The mean radiance over all directions and 400–700 nm, W m⁻² sr⁻¹ nm⁻¹, roughly.
    pub(crate) fn mean(&self) -> f64 {
        let n_samples = (self.columns * self.rows.len()) as f64;
        let area = if self.sky.mapping == SkyMapping::LatLong { std::f64::consts::FRAC_2_PI } else { 1.0 };
        let white = f64::from(SpectralCurve::from_rgb_light([1.0; 3]).mean_visible());
        self.rows.total() / (9.0 * n_samples * area) * f64::from(self.sky.scale) * white
    }

    pub(crate) fn radiance<const N: usize>(&self, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let rgb = self.sky.image.rgb_at(self.uv_of(direction));
        SpectralCurve::light_at(rgb.map(|v| v * self.sky.scale), wavelengths_nm)
    }

    /// Draws a direction, with its density over solid angle.
    pub(crate) fn sample(&self, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let (row, along_y) = self.rows.pick(u[0]);
        let (column, along_x) = self.in_row[row].pick(u[1]);
        let x = (column as f32 + along_x) / self.columns as f32;
        let y = (row as f32 + along_y) / self.rows.len() as f32;
        let own = match self.sky.mapping {
            SkyMapping::LatLong => {
                let (sin, cos) = (PI * y).sin_cos();
                (sin * Vec2::from_angle(TAU * x)).extend(cos)
            }
            SkyMapping::EqualArea => sphere_of_square(Vec2::new(x, y)),
        };
        let direction = (self.sky.world_from_sky.as_mat3() * own).normalize();
        let pdf = self.pdf(direction);
        (pdf > 0.0 && pdf.is_finite()).then_some((direction, pdf))
    }

    /// The density of `sample`, 1/sr.
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let uv = self.uv_of(direction);
        let n_rows = self.rows.len();
        let row = (((1.0 - uv.y) * n_rows as f32) as usize).min(n_rows - 1);
        let column = ((uv.x * self.columns as f32) as usize).min(self.columns - 1);
        let share = self.rows.probability(row) * self.in_row[row].probability(column);
        let density = share * (self.columns * n_rows) as f32;
        match self.sky.mapping {
            SkyMapping::LatLong => {
                let sin = self.own(direction).truncate().length();
                if sin > 0.0 { density / (TAU * PI * sin) } else { 0.0 }
            }
            SkyMapping::EqualArea => density / (2.0 * TAU),
        }
    }

    fn own(&self, direction: Vec3) -> Vec3 {
        self.sky.world_from_sky.as_mat3().transpose() * direction
    }

    /// Returns the texture coordinates of a direction, v upwards.
    fn uv_of(&self, direction: Vec3) -> Vec2 {
        self.sky.mapping.uv_of(self.own(direction))
    }
}

/// Returns the direction of a point of the unit square (Clarberg 2008).
fn sphere_of_square(at: Vec2) -> Vec3 {
    let uv = 2.0 * at - 1.0;
    let off = uv.abs();
    // Distance from the diagonal along which the halves of the octahedron meet.
    let signed = 1.0 - (off.x + off.y);
    let r = 1.0 - signed.abs();
    let azimuth = FRAC_PI_4 * if r == 0.0 { 1.0 } else { (off.y - off.x) / r + 1.0 };
    let z = (1.0 - r * r).copysign(signed);
    let across = r * (2.0 - r * r).max(0.0).sqrt();
    Vec3::new(across * azimuth.cos().copysign(uv.x), across * azimuth.sin().copysign(uv.y), z)
}

/// The reverse of `sphere_of_square`.
fn square_of_sphere(d: Vec3) -> Vec2 {
    let [x, y, z] = d.abs().to_array();
    let r = (1.0 - z).max(0.0).sqrt();
    let azimuth = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) / FRAC_PI_2 };
    let (mut u, mut v) = (r - azimuth * r, azimuth * r);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    0.5 * (Vec2::new(u.copysign(d.x), v.copysign(d.y)) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Wrap;

    fn sky(mapping: SkyMapping) -> SampledSky {
        let (columns, rows) = (16, 16);
        let rgb = (0..columns * rows).map(|i| [if i == 5 * columns + 11 { 50.0 } else { (i % 7) as f32 * 0.1 }; 3]);
        let image = Arc::new(ImageTexture::from_linear(columns, rgb.collect(), Wrap::Repeat).unwrap());
        SampledSky::new(SkyImage { image, mapping, world_from_sky: DMat3::from_rotation_x(0.7), scale: 2.0 })
    }

    #[test]
    fn square_and_sphere_are_inverse() {
        for i in 0..400 {
            let at = Vec2::new(((i * 7) % 20) as f32 + 0.4, ((i / 20) as f32) + 0.3) / 20.0;
            let direction = sphere_of_square(at);
            assert!((direction.length() - 1.0).abs() < 1e-6);
            assert!(square_of_sphere(direction).abs_diff_eq(at, 1e-5), "{at}");
        }
    }

    /// A sky that grows brighter upwards and is dark below: ∫ z · z dω = 2π/3 by closed form.
    #[test]
    fn illuminance_is_that_of_the_upper_half() {
        for mapping in [SkyMapping::LatLong, SkyMapping::EqualArea] {
            let side = 256;
            let rgb = (0..side * side).map(|i| {
                let at = Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32;
                let z = if mapping == SkyMapping::LatLong { (PI * at.y).cos() } else { sphere_of_square(at).z };
                [z.max(0.0); 3]
            });
            let image = Arc::new(ImageTexture::from_linear(side, rgb.collect(), Wrap::Repeat).unwrap());
            let sky = SkyImage { image, mapping, world_from_sky: DMat3::from_rotation_x(0.7), scale: 2.0 };
            let expected = 2.0 / 3.0 * std::f64::consts::PI;
            // Samples of 256 × 256.
            assert!((sky.image_illuminance() / expected - 1.0).abs() < 1e-4, "{mapping:?} {}", sky.image_illuminance());
        }
    }

    #[test]
    fn density_is_that_of_draws() {
        for mapping in [SkyMapping::LatLong, SkyMapping::EqualArea] {
            let sky = sky(mapping);
            // ∫ pdf dω, and ∫ L dω by even directions against that by draws.
            let n = 400;
            let (mut total, mut even) = (0.0, 0.0);
            for i in 0..n * n {
                let z = 2.0 * ((i / n) as f32 + 0.5) / n as f32 - 1.0;
                let around = Vec2::from_angle(TAU * ((i % n) as f32 + 0.5) / n as f32);
                let direction = ((1.0 - z * z).sqrt() * around).extend(z);
                let solid_angle = f64::from(2.0 * TAU) / f64::from(n * n);
                total += f64::from(sky.pdf(direction)) * solid_angle;
                even += f64::from(sky.radiance(direction, &[550.0])[0]) * solid_angle;
            }
            let m = 200;
            let drawn: f64 = (0..m * m)
                .filter_map(|i| sky.sample([((i % m) as f32 + 0.5) / m as f32, ((i / m) as f32 + 0.5) / m as f32]))
                .map(|(direction, pdf)| f64::from(sky.radiance(direction, &[550.0])[0] / pdf) / f64::from(m * m))
                .sum();
            assert!((total - 1.0).abs() < 0.01, "{mapping:?}: {total}");
            assert!((drawn / even - 1.0).abs() < 0.01, "{mapping:?}: {drawn} {even}");
            // The mean radiance that lights are chosen by: of green alone, roughly that of white.
            let mean = even / f64::from(2.0 * TAU);
            assert!((sky.mean() / mean - 1.0).abs() < 0.5, "{mapping:?}: {} {mean}", sky.mean());
        }
    }
}
