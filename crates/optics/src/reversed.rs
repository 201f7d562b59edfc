//! A lens met from behind: rays from the film back into the scene.
//!
//! The lens is mirrored at the plane z = 0, and its surfaces are met in the opposite order, so that the kernels of the
//! forward trace do the work: the same digits, surfaces and fates.

use glam::{DMat3, DVec3};

use crate::{
    MonoLens, Placement, RayBatch, RayBatchF32, RayLight, RayLightF32, Vignetting,
    mono::trace_light_by_surfaces,
    rays::RaySlices,
    toric::Toric,
    trace::{self, Goal, Kind, LightPass, Lights, Phase, Plan, Real, Step},
    transmission::Transmission,
};

/// A lens at one wavelength, traced from the film to the scene.
///
/// Rays are given and returned in the lens frame; those on their way to the scene have directions with z below 0. A fate
/// names the surface by its place in the lens, counted from the scene as ever.
#[derive(Clone, Debug)]
pub struct ReversedLens {
    forward: MonoLens,
    /// Where surfaces stand in the mirrored frame, the last first, if not all are centered.
    placements: Option<Vec<Placement>>,
    /// Plans for each part, of a far object and with rims.
    plans: [Plan<f64>; 3],
    plans_f32: [Plan<f32>; 3],
}

/// What to trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// All surfaces.
    Whole = 0,
    /// Those behind the stop, and on to the stop, which turns nothing.
    ToStop = 1,
    /// The stop, where it turns rays, and those before it.
    FromStop = 2,
}

impl MonoLens {
    /// Returns the lens for rays from the film to the scene.
    pub fn reversed(&self) -> ReversedLens {
        let placements = self.placements().map(|placements| {
            let both = placements.iter().zip(self.steps()).rev();
            both.map(|(placement, step)| mirrored_placement(placement, step.is_mirror)).collect()
        });
        let steps = |part: Part| part_of(&mirrored_steps(self, f64::NEG_INFINITY), self.stop(), part);
        let parts = [Part::Whole, Part::ToStop, Part::FromStop];
        ReversedLens {
            placements,
            plans: parts.map(|part| plan_of(&steps(part), part, self.first_of(part), Vignetting::On)),
            plans_f32: parts.map(|part| plan_of(&steps(part), part, self.first_of(part), Vignetting::On)),
            forward: self.clone(),
        }
    }

    /// The surface that a part begins with.
    fn first_of(&self, part: Part) -> usize {
        if part == Part::FromStop { self.stop() } else { self.n_surfaces() - 1 }
    }
}

impl ReversedLens {
    /// The lens, as it is traced forward.
    pub fn forward(&self) -> &MonoLens {
        &self.forward
    }

    /// Where the stop stands: in its frame diffraction turns rays between [`trace_to_stop`](Self::trace_to_stop) and
    /// [`trace_from_stop`](Self::trace_from_stop).
    pub fn stop_placement(&self) -> Placement {
        self.forward.stop_placement()
    }

    /// Traces rays from the image space through all surfaces, on this thread.
    ///
    /// Each ray in flight ends on the first surface, bent into the object space, or where it was lost.
    pub fn trace(&self, rays: &mut RayBatch, rims: Vignetting) {
        self.trace_part(Part::Whole, rays, rims);
    }

    /// Traces rays from the image space through the surfaces behind the stop and on to the stop, whose rim ends them.
    ///
    /// A stop that refracts has not done so yet: rays are in the medium behind it, where forward rays are diffracted.
    pub fn trace_to_stop(&self, rays: &mut RayBatch, rims: Vignetting) {
        self.trace_part(Part::ToStop, rays, rims);
    }

    /// Traces rays that are at the stop on through it and the surfaces before it.
    pub fn trace_from_stop(&self, rays: &mut RayBatch, rims: Vignetting) {
        self.trace_part(Part::FromStop, rays, rims);
    }

    /// Traces rays in single precision as [`trace`](Self::trace) does, with rims.
    ///
    /// They must start near the last vertex. Through tilted and decentered surfaces they go in double precision.
    pub fn trace_f32(&self, rays: &mut RayBatchF32) {
        self.trace_part_f32(Part::Whole, rays);
    }

    /// Does the same to the stop, as [`trace_to_stop`](Self::trace_to_stop).
    pub fn trace_to_stop_f32(&self, rays: &mut RayBatchF32) {
        self.trace_part_f32(Part::ToStop, rays);
    }

    /// Does the same from the stop on, as [`trace_from_stop`](Self::trace_from_stop).
    pub fn trace_from_stop_f32(&self, rays: &mut RayBatchF32) {
        self.trace_part_f32(Part::FromStop, rays);
    }

    /// Traces rays as [`trace`](Self::trace) does, and their light: that of a ray of the scene along the same way.
    pub fn trace_light(&self, rays: &mut RayBatch, light: &mut RayLight, rims: Vignetting) {
        let Some(losses) = &self.forward.losses else { return self.trace(rays, rims) };
        self.trace_part_light(Part::Whole, (rays, &mut light.0), losses.transmission(), rims);
    }

