//! Aspheres: Newton's method from the conic, for a tile at once.
//!
//! Every lane stops for itself, so that a ray's result does not depend on its neighbours. The scalar twin uses the
//! same code with one lane.

use super::crossing::{Crossing, Ray, cross_conic};

/// Newton steps after which a ray is held to miss an asphere.
const NEWTON_STEPS: usize = 24;

/// A conic with powers of r added.
#[derive(Clone, Copy)]
pub(crate) struct Asphere<'a> {
    pub(crate) curvature: f64,
    pub(crate) conic: f64,
    pub(crate) powers: Powers<'a>,
}

/// The powers that an asphere adds to its conic.
#[derive(Clone, Copy)]
pub(crate) enum Powers<'a> {
    /// r², and the rest from r⁴ on.
    Even { a2: f64, rest: &'a [f64] },
    /// From r on.
    All(&'a [f64]),
}

/// Sag and gradient of an asphere below the points of a tile's rays.
struct Below<const N: usize> {
    sag: [f64; N],
    gx: [f64; N],
    gy: [f64; N],
}

impl Asphere<'_> {
    /// Crosses the asphere with each ray.
    ///
    /// Once a step is small the next would be of the order of its square: it has converged to rounding.
    #[inline(always)]
    pub(crate) fn cross<const N: usize>(self, rays: [Ray; N], alive: [bool; N]) -> [Crossing; N] {
        let mut t = [0.0; N];
        for i in 0..N {
            let start = cross_conic(self.curvature, self.conic, rays[i]);
            let is_start = start.is_front & (start.t.abs() < f64::INFINITY);
            t[i] = if is_start { start.t } else { -rays[i].z / rays[i].n };
        }
        let mut is_converged = [false; N];
        let mut is_open = alive;
        for _ in 0..NEWTON_STEPS {
            let below = self.below(&rays, &t);
            for i in 0..N {
                let ray = &rays[i];
                let step = (ray.z + ray.n * t[i] - below.sag[i]) / (ray.l * below.gx[i] + ray.m * below.gy[i] + ray.n);
                let next = t[i] - step;
                let is_small = step.abs() <= 1e-9 * (1.0 + next.abs());
                t[i] = if is_open[i] { next } else { t[i] };
                is_converged[i] |= is_open[i] & is_small;
                // A ray that has left the surface's domain has no step.
                is_open[i] &= !is_small & (step.abs() < f64::INFINITY);
            }
            if is_open.iter().fold(0, |any, &open| any | u8::from(open)) == 0 {
                break;
            }
        }
        let below = self.below(&rays, &t);
        std::array::from_fn(|i| {
            let (gx, gy) = (below.gx[i], below.gy[i]);
            let inverse = 1.0 / (gx * gx + gy * gy + 1.0).sqrt();
            let cos = (rays[i].l * gx + rays[i].m * gy + rays[i].n) * inverse;
            let normal = [gx * inverse, gy * inverse, inverse];
            Crossing { t: t[i], normal, cos, cos2: cos * cos, is_front: is_converged[i] & (cos > 0.0) }
        })
    }

    #[inline(always)]
    fn below<const N: usize>(self, rays: &[Ray; N], t: &[f64; N]) -> Below<N> {
        let (c, k1) = (self.curvature, 1.0 + self.conic);
        let (mut x, mut y, mut r2) = ([0.0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            x[i] = rays[i].x + rays[i].l * t[i];
            y[i] = rays[i].y + rays[i].m * t[i];
            r2[i] = x[i] * x[i] + y[i] * y[i];
        }
        let (bump, slope) = self.powers.at(&r2);
        let mut below = Below { sag: [0.0; N], gx: [0.0; N], gy: [0.0; N] };
        for i in 0..N {
            let root = (1.0 - k1 * c * c * r2[i]).sqrt();
            // The conic's slope is c r/root, its sag c r²/(1 + root): one division serves both.
            let shared = c / (root * (1.0 + root));
            let along = shared * (1.0 + root) + slope[i];
            below.sag[i] = shared * root * r2[i] + bump[i];
            below.gx[i] = -along * x[i];
            below.gy[i] = -along * y[i];
        }
        below
    }
}

impl Powers<'_> {
    /// Returns the added sag, and its slope over r, at these squared distances from the axis.
    #[inline(always)]
    fn at<const N: usize>(self, r2: &[f64; N]) -> ([f64; N], [f64; N]) {
        let (mut high, mut slope) = ([0.0; N], [0.0; N]);
        match self {
            Self::Even { a2, rest } => {
                for (power, a) in rest.iter().enumerate().rev() {
                    let derived = a * (2 * power + 4) as f64;
                    for i in 0..N {
                        high[i] = high[i] * r2[i] + a;
                        slope[i] = slope[i] * r2[i] + derived;
                    }
                }
                for i in 0..N {
                    high[i] = (high[i] * r2[i] + a2) * r2[i];
                    slope[i] = slope[i] * r2[i] + 2.0 * a2;
                }
            }
            Self::All(coefficients) => {
                let r = r2.map(f64::sqrt);
                for (power, a) in coefficients.iter().enumerate().rev() {
                    let derived = a * (power + 1) as f64;
                    for i in 0..N {
                        high[i] = high[i] * r[i] + a;
                        slope[i] = slope[i] * r[i] + derived;
                    }
                }
                for i in 0..N {
                    high[i] *= r[i];
                    // At the tip of a cone the normal is taken along the axis.
                    slope[i] = if r[i] > 0.0 { slope[i] / r[i] } else { 0.0 };
                }
            }
        }
        (high, slope)
    }
}
