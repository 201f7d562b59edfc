//! The lens: which, how far open, focused where, turned and moved how.

use std::path::{Path, PathBuf};

use dioptric_optics::Lens;
use dioptric_pipeline::{
    Camera, CoatingSpec, FocusSpec, GlassRange, Iris, LensReadOptions, LensSpec, MissingGlass, SeqNumbers, StopSpec,
};
use egui::{CollapsingHeader, Ui};

use super::{
    super::fields::{NumberField, choice, count, optional, text, with_choice_of_file},
    Desk, Wanted, focus_plane, lens_drawing, surfaces,
};
use crate::engine::Field;

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    which(ui, camera, desk);
    desk.tell(ui, Field::Lens, camera);
    if let Some(product) = desk.product {
        lens_drawing::show(ui, camera, product, desk.stamp);
        focus_plane::show(ui, camera, product, desk.stamp);
    }
    surfaces::show(ui, camera, desk);
    psf_file(ui, camera);
    stop(ui, camera, desk);
    desk.tell(ui, Field::Stop, camera);
    focus(ui, camera, desk);
    desk.tell(ui, Field::Focus, camera);
}

fn which(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut named = match camera.lens.base() {
        LensSpec::Thin { .. } => "thin".to_owned(),
        LensSpec::Pinhole { .. } => "pinhole".to_owned(),
        other => other.text().unwrap_or_else(|| "changed".to_owned()),
    };
    let is_text = camera.lens.base().text().is_some();
    let before = named.clone();
    let mut names: Vec<(String, &str)> = Lens::built_in_names().map(|name| (name.to_owned(), name)).collect();
    names.extend([("thin".to_owned(), "ideal thin lens"), ("pinhole".to_owned(), "pinhole")]);
    choice(ui, "lens", "A built-in lens, an ideal one, or a pinhole", &mut named, &names);
    if is_text {
        let words =
            "A lens file, the name of a built-in lens, or an eye as eye:FILE:3mm; files can be dropped on the window";
        let (typed, is_asked) =
            with_choice_of_file(ui, "Choose a lens file", |ui| text(ui, "lens file", words, &before));
        if is_asked {
            desk.ask_for(Wanted::Lens);
        }
        named = typed.unwrap_or(named);
    }
    if named != before {
        take_lens(camera, lens_of(&named));
    }
    if matches!(camera.lens.base(), LensSpec::File(_)) {
        CollapsingHeader::new("What the file leaves open").show(ui, |ui| reading(ui, &mut camera.lens_reading));
    }
    match &mut camera.lens {
        LensSpec::Thin { focal_length_mm, diameter_mm } => {
            millimetres("focal length", "Focal length of the thin lens", 1.0..=500.0).show(ui, focal_length_mm);
            millimetres("diameter", "Diameter of its rim, which is the stop", 0.01..=200.0).show(ui, diameter_mm);
        }
        LensSpec::Pinhole { diameter_mm } => {
            millimetres("diameter", "Diameter of the hole", 0.01..=5.0).show(ui, diameter_mm);
        }
        LensSpec::MeasuredEye { pupil_mm, .. } => {
            millimetres("pupil", "Diameter of the pupil that the coefficients are of", 1.0..=8.0).show(ui, pupil_mm);
        }
        LensSpec::BuiltIn(_) | LensSpec::File(_) | LensSpec::Changed { .. } => {}
    }
}

/// A file of point spread functions in place of those of the lens.
fn psf_file(ui: &mut Ui, camera: &mut Camera) {
    let now = camera.psfs.as_deref().unwrap_or(Path::new("")).display().to_string();
    let words = "A file (.npz) of point spread functions that blur in place of those of the lens, at every focus and \
                 f-number; empty for the lens's own";
    if let Some(typed) = text(ui, "PSF file", words, &now) {
        camera.psfs = (!typed.is_empty()).then(|| PathBuf::from(typed));
    }
}

/// Returns the lens of a name, a path, or one of the two that are made of numbers.
fn lens_of(named: &str) -> LensSpec {
    match named {
        "thin" => LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 12.5 },
        "pinhole" => LensSpec::Pinhole { diameter_mm: 0.3 },
        other => LensSpec::named(other),
    }
}

/// Puts another lens on the camera; stop and glasses of the one before meant that one.
pub(in crate::ui) fn take_lens(camera: &mut Camera, lens: LensSpec) {
    if let LensSpec::Pinhole { .. } = lens {
        camera.focus = FocusSpec::FilmMm(50.0);
    }
    (camera.lens, camera.stop, camera.lens_reading) = (lens, StopSpec::AsGiven, LensReadOptions::default());
    camera.iris = None;
}

fn millimetres<'a>(label: &'a str, words: &'a str, slider: std::ops::RangeInclusive<f64>) -> NumberField<'a> {
    NumberField { label, unit: "mm", range: 1e-4..=1e6, slider, is_logarithmic: true, words }
}

