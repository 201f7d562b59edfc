//! Exact tracing of ray batches: tiles of rays, surface by surface.
//!
//! The tile is plain Rust over arrays of lanes, compiled once for the base instruction set and once for AVX2, chosen
//! at run time. Neither uses fused multiply-add, and square roots and divisions are correctly rounded, so every
//! machine gives the same bits. Lanes whose ray has ended go on computing numbers that nobody reads.

mod asphere;
mod crossing;
mod placed;
mod toric;
#[cfg(test)]
mod twin;

use multiversion::multiversion;

use self::{
    asphere::{Asphere, Powers},
    crossing::{Crossing, Ray, cross_conic, cross_plane, cross_sphere, refract, thin_lens},
};
pub(crate) use self::{
    placed::{move_to_placed_conic, move_to_placed_plane, placed_clearances, trace_placed},
    toric::Toric,
};
use crate::{RayFate, rays::RaySlices};

/// Whether rims end rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rims {
    /// A ray that meets a surface outside its rim ends there.
    Clip,
    /// Surfaces reach as far as their shape does.
    Ignore,
}

/// A surface with its indices resolved: what the kernel needs of it.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) kind: Kind,
    pub(crate) curvature: f64,
    pub(crate) index_before: f64,
    pub(crate) index_after: f64,
    pub(crate) vertex_z: f64,
    pub(crate) semi_aperture: f64,
}

/// The shapes as the kernel tells them apart.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    /// A plane between equal media: nothing bends.
    Window,
    Sphere,
    Conic {
        conic: f64,
    },
    /// The coefficient of r², then those of r⁴ and on.
    EvenAsphere {
        conic: f64,
        a2: f64,
        coefficients: Vec<f64>,
    },
    /// Coefficients of r and on.
    OddAsphere {
        conic: f64,
        coefficients: Vec<f64>,
    },
    ThinLens {
        power: f64,
        object_z: f64,
    },
    /// Curved differently along x and y.
    Toric(Toric),
}

/// Rays in a tile: enough for two vectors of the widest kind in use, so that one can wait while the other computes.
const LANES: usize = 8;

type Lanes = [f64; LANES];

/// Some rays; z is from the vertex of the surface at hand.
struct Tile {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    l: Lanes,
    m: Lanes,
    n: Lanes,
    opl: Lanes,
    /// All ones while the ray is in flight, else 0.
    alive: [u64; LANES],
}

/// Traces rays given in the lens frame through these steps; `first` is the number of the first of them.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn trace_batch(steps: &[Step], first: usize, rims: Rims, mut rays: RaySlices<'_>) {
    trace_tiles(steps, first, rims, &mut rays, |_, _, _| {});
}

/// Moves every ray in flight along its line to the plane at `z` in a medium of this index.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn move_to_plane(rays: RaySlices<'_>, plane_z: f64, index: f64) {
    let RaySlices { x, y, z, l, m, n, opl, fate } = rays;
    let count = fate.len();
    let (x, y, z, opl) = (&mut x[..count], &mut y[..count], &mut z[..count], &mut opl[..count]);
    let (l, m, n) = (&l[..count], &m[..count], &n[..count]);
    for i in 0..count {
        let t = (plane_z - z[i]) / n[i];
        let is_alive = fate[i].is_in_flight();
        x[i] = if is_alive { x[i] + l[i] * t } else { x[i] };
        y[i] = if is_alive { y[i] + m[i] * t } else { y[i] };
        z[i] = if is_alive { plane_z } else { z[i] };
        opl[i] = if is_alive { opl[i] + index * t } else { opl[i] };
    }
}

