//! A world rendered both ways through a real lens.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use std::fs;

use dioptric_analysis::MethodComparison;
use dioptric_pipeline::{Camera, Silent};
use dioptric_spectrum::Cancel;

/// A wall that glows 1.5 m before the camera.
const WORLD: &str = r#"
Film "rgb" "integer xresolution" 120 "integer yresolution" 90
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 9
WorldBegin
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 400 1 700 2 ] "bool twosided" true
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -1 -1 1.5  -1 1 1.5  1 1 1.5  1 -1 1.5 ]
AttributeEnd
"#;

/// A brighter bar before the left half of it.
const BAR: &str = r#"
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 400 3 700 3 ] "bool twosided" true
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -.03 -1 1.2  -.03 1 1.2  -.015 1 1.2  -.015 -1 1.2 ]
AttributeEnd
"#;

const CAMERA: &str = r#"(
    name: "both ways",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(5.0),
    focus: DistanceMm(1450.0),
    film: Pixels(columns: 40, rows: 30, pitch_um: 150.0),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "wall.pbrt", effort: Samples(256)))),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

fn compare(world: &str) -> MethodComparison {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), world).unwrap();
    let camera = Camera::parse(CAMERA, &folder.path().join("camera.ron")).unwrap();
    MethodComparison::of(&camera, &Silent, &Cancel::new()).unwrap()
}

#[test]
fn even_wall_is_the_same_both_ways() {
    let found = compare(WORLD);
    assert_eq!(found.edge_fraction, 0.0);
    for row in &found.rows {
        // 0.3 % is what is asked of light that no rim takes; the rendering's noise stands beside it.
        assert!(row.total.abs() < 0.003 + 4.0 * row.total_error, "{row:?}");
        assert!(row.off_edges < 0.003 + 2.0 * row.noise, "{row:?}");
    }
}

/// A glass is continued beyond its table for both, and that is said.
#[test]
fn continued_glass_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), WORLD).unwrap();
    let of = |glass_range: &str| {
        let text = CAMERA
            .replace("dgauss-50mm\")", &format!("achromat-100mm\"), lens_reading: (glass_range: {glass_range})"))
            .replace("Samples(256)", "Samples(16)")
            .replace("450.0, 550.0, 650.0", "310.0, 550.0");
        let camera = Camera::parse(&text, &folder.path().join("camera.ron")).unwrap();
        MethodComparison::of(&camera, &Silent, &Cancel::new())
    };
    let notes = of("Extend").unwrap().notes;
    assert!(
        notes.iter().any(|note| note.contains("SCHOTT:F2 is known from 320 to 2500 nm and continued: at 310 nm")),
        "{notes:?}"
    );
    assert!(of("Refuse").unwrap_err().to_string().contains("not at 310 nm"));
}

#[test]
fn bar_before_a_wall_differs_at_its_edges_alone() {
    let found = compare(&[WORLD, BAR].concat());
    assert!((0.05..0.9).contains(&found.edge_fraction), "{}", found.edge_fraction);
    for row in &found.rows {
        // What is asked off edges, and in their band.
        assert!(row.off_edges < 0.01 + 2.0 * row.noise, "{row:?}");
        assert!(row.edge_band.unwrap() < 0.06 + 2.0 * row.noise, "{row:?}");
    }
}

/// A dim beam 10 cm thick and 8 mm wide before a dim wall with a bright stripe, 6 mm wide, that the beam hides from the middle of the pupil but
/// not from its rim.
const STRIPE_BEHIND_A_BEAM: &str = r#"
Film "rgb" "integer xresolution" 240 "integer yresolution" 180
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 9
WorldBegin
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 400 1 700 1 ] "float scale" .2 "bool twosided" true
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -1 -1 1.6  -1 1 1.6  1 1 1.6  1 -1 1.6 ]
AttributeEnd
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 400 1 700 1 ] "float scale" 6 "bool twosided" true
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -.003 -1 1.599  -.003 1 1.599  .003 1 1.599  .003 -1 1.599 ]
AttributeEnd
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 400 1 700 1 ] "float scale" .1 "bool twosided" true
Shape "trianglemesh"
  "integer indices" [ 0 1 2 0 2 3  4 6 5 4 7 6  0 4 5 0 5 1  3 2 6 3 6 7 ]
  "point3 P" [ -.004 -1 .8  -.004 1 .8  .004 1 .8  .004 -1 .8  -.004 -1 .9  -.004 1 .9  .004 1 .9  .004 -1 .9 ]
AttributeEnd
"#;

/// Blurred edges show what lies behind them where it is rendered, not the back of what is in front nor a guess.
#[test]
fn what_a_beam_hides_is_known_with_two_layers() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), STRIPE_BEHIND_A_BEAM).unwrap();
    let error_with = |layers: u32| {
        let text = CAMERA
            .replace("effort: Samples(256)", &format!("effort: Samples(256), layers: {layers}"))
            .replace("FNumber(5.0)", "FNumber(2.2)")
            .replace("DistanceMm(1450.0)", "DistanceMm(1600.0)");
        let camera = Camera::parse(&text, &folder.path().join("camera.ron")).unwrap();
        let found = MethodComparison::of(&camera, &Silent, &Cancel::new()).unwrap();
        let row = found.rows[1];
        println!("{layers} layers: total {:+.3}, edge band {:.3}", row.total, row.edge_band.unwrap());
        (row.total, row.edge_band.unwrap())
    };
    let (guessed, known) = (error_with(1), error_with(2));
    // A guess knows nothing of the stripe, which is a seventh of all light. Layers know how much of a pixel the beam covers, not through which
    // part of the pupil: .054 and .23 with what is known, .57 of the band without.
    assert!(guessed.0 < -0.1 && guessed.1 > 0.5, "{guessed:?}");
    assert!(known.0.abs() < 0.07 && known.1 < 0.3, "{known:?}");
}

/// The demo's scene is taken as it is, as a world of which what edges hide is known.
#[test]
fn still_life_is_the_same_both_ways() {
    let text = CAMERA
        .replace("World((file: \"wall.pbrt\", effort: Samples(256)))", "StillLife(columns: 270, rows: 180)")
        .replace("columns: 40, rows: 30, pitch_um: 150.0", "columns: 40, rows: 24, pitch_um: 600.0")
        .replace("DistanceMm(1450.0)", "DistanceMm(960.0)");
    let camera = Camera::parse(&text, "camera.ron".as_ref()).unwrap();
    let found = MethodComparison::of(&camera, &Silent, &Cancel::new()).unwrap();
    for row in &found.rows {
        // A coarse view: bulbs and glints are as wide as its samples, which are at 16 points of them; 64 rays a pixel are noise beside it.
        assert!(row.total.abs() < 0.02 + 4.0 * row.total_error, "{row:?}");
        assert!(row.edge_band.unwrap() < 0.06 + 2.0 * row.noise, "{row:?}");
        let [_, right_error, down_error, ..] = row.fit.errors;
        assert!(row.fit.right_px.abs() < 0.02 + 3.0 * right_error, "{row:?}");
        assert!(row.fit.down_px.abs() < 0.02 + 3.0 * down_error, "{row:?}");
    }
}
