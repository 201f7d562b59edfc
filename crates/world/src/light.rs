//! What gives light.

use glam::{DVec3, Vec3};
use std::f32::consts::TAU;

use dioptric_spectrum::{Observer, Spectrum, WavelengthGrid};

use crate::{
    Beyond, Hit, LightId, SkyImage, SpectralCurve, WorldError,
    mesh::triangle_area,
    placed::{PlacedKind, PlacedShape},
    sampling::{Distribution, Frame, cone, on_disc, on_triangle},
    shape::{Quadric, Shape},
    sky::SampledSky,
};

/// A light that is no shape.
#[derive(Clone, Debug, PartialEq)]
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
#[derive(Clone, Debug, PartialEq)]
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

/// All lights of a world, with what is needed to sample them.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    lights: Vec<Source>,
    pick: Distribution,
}

#[derive(Clone, Debug)]
enum Source {
    Alone(Light),
    Sky(Box<SampledSky>),
    Area(AreaLight),
}

/// A shape that glows, outside any instance.
#[derive(Clone, Debug)]
struct AreaLight {
    shape: u32,
    emission: Emission,
    /// Triangles by area; of one entry for other shapes.
    parts: Distribution,
}

impl Lights {
    /// Returns the lights of a world: those that are no shapes, then the glowing shapes of the root group.
    pub(crate) fn new(alone: Vec<Light>, shapes: &mut [PlacedShape], scene_radius_m: f64) -> Self {
        let mut lights: Vec<Source> = alone
            .into_iter()
            .map(|light| match light {
                Light::SkyImage(sky) => Source::Sky(Box::new(SampledSky::new(sky))),
                light => Source::Alone(light),
            })
            .collect();
        for (index, shape) in shapes.iter_mut().enumerate() {
            let (Some(emission), true) = (&shape.emission, shape.group == 0) else { continue };
            let parts = match &shape.kind {
                PlacedKind::Mesh(mesh) if mesh.triangles.is_empty() => continue,
                PlacedKind::Mesh(mesh) => Distribution::new(
                    &(0..mesh.triangles.len()).map(|t| triangle_area(mesh.corners(t))).collect::<Vec<_>>(),
                ),
                PlacedKind::Quadric(quadric) => Distribution::new(&[quadric.area_about()]),
            };
            shape.light = Some(LightId(lights.len() as u32));
            lights.push(Source::Area(AreaLight { shape: index as u32, emission: emission.clone(), parts }));
        }
        let powers: Vec<f64> = lights.iter().map(|light| light.power_about(scene_radius_m)).collect();
        Self { lights, pick: Distribution::new(&powers) }
    }

    pub(crate) fn len(&self) -> usize {
        self.lights.len()
    }

    pub(crate) fn sample<const N: usize>(
        &self,
        shapes: &[PlacedShape],
        from: Vec3,
        u_light: f32,
        u: [f32; 2],
        wavelengths_nm: &[f32; N],
    ) -> Option<LightSample<N>> {
        if self.lights.is_empty() {
            return None;
        }
        let (index, rest) = self.pick.pick(u_light);
        let probability = self.pick.probability(index);
        let light = LightId(index as u32);
        match &self.lights[index] {
            Source::Alone(alone) => alone.sample(from, u, wavelengths_nm, probability, light),
            Source::Sky(sky) => {
                let (direction, pdf) = sky.sample(u)?;
                Some(LightSample {
                    direction,
                    distance_m: f32::INFINITY,
                    radiance: sky.radiance(direction, wavelengths_nm),
                    pdf: pdf * probability,
                    is_delta: false,
                    light,
                })
            }
            Source::Area(area) => {
                let (direction, distance_m, pdf, is_front) = area.sample(shapes, from, rest, u)?;
                let is_lit = is_front || area.emission.is_two_sided;
                is_lit.then(|| LightSample {
                    direction,
                    distance_m,
                    radiance: area.emission.radiance.at(wavelengths_nm),
                    pdf: pdf * probability,
                    is_delta: false,
                    light,
                })
            }
        }
    }

    /// The density with which `sample` draws this point of a glowing shape.
    pub(crate) fn pdf(&self, shapes: &[PlacedShape], from: Vec3, hit: &Hit) -> f32 {
        let placed = &shapes[hit.shape.0 as usize];
        let (Some(light), None) = (placed.light, hit.instance) else { return 0.0 };
        let Source::Area(area) = &self.lights[light.0 as usize] else { return 0.0 };
        self.pick.probability(light.0 as usize) * area.pdf(placed, from, hit)
    }

