//! What imaging a band needs beside its light, computed at some bands and interpolated between them.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    knot_kernels::LayerKernels,
    occlusion::{AlphaBetween, LayerAlpha},
};

/// The kernels of a lens in one band, at the knots of every depth layer.
#[derive(Clone, Debug)]
pub struct BandKernels {
    pub(crate) by_layer: Arc<Vec<LayerKernels>>,
}

impl BandKernels {
    /// The number of kernels; those that mirror each other count once.
    pub fn n_kernels(&self) -> usize {
        self.by_layer.iter().map(LayerKernels::n_kernels).sum()
    }

    /// The bytes of memory that the samples of the kernels take.
    pub fn size_bytes(&self) -> usize {
        self.by_layer.iter().map(LayerKernels::size_bytes).sum()
    }

    /// Returns the kernels between two bands.
    pub(crate) fn mixed(&self, upper: &Self, fraction: f32) -> Self {
        // At its ends they are those of one band, no wider: sums of transforms of another size have another rounding.
        if fraction == 0.0 {
            return self.clone();
        }
        if fraction == 1.0 {
            return upper.clone();
        }
        let pairs = self.by_layer.iter().zip(upper.by_layer.iter());
        Self { by_layer: Arc::new(pairs.map(|(lower, upper)| lower.mixed(upper, fraction)).collect()) }
    }
}

/// What imaging a band needs beside its light: the kernels and, where layers hide each other, what each covers.
#[derive(Clone)]
pub(crate) struct BandBasis {
    pub(crate) kernels: BandKernels,
    pub(crate) alpha: Option<Arc<Vec<LayerAlpha>>>,
}

impl BandBasis {
    /// The bytes of memory that it takes.
    pub(crate) fn size_bytes(&self) -> usize {
        let alpha = self.alpha.iter().flat_map(|alpha| alpha.iter());
        self.kernels.size_bytes() + alpha.map(LayerAlpha::size_bytes).sum::<usize>()
    }
}

/// A band between two whose bases are known.
pub(crate) struct BasisBetween {
    pub(crate) kernels: BandKernels,
    lower: Option<Arc<Vec<LayerAlpha>>>,
    upper: Option<Arc<Vec<LayerAlpha>>>,
    fraction: f32,
}

impl BasisBetween {
    /// Returns the basis with these kernels a fraction of the way from one band to another.
    pub(crate) fn new(kernels: BandKernels, [lower, upper]: [&BandBasis; 2], fraction: f32) -> Self {
        Self { kernels, lower: lower.alpha.clone(), upper: upper.alpha.clone(), fraction }
    }

    /// The alpha of a layer, where layers hide each other.
    pub(crate) fn alpha(&self, layer: usize) -> Option<AlphaBetween<'_>> {
        let (lower, upper) = (self.lower.as_ref()?, self.upper.as_ref()?);
        Some(AlphaBetween { lower: &lower[layer], upper: &upper[layer], fraction: self.fraction })
    }
}

/// Kernels and alpha of the bands at which they are computed, as many as the budget allows.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) budget_bytes: usize,
    pub(crate) size_bytes: usize,
    pub(crate) kernels: BTreeMap<usize, BandKernels>,
    pub(crate) alpha: BTreeMap<usize, Arc<Vec<LayerAlpha>>>,
}

impl Kept {
    /// Changes the budget, and drops alpha and kernels that do not fit into it.
    pub(crate) fn limit(&mut self, budget_bytes: usize) {
        let Self { kernels, .. } = std::mem::replace(self, Self { budget_bytes, ..Self::default() });
        for (band, kernels) in kernels {
            self.keep(band, &kernels);
        }
    }

    /// Keeps the kernels of a band, if they are not kept and there is room for them.
    pub(crate) fn keep(&mut self, band: usize, kernels: &BandKernels) {
        if !self.kernels.contains_key(&band) && self.takes(kernels.size_bytes()) {
            self.kernels.insert(band, kernels.clone());
        }
    }

    /// Whether there is room for so many more bytes; if so, they count as taken.
    pub(crate) fn takes(&mut self, size_bytes: usize) -> bool {
        let fits = self.size_bytes + size_bytes <= self.budget_bytes;
        if fits {
            self.size_bytes += size_bytes;
        }
        fits
    }
}