/// Traces rays without rims, and keeps for each the least over all surfaces of semi-aperture less distance from the
/// axis; −∞ for a ray that does not get through.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn trace_clearances(steps: &[Step], mut rays: RaySlices<'_>, clearances: &mut [f64]) {
    let note = |step: &Step, tile: &Tile, start: usize| {
        for i in 0..LANES.min(clearances.len() - start) {
            let here = step.semi_aperture - (tile.x[i] * tile.x[i] + tile.y[i] * tile.y[i]).sqrt();
            let here = if tile.alive[i] == 0 { f64::NEG_INFINITY } else { here };
            clearances[start + i] = if here < clearances[start + i] { here } else { clearances[start + i] };
        }
    };
    trace_tiles(steps, 0, Rims::Ignore, &mut rays, note);
}

#[inline(always)]
fn trace_tiles(
    steps: &[Step],
    first: usize,
    rims: Rims,
    rays: &mut RaySlices<'_>,
    mut note: impl FnMut(&Step, &Tile, usize),
) {
    let (Some(begin), Some(end)) = (steps.first(), steps.last()) else { return };
    for start in (0..rays.fate.len()).step_by(LANES) {
        let mut tile = load(rays, start);
        for z in &mut tile.z {
            *z -= begin.vertex_z;
        }
        if first == 0 {
            approach(begin.index_before, &mut tile);
        }
        let mut previous_z = begin.vertex_z;
        for (i, step) in steps.iter().enumerate() {
            let shift = step.vertex_z - previous_z;
            previous_z = step.vertex_z;
            for z in &mut tile.z {
                *z -= shift;
            }
            let limit_mm2 = match rims {
                Rims::Clip => step.semi_aperture * step.semi_aperture,
                Rims::Ignore => f64::MAX,
            };
            let mut at = At { step, surface: (first + i) as u16, limit_mm2, rays: &mut *rays, start };
            pass(&mut at, &mut tile);
            note(step, &tile, start);
        }
        store(&tile, end.vertex_z, rays, start);
    }
}

#[inline(always)]
fn load(rays: &RaySlices<'_>, start: usize) -> Tile {
    let n = LANES.min(rays.fate.len() - start);
    // Lanes without a ray hold one that has ended.
    let mut alive = [0; LANES];
    for (alive, fate) in alive.iter_mut().zip(&rays.fate[start..start + n]) {
        *alive = if fate.is_in_flight() { u64::MAX } else { 0 };
    }
    let take = |list: &[f64], rest: f64| {
        let mut lanes = [rest; LANES];
        lanes[..n].copy_from_slice(&list[start..start + n]);
        lanes
    };
    Tile {
        x: take(rays.x, 0.0),
        y: take(rays.y, 0.0),
        z: take(rays.z, 0.0),
        l: take(rays.l, 0.0),
        m: take(rays.m, 0.0),
        n: take(rays.n, 1.0),
        opl: take(rays.opl, 0.0),
        alive,
    }
}

/// Writes the rays that are still in flight; the others have been written where they ended.
#[inline(always)]
fn store(tile: &Tile, vertex_z: f64, rays: &mut RaySlices<'_>, start: usize) {
    let n = LANES.min(rays.fate.len() - start);
    if n == LANES && tile.alive.iter().fold(u64::MAX, |all, alive| all & alive) == u64::MAX {
        let put = |list: &mut [f64], lanes: &Lanes| list[start..start + LANES].copy_from_slice(lanes);
        put(rays.x, &tile.x);
        put(rays.y, &tile.y);
        put(rays.z, &tile.z.map(|z| z + vertex_z));
        put(rays.l, &tile.l);
        put(rays.m, &tile.m);
        put(rays.n, &tile.n);
        put(rays.opl, &tile.opl);
        return;
    }
    for i in (0..n).filter(|&i| tile.alive[i] != 0) {
        rays.put(start + i, &tile.ray(i), vertex_z);
    }
}

/// Moves each ray to where it passes nearest to the first vertex, so that far starts cost no digits at the surface.
#[inline(always)]
fn approach(index: f64, tile: &mut Tile) {
    for i in 0..LANES {
        let t = -(tile.x[i] * tile.l[i] + tile.y[i] * tile.m[i] + tile.z[i] * tile.n[i]);
        tile.x[i] += tile.l[i] * t;
        tile.y[i] += tile.m[i] * t;
        tile.z[i] += tile.n[i] * t;
        tile.opl[i] += index * t;
    }
}

