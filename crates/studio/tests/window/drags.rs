//! What is dragged in the drawings is the camera's, in one step, and its picture follows.

use dioptric_pipeline::{FocusSpec, LensSpec};
use dioptric_studio::session::{as_command, as_python, as_ron};
use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable;

use super::desk::{drag, draw, settle, small, studio, taken_elsewhere, window};

#[test]
fn a_dragged_surface_is_another_lens_in_one_step() {
    let mut harness = window(None);
    let first = studio(&harness).product().unwrap().rgb8.clone();
    let spread =
        |harness: &egui_kittest::Harness<'_, _>| studio(harness).product().unwrap().spread([0.7, 0.3]).unwrap();
    let blur_um = spread(&harness).rms_um;
    let drawing = harness.get_by_label("drawing of the lens").rect();
    // The outermost line of the lens at the left, at a third of its height, is its first surface.
    let taken = (0..40).map(|i| drawing.left() + 2.0 + 3.0 * i as f32).find(|x| {
        drag(&mut harness, egui::pos2(*x, drawing.center().y - 0.25 * drawing.height()), vec2(-6.0, 0.0));
        matches!(studio(&harness).session().camera().lens, LensSpec::Changed { .. })
    });
    assert!(taken.is_some(), "no surface was found in the drawing");
    assert_eq!(studio(&harness).session().history().n_past(), 1);
    settle(&mut harness);
    assert!(studio(&harness).fault().is_none());
    let camera = studio(&harness).session().camera().clone();
    let changes = camera.lens.changes();
    assert_eq!((changes.len(), changes[0].surface), (1, 0), "{changes:?}");
    // What is shown is of the lens that the camera file has.
    let product = studio(&harness).product().unwrap();
    assert_eq!(*product.camera(), camera);
    assert_eq!(
        product.capture.lens.lens.interfaces()[0].surface.curvature_per_mm,
        changes[0].curvature_per_mm.unwrap()
    );
    assert!(product.rgb8 != first && product.rgb8 == taken_elsewhere(studio(&harness)));
    assert!((spread(&harness).rms_um / blur_um - 1.0).abs() > 0.01);
    for text in [as_ron(&camera), as_command(studio(&harness).session()), as_python(studio(&harness).session())] {
        assert!(text.contains("Changed(") && text.contains("curvature_per_mm"), "{text}");
    }
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    draw(&mut harness);
    settle(&mut harness);
    assert_eq!(*studio(&harness).session().camera(), small());
    assert_eq!(studio(&harness).product().unwrap().rgb8, first);
}

#[test]
fn the_plane_of_focus_is_dragged() {
    let mut harness = window(None);
    let FocusSpec::DistanceMm(before_mm) = small().focus else { panic!("the demo is focused on a distance") };
    let plane = harness.get_by_label("plane of focus").rect();
    drag(&mut harness, plane.center(), vec2(20.0, 0.0));
    settle(&mut harness);
    // Towards the lens is nearer, and by equal dioptres a point of the screen.
    let FocusSpec::DistanceMm(near_mm) = studio(&harness).session().camera().focus else { panic!("a distance") };
    assert!(near_mm < before_mm && near_mm > 100.0, "{near_mm}");
    assert_eq!(studio(&harness).session().history().n_past(), 1);
    let found_mm = studio(&harness).product().unwrap().capture.place.focus_distance_mm.unwrap();
    assert!((found_mm / near_mm - 1.0).abs() < 1e-9);
    drag(&mut harness, plane.center(), vec2(-2000.0, 0.0));
    assert_eq!(studio(&harness).session().camera().focus, FocusSpec::DistanceMm(f64::INFINITY));
    assert_eq!(studio(&harness).session().history().n_past(), 2);
}
