//! What a ray of the camera shows: the surface whose light is gathered, and what glows or is mirrored on the way to it.

use dioptric_spectrum::lanes;
use dioptric_world::{
    Hit, Ray,
    glam::{DVec3, Vec3},
};

use super::{
    light::{Gatherer, LightRays, LitSurface},
    smooth::Guide,
};

/// What is seen along a ray.
#[derive(Clone, Debug)]
pub(super) struct Look<const N: usize> {
    /// What is met first; none in the sky.
    pub(super) first: Option<First>,
    pub(super) guide: Guide,
    /// What is scattered evenly of light on the surface, by way of the mirrors before it.
    pub(super) reflectance: [f32; N],
    /// What glows, seen directly or by mirrors: of few looks anything.
    pub(super) own: Option<Box<[f32; N]>>,
    /// Where light is to be gathered; taken from corners once it has been.
    pub(super) surface: Option<Box<LitSurface<N>>>,
    /// Whether there is a surface that light falls on, and whether it has gloss or mirrors.
    pub(super) is_lit: bool,
    pub(super) has_gloss: bool,
    /// The row and the column that it was looked at, in pixels.
    pub(super) seen_at: (f64, f64),
}

/// The first surface on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct First {
    pub(super) key: u64,
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
}

/// The most mirrors and panes one behind another.
const MOST_MIRRORS: usize = 12;
/// What is mirrored of light less than this is not looked for.
const LEAST_MIRRORED: f32 = 1e-3;
/// What is mirrored less than this is lit by few rays: its noise is as weak.
const WEAK: f32 = 0.15;
/// How many mirrors deep what is mirrored besides is looked for.
const DEEP: usize = 3;

fn mean<const N: usize>(values: &[f32; N]) -> f32 {
    values.iter().sum::<f32>() / N as f32
}

fn key_of(before: u64, hit: &Hit) -> u64 {
    let instance = hit.instance.map_or(0, |instance| u64::from(instance.0) + 1);
    let own = u64::from(hit.shape.0) | instance << 32;
    (before.rotate_left(17) ^ own).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ own
}

impl<const N: usize> Gatherer<'_, N> {
    /// Looks along a ray. Details of patterns smaller than `pitch`, a tangent, are blurred away.
    pub(super) fn look(&self, ray: Ray, pitch: f32) -> Look<N> {
        let mut look = Look::nothing();
        let (mut ray, mut gone_m, mut key, mut mirrored) = (ray, 0.0, 0, Vec::new());
        // What is left of light on its way over the mirrors before the surface.
        let mut through = [1.0; N];
        for _ in 0..MOST_MIRRORS {
            let Some(mut hit) = self.world.intersect(&ray, f32::INFINITY) else {
                look.add(&through, &self.world.sky(ray.direction, self.wavelengths_nm));
                return look;
            };
            gone_m += hit.distance_m;
            key = key_of(key, &hit);
            hit.footprint_m = footprint_m(&hit, ray.direction, pitch * gone_m);
            if look.first.is_none() {
                look.first = Some(First { key, point: hit.point, normal: hit.geometric_normal });
            }
            look.add(&through, &self.world.emission(&hit, -ray.direction, self.wavelengths_nm));
            let bsdf = self.world.bsdf(&hit, -ray.direction, self.wavelengths_nm);
            let mut mirrors = bsdf.mirrors();
            let reflectance = bsdf.diffuse_reflectance();
            let gloss = bsdf.gloss();
            let is_diffuse = reflectance.iter().any(|&r| r > 0.0);
            // Of nothing but mirrors the brightest is what is shown.
            let goes_on = !is_diffuse && gloss.is_none();
            let brightest = (0..mirrors.len()).max_by(|&a, &b| mean(&mirrors[a].1).total_cmp(&mean(&mirrors[b].1)));
            let next = brightest.filter(|_| goes_on).map(|index| mirrors.swap_remove(index));
            for (direction, value) in mirrors {
                let value: [f32; N] = lanes(|lane| value[lane] * through[lane]);
                if mean(&value) > LEAST_MIRRORED {
                    let ray = hit.ray_towards(direction);
                    look.add(&value, &self.glow(ray, DEEP));
                    mirrored.push((ray, value));
                }
            }
            let normal = seen_side(&hit, bsdf.normal(), ray.direction);
            let width_m = pitch * gone_m / normal.dot(ray.direction).abs().max(0.05);
            let Some((direction, value)) = next else {
                look.guide = Guide { key, point: hit.point, normal, width_m };
                if !goes_on || !mirrored.is_empty() {
                    (0..N).for_each(|lane| look.reflectance[lane] = reflectance[lane] * through[lane]);
                    let surface = LitSurface { hit, bsdf, normal, gloss, is_diffuse, mirrored, through };
                    (look.is_lit, look.has_gloss) = (true, surface.has_gloss());
                    look.surface = Some(Box::new(surface));
                }
                return look;
            };
            (0..N).for_each(|lane| through[lane] *= value[lane]);
            if mean(&through) < LEAST_MIRRORED {
                look.guide = Guide { key, point: hit.point, normal, width_m };
                return look;
            }
            ray = hit.ray_towards(direction);
        }
        look
    }

    /// Returns what glows along a ray that a mirror sends on, by more mirrors too.
    fn glow(&self, ray: Ray, deep: usize) -> [f32; N] {
        let Some(hit) = self.world.intersect(&ray, f32::INFINITY) else {
            return self.world.sky(ray.direction, self.wavelengths_nm);
        };
        let mut sum = self.world.emission(&hit, -ray.direction, self.wavelengths_nm);
        if deep > 0 {
            for (direction, value) in self.mirrors_of(&hit, -ray.direction) {
                let seen = self.glow(hit.ray_towards(direction), deep - 1);
                (0..N).for_each(|lane| sum[lane] += value[lane] * seen[lane]);
            }
        }
        sum
    }

    /// Returns what is mirrored to the eye besides what glows: light that falls on what the mirrors show, gathered by few rays, and
    /// what gloss sends out.
    pub(super) fn sent_on(
        &self,
        surface: &LitSurface<N>,
        gloss: &[f32; N],
        at: (usize, usize),
        rays: LightRays,
    ) -> [f32; N] {
        let mut sum: [f32; N] = lanes(|lane| surface.through[lane] * gloss[lane]);
        for (ray, value) in &surface.mirrored {
            let rays = if mean(value) < WEAK { LightRays::FEW } else { rays };
            let seen = self.lit_along(*ray, at, (rays, DEEP));
            (0..N).for_each(|lane| sum[lane] += value[lane] * seen[lane]);
        }
        sum
    }

    /// Returns the radiance along a ray without what glows.
    fn lit_along(&self, ray: Ray, at: (usize, usize), (rays, deep): (LightRays, usize)) -> [f32; N] {
        let Some(hit) = self.world.intersect(&ray, f32::INFINITY) else { return [0.0; N] };
        let bsdf = self.world.bsdf(&hit, -ray.direction, self.wavelengths_nm);
        let mut sum = [0.0; N];
        if deep > 0 {
            for (direction, value) in self.mirrors_of(&hit, -ray.direction) {
                let seen = self.lit_along(hit.ray_towards(direction), at, (rays, deep - 1));
                (0..N).for_each(|lane| sum[lane] += value[lane] * seen[lane]);
            }
        }
        let normal = seen_side(&hit, bsdf.normal(), ray.direction);
        let is_diffuse = bsdf.diffuse_reflectance().iter().any(|&r| r > 0.0);
        let (gloss, mirrored, through) = (bsdf.gloss(), Vec::new(), [1.0; N]);
        let surface = LitSurface { hit, bsdf, normal, gloss, is_diffuse, mirrored, through };
        let lit = self.lit_now(&surface, at, rays);
        lanes(|lane| sum[lane] + lit[lane])
    }

    /// Returns the mirrors of a surface that is seen in another: of glass and coats seen so, those that send on much alone.
    fn mirrors_of(&self, hit: &Hit, outgoing: Vec3) -> Vec<(Vec3, [f32; N])> {
        const LEAST: f32 = 0.1;
        if !self.world.may_mirror(hit) {
            return Vec::new();
        }
        let mut mirrors = self.world.bsdf(hit, outgoing, self.wavelengths_nm).mirrors();
        mirrors.retain(|(_, value)| mean(value) > LEAST);
        mirrors
    }
}