/// How the stop is stated.
#[derive(Clone, Copy, PartialEq, Eq)]
enum StopKind {
    AsGiven,
    FNumber,
    Diameter,
}

fn stop(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let lens = desk.product.map(|product| &product.capture.lens);
    let f_number = lens.map_or(4.0, |lens| lens.reference.first_order().f_number.abs());
    let diameter_mm = lens.map_or(10.0, |lens| 2.0 * lens.lens.stop_semi_aperture_mm());
    let mut kind = match camera.stop {
        StopSpec::AsGiven => StopKind::AsGiven,
        StopSpec::FNumber(_) => StopKind::FNumber,
        StopSpec::DiameterMm(_) => StopKind::Diameter,
    };
    let kinds =
        [(StopKind::AsGiven, "the lens's own"), (StopKind::FNumber, "f-number"), (StopKind::Diameter, "diameter")];
    if choice(ui, "stop", "How far the stop is open", &mut kind, &kinds) {
        camera.stop = match kind {
            StopKind::AsGiven => StopSpec::AsGiven,
            StopKind::FNumber => StopSpec::FNumber((100.0 * f_number).ceil() / 100.0),
            StopKind::Diameter => StopSpec::DiameterMm((1000.0 * diameter_mm).floor() / 1000.0),
        };
    }
    // The f-number is there however the stop is stated; typing one states it so.
    let mut number = match camera.stop {
        StopSpec::FNumber(n) => n,
        _ => (100.0 * f_number).round() / 100.0,
    };
    let field = NumberField {
        label: "f-number",
        unit: "",
        range: 0.1..=1000.0,
        slider: 1.0..=64.0,
        is_logarithmic: true,
        words: "Focal length over the diameter of the entrance pupil, for a far object, at the main wavelength of the lens, else at 550 nm",
    };
    if field.show(ui, &mut number) {
        camera.stop = StopSpec::FNumber(number);
    }
    if let StopSpec::DiameterMm(mm) = &mut camera.stop {
        millimetres("diameter of stop", "Diameter of the stop", 0.01..=100.0).show(ui, mm);
    }
    iris(ui, camera);
}

fn iris(ui: &mut Ui, camera: &mut Camera) {
    let mut has_blades = camera.iris.is_some();
    let kinds = [(false, "the lens's own"), (true, "blades")];
    if choice(
        ui,
        "iris",
        "What closes the stop: what the lens's file says, else a round hole; or blades",
        &mut has_blades,
        &kinds,
    ) {
        camera.iris = has_blades.then_some(Iris { blades: 6, rotation_deg: 0.0, curvature: 0.0 });
    }
    let Some(Iris { blades, rotation_deg, curvature }) = &mut camera.iris else { return };
    let field = |label, unit, range: std::ops::RangeInclusive<f64>, slider, words| NumberField {
        label,
        unit,
        range,
        slider,
        is_logarithmic: false,
        words,
    };
    let mut n = f64::from(*blades);
    if field("blades", "", 3.0..=64.0, 3.0..=18.0, "How many blades close the stop").show(ui, &mut n) {
        *blades = n.round() as u32;
    }
    field("rotation", "°", -360.0..=360.0, 0.0..=120.0, "Turn of the opening from one with a corner at its top")
        .show(ui, rotation_deg);
    field("curvature", "", 0.0..=1.0, 0.0..=1.0, "Of the blades' edges: 0 straight, 1 as the rim").show(ui, curvature);
}

/// How the film is placed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FocusKind {
    Distance,
    Film,
    Near,
}

fn focus(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let place = desk.product.map(|product| &product.capture.place);
    let distance_mm = place.and_then(|place| place.focus_distance_mm).unwrap_or(1000.0);
    let film_mm = place.map_or(50.0, |place| place.film_distance_mm);
    let mut kind = match camera.focus {
        FocusSpec::DistanceMm(_) => FocusKind::Distance,
        FocusSpec::FilmMm(_) => FocusKind::Film,
        FocusSpec::NearObject => FocusKind::Near,
    };
    let kinds = [
        (FocusKind::Distance, "on a distance"),
        (FocusKind::Film, "by the film's place"),
        (FocusKind::Near, "on what is near"),
    ];
    if choice(ui, "focus", "How the film is placed; a click into the picture focuses there", &mut kind, &kinds) {
        camera.focus = match kind {
            FocusKind::Distance => FocusSpec::DistanceMm(distance_mm.round()),
            FocusKind::Film => FocusSpec::FilmMm((1e4 * film_mm).round() / 1e4),
            FocusKind::Near => FocusSpec::NearObject,
        };
    }
    match &mut camera.focus {
        FocusSpec::FilmMm(mm) => {
            let field = NumberField {
                label: "film distance",
                unit: "mm",
                range: -1e5..=1e5,
                slider: 0.9 * film_mm..=1.15 * film_mm,
                is_logarithmic: false,
                words: "Distance of the film behind the last vertex",
            };
            field.show(ui, mm);
        }
        focus => {
            // As above: typing a distance focuses there.
            let mut mm = match focus {
                FocusSpec::DistanceMm(mm) => *mm,
                _ => distance_mm.round(),
            };
            let field = NumberField {
                label: "distance",
                unit: "mm",
                range: 1e-3..=f64::INFINITY,
                slider: 100.0..=20_000.0,
                is_logarithmic: true,
                words: "Distance before the first vertex that is in focus; inf for a far one",
            };
            if field.show(ui, &mut mm) {
                *focus = FocusSpec::DistanceMm(mm);
            }
        }
    }
}

