//! All lights of a world, and which of them is drawn.
//!
//! Those far away stand beside a tree of the others ([`LightTree`]), in which one is drawn by what may fall on the point, as is which of the two
//! groups; a mesh that glows is as many lights there as it has triangles. A light that is the only one needs neither.

use dioptric_spectrum::lanes;
use glam::Vec3;
use std::{f32::consts::TAU, f64::consts::PI};

use crate::{
    Hit, Light, LightId, LightSample, Receiver, SpectralCurve,
    area_light::AreaLight,
    light::visible_power,
    light_tree::{BELOW_ONE, LightBounds, LightTree},
    placed::PlacedShape,
    sampling::Distribution,
    sky::SampledSky,
};

/// All lights of a world, with what is needed to sample them.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    lights: Vec<Source>,
    choice: Choice,
    /// Those whose radiance is seen where nothing is met.
    skies: Vec<u32>,
}

#[derive(Clone, Debug)]
enum Source {
    Alone(Light),
    Sky(Box<SampledSky>),
    Area(AreaLight),
}

/// How one light is chosen.
#[derive(Clone, Debug)]
enum Choice {
    /// By fixed weights.
    Fixed(Distribution),
    /// By what may fall on the point.
    Tree(Box<ManyLights>),
}

/// Lights in a tree, and those that are too far away to be in one.
#[derive(Clone, Debug)]
struct ManyLights {
    far: Vec<u32>,
    /// Those far away by the irradiance, W m⁻², that they give a plane that faces them.
    far_choice: Distribution,
    tree: LightTree,
    /// Light and triangle of each leaf.
    leaves: Vec<(u32, Option<u32>)>,
    /// Where each light is.
    places: Vec<Place>,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    /// This one of those far away.
    Far(u32),
    /// In the tree, from this leaf on: one leaf, or one a triangle.
    Near { first_leaf: u32, is_divided: bool },
}

/// A light that has been chosen.
struct Chosen {
    light: usize,
    /// The triangle of a mesh, where that was chosen too.
    triangle: Option<usize>,
    probability: f32,
    /// What is left of the number that chose it, in [0, 1).
    rest: f32,
}

/// A light alone, of so many triangles, needs no tree.
const FEW_PARTS: usize = 16;
/// The least probability of the lights far away, and of the others, where both may shine: what hides them is not known.
const LEAST_SHARE: f32 = 1.0 / 16.0;
/// Meshes of more triangles are one light of the tree each.
const MOST_PARTS: usize = 1 << 20;

/// The number of a shape, and that of a triangle of a mesh.
pub(crate) type PartOfShape = (u32, Option<u32>);

impl Lights {
    /// Returns the lights of a world: those that are no shapes, then the glowing shapes of the root group.
    pub(crate) fn new(alone: Vec<Light>, shapes: &mut [PlacedShape]) -> Self {
        let mut lights: Vec<Source> = alone
            .into_iter()
            .map(|light| match light {
                Light::SkyImage(sky) => Source::Sky(Box::new(SampledSky::new(sky))),
                light => Source::Alone(light),
            })
            .collect();
        for (index, shape) in shapes.iter_mut().enumerate() {
            let Some(area) = AreaLight::of(shape, index as u32) else { continue };
            shape.light = Some(LightId(lights.len() as u32));
            lights.push(Source::Area(area));
        }
        let is_sky = |light: &Source| matches!(light, Source::Alone(Light::Sky { .. }) | Source::Sky(_));
        let skies = (0..lights.len() as u32).filter(|&i| is_sky(&lights[i as usize])).collect();
        let n_parts: usize = lights.iter().map(Source::n_parts).sum();
        let choice = match lights.len() < 2 && n_parts <= FEW_PARTS {
            true => Choice::Fixed(Distribution::new(&vec![1.0; lights.len()])),
            false => Choice::Tree(Box::new(ManyLights::new(&lights, shapes))),
        };
        Self { lights, choice, skies }
    }

