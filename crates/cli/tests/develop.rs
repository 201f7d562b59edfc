//! `dioptric develop` on the built program: raw files to pictures, and files that are none.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{CAMERA, check_error, output, read_picture, sheet};
use image::{ImageBuffer, Luma};
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

/// Runs the small camera without noise, with one change to its data sheet; returns its codes and the report of
/// developing its raw file.
fn run_and_develop(
    folder: &Path,
    (before, after): (&str, &str),
    options: &[&str],
) -> (ImageBuffer<Luma<u16>, Vec<u16>>, Value) {
    let sheet = sheet();
    assert!(sheet.contains(before));
    fs::write(folder.join("own.ron"), sheet.replacen(before, after, 1)).unwrap();
    let usual =
        ["run", "camera.ron", "--out", "run", "--quiet", "--sensor", "own.ron", "--also", "raw-dng,picture-png16"];
    output(folder, &[&usual, &["--noise", "none", "--denoise", "0"][..], options].concat());
    (read_picture(&folder.join("run/raw.png")).into_luma16(), develop(folder, &["--denoise", "0"]))
}

/// Returns the only note of a report, and checks that the file's description is the same.
#[track_caller]
fn only_note(report: &Value) -> String {
    let notes = report["notes"].as_array().unwrap();
    assert_eq!((notes.len(), &notes[0]), (1, &report["description"]));
    notes[0].as_str().unwrap().to_owned()
}

#[test]
fn rows_of_two_times_are_merged_in_the_picture_and_marked_in_the_raw_file() {
    let folder = folder();
    let options = ["--interleaved-ratio", "8", "--curve", "linear"];
    let (codes, report) = run_and_develop(folder.path(), ("", ""), &options);
    let at = |row: u32| f64::from(codes.get_pixel(24, row).0[0]);
    // Long rows 16 and 17 between short ones; half a code of some 300 of them.
    for row in [16, 17] {
        let ratio = 2.0 * at(row) / (at(row - 2) + at(row + 2));
        assert!((ratio / 8.0 - 1.0).abs() < 3e-3, "row {row}: {ratio}");
    }
    let picture = read_picture(&folder.path().join("run/picture.png")).into_rgb8();
    let green = |row: u32| picture.get_pixel(24, row).0[1];
    let rows: Vec<u8> = (12..20).map(green).collect();
    assert!(rows.iter().all(|code| code.abs_diff(rows[0]) <= 1) && rows[0] > 20, "{rows:?}");
    let note = only_note(&report);
    assert!(note.contains("2 of the stated time, then 2 of 1/8 of it"), "{note}");
}

#[test]
fn split_pixels_reach_beyond_the_large_photodiode_and_the_raw_file_is_marked() {
    let folder = folder();
    let small =
        "split_pixel: (area_ratio: 10.0, conversion_gain_v_per_e: 3.0e-5, full_well_e: 33000.0, read_noise_e: 3.0),";
    let split = format!("{small}\n    full_well_e: 33000.0,");
    let code = |sheet: (&str, &str), time_s: &str| {
        let options = ["--exposure-s", time_s, "--curve", "linear"];
        let (codes, report) = run_and_develop(folder.path(), sheet, &options);
        let picture = read_picture(&folder.path().join("run/picture-16.png")).into_rgb16();
        (codes.get_pixel(24, 16).0[0], f64::from(picture.get_pixel(24, 16).0[1]), report)
    };
    // The large photodiode under green saturates at 31 µs.
    let (below, above) = ("1e-5", "1e-4");
    let (whole, split) = (("", ""), ("full_well_e: 33000.0,", split.as_str()));
    let [whole_below, whole_above, split_below, split_above] =
        [(whole, below), (whole, above), (split, below), (split, above)].map(|(sheet, time_s)| code(sheet, time_s));
    assert_eq!((whole_above.0, whole_above.1, split_above.0), (16220, 65535.0, 16220));
    // Ten times the range on the same codes, and light in proportion past it: half a code of 2091.
    for ratio in [whole_below.1 / split_below.1, split_above.1 / split_below.1] {
        assert!((ratio / 10.0 - 1.0).abs() < 1e-3, "{ratio}");
    }
    assert!(folder.path().join("run/raw-small.dng").is_file() && folder.path().join("run/raw-small.png").is_file());
    for note in [only_note(&split_below.2), only_note(&split_above.2)] {
        assert_eq!(note, "this raw frame holds the large photodiodes of split pixels, without the small ones");
    }
    assert!(whole_above.2["notes"].as_array().unwrap().is_empty());
}

