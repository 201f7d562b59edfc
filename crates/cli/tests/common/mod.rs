//! Runs the built program.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

/// A camera before an even target, on 48 × 32 pixels of 200 µm: a run takes a moment.
#[allow(dead_code, reason = "not every test file needs it")]
pub(crate) const CAMERA: &str = r#"(
    name: "small",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(4.0),
    focus: DistanceMm(2000.0),
    film: Pixels(columns: 48, rows: 32, pitch_um: 200.0),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

/// The data sheet of a color camera with the pixels of that film.
#[allow(dead_code, reason = "not every test file needs it")]
pub(crate) fn sheet() -> String {
    let sheet = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../sensor/data/nikon-d5100.ron"))
        .expect("the data sheet of the library");
    let sized = |line: &str| match line.trim_start().split(':').next() {
        Some("rows") => "    rows: 32,".to_owned(),
        Some("columns") => "    columns: 48,".to_owned(),
        Some("pixel_pitch_um") => "    pixel_pitch_um: 200.0,".to_owned(),
        Some("row_time_us") => String::new(),
        _ => line.to_owned(),
    };
    let lines: Vec<String> = sheet.lines().map(sized).collect();
    let text = lines.join("\n");
    let end = text.rfind(')').expect("the data sheet of the library");
    format!("{}    row_time_us: 10.0,\n)", &text[..end])
}

/// Runs `dioptric` with these arguments in a folder.
pub(crate) fn dioptric(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .env("DIOPTRIC_CACHE", "")
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

/// Returns what a run that must succeed writes to standard output.
#[track_caller]
#[allow(dead_code, reason = "not every test file needs it")]
pub(crate) fn output(folder: &Path, arguments: &[&str]) -> String {
    let run = dioptric(folder, arguments);
    assert!(run.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).expect("the output is text")
}

/// Checks that a run fails with one sentence that holds these words, and leaves the folder as it was.
#[track_caller]
#[allow(dead_code, reason = "not every test file needs it")]
pub(crate) fn check_error(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = names_in(folder);
    let run = dioptric(folder, arguments);
    let message = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(!run.status.success(), "{arguments:?} succeeded");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(message.starts_with("error: ") && !message.contains("panicked"), "{message}");
    let parts: Vec<&str> = message.trim().split(": ").collect();
    assert!((1..parts.len()).all(|i| !parts[..i].contains(&parts[i])), "said twice: {message}");
    for word in words {
        assert!(message.contains(word), "'{word}' in: {message}");
    }
    assert_eq!(names_in(folder), before, "{arguments:?} left something behind");
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("the folder is there")
        .map(|entry| entry.expect("the folder can be read").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Reads a picture that the program wrote.
#[allow(dead_code, reason = "not every test file needs it")]
pub(crate) fn read_picture(path: &Path) -> dioptric_pictures::DynamicImage {
    dioptric_pictures::read(path, dioptric_pictures::Limits::no_limits()).expect("a picture")
}
