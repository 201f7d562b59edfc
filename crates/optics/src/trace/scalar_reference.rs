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
    for (surface, pass) in plan.passes.iter().enumerate() {
        let Pass { form, shift, vertex_z, .. } = pass;
        form.pass(*shift, &from, &mut to);
        if pass.is_clipped_further() && !pass.is_within(to.ray(0, T::ZERO).x, to.ray(0, T::ZERO).y) {
            to.alive = [T::NO];
        }
        if to.alive == [T::NO] {
            let (fate, ended) = fate_of(surface as u16, pass, &from.ray(0, *shift), (&to, 0));
            return (Ray { z: ended.z + *vertex_z, ..ended }, fate);
        }
        from = to;
    }
    let (_, last_z) = plan.ends_z();
    (from.ray(0, -last_z), RayFate::InFlight)
}
