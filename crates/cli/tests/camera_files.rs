//! Camera and sensor files as the command line writes, describes and checks them.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    path::Path,
    process::{Command, Output},
};

fn dioptric(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

fn text(folder: &Path, arguments: &[&str]) -> String {
    let output = dioptric(folder, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refusal(folder: &Path, arguments: &[&str]) -> String {
    let output = dioptric(folder, arguments);
    assert!(!output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

#[test]
fn first_camera_file_is_right() {
    let folder = tempfile::tempdir().unwrap();
    text(folder.path(), &["camera", "init", "-o", "mine.ron"]);
    let found = text(folder.path(), &["camera", "check", "mine.ron"]);
    assert!(found.contains("mine.ron") && found.contains("f/2.03"), "{found}");
    // What is there stays.
    let message = refusal(folder.path(), &["camera", "init", "-o", "mine.ron"]);
    assert!(message.contains("mine.ron is there already"), "{message}");
    let shown = text(folder.path(), &["camera", "init"]);
    assert_eq!(shown, std::fs::read_to_string(folder.path().join("mine.ron")).unwrap());
}

#[test]
fn wrong_parts_of_a_camera_file_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let good = text(folder.path(), &["camera", "init"]);
    for (from, to, words) in [
        ("stop: AsGiven", "stop: FNumber(1.0)", ["2.028", "1"]),
        ("BuiltIn(\"nikon-d5100\")", "BuiltIn(\"nikon-d9\")", ["nikon-d9", "nikon-d5100"]),
        ("BuiltIn(\"dgauss-50mm\")", "File(\"none.zmx\")", ["none.zmx", "error: "]),
        ("source: StillLife(columns: 1080, rows: 720)", "source: File(\"none.exr\")", ["none.exr", "error: "]),
        ("seed: 1", "seeds: 1", ["mine.ron:", "seeds"]),
    ] {
        assert!(good.contains(from), "{from}");
        std::fs::write(folder.path().join("mine.ron"), good.replacen(from, to, 1)).unwrap();
        let message = refusal(folder.path(), &["camera", "check", "mine.ron"]);
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

#[test]
fn schemas_are_json() {
    let folder = tempfile::tempdir().unwrap();
    for (command, key) in [("camera", "lens"), ("sensor", "cfa")] {
        let schema: serde_json::Value = serde_json::from_str(&text(folder.path(), &[command, "schema"])).unwrap();
        assert!(schema["properties"][key].is_object(), "{command}");
    }
}

#[test]
fn sensor_files_read_back() {
    let folder = tempfile::tempdir().unwrap();
    assert!(text(folder.path(), &["sensor", "list"]).contains("imx363"));
    text(folder.path(), &["sensor", "init", "imx363", "-o", "mine.ron"]);
    let from_file = text(folder.path(), &["sensor", "show", "mine.ron"]);
    assert_eq!(from_file, text(folder.path(), &["sensor", "show", "imx363"]));
}

#[test]
fn movements_and_stops_are_taken_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let number = |arguments: &[&str], key: &str| -> f64 {
        let with_json = [arguments, &["--json"]].concat();
        let value: serde_json::Value = serde_json::from_str(&text(folder.path(), &with_json)).unwrap();
        value.pointer(key).unwrap_or_else(|| panic!("{key} in {value}")).as_f64().unwrap()
    };
    let stopped = number(&["lens", "info", "dgauss-50mm", "--f-number", "8"], "/0/f_number");
    assert!((stopped - 8.0).abs() < 1e-9, "{stopped}");
    // A lens that is shifted by 1 mm takes the image of a far point with it.
    let psf =
        ["psf", "dgauss-50mm", "--distances-mm", "inf", "--focus-mm", "inf", "--shift-mm", "1", "--f-number", "8"];
    let shifted = number(&psf, "/0/centroid_x_mm");
    assert!((shifted.abs() - 1.0).abs() < 1e-3, "{shifted}");
    text(folder.path(), &["lens", "draw", "dgauss-50mm", "--f-number", "8", "--rise-mm", "2", "-o", "lens.svg"]);
    text(folder.path(), &["lens", "analyze", "dgauss-50mm", "--tilt-deg", "1", "--fields-deg", "0", "--rings", "3"]);
}
