//! `dioptric render` on the built program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use common::{CAMERA, check_error, dioptric, output, read_picture};

/// A gray wall 2 m before the camera, and a lamp beside the view.
const WORLD: &str = r#"
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 20
WorldBegin
LightSource "point" "point3 from" [ 0.5 0.5 1 ] "spectrum I" [ 300 1 900 1 ]
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -1 -1 2  -1 1 2  1 1 2  1 -1 2 ]
"#;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), WORLD).unwrap();
    folder
}

const BANDS: &[&str] = &["--wavelengths-nm", "450,550,650", "--quiet"];
const LENS: &[&str] = &["--lens", "dgauss-50mm", "--f-number", "5"];

fn render(folder: &Path, options: &[&str]) {
    output(folder, &[&["render", "wall.pbrt"], LENS, BANDS, options].concat());
}

fn report(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap()
}

/// All that a rendering has gathered, and what came of it.
fn bits(folder: &Path) -> [Vec<u8>; 4] {
    ["render.state", "picture.png", "irradiance.exr", "auxiliary.exr"].map(|name| fs::read(folder.join(name)).unwrap())
}

#[test]
fn world_ends_in_a_picture_and_a_report() {
    let folder = folder();
    render(folder.path(), &["--samples", "16", "-o", "out"]);
    let out = folder.path().join("out");
    for name in ["irradiance.exr", "auxiliary.exr", "picture.png", "report.html", "render.state", "kept.ron"] {
        assert!(out.join(name).exists(), "{name}");
    }
    let report = report(&out);
    assert_eq!(report["rendering"]["samples_per_pixel"], 16.0);
    // The wall 2 m before the entrance pupil is in focus, and the lens is the one asked for.
    let focus_mm = report["lens"]["distance_mm"].as_f64().unwrap();
    assert!((1900.0..2000.0).contains(&focus_mm), "{focus_mm}");
    // Single precision.
    assert!((report["scene"]["near_m"].as_f64().unwrap() - 2.0).abs() < 1e-6);
    // What follows the film starts from its irradiance.
    let again = dioptric(folder.path(), &["run", "--from", "out", "--seed", "2", "--memory", "2GiB", "-o", "again"]);
    assert!(again.status.success() && folder.path().join("again/picture.png").exists());
    // No imaging takes the budget's memory.
    assert!(String::from_utf8_lossy(&again.stderr).contains("--memory limits scene and imaging"));
    output(folder.path(), &["sense", "out/irradiance.exr", "--sensor", "nikon-d100", "--quiet", "-o", "sensed"]);
}

/// The scene beside the rendering images as the world does: a wall that hides nothing, in two layers.
#[test]
fn scene_seen_from_the_pupil_is_one_for_run() {
    let folder = folder();
    render(folder.path(), &["--samples", "16", "--layers", "2", "-o", "out"]);
    assert!(report(&folder.path().join("out"))["files"].as_array().unwrap().iter().any(|name| name == "scene.exr"));
    let pitch_um = report(&folder.path().join("out"))["film"]["pitch_um"].to_string();
    let film = ["--pixels", "24x16", "--pixel-um", &pitch_um, "-o", "blurred"];
    output(folder.path(), &[&["run", "--scene", "out/scene.exr"], &film[..], LENS].concat());
    let mean = |of: &str| report(&folder.path().join(of))["irradiance"]["mean_w_m2_nm"][1].as_f64().unwrap();
    // But for the noise of 16 samples a pixel; .3 % is found.
    assert!((mean("blurred") / mean("out") - 1.0).abs() < 0.01, "{} {}", mean("out"), mean("blurred"));
    // What time ends has a scene of as many samples.
    render(folder.path(), &["--seconds", "0.2", "--layers", "1", "-o", "timed"]);
    assert!(folder.path().join("timed/scene.exr").exists());
    check_error(folder.path(), &["render", "wall.pbrt", "--layers", "2"], &["--layers", "expected --lens or --camera"]);
}

#[test]
fn camera_of_the_file_sees_radiance() {
    let folder = folder();
    output(folder.path(), &[&["render", "wall.pbrt", "--samples", "16", "-o", "out"], BANDS].concat());
    let out = folder.path().join("out");
    assert!(out.join("radiance.exr").exists() && out.join("picture.png").exists());
    assert!(!out.join("irradiance.exr").exists());
    // ρ/π I cos θ / d² at the middle of each pixel, with I = 1 W/(sr nm), the lamp 1 m before the wall and 0.5 m aside and up.
    let half_tan = 10_f64.to_radians().tan();
    let at = |n: usize, i: usize| (2.0 * (i as f64 + 0.5) / n as f64 - 1.0) * half_tan * 2.0 * n as f64 / 16.0;
    let radiance = |x: f64, y: f64| {
        let square = (x - 0.5).powi(2) + (y - 0.5).powi(2) + 1.0;
        0.5 / std::f64::consts::PI * square.powf(-1.5)
    };
    let sum: f64 = (0..24).flat_map(|x| (0..16).map(move |y| radiance(at(24, x), at(16, y)))).sum();
    // The middle of a pixel stands for its mean to 1e-4, and the lamp leaves no noise but that of places in it.
    let mean = report(&out)["rendering"]["mean"][1].as_f64().unwrap();
    assert!((mean / (sum / 384.0) - 1.0).abs() < 1e-3, "{mean} {sum}");
}

