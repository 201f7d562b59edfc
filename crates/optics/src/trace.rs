//! Exact tracing of ray batches: blocks of rays, surface by surface.
//!
//! A handful of blocks goes through a whole lens before the next, so that nothing is stored between surfaces. What
//! happens at a surface is vector code, one function for each kind of surface ([`kernel`]); this file brings the
//! rays there, and writes those that end.

mod aperture;
mod asphere;
mod block;
mod crossing;
mod kernel;
mod light;
mod phase;
mod placed;
mod plan;
mod real;
#[cfg(test)]
mod scalar_reference;
#[cfg(test)]
mod tests;
mod toric;
mod tree;

use multiversion::multiversion;

use self::{
    block::{Block, LANES},
    crossing::Ray,
    plan::Pass,
};
pub(crate) use self::{
    light::{Argument, LightPass, Lights, trace_light},
    phase::Phase,
    placed::{
        move_to_placed_conic, move_to_placed_plane, placed_clearances, trace_placed, trace_placed_by,
        trace_placed_light_by,
    },
    plan::Plan,
    real::Real,
    tree::{GhostTree, LightSink, Loss, SideLight},
};
use crate::{Aperture, RayFate, rays::RaySlices, toric::Toric};

/// Whether rims end rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vignetting {
    /// A ray that meets a surface outside its rim ends there.
    On,
    /// Surfaces reach as far as their shape does.
    Off,
}

/// A surface with its indices resolved, as the light meets it: where that runs towards −z, the surface is mirrored at its
/// vertex plane and z counts the other way, so that light always runs towards +z.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) kind: Kind,
    pub(crate) curvature: f64,
    pub(crate) index_before: f64,
    pub(crate) index_after: f64,
    pub(crate) vertex_z: f64,
    pub(crate) semi_aperture: f64,
    /// Openings beside the round rim.
    pub(crate) apertures: Vec<Aperture>,
    /// Whether it reflects.
    pub(crate) is_mirror: bool,
    /// The phase that it adds.
    pub(crate) phase: Option<Phase>,
}

/// The shapes, and what they need beyond a curvature.
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

/// Blocks that go through the lens together: few enough for the nearest cache, and enough that the call to a
/// surface's code costs nothing.
const BLOCKS: usize = 4;

/// Where a trace leaves rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Goal {
    /// On the last surface.
    LastSurface,
    /// On the plane so far behind the last vertex.
    Film { film_distance_mm: f64 },
}

/// Traces rays given in the lens frame.
pub(crate) fn trace_batch<T: Real>(plan: &Plan<T>, goal: Goal, mut rays: RaySlices<'_, T>) {
    trace_blocks(plan, goal, &mut rays, |_, _, _, _| {});
}

/// Traces rays without rims, and keeps for each the least over all surfaces of semi-aperture less distance from the
/// axis; −∞ for a ray that does not get through.
pub(crate) fn trace_clearances(plan: &Plan<f64>, mut rays: RaySlices<'_>, clearances: &mut [f64]) {
    trace_blocks(plan, Goal::LastSurface, &mut rays, |surface, _, blocks, start| {
        let pass = &plan.passes[surface];
        kernel::keep_clearance(pass.semi_aperture, blocks, &mut clearances[start..]);
        if !pass.apertures.is_empty() {
            aperture::keep_clearance(&pass.apertures, blocks, &mut clearances[start..]);
        }
    });
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

/// Traces rays; `note` sees every surface passed, the blocks as they came and as they leave it, and the number of their first ray.
fn trace_blocks<T: Real>(
    plan: &Plan<T>,
    goal: Goal,
    rays: &mut RaySlices<'_, T>,
    note: impl FnMut(usize, &[Block<T>], &[Block<T>], usize),
) {
    // A few rays need not pay for the room of many.
    match rays.fate.len() <= LANES {
        true => trace_groups::<T, 1>(plan, goal, rays, note),
        false => trace_groups::<T, BLOCKS>(plan, goal, rays, note),
    }
}

fn trace_groups<T: Real, const B: usize>(
    plan: &Plan<T>,
    goal: Goal,
    rays: &mut RaySlices<'_, T>,
    mut note: impl FnMut(usize, &[Block<T>], &[Block<T>], usize),
) {
    let (first_z, last_z) = plan.ends_z();
    let (mut here, mut there) = ([Block::EMPTY; B], [Block::EMPTY; B]);
    for start in (0..rays.fate.len()).step_by(LANES * B) {
        let n_blocks = (rays.fate.len() - start).div_ceil(LANES).min(B);
        let (mut from, mut to) = (&mut here[..n_blocks], &mut there[..n_blocks]);
        for (i, block) in from.iter_mut().enumerate() {
            *block = Block::load(rays, start + i * LANES, first_z);
        }
        if plan.approaches {
            kernel::approach(plan.index_before, from);
        }
        for (i, pass) in plan.passes.iter().enumerate() {
            let mut is_any_ended = pass.form.pass_blocks(pass.shift, from, to);
            if pass.is_clipped_further() {
                is_any_ended |= aperture::clip(&pass.apertures, to);
            }
            note(i, from, to, start);
            (from, to) = (to, from);
            if is_any_ended {
                let at = At { pass, surface: plan.surface(i), start };
                at.end_rays(to, from, rays);
                if !from.iter().any(Block::is_any_alive) {
                    break;
                }
            }
        }
        if let Goal::Film { film_distance_mm } = goal {
            kernel::to_plane(T::of(film_distance_mm), plan.index_after, from);
        }
        for (i, block) in from.iter().enumerate() {
            block.store(last_z, rays, start + i * LANES);
        }
    }
}

/// A surface that some blocks are at, and the number of their first ray.
struct At<'a, T> {
    pass: &'a Pass<T>,
    surface: u16,
    start: usize,
}

impl<T: Real> At<'_, T> {
    /// Writes the rays that were in flight before the surface and are not behind it.
    fn end_rays(&self, before: &[Block<T>], after: &[Block<T>], rays: &mut RaySlices<'_, T>) {
        for (i, (before, after)) in before.iter().zip(after).enumerate() {
            for lane in (0..LANES).filter(|&lane| before.alive[lane] != after.alive[lane]) {
                let came = before.ray(lane, self.pass.shift);
                let (fate, ray) = fate_of(self.surface, self.pass, &came, (after, lane));
                let in_lens = Ray { z: ray.z + self.pass.vertex_z, ..ray };
                rays.end(self.start + i * LANES + lane, &in_lens, fate);
            }
        }
    }
}

/// Returns how and where a ray ended that a lane held, with the direction in which it came.
fn fate_of<T: Real, const N: usize>(
    surface: u16,
    pass: &Pass<T>,
    before: &Ray<T>,
    (after, lane): (&Block<T, N>, usize),
) -> (RayFate, Ray<T>) {
    let Ray { l, m, n, .. } = *before;
    let there = Ray { l, m, n, ..after.ray(lane, T::ZERO) };
    let is_hit = after.front[lane] != T::NO && there.x.abs() + there.y.abs() < T::INFINITY;
    match (is_hit, pass.is_within(there.x, there.y)) {
        (false, _) => (RayFate::Missed { surface }, *before),
        (true, false) => (RayFate::Vignetted { surface }, there),
        (true, true) => (RayFate::TotalReflection { surface }, there),
    }
}