    pub(crate) fn len(&self) -> usize {
        self.lights.len()
    }

    /// Where those are that are points.
    pub(crate) fn positions(&self) -> impl Iterator<Item = Vec3> {
        self.lights.iter().filter_map(|source| match source {
            Source::Alone(
                Light::Point { position, .. } | Light::Spot { position, .. } | Light::Pictured { position, .. },
            ) => Some(position.as_vec3()),
            Source::Alone(_) | Source::Sky(_) | Source::Area(_) => None,
        })
    }

    /// Draws light; of a shape that glows, with its number and that of the triangle of a mesh.
    pub(crate) fn sample<const N: usize>(
        &self,
        shapes: &[PlacedShape],
        at: &Receiver,
        u_light: f32,
        u: [f32; 2],
        wavelengths_nm: &[f32; N],
    ) -> Option<(LightSample<N>, Option<PartOfShape>)> {
        let Chosen { light: index, triangle, probability, rest } = self.choose(at, u_light, u)?;
        let light = LightId(index as u32);
        let mut place = None;
        let sample = match &self.lights[index] {
            Source::Alone(alone) => alone.sample(at.point, u, wavelengths_nm, probability, light),
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
                let (direction, distance_m, pdf, is_front, triangle) =
                    area.sample(shapes, at.point, triangle, rest, u)?;
                place = Some((area.shape(), triangle));
                let is_lit = is_front || area.emission().is_two_sided;
                is_lit.then(|| LightSample {
                    direction,
                    distance_m,
                    radiance: area.emission().radiance.at(wavelengths_nm),
                    pdf: pdf * probability,
                    is_delta: false,
                    light,
                })
            }
        };
        sample.map(|sample| (sample, place))
    }

    /// The density with which `sample` draws this point of a glowing shape.
    pub(crate) fn pdf(&self, shapes: &[PlacedShape], at: &Receiver, hit: &Hit) -> f32 {
        let placed = &shapes[hit.shape.0 as usize];
        let (Some(light), None) = (placed.light, hit.instance) else { return 0.0 };
        let index = light.0 as usize;
        let Source::Area(area) = &self.lights[index] else { return 0.0 };
        let (probability, triangle) = match &self.choice {
            Choice::Fixed(pick) => (pick.probability(index), None),
            Choice::Tree(many) => many.probability(at, index, hit.primitive),
        };
        if probability > 0.0 { probability * area.pdf(placed, at.point, hit, triangle) } else { 0.0 }
    }

    /// The radiance of the sky in a direction.
    pub(crate) fn sky<const N: usize>(&self, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let mut sum = [0.0; N];
        for &index in &self.skies {
            let radiance = self.of_sky(index, direction, wavelengths_nm);
            sum = lanes(|i| sum[i] + radiance[i]);
        }
        sum
    }

    fn of_sky<const N: usize>(&self, index: u32, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.lights[index as usize] {
            Source::Alone(Light::Sky { radiance }) => radiance.at(wavelengths_nm),
            Source::Sky(sky) => sky.radiance(direction, wavelengths_nm),
            Source::Alone(_) | Source::Area(_) => [0.0; N],
        }
    }

    /// Returns what each sky gives from a direction, multiplied by a share of the density with which `sample` draws the direction of that
    /// sky for this point.
    pub(crate) fn shared_sky<const N: usize>(
        &self,
        at: &Receiver,
        direction: Vec3,
        wavelengths_nm: &[f32; N],
        share: impl Fn(f32) -> f32,
    ) -> [f32; N] {
        let mut sum = [0.0; N];
        for &index in &self.skies {
            let radiance = self.of_sky(index, direction, wavelengths_nm);
            let share = share(self.pdf_of_sky(index, at, direction));
            sum = lanes(|i| sum[i] + share * radiance[i]);
        }
        sum
    }

    /// The density with which `sample` draws a direction of the sky for this point.
    pub(crate) fn sky_pdf(&self, at: &Receiver, direction: Vec3) -> f32 {
        self.skies.iter().map(|&index| self.pdf_of_sky(index, at, direction)).sum()
    }

    fn pdf_of_sky(&self, index: u32, at: &Receiver, direction: Vec3) -> f32 {
        let probability = |index: usize| match &self.choice {
            Choice::Fixed(pick) => pick.probability(index),
            Choice::Tree(many) => many.probability_of_far(at, index),
        };
        match &self.lights[index as usize] {
            Source::Alone(Light::Sky { .. }) => probability(index as usize) / (2.0 * TAU),
            Source::Sky(sky) => probability(index as usize) * sky.pdf(direction),
            Source::Alone(_) | Source::Area(_) => 0.0,
        }
    }

    fn choose(&self, at: &Receiver, u_light: f32, u: [f32; 2]) -> Option<Chosen> {
        if self.lights.is_empty() {
            return None;
        }
        match &self.choice {
            Choice::Fixed(pick) => {
                let (light, rest) = pick.pick(u_light);
                Some(Chosen { light, triangle: None, probability: pick.probability(light), rest })
            }
            Choice::Tree(many) => many.choose(at, refined(u_light, u)),
        }
    }
}

