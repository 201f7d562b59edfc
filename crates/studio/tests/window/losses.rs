//! Work that the window once lost, and differences that it once showed wrongly.

use std::{fs, path::Path, thread, time::Duration, time::Instant};

use dioptric_pipeline::{Camera, KeptCamera, StopSpec};
use dioptric_studio::{
    engine::EngineSettings,
    session::{Autosave, Snapshot},
    ui::{Shown, Studio, StudioSettings, Tab},
};
use egui::{Key, Modifiers};
use egui_kittest::{
    Harness,
    kittest::{NodeT, Queryable},
};

use super::{
    desk::{LONG, draw, settle, small, studio, taken_elsewhere, type_into, window},
    files::answer,
};

/// Draws frames until something holds.
fn wait(harness: &mut Harness<'_, Option<Studio>>, what: &str, holds: impl Fn(&Harness<'_, Option<Studio>>) -> bool) {
    let start = Instant::now();
    while !holds(harness) {
        assert!(start.elapsed() < LONG, "{what}");
        thread::sleep(Duration::from_millis(10));
        harness.step();
    }
}

fn change(harness: &mut Harness<'_, Option<Studio>>, f_number: f64) {
    harness.state_mut().as_mut().unwrap().change(|camera| camera.stop = StopSpec::FNumber(f_number));
    harness.step();
}

fn open(harness: &mut Harness<'_, Option<Studio>>, path: &Path) {
    harness.state_mut().as_mut().unwrap().open(path);
    harness.step();
}

/// The words over the difference.
fn words(harness: &Harness<'_, Option<Studio>>) -> Option<String> {
    let node = harness.query_by_label_contains("A − B about gray")?.accesskit_node();
    node.value().or_else(|| node.label())
}

fn shown_rms(harness: &Harness<'_, Option<Studio>>) -> Option<f64> {
    words(harness)?.split("rms ").nth(1)?.split(' ').next()?.parse().ok()
}

/// →A, Pause, f/11, →B: B is the camera at f/11, and so is its picture.
#[test]
fn a_difference_is_that_of_the_two_cameras() {
    let mut harness = window(None);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::A);
    let first = studio(&harness).product().unwrap().rgb8.clone();
    harness.get_by_label("Pause").click();
    draw(&mut harness);
    change(&mut harness, 11.0);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::B);
    harness.state_mut().as_mut().unwrap().show_tab(Tab::Picture, Shown::Difference);
    harness.step();
    // Until there is a picture of B, none is taken for it.
    assert!(shown_rms(&harness).is_none());
    wait(&mut harness, "no difference is shown", |harness| shown_rms(harness).is_some());
    let second = taken_elsewhere(studio(&harness));
    let squares: f64 = first.iter().zip(&second).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    let expected = 100.0 * (squares / first.len() as f64).sqrt() / 255.0;
    let shown = shown_rms(&harness).unwrap();
    assert!(expected > 0.1 && (shown - expected).abs() < 0.006, "{shown} {expected}");
    assert!(harness.query_by_label("paused").is_some());
}

#[test]
fn a_snapshot_kept_early_becomes_the_full_picture() {
    let mut harness = window(None);
    change(&mut harness, 2.8);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::A);
    change(&mut harness, 8.0);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::B);
    // Gone on meanwhile: both pictures are of cameras that are no longer on the desk.
    change(&mut harness, 5.6);
    harness.state_mut().as_mut().unwrap().show_tab(Tab::Picture, Shown::Difference);
    wait(&mut harness, "no difference is shown", |harness| shown_rms(harness).is_some());
    let label = words(&harness).unwrap();
    assert!(!label.contains("sketch") && !label.contains("preview"), "{label}");
}