pub(super) fn movements(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let movements = &mut camera.movements;
    let turn = |label, words| NumberField {
        label,
        unit: "°",
        range: -60.0..=60.0,
        slider: -12.0..=12.0,
        is_logarithmic: false,
        words,
    };
    turn("tilt", "Turn about the horizontal; above 0 the lens looks down").show(ui, &mut movements.tilt_deg);
    turn("swing", "Turn about the vertical; above 0 the lens looks to the right").show(ui, &mut movements.swing_deg);
    let shift = |label, words| NumberField {
        label,
        unit: "mm",
        range: -1000.0..=1000.0,
        slider: -10.0..=10.0,
        is_logarithmic: false,
        words,
    };
    shift("rise", "How far the lens is moved up").show(ui, &mut movements.rise_mm);
    shift("shift", "How far the lens is moved to the right").show(ui, &mut movements.shift_mm);
    desk.tell(ui, Field::Movements, camera);
}

/// What the lens's file leaves open.
fn reading(ui: &mut Ui, reading: &mut LensReadOptions) {
    let mut number = reading.configuration.unwrap_or(0);
    let words = "Which position of a zoom lens, or other configuration of the file, counted from 1; 0 for the one that it has in use";
    if count(ui, "configuration", words, 0..=100, &mut number) {
        reading.configuration = (number > 0).then_some(number);
    }
    let now = reading.glasses.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join("; ");
    let words = "Glass catalogues (.agf, .yml) to look in before the built-in one, with semicolons between them";
    if let Some(typed) = text(ui, "catalogues", words, &now) {
        let paths = typed.split(';').map(str::trim).filter(|path| !path.is_empty());
        reading.glasses = paths.map(PathBuf::from).collect();
    }
    let missing = [
        (MissingGlass::Refuse, "is refused"),
        (MissingGlass::FromNdVd, "by index and Abbe number"),
        (MissingGlass::Nearest, "by the nearest glass"),
    ];
    let words = "What becomes of a glass that no catalogue has";
    choice(ui, "unknown glass", words, &mut reading.missing_glass, &missing);
    let ranges = [(GlassRange::Refuse, "is refused"), (GlassRange::Extend, "continues the glass")];
    let words = "What becomes of a wavelength outside the range in which a glass is known; where the glass is continued, a note states how \
                 far its index may be off";
    choice(ui, "beyond its table", words, &mut reading.glass_range, &ranges);
    let words = "Change of index a nanometre, of media of which one index is stated";
    let slope = NumberField::even("index slope", "1/nm", -0.01..=0.01, -0.001..=0.001, words);
    optional(ui, slope, &mut reading.slope_per_nm, -1.333e-4);
    let words = "How many times as large the lens is as its prescription has it, in all its lengths";
    let scale = NumberField::even("lens scale", "", 1e-6..=1e6, 0.1..=10.0, words);
    optional(ui, scale, &mut reading.lens_scale, 2.0);
    let file = match &reading.coating {
        Some(CoatingSpec::File(path)) => path.display().to_string(),
        _ => String::new(),
    };
    let mut coatings = vec![
        (None, "the file's own, else MgF2"),
        (Some(CoatingSpec::Bare), "none"),
        (Some(CoatingSpec::MgF2), "MgF2, one layer"),
        (Some(CoatingSpec::VCoat), "V coat, two layers"),
        (Some(CoatingSpec::Bbar), "broadband, three layers"),
        (Some(CoatingSpec::Ideal), "no loss of light at all"),
    ];
    if !file.is_empty() {
        coatings.push((reading.coating.clone(), "of a file"));
    }
    let words = "What covers the surfaces between air and glass";
    choice(ui, "coating", words, &mut reading.coating, &coatings);
    let words = "A table of reflectance (.csv) or layers (.ron) that cover the surfaces between air and glass";
    if let Some(typed) = text(ui, "coating file", words, &file) {
        reading.coating = (!typed.trim().is_empty()).then(|| CoatingSpec::File(PathBuf::from(typed.trim())));
    }
    let numbers =
        [(None, "what is plausible"), (Some(SeqNumbers::Radii), "radii"), (Some(SeqNumbers::Curvatures), "curvatures")];
    let words = "What the numbers of surfaces are in a CODE V file that does not state it";
    choice(ui, "seq numbers", words, &mut reading.seq_numbers, &numbers);
}
