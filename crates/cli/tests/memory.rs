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

use common::{CAMERA, output};

/// Writes a camera in place of the small one's film, scene and bands.
fn folder(parts: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = parts.iter().fold(CAMERA.to_owned(), |camera, (from, to)| {
        assert!(camera.contains(from), "{from}");
        camera.replace(from, to)
    });
    fs::write(folder.path().join("camera.ron"), camera).unwrap();
    folder
}

const FILM: &str = "Pixels(columns: 48, rows: 32, pitch_um: 200.0)";
const SCENE: &str = "(source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0)";
const BANDS: &str = "ListNm([450.0, 550.0, 650.0])";

/// Runs the camera with two threads and so much memory; returns the most that its process had resident, MiB, or what it refused with.
fn peak_mib(folder: &Path, mib: u64, out: &str) -> Result<u64, String> {
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(["run", "camera.ron", "--quiet", "--threads", "2", "--memory", &format!("{mib}MiB"), "--out", out])
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", run.id());
    let mut most = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib: Option<u64> = peak.and_then(|peak| peak.trim().strip_suffix("kB")?.trim().parse().ok());
        most = most.max(kib.unwrap_or_default().div_ceil(1024));
        if run.try_wait().unwrap().is_some() {
            break;
        }
        sleep(Duration::from_millis(2));
    }
    let ended = run.wait_with_output().unwrap();
    if ended.status.success() { Ok(most) } else { Err(String::from_utf8_lossy(&ended.stderr).into_owned()) }
}

/// Runs the camera with the least memory that it asks for: what is known before the lens is traced, and then what the plan takes. Returns that and the most
/// that was resident, MiB.
fn least_and_peak_mib(folder: &Path, out: &str) -> [u64; 2] {
    let mut least_mib = 1;
    loop {
        match peak_mib(folder, least_mib, out) {
            Ok(peak_mib) => return [least_mib, peak_mib],
            Err(said) => {
                let next_mib = said.split("at least ").nth(1).unwrap().split(" MiB").next().unwrap().parse().unwrap();
                assert!(next_mib > least_mib, "{said}");
                least_mib = next_mib;
            }
        }
    }
}

#[test]
fn a_run_stays_within_its_memory() {
    // A film whose frames take more than scene and plan do.
    let folder = folder(&[(FILM, "Pixels(columns: 2400, rows: 1600, pitch_um: 4.0)")]);
    let [least_mib, peak_mib] = least_and_peak_mib(folder.path(), "tight");
    assert!(peak_mib <= least_mib, "{peak_mib} of {least_mib} MiB");
    output(folder.path(), &["run", "camera.ron", "--quiet", "--out", "usual"]);
    for file in ["irradiance.exr", "volts.exr", "raw.png", "picture.png", "depth.exr", "report.json"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(file)).unwrap();
        assert!(read("tight") == read("usual"), "{file}");
    }
}

/// Painting takes no more than the scene does and some rows, and lights of photodiodes that nobody looks at are not held.
#[test]
fn paintings_and_photodiodes_are_within_the_least() {
    let sensor = ("BuiltIn(\"nikon-d5100\"),", "BuiltIn(\"imx363\"),\n    dual_pixel: (photodiodes: LeftRight),");
    let painted = [
        (FILM, "Pixels(columns: 200, rows: 133, pitch_um: 160.0)"),
        (SCENE, "(source: StillLife(columns: 720, rows: 480))"),
        (BANDS, "Range(first_nm: 400.0, last_nm: 700.0, step_nm: 20.0)"),
    ];
    let halves = [(FILM, "Pixels(columns: 1600, rows: 1066, pitch_um: 8.0)"), sensor];
    for parts in [&painted[..], &halves[..]] {
        let folder = folder(parts);
        let [least_mib, peak_mib] = least_and_peak_mib(folder.path(), "least");
        assert!(peak_mib <= least_mib, "{peak_mib} of {least_mib} MiB: {parts:?}");
    }
}
