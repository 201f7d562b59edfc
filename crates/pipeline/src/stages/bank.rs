//! The image of the lens, described from the film.

use dioptric_psf::{ImageSettings, LensImageModel};
use dioptric_spectrum::WavelengthGrid;

use super::{film::FilmPlace, lens::ResolvedLens, spec::BankInputs};
use crate::{PipelineError, Quality};

/// Rings and azimuths of the pupil's mesh for sketches: what one sees on pixels of several times the full ones.
const SKETCH: (usize, usize) = (5, 20);

/// Describes the lens at each band; what is asked of the film is traced then.
pub(super) fn build(
    inputs: &BankInputs,
    lens: &ResolvedLens,
    place: &FilmPlace,
    grid: &WavelengthGrid,
) -> Result<LensImageModel, PipelineError> {
    let settings = ImageSettings {
        reference_wavelength_nm: lens.reference.wavelength_nm(),
        ..ImageSettings::new(place.film_distance_mm, inputs.diffraction)
    };
    let settings = match inputs.film.geometry.quality {
        Quality::Full | Quality::Draft => settings,
        Quality::Preview => settings.for_preview(),
        Quality::Sketch => ImageSettings { n_rings: SKETCH.0, n_azimuths: SKETCH.1, ..settings },
    };
    let model = LensImageModel::new(&lens.lens, grid.centers_nm(), &settings)?;
    Ok(match &lens.psfs {
        Some(psfs) => model.with_psfs(psfs.array.clone())?,
        None => model,
    })
}
