//! The demo's picture looks as it did: `fixtures/golden/demo-96x64.png`, to be looked at.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_golden::workspace_root;
use dioptric_pipeline::{Camera, Capture, CoatingSpec, FilmSpec, KeptCamera, SceneSource, Silent, WavelengthSpec};
use dioptric_spectrum::{Bands, Cancel};
use image::RgbImage;

/// The demo on ten times larger pixels, with seven bands; all noise is seeded.
fn small_demo(coating: Option<CoatingSpec>) -> Capture {
    let mut camera = Camera::demo().unwrap();
    camera.lens_reading.coating = coating;
    camera.film = FilmSpec::Pixels { columns: 96, rows: 64, pitch_um: 330.0 };
    camera.scene.source = SceneSource::StillLife { columns: 108, rows: 72 };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 50.0 };
    KeptCamera::new(camera).capture(&Silent, &Cancel::new()).unwrap()
}

fn save(picture: &RgbImage, path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    dioptric_pictures::save(&picture.clone().into(), path).unwrap();
}

/// Without losses of light the picture is that of the time before there were any.
#[test]
fn demo_is_the_golden_picture() {
    let picture = small_demo(Some(CoatingSpec::Ideal)).developed.picture.to_rgb8();
    let picture = RgbImage::from_raw(96, 64, picture).unwrap();
    let path = workspace_root().join("fixtures/golden/demo-96x64.png");
    let largest = dioptric_pictures::read(&path, dioptric_pictures::Limits::no_limits()).ok().map(|golden| {
        let golden = golden.into_rgb8();
        assert_eq!(golden.dimensions(), picture.dimensions());
        golden.as_raw().iter().zip(picture.as_raw()).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    });
    // One code of 255 for another library of elementary functions, and one for rounding.
    if largest.is_some_and(|codes| codes <= 2) {
        return;
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        save(&picture, &path);
        return;
    }
    let kept = workspace_root().join("target/golden/demo-96x64.png");
    save(&picture, &kept);
    panic!(
        "the picture differs by {largest:?} codes; the actual one is target/golden/demo-96x64.png (UPDATE_GOLDEN=1 accepts it)"
    );
}

/// The light about the middle of the film in a band.
fn in_middle(capture: &Capture, band: usize) -> f64 {
    let plane = capture.irradiance.band(band).unwrap();
    (24..40).flat_map(|row| (36..60).map(move |column| (row, column))).map(|at| f64::from(plane[at])).sum()
}

/// What coatings take of each band is what the lens does not transmit; the exposure is as much longer.
#[test]
fn light_is_less_by_the_transmission_of_the_lens() {
    let (lossless, coated) = (small_demo(Some(CoatingSpec::Ideal)), small_demo(None));
    for (band, &nm) in coated.grid().centers_nm().iter().enumerate() {
        let share = coated.lens.lens.at(nm).unwrap().axial_transmission(f64::INFINITY).unwrap();
        let ratio = in_middle(&coated, band) / in_middle(&lossless, band);
        // Up to 5 degrees from the axis it changes by a thousandth; in the corners, in the violet, by a hundredth.
        assert!((ratio / share - 1.0).abs() < 2e-3, "{nm} nm: {ratio} {share}");
    }
    let [before_s, after_s] = [&lossless, &coated].map(|capture| capture.frames.exposure.time_s);
    assert!((1.03..1.07).contains(&(after_s / before_s)), "{before_s} {after_s}");
}
