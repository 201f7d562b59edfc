//! The memory that a run takes, against what it is allowed.

#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread::sleep,
    time::Duration,
};

use common::{CAMERA, dioptric, output};

/// A film whose frames take more than scene and plan do.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = CAMERA
        .replace("Pixels(columns: 48, rows: 32, pitch_um: 200.0)", "Pixels(columns: 2400, rows: 1600, pitch_um: 4.0)");
    assert_ne!(camera, CAMERA);
    fs::write(folder.path().join("camera.ron"), camera).unwrap();
    folder
}

/// Runs the camera with two threads and so much memory; returns the most that its process had resident, MiB.
fn peak_mib(folder: &Path, mib: u64, out: &str) -> u64 {
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(["run", "camera.ron", "--quiet", "--threads", "2", "--memory", &format!("{mib}MiB"), "--out", out])
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .stdin(Stdio::null())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", run.id());
    let mut most = 0;
    let ended = loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib: Option<u64> = peak.and_then(|peak| peak.trim().strip_suffix("kB")?.trim().parse().ok());
        most = most.max(kib.unwrap_or_default().div_ceil(1024));
        if let Some(ended) = run.try_wait().unwrap() {
            break ended;
        }
        sleep(Duration::from_millis(2));
    };
    assert!(ended.success());
    most
}

#[test]
fn a_run_stays_within_its_memory() {
    let folder = folder();
    let refused = dioptric(folder.path(), &["run", "camera.ron", "--memory", "1MiB", "--out", "none"]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    let least_mib: u64 = said.split("at least ").nth(1).unwrap().split(" MiB").next().unwrap().parse().unwrap();
    // More than the film's frames, less than they, scene and plan together.
    let budget_mib = least_mib + 8;
    let peak_mib = peak_mib(folder.path(), budget_mib, "tight");
    assert!(peak_mib <= budget_mib, "{peak_mib} of {budget_mib} MiB");
    output(folder.path(), &["run", "camera.ron", "--quiet", "--out", "usual"]);
    for file in ["irradiance.exr", "volts.exr", "raw.png", "picture.png", "depth.exr", "report.json"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(file)).unwrap();
        assert!(read("tight") == read("usual"), "{file}");
    }
}
