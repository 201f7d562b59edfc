//! Light on its way through media: where it is scattered, and what is left of it.
//!
//! Distances are drawn against a bound of the density, beyond which what is missing counts as a scattering that changes
//! nothing (Woodcock & al. 1965). All wavelengths of a packet share the distance: one of them, drawn by what it still
//! carries, draws it, and all count by their own density over the mean of all densities with those shares. What the packet
//! carries in all never grows by that, and every wavelength is estimated without bias (after Wilkie & al. 2014; Kutz & al.
//! 2017).

use dioptric_spectrum::lanes;
use dioptric_world::{Coefficients, Medium, MediumId, Met, Ray, World};

use crate::sampler::Stream;

/// What becomes of light along a piece of its way.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Crossing {
    /// It comes through.
    Through,
    /// It is scattered after so many metres.
    Scattered(f32),
}

/// What is asked for of light in a medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asked {
    /// Where it is scattered.
    Path,
    /// What is left of it where none is scattered.
    Straight,
}

/// Where a path goes on.
pub(crate) enum Arrival {
    /// At a surface.
    Surface(dioptric_world::Hit),
    /// In a medium, at the beginning of this ray.
    Medium(MediumId, Ray),
    /// Beyond everything.
    Sky,
    /// Nowhere.
    Lost,
}

/// Surfaces without matter that a ray passes one after another.
const MOST_BOUNDARIES: u32 = 1 << 16;
/// Steps through a grid, of which few end where something in it is denser than light could ever cross: it is lost there.
const MOST_STEPS: u32 = 1 << 20;

/// Follows a ray through media to what scatters it next; `glow` is what shines on the way.
pub(crate) fn fly<const N: usize>(
    world: &World,
    (mut ray, medium): (Ray, &mut Option<MediumId>),
    throughput: &mut [f32; N],
    glow: &mut [f32; N],
    wavelengths_nm: &[f32; N],
    random: &mut Stream,
) -> Arrival {
    for _ in 0..MOST_BOUNDARIES {
        // In an even medium what lies behind the next scattering needn't be looked for.
        let filled = medium.map(|id| (id, Local::of(world.medium(id), wavelengths_nm)));
        let drawn = filled.as_ref().and_then(|(_, local)| local.distance_m(throughput, random));
        let met = world.meet(&ray, drawn.unwrap_or(f32::INFINITY));
        let length_m = met.as_ref().map_or(f32::INFINITY, |met| met.hit.distance_m);
        if let Some((id, local)) = &filled {
            let crossing = match drawn {
                Some(drawn_m) => local.cross_even(length_m, drawn_m, throughput, glow),
                None => local.cross(&ray, length_m, Asked::Path, throughput, glow, random),
            };
            if let Crossing::Scattered(distance_m) = crossing {
                return Arrival::Medium(*id, Ray { origin: ray.origin + distance_m * ray.direction, ..ray });
            }
            if throughput.iter().all(|&share| share <= 0.0) {
                return Arrival::Lost;
            }
        }
        match met {
            None => return Arrival::Sky,
            Some(Met { hit, is_surface: true }) => return Arrival::Surface(hit),
            Some(Met { hit, is_surface: false }) => {
                *medium = world.medium_towards(&hit, ray.direction, *medium);
                ray = hit.ray_towards(ray.direction);
            }
        }
    }
    Arrival::Lost
}

/// Returns what is left of light, weighed by wavelength, on a straight way of this length; none where a surface stands before it.
///
/// As of [`World::is_occluded`] the last 1e-4 of the length is free of surfaces.
pub(crate) fn left_on_the_way<const N: usize>(
    world: &World,
    (mut ray, mut medium): (Ray, Option<MediumId>),
    length_m: f32,
    mut light: [f32; N],
    wavelengths_nm: &[f32; N],
    random: &mut Stream,
) -> Option<[f32; N]> {
    let (mut rest_m, mut no_glow) = (length_m, [0.0; N]);
    for _ in 0..MOST_BOUNDARIES {
        let met = world.meet(&ray, rest_m * (1.0 - 1e-4));
        if met.is_some_and(|met| met.is_surface) {
            return None;
        }
        let piece_m = met.as_ref().map_or(rest_m, |met| met.hit.distance_m);
        if let Some(id) = medium {
            let local = Local::of(world.medium(id), wavelengths_nm);
            local.cross(&ray, piece_m, Asked::Straight, &mut light, &mut no_glow, random);
            if light.iter().all(|&share| share <= 0.0) {
                return None;
            }
        }
        let Some(Met { hit, .. }) = met else { return Some(light) };
        medium = world.medium_towards(&hit, ray.direction, medium);
        ray = hit.ray_towards(ray.direction);
        rest_m -= piece_m;
    }
    None
}

/// A medium at the wavelengths of a packet.
struct Local<'a, const N: usize> {
    medium: &'a Medium,
    wavelengths_nm: &'a [f32; N],
    /// The bound of its extinction where that of its density is 1, 1/m.
    at_most: [f32; N],
    /// What an even one does.
    even: Option<Coefficients<N>>,
}

/// Returns what is left over a length.
fn left<const N: usize>(per_m: &[f32; N], length_m: f32) -> [f32; N] {
    // Nothing is taken by nothing, however long the way.
    lanes(|i| if per_m[i] > 0.0 { (-per_m[i] * length_m).exp() } else { 1.0 })
}

