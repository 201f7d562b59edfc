//! Bad input ends in one sentence, a status that is not 0, and no file.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{CAMERA, check_error, output};

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    folder
}

/// Runs the small camera for its irradiance, which is a valid spectral EXR.
fn spectral_exr(folder: &Path) -> Vec<u8> {
    output(folder, &["run", "camera.ron", "--out", "good", "--quiet", "--exr-samples", "uncompressed"]);
    let bytes = fs::read(folder.join("good/irradiance.exr")).unwrap();
    fs::remove_dir_all(folder.join("good")).unwrap();
    bytes
}

fn check_scene(folder: &Path, words: &[&str]) {
    check_error(folder, &["run", "camera.ron", "--scene", "scene.exr", "--depth-m", "2", "--out", "out"], words);
}

#[test]
fn moves_of_surfaces_that_there_are_not_are_refused() {
    let folder = folder();
    let lens = r#"(name: "askew", source: "test", surfaces: [(radius_mm: 50.0, semi_aperture_mm: 5.0,
        medium: Constant(index: 1.5), thickness_mm: 3.0), (stop: true, radius_mm: -50.0, semi_aperture_mm: 5.0,
        thickness_mm: 0.0)], moves: [(surfaces: (1, 1), tilt_deg: (1.0, 0.0, 0.0))])"#;
    let broken = lens.replace("(1, 1)", "(1, 3)");
    fs::write(folder.path().join("askew.ron"), broken).unwrap();
    check_error(folder.path(), &["lens", "info", "askew.ron"], &["askew.ron", "move 0 is of surfaces 1 to 3"]);
}

#[test]
fn a_window_needs_its_camera() {
    check_error(folder().path(), &["studio", "absent.ron"], &["cannot read absent.ron"]);
}

#[test]
fn a_truncated_exr_is_named() {
    let folder = folder();
    let bytes = spectral_exr(folder.path());
    fs::write(folder.path().join("scene.exr"), &bytes[..bytes.len() / 2]).unwrap();
    check_scene(folder.path(), &["scene.exr"]);
    fs::write(folder.path().join("scene.exr"), b"no picture at all").unwrap();
    check_scene(folder.path(), &["scene.exr"]);
    check_error(folder.path(), &["run", "camera.ron", "--scene", "absent.exr", "--out", "out"], &["absent.exr"]);
}

#[test]
fn an_exr_without_spectral_bands_is_named() {
    let folder = folder();
    output(folder.path(), &["run", "camera.ron", "--out", "good", "--quiet"]);
    fs::copy(folder.path().join("good/volts.exr"), folder.path().join("scene.exr")).unwrap();
    check_scene(folder.path(), &["scene.exr", "no spectral band"]);
}

#[test]
fn an_irradiance_is_no_scene() {
    let folder = folder();
    let bytes = spectral_exr(folder.path());
    fs::write(folder.path().join("scene.exr"), bytes).unwrap();
    check_scene(folder.path(), &["scene.exr", "the irradiance on a film", "dioptric sense"]);
}

#[test]
fn nan_and_negative_samples_are_named_with_their_place() {
    let folder = folder();
    let good = spectral_exr(folder.path());
    for bad in [f32::NAN, -1.0] {
        // The file is not compressed: its last four bytes are the last sample of the last band.
        let mut bytes = good.clone();
        let at = bytes.len() - 4;
        bytes[at..].copy_from_slice(&bad.to_le_bytes());
        fs::write(folder.path().join("light.exr"), bytes).unwrap();
        let arguments = ["sense", "light.exr", "--sensor", "nikon-d5100", "--out", "out"];
        check_error(folder.path(), &arguments, &["row 31, column 47", "650 nm"]);
        fs::remove_file(folder.path().join("light.exr")).unwrap();
    }
}

#[test]
fn missing_depth_and_view_are_asked_for() {
    let folder = folder();
    let picture = image_of_one_color();
    fs::write(folder.path().join("scene.png"), picture).unwrap();
    let run = ["run", "camera.ron", "--scene", "scene.png", "--out", "out"];
    check_error(folder.path(), &[&run[..], &["--fov-deg", "12"]].concat(), &["scene.png", "depth", "(--depth-m,"]);
    check_error(
        folder.path(),
        &[&run[..], &["--depth-m", "2"]].concat(),
        &["scene.png", "field of view", "(--fov-deg,"],
    );
    check_error(folder.path(), &run, &["scene.png", "neither", "--depth-m and --fov-deg"]);
    output(folder.path(), &[&run[..], &["--fov-deg", "12", "--depth-m", "2", "--quiet"]].concat());
    assert!(folder.path().join("out/picture.png").exists());
}

#[test]
fn only_runs_of_full_quality_are_continued() {
    let folder = folder();
    output(folder.path(), &["run", "camera.ron", "--quality", "preview", "--out", "look", "--quiet"]);
    check_error(folder.path(), &["run", "--from", "look", "--out", "on"], &["look/kept.ron", "full quality"]);
}

