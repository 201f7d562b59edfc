//! A world in the window.

use dioptric_pipeline::{
    Camera, FilmSpec, FocusSpec, LensSpec, RenderEffort, RenderMethod, SceneSource, SceneSpec, WavelengthSpec,
    WorldSpec,
};
use dioptric_studio::{session::Snapshot, ui::Studio};
use egui_kittest::kittest::Queryable;

use super::desk::{draw, settle, small, studio, window_of};

/// The room of the examples on a film of 24 × 16 pixels.
fn room() -> Camera {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/worlds/room.pbrt");
    let mut world = WorldSpec::of_file(file);
    (world.effort, world.size) = (RenderEffort::Samples(32), Some((30, 20)));
    Camera {
        lens: LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 12.5 },
        stop: dioptric_pipeline::StopSpec::AsGiven,
        focus: FocusSpec::DistanceMm(3000.0),
        film: FilmSpec::Pixels { columns: 24, rows: 16, pitch_um: 1400.0 },
        scene: SceneSpec { source: SceneSource::World(world), ..SceneSpec::of_file("room.pbrt".into()) },
        wavelengths: WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]),
        ..small()
    }
}

#[test]
fn both_methods_are_compared_by_one_click() {
    let camera = room();
    let mut harness = window_of(&camera, ([1400.0, 900.0], 1.0), None);
    harness.get_by_label("Forward against backward").click();
    draw(&mut harness);
    let is_there =
        |studio: &Studio| [Snapshot::A, Snapshot::B].iter().all(|which| studio.session().snapshot(*which).is_some());
    settle(&mut harness);
    while !is_there(studio(&harness)) {
        settle(&mut harness);
    }
    settle(&mut harness);
    let method = |which| match &studio(&harness).session().snapshot(which).unwrap().scene.source {
        SceneSource::World(world) => world.method,
        _ => panic!("no world"),
    };
    assert_eq!((method(Snapshot::A), method(Snapshot::B)), (RenderMethod::Backward, RenderMethod::Forward));
    assert!(harness.query_by_label_contains("A − B about gray").is_some());
    // The camera stays as it was, with nothing to undo.
    assert_eq!((studio(&harness).session().camera(), studio(&harness).session().history().n_past()), (&camera, 0));
    assert_eq!(*studio(&harness).product().unwrap().camera(), camera);
}