#[test]
fn a_filter_exposed_for_a_quarter_of_the_time_stays_neutral_through_its_raw_file() {
    let folder = folder();
    let name = r#"(name: "R", "#;
    let part = format!("{name}exposure_fraction: 0.25, ");
    let options = ["--exposure-s", "2e-6"];
    let (whole, _) = run_and_develop(folder.path(), ("", ""), &options);
    let (codes, report) = run_and_develop(folder.path(), (name, &part), &options);
    let at = |codes: &ImageBuffer<Luma<u16>, Vec<u16>>, column: u32| f64::from(codes.get_pixel(column, 16).0[0]);
    let shares = [24, 25].map(|column| at(&codes, column) / at(&whole, column));
    // Half a code of 170.
    assert!((shares[0] - 0.25).abs() < 1e-3 && shares[1] == 1.0, "{shares:?}");
    assert!(report["notes"].as_array().unwrap().is_empty() && report["description"].is_null());
    let [own, through] =
        ["run/picture.png", "out/picture.png"].map(|name| read_picture(&folder.path().join(name)).into_rgb8());
    let off = own.iter().zip(through.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off <= 3, "{off}");
    let [r, g, b] = through.get_pixel(24, 16).0.map(i32::from);
    assert!((r - g).abs() <= 3 && (b - g).abs() <= 3, "{r} {g} {b}");
}

#[test]
fn raw_files_of_several_frames_are_marked() {
    let folder = folder();
    for (options, words) in [
        (&["--burst", "3"][..], "the first of 3 frames of a burst"),
        (&["--bracket-stops", "0,-2"], "the first of 2 frames of a bracket"),
    ] {
        let (_, report) = run_and_develop(folder.path(), ("", ""), options);
        assert!(only_note(&report).ends_with(words), "{report}");
    }
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
fn pixels_that_are_read_as_one_are_those_of_picture_and_raw_file() {
    let folder = folder();
    let mut means = Vec::new();
    for (kind, time_s) in [("none", "4e-6"), ("charge:2", "1e-6"), ("voltage:2", "4e-6"), ("digital:2", "4e-6")] {
        let (codes, report) = run_and_develop(folder.path(), ("", ""), &["--binning", kind, "--exposure-s", time_s]);
        let size = if kind == "none" { (48, 32) } else { (24, 16) };
        assert_eq!((codes.dimensions(), &report["mosaic"]), (size, &serde_json::json!(["RG", "GB"])), "{kind}");
        assert!(report["notes"].as_array().unwrap().is_empty(), "{kind}");
        let picture = read_picture(&folder.path().join("run/picture-16.png")).into_rgb16();
        assert_eq!(picture.dimensions(), size, "{kind}");
        means.push(f64::from(picture.get_pixel(size.0 / 2, size.1 / 2).0[1]));
    }
    // The picture of an even plane is the same, whatever its pixels are read from.
    assert!(means.iter().all(|mean| (mean / means[0] - 1.0).abs() < 0.01 && *mean > 5000.0), "{means:?}");
    let run = common::dioptric(folder.path(), &["run", "camera.ron", "--out", "run", "--binning", "charge:2"]);
    let told = String::from_utf8_lossy(&run.stderr);
    assert!(told.contains("24 × 16 pixels of 400 µm are read from 48 × 32 of 200 µm"), "{told}");
    let refused = |more: &[&str], words: &[&str]| {
        check_error(folder.path(), &[&["run", "camera.ron", "--out", "none"], more].concat(), words);
    };
    refused(&["--binning", "charge:1"], &["binning", "2 to 16"]);
    refused(&["--binning", "sums"], &["sums", "charge:2"]);
    refused(&["--binning", "digital:3"], &["65535"]);
    refused(&["--binning", "charge:2", "--interleaved-ratio", "4"], &["binning", "Single"]);
    refused(&["--binning", "charge:2", "--dual-pixel", "left-right"], &["dual_pixel", "binning"]);
}

#[test]
fn pixels_in_the_dark_go_with_the_raw_file_and_set_its_black() {
    let folder = folder();
    let black =
        |clamp: &str| format!("optical_black: Some((rows: 4, columns: 8, clamp: {clamp})),\n    full_well_e: 33000.0,");
    let [kept, clamped] = ["None", "Row"].map(|clamp| {
        let changed = black(clamp);
        let options = ["--exposure-s", "1e-5"];
        run_and_develop(folder.path(), ("full_well_e: 33000.0,", &changed), &options)
    });
    assert_eq!((kept.0.dimensions(), clamped.0.dimensions()), ((48, 32), (48, 32)));
    assert_eq!((&clamped.1["stored_px"], &clamped.1["masked"]), (&serde_json::json!([48, 32]), &Value::Null));
    let (codes, report) = run_and_develop(folder.path(), ("full_well_e: 33000.0,", &black("None")), &[]);
    assert_eq!((codes.dimensions(), &report["stored_px"]), ((48, 32), &serde_json::json!([56, 36])));
    assert_eq!(report["masked"]["n_pixels"], 56 * 36 - 48 * 32);
    let by_masked = develop(folder.path(), &["--denoise", "0", "--black", "masked"]);
    let above = report["masked"]["above_black"][0].as_f64().unwrap();
    let shift = by_masked["black"].as_f64().unwrap() - report["black"].as_f64().unwrap();
    assert!((shift - above).abs() < 1e-9, "{shift} {above}");
    let refused = |line: &[&str], words: &[&str]| {
        check_error(folder.path(), &[&["develop", "run/raw.dng", "--out", "none"], line].concat(), words);
    };
    refused(&["--black", "white"], &["white", "masked"]);
    refused(&["--profile", "camera.ron"], &["camera.ron", "camera profile"]);
    refused(&["--profile", "none.dcp"], &["none.dcp", "cannot be read"]);
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
