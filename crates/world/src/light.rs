//! What gives light.

use serde::{Deserialize, Serialize};
use std::{
    f32::consts::{PI, TAU},
    sync::Arc,
};

use dioptric_spectrum::{Observer, SmoothReflectance, Spectrum, WavelengthGrid, lanes};
use glam::{DMat3, DVec2, DVec3, Vec3};

use crate::{
    Beyond, ImageTexture, LightId, SkyImage, SkyMapping, SpectralCurve, WorldError, light_tree::LightBounds,
    sampling::cone, sky::luminance,
};

/// A light that is no shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Light {
    /// A point that shines alike in all directions.
    Point {
        /// Where it is, m.
        position: DVec3,
        /// Radiant intensity, W sr⁻¹ nm⁻¹.
        intensity: SpectralCurve,
    },
    /// A point that shines within a cone, full within `inner_rad` of its axis and falling smoothly to 0 at `outer_rad`.
    Spot {
        /// Where it is, m.
        position: DVec3,
        /// Where it shines to, of length 1.
        direction: DVec3,
        /// Radiant intensity on the axis, W sr⁻¹ nm⁻¹.
        intensity: SpectralCurve,
        /// Half the angle of full intensity, rad.
        inner_rad: f64,
        /// Half the angle of the whole cone, rad.
        outer_rad: f64,
        /// How it falls between the two.
        fall_off: FallOff,
    },
    /// A point that shines by a picture of its directions: a lamp by its measured distribution, or a projector.
    Pictured {
        /// Where it is, m.
        position: DVec3,
        /// Radiant intensity where the picture is white, W sr⁻¹ nm⁻¹.
        intensity: SpectralCurve,
        /// The picture.
        #[serde(with = "crate::image_texture::shared")]
        picture: Arc<ImageTexture>,
        /// Which direction is where in it.
        layout: Layout,
        /// Turns the picture's directions into those of the world; orthonormal.
        world_from_light: DMat3,
    },
    /// Parallel light from far away, like the sun's.
    Distant {
        /// Where the light goes, of length 1.
        direction: DVec3,
        /// Irradiance on a surface that faces it, W m⁻² nm⁻¹.
        irradiance: SpectralCurve,
    },
    /// The same radiance from every direction in which nothing is met.
    Sky {
        /// Radiance, W m⁻² sr⁻¹ nm⁻¹.
        radiance: SpectralCurve,
    },
    /// The radiance of a picture of all directions.
    SkyImage(SkyImage),
}

/// Where the directions of a lamp lie on its picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Layout {
    /// All of them; the mean of its channels counts.
    Around(SkyMapping),
    /// Those ahead, along +z, in color: right and left, up and down to these tangents, with +x at the right and +y at the top.
    Ahead {
        /// Of half the width.
        tan_x: f64,
        /// Of half the height.
        tan_y: f64,
    },
}

impl Layout {
    /// Returns what the intensity in a direction is multiplied by.
    fn share<const N: usize>(self, picture: &ImageTexture, d: DVec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match self {
            Self::Around(mapping) => {
                let rgb = picture.rgb_at(mapping.uv_of(d.as_vec3()));
                [rgb.iter().sum::<f32>() / 3.0; N]
            }
            Self::Ahead { tan_x, tan_y } => {
                let at = DVec2::new(d.x / tan_x, d.y / tan_y) / d.z;
                if d.z <= 0.0 || at.abs().max_element() > 1.0 {
                    return [0.0; N];
                }
                let rgb = picture.rgb_at((0.5 * (at + 1.0)).as_vec2());
                let largest = rgb.into_iter().fold(0.0, f32::max);
                if !(largest > 0.0 && largest.is_finite()) {
                    return [0.0; N];
                }
                SmoothReflectance::of_rgb(rgb.map(|v| v / largest)).at(wavelengths_nm).map(|share| largest * share)
            }
        }
    }

    /// Returns the flux, in lumens, of a lamp of such a picture whose intensity is 1 cd where it is white.
    pub(crate) fn flux(self, picture: &ImageTexture) -> f64 {
        let Self::Ahead { tan_x, tan_y } = self else {
            let Self::Around(mapping) = self else { return 0.0 };
            return 4.0 * std::f64::consts::PI * mapping.mean_of(picture);
        };
        let (columns, rows) = picture.size();
        let mut sum = 0.0;
        for y in 0..rows {
            for x in 0..columns {
                let at = DVec2::new((x as f64 + 0.5) / columns as f64, (y as f64 + 0.5) / rows as f64);
                let way = (2.0 * at - 1.0) * DVec2::new(tan_x, tan_y);
                // Of an element of the plane at distance 1 the solid angle is cos³.
                sum += luminance(picture.rgb_at(at.as_vec2())) * (1.0 + way.length_squared()).powf(-1.5);
            }
        }
        sum * 4.0 * tan_x * tan_y / (columns * rows) as f64
    }
}

