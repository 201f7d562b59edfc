//! Scenes that people have, from their files to the picture.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{CAMERA, dioptric, output};
use dioptric_spectrum::Bands;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    folder
}

fn report(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&output(folder, &[arguments, &["--json"]].concat())).unwrap()
}

#[test]
fn isetcam_scene_is_photographed() {
    let folder = folder();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes");
    let scene = scenes.join("iset_scene.mat");
    let run = ["run", "camera.ron", "--scene", scene.to_str().unwrap(), "--out", "out", "--film", "scene"];
    let report = report(folder.path(), &run);
    assert_eq!((report["scene"]["columns"].as_u64(), report["scene"]["rows"].as_u64()), (Some(6), Some(4)));
    assert!(report["scene"]["light"]["illuminance_lux"].as_f64().unwrap() > 100.0);
    let understood = report["scene"]["notes"][0].as_str().unwrap();
    assert!(understood.starts_with("iset_scene.mat: radiance of its photons, 5 bands of 420–700 nm"), "{understood}");
    let notes: Vec<&str> =
        report["scene"]["notes"].as_array().unwrap().iter().map(|note| note.as_str().unwrap()).collect();
    for start in [
        "iset_scene.mat: its variable 'other' is not used",
        "iset_scene.mat: 5 bands of 420–700 nm, 60 to 80 nm apart become 3 bands",
    ] {
        assert!(notes.iter().any(|note| note.starts_with(start)), "{notes:?}");
    }
    // The same scene of version 7.3, and written anew.
    let new = scenes.join("iset_scene_v73.mat");
    output(folder.path(), &["scene", "convert", scene.to_str().unwrap(), "again.mat"]);
    let info = |file: &str| -> serde_json::Value {
        serde_json::from_str(&output(folder.path(), &["scene", "info", file, "--json"])).unwrap()
    };
    let first = info(scene.to_str().unwrap());
    for other in [info(new.to_str().unwrap()), info("again.mat")] {
        for key in ["columns", "wavelengths_nm", "field_of_view_deg"] {
            assert_eq!(other[key], first[key], "{key}");
        }
        let luminance = |info: &serde_json::Value| info["mean_luminance_cd_m2"].as_f64().unwrap();
        assert!((luminance(&other) / luminance(&first) - 1.0).abs() < 1e-6);
    }
}

