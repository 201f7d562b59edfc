//! What kernels that change over the film make of a uniform plane.

use crate::{
    knot_kernels::{LayerKernels, Moments},
    patch::{ONE, Patch, Products, Shares},
};

/// How much second moments are taken to make of a plane at most: the expansion holds while it is small.
pub(crate) const MOST_EXCESS: f64 = 0.2;

/// The least irradiance by which samples are divided.
pub(crate) const LEAST_RESPONSE: f32 = 0.1;

/// Returns the irradiance of a uniform plane of 1 under the kernels over a patch, to their second moments (docs/forward.md, eq. 5): of all knots, those
/// on its raster, whose factor is given, and those on others.
pub(crate) fn uniform_response(kernels: &LayerKernels, patch: &Patch, factor: usize) -> Products {
    UniformResponse::of(kernels, patch, factor).products()
}

/// The moments that it is made of.
struct UniformResponse {
    /// Of the second moments, all over the patch.
    excess: f64,
    /// First moments down and across, over the size of the cell: coefficients of the products of polynomials, down × across.
    down: [f64; 9],
    across: [f64; 9],
}

impl UniformResponse {
    fn of(kernels: &LayerKernels, patch: &Patch, factor: usize) -> Self {
        let mut sum = Self { excess: 0.0, down: [0.0; 9], across: [0.0; 9] };
        sum.add(kernels, &patch.shares, patch.cell.size as f64 / factor as f64);
        for (factor, shares) in &patch.elsewhere {
            sum.add(kernels, shares, patch.cell.size as f64 / *factor as f64);
        }
        sum.excess = sum.excess.clamp(-MOST_EXCESS, MOST_EXCESS);
        sum
    }

    /// Adds knots with kernels on a raster on which the cell has a size.
    fn add(&mut self, kernels: &LayerKernels, shares: &Shares, size: f64) {
        for (knot, shares) in shares {
            let Moments { first, second: [down, mixed, across] } = kernels.moments_at(*knot);
            let second = f64::from(shares[6]) * down + f64::from(shares[4]) * mixed + f64::from(shares[2]) * across;
            self.excess += second / (size * size);
            for (i, share) in shares.iter().enumerate() {
                self.down[i] += f64::from(*share) * first[0] / size;
                self.across[i] += f64::from(*share) * first[1] / size;
            }
        }
    }

    /// Returns the irradiance over the patch: products of polynomials.
    fn products(&self) -> Products {
        // The derivatives of the polynomials 1, u and u² − 1/12 are 0, 1 and 2u.
        let mut products = ONE;
        products[0] += self.excess as f32;
        for i in 0..3 {
            products[3 * i] -= self.across[3 * i + 1] as f32;
            products[3 * i + 1] -= 2.0 * self.across[3 * i + 2] as f32;
            products[i] -= self.down[3 + i] as f32;
            products[3 + i] -= 2.0 * self.down[6 + i] as f32;
        }
        products
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use crate::{
        knot_kernels::{KnotKernel, Symmetry},
        mesh::Mesh,
        patch::{Cell, Knot, polynomials, value_of},
        rectangle::Rectangle,
    };

    /// Kernels that move by a hundredth of a pixel each pixel to the right, and twice that down: a plane is that much darker.
    #[test]
    fn moving_kernels_thin_a_plane_out() {
        let mesh = Mesh { size: 64, added: BTreeSet::new() };
        let mut pieces = vec![];
        mesh.pieces_of(Cell { down: 1, across: -1, size: 64 }, &mut pieces);
        let (cell, shares) = pieces.remove(0);
        // Shares of a pixel's light on the pixels around it.
        let kernel = |knot: Knot| {
            let (right, down) = (0.01 * knot.right as f32, 0.02 * knot.down as f32);
            let mut samples = vec![0.0; 9];
            (samples[4], samples[5], samples[7]) = (1.0 - right - down, right, down);
            (knot, KnotKernel { at: Rectangle::PIXEL.grown(1), samples })
        };
        let by_knot: BTreeMap<Knot, KnotKernel> = shares.iter().map(|(knot, _)| kernel(*knot)).collect();
        let kernels = LayerKernels::new(Symmetry::None, by_knot);
        let patch = Patch { cell, is_by_knots: false, around: None, shares, elsewhere: vec![] };
        let response = uniform_response(&kernels, &patch, 1);
        for (v, u) in [(0.0, 0.0), (0.4, -0.3)] {
            let found = value_of(&response, &polynomials(v), &polynomials(u));
            assert!((found - 0.97).abs() < 1e-4, "{found}");
        }
    }
}
