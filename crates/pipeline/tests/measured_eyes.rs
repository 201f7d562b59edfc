//! Eyes of files: their coefficients, and those drawn from statistics.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{PhaseProfile, WavefrontError};
use dioptric_pipeline::{Camera, LensReadOptions, LensSpec};

/// A variable of a MATLAB file of version 5: a matrix of doubles, the first index fastest.
fn variable(name: &str, rows: usize, columns: usize, values: &[f64]) -> Vec<u8> {
    let element = |kind: u32, bytes: &[u8]| {
        let mut element = [kind.to_le_bytes(), (bytes.len() as u32).to_le_bytes()].concat();
        element.extend(bytes);
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let sides = [(rows as i32).to_le_bytes(), (columns as i32).to_le_bytes()].concat();
    let doubles: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let flags = [6_u32.to_le_bytes(), [0; 4]].concat();
    element(14, &[element(6, &flags), element(5, &sides), element(1, name.as_bytes()), element(9, &doubles)].concat())
}

fn mat_file(path: &Path, mean: &[f64], covariance: &[f64]) {
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0, 1, b'I', b'M']);
    let n = mean.len();
    bytes.extend(variable("sample_mean", n, 1, mean));
    bytes.extend(variable("S", n, n, covariance));
    std::fs::write(path, bytes).unwrap();
}

fn error_of(name: &str) -> WavefrontError {
    let file = LensSpec::named(name).open(&LensReadOptions::default()).unwrap();
    assert!((file.film_distance_mm.unwrap() * 1_f64.to_radians().tan() - 0.3).abs() < 1e-5);
    let PhaseProfile::Wavefront(error) = &file.lens.diffractive()[0].profile else { panic!("no wavefront error") };
    error.clone()
}

fn coefficients_um(name: &str) -> Vec<f64> {
    let error = error_of(name);
    assert_eq!((error.bands.len(), error.bands[0].wavelength_nm, error.chromatic_eye_nm), (1, 550.0, Some(550.0)));
    // As who looks into the eye has them: what is odd in x has the other sign.
    let odd = [2, 3, 8, 9];
    let of = error.bands[0].coefficients_um.iter().enumerate();
    of.map(|(j, um)| if odd.contains(&j) { -um } else { *um }).collect()
}

fn refusal(name: &str) -> String {
    LensSpec::named(name).open(&LensReadOptions::default()).unwrap_err().to_string()
}

#[test]
fn eyes_drawn_have_the_mean_and_the_covariance_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("statistics.mat");
    // Piston and tilts do not vary; defocus and spherical aberration vary together.
    let mean = [0.0, 0.0, 0.0, 0.02, 0.1, -0.05, 0.01, 0.0, 0.03];
    let n = mean.len();
    let covariance = |i: usize, j: usize| match (i.min(j), i.max(j)) {
        (0..=2, _) => 0.0,
        (4, 8) => 0.008,
        (5, 6) => -0.002,
        (i, j) if i == j => 0.01 / (i - 2) as f64,
        _ => 0.0,
    };
    let matrix: Vec<f64> = (0..n * n).map(|k| covariance(k % n, k / n)).collect();
    // Too much for two to have together.
    mat_file(&path, &mean, &matrix);
    let eye = |which: &str| format!("eye:{}:3mm{which}", path.display());
    assert!(refusal(&eye(":1")).contains("covariance"), "{}", refusal(&eye(":1")));
    assert_eq!(coefficients_um(&eye("")), mean);
    let covariance = |i: usize, j: usize| if (i.min(j), i.max(j)) == (4, 8) { 0.002 } else { covariance(i, j) };
    let matrix: Vec<f64> = (0..n * n).map(|k| covariance(k % n, k / n)).collect();
    mat_file(&path, &mean, &matrix);
    assert_eq!(error_of(&eye("")).radius_mm, 1.5);
    // The same eye again, whatever was drawn before; other seeds have others.
    assert_eq!(coefficients_um(&eye(":7@3")), coefficients_um(&eye(":7@3")));
    assert_ne!(coefficients_um(&eye(":7@3")), coefficients_um(&eye(":7@4")));
    let n_eyes = 4000;
    let eyes: Vec<Vec<f64>> = (0..n_eyes).map(|number| coefficients_um(&eye(&format!(":{number}")))).collect();
    let mean_of = |of: &dyn Fn(&[f64]) -> f64| eyes.iter().map(|eye| of(eye)).sum::<f64>() / f64::from(n_eyes);
    for i in 0..n {
        // Three standard errors of a mean and of a covariance.
        let off = (mean_of(&|eye| eye[i]) - mean[i]).abs();
        assert!(off <= 3.0 * (covariance(i, i) / f64::from(n_eyes)).sqrt(), "mean of {i}: off by {off}");
        for j in 0..=i {
            let found = mean_of(&|eye| (eye[i] - mean[i]) * (eye[j] - mean[j]));
            let spread = covariance(i, i) * covariance(j, j) + covariance(i, j).powi(2);
            let off = (found - covariance(i, j)).abs();
            assert!(off <= 3.0 * (spread / f64::from(n_eyes)).sqrt(), "covariance of {i} and {j}: off by {off}");
        }
    }
}

