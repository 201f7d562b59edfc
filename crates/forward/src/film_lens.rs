//! A lens at one wavelength over the layers of a film: its maps and its kernels.

use std::collections::BTreeMap;

use dioptric_psf::{FilmMap, LensImage, PsfQuery};
use dioptric_spectrum::Cancelled;
use rayon::prelude::*;

use crate::{
    Film,
    knot_kernels::KnotKernel,
    layers::Layers,
    patch::Knot,
    stopwatch::{Part, Stopwatch},
    work::Work,
};

/// A lens at one wavelength, its maps and kernels on the film.
pub(crate) struct FilmLens<'a> {
    pub(crate) image: &'a dyn LensImage,
    pub(crate) film: &'a Film,
    pub(crate) layers: &'a Layers,
    /// Of each layer.
    pub(crate) maps: &'a [FilmMap],
    pub(crate) wavelength_nm: f64,
    pub(crate) stopwatch: &'a Stopwatch,
}

impl FilmLens<'_> {
    /// Returns the kernel at a knot of a layer, on pixels so many times as wide as the film's.
    pub(crate) fn kernel(&self, layer: usize, knot: Knot, factor: usize) -> KnotKernel {
        let field_tan = knot.field_tan(&self.maps[layer], 1e-3 * self.film.pitch_um);
        let pitch_um = factor as f64 * self.film.pitch_um;
        let query = PsfQuery::new(field_tan, self.layers.dioptres()[layer], self.wavelength_nm, pitch_um);
        KnotKernel::new(&self.image.kernel(query))
    }

    /// Computes the kernels of canonical knots of a layer, each on pixels so many times as wide as the film's.
    pub(crate) fn layer_kernels(
        &self,
        layer: usize,
        knots: impl IntoIterator<Item = (Knot, usize)>,
        work: &Work<'_>,
    ) -> Result<BTreeMap<Knot, KnotKernel>, Cancelled> {
        let knots: Vec<(Knot, usize)> = knots.into_iter().collect();
        let computed = knots.into_par_iter().map(|(knot, factor)| {
            work.check()?;
            let kernel = self.stopwatch.time(Part::Kernels, || self.kernel(layer, knot, factor));
            work.advance(1);
            Ok((knot, kernel))
        });
        computed.collect()
    }

    /// Returns the largest spread of a point at a knot of a layer over some wavelengths, pixels of the film.
    pub(crate) fn spread_px(&self, layer: usize, knot: Knot, wavelengths_nm: &[f64]) -> f64 {
        let pitch_mm = 1e-3 * self.film.pitch_um;
        let field_tan = knot.field_tan(&self.maps[layer], pitch_mm);
        let spread_mm = |&wavelength_nm| self.image.spread_mm(field_tan, self.layers.dioptres()[layer], wavelength_nm);
        wavelengths_nm.iter().map(spread_mm).fold(0.0, f64::max) / pitch_mm
    }
}
