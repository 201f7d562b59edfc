//! Exact tracing of ray batches: tiles of eight rays, surface by surface.
//!
//! The tile is plain Rust over arrays of eight lanes, compiled once for the base instruction set and once for AVX2,
//! chosen at run time. Neither uses fused multiply-add, and square roots and divisions are correctly rounded, so
//! every machine gives the same bits.

use multiversion::multiversion;

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
    EvenAsphere {
        conic: f64,
        coefficients: Vec<f64>,
    },
    ThinLens {
        power: f64,
        object_z: f64,
    },
}

/// Rays in a tile.
const LANES: usize = 8;
/// Newton steps after which a ray is held to miss an asphere.
const NEWTON_STEPS: usize = 30;

const IN_FLIGHT: u64 = 0;
const VIGNETTED: u64 = 1;
const MISSED: u64 = 2;
const REFLECTED: u64 = 3;

type Lanes = [f64; LANES];

/// Eight rays; z is from the vertex of the surface at hand.
struct Tile {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    l: Lanes,
    m: Lanes,
    n: Lanes,
    opl: Lanes,
    /// 0 in flight, else how the ray ended plus four times the surface.
    code: [u64; LANES],
}

/// Traces rays given in the lens frame through these steps; `first` is the number of the first of them.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(crate) fn trace_batch(steps: &[Step], first: usize, rims: Rims, mut rays: RaySlices<'_>) {
    trace_batch_here(steps, first, rims, &mut rays);
}

#[inline(always)]
fn trace_batch_here(steps: &[Step], first: usize, rims: Rims, rays: &mut RaySlices<'_>) {
    let (Some(begin), Some(end)) = (steps.first(), steps.last()) else { return };
    let n_rays = rays.fate.len();
    let mut start = 0;
    while start < n_rays {
        let n = LANES.min(n_rays - start);
        let mut tile = load(rays, start, n);
        for z in &mut tile.z {
            *z -= begin.vertex_z;
        }
        if first == 0 {
            approach_tile(begin.index_before, &mut tile);
        }
        let mut previous_z = begin.vertex_z;
        for (i, step) in steps.iter().enumerate() {
            let shift = step.vertex_z - previous_z;
            for z in &mut tile.z {
                *z -= shift;
            }
            previous_z = step.vertex_z;
            step_tile(step, (first + i) as u64, rims, &mut tile);
        }
        for z in &mut tile.z {
            *z += end.vertex_z;
        }
        store(&tile, rays, start, n);
        start += n;
    }
}

#[inline(always)]
fn load(rays: &RaySlices<'_>, start: usize, n: usize) -> Tile {
    // Lanes without a ray hold one that has ended.
    let mut code = [MISSED; LANES];
    for (code, fate) in code.iter_mut().zip(&rays.fate[start..start + n]) {
        *code = encode(*fate);
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
        code,
    }
}

#[inline(always)]
fn store(tile: &Tile, rays: &mut RaySlices<'_>, start: usize, n: usize) {
    let put = |list: &mut [f64], lanes: &Lanes| list[start..start + n].copy_from_slice(&lanes[..n]);
    put(rays.x, &tile.x);
    put(rays.y, &tile.y);
    put(rays.z, &tile.z);
    put(rays.l, &tile.l);
    put(rays.m, &tile.m);
    put(rays.n, &tile.n);
    put(rays.opl, &tile.opl);
    for (fate, code) in rays.fate[start..start + n].iter_mut().zip(tile.code) {
        *fate = decode(code);
    }
}

fn encode(fate: RayFate) -> u64 {
    match fate {
        RayFate::InFlight => IN_FLIGHT,
        RayFate::Vignetted { surface } => VIGNETTED + 4 * u64::from(surface),
        RayFate::Missed { surface } => MISSED + 4 * u64::from(surface),
        RayFate::TotalReflection { surface } => REFLECTED + 4 * u64::from(surface),
    }
}

