//! A world in three dimensions: its file, where the camera stands in it, how it is rendered.

use dioptric_pipeline::{BandSampling, LightPaths, RenderEffort, RenderMethod, WorldSpec};
use egui::{CollapsingHeader, Ui};

use super::{
    super::fields::{NumberField, choice, count, text, tick, variant},
    Desk, path,
};

pub(super) fn show(ui: &mut Ui, world: &mut WorldSpec, desk: &Desk<'_>) {
    path::show(ui, &mut world.file, "pbrt, glTF, OBJ or PLY", desk);
    let methods = [
        (RenderMethod::Backward, "backward: rays from the film"),
        (RenderMethod::Forward, "forward: the view, blurred"),
    ];
    choice(ui, "method", "How the light of the world comes to the film", &mut world.method, &methods);
    let words = "Takes both pictures, keeps backward as A and forward as B, and shows A − B";
    if ui.button("Forward against backward").on_hover_text(words).clicked() {
        desk.ask_for(super::Wanted::BothMethods);
    }
    let efforts = [(RenderEffort::Samples(64), "a number of samples"), (RenderEffort::Noise(0.02), "a standard error")];
    variant(ui, "until", "When the rendering is good enough", &mut world.effort, &efforts);
    match &mut world.effort {
        RenderEffort::Samples(n) => {
            let mut samples = *n as usize;
            if count(ui, "samples", "Rays of a pixel", 1..=65_536, &mut samples) {
                *n = samples as u32;
            }
        }
        RenderEffort::Noise(share) => {
            let words = "Relative standard error of a pixel over all bands";
            NumberField::by_factors("noise", "", 1e-4..=1.0, 0.002..=0.5, words).show(ui, share);
        }
    }
    CollapsingHeader::new("More of the world").show(ui, |ui| more(ui, world));
}

fn more(ui: &mut Ui, world: &mut WorldSpec) {
    let unit = "Length of the file's unit";
    NumberField::by_factors("unit", "m", 1e-9..=1e9, 1e-3..=10.0, unit).show(ui, &mut world.unit_m);
    let mut is_given = world.time_s.is_some();
    let words = "How far the animations of a glTF file have come; else everything stands as it is written";
    if tick(ui, "at a time", words, &mut is_given) {
        world.time_s = is_given.then_some(0.0);
    }
    if let Some(time_s) = &mut world.time_s {
        NumberField::even("time", "s", 0.0..=1e6, 0.0..=10.0, words).show(ui, time_s);
    }
    let name = |ui: &mut Ui, title, words, name: &mut Option<String>| {
        if let Some(typed) = text(ui, title, words, name.as_deref().unwrap_or("")) {
            *name = Some(typed).filter(|typed| !typed.is_empty());
        }
    };
    let words = "Which animation moves it, by name or number; left empty the first, and others that move what none before them does";
    name(ui, "animation", words, &mut world.animation);
    let words = "Which of the variants of its materials a glTF file shows; left empty its own materials";
    name(ui, "variant", words, &mut world.variant);
    let place = |label, words| NumberField::even(label, "mm", -1e9..=1e9, -1000.0..=1000.0, words);
    let words = "How far the camera stands before the place of the file's, along its axis";
    place("advance", words).show(ui, &mut world.advance_mm);
    let words = "How far the camera stands to the right of the place of the file's";
    place("to the right", words).show(ui, &mut world.aside_mm.0);
    place("above", "How far the camera stands above the place of the file's").show(ui, &mut world.aside_mm.1);
    let mut is_given = world.size.is_some();
    let words = "Columns and rows of the view from the entrance pupil; else those of the file's camera";
    if tick(ui, "own size of the view", words, &mut is_given) {
        world.size = is_given.then_some((720, 480));
    }
    if let Some((columns, rows)) = &mut world.size {
        count(ui, "view columns", "Columns of the view from the entrance pupil", 1..=65_536, columns);
        count(ui, "view rows", "Rows of the view from the entrance pupil", 1..=65_536, rows);
    }
    let mut knows_hidden = world.layers > 1;
    let words =
        "Renders what the first surfaces hide too, for views that are blurred: edges then show it instead of a guess";
    if tick(ui, "what edges hide", words, &mut knows_hidden) {
        world.layers = if knows_hidden { 2 } else { 1 };
    }
    let samplings = [(BandSampling::Mean, "mean over its width"), (BandSampling::Center, "at its center")];
    choice(ui, "value of a band", "What of the light a band holds", &mut world.bands, &samplings);
    let paths = [
        (LightPaths::Full, "any number of times"),
        (LightPaths::UpTo(4), "up to a number"),
        (LightPaths::Direct, "once: direct light"),
        (LightPaths::Emission, "never: lights alone"),
    ];
    variant(ui, "scattering", "How often light may be scattered on its way", &mut world.paths, &paths);
    if let LightPaths::UpTo(n) = &mut world.paths {
        let mut times = *n as usize;
        if count(ui, "scatterings", "The most times that light is scattered", 1..=1000, &mut times) {
            *n = times as u32;
        }
    }
    let mut seed = world.seed as usize;
    let words = "The seed of the rendering's samples; that of the sensor's noise is apart";
    if count(ui, "world seed", words, 0..=1_000_000, &mut seed) {
        world.seed = seed as u64;
    }
}
