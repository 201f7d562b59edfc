//! What surfaces and media leave of the light along rays, and how they polarize it: for blocks of rays, behind the kernel.
//!
//! Light is a vector of Stokes: its power, Q and U along and across the electric field across the last plane of incidence, and V. Light
//! that comes unpolarized is followed exactly, but for waves that go to and fro between surfaces, as light of one Jones matrix a surface.
//! A surface needs no more than the directions before and behind it: their cross product is the normal of the plane of incidence, and their
//! product says the angle (docs/stray-light.md, eq. 3).

use glam::{DMat3, DVec3};
use multiversion::multiversion;

use super::{
    Goal, Plan,
    block::{Block, LANES},
    real::Real,
    trace_blocks,
};
use crate::rays::RaySlices;

/// What one surface does to light, and the medium before it.
#[derive(Clone, Debug)]
pub(crate) struct LightPass<T> {
    /// What the argument of the series is of: the product of the directions before and behind, or, where light comes back, the cosine of
    /// the angle to the normal in the medium of lower index.
    pub(crate) argument: Argument<T>,
    pub(crate) scale: T,
    pub(crate) offset: T,
    /// Chebyshev series of half the sum and half the difference of the shares of s and p, and of the real and the imaginary part of
    /// `t_s t_p*`; none where the surface leaves light as it is.
    pub(crate) series: Option<[Vec<T>; 4]>,
    /// Absorption of the medium before, 1/mm.
    pub(crate) per_mm: T,
}

/// What is told from the directions of a ray before and behind a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Argument<T> {
    /// Their product.
    Product,
    /// The cosine in the medium of lower index, of a ray reflected in the one whose index is the square root of this times as great.
    LowCosine { ratio2: T },
}

impl<T: Real> LightPass<T> {
    /// A surface that does nothing to light, behind a medium that does not.
    pub(crate) const NOTHING: Self =
        Self { argument: Argument::Product, scale: T::ONE, offset: T::ZERO, series: None, per_mm: T::ZERO };

    /// A surface that leaves this share of light, however polarized.
    pub(crate) fn constant(share: T) -> Self {
        let series = Some([vec![share], Vec::new(), vec![share], Vec::new()]);
        Self { series, ..Self::NOTHING }
    }

    pub(super) fn is_nothing(&self) -> bool {
        self.series.is_none() && self.per_mm == T::ZERO
    }
}

/// The light along the rays of a batch, lists as long as whole groups of blocks.
#[derive(Clone, Debug)]
pub(crate) struct Lights<T> {
    n_rays: usize,
    /// Stokes's vector.
    power: Vec<T>,
    q: Vec<T>,
    u: Vec<T>,
    v: Vec<T>,
    /// The normal of the last plane of incidence, of any length.
    x: Vec<T>,
    y: Vec<T>,
    z: Vec<T>,
    /// Optical depth of the media passed.
    depth: Vec<T>,
}

impl<T: Real> Lights<T> {
    /// Returns unpolarized light of power 1 along so many rays.
    pub(crate) fn unpolarized(n_rays: usize) -> Self {
        let n = n_rays.next_multiple_of(LANES);
        let list = |value: T| vec![value; n];
        let none = || list(T::ZERO);
        Self {
            n_rays,
            power: list(T::ONE),
            q: none(),
            u: none(),
            v: none(),
            x: none(),
            y: none(),
            z: none(),
            depth: none(),
        }
    }

    pub(crate) fn n_rays(&self) -> usize {
        self.n_rays
    }

    /// Returns the share of a ray's light that is left.
    pub(crate) fn share(&self, ray: usize) -> f64 {
        let depth = self.depth[ray].to_f64();
        let power = self.power[ray].to_f64();
        if depth == 0.0 { power } else { power * (-depth).exp() }
    }

    /// Returns the same light in another precision.
    pub(crate) fn converted<U: Real>(&self) -> Lights<U> {
        let list = |list: &[T]| list.iter().map(|v| U::of(v.to_f64())).collect();
        Lights {
            n_rays: self.n_rays,
            power: list(&self.power),
            q: list(&self.q),
            u: list(&self.u),
            v: list(&self.v),
            x: list(&self.x),
            y: list(&self.y),
            z: list(&self.z),
            depth: list(&self.depth),
        }
    }

    /// Sees the light as rays do that are mirrored at the plane z = 0.
    pub(crate) fn mirror(&mut self) {
        self.z.iter_mut().for_each(|z| *z = -*z);
    }

    /// Sees the light in a turned frame.
    pub(super) fn turn(&mut self, rotation: &DMat3) {
        if *rotation == DMat3::IDENTITY {
            return;
        }
        for ((x, y), z) in self.x.iter_mut().zip(&mut self.y).zip(&mut self.z) {
            let turned = *rotation * DVec3::new(x.to_f64(), y.to_f64(), z.to_f64());
            (*x, *y, *z) = (T::of(turned.x), T::of(turned.y), T::of(turned.z));
        }
    }