fn decode(code: u64) -> RayFate {
    let surface = (code / 4) as u16;
    match code % 4 {
        IN_FLIGHT => RayFate::InFlight,
        VIGNETTED => RayFate::Vignetted { surface },
        MISSED => RayFate::Missed { surface },
        _ => RayFate::TotalReflection { surface },
    }
}

/// Moves each ray to where it passes nearest to the first vertex, so that far starts cost no digits at the surface.
#[inline(always)]
fn approach_tile(index: f64, tile: &mut Tile) {
    for i in 0..LANES {
        let is_alive = tile.code[i] == IN_FLIGHT;
        let t = -(tile.x[i] * tile.l[i] + tile.y[i] * tile.m[i] + tile.z[i] * tile.n[i]);
        let t = if is_alive { t } else { 0.0 };
        tile.x[i] += tile.l[i] * t;
        tile.y[i] += tile.m[i] * t;
        tile.z[i] += tile.n[i] * t;
        tile.opl[i] += index * t;
    }
}

/// What a ray does at a surface: how far it goes, the normal there and the cosine of incidence.
#[derive(Clone, Copy)]
struct Meeting {
    is_hit: bool,
    t: f64,
    /// Unit normal, pointing downstream.
    normal: [f64; 3],
    cos_incidence: f64,
}

#[inline(always)]
fn step_tile(step: &Step, surface: u64, rims: Rims, tile: &mut Tile) {
    let limit_mm2 = match rims {
        Rims::Clip => step.semi_aperture * step.semi_aperture,
        Rims::Ignore => f64::INFINITY,
    };
    match &step.kind {
        Kind::Window => window_tile(step, surface, limit_mm2, tile),
        Kind::Sphere => refract_tile(step, surface, limit_mm2, tile, |ray| meet_sphere(step.curvature, ray)),
        Kind::Conic { conic } => {
            refract_tile(step, surface, limit_mm2, tile, |ray| meet_conic(step.curvature, *conic, ray));
        }
        Kind::EvenAsphere { conic, coefficients } => {
            refract_tile(step, surface, limit_mm2, tile, |ray| {
                meet_even_asphere(step.curvature, *conic, coefficients, ray)
            });
        }
        Kind::ThinLens { power, object_z } => thin_lens_tile(step, *power, *object_z, surface, limit_mm2, tile),
    }
}

/// A ray's point, from the vertex, and its direction.
type Ray = [f64; 6];

/// Returns where a ray meets a sphere: the crossing at which it goes through the surface downstream.
///
/// Written in curvature, so that it stays accurate as the sphere flattens to a plane; the cosine of incidence
/// comes with it, and the normal is already of unit length.
#[inline(always)]
fn meet_sphere(c: f64, [x, y, z, l, m, n]: Ray) -> Meeting {
    let f = c * (x * x + y * y + z * z) - 2.0 * z;
    let g = n - c * (x * l + y * m + z * n);
    let square = g * g - c * f;
    let s = square.max(0.0).sqrt();
    // Both quotients are the same number; each is free of cancellation on its side.
    let is_ahead = g >= 0.0;
    let numerator = if is_ahead { f } else { g - s };
    let denominator = if is_ahead { g + s } else { c };
    let t = numerator / denominator;
    let (x1, y1, z1) = (x + l * t, y + m * t, z + n * t);
    let normal = [-c * x1, -c * y1, 1.0 - c * z1];
    // Beyond the equator the sphere is no longer the surface.
    let is_hit = (square >= 0.0) & (t.abs() < f64::INFINITY) & (normal[2] > 0.0);
    Meeting { is_hit, t, normal, cos_incidence: s }
}

