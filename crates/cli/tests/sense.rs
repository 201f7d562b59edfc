//! `dioptric sense` on the built program: every file of a frame, bursts, brackets and oblique light.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{CAMERA, check_error, output, read_picture, sheet};
use image::{ColorType, DynamicImage};
use serde_json::Value;

/// Returns a folder with `light.exr`, a spectral irradiance, and `small.ron`, a sensor for it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    fs::write(folder.path().join("small.ron"), sheet()).unwrap();
    output(folder.path(), &["run", "camera.ron", "--out", "run", "--quiet"]);
    fs::rename(folder.path().join("run/irradiance.exr"), folder.path().join("light.exr")).unwrap();
    folder
}

fn sense(folder: &Path, sensor: &str, options: &[&str]) -> Value {
    let arguments = [&["sense", "light.exr", "--sensor", sensor, "--out", "out", "--json"], options].concat();
    serde_json::from_str(&output(folder, &arguments)).unwrap()
}

#[test]
fn every_file_of_a_frame_is_written_and_reads_back() {
    let folder = folder();
    let all = "electrons,raw-tiff,raw-dng,picture-png16,picture-tiff8,picture-tiff16,picture-exr";
    sense(folder.path(), "small.ron", &["--also", all]);
    let open = |name: &str| -> DynamicImage { read_picture(&folder.path().join("out").join(name)) };
    assert_eq!(open("raw.png").color(), ColorType::L16);
    assert_eq!(open("raw.tiff").into_luma16(), open("raw.png").into_luma16());
    assert_eq!(open("picture.png").color(), ColorType::Rgb8);
    assert_eq!(open("picture-8.tiff").into_rgb8(), open("picture.png").into_rgb8());
    assert_eq!((open("picture-16.png").color(), open("picture-16.tiff").color()), (ColorType::Rgb16, ColorType::Rgb16));
    assert_eq!(open("picture-16.tiff").into_rgb16(), open("picture-16.png").into_rgb16());
    let dng = fs::read(folder.path().join("out/raw.dng")).unwrap();
    assert_eq!(&dng[..4], b"II*\0");
    // The EXR files open as planes: their mean is measured by the program itself.
    for name in ["electrons.exr", "volts.exr", "picture.exr"] {
        let path = format!("out/{name}");
        let run = common::dioptric(folder.path(), &["measure", "spot", &path]);
        // An even field has no spots, but it was read.
        assert!(!String::from_utf8_lossy(&run.stderr).contains("cannot be read"), "{name}");
        assert!(fs::metadata(folder.path().join(path)).unwrap().len() > 1000);
    }
    output(folder.path(), &["run", "camera.ron", "--out", "both", "--quiet", "--also", "electrons,raw-dng"]);
    assert!(folder.path().join("both/electrons.exr").exists() && folder.path().join("both/raw.dng").exists());
}

#[test]
fn sense_makes_white_as_the_run_did() {
    let folder = folder();
    let warm = fs::read_to_string(folder.path().join("camera.ron"))
        .unwrap()
        .replace("depth_m: 2.0", "depth_m: 2.0, illuminant: A");
    fs::write(folder.path().join("warm.ron"), warm).unwrap();
    output(folder.path(), &["run", "warm.ron", "--noise", "none", "--out", "warm", "--quiet"]);
    let options = ["sense", "warm/irradiance.exr", "--sensor", "nikon-d5100", "--pixel-um", "200", "--noise", "none"];
    output(folder.path(), &[&options[..], &["--out", "sensed"]].concat());
    let codes = |name: &str| read_picture(&folder.path().join(name)).into_rgb8().into_raw();
    // The file states the light: an even gray under incandescent light is gray in both.
    assert_eq!(codes("sensed/picture.png"), codes("warm/picture.png"));
    output(folder.path(), &[&options[..], &["--illuminant", "D65", "--out", "other"]].concat());
    assert_ne!(codes("other/picture.png"), codes("warm/picture.png"));
}