/// A picture that the program itself made.
fn image_of_one_color() -> Vec<u8> {
    let other = folder();
    output(other.path(), &["run", "camera.ron", "--out", "good", "--quiet"]);
    fs::read(other.path().join("good/picture.png")).unwrap()
}

#[test]
fn wavelengths_outside_the_glass_are_named() {
    let folder = folder();
    let lens = r#"(
    name: "tabulated",
    source: "a test",
    surfaces: [
        (radius_mm: 50.0, thickness_mm: 4.0, semi_aperture_mm: 8.0, medium: Tabulated(wavelengths_nm: [500.0, 600.0], indices: [1.6, 1.59])),
        (radius_mm: -50.0, thickness_mm: 1.0, semi_aperture_mm: 8.0, medium: Air),
        (stop: true, thickness_mm: 0.0, semi_aperture_mm: 4.0, medium: Air),
    ],
)"#;
    fs::write(folder.path().join("lens.ron"), lens).unwrap();
    let arguments = ["glass", "show", "SCHOTT:N-BK7", "--wavelengths-nm", "100"];
    check_error(folder.path(), &arguments, &["100 nm", "from"]);
    check_error(folder.path(), &["lens", "info", "lens.ron", "--wavelengths-nm", "450"], &["500 to 600 nm"]);
}

#[test]
fn a_dat_needs_exactly_one_stop() {
    let folder = folder();
    let rows = |stops: usize| {
        let stop = "0\t1.0\t1\t8\n".repeat(stops);
        format!("# lens\n50\nradius\taxpos\tN\taperture\n50\t4\t1.6\t16\n-50\t2\t1\t16\n{stop}60\t0\t1\t16\n")
    };
    for stops in [0, 2] {
        fs::write(folder.path().join("lens.dat"), rows(stops)).unwrap();
        check_error(folder.path(), &["lens", "info", "lens.dat"], &["lens.dat", "stop"]);
    }
    fs::write(folder.path().join("lens.dat"), rows(1)).unwrap();
    output(folder.path(), &["lens", "info", "lens.dat"]);
}

#[test]
fn malformed_ron_is_named_with_its_line() {
    let folder = folder();
    fs::write(folder.path().join("camera.ron"), CAMERA.replace("focus:", "fokus:")).unwrap();
    check_error(folder.path(), &["run", "camera.ron"], &["camera.ron:5", "fokus"]);
    fs::write(folder.path().join("camera.ron"), &CAMERA[..100]).unwrap();
    check_error(folder.path(), &["run", "camera.ron"], &["camera.ron:"]);
    fs::write(folder.path().join("camera.ron"), CAMERA.replace("200.0)", "NaN)")).unwrap();
    check_error(folder.path(), &["run", "camera.ron"], &["camera.ron:6", "pitch_um", "NaN"]);
}

#[test]
fn unknown_names_are_answered_with_the_known_ones() {
    let folder = folder();
    check_error(folder.path(), &["lens", "info", "no-such-lens"], &["no-such-lens", "dgauss-50mm"]);
    check_error(folder.path(), &["run", "camera.ron", "--lens", "no-such-lens"], &["no-such-lens"]);
    check_error(folder.path(), &["run", "camera.ron", "--sensor", "no-such-sensor"], &["no-such-sensor"]);
    check_error(folder.path(), &["run", "camera.ron", "--illuminant", "D66"], &["D66", "D65"]);
}

#[test]
fn a_place_that_cannot_be_written_to_is_named_before_the_work() {
    let folder = folder();
    fs::write(folder.path().join("file"), "").unwrap();
    check_error(folder.path(), &["run", "camera.ron", "--out", "file"], &["cannot write file"]);
    check_error(folder.path(), &["run", "camera.ron", "--out", "file/out"], &["cannot write file/out"]);
    check_error(folder.path(), &["lens", "draw", "dgauss-50mm", "-o", "file/lens.svg"], &["cannot write"]);
    let png = ["lens", "draw", "dgauss-50mm", "-o", "lens.png"];
    if cfg!(feature = "png") {
        output(folder.path(), &png);
    } else {
        check_error(folder.path(), &png, &["lens.png", "--features png"]);
    }
    let psf = ["psf", "dgauss-50mm", "--focus-mm", "2000", "-o", "file/psf.exr"];
    check_error(folder.path(), &psf, &["cannot write"]);
}

