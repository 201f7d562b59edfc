//! The wave sum against Airy's theory of a perfect lens with a round pupil.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::f64::consts::TAU;

use dioptric_diffraction::{
    DiffractionError, PhaseRange, PupilGrid, PupilSamples, WavePsf, WaveWindow, WindowCenter, airy,
};
use dioptric_optics::{glam::DVec2, quadrature::gauss_legendre_on};

const CENTER: WindowCenter = WindowCenter::At(DVec2::ZERO);

fn perfect(f_number: f64, wavelength_nm: f64) -> PupilSamples {
    PupilSamples::perfect(0.5 / f_number, 1.0, wavelength_nm, PupilGrid::STANDARD).unwrap()
}

/// Returns the largest-to-least error measure Σ|a − b| / Σ b of a psf against theory.
fn l1(psf: &WavePsf, theory: impl Fn(usize, usize) -> f64) -> f64 {
    let (mut difference, mut sum) = (0.0, 0.0);
    for ((row, column), share) in psf.samples.indexed_iter() {
        let expected = theory(row, column);
        difference += (share - expected).abs();
        sum += expected;
    }
    difference / sum
}

#[test]
fn airy_pattern_comes_out_of_576_nodes_at_every_f_number_and_wavelength() {
    for f_number in [2.0, 4.0, 5.0, 8.0, 22.0] {
        for wavelength_nm in [400.0, 550.0, 700.0] {
            let nodes = perfect(f_number, wavelength_nm);
            assert_eq!(nodes.len(), 576);
            // 65² places of λN/6, as far as 5.4 λN along an axis.
            let unit_um = wavelength_nm * 1e-3 * f_number;
            let window = WaveWindow { pitch_um: unit_um / 6.0, rows: 65, columns: 65, center: CENTER };
            let psf = nodes.psf(&window, Some(1)).unwrap();
            let at = |row, column| psf.pixel_mm(row, column).length() * 1e3 / unit_um;
            let error = l1(&psf, |row, column| airy::psf(at(row, column)) / 36.0);
            // The single-precision sums leave 1e-7 of the peak's amplitude everywhere.
            assert!(error < 1e-6, "f/{f_number} at {wavelength_nm} nm: {error:e}");
        }
    }
}

#[test]
fn first_zero_and_first_ring_lie_where_theory_has_them() {
    let nodes = perfect(5.0, 550.0);
    let unit_mm = 2.75e-3;
    assert!((nodes.airy_unit_mm() / unit_mm - 1.0).abs() < 1e-4);
    let at = |u: f64| nodes.irradiance_per_mm2(DVec2::from_angle(0.3) * (u * unit_mm));
    let extremum = |from: f64, to: f64, sign: f64| {
        let (mut low, mut high): (f64, f64) = (from, to);
        while high - low > 1e-7 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if sign * at(a) < sign * at(b) { low = a } else { high = b }
        }
        0.5 * (low + high)
    };
    let zero = extremum(1.0, 1.4, -1.0);
    assert!((zero / 1.219_669_9 - 1.0).abs() < 5e-4, "first zero at {zero} λN");
    let ring = extremum(1.4, 1.9, 1.0);
    assert!((ring - 1.6350).abs() < 1e-3, "first ring at {ring} λN");
    assert!((at(ring) / at(0.0) - 0.0175).abs() < 1e-4, "first ring of {}", at(ring) / at(0.0));
    let peak = std::f64::consts::PI / 4.0 / (unit_mm * unit_mm);
    assert!((at(0.0) / peak - 1.0).abs() < 1e-12 && (nodes.perfect_peak_per_mm2() / peak - 1.0).abs() < 1e-12);
}

#[test]
fn energy_in_a_circle_is_that_of_theory() {
    for f_number in [2.0, 22.0] {
        let nodes = perfect(f_number, 550.0);
        let unit_mm = 550e-6 * f_number;
        for radius in [0.5, 1.0, 1.22, 2.0, 4.0] {
            // The pattern is even in azimuth to rounding, and polynomial enough along the radius.
            let energy: f64 = gauss_legendre_on(40, 0.0, radius)
                .iter()
                .map(|(u, w)| TAU * u * w * nodes.irradiance_per_mm2(DVec2::new(u * unit_mm, 0.0)) * unit_mm * unit_mm)
                .sum();
            let error = energy - airy::encircled_energy(radius);
            assert!(error.abs() < 1e-6, "f/{f_number}, {radius} λN: {error:e}");
        }
    }
}