impl Tile {
    #[inline(always)]
    fn ray(&self, i: usize) -> Ray {
        Ray { x: self.x[i], y: self.y[i], z: self.z[i], l: self.l[i], m: self.m[i], n: self.n[i], opl: self.opl[i] }
    }
}

impl Tile {
    #[inline(always)]
    fn cross(&self, asphere: Asphere<'_>) -> [Crossing; LANES] {
        asphere.cross(std::array::from_fn(|i| self.ray(i)), self.alive.map(|alive| alive != 0))
    }
}

impl RaySlices<'_> {
    #[inline(always)]
    fn put(&mut self, i: usize, ray: &Ray, vertex_z: f64) {
        (self.x[i], self.y[i], self.z[i]) = (ray.x, ray.y, ray.z + vertex_z);
        (self.l[i], self.m[i], self.n[i]) = (ray.l, ray.m, ray.n);
        self.opl[i] = ray.opl;
    }
}

/// A surface that a tile is at, and where the tile's rays are written when they end there.
struct At<'a, 'b> {
    step: &'a Step,
    surface: u16,
    limit_mm2: f64,
    rays: &'a mut RaySlices<'b>,
    start: usize,
}

/// Takes a tile through one surface.
#[inline(always)]
fn pass(at: &mut At<'_, '_>, tile: &mut Tile) {
    let (step, limit_mm2) = (at.step, at.limit_mm2);
    let c = step.curvature;
    let refracting = Refracting::new(step, limit_mm2);
    match &step.kind {
        Kind::Window => pass_lanes(at, tile, |_, ray| cross_plane(step.index_before, limit_mm2, ray)),
        Kind::Sphere => pass_lanes(at, tile, |_, ray| refract(&refracting, ray, cross_sphere(c, ray))),
        Kind::Conic { conic } => pass_lanes(at, tile, |_, ray| refract(&refracting, ray, cross_conic(c, *conic, ray))),
        Kind::EvenAsphere { conic, a2, coefficients } => {
            let powers = Powers::Even { a2: *a2, rest: coefficients };
            let crossings = tile.cross(Asphere { curvature: c, conic: *conic, powers });
            pass_lanes(at, tile, |i, ray| refract(&refracting, ray, crossings[i]));
        }
        Kind::OddAsphere { conic, coefficients } => {
            let crossings = tile.cross(Asphere { curvature: c, conic: *conic, powers: Powers::All(coefficients) });
            pass_lanes(at, tile, |i, ray| refract(&refracting, ray, crossings[i]));
        }
        Kind::ThinLens { power, object_z } => {
            pass_lanes(at, tile, |_, ray| thin_lens(step, *power, *object_z, limit_mm2, ray));
        }
        Kind::Toric(toric) => pass_lanes(at, tile, |_, ray| refract(&refracting, ray, toric.cross(ray))),
    }
}

/// What refraction needs of a surface.
pub(crate) struct Refracting {
    ratio: f64,
    ratio2: f64,
    index_before: f64,
    limit_mm2: f64,
}

impl Refracting {
    #[inline(always)]
    fn new(step: &Step, limit_mm2: f64) -> Self {
        let ratio = step.index_before / step.index_after;
        Self { ratio, ratio2: ratio * ratio, index_before: step.index_before, limit_mm2 }
    }
}

/// What becomes of a ray at a surface.
#[derive(Clone, Copy)]
struct Passed {
    /// The ray on the surface, turned.
    ray: Ray,
    /// Whether it goes on; if not, the rest says why.
    goes_on: bool,
    /// Whether it met the surface at all.
    is_hit: bool,
    /// Whether it met it inside the rim.
    is_within: bool,
}

