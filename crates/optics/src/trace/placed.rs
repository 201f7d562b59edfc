//! Tracing through surfaces that are tilted or decentered: those on one axis in its frame, by the kernels for centered ones.

use std::ops::Range;

use glam::DVec3;

use super::{
    Goal, Plan, Step, Vignetting,
    crossing::{ConicForm, Ray, cross_conic},
    move_to_plane, trace_batch, trace_clearances,
};
use crate::{Placement, RayFate, rays::RaySlices};

/// Traces rays given in the lens frame through these steps, each of which stands as its placement says; `first` is the
/// number of the first of them.
pub(crate) fn trace_placed(
    steps: &[Step],
    placements: &[Placement],
    first: usize,
    rims: Vignetting,
    rays: &mut RaySlices<'_>,
) {
    trace_placed_by(steps, placements, |own, place| Plan::new(own, first + place, rims), rays);
}

/// Traces such rays by a plan for each group of surfaces on one axis, made of its steps and the place of the first of them
/// among all.
pub(crate) fn trace_placed_by(
    steps: &[Step],
    placements: &[Placement],
    plan: impl Fn(&[Step], usize) -> Plan<f64>,
    rays: &mut RaySlices<'_>,
) {
    for group in coaxial(placements) {
        let place = group.start;
        let (placement, own) = in_own_frame(&steps[group.clone()], &placements[group]);
        in_frame(&placement, rays, |rays| trace_batch(&plan(&own, place), Goal::LastSurface, rays));
    }
}

/// Does what [`trace_clearances`] does; distances are those from each surface's own axis.
pub(crate) fn placed_clearances(
    steps: &[Step],
    placements: &[Placement],
    rays: &mut RaySlices<'_>,
    clearances: &mut [f64],
) {
    for group in coaxial(placements) {
        let (placement, own) = in_own_frame(&steps[group.clone()], &placements[group]);
        in_frame(&placement, rays, |rays| trace_clearances(&Plan::new(&own, 0, Vignetting::Off), rays, clearances));
    }
}

/// Returns the surfaces in groups that stand on one axis each, as those of a lens do that is tilted as a whole: for a group
/// rays change their frame once.
fn coaxial(placements: &[Placement]) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let first = placements.get(start)?;
        let n = placements[start..].iter().take_while(|placement| first.is_coaxial(placement)).count();
        start += n;
        Some(start - n..start)
    })
}

/// Returns the frame of the first of the surfaces of a group, and all of them as centered ones in it.
fn in_own_frame(steps: &[Step], placements: &[Placement]) -> (Placement, Vec<Step>) {
    let frame = placements[0];
    let own = |(step, placement): (&Step, &Placement)| Step {
        vertex_z: frame.surface_from_lens(placement.vertex_mm).z,
        ..step.clone()
    };
    (frame, steps.iter().zip(placements).map(own).collect())
}

/// Moves every ray in flight along its line to the x–y plane of a frame, in a medium of this index.
pub(crate) fn move_to_placed_plane(placement: &Placement, index: f64, rays: &mut RaySlices<'_>) {
    in_frame(placement, rays, |rays| move_to_plane(rays, 0.0, index));
}

/// Moves every ray in flight along its line to a conic with its vertex at a frame's origin; those that do not meet it
/// have missed it.
pub(crate) fn move_to_placed_conic(
    placement: &Placement,
    [curvature, conic]: [f64; 2],
    (index, surface): (f64, u16),
    rays: &mut RaySlices<'_>,
) {
    let form = ConicForm::new(curvature, conic);
    in_frame(placement, rays, |mut rays| {
        for i in (0..rays.fate.len()).filter(|&i| rays.fate[i].is_in_flight()).collect::<Vec<_>>() {
            let (p, d) = (rays.point(i), rays.direction(i));
            // From where the ray passes nearest to the vertex, so that a far start costs no digits.
            let near = -p.dot(d);
            let q = p + d * near;
            let crossing = cross_conic(&form, &Ray { x: q.x, y: q.y, z: q.z, l: d.x, m: d.y, n: d.z, opl: 0.0 });
            if !(crossing.is_front && crossing.t.is_finite()) {
                rays.fate[i] = RayFate::Missed { surface };
                continue;
            }
            rays.set_point(i, q + d * crossing.t);
            rays.opl[i] += index * (near + crossing.t);
        }
    });
}

/// Brings the rays in flight into a surface's own frame, works on them there, and brings the same ones back.
fn in_frame(placement: &Placement, rays: &mut RaySlices<'_>, work: impl FnOnce(RaySlices<'_>)) {
    let there: Vec<bool> = rays.fate.iter().map(|fate| fate.is_in_flight()).collect();
    let turn = |rays: &mut RaySlices<'_>, point: &dyn Fn(DVec3) -> DVec3, direction: &dyn Fn(DVec3) -> DVec3| {
        for i in there.iter().enumerate().filter_map(|(i, &is_there)| is_there.then_some(i)) {
            rays.set_point(i, point(rays.point(i)));
            rays.set_direction(i, direction(rays.direction(i)));
        }
    };
    let back = placement.rotation.transpose();
    turn(rays, &|p| placement.surface_from_lens(p), &|d| back * d);
    work(rays.reborrow());
    turn(rays, &|p| placement.lens_from_surface(p), &|d| placement.rotation * d);
}
