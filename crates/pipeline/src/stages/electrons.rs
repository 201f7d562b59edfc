//! The mean rate of photo-electrons in each pixel.

use std::sync::Arc;

use dioptric_optics::{Lens, glam::DVec2};
use dioptric_sensor::{ElectronRate, ExitPupil, Illumination, PixelStack, Sensor};

use super::{Watch, film::FilmPlace, irradiance::Irradiance, lens::ResolvedLens, spec::ElectronInputs};
use crate::{Movements, PipelineError, Stage};

/// The mean rates of photo-electrons of a sensor.
#[derive(Debug)]
pub(crate) struct PixelRates {
    /// Those of whole pixels.
    pub(crate) whole: Arc<ElectronRate>,
    /// Those of the photodiodes that are read by themselves, whose sum the whole is; none of whole pixels.
    pub(crate) photodiodes: Vec<ElectronRate>,
}

/// Returns the sensor as its frames are developed: as it lies on the film, calibrated with the lens, with the noise of as many reads as the
/// samples of its frames are sums of.
pub(super) fn read_out(inputs: &ElectronInputs, place: &FilmPlace, lens: &ResolvedLens) -> Sensor {
    let sensor = lens.calibrated(on_film(&inputs.sensor, place));
    match inputs.irradiance.dual_pixel {
        Some(spec) => sensor.of_summed_reads(spec.photodiodes.names().len()),
        None => sensor,
    }
}

/// Returns the sensor as it lies on the film, behind the filters.
pub(super) fn exposed(inputs: &ElectronInputs, place: &FilmPlace) -> Sensor {
    on_film(&inputs.sensor, place).behind(&inputs.filters)
}

/// Returns the sensor as it lies on the film: its pixels are the film's samples, its mosaic that of the whole film.
pub(super) fn on_film(sensor: &Sensor, place: &FilmPlace) -> Sensor {
    let cfa = match place.part {
        Some(part) => sensor.cfa.from_pixel(part.first_row, part.first_column),
        None => sensor.cfa.clone(),
    };
    let sensor = sensor.with_pitch_um(place.pixel_pitch_um()).with_size(place.rows, place.columns);
    let DVec2 { x: right_mm, y: up_mm } = place.film().center_mm;
    let in_part = |stack: PixelStack| stack.seen_in_part([right_mm, -up_mm], place.binning);
    Sensor { cfa, pixel_stack: sensor.pixel_stack.map(in_part), ..sensor }
}

/// Returns where the light of the sensor's pixels comes from, if its responses depend on that.
pub(super) fn exit_pupil(sensor: &Sensor, place: &FilmPlace, lens: &ResolvedLens) -> Option<ExitPupil> {
    if !sensor.depends_on_angle() {
        return None;
    }
    // Pixels of a binned film are the full film's, farther apart: angles are those of the places they stand for.
    let closer = |mm: f64| mm / place.binning as f64;
    let f_number = if sensor.pixel_stack.is_some() { place.working_f_number(lens) } else { f64::INFINITY };
    Some(ExitPupil {
        distance_mm: closer(place.exit_pupil_distance_mm.unwrap_or(f64::INFINITY)),
        axis_mm: place.exit_pupil_axis_mm.map(closer),
        f_number,
    })
}

/// Returns a sentence on what the angles leave out at which light comes to a sensor that depends on them: the lens is what movements made of its file.
pub(super) fn note_on_angles(sensor: &Sensor, lens: &Lens, movements: Movements) -> Option<String> {
    // A rise and a shift of the whole lens are followed.
    let followed = usize::from(movements != Movements::default());
    let is_moved = lens.moves().len() > followed || lens.moves().iter().any(|part| part.tilt_deg != [0.0; 3]);
    let is_curved = lens.image_surface().curvature_per_mm != 0.0;
    let left_out = match (is_moved, is_curved) {
        _ if !sensor.depends_on_angle() => return None,
        (false, false) => return None,
        (true, false) => "tilts and decentered surfaces are",
        (false, true) => "the curvature of the film is",
        (true, true) => "tilts, decentered surfaces and the curvature of the film are",
    };
    Some(format!(
        "the pixels of {} depend on the angle of light, which is taken from an exit pupil on the lens's own axis and a flat film at right \
         angles to it: {left_out} left out",
        sensor.name
    ))
}

/// Collects the electrons of all bands; the pixels are one sample each.
pub(super) fn collect(
    irradiance: Arc<Irradiance>,
    sensor: Sensor,
    exit_pupil: Option<ExitPupil>,
    watch: &Watch<'_>,
) -> Result<PixelRates, PipelineError> {
    watch.progress.at(Stage::Sensor, 0.0);
    watch.run(move || {
        let rate = |irradiance: &Irradiance| {
            sensor.electron_rate(&Illumination { exit_pupil, ..Illumination::on_pixels(irradiance) })
        };
        let photodiodes = irradiance.photodiodes().iter().map(rate).collect::<Result<Vec<_>, _>>()?;
        let whole = match photodiodes.split_first() {
            None => rate(&irradiance)?,
            Some((first, others)) => {
                let mut sum = first.clone();
                let planes = others.iter().flat_map(|rate| rate.planes_e_per_s.iter().enumerate());
                planes.for_each(|(number, plane)| sum.planes_e_per_s[number] += plane);
                sum
            }
        };
        Ok(PixelRates { whole: Arc::new(whole), photodiodes })
    })
}