#[inline(always)]
fn pass_lanes(at: &mut At<'_, '_>, tile: &mut Tile, pass_one: impl Fn(usize, Ray) -> Passed) {
    let mut next = [[0.0; LANES]; 7];
    let mut ended = [0_u64; LANES];
    for i in 0..LANES {
        let Passed { ray, goes_on, .. } = pass_one(i, tile.ray(i));
        next[0][i] = ray.x;
        next[1][i] = ray.y;
        next[2][i] = ray.z;
        next[3][i] = ray.l;
        next[4][i] = ray.m;
        next[5][i] = ray.n;
        next[6][i] = ray.opl;
        ended[i] = if goes_on { 0 } else { tile.alive[i] };
    }
    if ended.iter().fold(0, |any, ended| any | ended) != 0 {
        for i in (0..LANES).filter(|&i| ended[i] != 0) {
            let before = tile.ray(i);
            end_ray(at, i, before, pass_one(i, before));
            tile.alive[i] = 0;
        }
    }
    [tile.x, tile.y, tile.z, tile.l, tile.m, tile.n, tile.opl] = next;
}

/// Writes a ray where it ended, with the direction in which it came.
#[inline(never)]
fn end_ray(at: &mut At<'_, '_>, lane: usize, before: Ray, passed: Passed) {
    let surface = at.surface;
    let (fate, ray) = fate_of(surface, before, passed);
    at.rays.put(at.start + lane, &ray, at.step.vertex_z);
    at.rays.fate[at.start + lane] = fate;
}

