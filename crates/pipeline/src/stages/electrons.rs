//! The mean rate of photo-electrons in each pixel.

use std::sync::Arc;

use dioptric_sensor::{ElectronRate, ExitPupil, Illumination, Sensor};

use super::{Watch, film::FilmPlace, irradiance::Irradiance};
use crate::{PipelineError, Stage};

/// Returns the sensor as it lies on the film: its pixels are the film's samples, its mosaic that of the whole film.
pub(super) fn on_film(sensor: &Sensor, place: &FilmPlace) -> Sensor {
    let cfa = match place.part {
        Some(part) => sensor.cfa.from_pixel(part.first_row, part.first_column),
        None => sensor.cfa.clone(),
    };
    Sensor { pixel_pitch_um: place.pixel_pitch_um(), cfa, ..sensor.clone().with_size(place.rows, place.columns) }
}

/// Returns where the light of the sensor's pixels comes from, if its responses depend on that.
pub(super) fn exit_pupil(sensor: &Sensor, place: &FilmPlace) -> Option<ExitPupil> {
    // Pixels of a binned film are the full film's, farther apart: angles are those of the places they stand for.
    let closer = |mm: f64| mm / place.binning as f64;
    let pupil = place.exit_pupil_distance_mm.filter(|_| !sensor.chief_ray_response.is_empty());
    pupil.map(|mm| ExitPupil { distance_mm: closer(mm), axis_mm: place.exit_pupil_axis_mm.map(closer) })
}

/// Collects the electrons of all bands; the pixels are one sample each.
pub(super) fn collect(
    irradiance: Arc<Irradiance>,
    sensor: Sensor,
    place: &FilmPlace,
    watch: &Watch<'_>,
) -> Result<ElectronRate, PipelineError> {
    watch.progress.at(Stage::Sensor, 0.0);
    let exit_pupil = exit_pupil(&sensor, place);
    watch.run(move || {
        let light = Illumination { exit_pupil, ..Illumination::on_pixels(&*irradiance) };
        Ok(sensor.electron_rate(&light)?)
    })
}
