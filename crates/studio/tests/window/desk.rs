//! A window without a screen, and hands to use it.

use std::{
    thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::{Camera, FilmSpec, KeptCamera, SceneSource, Silent, WavelengthSpec};
use dioptric_spectrum::Cancel;
use dioptric_studio::{
    engine::EngineSettings,
    session::Autosave,
    ui::{Studio, StudioSettings},
};
use egui::{Key, Modifiers, Pos2, Vec2, accesskit::Role};
use egui_kittest::{Harness, kittest::Queryable};

/// Longer than any picture here takes on a machine that does ten other things: beyond it something hangs.
pub(crate) const LONG: Duration = Duration::from_secs(600);

/// The demo on a film of 96 × 64 pixels and three bands.
pub(crate) fn small() -> Camera {
    let mut camera = Camera::demo().unwrap();
    camera.film = FilmSpec::Pixels { columns: 96, rows: 64, pitch_um: 330.0 };
    camera.scene.source = SceneSource::StillLife { columns: 108, rows: 72 };
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
    camera
}

/// A window of a small camera, drawn once.
pub(crate) fn window<'a>(autosave: Option<Autosave>) -> Harness<'a, Option<Studio>> {
    window_of(&small(), ([1400.0, 900.0], 1.0), autosave)
}

/// A window of a camera and a size, points, each of so many pixels, drawn until its full picture is there.
pub(crate) fn window_of<'a>(
    camera: &Camera,
    (size, pixels_per_point): ([f32; 2], f32),
    autosave: Option<Autosave>,
) -> Harness<'a, Option<Studio>> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.ron");
    std::fs::write(&file, camera.to_ron()).unwrap();
    let settings = StudioSettings { engine: EngineSettings::default(), autosave, camera: Some(file) };
    let ui = |ui: &mut egui::Ui, studio: &mut Option<Studio>| {
        if let Some(studio) = studio {
            studio.ui(ui);
        }
    };
    let mut harness =
        Harness::builder().with_size(size).with_pixels_per_point(pixels_per_point).build_ui_state(ui, None);
    let studio = Studio::new(&harness.ctx, settings).unwrap();
    *harness.state_mut() = Some(studio);
    settle(&mut harness);
    harness
}

pub(crate) fn studio<'h>(harness: &'h Harness<'_, Option<Studio>>) -> &'h Studio {
    harness.state().as_ref().unwrap()
}

/// Draws frames until the full picture of the camera is there, or what is wrong with it.
pub(crate) fn settle(harness: &mut Harness<'_, Option<Studio>>) {
    let start = Instant::now();
    harness.step();
    while !studio(harness).is_settled() {
        assert!(start.elapsed() < LONG, "the picture did not come");
        thread::sleep(Duration::from_millis(5));
        harness.step();
    }
    harness.step();
}

/// The picture that the camera of a window has, taken elsewhere.
pub(crate) fn taken_elsewhere(studio: &Studio) -> Vec<u8> {
    let kept = KeptCamera::new(studio.session().camera().clone());
    kept.capture(&Silent, &Cancel::new()).unwrap().developed.picture.to_rgb8()
}

/// Types a text into the field of a label, in place of what stands there.
pub(crate) fn type_into(harness: &mut Harness<'_, Option<Studio>>, label: &str, text: &str) {
    let field = || harness.get_by_role_and_label(Role::TextInput, label);
    field().focus();
    harness.step();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.step();
    harness.get_by_role_and_label(Role::TextInput, label).type_text(text);
    harness.step();
    harness.key_press(Key::Enter);
    harness.step();
}

/// Draws a few frames.
pub(crate) fn draw(harness: &mut Harness<'_, Option<Studio>>) {
    (0..4).for_each(|_| harness.step());
}

/// Drags from a place of the window to another in steps.
pub(crate) fn drag(harness: &mut Harness<'_, Option<Studio>>, from: Pos2, by: Vec2) {
    harness.hover_at(from);
    harness.step();
    harness.drag_at(from);
    harness.step();
    for step in 1..=5 {
        harness.hover_at(from + 0.2 * step as f32 * by);
        harness.step();
    }
    harness.drop_at(from + by);
    draw(harness);
}