/// Returns the share of Airy's pattern in a square of this half-side, in λN: a circle, and four corners.
fn energy_in_square(half: f64) -> f64 {
    let corners: f64 = gauss_legendre_on(60, 0.0, std::f64::consts::FRAC_PI_4)
        .iter()
        .map(|(angle, w)| 8.0 * w / TAU * airy::encircled_energy(half / angle.cos()))
        .sum();
    corners
}

#[test]
fn window_captures_what_theory_says() {
    let nodes = perfect(4.0, 550.0);
    // Pixels of λN/2, two points in each.
    let window = |n: usize| WaveWindow { pitch_um: 1.1, rows: n, columns: n, center: CENTER };
    // The quadrature rule of a pixel for real use: 0.3 % in L1, far less in the sum.
    let psf = nodes.psf(&window(16), None).unwrap();
    assert_eq!(psf.points_per_pixel, 2);
    assert!((psf.captured - energy_in_square(4.0)).abs() < 3e-4, "{}", psf.captured - energy_in_square(4.0));
    // With more points only rounding is left.
    let psf = nodes.psf(&window(16), Some(5)).unwrap();
    assert!((psf.captured - energy_in_square(4.0)).abs() < 1e-6, "{:e}", psf.captured - energy_in_square(4.0));
    // ±10 λN hold 98.0 to 98.2 %, and ±40 λN at least 99.4 %.
    for (half, least, most) in [(10.0, 0.980, 0.982), (40.0, 0.994, 0.996)] {
        let grid = PupilGrid::needed(PhaseRange { rays: 0.0, along_radius: 0.0, window: TAU / 2.0 * half * 1.415 });
        let nodes = PupilSamples::perfect(0.125, 1.0, 550.0, grid).unwrap();
        let n = (2.0 * half) as usize;
        let window = WaveWindow { pitch_um: 2.2, rows: n, columns: n, center: CENTER };
        let psf = nodes.psf(&window, None).unwrap();
        assert!((least..most).contains(&psf.captured), "±{half} λN hold {}", psf.captured);
        assert!((psf.captured - energy_in_square(half)).abs() < 2e-4);
    }
}

#[test]
fn pixels_are_integrated_as_well_as_the_rule_promises() {
    // The pitch in λN, and the L1 error that the rule's number of points may leave.
    for (pitch, most) in [(0.5, 3e-3), (1.0, 2e-3), (2.0, 1.5e-3), (4.0, 2.5e-3)] {
        let nodes = PupilSamples::perfect(0.1, 1.0, 550.0, PupilGrid { n_radii: 24, n_azimuths: 96 }).unwrap();
        let n = (16.0 / pitch) as usize | 1;
        let window = WaveWindow { pitch_um: pitch * 2.75, rows: n, columns: n, center: CENTER };
        let psf = nodes.psf(&window, None).unwrap();
        let n_points = if pitch == 0.5 { 2 } else { 2 * pitch as usize + 1 };
        assert_eq!(psf.points_per_pixel, n_points);
        let fine = nodes.psf(&window, Some(3 * n_points + 4)).unwrap();
        let error = l1(&psf, |row, column| fine.samples[(row, column)]);
        assert!(error < most, "{pitch} λN with {n_points} points: {error}");
        let middle = nodes.psf(&window, Some(1)).unwrap();
        assert!(l1(&middle, |row, column| fine.samples[(row, column)]) > 0.05);
    }
}

#[test]
fn too_few_nodes_are_refused() {
    let nodes = perfect(4.0, 550.0);
    let window = WaveWindow { pitch_um: 2.2, rows: 40, columns: 40, center: CENTER };
    let error = nodes.psf(&window, None).unwrap_err();
    assert!(matches!(error, DiffractionError::TooFewNodes { n_radii: 12, n_azimuths: 48, .. }), "{error}");
    assert!(error.to_string().starts_with("12 x 48 nodes are too few for a phase range of B = 8"), "{error}");
}
