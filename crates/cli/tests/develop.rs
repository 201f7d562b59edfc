//! `dioptric develop` on the built program: raw files to pictures, and files that are none.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{CAMERA, check_error, output, read_picture};
use serde_json::Value;

/// Returns a folder with `run/raw.dng` of a small camera, and its picture.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    output(folder.path(), &["run", "camera.ron", "--out", "run", "--quiet", "--also", "raw-dng", "--denoise", "0"]);
    folder
}

fn develop(folder: &Path, options: &[&str]) -> Value {
    let line = [&["develop", "run/raw.dng", "--out", "out", "--json"], options].concat();
    serde_json::from_str(&output(folder, &line)).unwrap()
}

#[test]
fn a_raw_file_of_a_run_becomes_the_picture_of_the_run() {
    let folder = folder();
    let report = develop(folder.path(), &["--denoise", "0", "--also", "picture-png16,picture-tiff8"]);
    let [own, through] =
        ["run/picture.png", "out/picture.png"].map(|name| read_picture(&folder.path().join(name)).into_rgb8());
    assert_eq!(own.dimensions(), through.dimensions());
    // Levels and matrices are rounded in the file.
    let off = own.iter().zip(through.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off <= 3, "{off}");
    let run: Value = serde_json::from_slice(&fs::read(folder.path().join("run/report.json")).unwrap()).unwrap();
    let number = |report: &Value, key: &str| report[key].as_f64().unwrap();
    let time_s = number(&run["sensor"], "exposure_time_s");
    assert!((number(&report, "exposure_time_s") / time_s - 1.0).abs() < 1e-3);
    assert_eq!((report["orientation"].as_u64(), report["mosaic"][0].as_str().map(str::len)), (Some(1), Some(2)));
    assert!(report["notes"].as_array().unwrap().is_empty() && report["camera"]["noise"][0]["scale"].as_f64().is_some());
    assert!(folder.path().join("out/picture-16.png").exists() && folder.path().join("out/picture-8.tiff").exists());
    let written: Value = serde_json::from_slice(&fs::read(folder.path().join("out/report.json")).unwrap()).unwrap();
    assert_eq!(written, report);
}

#[test]
fn processing_comes_from_options_and_from_a_camera_file() {
    let folder = folder();
    let picture = || read_picture(&folder.path().join("out/picture.png")).into_rgb8();
    let camera = CAMERA.trim_end().trim_end_matches(')').to_owned()
        + "\n    processing: (demosaic: Bilinear, curve: Linear, brightness: Factor(0.5), white: None),\n)\n";
    fs::write(folder.path().join("plain.ron"), camera).unwrap();
    develop(folder.path(), &["--camera", "plain.ron"]);
    let by_file = picture();
    let options = ["--demosaic", "bilinear", "--curve", "linear", "--brightness", "0.5", "--white", "none"];
    develop(folder.path(), &options);
    assert_eq!(by_file, picture());
    develop(folder.path(), &["--space", "display-p3", "--brightness", "99%:0.9", "--defect-threshold", "0.2"]);
    assert_ne!(by_file, picture());
}

#[test]
fn what_cannot_be_developed_is_refused_and_leaves_nothing() {
    let folder = folder();
    let refused = |line: &[&str], words: &[&str]| {
        let line = [&["develop"], line, &["--out", "none"]].concat();
        check_error(folder.path(), &line, words);
        assert!(!folder.path().join("none").exists());
    };
    refused(&["run/picture.png"], &["picture.png", "TIFF"]);
    refused(&["nothing.dng"], &["nothing.dng", "cannot be read"]);
    refused(&["run/raw.dng", "--color", "roots"], &["quantum efficiencies"]);
    refused(&["run/raw.dng", "--lens-corrections", "all"], &["simulated lens"]);
    refused(&["run/raw.dng", "--also", "electrons"], &["electrons", "picture-png16"]);
    refused(&["run/raw.dng", "--curve", "steep"], &["steep", "filmic:CONTRAST"]);
    refused(&["run/raw.dng", "--brightness", "bright"], &["bright", "99%:0.9"]);
    refused(&["run/raw.dng", "--space", "adobe"], &["adobe", "display-p3"]);
    let whole = fs::read(folder.path().join("run/raw.dng")).unwrap();
    fs::write(folder.path().join("cut.dng"), &whole[..whole.len() / 2]).unwrap();
    refused(&["cut.dng"], &["cut.dng", "ends before"]);
}
