//! The rasters on which a layer is imaged: the film's, and coarser ones where the blur is wide.

use dioptric_psf::FilmMap;
use dioptric_scene::View;

use crate::{Film, sampler::Sampler};

/// The most samples of the scene a pixel of the film, each way.
const MOST_SAMPLES: usize = 16;

/// The same of a coarser raster: a blur holds thousands of its pixels, over which what is missed averages out.
const MOST_SAMPLES_OF_WIDE: usize = 8;

/// The pixels on which a layer, or a part of it, is imaged; they have the film's axis in their middle.
pub(crate) struct LayerRaster {
    pub(crate) film: Film,
    pub(crate) sampler: Sampler,
}

impl LayerRaster {
    /// Returns the factor for a blur: 1, or that with which its radius is at most `widest_px`, and more than half of that.
    pub(crate) fn factor_for(blur_px: f64, widest_px: f64) -> usize {
        let mut factor = 1;
        while blur_px > widest_px * factor as f64 {
            factor *= 2;
        }
        factor
    }

    /// Returns the raster of pixels `factor` times as wide as the film's, which reaches beyond its edges. `view` is
    /// that of the scene, with its rows and columns.
    pub(crate) fn new(film: &Film, factor: usize, view: (View, (usize, usize)), map: &FilmMap) -> Self {
        let n = |n: usize| if factor == 1 { n } else { n.div_ceil(factor) + 2 };
        let coarse = Film::centered(n(film.rows), n(film.columns), factor as f64 * film.pitch_um);
        let most = if factor == 1 { MOST_SAMPLES } else { MOST_SAMPLES_OF_WIDE };
        let sampler = Sampler::new(view, (&coarse, factor), map, most);
        Self { film: coarse, sampler }
    }
}
