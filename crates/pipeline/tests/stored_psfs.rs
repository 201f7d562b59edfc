//! Point spread functions of a file in place of those of a lens.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_pipeline::{Camera, KeptCamera, PipelineError, Silent};
use dioptric_scene::write_npz_arrays;
use dioptric_spectrum::{Bands, Cancel};
use ndarray::Array2;

/// Pixels of the film each way.
const N: usize = 64;

/// Returns the file of a thin lens, whose film of square pixels sees a target at 2 m, with more keys.
fn camera_text(more: &str) -> String {
    format!(
        r#"(
    name: "stored",
    lens: Thin(focal_length_mm: 50.0, diameter_mm: 12.5),
    focus: DistanceMm(2000.0),
    film: Pixels(columns: {N}, rows: {N}, pitch_um: 20.0),
    sensor: BuiltIn("nikon-d5100"),
    wavelengths: ListNm([500.0, 600.0]),
    scene: (source: Target(pattern: SlantedBar(slope: 2.6), columns: 200, rows: 200), field_of_view_deg: 5.0, depth_m: 2.0),
    {more}
)"#
    )
}

fn camera(folder: &Path, more: &str) -> Camera {
    Camera::parse(&camera_text(more), &folder.join("camera.ron")).unwrap()
}

/// Returns the planes of the irradiance.
fn planes(camera: Camera) -> Result<Vec<Array2<f32>>, PipelineError> {
    let irradiance = KeptCamera::new(camera).irradiance(&Silent, &Cancel::new())?;
    Ok((0..irradiance.grid().len()).map(|band| irradiance.band(band).unwrap().into_owned()).collect())
}

/// Writes functions of a wavelength each, on the pixels of the film, and no others.
fn write(folder: &Path, name: &str, functions: &[Array2<f32>]) {
    let (rows, columns) = functions[0].dim();
    let samples: Vec<f32> = functions.iter().flatten().copied().collect();
    let nm = [500.0, 600.0];
    let arrays: &[(&str, &[usize], &[f32])] = &[
        ("psf", &[functions.len(), rows, columns], &samples),
        ("wavelengths_nm", &[functions.len()], &nm[..functions.len()]),
        ("pitch_um", &[], &[20.0]),
    ];
    write_npz_arrays(&folder.join(name), arrays).unwrap();
}

/// Returns a comet with its head beside the middle, down and to the right, of sum 1.
fn comet(width: f32) -> Array2<f32> {
    let comet = Array2::from_shape_fn((15, 15), |(row, column)| {
        let (x, y) = (column as f32 - 8.0, row as f32 - 9.0);
        (-(x * x + y * y) / width - 0.3 * x.max(0.0) * y.max(0.0)).exp()
    });
    let sum = comet.sum();
    comet / sum
}

fn dot() -> Array2<f32> {
    let mut dot = Array2::zeros((3, 3));
    dot[(1, 1)] = 1.0;
    dot
}

#[test]
fn a_picture_is_the_sharp_one_convolved_with_them() {
    let folder = tempfile::tempdir().unwrap();
    let comets = [comet(6.0), comet(2.0)];
    write(folder.path(), "dots.npz", &[dot(), dot()]);
    write(folder.path(), "comets.npz", &comets);
    let of = |name: &str| planes(camera(folder.path(), &format!("psfs: {name:?},"))).unwrap();
    let (sharp, blurred) = (of("dots.npz"), of("comets.npz"));
    for ((sharp, blurred), comet) in sharp.iter().zip(&blurred).zip(&comets) {
        let light = sharp.mean().unwrap();
        for (row, column) in (8..N - 8).flat_map(|row| (8..N - 8).map(move |column| (row, column))) {
            let sum: f32 =
                comet.indexed_iter().map(|((r, c), share)| share * sharp[(row + 7 - r, column + 7 - c)]).sum();
            // What singles leave of transforms, and of kernels the share that is not worth a sample.
            assert!((blurred[(row, column)] - sum).abs() < 2e-3 * light, "{row}, {column}");
        }
    }
}

#[test]
fn the_light_stays_that_of_the_lens() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "dots.npz", &[dot(), dot()]);
    let traced = planes(camera(folder.path(), "diffraction: None,")).unwrap();
    let stored = planes(camera(folder.path(), r#"psfs: "dots.npz","#)).unwrap();
    for (traced, stored) in traced.iter().zip(&stored) {
        let sums = [traced.sum(), stored.sum()];
        assert!((sums[0] / sums[1] - 1.0).abs() < 1e-3, "{sums:?}");
    }
}

#[test]
fn what_they_do_not_go_with_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "one.npz", &[dot()]);
    let message = |more: &str| {
        let camera = camera(folder.path(), &format!(r#"psfs: "one.npz", {more}"#));
        planes(camera).unwrap_err().to_string()
    };
    let bands = message("");
    assert!(bands.contains("without 600 nm") && bands.contains("wavelengths_nm"), "{bands}");
    for (more, word) in [("blur: Views(16),", "blur"), ("movements: (tilt_deg: 2.0),", "tilt_deg")] {
        let text = camera_text(&format!(r#"psfs: "one.npz", {more}"#));
        let message = Camera::parse(&text, &folder.path().join("camera.ron")).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains("psfs"), "{message}");
    }
    let lost = planes(camera(folder.path(), r#"psfs: "lost.npz","#)).unwrap_err().to_string();
    assert!(lost.contains("lost.npz"), "{lost}");
}
