//! The surfaces of a scene, as samples that lie in layers of depth.

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

/// One surface of the scene: its layer coordinates, and its radiance in one band.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    /// As many samples as there are layer coordinates, row by row.
    pub(crate) radiance: &'a [f32],
    pub(crate) coordinates: &'a LayerCoordinates,
}

/// The layer coordinates of a surface.
pub(crate) struct LayerCoordinates {
    /// Rows and columns.
    size: (usize, usize),
    /// Row by row; NaN where the surface has no sample.
    samples: Vec<f32>,
    /// The layers that have weight in each square between four samples, first and last: most squares lie in few layers, so
    /// most of the work of a layer is to find that it has no part of a square.
    ranges: Vec<(u16, u16)>,
    is_flat: bool,
}

impl LayerCoordinates {
    /// Takes samples row by row.
    pub(crate) fn new(samples: Array2<f32>, cancel: &Cancel) -> Result<Self, Cancelled> {
        let (rows, columns) = samples.dim();
        let mut ranges = vec![(u16::MAX, 0); rows * columns];
        ranges.par_chunks_mut(columns).enumerate().try_for_each(|(top, line)| {
            cancel.check()?;
            let bottom = (top + 1).min(rows - 1);
            for (left, (first, last)) in line.iter_mut().enumerate() {
                let right = (left + 1).min(columns - 1);
                let corners = [(top, left), (top, right), (bottom, left), (bottom, right)].map(|at| samples[at]);
                for coordinate in corners.into_iter().filter(|coordinate| !coordinate.is_nan()) {
                    *first = (*first).min(coordinate as u16);
                    *last = (*last).max(coordinate.ceil() as u16);
                }
            }
            Ok(())
        })?;
        let is_flat = samples.iter().all(|coordinate| *coordinate == 0.0);
        Ok(Self { size: (rows, columns), samples: samples.into_iter().collect(), ranges, is_flat })
    }

    /// Rows and columns.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Whether all samples lie in the first layer and no other.
    pub(crate) fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// The coordinates row by row.
    pub(crate) fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// The first and last layer with weight in each square that begins at a sample, row by row.
    pub(crate) fn ranges(&self) -> &[(u16, u16)] {
        &self.ranges
    }

    /// The bytes of memory that they take.
    pub(crate) fn size_bytes(&self) -> usize {
        self.samples.len() * (size_of::<f32>() + size_of::<(u16, u16)>())
    }
}