/// Returns a number with bits below its last that are as good as random: 24 do not choose among millions of lights.
fn refined(u_light: f32, u: [f32; 2]) -> f64 {
    let mut v = u[0].to_bits() ^ u[1].to_bits().rotate_left(16) ^ u_light.to_bits().wrapping_mul(0x9e37_79b1);
    for _ in 0..2 {
        v = (v ^ (v >> 16)).wrapping_mul(0x85eb_ca6b);
    }
    f64::from(u_light) + f64::from(v ^ (v >> 16)) * (0.5_f64.powi(56))
}

impl ManyLights {
    fn new(lights: &[Source], shapes: &[PlacedShape]) -> Self {
        let (mut far, mut far_irradiances) = (Vec::new(), Vec::new());
        let (mut bounds, mut leaves, mut places) = (Vec::<LightBounds>::new(), Vec::new(), Vec::new());
        for (index, light) in lights.iter().enumerate() {
            if let Some(irradiance) = light.irradiance_from_afar() {
                places.push(Place::Far(far.len() as u32));
                far.push(index as u32);
                far_irradiances.push(irradiance);
                continue;
            }
            let first_leaf = bounds.len() as u32;
            let is_divided = match light {
                Source::Alone(alone) => {
                    bounds.extend(alone.bounds());
                    false
                }
                Source::Area(area) => area.add_bounds(shapes, MOST_PARTS, &mut bounds),
                Source::Sky(_) => false,
            };
            places.push(Place::Near { first_leaf, is_divided });
            let n_leaves = bounds.len() as u32 - first_leaf;
            leaves.extend((0..n_leaves).map(|part| (index as u32, is_divided.then_some(part))));
        }
        Self { far, far_choice: Distribution::new(&far_irradiances), tree: LightTree::new(&bounds), leaves, places }
    }

