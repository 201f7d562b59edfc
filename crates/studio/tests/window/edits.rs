//! What is typed and clicked changes camera, numbers and picture.

use std::{
    thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::StopSpec;
use dioptric_studio::{
    engine::{EngineSettings, Field},
    session::{Autosave, Snapshot},
    ui::{Shown, Studio, StudioSettings, Tab},
};
use egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::kittest::Queryable;

use super::desk::{LONG, settle, small, studio, taken_elsewhere, type_into, window};

#[test]
fn typed_f_number_changes_numbers_and_picture() {
    let mut harness = window(None);
    let before = studio(&harness).product().unwrap().rgb8.clone();
    let light_before = studio(&harness).product().unwrap().light();
    type_into(&mut harness, "f-number", "2.8");
    settle(&mut harness);
    let studio = studio(&harness);
    assert_eq!(studio.session().camera().stop, StopSpec::FNumber(2.8));
    let product = studio.product().unwrap();
    assert!((product.capture.lens.reference.first_order().f_number.abs() - 2.8).abs() < 1e-6);
    assert!(product.rgb8 != before && product.light() != light_before);
    assert_eq!(product.rgb8, taken_elsewhere(studio));
    // What was typed is one step, whatever it took to type.
    assert_eq!(studio.session().history().n_past(), 1);
}

#[test]
fn undo_restores_the_bits() {
    let mut harness = window(None);
    let first = studio(&harness).product().unwrap().rgb8.clone();
    type_into(&mut harness, "f-number", "11");
    type_into(&mut harness, "swing", "3");
    settle(&mut harness);
    assert_ne!(studio(&harness).product().unwrap().rgb8, first);
    for _ in 0..2 {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
        harness.step();
    }
    settle(&mut harness);
    assert_eq!(*studio(&harness).session().camera(), small());
    assert_eq!(studio(&harness).product().unwrap().rgb8, first);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Y);
    settle(&mut harness);
    assert_eq!(studio(&harness).session().camera().stop, StopSpec::FNumber(11.0));
}

#[test]
fn what_cannot_be_is_reported_beside_its_field() {
    let mut harness = window(None);
    // No number at all: the camera stays.
    type_into(&mut harness, "f-number", "wide");
    assert_eq!(*studio(&harness).session().camera(), small());
    assert!(harness.query_by_label_contains("'wide' is no number").is_some());
    // A number that this lens has not: the remedy is offered, and works.
    type_into(&mut harness, "f-number", "1.2");
    settle(&mut harness);
    assert_eq!(studio(&harness).fault().unwrap().field, Field::Stop);
    // The picture of before stays.
    assert_eq!(*studio(&harness).product().unwrap().camera(), small());
    harness.get_by_label_contains("✔ open it to f/").click();
    harness.step();
    settle(&mut harness);
    assert!(studio(&harness).fault().is_none());
    assert_eq!(studio(&harness).product().unwrap().camera(), studio(&harness).session().camera());
}

/// A generator of numbers for edits that look random (the minimal standard of Park and Miller).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        self.0 % n
    }
}

/// Random edits: 75, or as many as `DIOPTRIC_FUZZ_CASES` says.
#[test]
fn random_edits_leave_no_stale_picture() {
    let n_edits = std::env::var("DIOPTRIC_FUZZ_CASES").map_or(75, |text| text.parse().unwrap());
    let mut harness = window(None);
    let mut numbers = Numbers(7);
    let labels =
        ["f-number", "distance", "swing", "tilt", "rise", "shift", "time", "gain", "illuminance", "pixel pitch"];
    for edit in 0..n_edits {
        match numbers.below(20) {
            0 => {
                harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
                harness.step();
            }
            1 => {
                harness.key_press_modifiers(Modifiers::COMMAND, Key::Y);
                harness.step();
            }
            2 => harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::A),
            3 => {
                harness.key_press(Key::A);
                harness.step();
            }
            4 => {
                let shown = Shown::ALL[numbers.below(5) as usize].0;
                let tab = [Tab::Picture, Tab::LensBench, Tab::SensorBench, Tab::CameraFile][numbers.below(4) as usize];
                harness.state_mut().as_mut().unwrap().show_tab(tab, shown);
                harness.step();
            }
            _ => {
                let label = labels[numbers.below(labels.len() as u64) as usize];
                if harness.query_by_role_and_label(Role::TextInput, label).is_some() {
                    // Some of them are no numbers, or none that the camera can have.
                    let text = ["3", "0.5", "8", "-2", "1e3", "x", "40", "2.8"][numbers.below(8) as usize];
                    type_into(&mut harness, label, text);
                }
            }
        }
        if edit % 25 == 24 {
            settle(&mut harness);
            let studio = studio(&harness);
            if studio.fault().is_none() {
                assert_eq!(studio.product().unwrap().camera(), studio.session().camera(), "edit {edit}");
                assert_eq!(studio.product().unwrap().rgb8, taken_elsewhere(studio), "edit {edit}");
            }
        }
    }
}

#[test]
fn a_click_focuses_there() {
    let mut harness = window(None);
    let picture = harness.get_by_label("picture").rect();
    let at = picture.center();
    harness.hover_at(at);
    harness.drag_at(at);
    harness.step();
    harness.drop_at(at);
    harness.step();
    settle(&mut harness);
    let product = studio(&harness).product().unwrap();
    let depth_m = product.probe([0.5, 0.5]).unwrap().depth_m.unwrap();
    let focus_mm = product.capture.place.focus_distance_mm.unwrap();
    assert!((1e-3 * focus_mm - depth_m).abs() < 0.05, "{focus_mm} {depth_m}");
    assert_ne!(studio(&harness).session().camera().focus, small().focus);
}

#[test]
fn the_camera_is_kept_at_every_change() {
    let folder = tempfile::tempdir().unwrap();
    let autosave = Autosave::new(folder.path());
    let mut harness = window(Some(autosave.clone()));
    type_into(&mut harness, "f-number", "5.6");
    let start = Instant::now();
    while autosave.left().is_none_or(|left| left.document.camera.stop != StopSpec::FNumber(5.6)) {
        assert!(start.elapsed() < LONG);
        thread::sleep(Duration::from_millis(20));
        harness.step();
    }
    // The next window begins there.
    let settings = StudioSettings { engine: EngineSettings::default(), autosave: Some(autosave), camera: None };
    let next = Studio::new(&egui::Context::default(), settings).unwrap();
    assert_eq!(next.session().camera(), studio(&harness).session().camera());
}

#[test]
fn every_tab_is_drawn() {
    let mut harness = window(None);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::A);
    type_into(&mut harness, "f-number", "16");
    settle(&mut harness);
    harness.state_mut().as_mut().unwrap().keep_snapshot(Snapshot::B);
    for (shown, _) in Shown::ALL {
        harness.state_mut().as_mut().unwrap().show_tab(Tab::Picture, shown);
        harness.step();
        assert!(harness.query_by_label("picture").is_some(), "{shown:?}");
    }
    for (tab, words) in
        [(Tab::LensBench, "Modulation"), (Tab::SensorBench, "dark noise"), (Tab::CameraFile, "camera file")]
    {
        harness.state_mut().as_mut().unwrap().show_tab(tab, Shown::Picture);
        let start = Instant::now();
        while harness.query_by_label_contains(words).is_none() {
            assert!(start.elapsed() < LONG, "{tab:?}");
            thread::sleep(Duration::from_millis(20));
            harness.step();
        }
    }
}
