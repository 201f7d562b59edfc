//! Ghosts of a lamp in the dark: drawn by `run`, and met by rays from the film.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::fs;

use dioptric_pipeline::{Camera, KeptCamera, LensReflections, RenderEffort, RenderMethod, SceneSource, Silent};
use dioptric_spectrum::{Bands, Cancel};
use ndarray::Array2;

/// A disc that shines, 2 m before the camera.
const WORLD: &str = r#"
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 34
WorldBegin
AttributeBegin
AreaLightSource "diffuse" "spectrum L" [ 300 1000 900 1000 ] "bool twosided" true
Translate PLACE 2
Shape "disk" "float radius" 0.2
AttributeEnd
"#;

const CAMERA: &str = r#"(
    name: "lamp",
    lens: BuiltIn("dgauss-50mm"),
    lens_reading: (coating: Bare),
    stop: FNumber(4.0),
    focus: DistanceMm(2000.0),
    film: Pixels(columns: 48, rows: 32, pitch_um: 750.0),
    diffraction: None,
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "lamp.pbrt", bands: Center, effort: Samples(32), size: (144, 96)))),
    wavelengths: ListNm([470.0, 600.0]),
)"#;

/// To the upper left of the axis, and near it.
const ASIDE: &str = "0.45 0.25";
const NEAR: &str = "0.1 0.06";

fn kept(place: &str) -> (tempfile::TempDir, KeptCamera) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lamp.pbrt"), WORLD.replace("PLACE", place)).unwrap();
    let camera = Camera::parse(CAMERA, &folder.path().join("camera.ron")).unwrap();
    (folder, KeptCamera::new(camera))
}

fn by(kept: &KeptCamera, method: RenderMethod, reflections: LensReflections) -> KeptCamera {
    kept.with(|camera| {
        camera.lens_reflections = reflections;
        if let SceneSource::World(spec) = &mut camera.scene.source {
            spec.method = method;
        }
    })
}

fn sum(plane: &Array2<f32>, is_counted: impl Fn((usize, usize)) -> bool, power: i32) -> f64 {
    plane.indexed_iter().filter(|(at, _)| is_counted(*at)).map(|(_, value)| f64::from(*value).powi(power)).sum()
}

#[test]
fn ghosts_of_a_lamp_are_alike_both_ways() {
    let share = alike_both_ways(ASIDE, LensReflections::Ghosts);
    assert!((1e-4..0.2).contains(&share), "{share}");
}

/// Of a lamp far from the axis a film sends all light past the lens.
#[test]
fn ghosts_of_a_film_that_reflects_are_alike_both_ways() {
    let share = alike_both_ways(NEAR, LensReflections::Film(0.5));
    let (_folder, kept) = kept(NEAR);
    let pairs = by(&kept, RenderMethod::Forward, LensReflections::Ghosts).irradiance(&Silent, &Cancel::new()).unwrap();
    let of_pairs = pairs.summary.ghost_share.unwrap();
    assert!(share > 1.5 * of_pairs, "{share} {of_pairs}");
}

/// Checks both ways away from the lamp: in all, and quarter by quarter of the film. Returns the share of ghosts in all light.
fn alike_both_ways(place: &str, reflections: LensReflections) -> f64 {
    let (_folder, kept) = kept(place);
    let rendered = |reflections| {
        let render = by(&kept, RenderMethod::Backward, reflections).world_render(&Silent, &Cancel::new()).unwrap();
        let mut renderer = render.renderer().unwrap();
        let effort = RenderEffort::Samples(192);
        render.refine(&mut renderer, effort, &Silent, &Cancel::new(), &mut |_| Ok(true)).unwrap();
        renderer.rendering()
    };
    let (without, with) = (rendered(LensReflections::Off), rendered(reflections));
    let blurred =
        |reflections| by(&kept, RenderMethod::Forward, reflections).irradiance(&Silent, &Cancel::new()).unwrap();
    let (dark, ghosts) = (blurred(LensReflections::Off), blurred(reflections));
    for band in 0..2 {
        let image = &without.picture.planes()[band];
        let off = dark.band(band).unwrap();
        let (truth, error) = (&with.picture.planes()[band], &with.standard_error.planes()[band]);
        let drawn = ghosts.band(band).unwrap();
        let is_beside = |at: (usize, usize)| image[at] == 0.0 && off[at] == 0.0;
        let in_quarter = |quarter: usize| move |at: (usize, usize)| (at.0 / 16) * 2 + at.1 / 24 == quarter;
        let compare = |is_counted: &dyn Fn((usize, usize)) -> bool, least: f64| {
            let [truth, drawn] = [truth, &*drawn].map(|plane| sum(plane, is_counted, 1));
            let noise = sum(error, is_counted, 2).sqrt() / truth;
            assert!(truth > 0.0 && noise < 0.1, "{band}: {truth} {noise}");
            assert!((drawn / truth - 1.0).abs() < least + 3.0 * noise, "{band}: {drawn} {truth} ± {noise}");
        };
        // Beside the noise, what the lamp's cells and the samples at its rim leave of it.
        compare(&is_beside, 0.01);
        (0..4).for_each(|quarter| compare(&|at| is_beside(at) && in_quarter(quarter)(at), 0.03));
    }
    assert_eq!(dark.summary.ghost_share, None);
    ghosts.summary.ghost_share.unwrap()
}

/// Ghosts add light and change nothing else, and half of them falls on each of two photodiodes.
#[test]
fn photodiodes_share_ghosts() {
    let (_folder, kept) = kept(ASIDE);
    let kept = by(&kept, RenderMethod::Forward, LensReflections::Ghosts);
    let whole = kept.irradiance(&Silent, &Cancel::new()).unwrap();
    let halves = kept.with(|camera| camera.dual_pixel = Some("left-right:0:0.01".parse().unwrap()));
    let halves = halves.irradiance(&Silent, &Cancel::new()).unwrap();
    for band in 0..2 {
        let [left, right] = [0, 1].map(|part| halves.photodiodes()[part].band(band).unwrap().into_owned());
        // The lower right, where the lamp is not.
        let is_below = |(row, column): (usize, usize)| row >= 20 && column >= 30;
        let [left, right, whole] = [&left, &right, &*whole.band(band).unwrap()].map(|plane| sum(plane, is_below, 1));
        assert!(
            (left / right - 1.0).abs() < 1e-3 && ((left + right) / whole - 1.0).abs() < 1e-3,
            "{left} {right} {whole}"
        );
    }
}