    /// The radiance of the sky in a direction.
    pub(crate) fn sky<const N: usize>(&self, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let mut sum = [0.0; N];
        for light in &self.lights {
            let radiance = match light {
                Source::Alone(Light::Sky { radiance }) => radiance.at(wavelengths_nm),
                Source::Sky(sky) => sky.radiance(direction, wavelengths_nm),
                Source::Alone(_) | Source::Area(_) => continue,
            };
            sum = std::array::from_fn(|i| sum[i] + radiance[i]);
        }
        sum
    }

    /// The density with which `sample` draws a direction of the sky.
    pub(crate) fn sky_pdf(&self, direction: Vec3) -> f32 {
        let each = self.lights.iter().enumerate().map(|(index, light)| match light {
            Source::Alone(Light::Sky { .. }) => self.pick.probability(index) / (2.0 * TAU),
            Source::Sky(sky) => self.pick.probability(index) * sky.pdf(direction),
            Source::Alone(_) | Source::Area(_) => 0.0,
        });
        each.sum()
    }
}

impl Source {
    /// The power, W, that reaches a scene of this radius, roughly: to choose lights by.
    fn power_about(&self, scene_radius_m: f64) -> f64 {
        let area = std::f64::consts::PI * scene_radius_m * scene_radius_m;
        let mean = |curve: &SpectralCurve| f64::from(curve.mean_visible());
        match self {
            Self::Alone(Light::Point { intensity, .. }) => 4.0 * std::f64::consts::PI * mean(intensity),
            Self::Alone(Light::Spot { intensity, outer_rad, .. }) => {
                2.0 * std::f64::consts::PI * (1.0 - outer_rad.cos()) * mean(intensity)
            }
            Self::Alone(Light::Distant { irradiance, .. }) => area * mean(irradiance),
            Self::Alone(Light::Sky { radiance }) => 4.0 * std::f64::consts::PI * area * mean(radiance),
            Self::Sky(sky) => 4.0 * std::f64::consts::PI * area * sky.mean(),
            Self::Alone(Light::SkyImage(_)) => 0.0,
            Self::Area(light) => {
                let sides = if light.emission.is_two_sided { 2.0 } else { 1.0 };
                sides * std::f64::consts::PI * light.parts.total() * mean(&light.emission.radiance)
            }
        }
    }
}