/// A flat scene by its size is the one of the angle and the depth that it has from the entrance pupil.
#[test]
fn flat_scene_is_as_wide_as_stated() {
    let folder = folder();
    let info = output(folder.path(), &["lens", "info", "dgauss-50mm", "--wavelengths-nm", "550", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    let pupil_mm = info[0]["entrance_pupil_z_mm"].as_f64().unwrap();
    let (width_mm, distance_mm) = (120.0, 400.0);
    let depth_mm = distance_mm + pupil_mm;
    let fov_deg = 2.0 * (0.5 * width_mm / depth_mm).atan().to_degrees();
    let scene =
        |words: &str| CAMERA.replace("field_of_view_deg: 14.0, depth_m: 2.0", words).replace("Uniform", "ColorChart");
    let by_size = scene(&format!("flat: (width_mm: {width_mm:?}, distance_mm: {distance_mm:?})"));
    let by_angle = scene(&format!("field_of_view_deg: {fov_deg}, depth_m: {}", 1e-3 * depth_mm));
    let irradiance = |name: &str, text: &str| {
        assert_ne!(text, CAMERA);
        fs::write(folder.path().join(format!("{name}.ron")), text.replace("DistanceMm(2000.0)", "DistanceMm(400.0)"))
            .unwrap();
        output(folder.path(), &["run", &format!("{name}.ron"), "--out", name, "--quiet"]);
        dioptric_pipeline::Irradiance::read_exr(&folder.path().join(name).join("irradiance.exr"), None)
            .unwrap()
            .of_own_file()
    };
    let (size, angle) = (irradiance("size", &by_size), irradiance("angle", &by_angle));
    for band in 0..3 {
        let (size, angle) = (size.band(band).unwrap(), angle.band(band).unwrap());
        let most = size.iter().copied().fold(0.0, f32::max);
        // The printed pupil has 17 digits; single precision, of depth too, is left.
        let largest = size.iter().zip(angle.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(most > 0.0 && largest < 1e-4 * most, "{largest} of {most}");
    }
}

/// What is given as lying behind is what is seen past an edge that is out of focus.
#[test]
fn hidden_layer_is_seen_past_an_edge() {
    let folder = folder();
    let save = |name: &str, color: &dyn Fn(u32) -> u8, depth: &dyn Fn(u32) -> u16| {
        let picture = image::RgbImage::from_fn(64, 48, |x, _| image::Rgb([color(x); 3]));
        dioptric_pictures::save(&picture.into(), &folder.path().join(format!("{name}.png"))).unwrap();
        let map = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(64, 48, |x, _| image::Luma([depth(x)]));
        dioptric_pictures::save(&map.into(), &folder.path().join(format!("{name}.depth.png"))).unwrap();
    };
    // A dark near half, in focus behind it a gray wall; what it hides is bright.
    save("room", &|x| if x < 32 { 40 } else { 100 }, &|x| if x < 32 { 500 } else { 2000 });
    save("behind", &|_| 255, &|x| if x < 32 { 2000 } else { 0 });
    let light = |more: &[&str]| {
        let run = [
            "run",
            "camera.ron",
            "--scene",
            "room.png",
            "--fov-deg",
            "14",
            "--f-number",
            "2.1",
            "--out",
            "out",
            "--quiet",
        ];
        output(folder.path(), &[&run[..], more].concat());
        let path = folder.path().join("out/irradiance.exr");
        let irradiance = dioptric_pipeline::Irradiance::read_exr(&path, None).unwrap().of_own_file();
        let green = irradiance.band(1).unwrap();
        // The edge lies in the middle of the film; far from it nothing of the hidden is seen.
        let at = |column: usize| f64::from(green[(16, column)]);
        (at(23), at(2), at(45))
    };
    let (guessed, known) = (light(&[]), light(&["--hidden", "behind.png"]));
    assert!(known.0 > 1.15 * guessed.0, "{known:?} {guessed:?}");
    for (known, guessed) in [(known.1, guessed.1), (known.2, guessed.2)] {
        assert!((known / guessed - 1.0).abs() < 0.02, "{known} {guessed}");
    }
}

/// Writes a file of 7 bands whose header says more than numbers, and a picture.
fn files(folder: &Path) {
    let header = "ENVI\nsamples = 8\nlines = 6\nbands = 7\ndata type = 12\ninterleave = bil\nwavelength units = nm\n\
                  wavelength = {400, 450, 500, 550, 600, 650, 700}\nreflectance scale factor = 1000\ndata ignore value = 9\n\
                  frobnicate = 3\n";
    fs::write(folder.join("cube.hdr"), header).unwrap();
    let codes: Vec<u8> = (0..8 * 6 * 7).flat_map(|i| (if i == 5 { 9_u16 } else { 500 }).to_le_bytes()).collect();
    fs::write(folder.join("cube.raw"), codes).unwrap();
    let picture = image::RgbImage::from_pixel(60, 40, image::Rgb([255, 255, 255]));
    dioptric_pictures::save(&picture.into(), &folder.join("white.png")).unwrap();
}

#[test]
fn scene_info_says_what_was_understood() {
    let folder = folder();
    files(folder.path());
    let text = output(folder.path(), &["scene", "info", "cube.hdr", "--depth-m", "2", "-o", "cube.png"]);
    for words in [
        "reflectance, 1000 being a perfect white, under a light of x, y 0.313, 0.329 and 1000 lx, 7 bands of 400–700 nm",
        "'frobnicate'",
        "1 without data are black",
        "no field of view",
    ] {
        assert!(text.contains(words), "'{words}' in: {text}");
    }
    assert!(folder.path().join("cube.png").is_file());
    // White of half reflectance under 1000 lx, written once and read again to the bit.
    let convert = ["scene", "convert", "cube.hdr", "cube.exr", "--depth-m", "2", "--fov-deg", "20", "--quiet"];
    output(folder.path(), &convert);
    let of = |arguments: &[&str]| report(folder.path(), &[&["scene", "info"], arguments].concat());
    let (own, made) = (of(&["cube.hdr", "--depth-m", "2", "--fov-deg", "20"]), of(&["cube.exr"]));
    for key in ["mean_radiance", "largest_radiance", "depth_m", "view", "light", "wavelengths_nm"] {
        assert_eq!(own[key], made[key], "{key}");
    }
    let luminance = own["mean_luminance_cd_m2"].as_f64().unwrap();
    // Seven bands of 50 nm sum a spectrum to 3 %, and one of 336 samples is black.
    assert!((luminance / (0.5 * 1000.0 / std::f64::consts::PI) - 1.0).abs() < 0.03, "{luminance}");
    let part = of(&["cube.exr", "--crop", "2,1,4,3", "--rotate-deg", "90"]);
    assert_eq!((part["columns"].as_u64(), part["rows"].as_u64()), (Some(3), Some(4)));
}

/// White under any light is white in the picture.
#[test]
fn relit_picture_is_white() {
    let folder = folder();
    files(folder.path());
    for light in ["D65", "A"] {
        let run = [
            "run",
            "camera.ron",
            "--scene",
            "white.png",
            "--fov-deg",
            "30",
            "--depth-m",
            "2",
            "--illuminant",
            light,
            "--noise",
            "none",
            "--wavelengths-nm",
            "400:700:20",
            "--out",
            "out",
        ];
        let text = dioptric(folder.path(), &run);
        assert!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
        let said = String::from_utf8_lossy(&text.stderr).into_owned();
        assert!(said.contains("white.png: a picture as a display shows it (sRGB of 8 bits)"), "{said}");
        let picture = common::read_picture(&folder.path().join("out/picture.png")).into_rgb8();
        let pixel = picture.get_pixel(24, 16).0.map(i32::from);
        assert!(pixel.iter().all(|v| (v - pixel[1]).abs() <= 2) && pixel[1] > 100, "{light}: {pixel:?}");
    }
}

#[test]
fn what_does_not_apply_is_refused_by_its_option() {
    let folder = folder();
    files(folder.path());
    for (options, words) in [
        (&["--white-level", "255"][..], &["white.png", "--white-level"][..]),
        (&["--unit", "W/m^2/sr/nm"], &["white.png", "--unit"]),
        (&["--unit", "lumen"], &["'lumen'"]),
        (&["--depth-unit", "mm"], &["white.png", "--depth FILE"]),
        (&["--depth", "none.png"], &["none.png"]),
        (&["--view", "cube.hdr"], &["cube.hdr", "expected JSON"]),
    ] {
        let run = ["run", "camera.ron", "--scene", "white.png", "--depth-m", "2", "--out", "bad"];
        common::check_error(folder.path(), &[&run[..], options].concat(), words);
    }
}

/// What is written is what its name says, and a part beyond all numbers is refused as any other.
#[test]
fn scenes_are_written_as_their_names_say() {
    let folder = folder();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_scene.mat");
    let scene = scene.to_str().unwrap();
    common::check_error(folder.path(), &["scene", "convert", scene, "out.tif"], &["out.tif", ".exr or .mat"]);
    common::check_error(folder.path(), &["scene", "info", scene, "-o", "out.jpg"], &["out.jpg", ".png"]);
    let most = format!("{},0,1,1", u64::MAX);
    common::check_error(
        folder.path(),
        &["scene", "convert", scene, "out.exr", "--crop", &most],
        &["the part of the scene"],
    );
}

/// Stars of a table bring what they are said to: a lux through the entrance pupil of a thin lens, all of it on the film.
#[test]
fn points_of_a_table_bring_their_light() {
    let folder = folder();
    let points = "name,x_deg,y_deg,lux,depth_m\na,0.5,-0.3,2,200\nb,-0.4,0.2,1,100\nc,0,0,1,\nd,60,0,1,\n";
    fs::write(folder.path().join("stars.csv"), points).unwrap();
    let camera = r#"(name: "stars", lens: BuiltIn("thin:50mm:f16"), focus: DistanceMm(500000.0), diffraction: None,
        film: Pixels(columns: 120, rows: 80, pitch_um: 20.0), sensor: BuiltIn("nikon-d5100"),
        scene: (source: Target(pattern: Uniform, columns: 60, rows: 40), field_of_view_deg: 4.0, depth_m: 500.0),
        wavelengths: Range(first_nm: 400.0, last_nm: 700.0, step_nm: 10.0))"#;
    fs::write(folder.path().join("stars.ron"), camera).unwrap();
    let run = |more: &[&str]| {
        let report = report(folder.path(), &[&["run", "stars.ron", "--out", "out"], more].concat());
        let mean = report["irradiance"]["mean_lux"].as_f64().unwrap();
        (mean * 120.0 * 80.0 * 0.02 * 0.02, report["scene"]["notes"].to_string())
    };
    let ((without, _), (with, notes)) = (run(&[]), run(&["--points", "stars.csv"]));
    let pupil_mm2 = std::f64::consts::PI * (50.0_f64 / 32.0).powi(2);
    let cos = 1.0 / (1.0 + 0.5_f64.to_radians().tan().powi(2) + 0.3_f64.to_radians().tan().powi(2)).sqrt();
    // Two stand before the wall; a star lies behind it, the fourth beside the film. The sine of the image side's angle is its tangent to 0.1 %.
    let expected = pupil_mm2 * (2.0 * cos + 1.0);
    assert!(((with - without) / expected - 1.0).abs() < 2e-3, "{with} {without} {expected}");
    assert!(notes.contains("4 points of stars.csv") && notes.contains("of 4 points 1 lie behind"), "{notes}");
    fs::write(folder.path().join("stars.csv"), "x_deg,y_deg,lux\n0,0,bright\n").unwrap();
    common::check_error(
        folder.path(),
        &["run", "camera.ron", "--points", "stars.csv"],
        &["stars.csv", "line 2", "lux"],
    );
}