    /// Takes the light of one ray through a surface: the way to it, and the directions before and behind.
    pub(crate) fn pass_one(&mut self, ray: usize, pass: &LightPass<T>, way: T, before: [T; 3], after: [T; 3]) {
        let at = |list: &[T]| [list[ray]];
        let mut one = Lane {
            power: at(&self.power),
            q: at(&self.q),
            u: at(&self.u),
            v: at(&self.v),
            normal: [at(&self.x), at(&self.y), at(&self.z)],
            depth: at(&self.depth),
        };
        one.pass(pass, &[way], &before.map(|v| [v]), &after.map(|v| [v]));
        let put = |list: &mut [T], [value]: [T; 1]| list[ray] = value;
        put(&mut self.power, one.power);
        put(&mut self.q, one.q);
        put(&mut self.u, one.u);
        put(&mut self.v, one.v);
        let [x, y, z] = one.normal;
        put(&mut self.x, x);
        put(&mut self.y, y);
        put(&mut self.z, z);
        put(&mut self.depth, one.depth);
    }

    fn load(&self, start: usize) -> Lane<T, LANES> {
        let at = |list: &[T]| -> [T; LANES] { std::array::from_fn(|i| list[start + i]) };
        Lane {
            power: at(&self.power),
            q: at(&self.q),
            u: at(&self.u),
            v: at(&self.v),
            normal: [at(&self.x), at(&self.y), at(&self.z)],
            depth: at(&self.depth),
        }
    }

    fn store(&mut self, start: usize, lane: &Lane<T, LANES>) {
        let put = |list: &mut [T], lanes: &[T; LANES]| list[start..start + LANES].copy_from_slice(lanes);
        put(&mut self.power, &lane.power);
        put(&mut self.q, &lane.q);
        put(&mut self.u, &lane.u);
        put(&mut self.v, &lane.v);
        put(&mut self.x, &lane.normal[0]);
        put(&mut self.y, &lane.normal[1]);
        put(&mut self.z, &lane.normal[2]);
        put(&mut self.depth, &lane.depth);
    }
}

/// The light of some rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lane<T, const N: usize> {
    pub(super) power: [T; N],
    q: [T; N],
    u: [T; N],
    v: [T; N],
    normal: [[T; N]; 3],
    depth: [T; N],
}

impl<T: Real, const N: usize> Lane<T, N> {
    /// Unpolarized light of power 1.
    pub(super) const UNPOLARIZED: Self = Self {
        power: [T::ONE; N],
        q: [T::ZERO; N],
        u: [T::ZERO; N],
        v: [T::ZERO; N],
        normal: [[T::ZERO; N]; 3],
        depth: [T::ZERO; N],
    };

    /// Takes the light through a surface.
    #[inline(always)]
    pub(super) fn pass(&mut self, pass: &LightPass<T>, way: &[T; N], before: &[[T; N]; 3], after: &[[T; N]; 3]) {
        if pass.per_mm != T::ZERO {
            for (depth, way) in self.depth.iter_mut().zip(way) {
                *depth += pass.per_mm * *way;
            }
        }
        let Some([sum, difference, real, imaginary]) = &pass.series else { return };
        // The angle by which the surface turns the ray says that of incidence.
        let mut x = [T::ZERO; N];
        for i in 0..N {
            x[i] = before[0][i] * after[0][i] + before[1][i] * after[1][i] + before[2][i] * after[2][i];
        }
        let mut is_total = [false; N];
        if let Argument::LowCosine { ratio2 } = pass.argument {
            for i in 0..N {
                let square = T::ONE - ratio2 * (T::HALF + T::HALF * x[i]);
                is_total[i] = square < T::ZERO;
                x[i] = if is_total[i] { T::ZERO } else { square }.sqrt();
            }
        }
        for x in &mut x {
            *x = *x * pass.scale + pass.offset;
        }
        let (mut a, mut b, mut c) = (series_at(sum, &x), series_at(difference, &x), series_at(real, &x));
        for i in 0..N {
            a[i] = if is_total[i] { T::ONE } else { a[i] };
            b[i] = if is_total[i] { T::ZERO } else { b[i] };
            c[i] = if is_total[i] { T::ONE } else { c[i] };
        }
        self.turn(before, after);
        for i in 0..N {
            let (power, q) = (self.power[i], self.q[i]);
            self.power[i] = a[i] * power + b[i] * q;
            self.q[i] = b[i] * power + a[i] * q;
        }
        if imaginary.is_empty() {
            for ((u, v), c) in self.u.iter_mut().zip(&mut self.v).zip(c) {
                *u = c * *u;
                *v = c * *v;
            }
        } else {
            let s = series_at(imaginary, &x);
            for i in 0..N {
                let (u, v) = (self.u[i], self.v[i]);
                self.u[i] = c[i] * u - s[i] * v;
                self.v[i] = s[i] * u + c[i] * v;
            }
        }
    }

    /// Returns the share of a ray's light that is left.
    pub(super) fn share(&self, i: usize) -> f64 {
        let (power, depth) = (self.power[i].to_f64(), self.depth[i].to_f64());
        if depth == 0.0 { power } else { power * (-depth).exp() }
    }

