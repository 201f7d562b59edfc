//! The light that falls on a point of a surface, gathered by a few rays.

use std::f32::consts::{FRAC_1_PI, PI};

use dioptric_spectrum::lanes;
use dioptric_world::{Bsdf, Hit, Ray, Receiver, World, glam::Vec3};

use crate::{
    LightPaths, Sampler,
    integrator::{Integrator, Path},
};

/// Rays by which light is gathered at a sample; powers of two, so that those of neighbors fill each other's gaps.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightRays {
    /// To lights.
    pub(super) n_lights: u32,
    /// Into the world, for light that other surfaces scatter.
    pub(super) n_bounces: u32,
    /// For gloss.
    pub(super) n_gloss: u32,
}

impl LightRays {
    /// As few as there can be.
    pub(super) const FEW: Self = Self { n_lights: 1, n_bounces: 1, n_gloss: 1 };

    /// More of them where light is smoothed less: where less than all samples beside are [`alike`](super::smooth::alike).
    pub(super) fn where_alike(self, alike: f32) -> Self {
        let times = match alike {
            0.85.. => 1,
            0.6.. => 2,
            0.35.. => 4,
            _ => 8,
        };
        let Self { n_lights, n_bounces, n_gloss } = self;
        Self { n_lights: times * n_lights, n_bounces: times * n_bounces, n_gloss: times * n_gloss }
    }
}

/// Light straight from its sources: the irradiance of what is scattered evenly, and the radiance that gloss sends on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direct<const N: usize> {
    pub(super) irradiance: [f32; N],
    pub(super) gloss: [f32; N],
}

/// A surface that light is gathered on.
#[derive(Clone, Debug)]
pub(super) struct LitSurface<const N: usize> {
    pub(super) hit: Hit,
    pub(super) bsdf: Bsdf<N>,
    /// The normal of the side that is seen, with relief.
    pub(super) normal: Vec3,
    pub(super) gloss: Option<Bsdf<N>>,
    /// Whether anything is scattered evenly.
    pub(super) is_diffuse: bool,
    /// What mirrors show on the way, each with what its radiance counts.
    pub(super) mirrored: Vec<(Ray, [f32; N])>,
    /// What is sent on to the eye of what gloss sends out.
    pub(super) through: [f32; N],
}

impl<const N: usize> LitSurface<N> {
    /// Whether anything else than even scattering sends light on.
    pub(super) fn has_gloss(&self) -> bool {
        self.gloss.is_some() || !self.mirrored.is_empty()
    }
}

/// What light is gathered from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gatherer<'a, const N: usize> {
    pub(super) world: &'a World,
    pub(super) wavelengths_nm: &'a [f32; N],
    pub(super) seed: u64,
    /// The most radiance that one path may find, W m⁻² sr⁻¹ nm⁻¹.
    pub(super) most: f32,
}

/// Samples of the lattice along each side of a block whose rays are one net, a power of 2.
const BLOCK: usize = 1 << 12;
/// Pairs of numbers that rays begin with; those of their paths follow.
const BOUNCE_PAIR: u32 = 2;
const GLOSS_PAIR: u32 = 3;
const GLOSS_LOBE_PAIR: u32 = 4;

/// A density so small that light which could have been drawn counts for nothing where a path meets it.
const HARDLY: f32 = 1e-30;