/// Opens a, opens b, takes that back, saves: the camera of a goes to a, and b stays.
#[test]
fn a_save_goes_to_the_file_of_its_camera() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [("a.ron", 1), ("b.ron", 2)].map(|(name, seed)| {
        let path = folder.path().join(name);
        fs::write(&path, Camera { seed, ..small() }.to_ron()).unwrap();
        path
    });
    let mut harness = window(None);
    open(&mut harness, &a);
    open(&mut harness, &b);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    draw(&mut harness);
    change(&mut harness, 4.5);
    assert!(studio(&harness).session().title().starts_with("a.ron •"));
    harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    draw(&mut harness);
    assert_eq!(Camera::read(&b).unwrap(), Camera { seed: 2, ..small() });
    let saved = Camera::read(&a).unwrap();
    assert_eq!((saved.seed, saved.stop), (1, StopSpec::FNumber(4.5)));
    // A preset is in no file: a save asks for one.
    harness.get_by_label("Presets").click();
    draw(&mut harness);
    harness.get_by_label("Slanted edge").click();
    draw(&mut harness);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    draw(&mut harness);
    assert!(harness.query_by_label("file name").is_some());
    assert_eq!(Camera::read(&a).unwrap(), saved);
}

#[test]
fn a_file_that_another_program_wrote_is_not_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ron");
    fs::write(&path, small().to_ron()).unwrap();
    let mut harness = window(None);
    open(&mut harness, &path);
    change(&mut harness, 4.5);
    let other = Camera { seed: 5, ..small() };
    fs::write(&path, other.to_ron()).unwrap();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    draw(&mut harness);
    assert!(harness.query_by_label("file name").is_some());
    assert_eq!(Camera::read(&path).unwrap(), other);
}

#[test]
fn pictures_are_written_when_they_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = window(None);
    change(&mut harness, 3.0);
    let asked = studio(&harness).session().camera().clone();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    answer(&mut harness, &folder.path().join("early"));
    // Another camera is on the desk before the picture is there.
    change(&mut harness, 9.0);
    let file = folder.path().join("early.png");
    wait(&mut harness, "nothing was written", |_| file.exists());
    let capture = KeptCamera::new(asked).capture(&dioptric_pipeline::Silent, &Default::default()).unwrap();
    let png = dioptric_pipeline::picture_png(&capture.developed.picture).unwrap();
    assert!(fs::read(&file).unwrap() == png, "the picture of another camera was written");
    // What is exported can be continued.
    settle(&mut harness);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    answer(&mut harness, &folder.path().join("run"));
    wait(&mut harness, "nothing was exported", |_| folder.path().join("run/report.html").exists());
    let resumed = KeptCamera::resume(&folder.path().join("run")).unwrap();
    assert!(resumed.notes.is_empty() && resumed.camera.has_irradiance().unwrap());
}

#[test]
fn each_document_is_as_it_was_left() {
    let folder = tempfile::tempdir().unwrap();
    let autosave = Autosave::new(folder.path().join("state"));
    let [a, b] = ["a.ron", "b.ron"].map(|name| {
        let path = folder.path().join(name);
        fs::write(&path, small().to_ron()).unwrap();
        path
    });
    {
        let mut harness = window(Some(autosave.clone()));
        open(&mut harness, &a);
        type_into(&mut harness, "f-number", "5.6");
        harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::A);
        // Opened before what was typed was kept by the clock.
        open(&mut harness, &b);
        change(&mut harness, 16.0);
        harness.state_mut().as_mut().unwrap().show_tab(Tab::LensBench, Shown::Picture);
    }
    // The window was closed at once. The next one goes on with b, and a is as it was left too.
    let start = |camera: Option<&Path>| {
        let autosave = Some(autosave.clone());
        let settings =
            StudioSettings { engine: EngineSettings::default(), autosave, camera: camera.map(Path::to_owned) };
        Studio::new(&egui::Context::default(), settings).unwrap()
    };
    let next = start(None);
    assert_eq!(next.session().camera().stop, StopSpec::FNumber(16.0));
    assert!(next.session().title().starts_with("b.ron •"));
    assert_eq!(next.session().snapshot(Snapshot::A).unwrap().stop, StopSpec::FNumber(5.6));
    drop(next);
    let of_a = start(Some(&a));
    assert_eq!(of_a.session().camera().stop, StopSpec::FNumber(5.6));
    assert!(of_a.session().is_changed() && of_a.session().history().n_past() == 1);
    assert_eq!(Camera::read(&a).unwrap(), small());
}