    /// Returns the probability that the light comes from the tree: the share of the irradiance that it may give the point.
    fn near_share(&self, at: &Receiver) -> f32 {
        if self.far.is_empty() {
            return 1.0;
        }
        let near = self.tree.irradiance(at);
        if near > 0.0 {
            let share = near / (near + self.far_choice.total() as f32);
            // The irradiance beside a point that shines has no bound.
            if share.is_finite() { share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) } else { 1.0 - LEAST_SHARE }
        } else {
            0.0
        }
    }

    fn choose(&self, at: &Receiver, u: f64) -> Option<Chosen> {
        let near_share = self.near_share(at);
        let near = f64::from(near_share);
        if u >= near {
            let (far, rest) = self.far_choice.pick_f64(((u - near) / (1.0 - near)).min(BELOW_ONE));
            let probability = (1.0 - near_share) * self.far_choice.probability(far);
            return Some(Chosen { light: self.far[far] as usize, triangle: None, probability, rest: rest as f32 });
        }
        let (leaf, probability, rest) = self.tree.pick(at, (u / near).min(BELOW_ONE))?;
        let (light, triangle) = self.leaves[leaf];
        Some(Chosen {
            light: light as usize,
            triangle: triangle.map(|triangle| triangle as usize),
            probability: near_share * probability,
            rest: (rest as f32).min(crate::sampling::ONE_MINUS_EPSILON),
        })
    }

    /// Returns the probability with which a light is chosen, and of a mesh the triangle that is chosen with it.
    fn probability(&self, at: &Receiver, light: usize, primitive: u32) -> (f32, Option<usize>) {
        match self.places[light] {
            Place::Far(_) => (self.probability_of_far(at, light), None),
            Place::Near { first_leaf, is_divided } => {
                let leaf = first_leaf + if is_divided { primitive } else { 0 };
                let probability = self.near_share(at) * self.tree.probability(at, leaf as usize);
                (probability, is_divided.then_some(primitive as usize))
            }
        }
    }

    fn probability_of_far(&self, at: &Receiver, light: usize) -> f32 {
        let Place::Far(far) = self.places[light] else { return 0.0 };
        (1.0 - self.near_share(at)) * self.far_choice.probability(far as usize)
    }
}

impl Source {
    /// As many lights it is to choose from.
    fn n_parts(&self) -> usize {
        if let Self::Area(area) = self { area.n_parts() } else { 1 }
    }

