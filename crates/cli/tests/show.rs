//! `dioptric show` and the displays of `dioptric measure color` on the built program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{check_error, dioptric, output};
use image::{ImageBuffer, Rgb};
use serde_json::Value;

/// Returns a folder with `a.png`, a gray ramp, and `b.png`, the same with a fine pattern of red and green.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let save = |name: &str, color: &dyn Fn(u32, u32) -> [u8; 3]| {
        let picture = ImageBuffer::from_fn(96, 64, |x, y| Rgb(color(x, y)));
        dioptric_pictures::save(&picture.into(), &folder.path().join(name)).unwrap();
    };
    save("a.png", &|x, _| [60 + x as u8; 3]);
    save("b.png", &|x, y| {
        if (x + y) % 2 == 0 {
            [80 + x as u8, 40 + x as u8, 60 + x as u8]
        } else {
            [40 + x as u8, 75 + x as u8, 60 + x as u8]
        }
    });
    folder
}

fn json(folder: &Path, line: &[&str]) -> Value {
    serde_json::from_str(&output(folder, &[line, &["--json"]].concat())).unwrap()
}

#[test]
fn a_shown_picture_is_a_scene_that_a_camera_photographs() {
    let folder = folder();
    let shown =
        json(folder.path(), &["show", "a.png", "--display", "apple-studio", "--distance-m", "0.5", "-o", "a.exr"]);
    assert_eq!((shown["samples"][0].as_u64(), shown["samples"][1].as_u64()), (Some(96), Some(64)));
    // 218 pixels an inch, half a metre away.
    let wanted = 0.5 * 1_f64.to_radians() / (0.0254 / 218.0);
    assert!((shown["pixels_per_degree"].as_f64().unwrap() / wanted - 1.0).abs() < 1e-4);
    assert!(shown["band_error"].as_f64().unwrap() < 0.01);
    let line = ["run", "--scene", "a.exr", "--lens", "thin:8mm:f4", "--pixels", "48x32", "--out", "run"];
    output(folder.path(), &[&line[..], &["--quiet"]].concat());
    let report: Value = serde_json::from_slice(&fs::read(folder.path().join("run/report.json")).unwrap()).unwrap();
    assert!(report["sensor"]["channels"][1]["mean_e"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_display_of_a_file_has_its_white_and_its_stripes() {
    let folder = folder();
    let primary = |from: f64, to: f64| format!("(wavelengths_nm: [{from}, {to}], values: [1.0, 1.0])");
    let text = format!(
        "(name: \"mine\", source: \"made up\", primaries: ({}, {}, {}), white_cd_m2: 250.0, black_cd_m2: 0.5, curve: Gamma(2.2), \
         pixel_pitch_um: 100.0, pixels: Stripes)",
        primary(600.0, 680.0),
        primary(510.0, 570.0),
        primary(430.0, 480.0)
    );
    fs::write(folder.path().join("mine.ron"), &text).unwrap();
    let shown = json(folder.path(), &["show", "a.png", "--display", "mine.ron", "-o", "a.exr"]);
    assert_eq!((shown["samples"][0].as_u64(), shown["display"].as_str()), (Some(288), Some("mine")));
    assert!((shown["white_cd_m2"].as_f64().unwrap() - 250.0).abs() < 1e-6);
    let brighter =
        json(folder.path(), &["show", "a.png", "--display", "mine.ron", "--white-cd-m2", "500", "-o", "b.exr"]);
    let mean = |shown: &Value| shown["mean_luminance_cd_m2"].as_f64().unwrap();
    // Black stays at half a candela.
    assert!((mean(&brighter) / mean(&shown) - 2.0).abs() < 0.02);
}

#[test]
fn pictures_are_compared_on_a_display() {
    let folder = folder();
    let mean = |options: &[&str]| {
        let line = [&["measure", "color", "a.png", "--against", "b.png"], options].concat();
        json(folder.path(), &line)["scielab"]["mean"].as_f64().unwrap()
    };
    let near = mean(&["--display", "srgb", "--distance-m", "0.3"]);
    let far = mean(&["--display", "srgb", "--distance-m", "3"]);
    assert!(far < 0.5 * near, "{far} {near}");
    // As many pixels a degree, and the same primaries: the plain comparison.
    let plain = json(
        folder.path(),
        &["measure", "color", "a.png", "--against", "b.png", "--display", "srgb", "--distance-m", "0.3"],
    )["pixels_per_degree"]
        .to_string();
    assert!((mean(&["--pixels-per-degree", &plain]) / near - 1.0).abs() < 0.01);
    // Finer pixels blend at once.
    assert!(mean(&["--display", "apple-studio", "--distance-m", "0.3"]) < 0.5 * near);
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let folder = folder();
    let refused = |options: &[&str], words: &[&str]| {
        check_error(folder.path(), &[&["show", "a.png", "-o", "none.exr"], options].concat(), words);
    };
    refused(&["--display", "lcd"], &["lcd", "display-p3"]);
    refused(&["--display", "lcd.ron"], &["lcd.ron", "No such file"]);
    refused(&["--distance-m", "0"], &["--distance-m is 0", "expected"]);
    refused(&["--white-cd-m2", "-5"], &["--white-cd-m2 is -5"]);
    refused(&["--wavelengths-nm", "500,600"], &["tell its three primaries apart"]);
    fs::write(folder.path().join("wrong.ron"), "(name: \"x\", brightness: 3)").unwrap();
    check_error(
        folder.path(),
        &["show", "a.png", "-o", "none.exr", "--display", "wrong.ron"],
        &["wrong.ron:1", "brightness"],
    );
    let run = dioptric(folder.path(), &["measure", "color", "a.png", "--display", "srgb"]);
    assert!(!run.status.success());
}