/// How a spot falls to 0 between its two angles, as a function of t, which goes from 0 to 1 with the cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FallOff {
    /// 3 t² − 2 t³: pbrt's 4th version.
    #[default]
    Smooth,
    /// t²: glTF.
    Square,
    /// t⁴: pbrt's 2nd and 3rd version.
    Quartic,
}

/// How much light a lamp gives in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flux {
    /// Radiant flux from 360 to 830 nm, W.
    Watts(f64),
    /// Luminous flux (CIE 1931), lm.
    Lumens(f64),
}

impl Flux {
    /// Returns the spectrum of this shape that gives the flux over an étendue: 4π sr for the intensity of a point, π
    /// times the glowing area (m² sr) for the radiance of a surface, 1 m² for the irradiance of a square meter.
    ///
    /// # Errors
    /// When the shape has no light to scale, or a number is not positive and finite.
    pub fn spectrum(self, shape: &Spectrum, etendue: f64) -> Result<SpectralCurve, WorldError> {
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
        let values = shape.sample_or_zero(&fine);
        let values = if shape.values().len() == 1 { vec![shape.values()[0]; values.len()] } else { values };
        let (wanted, given) = match self {
            Self::Watts(watts) => (watts, fine.integrate(&values)),
            Self::Lumens(lumens) => (lumens, Observer::Cie1931.xyz(&fine, &values).luminance_cd_m2()),
        };
        let scale = wanted / (given * etendue);
        if !(scale >= 0.0 && scale.is_finite() && given > 0.0) {
            return Err(WorldError::Setting {
                what: "the flux of a light",
                value: format!("{wanted}"),
                expected: "a finite number of watts or lumens, of a spectrum that has some between 360 and 830 nm",
            });
        }
        Ok(SpectralCurve::new(shape, Beyond::Zero).scaled(scale as f32))
    }
}

/// The glow of a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Emission {
    /// Radiance, the same in all directions, W m⁻² sr⁻¹ nm⁻¹.
    pub radiance: SpectralCurve,
    /// Whether both sides glow, or the outside alone.
    pub is_two_sided: bool,
}

/// Light drawn to fall on a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample<const N: usize> {
    /// Where the light comes from, of length 1.
    pub direction: Vec3,
    /// How far away it is, m; infinite for distant lights and the sky. Whether something stands between is for the
    /// caller to find out ([`World::is_occluded`](crate::World::is_occluded) stops short of it).
    pub distance_m: f32,
    /// Radiance, W m⁻² sr⁻¹ nm⁻¹; for points and distant lights (`is_delta`) irradiance facing them, W m⁻² nm⁻¹.
    pub radiance: [f32; N],
    /// The density over solid angle with which the direction was drawn, 1/sr, the choice of the light included; for
    /// points and distant lights the probability of that choice.
    pub pdf: f32,
    /// Whether the light is a point or distant, so that no scattered ray can meet it.
    pub is_delta: bool,
    /// Which light.
    pub light: LightId,
}

impl Light {
    /// Returns where it is and shines to; `None` of lights that are far away.
    pub(crate) fn bounds(&self) -> Option<LightBounds> {
        match self {
            Self::Point { position, intensity } | Self::Pictured { position, intensity, .. } => {
                let at = position.as_vec3();
                Some(LightBounds::all_around(at, at, 4.0 * PI * visible_power(intensity)))
            }
            Self::Spot { position, direction, intensity, inner_rad, outer_rad, .. } => {
                let (at, inner_rad, outer_rad) = (position.as_vec3(), *inner_rad as f32, *outer_rad as f32);
                let power = 4.0 * PI * visible_power(intensity);
                let axis = direction.as_vec3();
                // As bright as a point within its cone, which ends soon enough to be full of it.
                let spread_rad = outer_rad.max(inner_rad).min(PI);
                let reach_rad = SPOT_RIM_RAD;
                Some(LightBounds { axis, spread_rad, reach_rad, ..LightBounds::all_around(at, at, power) })
            }
            Self::Distant { .. } | Self::Sky { .. } | Self::SkyImage(_) => None,
        }
    }