    /// Traces rays in single precision as [`trace_f32`](Self::trace_f32) does, and their light.
    pub fn trace_light_f32(&self, rays: &mut RayBatchF32, light: &mut RayLightF32) {
        self.trace_part_light_f32(Part::Whole, rays, light);
    }

    /// Does the same to the stop, as [`trace_to_stop`](Self::trace_to_stop).
    pub fn trace_light_to_stop_f32(&self, rays: &mut RayBatchF32, light: &mut RayLightF32) {
        self.trace_part_light_f32(Part::ToStop, rays, light);
    }

    /// Does the same from the stop on, as [`trace_from_stop`](Self::trace_from_stop).
    pub fn trace_light_from_stop_f32(&self, rays: &mut RayBatchF32, light: &mut RayLightF32) {
        self.trace_part_light_f32(Part::FromStop, rays, light);
    }

    /// Returns for each ray from the image space the least over the surfaces of semi-aperture less distance from the
    /// axis, mm; −∞ for one that does not get through. Openings count as rims, obscurations do not.
    ///
    /// With `to_stop` the surfaces are those behind the stop and the stop.
    pub fn clearances_mm(&self, rays: &mut RayBatch, to_stop: bool) -> Vec<f64> {
        let part = if to_stop { Part::ToStop } else { Part::Whole };
        let steps = part_of(&mirrored_steps(&self.forward, rays.object_z_mm), self.forward.stop(), part);
        let mut clearances_mm = vec![f64::INFINITY; rays.len()];
        let mut slices = rays.slices();
        mirror(&mut slices);
        match self.poses_of(part) {
            Some(placements) => trace::placed_clearances(&steps, placements, &mut slices, &mut clearances_mm),
            None => {
                let plan = plan_of(&steps, part, self.forward.first_of(part), Vignetting::Off);
                trace::trace_clearances(&plan, slices, &mut clearances_mm);
            }
        }
        mirror(&mut rays.slices());
        clearances_mm
    }

    fn trace_part(&self, part: Part, rays: &mut RayBatch, rims: Vignetting) {
        let object_z_mm = rays.object_z_mm;
        let is_planned = rims == Vignetting::On && object_z_mm == f64::NEG_INFINITY;
        let mut slices = rays.slices();
        mirror(&mut slices);
        let steps = || part_of(&mirrored_steps(&self.forward, object_z_mm), self.forward.stop(), part);
        let first = self.forward.first_of(part);
        match self.poses_of(part) {
            Some(placements) => {
                let plan = |own: &[Step], place: usize| Plan::reversed(own, first - place, rims, place == 0);
                trace::trace_placed_by(&steps(), placements, plan, &mut slices);
            }
            None if is_planned => trace::trace_batch(&self.plans[part as usize], Goal::LastSurface, slices),
            None => trace::trace_batch(&plan_of(&steps(), part, first, rims), Goal::LastSurface, slices),
        }
        mirror(&mut rays.slices());
    }

    fn trace_part_f32(&self, part: Part, rays: &mut RayBatchF32) {
        if self.placements.is_some() {
            let mut wide = rays.widened();
            self.trace_part(part, &mut wide, Vignetting::On);
            return rays.set_rounded(&wide, |point, _| point);
        }
        let mut slices = rays.slices();
        mirror(&mut slices);
        trace::trace_batch(&self.plans_f32[part as usize], Goal::LastSurface, slices);
        mirror(&mut rays.slices());
    }

    fn trace_part_light(
        &self,
        part: Part,
        (rays, lights): (&mut RayBatch, &mut Lights<f64>),
        transmission: &Transmission,
        rims: Vignetting,
    ) {
        assert_eq!(rays.len(), lights.n_rays(), "light along each ray");
        let passes = self.passes_of(part, [&transmission.backward, &transmission.to_stop]);
        mirror(&mut rays.slices());
        lights.mirror();
        let steps = part_of(&mirrored_steps(&self.forward, rays.object_z_mm), self.forward.stop(), part);
        let first = self.forward.first_of(part);
        match self.poses_of(part) {
            Some(placements) if steps.iter().any(|step| step.is_mirror) => {
                let plan = |at: usize| {
                    move |own: &[Step], place: usize| Plan::reversed(own, first - at - place, rims, at + place == 0)
                };
                trace_light_by_surfaces(passes, rays, lights, |at, rays| {
                    trace::trace_placed_by(&steps[at..=at], &placements[at..=at], plan(at), &mut rays.slices());
                });
            }
            Some(placements) => {
                let plan = |own: &[Step], place: usize| Plan::reversed(own, first - place, rims, place == 0);
                let both = (&mut rays.slices(), &mut *lights);
                trace::trace_placed_light_by((&steps, placements), plan, passes, both);
            }
            None => trace::trace_light(&plan_of(&steps, part, first, rims), passes, rays.slices(), lights),
        }
        mirror(&mut rays.slices());
        lights.mirror();
    }

