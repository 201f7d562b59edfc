//! The kernel over a patch as a polynomial of the place.

use std::collections::BTreeMap;

use dioptric_spectrum::{Cancel, Cancelled};

use crate::{
    convolve::add_scaled,
    cost::Cost,
    knot_kernels::{KnotKernel, corner_spread_exceeds},
    patch::{Knot, LARGEST, Patch},
    rectangle::Rectangle,
};

/// The kernel over a cell: a sum of blocks of samples, each times a polynomial down and one across the cell.
pub(crate) struct Expansion {
    /// Where the samples lie about the reference point's.
    pub(crate) at: Rectangle,
    pub(crate) terms: Vec<Term>,
}

pub(crate) struct Term {
    /// Numbers of the polynomials.
    pub(crate) down: usize,
    pub(crate) across: usize,
    pub(crate) samples: Vec<f32>,
}

impl Expansion {
    /// Takes the kernels at the patch's knots. A term that changes no edge and no corner by more than `negligible_edge` is left out: at corners of patches
    /// what is left out shows alone.
    pub(crate) fn of(
        patch: &Patch,
        kernels: &BTreeMap<Knot, KnotKernel>,
        negligible_edge: f64,
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let at = Rectangle::around(patch.shares.iter().map(|(knot, _)| kernels[knot].at)).unwrap_or(Rectangle::PIXEL);
        let mut terms = vec![];
        for product in 0..9 {
            cancel.check()?;
            let (down, across) = (product / 3, product % 3);
            let mut samples = vec![0.0; at.len()];
            for (knot, shares) in patch.shares.iter().filter(|(_, shares)| shares[product] != 0.0) {
                kernels[knot].add_to(&mut samples, &at, shares[product]);
            }
            let largest = LARGEST[down] * LARGEST[across];
            if product == 0 || corner_spread_exceeds(&samples, at.columns, negligible_edge / largest) {
                terms.push(Term { down, across, samples });
            }
        }
        Ok(Self { at, terms })
    }

    /// The number of polynomials across the cell.
    pub(crate) fn n_across(&self) -> usize {
        1 + self.terms.iter().map(|term| term.across).max().unwrap_or(0)
    }

    /// What it takes to spread a patch by it.
    pub(crate) fn cost(&self) -> Cost {
        Cost { n_terms: self.terms.len(), n_across: self.n_across(), kernel_size: (self.at.rows, self.at.columns) }
    }

    /// Returns the kernel at a place down the cell, for each polynomial across it.
    pub(crate) fn at_row(&self, down: &[f32; 3], kernels: &mut [f32]) {
        kernels.fill(0.0);
        let n = self.at.len();
        for term in &self.terms {
            let factor = down[term.down];
            add_scaled(&mut kernels[term.across * n..][..n], factor, &term.samples);
        }
    }
}
