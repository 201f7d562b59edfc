//! The mean rate of photo-electrons in each pixel.

use dioptric_sensor::{ElectronRate, Illumination, Sensor};

use super::{Watch, film::FilmPlace, irradiance::Irradiance};
use crate::{PipelineError, Stage};

/// Returns the sensor as it lies on the film: its pixels are the film's samples.
pub(super) fn on_film(sensor: &Sensor, place: &FilmPlace) -> Sensor {
    Sensor { pixel_pitch_um: place.pixel_pitch_um(), ..sensor.clone().with_size(place.rows, place.columns) }
}

/// Collects the electrons of all bands; the pixels are one sample each.
pub(super) fn collect(
    irradiance: &Irradiance,
    sensor: &Sensor,
    place: &FilmPlace,
    watch: &Watch<'_>,
) -> Result<ElectronRate, PipelineError> {
    watch.progress.at(Stage::Sensor, 0.0);
    watch.cancel.check()?;
    let light = Illumination {
        // Pixels of a binned film are the full film's, farther apart: angles are those of the places they stand for.
        exit_pupil_distance_mm: place.exit_pupil_distance_mm.map(|mm| mm / place.binning as f64),
        ..Illumination::on_pixels(irradiance)
    };
    Ok(sensor.electron_rate(&light)?)
}
