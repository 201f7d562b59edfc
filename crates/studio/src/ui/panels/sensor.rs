//! Film and sensor, and the sources of noise.

use dioptric_pipeline::{Camera, Crop, DualPixelSpec, FilmSpec, Photodiodes, SensorSpec};
use dioptric_sensor::{NoiseSource, NoiseSources, Sensor};
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, count, text, tick, with_choice_of_file},
    Desk, Wanted,
};
use crate::engine::Field;

/// How large the film is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FilmKind {
    Sensor,
    Field,
    Scene,
    Pixels,
}

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut named = match &camera.sensor {
        SensorSpec::BuiltIn(name) => name.clone(),
        SensorSpec::File(path) => path.display().to_string(),
    };
    let before = named.clone();
    let names: Vec<(String, &str)> = Sensor::built_in_names().map(|name| (name.to_owned(), name)).collect();
    choice(ui, "sensor", "A built-in sensor", &mut named, &names);
    let words = "A sensor file, or the name of a built-in sensor; files can be dropped on the window";
    let (typed, is_asked) =
        with_choice_of_file(ui, "Choose a sensor file", |ui| text(ui, "sensor file", words, &before));
    if is_asked {
        desk.ask_for(Wanted::Sensor);
    }
    named = typed.unwrap_or(named);
    if named != before {
        camera.sensor = SensorSpec::named(&named);
    }
    dual_pixel(ui, &mut camera.dual_pixel);
    desk.tell(ui, Field::Sensor, camera);
    film(ui, camera, desk);
    crop(ui, camera, desk);
    desk.tell(ui, Field::Film, camera);
}

/// Photodiodes that are read one by one, or whole pixels.
fn dual_pixel(ui: &mut Ui, spec: &mut Option<DualPixelSpec>) {
    let mut kind = spec.map(|spec| spec.photodiodes);
    let kinds = [
        (None, "whole pixels"),
        (Some(Photodiodes::LeftRight), "left and right"),
        (Some(Photodiodes::TopBottom), "top and bottom"),
        (Some(Photodiodes::Quad), "four"),
    ];
    let words = "Photodiodes below each microlens that are read one by one, each seeing a part of the pupil";
    if choice(ui, "photodiodes", words, &mut kind, &kinds) {
        *spec = kind
            .map(|photodiodes| spec.map_or(DualPixelSpec::of(photodiodes), |own| DualPixelSpec { photodiodes, ..own }));
    }
    if let Some(DualPixelSpec { crosstalk, transition_deg, .. }) = spec {
        let words = "Share of light from far on one side of the pupil that the photodiode of the other side gets";
        NumberField::even("crosstalk", "", 0.0..=0.5, 0.0..=0.5, words).show(ui, crosstalk);
        let words = "How soft the boundary between the sides is: standard deviation over the angle of incidence";
        NumberField::even("transition", "°", 0.0..=45.0, 0.0..=15.0, words).show(ui, transition_deg);
    }
}

/// Columns, rows and pitch of the whole film as it is, pixels and µm.
fn whole(desk: &Desk<'_>) -> (usize, usize, f64) {
    desk.product.map_or((960, 640, 33.0), |product| {
        let place = &product.capture.place;
        let [columns, rows] = product.film_size();
        (columns, rows, place.pixel_pitch_um())
    })
}

fn film(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut kind = match camera.film {
        FilmSpec::Sensor => FilmKind::Sensor,
        FilmSpec::Scene => FilmKind::Scene,
        FilmSpec::Field => FilmKind::Field,
        FilmSpec::Pixels { .. } => FilmKind::Pixels,
    };
    let kinds = [
        (FilmKind::Pixels, "own pixels"),
        (FilmKind::Sensor, "the sensor's pixels"),
        (FilmKind::Field, "the sensor's pixels that the scene covers"),
        (FilmKind::Scene, "a pixel a sample of the scene"),
    ];
    if choice(ui, "film", "How large the film is, and its pixels", &mut kind, &kinds) {
        camera.film = match kind {
            FilmKind::Sensor => FilmSpec::Sensor,
            FilmKind::Scene => FilmSpec::Scene,
            FilmKind::Field => FilmSpec::Field,
            FilmKind::Pixels => {
                let (columns, rows, pitch_um) = whole(desk);
                FilmSpec::Pixels { columns, rows, pitch_um }
            }
        };
    }
    if let FilmSpec::Pixels { columns, rows, pitch_um } = &mut camera.film {
        count(ui, "columns", "Columns of pixels", 1..=65_536, columns);
        count(ui, "rows", "Rows of pixels", 1..=65_536, rows);
        let words = "Distance between pixels";
        NumberField::by_factors("pixel pitch", "µm", 0.01..=1e5, 0.5..=100.0, words).show(ui, pitch_um);
    }
}

/// The part of the film that is simulated: at first its middle quarter.
fn crop(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut is_part = camera.crop.is_some();
    let words = "Simulates a part of the film, which has the pixels that it has in the whole";
    if tick(ui, "part of the film", words, &mut is_part) {
        let (columns, rows, _) = match camera.film {
            FilmSpec::Pixels { columns, rows, pitch_um } => (columns, rows, pitch_um),
            _ => whole(desk),
        };
        let (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
        camera.crop = is_part.then_some(Crop { x: columns / 2, y: rows / 2, columns, rows });
    }
    if let Some(Crop { x, y, columns, rows }) = &mut camera.crop {
        count(ui, "part from column", "The first column of the part, from 0", 0..=65_535, x);
        count(ui, "part from row", "The first row of the part, from 0", 0..=65_535, y);
        count(ui, "part columns", "Columns of the part", 1..=65_536, columns);
        count(ui, "part rows", "Rows of the part", 1..=65_536, rows);
    }
}

pub(super) fn noise(ui: &mut Ui, camera: &mut Camera) {
    let mut on: Vec<NoiseSource> =
        NoiseSource::NAMES.iter().map(|(_, source)| *source).filter(|source| camera.noise.has(*source)).collect();
    let before = on.clone();
    egui::Grid::new("noise").num_columns(2).show(ui, |ui| {
        for (i, (name, source)) in NoiseSource::NAMES.iter().enumerate() {
            let mut is_on = on.contains(source);
            if tick(ui, name, "Whether this source of noise is on", &mut is_on) {
                on.retain(|other| other != source);
                on.extend(is_on.then_some(*source));
            }
            if i % 2 == 1 {
                ui.end_row();
            }
        }
    });
    if on != before {
        camera.noise = NoiseSources::only(&on);
    }
    let mut seed = camera.seed as usize;
    if count(ui, "seed", "The seed of all noise: the same seed, the same noise", 0..=1_000_000, &mut seed) {
        camera.seed = seed as u64;
    }
}