#[test]
fn numbers_that_make_no_sense_are_named() {
    let folder = folder();
    for (arguments, word) in [
        (vec!["psf", "dgauss-50mm", "--focus-mm", "2000", "--fields-deg", "90"], "fields_deg"),
        (vec!["psf", "dgauss-50mm", "--focus-mm", "2000", "--distances-mm", "-5"], "distances"),
        (vec!["psf", "dgauss-50mm", "--focus-mm", "1"], "1 mm"),
        (vec!["psf", "dgauss-50mm", "--focus-mm", "2000", "--stop-mm", "80"], "80"),
        (vec!["run", "camera.ron", "--f-number", "-4"], "--f-number is -4"),
        (vec!["lens", "info", "dgauss-50mm", "--wavelengths-nm", "blue"], "blue"),
    ] {
        let run = common::dioptric(folder.path(), &arguments);
        let message = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(!run.status.success() && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(message.contains(word), "{arguments:?}: {message}");
    }
}

#[test]
fn an_analysis_that_cannot_be_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let check = |more: &[&str], words: &[&str]| {
        check_error(folder.path(), &[&["lens", "analyze", "dgauss-50mm", "--out", "plots"], more].concat(), words);
    };
    check(&["--fields-deg", "0,130"], &["fields_deg is 130", "up to 120 degrees", "below 90 degrees"]);
    check(&["--fields-deg", "0,x"], &["--fields-deg", "'x'"]);
    check(&["--fields-deg", "0,5/y"], &["--fields-deg", "'5/y'"]);
    check(&["--fields-mm", "0,5"], &["a finite one for fields in mm"]);
    check(&["--distance-mm", "5"], &["forms no image"]);
    check(&["--f-number", "1.2"], &["opens to f/"]);
}

/// Writes a picture and the codes of its depth, millimetres.
fn write_rgbd(folder: &Path, codes: impl Fn(u32, u32) -> u16) {
    let color = image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([(10 * x) as u8, (15 * y) as u8, 128]));
    dioptric_pictures::save(&color.into(), &folder.join("room.png")).unwrap();
    let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(24, 16, |x, y| image::Luma([codes(x, y)]));
    dioptric_pictures::save(&depth.into(), &folder.join("room.depth.png")).unwrap();
}

const ROOM: [&str; 7] = ["run", "camera.ron", "--scene", "room.png", "--fov-deg", "14", "--out"];

#[test]
fn depth_inside_the_lens_is_refused_by_its_place() {
    let folder = folder();
    // 3 mm before the entrance pupil is amid the glass.
    write_rgbd(folder.path(), |x, y| if (x, y) == (5, 7) { 3 } else { 2000 });
    check_error(
        folder.path(),
        &[&ROOM[..], &["out"]].concat(),
        &["0.00300 m", "row 7, column 5", "inside dgauss-50mm"],
    );
}

#[test]
fn unmeasured_depth_is_counted() {
    let folder = folder();
    write_rgbd(folder.path(), |x, _| if x < 6 { 0 } else { 1500 });
    let run = common::dioptric(folder.path(), &[&ROOM[..], &["out", "--fill-depth", "far"]].concat());
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success() && said.contains("96 of 384 samples (25.00 %) have no depth"), "{said}");
    check_error(folder.path(), &[&ROOM[..], &["bad", "--fill-depth", "near"]].concat(), &["'near'", "far"]);
    write_rgbd(folder.path(), |_, _| 0);
    check_error(folder.path(), &[&ROOM[..], &["bad"]].concat(), &["room.depth.png", "no sample"]);
}

#[test]
fn hidden_layer_in_front_is_refused_by_its_place() {
    let folder = folder();
    write_rgbd(folder.path(), |x, y| if (x, y) == (3, 2) { 900 } else { 2500 });
    for name in ["room.png", "room.depth.png"] {
        fs::rename(folder.path().join(name), folder.path().join(name.replace("room", "behind"))).unwrap();
    }
    write_rgbd(folder.path(), |_, _| 2000);
    let hidden = [&ROOM[..], &["out", "--hidden", "behind.png"]].concat();
    check_error(folder.path(), &hidden, &["room.png", "0.9 m", "row 2, column 3", "2 m"]);
    fs::remove_file(folder.path().join("behind.depth.png")).unwrap();
    check_error(folder.path(), &hidden, &["behind.png", "needs a depth"]);
    check_error(folder.path(), &["run", "camera.ron", "--hidden", "behind.png", "--out", "out"], &["hidden", "a file"]);
}

#[test]
fn flat_scenes_are_stated_once() {
    let folder = folder();
    write_rgbd(folder.path(), |_, _| 2000);
    let scene = ["run", "camera.ron", "--scene", "room.png", "--out", "out"];
    let flat = |more: &[&'static str]| [&scene[..], more].concat();
    let alone = common::dioptric(folder.path(), &flat(&["--width-mm", "30"]));
    assert!(!alone.status.success() && String::from_utf8_lossy(&alone.stderr).contains("--distance-mm"));
    let both = flat(&["--width-mm", "30", "--distance-mm", "500", "--fov-deg", "3"]);
    assert!(!common::dioptric(folder.path(), &both).status.success());
    check_error(folder.path(), &flat(&["--width-mm", "-3", "--distance-mm", "500"]), &["--width-mm is -3"]);
    let world = ["run", "--width-mm", "30", "--distance-mm", "500", "--out", "out"];
    check_error(folder.path(), &world, &["flat is the size of what has depths of its own"]);
}
