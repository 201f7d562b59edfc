//! Aspheres: Newton's method from the conic, for a block of lanes at once.
//!
//! Every lane stops for itself, so that a ray's result does not depend on its neighbors. The scalar twin uses the
//! same code with one lane.

use super::{
    block::Block,
    crossing::{ConicForm, Crossing, Interface, Ray, conic_distance, refract},
    kernel::{Optic, pass_lanes},
    real::Real,
};

/// Newton steps after which a ray is held to miss an asphere.
const NEWTON_STEPS: usize = 24;

/// A conic with powers of r added.
#[derive(Clone, Debug)]
pub(super) struct Asphere<T, P> {
    pub(super) base: ConicForm<T>,
    pub(super) powers: P,
    pub(super) interface: Interface<T>,
}

/// The powers of r that an asphere adds to its conic.
pub(super) trait Powers<T> {
    /// Returns the added sag, and its slope over r, at this squared distance from the axis.
    fn at(&self, r2: T) -> (T, T);
}

/// Even powers, from r² on. A fixed number of them, so that the compiler unrolls the sum.
#[derive(Clone, Debug)]
pub(super) struct EvenPowers<T, const M: usize>(pub(super) [T; M]);

/// All powers, from r on.
#[derive(Clone, Debug)]
pub(super) struct AllPowers<T, const M: usize>(pub(super) [T; M]);

/// All powers, from r on, as many as there are: right for any number, but lane by lane.
#[derive(Clone, Debug)]
pub(super) struct ManyPowers<T>(pub(super) Vec<T>);

/// Returns a polynomial and its derivative by Horner's rule.
#[inline(always)]
fn horner<T: Real>(coefficients: &[T], u: T) -> (T, T) {
    let (mut value, mut derivative) = (T::ZERO, T::ZERO);
    for &a in coefficients.iter().rev() {
        derivative = derivative * u + value;
        value = value * u + a;
    }
    (value, derivative)
}

/// Returns sag and slope over r of the powers of r whose sum over r is this polynomial of r.
#[inline(always)]
fn from_first<T: Real>(coefficients: &[T], r2: T) -> (T, T) {
    let r = r2.sqrt();
    let (value, derivative) = horner(coefficients, r);
    // At the tip of a cone the normal is taken along the axis.
    let slope = if r > T::ZERO { value / r } else { T::ZERO };
    (value * r, slope + derivative)
}

impl<T: Real, const M: usize> Powers<T> for EvenPowers<T, M> {
    #[inline(always)]
    fn at(&self, r2: T) -> (T, T) {
        let (value, derivative) = horner(&self.0, r2);
        (value * r2, T::TWO * (value + derivative * r2))
    }
}

impl<T: Real, const M: usize> Powers<T> for AllPowers<T, M> {
    #[inline(always)]
    fn at(&self, r2: T) -> (T, T) {
        from_first(&self.0, r2)
    }
}

impl<T: Real> Powers<T> for ManyPowers<T> {
    #[inline(always)]
    fn at(&self, r2: T) -> (T, T) {
        from_first(&self.0, r2)
    }
}

/// What an asphere is like below a point of a ray.
struct Below<T> {
    x: T,
    y: T,
    r2: T,
    /// √(1 − (1 + conic) c² r²): the conic's sag is c r²/(1 + root) and its slope c r/root.
    root: T,
    bump: T,
    /// Slope over r, times the root.
    along: T,
}

impl<T: Real, P: Powers<T>> Asphere<T, P> {
    #[inline(always)]
    fn below(&self, ray: &Ray<T>, t: T) -> Below<T> {
        let &ConicForm { c, c2k1, .. } = &self.base;
        let (x, y) = (ray.x + ray.l * t, ray.y + ray.m * t);
        let r2 = x * x + y * y;
        let root = (T::ONE - c2k1 * r2).sqrt();
        let (bump, slope) = self.powers.at(r2);
        Below { x, y, r2, root, bump, along: c + slope * root }
    }

    /// Where Newton's method starts: on the conic, or on the vertex plane for rays that miss it.
    #[inline(always)]
    fn start(&self, ray: &Ray<T>) -> T {
        let (t, _) = conic_distance(&self.base, ray);
        let is_front = T::ONE - self.base.ck1 * (ray.z + ray.n * t) > T::ZERO;
        if is_front & (t.abs() < T::INFINITY) { t } else { -ray.z / ray.n }
    }

    /// The step from `t` towards the crossing: height over its rate, both times (1 + root) root, which leaves a
    /// single division.
    #[inline(always)]
    fn step(&self, ray: &Ray<T>, t: T) -> T {
        let Below { x, y, r2, root, bump, along } = self.below(ray, t);
        let beyond = T::ONE + root;
        let height = ((ray.z + ray.n * t - bump) * beyond - self.base.c * r2) * root;
        let rate = (ray.n * root - along * (x * ray.l + y * ray.m)) * beyond;
        height / rate
    }

    /// Returns the crossing at a distance that is known.
    #[inline(always)]
    fn crossing(&self, ray: &Ray<T>, t: T, is_found: bool) -> Crossing<T> {
        let Below { x, y, root, along, .. } = self.below(ray, t);
        // The gradient, times the root.
        let (gx, gy) = (-along * x, -along * y);
        let inverse = T::ONE / (gx * gx + gy * gy + root * root).sqrt();
        let normal = [gx * inverse, gy * inverse, root * inverse];
        let cos = ray.l * normal[0] + ray.m * normal[1] + ray.n * normal[2];
        let is_front = is_found & (cos > T::ZERO) & (root > T::ZERO);
        Crossing { t, normal, cos, cos2: cos * cos, is_front }
    }
}

impl<T: Real, P: Powers<T>> Optic<T> for Asphere<T, P> {
    /// Once a step is small the next would be of the order of its square: the ray has converged to rounding.
    #[inline(always)]
    fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        let mut t = [T::ZERO; N];
        for (i, t) in t.iter_mut().enumerate() {
            *t = self.start(&from.ray(i, shift));
        }
        let (mut found, mut open) = ([T::NO; N], from.alive);
        for _ in 0..NEWTON_STEPS {
            let mut any = T::NO;
            for i in 0..N {
                let step = self.step(&from.ray(i, shift), t[i]);
                let next = t[i] - step;
                let is_small = T::mask(step.abs() <= T::SMALL_STEP * (T::ONE + next.abs()));
                t[i] = if open[i] == T::NO { t[i] } else { next };
                found[i] = found[i] | (open[i] & is_small);
                // A ray that has left the surface's domain has no step.
                open[i] = open[i] & !is_small & T::mask(step.abs() < T::INFINITY);
                any = any | open[i];
            }
            if any == T::NO {
                break;
            }
        }
        pass_lanes(shift, from, to, |i, ray| {
            refract(&self.interface, ray, &self.crossing(ray, t[i], found[i] != T::NO))
        });
    }
}