    /// Draws its light on a point; `pdf` is the probability with which it was chosen.
    pub(crate) fn sample<const N: usize>(
        &self,
        from: Vec3,
        u: [f32; 2],
        wavelengths_nm: &[f32; N],
        pdf: f32,
        light: LightId,
    ) -> Option<LightSample<N>> {
        let point = |position: DVec3, intensity: &SpectralCurve, share: &dyn Fn(Vec3) -> f32| {
            let to = position - from.as_dvec3();
            let distance_m = to.length() as f32;
            let direction = to.normalize_or_zero().as_vec3();
            let scale = share(direction) / (distance_m * distance_m);
            let radiance = intensity.at(wavelengths_nm).map(|i| i * scale);
            let is_lit = scale > 0.0 && scale.is_finite();
            is_lit.then_some(LightSample { direction, distance_m, radiance, pdf, is_delta: true, light })
        };
        match self {
            Self::Point { position, intensity } => point(*position, intensity, &|_| 1.0),
            Self::Spot { position, direction, intensity, inner_rad, outer_rad, fall_off } => {
                point(*position, intensity, &|to_light| {
                    let cos = -f64::from(to_light.dot(direction.as_vec3()));
                    fall_off.at(outer_rad.cos(), inner_rad.cos(), cos) as f32
                })
            }
            Self::Pictured { position, intensity, picture, layout, world_from_light } => {
                let mut sample = point(*position, intensity, &|_| 1.0)?;
                let ahead = world_from_light.transpose() * -sample.direction.as_dvec3();
                let share = layout.share(picture, ahead, wavelengths_nm);
                sample.radiance = lanes(|lane| sample.radiance[lane] * share[lane]);
                sample.radiance.iter().any(|v| *v > 0.0).then_some(sample)
            }
            Self::Distant { direction, irradiance } => Some(LightSample {
                direction: -direction.as_vec3(),
                distance_m: f32::INFINITY,
                radiance: irradiance.at(wavelengths_nm),
                pdf,
                is_delta: true,
                light,
            }),
            Self::Sky { radiance } => Some(LightSample {
                direction: cone(u, 2.0),
                distance_m: f32::INFINITY,
                radiance: radiance.at(wavelengths_nm),
                pdf: pdf / (2.0 * TAU),
                is_delta: false,
                light,
            }),
            // Held as a `SampledSky`.
            Self::SkyImage(_) => None,
        }
    }
}

/// Beyond its cone a spot is taken to shine, for roundings, rad.
const SPOT_RIM_RAD: f32 = 1e-3;

/// Returns a measure of a spectrum to choose lights by: its mean over 400–700 nm, or over all that a curve can have where that is
/// nothing, so that no light is left out.
pub(crate) fn visible_power(curve: &SpectralCurve) -> f32 {
    let visible = curve.mean_visible();
    if visible > 0.0 {
        return visible;
    }
    (0..460).map(|i| curve.at(&[202.5 + 5.0 * i as f32])[0]).sum::<f32>() / 460.0
}

