//! Numbers of every size in pairs of options: a picture or one sentence, soon, and never a panic.
//!
//! `DIOPTRIC_EXTREMES=3000 cargo test -p dioptric --test extremes` tries so many pairs; without it a few.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    env, fs,
    path::Path,
    process::{Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use common::CAMERA;
use dioptric_pipeline::range_of;

/// The options that `run` takes a number for.
const OPTIONS: [&str; 30] = [
    "fov-deg",
    "depth-m",
    "illuminance-lux",
    "pixel-um",
    "exposure-s",
    "burst",
    "burst-motion-px",
    "interleaved-ratio",
    "interleaved-gain-ratio",
    "interleaved-rows",
    "bracket-stops",
    "analog-gain",
    "denoise",
    "sharpen-px",
    "defect-threshold",
    "gamma",
    "bank-error",
    "film-mm",
    "focus-mm",
    "f-number",
    "stop-mm",
    "tilt-deg",
    "swing-deg",
    "rise-mm",
    "shift-mm",
    "width-mm",
    "distance-mm",
    "wavelengths-nm",
    "white-level",
    "slope-per-nm",
];

/// What no option has, and what some have.
const ODD: [f64; 10] = [0.0, -1.0, 1e300, -1e300, 1e-300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e15, 1e-9];

/// The longest that a pair may take.
const MOST: Duration = Duration::from_secs(60);

/// The longest that a refusal of a number may take: no lens is traced and no scene opened before it.
const AT_ONCE: Duration = Duration::from_secs(10);

/// `SplitMix64`, so that a pair is found again by its number.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn fraction(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a number for an option and whether its range holds it: an end, something between in steps of its size, or what is odd.
    fn number(&mut self, option: &str) -> (f64, bool) {
        let range = range_of(&option.replace('-', "_")).unwrap();
        let number = match self.below(5) {
            0 => range.least,
            1 => range.most,
            2 | 3 if range.least > 0.0 => range.least * (range.most / range.least).powf(self.fraction()),
            2 | 3 => range.least + (range.most - range.least) * self.fraction().powi(4),
            _ => ODD[self.below(ODD.len())],
        };
        let is_whole = ["burst", "interleaved-rows"].contains(&option);
        let number = if is_whole && number.is_finite() && number.abs() < 1e9 { number.round() } else { number };
        (number, range.holds(number))
    }
}

/// Runs the camera with two options; returns what is wrong about how it ends.
fn fault(folder: &Path, number: u64) -> Option<String> {
    let mut draw = Draw(number);
    let mut arguments = ["run", "camera.ron", "--quiet", "--out", "out", "--threads", "2"].map(str::to_owned).to_vec();
    let mut is_in_range = true;
    for _ in 0..2 {
        let option = OPTIONS[draw.below(OPTIONS.len())];
        let (number, holds) = draw.number(option);
        is_in_range &= holds;
        let name = format!("--{option}");
        if !arguments.contains(&name) {
            arguments.extend([name, format!("{number}")]);
        }
    }
    let began = Instant::now();
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(&arguments)
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while run.try_wait().unwrap().is_none() {
        if began.elapsed() > MOST {
            run.kill().unwrap();
            return Some(format!("{number}: {arguments:?} hangs"));
        }
        sleep(Duration::from_millis(5));
    }
    let took = began.elapsed();
    let ended = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    let is_refused = ended.status.code().is_some_and(|code| code == 1 || code == 2);
    let is_right = match (ended.status.success(), is_in_range) {
        (true, in_range) => in_range,
        (false, true) => is_refused,
        (false, false) => is_refused && took < AT_ONCE,
    };
    let is_sentence = ended.status.success() || (said.starts_with("error: ") && !said.contains("panicked"));
    (!is_right || !is_sentence).then(|| format!("{number}: {arguments:?}: {:?} after {took:.1?}: {said}", ended.status))
}

#[test]
fn pairs_of_extreme_numbers_end_in_a_picture_or_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let small = CAMERA.replace("columns: 48, rows: 32, pitch_um: 200.0", "columns: 12, rows: 8, pitch_um: 800.0");
    // Rays alone: how long diffraction takes at f/90 is the business of its own tests.
    let small = small.replace("name: \"small\",", "name: \"small\",\n    diffraction: None,");
    fs::write(folder.path().join("camera.ron"), small).unwrap();
    let asked = env::var("DIOPTRIC_EXTREMES").ok().and_then(|n| n.parse().ok());
    let faults: Vec<String> = (0..asked.unwrap_or(24)).filter_map(|number| fault(folder.path(), number)).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