    /// The irradiance, W m⁻², of a light far away on a plane that faces it, roughly: to choose lights by. `None` where its distance matters.
    fn irradiance_from_afar(&self) -> Option<f64> {
        let power = |curve: &SpectralCurve| f64::from(visible_power(curve));
        match self {
            Self::Alone(Light::Distant { irradiance, .. }) => Some(power(irradiance)),
            Self::Alone(Light::Sky { radiance }) => Some(PI * power(radiance)),
            Self::Sky(sky) => Some(PI * sky.mean()),
            Self::Alone(Light::Point { .. } | Light::Spot { .. } | Light::Pictured { .. } | Light::SkyImage(_))
            | Self::Area(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::{Emission, MaterialId, Shape, TriangleMesh, WorldBuilder, placed::PlacedKind};

    /// A thousand panes of 2 cm in a room of 4 m; two of three face away from most of it.
    fn panes() -> Vec<PlacedShape> {
        let number = |i: u32, salt: u32| {
            f64::from(i.wrapping_mul(0x9e37_79b1 ^ salt).wrapping_mul(0x85eb_ca6b) >> 8) / f64::from(1 << 24)
        };
        let pane = |i: u32| {
            let turn =
                DAffine3::from_rotation_x(if i.is_multiple_of(3) { std::f64::consts::PI } else { number(i, 77) });
            let at = DVec3::new(4.0 * number(i, 1) - 2.0, 4.0 * number(i, 2) - 2.0, 0.3 + 2.0 * number(i, 3));
            let mut mesh = TriangleMesh::quad(Vec3::new(-0.01, -0.01, 0.0), Vec3::X * 0.02, Vec3::Y * 0.02);
            mesh.transform(&(DAffine3::from_translation(at) * turn));
            PlacedShape {
                kind: PlacedKind::Mesh(mesh),
                group: 0,
                material: MaterialId(0),
                emission: Some(Emission {
                    radiance: SpectralCurve::constant(0.5 + number(i, 4) as f32),
                    is_two_sided: false,
                }),
                is_reversed: false,
                light: None,
                interface: None,
            }
        };
        (0..1000).map(pane).collect()
    }

    /// Mean and variance of a sample of the irradiance on a floor, nothing hiding anything.
    fn irradiance(lights: &Lights, shapes: &[PlacedShape], point: Vec3, n: u32) -> (f64, f64) {
        let at = Receiver { point, normal: Some(Vec3::Z) };
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let number = |salt: u32| {
                let v = (i ^ salt.wrapping_mul(0x2722_0a95)).wrapping_mul(0x9e37_79b1);
                let v = (v ^ (v >> 15)).wrapping_mul(0x85eb_ca77);
                ((v ^ (v >> 13)).wrapping_mul(0xc2b2_ae3d) >> 8) as f32 / (1 << 24) as f32
            };
            let sample =
                lights.sample(shapes, &at, number(1), [number(2), number(3)], &[550.0]).map(|(sample, _)| sample);
            let value = sample.map_or(0.0, |s| f64::from(s.radiance[0] * s.direction.z.max(0.0) / s.pdf));
            sum += value / f64::from(n);
            squares += value * value / f64::from(n);
        }
        (sum, squares - sum * sum)
    }

    #[test]
    fn tree_has_the_mean_of_even_choice_and_far_less_variance() {
        let mut shapes = panes();
        let tree = Lights::new(Vec::new(), &mut shapes);
        assert!(matches!(tree.choice, Choice::Tree(_)));
        let even = Lights { choice: Choice::Fixed(Distribution::new(&[1.0; 1000])), ..tree.clone() };
        for point in [Vec3::ZERO, Vec3::new(1.2, -0.7, 0.0), Vec3::new(-1.9, 1.9, 0.5)] {
            let (n_tree, n_even) = (40_000, 400_000);
            let (mean, variance) = irradiance(&tree, &shapes, point, n_tree);
            let (even_mean, even_variance) = irradiance(&even, &shapes, point, n_even);
            let sigma = (variance / f64::from(n_tree) + even_variance / f64::from(n_even)).sqrt();
            println!("{point}: {mean:.4} {even_mean:.4} ± {sigma:.4}, variance {variance:.4} {even_variance:.4}");
            assert!((mean - even_mean).abs() < 3.0 * sigma, "{mean} {even_mean} {sigma}");
            assert!(variance < even_variance / 5.0, "{variance} {even_variance}");
        }
    }

    /// Lights are shared by what they give the point: neither a faint sky about a wide scene nor a strong lamp far away takes a near lamp's samples.
    #[test]
    fn near_lamp_is_chosen_beside_sky_and_strong_lamp_afar() {
        let lamp = |height_m: f64, intensity| Light::Point {
            position: DVec3::new(0.0, 0.0, height_m),
            intensity: SpectralCurve::constant(intensity),
        };
        let sky = Light::Sky { radiance: SpectralCurve::constant(1e-3) };
        // Irradiances of 1 and .01 W m⁻² nm⁻¹ by the lamps, π/1000 by the sky.
        let lights = Lights::new(vec![sky, lamp(10.0, 1.0), lamp(0.1, 0.01)], &mut []);
        let at = Receiver { point: Vec3::ZERO, normal: Some(Vec3::Z) };
        let chosen = |light| match &lights.choice {
            Choice::Tree(many) => f64::from(many.probability(&at, light, 0).0),
            Choice::Fixed(_) => panic!("three lights are chosen by the point"),
        };
        let [sky, far, near] = [0, 1, 2].map(chosen);
        assert!((sky - 1.0 / 16.0).abs() < 1e-6, "{sky}");
        assert!((near + far + sky - 1.0).abs() < 1e-6 && (near / far / 100.0 - 1.0).abs() < 1e-5, "{near} {far}");
        let (mean, variance) = irradiance(&lights, &[], at.point, 40_000);
        let truth = 1.01 + PI * 1e-3;
        assert!((mean - truth).abs() < 4.0 * (variance / 40_000.0).sqrt(), "{mean} {truth} {variance}");
        // Below the horizon no lamp shines: all goes to the sky.
        let below = Receiver { point: Vec3::ZERO, normal: Some(-Vec3::Z) };
        let Choice::Tree(many) = &lights.choice else { panic!("three lights are chosen by the point") };
        assert_eq!(many.probability_of_far(&below, 0), 1.0);
    }

    /// What a ray finds has the density with which it would have been drawn, so that bounced rays and lights share without loss.
    #[test]
    fn densities_of_hits_are_those_of_samples() {
        let mut builder = WorldBuilder::new();
        let matte = builder.add_material("black", crate::Material::Matte { reflectance: crate::TextureId(0) });
        builder.add_texture(crate::Texture::Curve(SpectralCurve::constant(0.0)));
        let glow = |radiance| Some(Emission { radiance: SpectralCurve::constant(radiance), is_two_sided: true });
        for (i, radiance) in [1.0, 3.0, 0.2].into_iter().enumerate() {
            let at = DAffine3::from_translation(DVec3::new(i as f64 - 1.0, 0.4, 1.5));
            builder.add_shape(Shape::Sphere { radius_m: 0.3 }, at, matte, glow(radiance));
            let block = TriangleMesh::block(Vec3::splat(-0.2), Vec3::splat(0.2));
            let at = DAffine3::from_translation(DVec3::new(1.0 - i as f64, -0.8, 1.0));
            builder.add_shape(Shape::Mesh(block), at, matte, glow(radiance));
        }
        builder.add_light(Light::Sky { radiance: SpectralCurve::constant(0.1) });
        let world = builder.build().unwrap();
        let at = Receiver { point: Vec3::ZERO, normal: Some(Vec3::Z) };
        let (mut n_compared, mut n_beside_edge) = (0, 0);
        for i in 0..4000_u32 {
            let number = |k: u32| (i.wrapping_mul(k).wrapping_mul(0x9e37_79b1) >> 8) as f32 / (1 << 24) as f32;
            let Some(drawn) = world.sample_light(at, number(1), [number(3), number(5)], &[550.0]) else { continue };
            let ray = crate::Ray { origin: at.point, direction: drawn.direction };
            let density = match world.intersect(&ray, f32::INFINITY) {
                None => world.sky_pdf(at, drawn.direction),
                Some(hit) if (hit.distance_m / drawn.distance_m - 1.0).abs() < 1e-4 => world.light_pdf(at, &hit),
                Some(_) => continue,
            };
            n_compared += 1;
            n_beside_edge += i32::from((density / drawn.pdf - 1.0).abs() > 1e-2);
        }
        // A ray to a point beside an edge of a block can meet the other face.
        assert!(n_compared > 2000 && n_beside_edge < n_compared / 200, "{n_beside_edge} of {n_compared}");
    }

    /// A lamp that shines beyond what is visible alone is chosen as others are.
    #[test]
    fn infrared_lamps_are_chosen() {
        let beyond = dioptric_spectrum::Spectrum::new(vec![840.0, 850.0, 860.0], vec![0.0, 1.0, 0.0]).unwrap();
        let infrared = Light::Point { position: DVec3::Z, intensity: SpectralCurve::new(&beyond, crate::Beyond::Zero) };
        let white = Light::Point { position: DVec3::X, intensity: SpectralCurve::constant(1.0) };
        for n_white in [1, 3] {
            let mut all = vec![infrared.clone()];
            all.extend(vec![white.clone(); n_white]);
            let lights = Lights::new(all, &mut []);
            let drawn = |i: u32| {
                let sample = lights.sample(&[], &Vec3::ZERO.into(), (i as f32 + 0.5) / 4096.0, [0.5; 2], &[850.0]);
                sample.map(|(sample, _)| sample)
            };
            let n_infrared = (0..4096).filter_map(drawn).filter(|sample| sample.light == LightId(0)).count();
            assert!(n_infrared > 0, "{n_white}");
        }
    }
}