impl FallOff {
    /// 0 below `low`, 1 above `high`.
    fn at(self, low: f64, high: f64, at: f64) -> f64 {
        if high <= low {
            return if at >= high { 1.0 } else { 0.0 };
        }
        let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
        match self {
            Self::Smooth => t * t * (3.0 - 2.0 * t),
            Self::Square => t.powi(2),
            Self::Quartic => t.powi(4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::Illuminant;

    #[test]
    fn flux_is_given_in_full() {
        let d65 = Illuminant::D65.spectrum();
        let intensity = Flux::Lumens(1000.0).spectrum(&d65, 4.0 * std::f64::consts::PI).unwrap();
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).unwrap();
        let values: Vec<f64> = fine.centers_nm().iter().map(|&w| f64::from(intensity.at(&[w as f32])[0])).collect();
        let candela = Observer::Cie1931.xyz(&fine, &values).luminance_cd_m2();
        assert!((candela * 4.0 * std::f64::consts::PI / 1000.0 - 1.0).abs() < 1e-4);
        let watts = Flux::Watts(60.0).spectrum(&Spectrum::constant(3.0), 1.0).unwrap();
        // 471 bands of 1 nm.
        assert!((watts.at(&[500.0])[0] - 60.0 / 471.0).abs() < 1e-6);
        assert!(Flux::Watts(f64::NAN).spectrum(&d65, 1.0).is_err());
        assert!(Flux::Watts(1.0).spectrum(&Spectrum::constant(0.0), 1.0).is_err());
    }

    fn sample(light: &Light, from: Vec3) -> Option<LightSample<1>> {
        light.sample(from, [0.3, 0.6], &[550.0], 0.5, LightId(0))
    }

    #[test]
    fn point_falls_off_by_distance_squared() {
        let light = Light::Point { position: DVec3::new(0.0, 3.0, 0.0), intensity: SpectralCurve::constant(18.0) };
        let seen = sample(&light, Vec3::ZERO).unwrap();
        assert_eq!((seen.radiance, seen.distance_m, seen.direction), ([2.0], 3.0, Vec3::Y));
        assert!(seen.is_delta && sample(&light, Vec3::new(0.0, 3.0, 0.0)).is_none());
    }

    #[test]
    fn spot_ends_at_its_cone() {
        let [inner_rad, outer_rad] = [20.0_f64, 30.0].map(f64::to_radians);
        let light = Light::Spot {
            position: DVec3::ZERO,
            direction: DVec3::Z,
            intensity: SpectralCurve::constant(1.0),
            inner_rad,
            outer_rad,
            fall_off: FallOff::Smooth,
        };
        let at = |degrees: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            sample(&light, Vec3::new(sin, 0.0, cos)).map_or(0.0, |seen| seen.radiance[0])
        };
        assert!((at(0.0) - 1.0).abs() < 1e-6 && (at(19.5) - 1.0).abs() < 1e-6);
        assert!(at(25.0) > 0.4 && at(25.0) < 0.6 && at(30.5) == 0.0 && at(180.0) == 0.0);
    }

    fn pictured(columns: usize, rgb: Vec<[f32; 3]>, layout: Layout) -> Light {
        Light::Pictured {
            position: DVec3::ZERO,
            intensity: SpectralCurve::constant(2.0),
            picture: Arc::new(ImageTexture::from_linear(columns, rgb, crate::Wrap::Clamp).unwrap()),
            layout,
            world_from_light: DMat3::IDENTITY,
        }
    }

    /// Shadows of a picture fall where it says, and its flux is that of all directions together.
    #[test]
    fn pictured_lamps_shine_where_their_picture_is_bright() {
        let (white, black, red) = ([1.0; 3], [0.0; 3], [1.0, 0.0, 0.0]);
        // Bright above the horizon, dark below, of 4 rows.
        let lamp = pictured(1, vec![white, white, black, black], Layout::Around(SkyMapping::LatLong));
        let at = |light: &Light, d: Vec3, nm: f32| {
            light.sample(d, [0.5; 2], &[nm], 1.0, LightId(0)).map_or(0.0, |seen| seen.radiance[0])
        };
        assert!((at(&lamp, Vec3::Z * 2.0, 550.0) - 0.5).abs() < 1e-6);
        assert_eq!(at(&lamp, -Vec3::Z, 550.0), 0.0);
        let even = pictured(2, vec![white; 4], Layout::Around(SkyMapping::EqualArea));
        assert_eq!(at(&even, Vec3::new(0.6, 0.0, -0.8), 550.0), 2.0);
        // A projector of 90° by 53°: red at the top right, white at the bottom left.
        let layout = Layout::Ahead { tan_x: 1.0, tan_y: 0.5 };
        let projector = pictured(2, vec![black, red, white, black], layout);
        let [right, left] = [Vec3::new(0.7, 0.35, 1.0), Vec3::new(-0.7, -0.35, 1.0)];
        assert!(at(&projector, right, 650.0) > 5.0 * at(&projector, right, 450.0));
        assert!((at(&projector, left, 450.0) * left.length_squared() - 2.0).abs() < 0.02);
        assert_eq!(at(&projector, Vec3::new(0.7, -0.4, 1.0), 550.0), at(&projector, Vec3::new(-0.7, 0.4, 1.0), 550.0));
        assert_eq!([at(&projector, -left, 550.0), at(&projector, Vec3::new(1.1, 0.0, 1.0), 550.0)], [0.0; 2]);
        // The solid angle of a rectangle, 4 asin(sin a sin b) of its half angles.
        let flux = layout.flux(&ImageTexture::from_linear(64, vec![white; 64 * 64], crate::Wrap::Clamp).unwrap());
        let expected = 4.0 * (1.0_f64.atan().sin() * 0.5_f64.atan().sin()).asin();
        assert!((flux / expected - 1.0).abs() < 1e-3, "{flux} {expected}");
        let Light::Pictured { picture, layout, .. } = &lamp else { panic!("a lamp by its picture") };
        assert!((layout.flux(picture) - 2.0 * std::f64::consts::PI).abs() < 1e-5);
    }
}
