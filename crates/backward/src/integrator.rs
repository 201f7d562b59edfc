//! Radiance along a ray: path tracing with sampled lights, without bias.
//!
//! At each surface a light is drawn and looked for, and a direction is drawn from the surface's own scattering; light
//! that both could have found is shared between them by the balance heuristic (Veach 1997, ch. 9). Paths end by Russian
//! roulette. A packet of wavelengths shares the path until it meets a surface that disperses it; there each goes on alone.

use dioptric_spectrum::lanes;
use dioptric_world::{Bsdf, BsdfSample, Hit, Medium, MediumId, Ray, Receiver, World, glam::Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    Sampler,
    media::{self, Arrival},
};

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
/// The same in media, where light that isn't absorbed may be scattered thousands of times before it leaves.
const ENDS_IN_MEDIA_FROM: u32 = 2048;
const MOST_LIKELY_IN_MEDIA: f32 = 0.999;
/// Paths in media end by what they have lost there: light within glass is less than 1 by its index alone.
const LEAST_ENTERED: f32 = 0.2;
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
    /// What it goes through.
    pub(crate) medium: Option<MediumId>,
    /// What it carried when it came into that.
    entered: f32,
    /// The surface that it has reached; none where that is still to be looked for.
    at: Option<Hit>,
}

impl<const N: usize> Path<N> {
    /// Returns a path that begins with this ray.
    pub(crate) fn new(world: &World, ray: Ray, scattered: Option<(Receiver, f32)>, n_scatterings: u32) -> Self {
        let medium = world.medium_along(&ray);
        Self { ray, throughput: [1.0; N], scattered, n_scatterings, medium, entered: 1.0, at: None }
    }
}

/// Where light is scattered.
enum Place<'a, const N: usize> {
    Surface(&'a Hit, Bsdf<N>),
    /// A point of a medium, and the way that the path came; whether no light is found from there.
    Medium(&'a Medium, Ray, bool),
}

impl<const N: usize> Place<'_, N> {
    fn receiver(&self) -> Receiver {
        match self {
            Self::Surface(hit, bsdf) => Receiver { point: hit.point, normal: bsdf.lit_side() },
            Self::Medium(_, at, _) => at.origin.into(),
        }
    }

    fn is_delta(&self) -> bool {
        match self {
            Self::Surface(_, bsdf) => bsdf.is_delta(),
            Self::Medium(_, _, is_closed) => *is_closed,
        }
    }

    fn eval(&self, incident: Vec3) -> [f32; N] {
        match self {
            Self::Surface(_, bsdf) => bsdf.eval(incident),
            Self::Medium(medium, at, _) => [medium.phase(at.direction.dot(incident)); N],
        }
    }

    fn pdf(&self, incident: Vec3) -> f32 {
        match self {
            Self::Surface(_, bsdf) => bsdf.pdf(incident),
            Self::Medium(medium, at, _) => medium.phase(at.direction.dot(incident)),
        }
    }

    fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        match self {
            Self::Surface(_, bsdf) => bsdf.sample(u_lobe, u),
            Self::Medium(medium, at, is_closed) => {
                let incident = medium.sample_phase(at.direction, u);
                let pdf = medium.phase(at.direction.dot(incident));
                Some(BsdfSample { incident, weight: [1.0; N], pdf, is_delta: *is_closed, is_dispersed: false })
            }
        }
    }

    fn ray_towards(&self, direction: Vec3) -> Ray {
        match self {
            Self::Surface(hit, _) => hit.ray_towards(direction),
            Self::Medium(_, at, _) => Ray { origin: at.origin, direction },
        }
    }

    fn medium_towards(&self, world: &World, direction: Vec3, here: Option<MediumId>) -> Option<MediumId> {
        match self {
            Self::Surface(hit, _) => world.medium_towards(hit, direction, here),
            Self::Medium(..) => here,
        }
    }
}

