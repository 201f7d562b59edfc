//! A world as the scene of a camera file.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::fs;

use dioptric_pipeline::{Camera, KeptCamera, RenderEffort, SceneSource, Silent, WorldSpec};
use dioptric_spectrum::{Bands, Cancel, Illuminant, WavelengthGrid};

/// A gray wall 2 m before the camera under a lamp.
const WORLD: &str = r#"
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 14
WorldBegin
LightSource "point" "point3 from" [ 0.5 0.5 1 ] "spectrum I" [ 300 1 900 1 ]
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -1 -1 2  -1 1 2  1 1 2  1 -1 2 ]
"#;

const CAMERA: &str = r#"(
    name: "wall",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(5.0),
    focus: NearObject,
    film: Pixels(columns: 40, rows: 24, pitch_um: 150.0),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "wall.pbrt", effort: Samples(32), size: (96, 64)))),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

fn camera(text: &str) -> (tempfile::TempDir, KeptCamera) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), WORLD).unwrap();
    let camera = Camera::parse(text, &folder.path().join("camera.ron")).unwrap();
    (folder, KeptCamera::new(camera))
}

#[test]
fn both_methods_end_in_a_picture() {
    for text in [CAMERA.to_owned(), CAMERA.replace("effort:", "method: Forward, effort:")] {
        let (_folder, kept) = camera(&text);
        let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
        assert!((capture.scene.near_m - 2.0).abs() < 1e-6 && capture.place.columns == 40);
        // A change of the sensor's noise renders nothing anew.
        let before = kept.stage_counts();
        kept.with(|camera| camera.seed = 9).capture(&Silent, &Cancel::new()).unwrap();
        assert_eq!(kept.stage_counts().irradiance, before.irradiance);
        assert!(capture.irradiance.summary.mean.iter().all(|mean| *mean > 0.0));
    }
}

#[test]
fn part_has_the_samples_of_the_whole() {
    let (_folder, kept) = camera(CAMERA);
    let render = kept.world_render(&Silent, &Cancel::new()).unwrap();
    let part = render.clone().cropped((5, 3), (7, 4)).unwrap();
    let [whole, part] = [render, part].map(|render| {
        let mut renderer = render.renderer().unwrap();
        let effort = RenderEffort::Samples(16);
        render.refine(&mut renderer, effort, &Silent, &Cancel::new(), &mut |_| Ok(true)).unwrap();
        renderer.rendering().picture
    });
    assert_eq!((part.rows(), part.columns()), (4, 7));
    for (row, column) in [(0, 0), (3, 6), (2, 1)] {
        assert_eq!(part.spectrum_at(row, column), whole.spectrum_at(row + 3, column + 5));
    }
}

#[test]
fn camera_file_states_the_same_lens_for_both() {
    let (_folder, kept) = camera(CAMERA);
    // What is kept is an irradiance of this film, and nothing else is taken for it.
    let image = kept.irradiance(&Silent, &Cancel::new()).unwrap();
    assert_eq!(image.size(), (24, 40));
    let scene = kept.world(&Silent, &Cancel::new()).unwrap();
    assert_eq!(scene.cameras().len(), 1);
    let still_life = kept.with(|camera| camera.scene.source = SceneSource::StillLife { columns: 8, rows: 8 });
    assert!(still_life.world(&Silent, &Cancel::new()).unwrap_err().to_string().contains("it is no world"));
}

#[test]
fn worlds_keep_their_own_light() {
    let spec = WorldSpec::of_file("wall.pbrt".into());
    assert_eq!(spec.effort, RenderEffort::Samples(64));
    for (from, to, words) in [
        ("scene: (", "scene: (illuminance_lux: 100.0, ", "lights and depths of its own"),
        ("Samples(32)", "Samples(0)", "Samples is 0"),
        ("Samples(32)", "Noise(-1.0)", "Noise is -1"),
        ("effort:", "unit_m: 0.0, effort:", "unit_m is 0"),
    ] {
        let error = Camera::parse(&CAMERA.replace(from, to), "camera.ron".as_ref()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let (_folder, kept) = camera(&CAMERA.replace("sensor:", "diffraction: Wave,\n    sensor:"));
    let error = kept.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("diffraction: Wave") && error.contains("carry no waves"), "{error}");
}

#[test]
fn light_on_the_scene_is_that_of_its_lamps() {
    // A lamp of daylight, and another of incandescence that a wall hides from what is seen.
    let lamp = |from: &str, kind: &str| {
        format!("LightSource \"point\" \"point3 from\" [ {from} ] \"spectrum I\" \"stdillum-{kind}\"\n")
    };
    let start = WORLD.find("LightSource").unwrap();
    let end = start + WORLD[start..].find('\n').unwrap() + 1;
    let lamps = lamp("0.5 0.5 1", "D65") + &lamp("0.5 0.5 3", "A");
    let (folder, kept) = camera(CAMERA);
    fs::write(folder.path().join("wall.pbrt"), WORLD.replace(&WORLD[start..end], &lamps)).unwrap();
    let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
    let light = capture.scene.light.clone().unwrap();
    let Illuminant::Spectrum(found) = &light.illuminant else { panic!("{light:?}") };
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let daylight = Illuminant::D65.white_radiance(&grid, 100.0);
    let middle = found.values()[15] / daylight[15];
    for (found, daylight) in found.values().iter().zip(daylight) {
        // The file's table of D65 has steps of 5 nm or so, and the world evaluates it in single precision.
        assert!((found / daylight / middle - 1.0).abs() < 0.01, "{found} {daylight}");
    }
}

#[test]
fn cancelled_rendering_ends() {
    let (_folder, kept) = camera(CAMERA);
    let cancel = Cancel::new();
    cancel.cancel();
    assert!(kept.capture(&Silent, &cancel).is_err());
}