/// Multiplies each by its density over the mean of all by their shares, which are those of `light`; returns that mean.
fn weigh<const N: usize>(light: &mut [f32; N], density: &[f32; N], drawn_by: &[f32; N]) {
    let (mut total, mut mean) = (0.0, 0.0);
    for i in 0..N {
        total += light[i];
        mean += light[i] * drawn_by[i];
    }
    let scale = if mean > 0.0 { total / mean } else { 0.0 };
    *light = lanes(|i| light[i] * density[i] * scale);
}

impl<'a, const N: usize> Local<'a, N> {
    fn of(medium: &'a Medium, wavelengths_nm: &'a [f32; N]) -> Self {
        let even = medium.is_even().then(|| medium.at(dioptric_world::glam::Vec3::ZERO, wavelengths_nm));
        let at_most = match &even {
            Some(even) => lanes(|i| even.absorption[i] + even.scattering[i]),
            None => medium.at_most(wavelengths_nm),
        };
        Self { medium, wavelengths_nm, at_most, even }
    }

    /// Draws where light may be scattered in an even medium that scatters.
    fn distance_m(&self, light: &[f32; N], random: &mut Stream) -> Option<f32> {
        let even = self.even.as_ref()?;
        even.scattering.iter().any(|&s| s > 0.0).then(|| self.step_m(1.0, light, random))
    }

    /// Draws a distance by the wavelength that carries most, or another by what it carries.
    fn step_m(&self, density: f32, light: &[f32; N], random: &mut Stream) -> f32 {
        let mut rest = random.next() * light.iter().sum::<f32>();
        let mut chosen = N - 1;
        for (lane, share) in light.iter().enumerate() {
            if rest < *share {
                chosen = lane;
                break;
            }
            rest -= share;
        }
        let per_m = density * self.at_most[chosen];
        if per_m > 0.0 { -(1.0 - random.next()).ln() / per_m } else { f32::INFINITY }
    }

    /// Crosses an even medium that scatters after this distance, or comes through.
    fn cross_even(&self, length_m: f32, drawn_m: f32, light: &mut [f32; N], glow: &mut [f32; N]) -> Crossing {
        let Some(even) = &self.even else { return Crossing::Through };
        if drawn_m >= length_m {
            let left = left(&self.at_most, length_m);
            weigh(light, &left, &left);
            return Crossing::Through;
        }
        let left = left(&self.at_most, drawn_m);
        let drawn_by = lanes(|i| left[i] * self.at_most[i]);
        self.shine(even, (&left, &drawn_by), light, glow);
        weigh(light, &lanes(|i| left[i] * even.scattering[i]), &drawn_by);
        Crossing::Scattered(drawn_m)
    }

    /// Adds what glows at a point that was drawn by these densities.
    fn shine(
        &self,
        local: &Coefficients<N>,
        (left, drawn_by): (&[f32; N], &[f32; N]),
        light: &[f32; N],
        glow: &mut [f32; N],
    ) {
        if self.medium.glow.is_some() {
            let mut shining = *light;
            weigh(&mut shining, &lanes(|i| left[i] * local.absorption[i] * local.glow[i]), drawn_by);
            *glow = lanes(|i| glow[i] + shining[i]);
        }
    }

    /// Crosses any medium up to a length.
    fn cross(
        &self,
        ray: &Ray,
        length_m: f32,
        asked: Asked,
        light: &mut [f32; N],
        glow: &mut [f32; N],
        random: &mut Stream,
    ) -> Crossing {
        if let Some(even) = &self.even {
            // Nothing is scattered back into the way: what is left has a closed form, and what shines on it too.
            let left = left(&self.at_most, length_m);
            if asked == Asked::Path {
                *glow = lanes(|i| glow[i] + light[i] * (1.0 - left[i]) * even.glow[i]);
            }
            *light = lanes(|i| light[i] * left[i]);
            return Crossing::Through;
        }
        let mut n_steps = 0;
        for piece in self.medium.pieces(ray, length_m) {
            let at_most: [f32; N] = self.at_most.map(|per_m| piece.density * per_m);
            let mut at_m = piece.from_m;
            loop {
                let step_m = self.step_m(piece.density, light, random);
                if at_m + step_m >= piece.to_m {
                    let left = left(&at_most, piece.to_m - at_m);
                    weigh(light, &left, &left);
                    break;
                }
                at_m += step_m;
                n_steps += 1;
                if n_steps > MOST_STEPS {
                    *light = [0.0; N];
                    return Crossing::Through;
                }
                let left = left(&at_most, step_m);
                let local = self.medium.at(ray.origin + at_m * ray.direction, self.wavelengths_nm);
                let taken: [f32; N] = lanes(|i| left[i] * (local.absorption[i] + local.scattering[i]).min(at_most[i]));
                let drawn_by: [f32; N] = lanes(|i| left[i] * at_most[i]);
                let spared: [f32; N] = lanes(|i| drawn_by[i] - taken[i]);
                if asked == Asked::Path {
                    self.shine(&local, (&left, &drawn_by), light, glow);
                }
                if asked == Asked::Straight || local.scattering.iter().all(|&s| s <= 0.0) {
                    weigh(light, &spared, &drawn_by);
                } else {
                    let sum = |of: &[f32; N]| (0..N).map(|i| light[i] * of[i]).sum::<f32>();
                    if random.next() * sum(&drawn_by) < sum(&taken) {
                        weigh(light, &lanes(|i| left[i] * local.scattering[i]), &taken);
                        return Crossing::Scattered(at_m);
                    }
                    weigh(light, &spared, &spared);
                }
                if light.iter().all(|&share| share <= 0.0) {
                    return Crossing::Through;
                }
            }
        }
        Crossing::Through
    }
}