#[test]
fn part_of_a_picture_has_no_sensor() {
    let folder = folder();
    render(folder.path(), &["--samples", "16", "--crop", "5,3,7,4", "-o", "part"]);
    let out = folder.path().join("part");
    assert_eq!(report(&out)["rendering"]["size"], serde_json::json!([7, 4]));
    assert!(out.join("irradiance.exr").exists() && !out.join("raw.png").exists());
    let beyond = [&["render", "wall.pbrt"], LENS, BANDS, &["--crop", "20,0,9,9"]].concat();
    check_error(folder.path(), &beyond, &["20,0", "within a picture"]);
}

#[test]
fn camera_file_lends_lens_and_sensor() {
    let folder = folder();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    let words = ["render", "wall.pbrt", "--camera", "camera.ron", "--samples", "16", "--quiet", "-o", "out"];
    output(folder.path(), &words);
    let report = report(&folder.path().join("out"));
    assert_eq!(report["film"]["columns"], 48);
    // The same camera with the world as its scene is the same picture.
    let of_world = r#"scene: (source: World((file: "wall.pbrt", effort: Samples(16)))),"#;
    let start = CAMERA.find("scene:").unwrap();
    let end = start + CAMERA[start..].find('\n').unwrap();
    fs::write(folder.path().join("world.ron"), CAMERA.replace(&CAMERA[start..end], of_world)).unwrap();
    output(folder.path(), &["run", "world.ron", "--quiet", "-o", "run"]);
    let picture = |name: &str| fs::read(folder.path().join(name).join("picture.png")).unwrap();
    assert!(picture("out") == picture("run"));
}

#[test]
fn resumed_rendering_has_the_same_bits() {
    let folder = folder();
    let read = |name: &str| bits(&folder.path().join(name));
    render(folder.path(), &["--samples", "64", "-o", "whole"]);
    render(folder.path(), &["--samples", "32", "-o", "parts", "--threads", "1"]);
    assert!(read("whole") != read("parts"));
    render(folder.path(), &["--samples", "64", "--resume", "-o", "parts"]);
    assert!(read("whole") == read("parts"));
    // Another world is not continued.
    fs::write(folder.path().join("wall.pbrt"), WORLD.replace("0.5 0.5 0.5", "0.25 0.5 0.5")).unwrap();
    let words = [&["render", "wall.pbrt"], LENS, BANDS, &["--samples", "96", "--resume", "-o", "parts"]].concat();
    check_error(folder.path(), &words, &["render.state", "another rendering"]);
}

#[test]
fn killed_rendering_is_continued_to_the_same_bits() {
    let folder = folder();
    let words = |out| [&["render", "wall.pbrt"], LENS, BANDS, &["--samples", "1024", "-o", out]].concat();
    let mut child = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(words("killed"))
        .current_dir(folder.path())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // The first checkpoint is written after the first pass.
    let (state, began) = (folder.path().join("killed/render.state"), Instant::now());
    while !state.exists() && began.elapsed() < Duration::from_secs(120) {
        thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(state.exists());
    // What there is can be looked at before the end, and gives way to the picture.
    let preview = folder.path().join("killed/preview.png");
    let shown = read_picture(&preview);
    assert!(shown.width() >= 24 && shown.height() >= 16);
    output(folder.path(), &[&words("killed")[..], &["--resume"]].concat());
    assert!(!preview.exists());
    output(folder.path(), &words("whole"));
    let read = |name: &str| bits(&folder.path().join(name));
    assert!(read("killed") == read("whole"));
}

/// Lenses of f/4 before 120 × 80 pixels: 11 × 7 of them have their image of the pupil on the film.
const LIGHT_FIELD: &str = r#"(
    name: "light field",
    lens: Thin(focal_length_mm: 50.0, diameter_mm: 12.5),
    focus: DistanceMm(1000.0),
    film: Pixels(columns: 120, rows: 80, pitch_um: 20.0),
    light_field: Array((elements: Lenses(focal_length_mm: 0.8), pitch_mm: 0.2, gap_mm: 0.8)),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "wall.pbrt", effort: Samples(8)))),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