    /// Returns the share of a ray's light that media have left since it was as before.
    pub(super) fn clear_since(&self, before: &Self, i: usize) -> f64 {
        (before.depth[i] - self.depth[i]).to_f64().exp()
    }

    /// Sees the light in a frame mirrored at the plane z = 0, in which U and V turn the other way.
    pub(super) fn mirror(&mut self) {
        for list in [&mut self.normal[2], &mut self.u, &mut self.v] {
            list.iter_mut().for_each(|v| *v = -*v);
        }
    }

    /// Refers Q and U to the plane of incidence of a surface; where the light falls straight on it, to that of the surface before.
    #[inline(always)]
    fn turn(&mut self, before: &[[T; N]; 3], after: &[[T; N]; 3]) {
        let ([ax, ay, az], [bx, by, bz]) = (before, after);
        for i in 0..N {
            let x = ay[i] * bz[i] - az[i] * by[i];
            let y = az[i] * bx[i] - ax[i] * bz[i];
            let z = ax[i] * by[i] - ay[i] * bx[i];
            let [sx, sy, sz] = [self.normal[0][i], self.normal[1][i], self.normal[2][i]];
            let along = sx * x + sy * y + sz * z;
            let across = ax[i] * (sy * z - sz * y) + ay[i] * (sz * x - sx * z) + az[i] * (sx * y - sy * x);
            // Cosine and sine of twice the angle between both planes.
            let square = along * along + across * across;
            let is_turned = square > T::TINY;
            let over = T::ONE / if is_turned { square } else { T::ONE };
            let cos = if is_turned { (along * along - across * across) * over } else { T::ONE };
            let sin = if is_turned { T::TWO * along * across * over } else { T::ZERO };
            let (q, u) = (self.q[i], self.u[i]);
            self.q[i] = cos * q + sin * u;
            self.u[i] = cos * u - sin * q;
            let is_slanted = x * x + y * y + z * z > T::TINY;
            self.normal[0][i] = if is_slanted { x } else { sx };
            self.normal[1][i] = if is_slanted { y } else { sy };
            self.normal[2][i] = if is_slanted { z } else { sz };
        }
    }
}

/// Returns a Chebyshev series at some places, by Clenshaw's recurrence.
#[inline(always)]
fn series_at<T: Real, const N: usize>(coefficients: &[T], x: &[T; N]) -> [T; N] {
    let (mut next, mut after) = ([T::ZERO; N], [T::ZERO; N]);
    let Some((&constant, rest)) = coefficients.split_first() else { return next };
    let double: [T; N] = std::array::from_fn(|i| T::TWO * x[i]);
    for &coefficient in rest.iter().rev() {
        for i in 0..N {
            let here = double[i] * next[i] - after[i] + coefficient;
            after[i] = next[i];
            next[i] = here;
        }
    }
    std::array::from_fn(|i| x[i] * next[i] - after[i] + constant)
}

/// Traces rays as [`trace_batch`](super::trace_batch) does, and their light; a pass for each surface of the plan.
pub(crate) fn trace_light<T: Real>(
    plan: &Plan<T>,
    passes: &[LightPass<T>],
    mut rays: RaySlices<'_, T>,
    lights: &mut Lights<T>,
) {
    trace_blocks(plan, Goal::LastSurface, &mut rays, |surface, from, to, start| {
        let pass = &passes[surface];
        if !pass.is_nothing() {
            pass_blocks(pass, plan.passes[surface].shift, (from, to), (lights, start));
        }
    });
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
fn pass_blocks<T: Real>(
    pass: &LightPass<T>,
    shift: T,
    (from, to): (&[Block<T>], &[Block<T>]),
    (lights, start): (&mut Lights<T>, usize),
) {
    for (k, (from, to)) in from.iter().zip(to).enumerate() {
        let start = start + k * LANES;
        let mut lane = lights.load(start);
        pass_block(&mut lane, pass, shift, from, to);
        lights.store(start, &lane);
    }
}

/// Takes the light of blocks through a surface.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"), dispatcher = "direct")]
pub(super) fn pass_lanes<T: Real>(
    pass: &LightPass<T>,
    shift: T,
    (from, to): (&[Block<T>], &[Block<T>]),
    lanes: &mut [Lane<T, LANES>],
) {
    for ((from, to), lane) in from.iter().zip(to).zip(lanes) {
        pass_block(lane, pass, shift, from, to);
    }
}

/// Takes the light of a block through a surface.
#[inline(always)]
fn pass_block<T: Real>(lane: &mut Lane<T, LANES>, pass: &LightPass<T>, shift: T, from: &Block<T>, to: &Block<T>) {
    let before = [from.l, from.m, from.n];
    let mut way = [T::ZERO; LANES];
    if pass.per_mm != T::ZERO {
        for (i, way) in way.iter_mut().enumerate() {
            let [x, y, z] = [to.x[i] - from.x[i], to.y[i] - from.y[i], to.z[i] - (from.z[i] - shift)];
            *way = x * from.l[i] + y * from.m[i] + z * from.n[i];
        }
    }
    lane.pass(pass, &way, &before, &[to.l, to.m, to.n]);
}
