//! Runs that are killed, and what continues them.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    collections::BTreeMap,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread::sleep,
    time::Duration,
};

use common::{CAMERA, dioptric, output};

/// Bands of the camera, and bytes of each.
const BANDS: u64 = 16;
const BAND_BYTES: u64 = 4 * 48 * 32;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera =
        CAMERA.replace("ListNm([450.0, 550.0, 650.0])", "Range(first_nm: 400.0, last_nm: 700.0, step_nm: 20.0)");
    assert_ne!(camera, CAMERA);
    fs::write(folder.path().join("camera.ron"), camera).unwrap();
    folder
}

/// Returns the files of a folder, each with a hash of its bytes, but for those that tell how long a run took.
fn files(folder: &Path) -> BTreeMap<PathBuf, u64> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_timed = |path: &PathBuf| ["report.html", "timings.json"].iter().any(|name| path.ends_with(name));
    let hash_of = |path: &Path| {
        let mut hasher = DefaultHasher::new();
        fs::read(path).unwrap().hash(&mut hasher);
        hasher.finish()
    };
    let same = entries.filter(|path| !is_timed(path));
    same.map(|path| (path.strip_prefix(folder).unwrap().to_owned(), hash_of(&path))).collect()
}

fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.to_string_lossy().contains(".partial-")).collect()
}

/// Runs the camera and kills it once so many bands are finished, and a moment later; returns how many there were then.
fn kill_after(folder: &Path, out: &str, bands: u64, delay: Duration) -> u64 {
    end_after(folder, out, bands, delay, |run| run.kill().unwrap()).0
}

/// Ends a run in another way; returns how many bands are left, and what it printed.
fn end_after(folder: &Path, out: &str, bands: u64, delay: Duration, end: impl FnOnce(&mut Child)) -> (u64, Output) {
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(["run", "camera.ron", "--out", out, "--quiet", "--threads", "1"])
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let finished = || {
        let of = |path: PathBuf| fs::metadata(path.join("bands.raw")).map_or(0, |data| data.len());
        leftovers(folder).into_iter().map(of).max().unwrap_or(0) / BAND_BYTES
    };
    while finished() < bands && run.try_wait().unwrap().is_none() {
        sleep(Duration::from_micros(200));
    }
    sleep(delay);
    end(&mut run);
    let output = run.wait_with_output().unwrap();
    (finished(), output)
}

/// Killed at ten moments, of which some are before the first band and some after the last, a run continues to the same bytes.
#[test]
fn killed_runs_continue_to_the_same_bits() {
    let folder = folder();
    output(folder.path(), &["run", "camera.ron", "--out", "whole", "--quiet"]);
    let whole = files(&folder.path().join("whole"));
    assert!(whole.contains_key(Path::new("picture.png")) && whole.contains_key(Path::new("irradiance.exr")));
    let moments = [(0, 150), (1, 0), (3, 7), (4, 0), (6, 3), (9, 11), (11, 1), (13, 0), (16, 0), (16, 40)];
    let mut n_continued = 0;
    for (moment, (bands, delay_ms)) in moments.into_iter().enumerate() {
        let out = format!("out{moment}");
        let left = kill_after(folder.path(), &out, bands, Duration::from_millis(delay_ms));
        let run = dioptric(folder.path(), &["run", "camera.ron", "--out", &out, "--resume"]);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.success(), "{said}");
        assert_eq!(files(&folder.path().join(&out)), whole, "killed when {left} of {BANDS} bands were there");
        // What the dead left is gone.
        assert!(leftovers(folder.path()).is_empty() && leftovers(&folder.path().join(&out)).is_empty());
        n_continued += u32::from(left > 0 && !said.contains("starts from the beginning"));
    }
    assert!(n_continued >= 5, "{n_continued} of 10 were continued");
}

/// An interrupted run keeps its bands, names the folder and how to go on, and leaves nothing where there are none yet.
#[cfg(unix)]
#[test]
fn interrupted_runs_keep_their_bands() {
    let folder = folder();
    let interrupt = |run: &mut Child| {
        // One that has ended has no process any more.
        if run.try_wait().unwrap().is_none() {
            let sent = Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
            assert!(sent.success());
        }
    };
    for bands in [0, 2] {
        let (left, output) = end_after(folder.path(), "out", bands, Duration::from_millis(60), interrupt);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.code() != Some(130) {
            // The run was quicker than the signal, or had not begun to listen to it.
            assert!(output.status.success() || left == 0, "{said}");
            continue;
        }
        let is_kept = !leftovers(folder.path()).is_empty();
        assert_eq!(is_kept, said.contains("with --resume the same command goes on"), "{said}");
        assert!(is_kept || left == 0, "{said}");
        if left > 0 {
            let run = dioptric(folder.path(), &["run", "camera.ron", "--out", "out", "--resume"]);
            assert!(run.status.success() && !String::from_utf8_lossy(&run.stderr).contains("from the beginning"));
        }
    }
    assert!(leftovers(folder.path()).is_empty());
}

#[test]
fn bands_of_another_camera_are_not_taken() {
    let folder = folder();
    if kill_after(folder.path(), "out", 2, Duration::ZERO) == 0 {
        return;
    }
    let other = dioptric(folder.path(), &["run", "camera.ron", "--diffraction", "none", "--out", "out", "--resume"]);
    assert!(other.status.success());
    assert!(String::from_utf8_lossy(&other.stderr).contains("starts from the beginning"));
    output(folder.path(), &["run", "camera.ron", "--diffraction", "none", "--out", "whole", "--quiet"]);
    assert_eq!(files(&folder.path().join("out")), files(&folder.path().join("whole")));
}

#[test]
fn memory_decides_no_bit_of_the_picture() {
    let folder = folder();
    output(folder.path(), &["run", "camera.ron", "--out", "usual", "--quiet"]);
    let message = dioptric(folder.path(), &["run", "camera.ron", "--memory", "100kB", "--out", "small"]);
    assert!(!message.status.success() && !folder.path().join("small").exists());
    let said = String::from_utf8_lossy(&message.stderr).into_owned();
    let least = said.split("at least ").nth(1).unwrap().split(" MiB").next().unwrap();
    // What it says would do does: the least of the plan is known once it is made.
    let first: u64 = least.parse().unwrap();
    let mut budget = first;
    while !dioptric(folder.path(), &["run", "camera.ron", "--memory", &format!("{budget}MiB"), "--out", "small"])
        .status
        .success()
    {
        budget += 1;
        assert!(budget < first + 16, "{said}");
    }
    assert_eq!(files(&folder.path().join("small")), files(&folder.path().join("usual")));
}