impl<const N: usize> Look<N> {
    /// Where nothing is met.
    pub(super) fn nothing() -> Self {
        Self {
            first: None,
            guide: Guide::NOTHING,
            reflectance: [0.0; N],
            own: None,
            surface: None,
            is_lit: false,
            has_gloss: false,
            seen_at: (0.0, 0.0),
        }
    }

    /// Adds what glows, of which a mirror sends so much on.
    fn add(&mut self, share: &[f32; N], radiance: &[f32; N]) {
        if radiance.iter().any(|&value| value != 0.0) {
            let own = self.own.get_or_insert_with(|| Box::new([0.0; N]));
            (0..N).for_each(|lane| own[lane] += share[lane] * radiance[lane]);
        }
    }

    /// Tells whether two looks differ by less than a step: in reflectance, and in what glows as a fraction of `bright`.
    pub(super) fn is_like(&self, other: &Self, step: f32, bright: f32) -> bool {
        const LEAST_COSINE: f32 = 0.97;
        let steps = |a: &[f32; N], b: &[f32; N], most: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() < most);
        let glows = || match (&self.own, &other.own) {
            (None, None) => true,
            (own, of_other) => {
                let [own, of_other] = [own, of_other].map(|own| own.as_deref().copied().unwrap_or([0.0; N]));
                steps(&own, &of_other, step * bright)
            }
        };
        self.guide.key == other.guide.key
            && self.guide.normal.dot(other.guide.normal) > LEAST_COSINE
            && steps(&self.reflectance, &other.reflectance, step)
            && glows()
    }
}

/// Returns the normal on the side of the surface that is seen along a direction: by the shape, since relief can turn away from the eye.
fn seen_side(hit: &Hit, normal: Vec3, along: Vec3) -> Vec3 {
    let outward = if normal.dot(hit.geometric_normal) < 0.0 { -normal } else { normal };
    if hit.geometric_normal.dot(along) > 0.0 { -outward } else { outward }
}

/// Returns the size of details that a pixel blurs away, m, where it is `width_m` wide.
fn footprint_m(hit: &Hit, direction: Vec3, width_m: f32) -> f32 {
    let cos = hit.geometric_normal.dot(direction).abs().max(0.12);
    // A part of the mean of the pixel's width and its length along the slope, since the looks of a pixel blur by its width again.
    0.42 * 0.5 * (width_m + width_m / cos)
}

/// Returns the depth of a point along an axis from a place, m.
pub(super) fn depth_m(point: Vec3, (from, axis): (DVec3, DVec3)) -> f64 {
    (point.as_dvec3() - from).dot(axis)
}