impl<const N: usize> Gatherer<'_, N> {
    /// Returns the numbers of ray `index` of `n` at a sample. Samples take the points of one Owen-scrambled sequence along a Z-curve, so that
    /// those of each square of 2 × 2, 4 × 4, … samples are a net: what smoothing takes together fills each other's gaps (Ahmed & Wonka 2020).
    fn random(&self, (row, column): (usize, usize), (index, n): (u32, u32), purpose: u64) -> Sampler {
        let block = (row / BLOCK) as u32 * 0x1_0001 + (column / BLOCK) as u32;
        let within = 2 * spread((row % BLOCK) as u32) + spread((column % BLOCK) as u32);
        Sampler::new(self.seed ^ (purpose << 40), block, n, within * n + index)
    }

    pub(super) fn integrator(&self) -> Integrator<'_> {
        Integrator { world: self.world, paths: LightPaths::Full, clamp: Some(self.most) }
    }

    /// Gathers light straight from its sources, and what gloss sends on of all light.
    pub(super) fn direct(&self, surface: &LitSurface<N>, at: (usize, usize), rays: LightRays) -> Direct<N> {
        let mut sum = Direct { irradiance: [0.0; N], gloss: [0.0; N] };
        let LitSurface { hit, bsdf, normal, gloss, is_diffuse, .. } = surface;
        if !is_diffuse && gloss.is_none() {
            return sum;
        }
        let LightRays { n_lights, n_gloss, .. } = rays;
        let receiver = Receiver { point: hit.point, normal: bsdf.lit_side() };
        for index in 0..n_lights {
            let random = self.random(at, (index, n_lights), 1);
            let [u_light, x, y, _] = random.camera().map(|u| u as f32);
            let light = self.world.sample_light(
                receiver,
                u_light.min(BELOW_ONE),
                [x, y].map(|u| u.min(BELOW_ONE)),
                self.wavelengths_nm,
            );
            let Some(light) = light else { continue };
            let cos = normal.dot(light.direction);
            let flat = hit.geometric_normal.dot(light.direction) * hit.geometric_normal.dot(*normal);
            let even = match *is_diffuse && cos > 0.0 && flat > 0.0 {
                true => cos * bsdf.diffuse_weight(light.direction),
                false => 0.0,
            };
            let glossy = gloss.as_ref().map(|gloss| gloss.eval(light.direction));
            let is_seen = even > 0.0 || glossy.is_some_and(|value| value.iter().any(|&v| v > 0.0));
            let is_lit = is_seen && light.pdf > 0.0 && light.radiance.iter().any(|&l| l > 0.0);
            if !is_lit || self.world.is_occluded(&hit.ray_towards(light.direction), light.distance_m) {
                continue;
            }
            let share = 1.0 / (n_lights as f32 * light.pdf);
            for lane in 0..N {
                sum.irradiance[lane] += share * even * light.radiance[lane];
            }
            if let (Some(value), Some(gloss)) = (glossy, gloss) {
                // Light that a ray of gloss could find too is shared between both.
                let by_lights = n_lights as f32 * light.pdf;
                let by_gloss = if light.is_delta { 0.0 } else { n_gloss as f32 * gloss.pdf(light.direction) };
                let share = share * by_lights / (by_lights + by_gloss);
                (0..N).for_each(|lane| sum.gloss[lane] += share * value[lane] * light.radiance[lane]);
            }
        }
        if let Some(gloss) = gloss {
            for index in 0..n_gloss {
                let random = self.random(at, (index, n_gloss), 2);
                let ([u_lobe, _], u) = (random.pair(GLOSS_LOBE_PAIR), random.pair(GLOSS_PAIR));
                let Some(drawn) = gloss.sample(u_lobe, u) else { continue };
                let density = drawn.pdf * n_gloss as f32 / n_lights.max(1) as f32;
                let path = Path::new(self.world, hit.ray_towards(drawn.incident), Some((receiver, density)), 1);
                let found = self.integrator().follow(path, self.wavelengths_nm, &random);
                let share = 1.0 / n_gloss as f32;
                (0..N).for_each(|lane| sum.gloss[lane] += share * drawn.weight[lane] * found[lane].min(self.most));
            }
        }
        sum
    }

    /// Gathers the irradiance that other surfaces scatter.
    pub(super) fn bounced(&self, surface: &LitSurface<N>, at: (usize, usize), rays: LightRays) -> [f32; N] {
        let LitSurface { hit, bsdf, normal, is_diffuse, .. } = surface;
        let mut sum = [0.0; N];
        if !is_diffuse {
            return sum;
        }
        let (x, y) = normal.any_orthonormal_pair();
        let receiver = Receiver { point: hit.point, normal: Some(*normal) };
        for index in 0..rays.n_bounces {
            let random = self.random(at, (index, rays.n_bounces), 3);
            let [u, v] = random.pair(BOUNCE_PAIR).map(f64::from);
            let disc = crate::sampler::on_disc(u, v).as_vec2();
            let up = (1.0 - disc.length_squared()).max(0.0).sqrt();
            let direction = (disc.x * x + disc.y * y + up * *normal).normalize();
            if hit.geometric_normal.dot(direction) * hit.geometric_normal.dot(*normal) <= 0.0 {
                continue;
            }
            // Lights have been looked for: what glows does not count again.
            let path = Path::new(self.world, hit.ray_towards(direction), Some((receiver, HARDLY)), 1);
            let found = self.integrator().follow(path, self.wavelengths_nm, &random);
            let share = PI * bsdf.diffuse_weight(direction) / rays.n_bounces as f32;
            (0..N).for_each(|lane| sum[lane] += share * found[lane].min(self.most));
        }
        sum
    }

    /// Returns the radiance that a surface sends out under light gathered now, by few rays.
    pub(super) fn lit_now(&self, surface: &LitSurface<N>, at: (usize, usize), rays: LightRays) -> [f32; N] {
        let (direct, bounced) = (self.direct(surface, at, rays), self.bounced(surface, at, rays));
        let reflectance = surface.bsdf.diffuse_reflectance();
        lanes(|lane| FRAC_1_PI * reflectance[lane] * (direct.irradiance[lane] + bounced[lane]) + direct.gloss[lane])
    }
}

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// Returns the lower 16 bits with a 0 above each.
fn spread(bits: u32) -> u32 {
    [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)]
        .into_iter()
        .fold(bits, |bits, (by, mask)| (bits | bits << by) & mask)
}
