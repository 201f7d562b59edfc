//! A uniform plane through lenses whose PSFs change over the field: no seams, and the relative illumination of real rays.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking and shows its numbers")]

mod plane;

use dioptric_psf::Diffraction;
use plane::{Case, Uniform};

#[track_caller]
fn check(case: &Case, flatness: f64) {
    let uniform = Uniform::new(case);
    let (step, at) = uniform.worst_step();
    let (error, radius_mm) = uniform.worst_illumination();
    let Case { lens, f_number, .. } = case;
    println!(
        "{lens} f/{f_number}: second difference {step:.2e} at {at:?}, illumination {error:+.2e} at {radius_mm:.2} mm"
    );
    assert!(step <= 1e-4, "{lens} f/{f_number}: {step} at {at:?}");
    assert!(error.abs() <= flatness, "{lens} f/{f_number}: {error} at {radius_mm} mm");
}

/// Seams were steps of 2.8 % of the mean, at multiples of 16 and 32 pixels from the axis.
#[test]
fn wide_double_gauss_has_no_seams() {
    let lens = "dgauss-50mm";
    check(
        &Case {
            lens,
            f_number: 2.03,
            focus_mm: 2000.0,
            plane_mm: 2000.0,
            columns: 1086,
            pitch_um: 20.8333,
            diffraction: Diffraction::None,
        },
        2e-3,
    );
}

#[test]
fn wide_tessar_has_no_seams() {
    check(
        &Case {
            lens: "tessar-50mm",
            f_number: 4.5,
            focus_mm: 2000.0,
            plane_mm: 2000.0,
            columns: 724,
            pitch_um: 20.8333,
            diffraction: Diffraction::None,
        },
        2e-3,
    );
}

#[test]
fn defocused_lens_has_no_seams() {
    let lens = "dgauss-50mm";
    check(
        &Case {
            lens,
            f_number: 2.03,
            focus_mm: 2000.0,
            plane_mm: 400.0,
            columns: 543,
            pitch_um: 41.6667,
            diffraction: Diffraction::None,
        },
        2e-3,
    );
}
