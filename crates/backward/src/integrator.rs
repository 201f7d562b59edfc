//! Radiance along a ray: path tracing with sampled lights, without bias.
//!
//! At each surface a light is drawn and looked for, and a direction is drawn from the surface's own scattering; light
//! that both could have found is shared between them by the balance heuristic (Veach 1997, ch. 9). Paths end by Russian
//! roulette. A packet of wavelengths shares the path until it meets a surface that disperses it; there each goes on alone.

use dioptric_spectrum::lanes;
use dioptric_world::{Ray, Receiver, World};
use serde::{Deserialize, Serialize};

use crate::Sampler;

/// How much of the light is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum LightPaths {
    /// All of it, however often it is scattered.
    #[default]
    Full,
    /// At most so many scatterings.
    UpTo(u32),
    /// Light that comes straight from its source, or from it by one scattering.
    Direct,
    /// What shines by itself, seen directly.
    Emission,
}

impl LightPaths {
    fn most_scatterings(self) -> u32 {
        match self {
            Self::Full => u32::MAX,
            Self::UpTo(most) => most,
            Self::Direct => 1,
            Self::Emission => 0,
        }
    }
}

/// Scatterings from which on Russian roulette may end a path.
const ROULETTE_FROM: u32 = 3;
/// Scatterings from which on a path that has lost nothing may end too, as within glass that reflects it totally again and again. Sooner, the few paths
/// that end would be rarer than what the spread of some passes shows.
const ENDS_FROM: u32 = 16;
/// The greatest chance to go on from there.
const MOST_LIKELY: f32 = 0.95;
/// Pairs of numbers that a scattering takes.
const PAIRS: u32 = 3;
/// The first pair of the first scattering; pairs before it are the camera's.
const FIRST_PAIR: u32 = 8;

/// What light is found along rays of a world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Integrator<'a> {
    pub(crate) world: &'a World,
    pub(crate) paths: LightPaths,
    /// The most that one scattered path may add to a sample, W m⁻² sr⁻¹ nm⁻¹; no limit, which would bias, unless asked for.
    pub(crate) clamp: Option<f32>,
}

/// A path on its way.
#[derive(Clone, Copy)]
pub(crate) struct Path<const N: usize> {
    pub(crate) ray: Ray,
    /// The share of radiance that reaches the camera.
    pub(crate) throughput: [f32; N],
    /// Where it was scattered last and the density of its direction; `None` where no drawn light could have found it.
    pub(crate) scattered: Option<(Receiver, f32)>,
    pub(crate) n_scatterings: u32,
}

impl Integrator<'_> {
    /// Returns an estimate of the radiance along a ray at these wavelengths.
    pub(crate) fn radiance<const N: usize>(&self, ray: Ray, wavelengths_nm: &[f32; N], random: &Sampler) -> [f32; N] {
        self.follow(Path { ray, throughput: [1.0; N], scattered: None, n_scatterings: 0 }, wavelengths_nm, random)
    }

    /// Returns an estimate of the light that a path on its way still finds.
    pub(crate) fn follow<const N: usize>(
        &self,
        mut path: Path<N>,
        wavelengths_nm: &[f32; N],
        random: &Sampler,
    ) -> [f32; N] {
        let mut sum = [0.0; N];
        loop {
            let Path { ray, throughput, scattered, n_scatterings } = path;
            // Beyond everything lies the sky.
            let Some(hit) = self.world.intersect(&ray, f32::INFINITY) else {
                let share = scattered.map_or(1.0, |(from, pdf)| share(pdf, self.world.sky_pdf(from, ray.direction)));
                let sky = self.world.sky(ray.direction, wavelengths_nm);
                self.add(&mut sum, n_scatterings, &throughput, &lanes(|i| sky[i] * share));
                return sum;
            };
            // Dispersion takes the packet apart: every wavelength meets this surface again by itself.
            let bsdf = self.world.bsdf(&hit, -ray.direction, wavelengths_nm);
            let is_last = n_scatterings >= self.paths.most_scatterings();
            if N > 1 && !is_last && bsdf.is_dispersive() {
                for i in 0..N {
                    let own = Path { ray, throughput: [throughput[i]], scattered, n_scatterings };
                    sum[i] += self.follow(own, &[wavelengths_nm[i]], random)[0];
                }
                return sum;
            }
            // A medium that it fills has taken its share on the way.
            let throughput = match self.world.transmittance(&hit, &ray, wavelengths_nm) {
                Some(left) => lanes(|i| throughput[i] * left[i]),
                None => throughput,
            };
            // The surface may shine.
            let glow = self.world.emission(&hit, -ray.direction, wavelengths_nm);
            if glow.iter().any(|&l| l > 0.0) {
                let share = scattered.map_or(1.0, |(from, pdf)| share(pdf, self.world.light_pdf(from, &hit)));
                self.add(&mut sum, n_scatterings, &throughput, &lanes(|i| glow[i] * share));
            }
            if is_last {
                return sum;
            }
            // Look for a light.
            let pair = FIRST_PAIR + PAIRS * n_scatterings;
            let [[u_light, u_lobe], u_place, u_direction] = [0, 1, 2].map(|i| random.pair(pair + i));
            let at = Receiver { point: hit.point, normal: bsdf.lit_side() };
            if !bsdf.is_delta()
                && let Some(light) = self.world.sample_light(at, u_light, u_place, wavelengths_nm)
            {
                let factor = bsdf.eval(light.direction);
                let is_lit = light.pdf > 0.0 && factor.iter().zip(&light.radiance).any(|(f, l)| f * l > 0.0);
                if is_lit && !self.world.is_occluded(&hit.ray_towards(light.direction), light.distance_m) {
                    let share = if light.is_delta { 1.0 } else { share(light.pdf, bsdf.pdf(light.direction)) };
                    let found = lanes(|i| factor[i] * light.radiance[i] * (share / light.pdf));
                    self.add(&mut sum, n_scatterings + 1, &throughput, &found);
                }
            }
            // Go on in a direction that the surface scatters from.
            let Some(next) = bsdf.sample(u_lobe, u_direction) else { return sum };
            path.ray = hit.ray_towards(next.incident);
            path.throughput = lanes(|i| throughput[i] * next.weight[i]);
            path.scattered = if next.is_delta { None } else { Some((at, next.pdf)) };
            path.n_scatterings += 1;
            let greatest = path.throughput.iter().copied().fold(0.0, f32::max);
            if greatest <= 0.0 {
                return sum;
            }
            if path.n_scatterings >= ROULETTE_FROM {
                let most_likely = if path.n_scatterings < ENDS_FROM { 1.0 } else { MOST_LIKELY };
                let chance = greatest.min(most_likely);
                if random.pair(pair + ROULETTE)[0] >= chance {
                    return sum;
                }
                path.throughput.iter_mut().for_each(|share| *share /= chance);
            }
        }
    }

    /// Adds light that was scattered so often.
    fn add<const N: usize>(&self, sum: &mut [f32; N], n_scatterings: u32, throughput: &[f32; N], light: &[f32; N]) {
        let most = self.clamp.filter(|_| n_scatterings > 1).unwrap_or(f32::INFINITY);
        for i in 0..N {
            sum[i] += (throughput[i] * light[i]).min(most);
        }
    }
}

/// Far from the pairs of scatterings: that of the roulette.
const ROULETTE: u32 = 0x4000_0000;

/// Returns the share of light found with the first density that is counted there, where the second could find it too.
fn share(pdf: f32, other: f32) -> f32 {
    pdf / (pdf + other)
}
