//! How much of the full work is done.

use dioptric_spectrum::{SpectrumError, WavelengthGrid};
use serde::{Deserialize, Serialize};

/// How finely a picture is simulated, from one that appears at once to the one that is kept.
///
/// A lower quality works on a film of fewer, larger samples, on fewer and wider bands, and from coarser samples of the lens,
/// whose error is not measured; each pixel keeps the electrons of a pixel of the full film, so that exposure, noise and
/// color are those of the full picture seen at every n-th pixel. What that costs in accuracy is measured in
/// docs/ARCHITECTURE.md.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Quality {
    /// At most 160 columns and 4 bands, and the coarsest bank: for each step of a hand that drags.
    Sketch,
    /// At most 480 columns and 5 bands, and a coarse bank: for changes while one looks.
    Preview,
    /// At most 960 columns and 11 bands.
    Draft,
    /// All samples and all bands, with the error of the bank.
    #[default]
    Full,
}

/// Columns of the still life that stand for more or fewer in previews and sketches.
const STILL_LIFE_COLUMNS: usize = 1080;

impl Quality {
    /// The most columns of a film and the most bands.
    fn most(self) -> Option<(usize, usize)> {
        match self {
            Self::Sketch => Some((160, 4)),
            Self::Preview => Some((480, 5)),
            Self::Draft => Some((960, 11)),
            Self::Full => None,
        }
    }

    /// Returns how many pixels of the full film are one, each way.
    pub fn film_binning(self, columns: usize) -> usize {
        self.most().map_or(1, |(most, _)| columns.div_ceil(most).max(1))
    }

    /// Returns how many samples of the full scene are one, each way: a scene is sampled a quarter finer than the film.
    pub(crate) fn scene_binning(self, columns: usize) -> usize {
        self.most().map_or(1, |(most, _)| (4 * columns).div_ceil(5 * most).max(1))
    }

    /// Returns the columns and rows that stand for those of the still life: all paintings of one shape that are fine enough for a preview or a sketch
    /// look alike there, so that a change of its size paints nothing.
    pub(crate) fn still_life_size(self, (columns, rows): (usize, usize)) -> (usize, usize) {
        match self.canvas_columns() {
            Some(least) if columns >= least => {
                let height = rows as f64 * STILL_LIFE_COLUMNS as f64 / columns as f64;
                (STILL_LIFE_COLUMNS, (height.round() as usize).max(1))
            }
            _ => (columns, rows),
        }
    }

    /// Returns the columns of the still life in a preview or a sketch, where it is fine enough.
    pub(crate) fn canvas_columns(self) -> Option<usize> {
        let is_coarse = matches!(self, Self::Preview | Self::Sketch);
        is_coarse.then(|| STILL_LIFE_COLUMNS / self.scene_binning(STILL_LIFE_COLUMNS))
    }

    /// Returns the bands that stand for those of the full picture: as many as it has, or fewer that cover its range evenly.
    pub(crate) fn bands_of(self, full: &WavelengthGrid) -> Result<WavelengthGrid, SpectrumError> {
        let Some((_, most)) = self.most().filter(|(_, most)| full.len() > *most) else { return Ok(full.clone()) };
        let (first_nm, last_nm) = full.range_nm();
        let widths_nm = full.widths_nm();
        let start_nm = first_nm - 0.5 * widths_nm[0];
        let width_nm = (last_nm + 0.5 * widths_nm[widths_nm.len() - 1] - start_nm) / most as f64;
        WavelengthGrid::new((0..most).map(|band| start_nm + width_nm * (band as f64 + 0.5)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_bands_cover_the_range_of_many() {
        let full = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let few = Quality::Preview.bands_of(&full).unwrap();
        assert_eq!((few.len(), few.range_nm()), (5, (426.0, 674.0)));
        assert!((few.widths_nm().iter().sum::<f64>() - 310.0).abs() < 1e-9);
        assert_eq!(Quality::Full.bands_of(&full).unwrap(), full);
    }

    #[test]
    fn full_quality_bins_nothing() {
        assert_eq!((Quality::Full.film_binning(9000), Quality::Preview.film_binning(960)), (1, 2));
        assert_eq!((Quality::Preview.scene_binning(1080), Quality::Draft.scene_binning(1080)), (2, 1));
    }

    #[test]
    fn still_lifes_of_one_shape_are_one_in_a_preview() {
        for size in [(1080, 720), (1200, 800), (4500, 3000), (540, 360)] {
            assert_eq!(Quality::Preview.still_life_size(size), (1080, 720));
            assert_eq!((Quality::Full.still_life_size(size), Quality::Draft.still_life_size(size)), (size, size));
        }
        // Of another shape, and coarser than a preview's own samples.
        assert_eq!(Quality::Preview.still_life_size((2000, 1000)), (1080, 540));
        assert_eq!(Quality::Preview.still_life_size((480, 320)), (480, 320));
        assert_eq!(Quality::Sketch.still_life_size((480, 320)), (1080, 720));
    }
}
