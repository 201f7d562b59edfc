//! Tracing through surfaces that are tilted or decentered, or that reflect: those on one axis in its frame, by the kernels for
//! centered ones.
//!
//! A mirror is the last of its group: behind it the frames of surfaces have their z along the reflected light. So is a
//! diffractive surface, at which rays are turned one by one.

use super::{
    Goal, Plan, Step, Vignetting,
    crossing::{ConicForm, Ray, cross_conic},
    light::{LightPass, Lights, trace_light},
    move_to_plane, trace_batch, trace_clearances,
};
use crate::{Placement, RayFate, rays::RaySlices};

/// Traces rays given in the lens frame through these steps, each of which stands at its placement; `first` is the
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
    for group in Group::all(steps, placements) {
        let plan = plan(&group.own, group.place);
        in_frame(&group.frame, group.is_reversed(), rays, |mut rays| {
            trace_batch(&plan, Goal::LastSurface, rays.reborrow());
            group.diffract(plan.surface(group.own.len() - 1), &mut rays);
        });
    }
}

/// Traces rays and their light by such plans, through surfaces of which none is a mirror; a pass of light for each step.
pub(crate) fn trace_placed_light_by(
    (steps, placements): (&[Step], &[Placement]),
    plan: impl Fn(&[Step], usize) -> Plan<f64>,
    passes: &[LightPass<f64>],
    (rays, lights): (&mut RaySlices<'_>, &mut Lights<f64>),
) {
    for group in Group::all(steps, placements) {
        let plan = plan(&group.own, group.place);
        lights.turn(&group.frame.rotation.transpose());
        in_frame(&group.frame, false, rays, |mut rays| {
            let own = &passes[group.place..group.place + group.own.len()];
            trace_light(&plan, own, rays.reborrow(), lights);
            group.diffract(plan.surface(group.own.len() - 1), &mut rays);
        });
        lights.turn(&group.frame.rotation);
    }
}

/// Does what [`trace_clearances`] does; distances are those from each surface's own axis.
pub(crate) fn placed_clearances(
    steps: &[Step],
    placements: &[Placement],
    rays: &mut RaySlices<'_>,
    clearances: &mut [f64],
) {
    for group in Group::all(steps, placements) {
        let plan = Plan::new(&group.own, 0, Vignetting::Off);
        in_frame(&group.frame, group.is_reversed(), rays, |mut rays| {
            trace_clearances(&plan, rays.reborrow(), clearances);
            group.diffract(plan.surface(group.own.len() - 1), &mut rays);
            let ended = rays.fate.iter().zip(clearances.iter_mut()).filter(|(fate, _)| !fate.is_in_flight());
            ended.for_each(|(_, clearance)| *clearance = f64::NEG_INFINITY);
        });
    }
}

/// Surfaces that stand on one axis, as those of a lens do that is tilted as a whole: for them rays change their frame once.
/// A mirror or a diffractive surface is the last.
struct Group<'a> {
    /// The frame of the first of them.
    frame: Placement,
    /// Its place among all.
    place: usize,
    /// All of them as centered ones in that frame; a diffractive one only ends the way.
    own: Vec<Step>,
    /// The last of them.
    last: &'a Step,
}

impl<'a> Group<'a> {
    fn all(steps: &'a [Step], placements: &'a [Placement]) -> impl Iterator<Item = Self> {
        let mut place = 0;
        std::iter::from_fn(move || {
            let (start, frame) = (place, *placements.get(place)?);
            place += 1;
            while place < steps.len() && !steps[place - 1].ends_group() && frame.is_coaxial(&placements[place]) {
                place += 1;
            }
            let own = |(step, stands): (&Step, &Placement)| {
                let step = if step.phase.is_some() { step.reached() } else { step.clone() };
                Step { vertex_z: frame.surface_from_lens(stands.vertex_mm).z, ..step }
            };
            let own = steps[start..place].iter().zip(&placements[start..place]).map(own).collect();
            Some(Self { frame, place: start, own, last: &steps[place - 1] })
        })
    }

    /// Whether the kernel leaves the directions of rays reversed: behind a mirror ([`Plan::new`]).
    fn is_reversed(&self) -> bool {
        self.own.last().is_some_and(|step| step.is_mirror)
    }

    /// Turns the rays on the last surface, of this number, if it is diffractive.
    fn diffract(&self, surface: u16, rays: &mut RaySlices<'_>) {
        if let Some(phase) = &self.last.phase {
            self.last.diffract_all(phase, surface, rays);
        }
    }
}

impl Step {
    /// Whether light has another frame, or another direction than refraction gives, behind the surface.
    fn ends_group(&self) -> bool {
        self.is_mirror || self.phase.is_some()
    }
}

/// Moves every ray in flight along its line to the x–y plane of a frame, in a medium of this index.
pub(crate) fn move_to_placed_plane(placement: &Placement, index: f64, rays: &mut RaySlices<'_>) {
    in_frame(placement, false, rays, |rays| move_to_plane(rays, 0.0, index));
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
    in_frame(placement, false, rays, |mut rays| {
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
///
/// Behind a mirror the kernel leaves the directions of rays reversed that go on (`Plan::new`); they are set right.
fn in_frame(placement: &Placement, is_reversed: bool, rays: &mut RaySlices<'_>, work: impl FnOnce(RaySlices<'_>)) {
    let there: Vec<usize> = (0..rays.fate.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
    let back = placement.rotation.transpose();
    for &i in &there {
        rays.set_point(i, placement.surface_from_lens(rays.point(i)));
        rays.set_direction(i, back * rays.direction(i));
    }
    work(rays.reborrow());
    for &i in &there {
        let direction = placement.rotation * rays.direction(i);
        rays.set_point(i, placement.lens_from_surface(rays.point(i)));
        rays.set_direction(i, if is_reversed && rays.fate[i].is_in_flight() { -direction } else { direction });
    }
}