impl Light {
    fn sample<const N: usize>(
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
            Self::Spot { position, direction, intensity, inner_rad, outer_rad } => {
                point(*position, intensity, &|to_light| {
                    let cos = -f64::from(to_light.dot(direction.as_vec3()));
                    smooth_step(outer_rad.cos(), inner_rad.cos(), cos) as f32
                })
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

/// 0 below `low`, 1 above `high`, a cubic of continuous slope between them.
fn smooth_step(low: f64, high: f64, at: f64) -> f64 {
    if high <= low {
        return if at >= high { 1.0 } else { 0.0 };
    }
    let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl AreaLight {
    /// Returns direction, distance, density over solid angle and whether the outside is seen.
    fn sample(&self, shapes: &[PlacedShape], from: Vec3, u_part: f32, u: [f32; 2]) -> Option<(Vec3, f32, f32, bool)> {
        let placed = &shapes[self.shape as usize];
        let (point, normal, area_pdf) = match &placed.kind {
            PlacedKind::Mesh(mesh) => {
                let (triangle, _) = self.parts.pick(u_part);
                let [a, b, c] = mesh.corners(triangle);
                let [b1, b2] = on_triangle(u);
                let normal = mesh.outward_normal(triangle);
                ((1.0 - b1 - b2) * a + b1 * b + b2 * c, normal, (1.0 / self.parts.total()) as f32)
            }
            PlacedKind::Quadric(quadric) => match quadric.cone_to(from) {
                Some(sphere) => return Some(sphere.sample(u, placed.is_reversed)),
                None => quadric.sample_area(u),
            },
        };
        let normal = if placed.is_reversed { -normal } else { normal };
        let to = point - from;
        let distance_m = to.length();
        let direction = to / distance_m;
        let cosine = normal.dot(direction);
        let pdf = area_pdf * distance_m * distance_m / cosine.abs();
        (pdf.is_finite() && pdf > 0.0).then_some((direction, distance_m, pdf, cosine < 0.0))
    }

    fn pdf(&self, placed: &PlacedShape, from: Vec3, hit: &Hit) -> f32 {
        let area_pdf = match &placed.kind {
            PlacedKind::Mesh(_) => (1.0 / self.parts.total()) as f32,
            PlacedKind::Quadric(quadric) => match quadric.cone_to(from) {
                Some(sphere) => return sphere.pdf(),
                None => quadric.area_pdf(hit.point),
            },
        };
        let to = hit.point - from;
        let cosine = hit.geometric_normal.dot(to).abs() / to.length();
        if cosine > 0.0 { area_pdf * to.length_squared() / cosine } else { 0.0 }
    }
}

/// A sphere as seen from a point outside it.
pub(crate) struct SphereCone {
    to_center: Vec3,
    radius_m: f32,
    one_minus_cos: f32,
}

impl SphereCone {
    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }

    fn sample(&self, u: [f32; 2], is_reversed: bool) -> (Vec3, f32, f32, bool) {
        let distance = self.to_center.length();
        let axis = self.to_center / distance;
        let direction = Frame::about(axis).to_world(cone(u, self.one_minus_cos));
        // To the nearer crossing; a ray that grazes the rim is put at the tangent point.
        let along = direction.dot(self.to_center);
        let off_squared = (self.to_center - along * direction).length_squared();
        let half_chord = (self.radius_m * self.radius_m - off_squared).max(0.0).sqrt();
        (direction, along - half_chord, self.pdf(), !is_reversed)
    }
}

impl Quadric {
    /// Its area, m², to choose lights by; exact where it wasn't stretched.
    fn area_about(&self) -> f64 {
        let stretch = self.place().matrix3.determinant().abs().powf(2.0 / 3.0);
        self.own_area() * stretch
    }

    fn own_area(&self) -> f64 {
        use std::f64::consts::PI;
        match *self.shape() {
            Shape::Sphere { radius_m } => 4.0 * PI * radius_m * radius_m,
            Shape::Disc { radius_m, inner_radius_m } => PI * (radius_m * radius_m - inner_radius_m * inner_radius_m),
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => 2.0 * PI * radius_m * (z_max_m - z_min_m),
            Shape::Mesh(_) => 0.0,
        }
    }

    /// Returns the cone in which a sphere that is still round is seen from a point clearly outside it.
    fn cone_to(&self, from: Vec3) -> Option<SphereCone> {
        let Shape::Sphere { radius_m } = *self.shape() else { return None };
        let m = self.place().matrix3;
        let scale = m.x_axis.length();
        let is_round = [m.y_axis.length(), m.z_axis.length()].iter().all(|s| (s / scale - 1.0).abs() < 1e-9)
            && [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)]
                .iter()
                .all(|d| d.abs() < 1e-9 * scale * scale);
        let to_center = self.place().translation - from.as_dvec3();
        let sin = radius_m * scale / to_center.length();
        if !is_round || sin.is_nan() || sin >= 0.9999 {
            return None;
        }
        // 1 − cos without cancellation for small cones.
        let one_minus_cos = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
        Some(SphereCone {
            to_center: to_center.as_vec3(),
            radius_m: (radius_m * scale) as f32,
            one_minus_cos: one_minus_cos as f32,
        })
    }

    /// Returns a point evenly spread over the surface before it was placed, its outward normal, and the density, 1/m².
    fn sample_area(&self, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        let own = match *self.shape() {
            Shape::Sphere { radius_m } => radius_m * cone(u, 2.0).as_dvec3(),
            Shape::Disc { radius_m, inner_radius_m } => {
                let p = on_disc(u).as_dvec2();
                // Move the rings outwards so that the hole is left free and areas stay in proportion.
                let share = inner_radius_m / radius_m;
                let r = (share * share + p.length_squared() * (1.0 - share * share)).sqrt();
                (radius_m * r * p.normalize_or(glam::DVec2::X)).extend(0.0)
            }
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => {
                let around = glam::DVec2::from_angle(f64::from(TAU * u[0]));
                (radius_m * around).extend(z_min_m + f64::from(u[1]) * (z_max_m - z_min_m))
            }
            Shape::Mesh(_) => DVec3::ZERO,
        };
        let point = self.place().transform_point3(own);
        let at = self.surface_at(point);
        (at.point.as_vec3(), at.normal.as_vec3(), self.area_pdf(at.point.as_vec3()))
    }

    /// The density of `sample_area` at a point of the surface, 1/m².
    fn area_pdf(&self, point: Vec3) -> f32 {
        (1.0 / (self.own_area() * self.area_ratio_at(point.as_dvec3()))) as f32
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
        };
        let at = |degrees: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            sample(&light, Vec3::new(sin, 0.0, cos)).map_or(0.0, |seen| seen.radiance[0])
        };
        assert!((at(0.0) - 1.0).abs() < 1e-6 && (at(19.5) - 1.0).abs() < 1e-6);
        assert!(at(25.0) > 0.4 && at(25.0) < 0.6 && at(30.5) == 0.0 && at(180.0) == 0.0);
    }
}