#[test]
fn light_field_ends_in_views_and_depth() {
    let folder = folder();
    fs::write(folder.path().join("camera.ron"), LIGHT_FIELD).unwrap();
    let words = ["lightfield", "camera.ron", "--refocus-m", "1,2", "--near-m", "0.8", "--far-m", "4", "--json"];
    let report: serde_json::Value =
        serde_json::from_str(&output(folder.path(), &[&words[..], &["-o", "out"]].concat())).unwrap();
    assert_eq!((&report["n_views"], &report["size"]), (&serde_json::json!([9, 9]), &serde_json::json!([7, 11])));
    // In focus neighboring views are alike; behind it they move the other way.
    let disparity_px = |i: usize| report["refocused"][i][1].as_f64().unwrap();
    assert!(disparity_px(0).abs() < 0.01 && disparity_px(1) < -0.1, "{report}");
    for name in report["files"].as_array().unwrap() {
        assert!(folder.path().join("out").join(name.as_str().unwrap()).exists(), "{name}");
    }
    // What was rendered is taken apart again without rendering.
    output(folder.path(), &[&words[..], &["--irradiance", "out/irradiance.exr", "-o", "again"]].concat());
    let picture = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(picture("out/views.png") == picture("again/views.png"));
    assert!(picture("out/depth.exr") == picture("again/depth.exr"));
    let plain = LIGHT_FIELD.replace("light_field: Array", "// Array");
    fs::write(folder.path().join("plain.ron"), plain).unwrap();
    check_error(folder.path(), &["lightfield", "plain.ron", "--quiet"], &["light_field", "the camera has none"]);
    check_error(folder.path(), &["lightfield", "camera.ron", "--refocus-m", "0"], &["--refocus-m is 0"]);
}

