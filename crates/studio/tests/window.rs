//! The window without a screen: what is typed and clicked changes camera, numbers and picture.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::{Camera, FilmSpec, KeptCamera, SceneSource, Silent, StopSpec, WavelengthSpec};
use dioptric_spectrum::Cancel;
use dioptric_studio::{
    engine::{EngineSettings, Field},
    session::{Autosave, Snapshot},
    ui::{Shown, Studio, StudioSettings, Tab},
};
use egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::{Harness, kittest::Queryable};

/// Longer than any picture here takes on a busy machine.
const LONG: Duration = Duration::from_secs(120);

/// The demo on a film of 96 × 64 pixels and three bands.
fn small() -> Camera {
    let mut camera = Camera::demo().unwrap();
    camera.film = FilmSpec::Pixels { columns: 96, rows: 64, pitch_um: 330.0 };
    camera.scene.source = SceneSource::StillLife { columns: 108, rows: 72 };
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
    camera
}

/// A window of a small camera, drawn once.
fn window<'a>(autosave: Option<Autosave>) -> Harness<'a, Option<Studio>> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.ron");
    std::fs::write(&file, small().to_ron()).unwrap();
    let settings = StudioSettings { engine: EngineSettings::default(), autosave, camera: Some(file) };
    let ui = |ui: &mut egui::Ui, studio: &mut Option<Studio>| {
        if let Some(studio) = studio {
            studio.ui(ui);
        }
    };
    let mut harness = Harness::builder().with_size([1400.0, 900.0]).build_ui_state(ui, None);
    let studio = Studio::new(&harness.ctx, settings).unwrap();
    *harness.state_mut() = Some(studio);
    settle(&mut harness);
    harness
}

fn studio<'h>(harness: &'h Harness<'_, Option<Studio>>) -> &'h Studio {
    harness.state().as_ref().unwrap()
}

/// Draws frames until the full picture of the camera is there, or what is wrong with it.
fn settle(harness: &mut Harness<'_, Option<Studio>>) {
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
fn taken_elsewhere(studio: &Studio) -> Vec<u8> {
    let kept = KeptCamera::new(studio.session().camera().clone());
    kept.capture(&Silent, &Cancel::new()).unwrap().developed.picture.to_rgb8()
}

/// Types a text into the field of a label, in place of what stands there.
fn type_into(harness: &mut Harness<'_, Option<Studio>>, label: &str, text: &str) {
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
fn what_cannot_be_is_told_beside_its_field() {
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

#[test]
fn two_hundred_edits_leave_no_stale_picture() {
    let mut harness = window(None);
    let mut numbers = Numbers(7);
    let labels =
        ["f-number", "distance", "swing", "tilt", "rise", "shift", "time", "gain", "illuminance", "pixel pitch"];
    for edit in 0..200 {
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
                let tab = [Tab::Picture, Tab::LensBench, Tab::SensorBench][numbers.below(3) as usize];
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
    while autosave.camera().is_none_or(|kept| kept.stop != StopSpec::FNumber(5.6)) {
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
    for (tab, words) in [(Tab::LensBench, "Modulation"), (Tab::SensorBench, "dark noise")] {
        harness.state_mut().as_mut().unwrap().show_tab(tab, Shown::Picture);
        let start = Instant::now();
        while harness.query_by_label_contains(words).is_none() {
            assert!(start.elapsed() < LONG, "{tab:?}");
            thread::sleep(Duration::from_millis(20));
            harness.step();
        }
    }
}
