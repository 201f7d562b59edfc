//! The image of the lens, over the fields, depths and wavelengths that the scene and the film need.

use dioptric_forward::PsfDomain;
use dioptric_psf::{LensImageModel, SampleCounts};
use dioptric_spectrum::WavelengthGrid;

use super::{Watch, film::FilmPlace, lens::ResolvedLens, spec::BankInputs};
use crate::{PipelineError, Quality, Stage};

/// For sketches: what one sees on pixels of several times the full ones.
const SKETCH: SampleCounts =
    SampleCounts { n_radial: 4, n_grid: 3, n_depths: 2, n_wavelengths: 2, n_rings: 5, n_azimuths: 20 };

/// Traces the model; its error is measured for a full picture alone.
pub(super) fn build(
    inputs: &BankInputs,
    lens: &ResolvedLens,
    place: &FilmPlace,
    depth_range_m: (f64, f64),
    grid: &WavelengthGrid,
    watch: &Watch<'_>,
) -> Result<LensImageModel, PipelineError> {
    let domain = PsfDomain {
        lens: &lens.lens,
        film: &place.film(),
        film_distance_mm: place.film_distance_mm,
        depth_range_m,
        grid,
        diffraction: inputs.diffraction,
    };
    let standard = domain.settings()?;
    let progress = |fraction| watch.progress.at(Stage::Lens, fraction);
    let settings = match inputs.film.geometry.quality {
        Quality::Full => {
            return inputs.bank.build(&lens.lens, standard, place.pitch_um, &progress, watch.cancel);
        }
        Quality::Draft => standard,
        Quality::Sketch => standard.with_counts(SKETCH),
        Quality::Preview => standard.with_counts(SampleCounts::PREVIEW),
    };
    Ok(LensImageModel::build_with(&lens.lens, &settings, &progress, watch.cancel)?)
}