    fn trace_part_light_f32(&self, part: Part, rays: &mut RayBatchF32, light: &mut RayLightF32) {
        let Some(losses) = &self.forward.losses else { return self.trace_part_f32(part, rays) };
        if self.placements.is_some() {
            let (mut wide, mut lights) = (rays.widened(), light.0.converted());
            self.trace_part_light(part, (&mut wide, &mut lights), losses.transmission(), Vignetting::On);
            light.0 = lights.converted();
            return rays.set_rounded(&wide, |point, _| point);
        }
        let transmission = losses.transmission();
        let passes = self.passes_of(part, [&transmission.backward_f32, &transmission.to_stop_f32]);
        mirror(&mut rays.slices());
        light.0.mirror();
        trace::trace_light(&self.plans_f32[part as usize], passes, rays.slices(), &mut light.0);
        mirror(&mut rays.slices());
        light.0.mirror();
    }

    /// The passes of light through the surfaces of a part, of those through all and those to the stop.
    fn passes_of<'a, T>(&self, part: Part, [all, to_stop]: [&'a [LightPass<T>]; 2]) -> &'a [LightPass<T>] {
        match part {
            Part::Whole => all,
            Part::FromStop => &all[self.forward.n_surfaces() - 1 - self.forward.stop()..],
            Part::ToStop => to_stop,
        }
    }

    /// The placements of the surfaces of a part.
    fn poses_of(&self, part: Part) -> Option<&[Placement]> {
        let stop_place = self.forward.n_surfaces() - 1 - self.forward.stop();
        self.placements.as_ref().map(|placements| match part {
            Part::Whole => &placements[..],
            Part::ToStop => &placements[..=stop_place],
            Part::FromStop => &placements[stop_place..],
        })
    }
}

fn plan_of<T: Real>(steps: &[Step], part: Part, first: usize, rims: Vignetting) -> Plan<T> {
    Plan::reversed(steps, first, rims, part != Part::FromStop)
}

/// Mirrors rays at the plane z = 0.
fn mirror<T: Real>(rays: &mut RaySlices<'_, T>) {
    for z in rays.z.iter_mut().chain(rays.n.iter_mut()) {
        *z = -*z;
    }
}

/// Returns where a surface stands in the mirrored frame: its own frame is mirrored too, but for a mirror, which light comes to
/// from the same side both ways.
fn mirrored_placement(placement: &Placement, is_mirror: bool) -> Placement {
    let flip = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
    let mirrored = Placement { vertex_mm: flip * placement.vertex_mm, rotation: flip * placement.rotation };
    if is_mirror { mirrored } else { mirrored.flipped() }
}

/// Returns the steps of a lens mirrored at z = 0, the last first.
fn mirrored_steps(lens: &MonoLens, object_z_mm: f64) -> Vec<Step> {
    lens.steps_for(object_z_mm).iter().rev().map(mirrored).collect()
}

/// Returns a step as light meets it from behind, mirrored at z = 0.
pub(crate) fn mirrored(step: &Step) -> Step {
    if step.is_mirror {
        return step.clone();
    }
    let negated = |list: &[f64]| list.iter().map(|a| -a).collect();
    let kind = match &step.kind {
        Kind::Window => Kind::Window,
        Kind::Sphere => Kind::Sphere,
        Kind::Conic { conic } => Kind::Conic { conic: *conic },
        Kind::EvenAsphere { conic, a2, coefficients } => {
            Kind::EvenAsphere { conic: *conic, a2: -a2, coefficients: negated(coefficients) }
        }
        Kind::OddAsphere { conic, coefficients } => {
            Kind::OddAsphere { conic: *conic, coefficients: negated(coefficients) }
        }
        Kind::ThinLens { power, object_z } => {
            // The object plane of rays that go back is the image plane of those that come.
            let image_z = step.index_after / (step.index_before / object_z + power);
            Kind::ThinLens { power: *power, object_z: -image_z }
        }
        Kind::Toric(Toric::Biconic { c, k }) => Kind::Toric(Toric::Biconic { c: c.map(|c| -c), k: *k }),
        Kind::Toric(Toric::Toroid { c, conic, coefficients }) => {
            let coefficients = negated(coefficients);
            Kind::Toric(Toric::Toroid { c: c.map(|c| -c), conic: *conic, coefficients })
        }
    };
    Step {
        kind,
        curvature: -step.curvature,
        index_before: step.index_after,
        index_after: step.index_before,
        vertex_z: -step.vertex_z,
        phase: step.phase.clone().map(Phase::turned_round),
        ..step.clone()
    }
}

/// Returns the steps of a part of a mirrored lens whose stop is the surface of this number.
fn part_of(steps: &[Step], stop: usize, part: Part) -> Vec<Step> {
    let stop_place = steps.len() - 1 - stop;
    match part {
        Part::Whole => steps.to_vec(),
        Part::FromStop => steps[stop_place..].to_vec(),
        Part::ToStop => {
            let mut steps = steps[..=stop_place].to_vec();
            let stop = &mut steps[stop_place];
            stop.index_after = stop.index_before;
            if matches!(stop.kind, Kind::ThinLens { .. }) {
                stop.kind = Kind::Window;
            }
            stop.is_mirror = false;
            stop.phase = None;
            steps
        }
    }
}