fn fate_of(surface: u16, before: Ray, passed: Passed) -> (RayFate, Ray) {
    let Ray { l, m, n, .. } = before;
    let there = Ray { l, m, n, ..passed.ray };
    match (passed.is_hit, passed.is_within) {
        (false, _) => (RayFate::Missed { surface }, before),
        (true, false) => (RayFate::Vignetted { surface }, there),
        (true, true) => (RayFate::TotalReflection { surface }, there),
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::{Glass, Interface, Lens, MonoLens, ObjectPoint, RayBatch, Shape, Surface, rays_towards};

    /// Rays that fill the front of a lens, and more: some pass, some are vignetted, some miss.
    fn bundle(lens: &MonoLens, field_tan: f64, n_rays: usize) -> RayBatch {
        let point = ObjectPoint::from_field(lens, DVec2::new(field_tan, 0.3 * field_tan), 0.5);
        let radius_mm = 1.2 * lens.semi_aperture_mm(0);
        let place = |i: usize| radius_mm * (i as f64 / n_rays as f64).sqrt() * DVec2::from_angle(2.4 * i as f64);
        let targets: Vec<DVec2> = (0..n_rays).map(place).collect();
        rays_towards(&point, &targets, lens.first_order().entrance_pupil_z_mm, 0.0)
    }

    #[track_caller]
    fn assert_same_bits(a: &RayBatch, b: &RayBatch) {
        assert_eq!(a.fate, b.fate);
        let bits = |r: &RayBatch| {
            let lists = [&r.x_mm, &r.y_mm, &r.z_mm, &r.l, &r.m, &r.n, &r.opl_mm];
            lists.map(|list| list.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
        };
        assert_eq!(bits(a), bits(b));
    }

    #[test]
    fn tile_and_scalar_twin_agree_to_the_bit() {
        for name in ["dgauss-50mm", "paper-2el", "fisheye-12.5mm", "asphere-15mm", "singlet-50mm"] {
            let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
            for rims in [Rims::Clip, Rims::Ignore] {
                for (field_tan, n_rays) in [(0.0, 501), (0.3, 1003), (3.0, 777)] {
                    let rays = bundle(&lens, field_tan, n_rays);
                    let (mut tiled, mut single) = (rays.clone(), rays.clone());
                    lens.trace(&mut tiled, rims);
                    twin::trace_one_by_one(&lens.steps_for(rays.object_z_mm), rims, &mut single);
                    assert_same_bits(&tiled, &single);
                }
            }
        }
        let odd = Surface {
            shape: Shape::OddAsphere { conic: -0.5, coefficients: vec![1e-3, 2e-3, -1e-4, 1e-6] },
            ..Surface::sphere(20.0, 9.0)
        };
        let medium_after = Glass::Constant { index: 1.6 };
        let odd = Lens::new("odd", "test", vec![Interface { surface: odd, medium_after, thickness_after_mm: 0.0 }], 0);
        for lens in [Lens::thin(50.0, 10.0).unwrap(), odd.unwrap()] {
            let lens = lens.at(550.0).unwrap();
            let rays = bundle(&lens, 0.2, 99);
            let (mut tiled, mut single) = (rays.clone(), rays.clone());
            lens.trace(&mut tiled, Rims::Clip);
            twin::trace_one_by_one(&lens.steps_for(rays.object_z_mm), Rims::Clip, &mut single);
            assert_same_bits(&tiled, &single);
        }
    }

    #[test]
    fn pieces_and_threads_change_no_bit() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(500.0).unwrap();
        let rays = bundle(&lens, 0.2, 10_001);
        let (mut whole, mut shared) = (rays.clone(), rays.clone());
        lens.trace(&mut whole, Rims::Clip);
        lens.trace_parallel(&mut shared, Rims::Clip);
        assert_same_bits(&whole, &shared);
        let losses = whole.losses();
        assert!(losses.n_in_flight > 1000 && losses.by_surface.iter().filter(|s| s.n_vignetted > 0).count() > 3);

        // A trace in pieces passes the lens frame between them, which rounds z.
        let mut pieces = rays;
        lens.trace_surfaces(0..lens.stop() + 1, &mut pieces, Rims::Clip);
        lens.trace_surfaces(lens.stop() + 1..lens.n_surfaces(), &mut pieces, Rims::Clip);
        assert_eq!(whole.fate, pieces.fate);
        let apart = whole.x_mm.iter().zip(&pieces.x_mm).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-13, "{apart}");
    }

    #[test]
    fn rays_end_where_and_as_they_should() {
        let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
        let at = |y: f64, direction: DVec3| {
            let mut rays = RayBatch::from_points(&[DVec3::new(0.0, y, -5.0)], &[direction.normalize()]);
            lens.trace(&mut rays, Rims::Clip);
            (rays.fate[0], rays.point_mm(0))
        };
        assert_eq!(at(12.4, DVec3::Z).0, RayFate::InFlight);
        let (fate, point) = at(12.6, DVec3::Z);
        assert_eq!(fate, RayFate::Vignetted { surface: 0 });
        assert!((point.z - (67.0 - (67.0_f64.powi(2) - 12.6_f64.powi(2)).sqrt())).abs() < 1e-12, "{point}");
        let (fate, point) = at(80.0, DVec3::Z);
        assert_eq!((fate, point), (RayFate::Missed { surface: 0 }, DVec3::new(0.0, 80.0, 0.0)));

        // Light inside a glass ball beyond the critical angle, 37.3 degrees.
        let ball =
            Interface { surface: Surface::sphere(-10.0, 9.99), medium_after: Glass::Air, thickness_after_mm: 0.0 };
        let window = Interface {
            surface: Surface::plane(9.0),
            medium_after: Glass::Constant { index: 1.65 },
            thickness_after_mm: 10.0,
        };
        let dome = Lens::new("dome", "test", vec![window, ball], 0).unwrap().at(550.0).unwrap();
        let end = |y: f64| {
            let mut rays = RayBatch::from_points(&[DVec3::new(0.0, y, -1.0)], &[DVec3::Z]);
            dome.trace(&mut rays, Rims::Clip);
            rays.fate[0]
        };
        assert_eq!(end(10.0 * (1.0 / 1.65) - 1e-9), RayFate::InFlight);
        assert_eq!(end(10.0 * (1.0 / 1.65) + 1e-9), RayFate::TotalReflection { surface: 1 });
    }
}
