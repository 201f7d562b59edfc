//! Scenes imaged through a lens.

use dioptric_psf::LensImage;
use dioptric_scene::Scene;

use crate::{Film, ForwardError, Settings, Sink, Source, render};

/// Images a scene with depth through a lens: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
///
/// `progress` receives the fraction that is done, from 0 to 1. The result does not depend on the number of threads.
///
/// # Errors
/// When the scene has no depth or no view, when the lens's image does not cover its wavelengths or depths or the corner of
/// the film, or when a band cannot be handed on.
pub fn irradiance(
    scene: &Scene,
    lens: &dyn LensImage,
    film: &Film,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
    sink: &mut Sink<'_>,
) -> Result<(), ForwardError> {
    render(&Source::of_scene(scene)?, lens, film, settings, progress, sink)
}
