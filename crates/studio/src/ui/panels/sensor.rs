//! Film, sensor, exposure, noise and processing.

use dioptric_pipeline::{
    Camera, FilmSpec, FramesSpec, SensorSpec, parse_white, with_analog_gain, with_auto_exposure, with_exposure_s,
};
use dioptric_sensor::{
    Brightness, Demosaic, ExposureControl, Highlights, NoiseSource, NoiseSources, Sensor, ToneCurve,
};
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, count, optional, text, wrong},
    Desk,
};
use crate::{engine::Field, session::white_word};

/// How large the film is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FilmKind {
    Sensor,
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
    if let Some(typed) = text(
        ui,
        "sensor file",
        "A sensor file, or the name of a built-in sensor; files can be dropped on the window",
        &before,
    ) {
        named = typed;
    }
    if named != before {
        camera.sensor = SensorSpec::named(&named);
    }
    desk.tell(ui, Field::Sensor, camera);
    film(ui, camera, desk);
    desk.tell(ui, Field::Film, camera);
}

fn film(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut kind = match camera.film {
        FilmSpec::Sensor => FilmKind::Sensor,
        FilmSpec::Scene => FilmKind::Scene,
        FilmSpec::Pixels { .. } => FilmKind::Pixels,
    };
    let kinds = [
        (FilmKind::Pixels, "own pixels"),
        (FilmKind::Sensor, "the sensor's pixels"),
        (FilmKind::Scene, "a pixel a sample of the scene"),
    ];
    if choice(ui, "film", "How large the film is, and its pixels", &mut kind, &kinds) {
        camera.film = match kind {
            FilmKind::Sensor => FilmSpec::Sensor,
            FilmKind::Scene => FilmSpec::Scene,
            FilmKind::Pixels => {
                let place = desk.product.map(|product| &product.capture.place);
                let (columns, rows, pitch_um) = place.map_or((960, 640, 33.0), |place| {
                    (place.columns * place.binning, place.rows * place.binning, place.pixel_pitch_um())
                });
                FilmSpec::Pixels { columns, rows, pitch_um }
            }
        };
    }
    if let FilmSpec::Pixels { columns, rows, pitch_um } = &mut camera.film {
        count(ui, "columns", "Columns of pixels", 1..=65_536, columns);
        count(ui, "rows", "Rows of pixels", 1..=65_536, rows);
        let field = NumberField {
            label: "pixel pitch",
            unit: "µm",
            range: 0.01..=1e5,
            slider: 0.5..=100.0,
            is_logarithmic: true,
            words: "Distance between pixels",
        };
        field.show(ui, pitch_um);
    }
}

pub(super) fn exposure(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let metered_s = desk.product.map_or(0.01, |product| product.statistics.exposure_time_s);
    let mut is_auto = matches!(camera.exposure, ExposureControl::Auto(_));
    if choice(ui, "exposure", "How the exposure is chosen", &mut is_auto, &[(true, "metered"), (false, "by hand")]) {
        camera.exposure = match is_auto {
            true => with_auto_exposure(camera.exposure),
            false => with_exposure_s(camera.exposure, three_digits(metered_s)),
        };
    }
    // Typing a time sets it by hand.
    let mut time_s = match camera.exposure {
        ExposureControl::Manual(exposure) => exposure.time_s,
        ExposureControl::Auto(_) => three_digits(metered_s),
    };
    let time = NumberField {
        label: "time",
        unit: "s",
        range: 0.0..=1e4,
        slider: 1e-5..=30.0,
        is_logarithmic: true,
        words: "How long the shutter is open; 0 is a bias frame",
    };
    if time.show(ui, &mut time_s) {
        camera.exposure = with_exposure_s(camera.exposure, time_s);
    }
    let mut gain = match camera.exposure {
        ExposureControl::Manual(exposure) => exposure.analog_gain,
        ExposureControl::Auto(auto) => auto.limit.analog_gain,
    };
    let field = NumberField {
        label: "gain",
        unit: "×",
        range: 1e-3..=1e4,
        slider: 1.0..=64.0,
        is_logarithmic: true,
        words: "Factor on the voltage after the pixel: the ISO speed over that of gain 1",
    };
    if field.show(ui, &mut gain) {
        camera.exposure = with_analog_gain(camera.exposure, gain);
    }
    let frames = [
        (FramesSpec::Single, "one"),
        (FramesSpec::Burst(8), "burst of 8"),
        (FramesSpec::MovingBurst { frames: 8, motion_px: 4.0 }, "burst of 8 by hand"),
        (FramesSpec::BracketStops(vec![-4.0, -2.0, 0.0]), "bracket −4, −2, 0"),
    ];
    choice(ui, "frames", "How many frames the picture is made of", &mut camera.frames, &frames);
    desk.tell(ui, Field::Exposure, camera);
}

fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

pub(super) fn noise(ui: &mut Ui, camera: &mut Camera) {
    let mut on: Vec<NoiseSource> =
        NoiseSource::NAMES.iter().map(|(_, source)| *source).filter(|source| camera.noise.has(*source)).collect();
    egui::Grid::new("noise").num_columns(2).show(ui, |ui| {
        for (i, (name, source)) in NoiseSource::NAMES.iter().enumerate() {
            let mut is_on = on.contains(source);
            if ui.checkbox(&mut is_on, *name).changed() {
                on.retain(|other| other != source);
                on.extend(is_on.then_some(*source));
            }
            if i % 2 == 1 {
                ui.end_row();
            }
        }
    });
    camera.noise = NoiseSources::only(&on);
    let mut seed = camera.seed as usize;
    if count(ui, "seed", "The seed of all noise: the same seed, the same noise", 0..=1_000_000, &mut seed) {
        camera.seed = seed as u64;
    }
}

pub(super) fn processing(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let processing = &mut camera.processing;
    let methods = Demosaic::NAMES.map(|(name, method)| (method, name));
    choice(ui, "demosaic", "How the missing colors are found", &mut processing.demosaic, &methods);
    let highlights = [(Highlights::Reconstruct, "rebuilt"), (Highlights::Clip, "clipped")];
    choice(ui, "highlights", "What becomes of light beyond saturation", &mut processing.highlights, &highlights);
    let field = NumberField {
        label: "denoising",
        unit: "",
        range: 0.0..=100.0,
        slider: 0.0..=2.0,
        is_logarithmic: false,
        words: "How much noise is taken out: 0 none, 0.5 what noise may be, more what texture may be too",
    };
    optional(ui, field, &mut processing.denoise, 0.5);
    let now = white_word(&processing.white).unwrap_or_else(|| "as in the file".to_owned());
    let id = ui.make_persistent_id("unknown white");
    let words = "What is made white: scene, none, gray-world, white-patch, shades-of-gray, gray-edge, patch:X,Y,W,H, or a light";
    if let Some(typed) = text(ui, "white", words, &now) {
        match parse_white(&typed) {
            Ok(white) => {
                processing.white = white;
                ui.data_mut(|data| data.remove_temp::<String>(id));
            }
            Err(error) => {
                ui.data_mut(|data| data.insert_temp(id, error.to_string()));
            }
        }
    }
    if let Some(words) = ui.data(|data| data.get_temp::<String>(id)) {
        wrong(ui, &words);
    }
    let brightness = [
        (Brightness::AsExposed, "as exposed"),
        (Brightness::Factor(2.0), "twice"),
        (Brightness::Factor(4.0), "four times"),
        (Brightness::Percentile { percent: 99.0, to: 0.9 }, "99 % of pixels below 0.9"),
    ];
    choice(ui, "brightness", "How bright the picture is made", &mut processing.brightness, &brightness);
    let curves = [
        (ToneCurve::Srgb, "sRGB"),
        (ToneCurve::Linear, "linear"),
        (ToneCurve::Gamma(0.6), "power of 0.6"),
        (ToneCurve::Filmic { contrast: 0.5 }, "filmic"),
    ];
    choice(ui, "curve", "The curve from light to codes", &mut processing.curve, &curves);
    desk.tell(ui, Field::Processing, camera);
}
