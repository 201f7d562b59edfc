//! The kernels of bands, kept as far as memory allows.

use std::{collections::BTreeMap, sync::Arc};

use crate::node_kernels::{LayerKernels, NodeKernel};

/// The kernels of a lens in one band, at the nodes of every depth layer.
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
        let pairs = self.by_layer.iter().zip(upper.by_layer.iter());
        Self { by_layer: Arc::new(pairs.map(|(lower, upper)| lower.mixed(upper, fraction)).collect()) }
    }
}

/// A band, and what a kernel of a point that shines was asked for there: place, depth and pitch, to the bit.
pub(crate) type PointKey = (usize, [u64; 4]);

/// Kernels of the bands at which they are computed, as many as the budget allows.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) budget_bytes: usize,
    pub(crate) size_bytes: usize,
    pub(crate) kernels: BTreeMap<usize, BandKernels>,
    pub(crate) of_points: BTreeMap<PointKey, Arc<NodeKernel>>,
}

impl Kept {
    /// Changes the budget, and drops kernels that do not fit into it.
    pub(crate) fn limit(&mut self, budget_bytes: usize) {
        let Self { kernels, .. } = std::mem::replace(self, Self { budget_bytes, ..Self::default() });
        kernels.iter().for_each(|(band, kernels)| self.keep(*band, kernels));
    }

    /// Keeps the kernels of a band, if they are not kept and there is room for them.
    pub(crate) fn keep(&mut self, band: usize, kernels: &BandKernels) {
        let size_bytes = self.size_bytes + kernels.size_bytes();
        if !self.kernels.contains_key(&band) && size_bytes <= self.budget_bytes {
            self.size_bytes = size_bytes;
            self.kernels.insert(band, kernels.clone());
        }
    }

    /// Keeps the kernel of a point, if there is room for it.
    pub(crate) fn keep_of_point(&mut self, key: PointKey, kernel: &Arc<NodeKernel>) {
        let size_bytes = self.size_bytes + size_of_val(kernel.samples.as_slice());
        if size_bytes <= self.budget_bytes && self.of_points.insert(key, kernel.clone()).is_none() {
            self.size_bytes = size_bytes;
        }
    }
}