#[inline(always)]
fn meet_conic(c: f64, conic: f64, [x, y, z, l, m, n]: Ray) -> Meeting {
    let k1 = 1.0 + conic;
    let a = c * (1.0 + conic * n * n);
    let f = c * (x * x + y * y + k1 * z * z) - 2.0 * z;
    let g = n - c * (x * l + y * m + k1 * z * n);
    let square = g * g - a * f;
    let s = square.max(0.0).sqrt();
    let is_ahead = g >= 0.0;
    let numerator = if is_ahead { f } else { g - s };
    let denominator = if is_ahead { g + s } else { a };
    let t = numerator / denominator;
    let (x1, y1, z1) = (x + l * t, y + m * t, z + n * t);
    let gradient = [-c * x1, -c * y1, 1.0 - c * k1 * z1];
    let length = (gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]).sqrt();
    let is_hit = (square >= 0.0) & (t.abs() < f64::INFINITY) & (gradient[2] > 0.0);
    let inverse = 1.0 / length;
    Meeting { is_hit, t, normal: gradient.map(|v| v * inverse), cos_incidence: s * inverse }
}

#[inline(always)]
fn meet_even_asphere(c: f64, conic: f64, coefficients: &[f64], ray: Ray) -> Meeting {
    let [x, y, z, l, m, n] = ray;
    let start = meet_conic(c, conic, ray);
    let mut t = if start.is_hit { start.t } else { -z / n };
    let k1 = 1.0 + conic;
    let mut is_hit = false;
    let (mut gx, mut gy) = (0.0, 0.0);
    let mut last_step = f64::INFINITY;
    for _ in 0..NEWTON_STEPS {
        let (x1, y1, z1) = (x + l * t, y + m * t, z + n * t);
        let r2 = x1 * x1 + y1 * y1;
        let root2 = 1.0 - k1 * c * c * r2;
        let root = root2.sqrt();
        let (mut high, mut slope) = (0.0, 0.0);
        for (i, a) in coefficients.iter().enumerate().rev() {
            high = high * r2 + a;
            slope = slope * r2 + a * (i + 2) as f64;
        }
        let sag = c * r2 / (1.0 + root) + high * r2 * r2;
        // d sag / d(r²), doubled: the slope along x is this times x.
        let along = c / root + 2.0 * slope * r2;
        (gx, gy) = (-along * x1, -along * y1);
        let step = (z1 - sag) / (l * gx + m * gy + n);
        t -= step;
        // Converged once a step no longer halves the one before and is down at rounding.
        let is_small = step.abs() <= 1e-13 * (1.0 + t.abs());
        if is_small && (step == 0.0 || step.abs() >= 0.5 * last_step) {
            is_hit = true;
            break;
        }
        is_hit = is_small;
        last_step = step.abs();
        if !step.is_finite() {
            break;
        }
    }
    let length = (gx * gx + gy * gy + 1.0).sqrt();
    let cos_incidence = (l * gx + m * gy + n) / length;
    is_hit &= (cos_incidence > 0.0) & t.is_finite();
    Meeting { is_hit, t, normal: [gx / length, gy / length, 1.0 / length], cos_incidence }
}

/// Moves each ray of a tile to the surface, and refracts it there.
#[inline(always)]
fn refract_tile(step: &Step, surface: u64, limit_mm2: f64, tile: &mut Tile, meet: impl Fn(Ray) -> Meeting) {
    let ratio = step.index_before / step.index_after;
    for i in 0..LANES {
        let (x, y, z) = (tile.x[i], tile.y[i], tile.z[i]);
        let (l, m, n) = (tile.l[i], tile.m[i], tile.n[i]);
        let is_alive = tile.code[i] == IN_FLIGHT;
        let Meeting { is_hit, t, normal, cos_incidence } = meet([x, y, z, l, m, n]);
        let (x1, y1, z1) = (x + l * t, y + m * t, z + n * t);
        let is_within = x1 * x1 + y1 * y1 <= limit_mm2;
        let cos2 = 1.0 - ratio * ratio * (1.0 - cos_incidence * cos_incidence);
        let is_refracted = cos2 >= 0.0;
        let bend = cos2.max(0.0).sqrt() - ratio * cos_incidence;

        let ended = if !is_hit {
            MISSED
        } else if !is_within {
            VIGNETTED
        } else {
            REFLECTED
        } + 4 * surface;
        let goes_on = is_hit & is_within & is_refracted;
        let moves = is_alive & is_hit;
        let turns = is_alive & goes_on;
        tile.code[i] = if is_alive & !goes_on { ended } else { tile.code[i] };
        tile.x[i] = if moves { x1 } else { x };
        tile.y[i] = if moves { y1 } else { y };
        tile.z[i] = if moves { z1 } else { z };
        tile.opl[i] = if moves { tile.opl[i] + step.index_before * t } else { tile.opl[i] };
        tile.l[i] = if turns { ratio * l + bend * normal[0] } else { l };
        tile.m[i] = if turns { ratio * m + bend * normal[1] } else { m };
        tile.n[i] = if turns { ratio * n + bend * normal[2] } else { n };
    }
}

