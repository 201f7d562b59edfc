//! The kernel's scalar twin: one ray after another, for the tests that hold the kernel to it.

use super::{
    block::Block,
    crossing::Ray,
    fate_of,
    kernel::approach_lanes,
    plan::{Pass, Plan},
    real::Real,
};
use crate::RayFate;

/// Traces a ray, given from the first vertex, by itself through a whole lens.
pub(super) fn trace_one<T: Real>(plan: &Plan<T>, ray: &Ray<T>) -> (Ray<T>, RayFate) {
    let mut from = Block::<T, 1>::EMPTY;
    from.set(0, ray);
    from.alive = [T::YES];
    approach_lanes(plan.index_before, &mut from);
    let mut to = from;
    for (surface, Pass { form, shift, vertex_z, interface, .. }) in plan.passes.iter().enumerate() {
        form.pass(*shift, &from, &mut to);
        if to.alive == [T::NO] {
            let (fate, ended) = fate_of(surface as u16, interface, &from.ray(0, *shift), (&to, 0));
            return (Ray { z: ended.z + *vertex_z, ..ended }, fate);
        }
        from = to;
    }
    let (_, last_z) = plan.ends_z();
    (from.ray(0, -last_z), RayFate::InFlight)
}