#[test]
fn tables_have_wavelengths_and_fields() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("eye.csv");
    let eye = format!("eye:{}:6mm", path.display());
    std::fs::write(&path, "j;um\n4;0,25\n8;0,1\n").unwrap();
    assert_eq!(coefficients_um(&eye), [0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.1]);
    let rows = "j,um,wavelength_nm,x_deg\n4,0.25,450,0\n4,0.2,650,0\n4,0.3,450,-10\n4,0.5,650,-10\n";
    std::fs::write(&path, rows).unwrap();
    let error = error_of(&eye);
    let bands: Vec<_> = error.bands.iter().map(|b| (b.wavelength_nm, b.field_deg[0], b.coefficients_um[4])).collect();
    let expected = [(450.0, 0.0, 0.25), (450.0, 10.0, 0.3), (650.0, 0.0, 0.2), (650.0, 10.0, 0.5)];
    assert_eq!((bands, error.chromatic_eye_nm), (expected.to_vec(), None));
    let json = folder.path().join("eye.json");
    std::fs::write(&json, r#"{"coefficients_um": [0, 0, 0, 0, 0.25]}"#).unwrap();
    assert_eq!(coefficients_um(&format!("eye:{}:6mm", json.display())), [0.0, 0.0, 0.0, 0.0, 0.25]);
    assert!(refusal(&format!("eye:{}:6mm:1", json.display())).contains("its covariance is 0 × 0, expected 5 × 5"));
    for (text, expected) in [
        ("j,um\n4,0.1\n4,0.2\n", "j 4 is there twice"),
        ("j,um\n300,0.1\n", "expected 0 to 230"),
        ("j,um\n", "no coefficients"),
        ("mode,um\n4,0.1\n", "expected the columns j and um"),
        ("j,um\n4,nan\n", "finite numbers"),
    ] {
        std::fs::write(&path, text).unwrap();
        assert!(refusal(&eye).contains(expected), "{text}: {}", refusal(&eye));
    }
    assert!(refusal(&format!("{eye}:1")).contains("one eye"));
    assert!(refusal(&format!("eye:{}:0mm", json.display())).contains("semi_aperture_mm"));
}

#[test]
fn a_camera_may_have_a_measured_eye() {
    let mut camera = Camera::demo().unwrap();
    camera.lens = LensSpec::named("eye:none.mat:3mm:7");
    camera.validate().unwrap();
    let again = Camera::parse(&camera.to_ron(), Path::new("camera.ron")).unwrap();
    assert_eq!(again.lens, camera.lens);
    camera.lens = LensSpec::named("eye:none.mat:-3mm");
    assert!(camera.validate().unwrap_err().to_string().contains("pupil_mm"));
}
