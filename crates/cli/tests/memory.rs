//! The memory that a run takes, against what it is allowed.

#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    fs,
    path::Path,
    process::{Child, Command, Stdio},
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
    let most = watched(&mut run);
    let ended = run.wait_with_output().unwrap();
    if ended.status.success() { Ok(most) } else { Err(String::from_utf8_lossy(&ended.stderr).into_owned()) }
}

/// Waits for the end of a process; returns the most that it had resident, MiB.
fn watched(run: &mut Child) -> u64 {
    let status = format!("/proc/{}/status", run.id());
    let mut most = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib: Option<u64> = peak.and_then(|peak| peak.trim().strip_suffix("kB")?.trim().parse().ok());
        most = most.max(kib.unwrap_or_default().div_ceil(1024));
        if run.try_wait().unwrap().is_some() {
            return most;
        }
        sleep(Duration::from_millis(2));
    }
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

/// Writes a picture of 1 bit per pixel, which is small as a file.
fn write_large_png(path: &Path, side: u32) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().unwrap();
    let mut stream = writer.stream_writer().unwrap();
    let row = vec![0xf0; side.div_ceil(8) as usize];
    (0..side).for_each(|_| std::io::Write::write_all(&mut stream, &row).unwrap());
    stream.finish().unwrap();
}

/// Runs a command; returns the most that its process had resident, MiB, whether it failed, and what it said.
fn peak_of(folder: &Path, arguments: &[&str]) -> (u64, bool, String) {
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
        .args(arguments)
        .args(["--threads", "2"])
        .env("DIOPTRIC_CACHE", "")
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let most = watched(&mut run);
    let ended = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    (most, !ended.status.success(), said)
}

/// Pictures of 30,000 × 30,000 pixels in a file of a few megabytes, as whatever is read: refused from their header; those of a world are left
/// out of it, as all that cannot be read, and said.
#[test]
fn pictures_that_fill_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_large_png(&folder.path().join("large.png"), 30_000);
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    let world = "LookAt 0 0 -5 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\n\
                 Film \"rgb\" \"integer xresolution\" 60 \"integer yresolution\" 40\nWorldBegin\n\
                 Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"large.png\"\n\
                 LightSource \"infinite\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"\n";
    fs::write(folder.path().join("world.pbrt"), world).unwrap();
    fs::create_dir(folder.path().join("bands")).unwrap();
    fs::hard_link(folder.path().join("large.png"), folder.path().join("bands/large-550.png")).unwrap();
    for arguments in [
        &["measure", "mtf", "large.png"][..],
        &["measure", "spot", "large.png"],
        &["show", "large.png", "--distance-m", "0.6", "-o", "shown.exr"],
        &["render", "world.pbrt", "--samples", "1", "-o", "rendered"],
        &["run", "camera.ron", "--scene", "bands", "--depth-m", "2", "--fov-deg", "14", "--out", "run"],
        // The film has as many pixels as the scene.
        &["run", "camera.ron", "--scene", "large.png", "--depth-m", "2", "--fov-deg", "14", "--film", "scene"],
    ] {
        let (mib, is_refused, said) = peak_of(folder.path(), arguments);
        assert_eq!(is_refused, arguments[0] != "render", "{arguments:?}");
        assert!(said.contains("large") && said.contains("GiB of memory and may take"), "{arguments:?}: {said}");
        assert!(mib < 300, "{arguments:?}: {mib} MiB");
    }
}

/// A picture that is finer than the film by far is read at the pixels that the film needs, and the same picture comes out.
#[test]
fn large_pictures_are_read_as_fine_as_the_film_needs() {
    let folder = tempfile::tempdir().unwrap();
    write_large_png(&folder.path().join("large.png"), 6000);
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    let line = "run camera.ron --scene large.png --depth-m 2 --fov-deg 14 --diffraction none --memory 700MiB --out out";
    let (mib, is_refused, said) = peak_of(folder.path(), &line.split(' ').collect::<Vec<_>>());
    assert!(!is_refused, "{said}");
    assert!(mib < 700, "{mib} MiB");
    let report = fs::read_to_string(folder.path().join("out/report.json")).unwrap();
    assert!(report.contains("6000 × 6000 samples are read as"), "{report}");
}
