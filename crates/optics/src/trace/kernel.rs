//! The kernel: a block of rays through one surface, as vectors.
//!
//! Plain Rust over arrays of lanes, compiled for the base instruction set, for AVX2 and for AVX-512, chosen at run time.
//! None uses fused multiply-add, and square roots and divisions are correctly rounded, so every machine gives the
//! same bits. Lanes whose ray has ended go on computing numbers that nobody reads.

use multiversion::multiversion;

use super::{
    block::{Block, LANES},
    crossing::{
        ConicForm, Crossing, Ideal, Interaction, Interface, Ray, cross_conic, cross_plane, cross_sphere, refract,
        thin_lens,
    },
    real::Real,
};
use crate::toric::Toric;

/// A surface that takes blocks of rays through it.
pub(super) trait Optic<T: Real> {
    /// Takes the rays of `from`, whose z counts from a vertex that lies before this one by `shift`, on to the surface
    /// and turns them there.
    ///
    /// The new block has which rays are still in flight, and which crossed the right sheet of it; where one ended it holds what
    /// [`Interaction`] does.
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>);
}

/// Takes blocks through a surface, and returns whether a ray ended there.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
pub(super) fn pass_blocks<T: Real, O: Optic<T>>(optic: &O, shift: T, from: &[Block<T>], to: &mut [Block<T>]) -> bool {
    let mut ended = T::NO;
    for (from, to) in from.iter().zip(to) {
        optic.pass(shift, from, to);
        for (&before, &after) in from.alive.iter().zip(&to.alive) {
            ended = ended | (before & !after);
        }
    }
    ended != T::NO
}

/// Takes each ray of a block through a surface.
#[inline(always)]
pub(super) fn pass_lanes<T: Real, const N: usize>(
    shift: T,
    from: &Block<T, N>,
    to: &mut Block<T, N>,
    pass_one: impl Fn(usize, &Ray<T>) -> Interaction<T>,
) {
    for i in 0..N {
        let Interaction { ray, survives, is_front } = pass_one(i, &from.ray(i, shift));
        to.set(i, &ray);
        to.alive[i] = if survives { from.alive[i] } else { T::NO };
        to.front[i] = T::mask(is_front);
    }
}

/// A plane between equal media: nothing bends.
#[derive(Clone, Debug)]
pub(super) struct Window<T>(pub(super) Interface<T>);

/// A sphere, or a plane.
#[derive(Clone, Debug)]
pub(super) struct Sphere<T> {
    pub(super) curvature: T,
    pub(super) interface: Interface<T>,
}

/// A conic of revolution.
#[derive(Clone, Debug)]
pub(super) struct Conic<T> {
    pub(super) form: ConicForm<T>,
    pub(super) interface: Interface<T>,
}

/// An ideal thin lens.
#[derive(Clone, Debug)]
pub(super) struct ThinLens<T> {
    pub(super) ideal: Ideal<T>,
    pub(super) interface: Interface<T>,
}

/// A surface with two curvatures: crossed ray by ray, in double precision.
#[derive(Clone, Debug)]
pub(super) struct TwoCurvatures<T> {
    pub(super) toric: Toric,
    pub(super) interface: Interface<T>,
}

impl<T: Real> Optic<T> for Window<T> {
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        pass_lanes(shift, from, to, |_, ray| cross_plane(&self.0, ray));
    }
}

impl<T: Real> Optic<T> for Sphere<T> {
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        pass_lanes(shift, from, to, |_, ray| refract(&self.interface, ray, &cross_sphere(self.curvature, ray)));
    }
}

impl<T: Real> Optic<T> for Conic<T> {
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        pass_lanes(shift, from, to, |_, ray| refract(&self.interface, ray, &cross_conic(&self.form, ray)));
    }
}

impl<T: Real> Optic<T> for ThinLens<T> {
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        pass_lanes(shift, from, to, |_, ray| thin_lens(&self.ideal, &self.interface, ray));
    }
}

impl<T: Real> Optic<T> for TwoCurvatures<T> {
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        pass_lanes(shift, from, to, |_, ray| {
            let Crossing { t, normal, cos, cos2, is_front } = self.toric.cross(&ray.to_f64());
            let (t, normal) = (T::of(t), normal.map(T::of));
            refract(&self.interface, ray, &Crossing { t, normal, cos: T::of(cos), cos2: T::of(cos2), is_front })
        });
    }
}

/// Moves each ray to where it passes nearest to the vertex, so that far starts cost no digits at the surface.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
pub(super) fn approach<T: Real>(index: T, blocks: &mut [Block<T>]) {
    for block in blocks {
        approach_lanes(index, block);
    }
}

#[inline(always)]
pub(super) fn approach_lanes<T: Real, const N: usize>(index: T, block: &mut Block<T, N>) {
    for i in 0..N {
        let t = -(block.x[i] * block.l[i] + block.y[i] * block.m[i] + block.z[i] * block.n[i]);
        block.x[i] += block.l[i] * t;
        block.y[i] += block.m[i] * t;
        block.z[i] += block.n[i] * t;
        block.opl[i] += index * t;
    }
}

/// Moves each ray along its line to the plane at `z` from the vertex.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
pub(super) fn to_plane<T: Real>(z: T, index: T, blocks: &mut [Block<T>]) {
    for block in blocks {
        for i in 0..block.x.len() {
            let t = (z - block.z[i]) / block.n[i];
            block.x[i] += block.l[i] * t;
            block.y[i] += block.m[i] * t;
            block.z[i] = z;
            block.opl[i] += index * t;
        }
    }
}

/// Keeps for each ray the least so far of the rim's radius less the distance from the axis; −∞ for one that ended.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
pub(super) fn keep_clearance<T: Real>(rim: T, blocks: &[Block<T>], least: &mut [T]) {
    for (block, least) in blocks.iter().zip(least.chunks_mut(LANES)) {
        for (i, least) in least.iter_mut().enumerate() {
            let here = rim - (block.x[i] * block.x[i] + block.y[i] * block.y[i]).sqrt();
            let here = if block.alive[i] == T::NO { -T::INFINITY } else { here };
            *least = if here < *least { here } else { *least };
        }
    }
}