impl Integrator<'_> {
    /// Returns an estimate of the radiance along a ray at these wavelengths.
    pub(crate) fn radiance<const N: usize>(&self, ray: Ray, wavelengths_nm: &[f32; N], random: &Sampler) -> [f32; N] {
        self.follow(Path::new(self.world, ray, None, 0), wavelengths_nm, random)
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
            let Path { ray, mut throughput, scattered, n_scatterings, .. } = path;
            let pair = FIRST_PAIR + PAIRS * n_scatterings;
            let arrival = match path.at.take() {
                Some(hit) => Arrival::Surface(hit),
                None if self.world.has_media() => {
                    // Media take their share on the way, shine, and may scatter.
                    let (mut glow, mut numbers) = ([0.0; N], random.stream(FLIGHT + n_scatterings));
                    let way = (ray, &mut path.medium);
                    let arrival = media::fly(self.world, way, &mut throughput, &mut glow, wavelengths_nm, &mut numbers);
                    self.add(&mut sum, n_scatterings, &[1.0; N], &glow);
                    arrival
                }
                None => self.world.intersect(&ray, f32::INFINITY).map_or(Arrival::Sky, Arrival::Surface),
            };
            let is_last = n_scatterings >= self.paths.most_scatterings();
            let hit;
            let place = match arrival {
                Arrival::Lost => return sum,
                // Beyond everything lies the sky.
                Arrival::Sky => {
                    let sky = match scattered {
                        None => self.world.sky(ray.direction, wavelengths_nm),
                        Some((from, pdf)) => {
                            self.world.shared_sky(from, ray.direction, wavelengths_nm, |other| share(pdf, other))
                        }
                    };
                    self.add(&mut sum, n_scatterings, &throughput, &sky);
                    return sum;
                }
                Arrival::Medium(medium, at) => {
                    Place::Medium(self.world.medium(medium), at, self.world.is_closed(medium))
                }
                Arrival::Surface(met) => {
                    // Dispersion takes the packet apart: every wavelength goes on from this surface by itself.
                    let bsdf = self.world.bsdf(&met, -ray.direction, wavelengths_nm);
                    if N > 1 && !is_last && bsdf.is_dispersive() {
                        for i in 0..N {
                            let Path { medium, entered, .. } = path;
                            let throughput = [throughput[i]];
                            let own =
                                Path { ray, throughput, scattered, n_scatterings, medium, entered, at: Some(met) };
                            sum[i] += self.follow(own, &[wavelengths_nm[i]], random)[0];
                        }
                        return sum;
                    }
                    // The surface may shine.
                    let glow = self.world.emission(&met, -ray.direction, wavelengths_nm);
                    if glow.iter().any(|&l| l > 0.0) {
                        let share = scattered.map_or(1.0, |(from, pdf)| share(pdf, self.world.light_pdf(from, &met)));
                        self.add(&mut sum, n_scatterings, &throughput, &lanes(|i| glow[i] * share));
                    }
                    hit = met;
                    Place::Surface(&hit, bsdf)
                }
            };
            if is_last {
                return sum;
            }
            // Look for a light.
            let [[u_light, u_lobe], u_place, u_direction] = [0, 1, 2].map(|i| random.pair(pair + i));
            let at = place.receiver();
            if !place.is_delta()
                && let Some(light) = self.world.sample_light(at, u_light, u_place, wavelengths_nm)
            {
                let factor = place.eval(light.direction);
                let is_lit = light.pdf > 0.0 && factor.iter().zip(&light.radiance).any(|(f, l)| f * l > 0.0);
                let way = place.ray_towards(light.direction);
                if is_lit && !self.world.has_media() {
                    if !self.world.is_occluded(&way, light.distance_m) {
                        let share = if light.is_delta { 1.0 } else { share(light.pdf, place.pdf(light.direction)) };
                        let found = lanes(|i| factor[i] * light.radiance[i] * (share / light.pdf));
                        self.add(&mut sum, n_scatterings + 1, &throughput, &found);
                    }
                } else if is_lit {
                    let share = if light.is_delta { 1.0 } else { share(light.pdf, place.pdf(light.direction)) };
                    let found = lanes(|i| throughput[i] * factor[i] * light.radiance[i] * (share / light.pdf));
                    let medium = place.medium_towards(self.world, light.direction, path.medium);
                    let mut numbers = random.stream(LOOK + n_scatterings);
                    let left = media::left_on_the_way(
                        self.world,
                        (way, medium),
                        light.distance_m,
                        found,
                        wavelengths_nm,
                        &mut numbers,
                    );
                    left.into_iter().for_each(|left| self.add(&mut sum, n_scatterings + 1, &[1.0; N], &left));
                }
            }
            // Go on in a direction that the surface scatters from, or the medium.
            let Some(next) = place.sample(u_lobe, u_direction) else { return sum };
            path.ray = place.ray_towards(next.incident);
            path.throughput = lanes(|i| throughput[i] * next.weight[i]);
            path.scattered = if next.is_delta { None } else { Some((at, next.pdf)) };
            path.n_scatterings += 1;
            let greatest = path.throughput.iter().copied().fold(0.0, f32::max);
            if greatest <= 0.0 {
                return sum;
            }
            let (mut ends_from, mut most_likely) = (ENDS_FROM, MOST_LIKELY);
            if self.world.has_media() {
                let medium = place.medium_towards(self.world, next.incident, path.medium);
                if medium != path.medium {
                    path.entered = if medium.is_some() { greatest.clamp(LEAST_ENTERED, 1.0) } else { 1.0 };
                    path.medium = medium;
                }
                if path.medium.is_some() {
                    (ends_from, most_likely) = (ENDS_IN_MEDIA_FROM, MOST_LIKELY_IN_MEDIA);
                }
            }
            if path.n_scatterings >= ROULETTE_FROM {
                let most_likely = if path.n_scatterings < ends_from { 1.0 } else { most_likely };
                let chance = (greatest / path.entered).min(most_likely);
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

/// Far from the pairs of scatterings: that of the roulette, and the numbers that media take on the way and towards a light.
const ROULETTE: u32 = 0x4000_0000;
const FLIGHT: u32 = 0x6000_0000;
const LOOK: u32 = 0x6800_0000;

/// Returns the share of light found with the first density that is counted there, where the second could find it too.
fn share(pdf: f32, other: f32) -> f32 {
    pdf / (pdf + other)
}