/// Returns the standard deviation of the picture's green codes in the middle of the frame.
fn noise(folder: &Path) -> f64 {
    let picture = read_picture(&folder.join("out/picture-16.png")).into_rgb16();
    let middle = (8..24).flat_map(|y| (12..36).map(move |x| (x, y)));
    let codes: Vec<f64> = middle.map(|(x, y)| f64::from(picture.get_pixel(x, y).0[1])).collect();
    let mean = codes.iter().sum::<f64>() / codes.len() as f64;
    (codes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / codes.len() as f64).sqrt()
}

#[test]
fn a_burst_is_less_noisy_and_a_bracket_is_a_picture_too() {
    let folder = folder();
    let metered = sense(folder.path(), "small.ron", &[])["exposure_time_s"].as_f64().unwrap();
    // In the dark most noise is temporal.
    let time_s = (0.01 * metered).to_string();
    let short = ["--exposure-s", &time_s, "--also", "picture-png16"];
    let single = sense(folder.path(), "small.ron", &short);
    assert_eq!(single["row_time_us"].as_f64(), Some(10.0));
    // 31 rows later, 10 µs each.
    assert!((single["last_row_later_ms"].as_f64().unwrap() - 0.31).abs() < 1e-9);
    let one = noise(folder.path());
    sense(folder.path(), "small.ron", &[&short[..], &["--burst", "16"]].concat());
    let sixteen = noise(folder.path());
    // A quarter of the temporal noise; what is fixed to the chip stays.
    assert!(sixteen < 0.5 * one, "{sixteen} of {one}");
    sense(folder.path(), "small.ron", &[&short[..], &["--bracket-stops", "0,2,4"]].concat());
    let bracket = noise(folder.path());
    assert!(bracket < 0.5 * one, "{bracket} of {one}");
}

#[test]
fn oblique_light_darkens_the_corners_of_a_sensor_that_minds_it() {
    let folder = folder();
    let sheet = sheet();
    let end = sheet.rfind(')').unwrap();
    let oblique = format!("{}    chief_ray_response: [(0.0, 1.0), (30.0, 0.2)],\n)", &sheet[..end]);
    fs::write(folder.path().join("oblique.ron"), oblique).unwrap();
    let mean = |options: &[&str]| {
        let options = [&["--exposure-s", "1e-6"], options].concat();
        sense(folder.path(), "oblique.ron", &options)["channels"][1]["mean_e"].as_f64().unwrap()
    };
    // The sensor is 9.6 mm wide: its edge is seen from the pupil at 26°.
    assert!(mean(&["--exit-pupil-mm", "10"]) < 0.8 * mean(&[]));
}

#[test]
fn fast_light_is_lost_by_pixels_with_a_stack() {
    let folder = folder();
    let sheet = sheet();
    let end = sheet.rfind(')').unwrap();
    let stack = "pixel_stack: (photodiode_um: 100.0, layers: [(thickness_um: 600.0, index: 1.5)], \
                 microlens: (power: FocusOnPhotodiode, shift: ExitPupilMm(10.0))),";
    fs::write(folder.path().join("stack.ron"), format!("{}    {stack}\n)", &sheet[..end])).unwrap();
    let of = |options: &[&str]| sense(folder.path(), "stack.ron", &[&["--exposure-s", "1e-6"], options].concat());
    let optics = |options: &[&str], place: &str| of(options)["pixel_optics"][place]["factor"].as_f64().unwrap();
    let fast = ["--exit-pupil-mm", "10", "--f-number", "1.4"];
    // The image of an f/1.4 pupil, a disc of 307 µm, covers the photodiode of 100 µm seven times; the shift keeps it over that in the corner.
    assert!((0.1..0.3).contains(&optics(&fast, "middle")) && optics(&fast, "corner") > 0.1);
    assert!(optics(&["--exit-pupil-mm", "10", "--f-number", "16"], "corner") > 0.95);
    assert!(optics(&["--exit-pupil-mm", "4", "--f-number", "16"], "corner") < 0.3);
    let mean = |options: &[&str]| of(options)["channels"][1]["mean_e"].as_f64().unwrap();
    assert!(mean(&fast) < 0.35 * mean(&["--f-number", "16", "--exit-pupil-mm", "10"]));
}

