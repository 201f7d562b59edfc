//! Tracing through surfaces that are tilted or decentred: each in its own frame, by the kernel for centred ones.

use glam::DVec3;

use super::{
    Goal, Plan, Rims, Step,
    crossing::{ConicForm, Ray, cross_conic},
    move_to_plane, trace_batch, trace_clearances,
};
use crate::{Pose, RayFate, rays::RaySlices};

/// Traces rays given in the lens frame through these steps, each of which stands as its pose says; `first` is the
/// number of the first of them.
pub(crate) fn trace_placed(steps: &[Step], poses: &[Pose], first: usize, rims: Rims, rays: &mut RaySlices<'_>) {
    for (i, (step, pose)) in steps.iter().zip(poses).enumerate() {
        let own = [Step { vertex_z: 0.0, ..step.clone() }];
        in_frame(pose, rays, |rays| trace_batch(&Plan::new(&own, first + i, rims), Goal::LastSurface, rays));
    }
}

/// Does what [`trace_clearances`] does; distances are those from each surface's own axis.
pub(crate) fn placed_clearances(steps: &[Step], poses: &[Pose], rays: &mut RaySlices<'_>, clearances: &mut [f64]) {
    for (step, pose) in steps.iter().zip(poses) {
        let own = [Step { vertex_z: 0.0, ..step.clone() }];
        in_frame(pose, rays, |rays| trace_clearances(&Plan::new(&own, 0, Rims::Ignore), rays, clearances));
    }
}

/// Moves every ray in flight along its line to the x–y plane of a frame, in a medium of this index.
pub(crate) fn move_to_placed_plane(pose: &Pose, index: f64, rays: &mut RaySlices<'_>) {
    in_frame(pose, rays, |rays| move_to_plane(rays, 0.0, index));
}

/// Moves every ray in flight along its line to a conic with its vertex at a frame's origin; those that do not meet it
/// have missed it.
pub(crate) fn move_to_placed_conic(
    pose: &Pose,
    [curvature, conic]: [f64; 2],
    (index, surface): (f64, u16),
    rays: &mut RaySlices<'_>,
) {
    let form = ConicForm::new(curvature, conic);
    in_frame(pose, rays, |mut rays| {
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
fn in_frame(pose: &Pose, rays: &mut RaySlices<'_>, work: impl FnOnce(RaySlices<'_>)) {
    let there: Vec<bool> = rays.fate.iter().map(|fate| fate.is_in_flight()).collect();
    let turn = |rays: &mut RaySlices<'_>, point: &dyn Fn(DVec3) -> DVec3, direction: &dyn Fn(DVec3) -> DVec3| {
        for i in there.iter().enumerate().filter_map(|(i, &is_there)| is_there.then_some(i)) {
            rays.set_point(i, point(rays.point(i)));
            rays.set_direction(i, direction(rays.direction(i)));
        }
    };
    let back = pose.rotation.transpose();
    turn(rays, &|p| pose.to_own(p), &|d| back * d);
    work(rays.reborrow());
    turn(rays, &|p| pose.to_lens(p), &|d| pose.rotation * d);
}
