//! The whole way from a scene to the irradiance on the film, band by band, for one use.

use dioptric_psf::LensImage;
use dioptric_spectrum::Cancel;

use crate::{
    Film, ForwardError, ImagingSpec, Settings, Sink, Source,
    views::{Framed, Views},
    work::Watch,
};

/// Images a source through a lens: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
///
/// `progress` receives the fraction that is done, from 0 to 1. A few bands are worked on at once; the result does not
/// depend on the number of threads. Whoever images the same geometry again, or wants to cancel, makes an
/// [`ImagingPlan`](crate::ImagingPlan).
///
/// # Errors
/// When the parts of the source do not fit each other, when the lens is not known for its wavelengths or depths or
/// for the corner of the film, or when a band cannot be read or handed on.
pub fn render(
    source: &Source<'_>,
    lens: &dyn LensImage,
    film: &Film,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
    sink: &mut Sink<'_>,
) -> Result<(), ForwardError> {
    let spec = ImagingSpec { film: *film, grid: source.radiance.grid().clone(), settings: *settings };
    source.light().check(source.geometry().size(), &spec.grid)?;
    let cancel = Cancel::new();
    let framed = Framed { lens, center_mm: film.center_mm };
    let lens: &dyn LensImage = if film.is_centered() { lens } else { &framed };
    progress(0.0);
    // Planning takes about as long as a band.
    let planned = 1.0 / (1 + spec.grid.len()) as f64;
    let views = Views::of(lens, &source.geometry(), &spec, (progress, (0.0, planned)), &cancel)?;
    views.stream_from(0, lens, &source.light(), &Watch { progress, range: (planned, 1.0), cancel: &cancel }, sink)
}