/// Moves each ray of a tile to the vertex plane and clips it there.
#[inline(always)]
fn window_tile(step: &Step, surface: u64, limit_mm2: f64, tile: &mut Tile) {
    for i in 0..LANES {
        let t = -tile.z[i] / tile.n[i];
        let is_alive = tile.code[i] == IN_FLIGHT;
        let is_hit = (tile.n[i] > 0.0) & (t.abs() < f64::INFINITY);
        let moves = is_alive & is_hit;
        let (x1, y1) = (tile.x[i] + tile.l[i] * t, tile.y[i] + tile.m[i] * t);
        let is_within = x1 * x1 + y1 * y1 <= limit_mm2;
        let ended = if is_hit { VIGNETTED } else { MISSED } + 4 * surface;
        tile.code[i] = if is_alive & !(is_hit & is_within) { ended } else { tile.code[i] };
        tile.x[i] = if moves { x1 } else { tile.x[i] };
        tile.y[i] = if moves { y1 } else { tile.y[i] };
        tile.z[i] = if moves { 0.0 } else { tile.z[i] };
        tile.opl[i] = if moves { tile.opl[i] + step.index_before * t } else { tile.opl[i] };
    }
}

/// Moves each ray of a tile to an ideal lens, and turns it there.
#[inline(always)]
fn thin_lens_tile(step: &Step, power: f64, object_z: f64, surface: u64, limit_mm2: f64, tile: &mut Tile) {
    window_tile(step, surface, limit_mm2, tile);
    let (n1, n2) = (step.index_before, step.index_after);
    for i in 0..LANES {
        if tile.code[i] != IN_FLIGHT {
            continue;
        }
        let (x, y) = (tile.x[i], tile.y[i]);
        let (tx, ty) = (tile.l[i] / tile.n[i], tile.m[i] / tile.n[i]);
        let (sx, sy) = ((n1 * tx - power * x) / n2, (n1 * ty - power * y) / n2);
        // The path from the object point, and on to its image, is made that of the ray through the centre.
        let reduced = n1 / object_z + power;
        let before = path_difference([x, y], [tx, ty], object_z);
        let after = path_difference([x, y], [sx, sy], n2 / reduced);
        let n_after = 1.0 / (1.0 + sx * sx + sy * sy).sqrt();
        tile.opl[i] += n2 * after - n1 * before;
        tile.l[i] = sx * n_after;
        tile.m[i] = sy * n_after;
        tile.n[i] = n_after;
    }
}

/// Returns the distance to a point of the plane `z` from the lens centre, less that from `height`, both counted along
/// the ray of these slopes through `height`; written so that the point may be infinitely far.
#[inline(always)]
fn path_difference(height: [f64; 2], slopes: [f64; 2], z: f64) -> f64 {
    // With u = slopes + height/z the slopes from the centre: z (|(slopes, 1)| − |(u, 1)|) without cancellation.
    let (ux, uy) = (slopes[0] + height[0] / z, slopes[1] + height[1] / z);
    let along = 1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1];
    let centre = 1.0 + ux * ux + uy * uy;
    let sum = (slopes[0] + ux) * height[0] + (slopes[1] + uy) * height[1];
    sum / (along.sqrt() + centre.sqrt())
}