/// The demo's lens stands before it unless another is named; what it cannot have is refused by name.
#[test]
fn built_in_still_life_is_rendered() {
    let folder = folder();
    let still_life = |options: &[&'static str]| {
        [&["render", "still-life", "--pixels", "30x20", "--samples", "8"], BANDS, options].concat()
    };
    output(folder.path(), &still_life(&["-o", "out"]));
    let out = folder.path().join("out");
    for name in ["irradiance.exr", "auxiliary.exr", "picture.png", "report.html", "render.state", "kept.ron"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(!out.join("preview.png").exists());
    let report = report(&out);
    assert_eq!((&report["rendering"]["world"], &report["rendering"]["size"]), (&"still-life".into(), &[30, 20].into()));
    // Taken up again it makes no further pass, and once more from the start the same bits.
    output(folder.path(), &still_life(&["-o", "whole"]));
    output(folder.path(), &still_life(&["--resume", "-o", "out"]));
    assert_eq!(bits(&out), bits(&folder.path().join("whole")));
    check_error(folder.path(), &still_life(&["--unit-m", "2"]), &["unit_m is 2"]);
    let infrared = ["render", "still-life", "--wavelengths-nm", "900:1200:100", "--quiet"];
    check_error(folder.path(), &infrared, &["850 to 1250 nm", "within 300 to 1100 nm"]);
}

#[test]
fn noise_and_time_end_a_rendering() {
    let folder = folder();
    render(folder.path(), &["--noise", "0.05", "-o", "noise"]);
    let error = &report(&folder.path().join("noise"))["rendering"];
    // What is aimed at is the noise of a pixel over all bands: that of one band is at most √3 times as large here.
    assert!(error["relative_standard_error"][1].as_f64().unwrap() < 0.1, "{error}");
    render(folder.path(), &["--seconds", "0.1", "-o", "seconds"]);
    assert!(folder.path().join("seconds/picture.png").exists());
}

/// A mesh alone, without camera, light or material, gives a picture at once, and says what stands in for each.
#[test]
fn a_mesh_alone_gives_a_picture() {
    let folder = folder();
    let solid = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 9 0\nendloop\nendfacet\nendsolid a\n";
    fs::write(folder.path().join("part.stl"), solid).unwrap();
    let words =
        ["render", "part.stl", "--pixels", "30x20", "--samples", "8", "--wavelengths-nm", "450,550,650", "-o", "out"];
    let said = Command::new(env!("CARGO_BIN_EXE_dioptric")).args(words).current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
    for word in ["no camera", "gives light", "without a material"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let picture = read_picture(&folder.path().join("out/picture.png")).to_rgb8();
    assert!(picture.pixels().filter(|p| p.0 != [255; 3]).count() > 20, "the triangle stands before the sky");
    // Seen by what the words say, and from beyond the other side of it nothing but the lamp's light is lost.
    let aside =
        ["--eye", "-3,-4,9", "--look-at", "2,2,0", "--up", "0,1,0", "--light", "3,3,5,800", "--sky", "day:30,200"];
    output(folder.path(), &[&words[..8], &["-o", "aside", "--quiet"], &aside].concat());
    let text = output(folder.path(), &["world", "info", "part.stl", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&info["n_primitives"], &info["cameras"]), (&1.into(), &serde_json::json!([])));
    assert_eq!(info["bounds_m"][1][0], 9.0);
}

/// A file that moves lists what it has; at a time it stands elsewhere, and what was rendered at another isn't gone on with.
#[test]
fn moments_and_variants_are_listed_and_shown() {
    let folder = folder();
    fs::write(folder.path().join("go.glb"), include_bytes!("../../world/tests/corpus/moving.glb")).unwrap();
    let info = |words: &[&str]| -> serde_json::Value {
        let text = output(folder.path(), &[&["world", "info", "go.glb", "--json"], words].concat());
        serde_json::from_str(&text).unwrap()
    };
    let still = info(&[]);
    assert_eq!(still["animations"], serde_json::json!([{"name": "go", "end_s": 2.0}]));
    assert_eq!(still["variants"], serde_json::json!(["day"]));
    // At 1 s the sheet is 1 m to the right and above, by the keys of a spline.
    let [at_rest, moved] =
        [still, info(&["--time", "1", "--animation", "1"])].map(|info| info["bounds_m"][1][0].as_f64());
    assert!(moved > at_rest, "{moved:?} {at_rest:?}");
    let words = |more: &[&'static str]| {
        let words = ["render", "go.glb", "--frame", "--pixels", "12x8", "--samples", "8", "-o", "out"];
        [&words[..], BANDS, more].concat()
    };
    output(folder.path(), &words(&["--time", "1"]));
    assert!(!dioptric(folder.path(), &words(&["--time", "1.5", "--resume"])).status.success());
    output(folder.path(), &words(&["--time", "1", "--resume"]));
}

/// What goes on is the content of all files: one that was touched or moved goes on, one of which an included material changed does not.
#[test]
fn resume_goes_by_contents() {
    let folder = folder();
    let parts = |at: &str, gray: &str| {
        fs::create_dir_all(folder.path().join(at)).unwrap();
        let text = WORLD.replace("Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]", "Include \"paint.pbrt\"");
        assert_ne!(text, WORLD);
        fs::write(folder.path().join(at).join("wall.pbrt"), text).unwrap();
        let paint = format!("Material \"diffuse\" \"rgb reflectance\" [ {gray} {gray} {gray} ]\n");
        fs::write(folder.path().join(at).join("paint.pbrt"), paint).unwrap();
    };
    let words = |at: &'static str, samples: &'static str, more: &'static [&'static str]| {
        [&["render", at, "--samples", samples, "-o", "out"], BANDS, more].concat()
    };
    parts("a", "0.5");
    output(folder.path(), &words("a/wall.pbrt", "8", &[]));
    // Written anew, elsewhere, with the same words.
    parts("b", "0.5");
    output(folder.path(), &words("b/wall.pbrt", "16", &["--resume"]));
    parts("b", "0.6");
    check_error(folder.path(), &words("b/wall.pbrt", "24", &["--resume"]), &["another rendering"]);
}

#[test]
fn bad_worlds_end_in_a_sentence() {
    let folder = folder();
    // Words of options are refused by the parser, which adds where help is.
    let check_usage = |folder: &Path, arguments: &[&str], words: &[&str]| {
        let run = dioptric(folder, arguments);
        let message = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(!run.status.success() && message.starts_with("error: "), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{words:?} in: {message}");
    };
    check_error(folder.path(), &["render", "none.pbrt", "--quiet"], &["none.pbrt"]);
    let pixels = [&["render", "wall.pbrt"], LENS, BANDS, &["--pixels", "24by16"]].concat();
    check_error(folder.path(), &pixels, &["--pixels is '24by16', expected WxH"]);
    check_error(folder.path(), &["render", "wall.pbrt", "--lens", "none", "--quiet"], &["none"]);
    fs::write(folder.path().join("bare.pbrt"), WORLD.replace("Camera \"perspective\" \"float fov\" 20\n", "")).unwrap();
    let camera = ["render", "bare.pbrt", "--quiet", "--camera", "left"];
    check_error(folder.path(), &camera, &["bare.pbrt", "'left'", "which has none"]);
    check_usage(folder.path(), &["render", "wall.pbrt", "--eye", "1,2", "--quiet"], &["--eye", "X,Y,Z"]);
    check_usage(folder.path(), &["render", "wall.pbrt", "--sky", "night", "--quiet"], &["--sky", "even:RADIANCE"]);
    fs::write(folder.path().join("broken.pbrt"), "WorldBegin\nShape \"sphere\" [\n").unwrap();
    check_error(folder.path(), &["render", "broken.pbrt", "--quiet"], &["broken.pbrt", "2"]);
}
