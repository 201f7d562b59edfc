//! Files by the dialogs of the window.

use std::{
    fs, thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::{Camera, LensSpec, SurfaceChange};
use dioptric_studio::{session::Autosave, ui::Studio};
use egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::{Harness, kittest::Queryable};

use super::desk::{LONG, draw, settle, small, studio, window, window_of};

/// Types a path into the dialog that is open, and Enter.
pub(crate) fn answer(harness: &mut Harness<'_, Option<Studio>>, path: &std::path::Path) {
    draw(harness);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.step();
    harness.get_by_role_and_label(Role::TextInput, "file name").type_text(&path.display().to_string());
    harness.step();
    harness.key_press(Key::Enter);
    draw(harness);
    assert!(harness.query_by_label("file name").is_none(), "the dialog is still there");
}

#[test]
fn cameras_pictures_and_runs_are_saved_and_opened() {
    let folder = tempfile::tempdir().unwrap();
    let autosave = Autosave::new(folder.path().join("state"));
    let mut harness = window(Some(autosave.clone()));
    let file = folder.path().join("mine.ron");
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    answer(&mut harness, &file);
    assert_eq!(Camera::read(&file).unwrap(), small());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    answer(&mut harness, &folder.path().join("shot"));
    assert_eq!(fs::read(folder.path().join("shot.png")).unwrap(), studio(&harness).product().unwrap().png().unwrap());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    answer(&mut harness, &folder.path().join("run"));
    let (start, report) = (Instant::now(), folder.path().join("run/report.html"));
    while !report.exists() {
        assert!(start.elapsed() < LONG, "nothing was exported");
        thread::sleep(Duration::from_millis(20));
        harness.step();
    }
    for name in ["picture.png", "irradiance.exr", "raw.png", "report.json", "camera.ron"] {
        assert!(folder.path().join("run").join(name).exists(), "{name}");
    }
    // Another camera is opened, and both are remembered.
    let other = Camera { seed: 99, ..small() };
    let second = folder.path().join("other.ron");
    fs::write(&second, other.to_ron()).unwrap();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    answer(&mut harness, &second);
    assert_eq!(*studio(&harness).session().camera(), other);
    assert!(autosave.recent()[0].ends_with("other.ron") && autosave.recent()[1].ends_with("mine.ron"));
    // Escape leaves everything as it is.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    draw(&mut harness);
    assert!(harness.query_by_label("file name").is_some());
    harness.key_press(Key::Escape);
    draw(&mut harness);
    assert!(harness.query_by_label("file name").is_none());
    assert_eq!(*studio(&harness).session().camera(), other);
}

#[test]
fn a_changed_lens_is_saved_as_a_file_of_the_same_rays() {
    let folder = tempfile::tempdir().unwrap();
    let change = SurfaceChange { surface: 1, thickness_mm: Some(9.5), ..SurfaceChange::default() };
    let mut camera = small();
    camera.lens = camera.lens.with_changes(vec![change]);
    let mut harness = window_of(&camera, ([1400.0, 900.0], 1.0), None);
    let before = studio(&harness).product().unwrap().rgb8.clone();
    harness.get_by_label("Save the lens…").click();
    draw(&mut harness);
    let file = folder.path().join("mine.ron");
    answer(&mut harness, &file);
    settle(&mut harness);
    assert_eq!(studio(&harness).session().camera().lens, LensSpec::File(file));
    assert_eq!(studio(&harness).product().unwrap().rgb8, before);
}
