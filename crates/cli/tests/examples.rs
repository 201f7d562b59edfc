//! The examples run: each camera file on few pixels and bands, each lens file, and the inputs that formulas made.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its files fails")]

mod common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use approx::assert_relative_eq;
use common::output;
use dioptric_pipeline::{
    Camera, Capture, FilmSpec, FramesSpec, KeptCamera, RenderEffort, SceneSource, SceneSpec, Silent, WavelengthSpec,
    with_exposure_s,
};
use dioptric_spectrum::Cancel;
use serde_json::Value;

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// The camera files, by name.
fn camera_files() -> Vec<PathBuf> {
    let entries = fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "ron")).collect();
    files.sort();
    files
}

/// Takes the picture on pixels twelve times as wide, of what is as coarse, in three bands.
fn small(path: &Path) -> Capture {
    const COARSER: usize = 12;
    let fewer = |n: &mut usize| *n = (*n / COARSER).max(8);
    let mut camera = Camera::read(path).unwrap();
    if let FilmSpec::Pixels { columns, rows, pitch_um } = &mut camera.film {
        let width_um = *pitch_um * *columns as f64;
        fewer(columns);
        fewer(rows);
        let wider = width_um / *columns as f64 / *pitch_um;
        *pitch_um *= wider;
        // Wider pixels saturate the sooner.
        let exposure = serde_json::to_value(camera.exposure).unwrap();
        if let Some(time_s) = exposure["Manual"]["time_s"].as_f64() {
            camera.exposure = with_exposure_s(camera.exposure, time_s / (wider * wider));
        }
    }
    match &mut camera.scene.source {
        SceneSource::StillLife { columns, rows } => [columns, rows].into_iter().for_each(fewer),
        SceneSource::World(world) => {
            world.effort = RenderEffort::Samples(8);
            world.size = Some((24, 24));
        }
        SceneSource::File(_) | SceneSource::Target { .. } => {}
    }
    if camera.wavelengths.grid().unwrap().unwrap().len() > 3 {
        camera.wavelengths = WavelengthSpec::ListNm(vec![460.0, 540.0, 620.0]);
    }
    let kept = KeptCamera::new(camera);
    kept.capture(&Silent, &Cancel::new()).unwrap()
}

#[test]
fn every_example_camera_takes_its_picture() {
    let files = camera_files();
    assert!(files.len() >= 10, "{files:?}");
    for path in files {
        let capture = small(&path);
        let codes = capture.developed.picture.to_rgb8();
        let mean = codes.iter().map(|&code| f64::from(code)).sum::<f64>() / codes.len() as f64;
        // Neither black nor white.
        assert!((15.0..240.0).contains(&mean), "{}: a mean code of {mean}", path.display());
        let (darkest, brightest) = (codes.iter().min().unwrap(), codes.iter().max().unwrap());
        assert!(brightest - darkest > 60, "{}: codes from {darkest} to {brightest}", path.display());
    }
}

#[test]
fn examples_ask_for_what_they_show() {
    let read = |name: &str| Camera::read(&examples().join(name)).unwrap();
    assert!(matches!(read("night-burst.ron").frames, FramesSpec::MovingBurst { frames: 8, .. }));
    assert_eq!(read("view-camera.ron").movements.tilt_deg, 6.0);
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&output(&examples(), &[arguments, &["--json"]].concat())).unwrap()
}

#[track_caller]
fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// The same prescription in every format: at the d line, where a .dat file has its indices.
#[test]
fn one_lens_is_the_same_in_every_format() {
    let at_d = |lens: &str| json(&["lens", "info", lens, "--wavelengths-nm", "587.5618"])[0].clone();
    let built_in = at_d("canon-50mm");
    for file in ["ron", "zmx", "seq", "dat", "json", "deeplens.json"] {
        let lens = at_d(&format!("lenses/canon-50mm.{file}"));
        for key in ["efl_mm", "bfl_mm", "exit_pupil_z_mm", "entrance_pupil_diameter_mm"] {
            // Indices of the .json file are a table every 10 nm with straight lines between.
            assert_relative_eq!(number(&lens, key), number(&built_in, key), max_relative = 5e-6);
        }
    }
}

/// First-order data of the patent's lens as ray-optics prints them: efl 5.555, bfl .5678, f/3.5, exit pupil 3.602 before the film.
#[test]
fn phone_lens_has_its_published_data() {
    let lens = json(&["lens", "info", "lenses/phone.ron", "--wavelengths-nm", "587.5618"])[0].clone();
    for (key, published, half_digit) in [("efl_mm", 5.555, 5e-4), ("bfl_mm", 0.5678, 5e-5), ("ffl_mm", -7.531, 5e-4)] {
        assert!((number(&lens, key) - published).abs() <= half_digit, "{key} of {lens}");
    }
}

/// A Gaussian of .8 pixels: half of the modulation is left at √(ln 2 / 2) / (.8 π) cycles a pixel.
#[test]
fn edge_of_known_blur_has_its_mtf() {
    let measured = json(&["measure", "mtf", "scenes/edge.png"]);
    let found = number(&measured["channels"][0], "mtf50_cycles_per_pixel");
    let expected = (0.5 * 2_f64.ln()).sqrt() / (0.8 * std::f64::consts::PI);
    // A slanted edge of 64 samples shows it to half a percent.
    assert_relative_eq!(found, expected, max_relative = 5e-3);
}

#[test]
fn still_life_is_as_wide_as_asked() {
    let grid = dioptric_spectrum::WavelengthGrid::new(vec![550.0]).unwrap();
    let width_deg = |field_of_view_deg: Option<f64>| {
        let source = SceneSource::StillLife { columns: 12, rows: 8 };
        let spec = SceneSpec { source, field_of_view_deg, ..SceneSpec::of_file(PathBuf::new()) };
        spec.open(Some(&grid)).unwrap().require_view().unwrap().horizontal_fov_deg(12)
    };
    // The arrangement is made for 34 degrees.
    assert_relative_eq!(width_deg(None), 34.0, max_relative = 1e-12);
    assert_relative_eq!(width_deg(Some(58.0)), 58.0, max_relative = 1e-12);
}

#[test]
fn examples_stay_small() {
    fn bytes_in(folder: &Path) -> u64 {
        let of = |path: PathBuf| if path.is_dir() { bytes_in(&path) } else { fs::metadata(path).unwrap().len() };
        fs::read_dir(folder).unwrap().map(|entry| of(entry.unwrap().path())).sum()
    }
    let bytes = bytes_in(&examples());
    assert!(bytes < 1_500_000, "{bytes} bytes");
}