#[test]
fn noise_and_white_are_chosen_on_the_command_line() {
    let folder = folder();
    let raw = |options: &[&str]| {
        sense(folder.path(), "small.ron", &[&["--exposure-s", "1e-6"], options].concat());
        read_picture(&folder.path().join("out/raw.png")).into_luma16()
    };
    assert_eq!(raw(&["--noise", "none", "--seed", "1"]), raw(&["--noise", "none", "--seed", "2"]));
    assert_ne!(raw(&["--noise", "photon", "--seed", "1"]), raw(&["--noise", "photon", "--seed", "2"]));
    assert_eq!(
        raw(&["--noise", "all,-photon,read"]),
        raw(&["--noise", "dark-current,reset,row,prnu,dsnu,column,defects"])
    );
    let gain = |options: &[&str]| sense(folder.path(), "small.ron", options)["analog_gain"].as_f64();
    assert_eq!(gain(&["--analog-gain", "4"]), Some(4.0));
    // Of an even field that is its own white, red and blue are as green.
    for white in ["patch:4,4,24,16", "gray-world", "shades-of-gray"] {
        let options = ["--white", white, "--demosaic", "bilinear", "--highlights", "clip", "--noise", "none"];
        sense(folder.path(), "small.ron", &options);
        let picture = read_picture(&folder.path().join("out/picture.png")).into_rgb8();
        let [r, g, b] = picture.get_pixel(24, 16).0.map(i32::from);
        assert!((r - g).abs() <= 1 && (b - g).abs() <= 1, "{white}: {r} {g} {b}");
    }
}

#[test]
fn what_cannot_be_asked_is_refused_in_one_sentence() {
    let folder = folder();
    for (options, words) in [
        (&["--also", "electrons,jpeg"][..], &["--also", "'jpeg'", "raw-dng"][..]),
        (&["--burst", "0"], &["--burst is 0"]),
        (&["--bracket-stops", "0,many"], &["--bracket-stops", "many"]),
        (&["--exit-pupil-mm", "0"], &["exit_pupil"]),
        (&["--noise", "hiss"], &["'hiss'", "dark-current"]),
        (&["--white", "sunny"], &["'sunny'", "gray-edge", "patch:"]),
        (&["--white", "patch:0,0,9000,2"], &["patch", "within"]),
        (&["--demosaic", "best"], &["'best'", "directional-ratio"]),
        (&["--highlights", "burn"], &["'burn'", "reconstruct"]),
        (&["--analog-gain", "-1"], &["--analog-gain is -1"]),
        (&["--illuminant", "0.9,0.3"], &["chromaticity", "0.9"]),
    ] {
        let arguments = [&["sense", "light.exr", "--sensor", "small.ron", "--out", "out"], options].concat();
        check_error(folder.path(), &arguments, words);
    }
    let at = sheet().find("adc: Bits").unwrap();
    let line = sheet()[at..].lines().next().unwrap().to_owned();
    fs::write(folder.path().join("analog.ron"), sheet().replace(&line, "adc: Analog,")).unwrap();
    let volts = ["sense", "light.exr", "--sensor", "analog.ron", "--out", "out", "--also", "raw-dng"];
    check_error(folder.path(), &volts, &["a DNG file", "volts"]);
}

#[test]
fn only_the_pixels_under_the_image_are_read() {
    let folder = folder();
    // 9.6 × 6.4 mm of light on 4.51 × 2.88 mm of pixels, and on the middle of 23.6 × 15.6 mm.
    sense(folder.path(), "mt9v024", &[]);
    let size = |name: &str| {
        let found = read_picture(&folder.path().join(name));
        (found.width(), found.height())
    };
    assert_eq!(size("out/picture.png"), (752, 480));
    sense(folder.path(), "nikon-d5100", &[]);
    assert_eq!(size("out/picture.png"), (2008, 1339));
}
