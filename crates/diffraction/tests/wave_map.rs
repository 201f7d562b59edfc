//! Waves as smooth functions over the pupil, held to traced nodes.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use dioptric_diffraction::{PupilFunctionFit, PupilOutline, WavePsf, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{Lens, MonoLens, ObjectPoint, PupilBoundary, glam::DVec2};

fn dgauss(f_number: f64, wavelength_nm: f64) -> MonoLens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap().at(wavelength_nm).unwrap()
}

fn map(lens: &MonoLens, field_tan: f64, dioptres: f64, film_distance_mm: f64) -> PupilFunctionFit {
    let point = ObjectPoint::from_field(lens, DVec2::new(field_tan, 0.0), dioptres);
    let pupil = PupilBoundary::find(lens, &point, 96).unwrap();
    let edge =
        PupilOutline { center_x_mm: pupil.center_mm().x, z_mm: pupil.z_mm(), rho_mm: pupil.rho_at_azimuths_mm() };
    PupilFunctionFit::trace(lens, &point, film_distance_mm, edge).unwrap()
}

fn l1(a: &WavePsf, b: &WavePsf) -> f64 {
    (&a.samples - &b.samples).mapv(f64::abs).sum() / b.samples.sum()
}

#[test]
fn fitted_waves_give_the_pattern_of_traced_ones() {
    // Sharp, blurred by a few waves, off axis, and vignetted with the lens wide open.
    for (f_number, degrees, shift_mm) in
        [(8.0, 0.0, 0.0), (8.0, 12.0, 0.15), (4.0, 8.0, 0.05), (2.8, 14.0, 0.0), (2.1, 4.0, 0.0)]
    {
        let lens = dgauss(f_number, 550.0);
        let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap() + shift_mm;
        let tan = f64::to_radians(degrees).tan();
        let map = map(&lens, tan, 0.5, film_distance_mm);
        let turn = DVec2::from_angle(0.4);
        let window = WaveWindow { pitch_um: 2.0, rows: 48, columns: 48, center: WindowCenter::Centroid };
        let found = map.psf(550.0, turn, &window).unwrap();
        let point = ObjectPoint::from_field(&lens, turn * tan, 0.5);
        let expected = wave_psf(&lens, &point, film_distance_mm, &window, WaveQuality::default()).unwrap();
        let error = l1(&found, &expected);
        println!("f/{f_number} {degrees}°: L1 {error:.2e}, fit {:.1e} waves", map.error_waves());
        // The kinks of a vignetted edge are known at 96 azimuths only.
        let tolerance = if f_number > 3.0 { 1e-3 } else { 5e-3 };
        assert!(error < tolerance, "f/{f_number} at {degrees}°: {error}");
        assert!((found.centroid_mm - expected.centroid_mm).length() < 1e-4);
        assert!((found.captured - expected.captured).abs() < 1e-3);
    }
}

/// Three pixels along the film's x, which runs to the left in the picture, and two against its y, which runs down.
#[test]
fn windows_beside_the_centroid_show_it_aside() {
    let lens = dgauss(4.0, 550.0);
    let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
    let (tan, turn) = (0.1, DVec2::from_angle(0.4));
    let (map, point) = (map(&lens, tan, 0.5, film_distance_mm), ObjectPoint::from_field(&lens, turn * tan, 0.5));
    let window = |center| WaveWindow { pitch_um: 2.0, rows: 48, columns: 48, center };
    let beside = window(WindowCenter::FromCentroid(DVec2::new(6e-3, -4e-3)));
    let about = map.psf(550.0, turn, &window(WindowCenter::Centroid)).unwrap().samples;
    let traced = wave_psf(&lens, &point, film_distance_mm, &beside, WaveQuality::default()).unwrap();
    for psf in [map.psf(550.0, turn, &beside).unwrap(), traced] {
        let off = |row: usize, column: usize| (psf.samples[(row + 2, column + 3)] - about[(row, column)]).abs();
        let sum: f64 = (0..46).flat_map(|row| (0..45).map(move |column| off(row, column))).sum();
        // As near as a fit is to traced waves.
        assert!(sum < 1e-3, "{sum}");
    }
}

#[test]
fn parts_of_a_fit_mix_to_it() {
    let lens = dgauss(8.0, 550.0);
    let map = map(&lens, 0.1, 0.5, lens.film_distance_mm_for(2000.0).unwrap());
    // Quarters have no rounding.
    assert_eq!(
        PupilFunctionFit::mix([(&map, 0.25), (&map, 0.75)].into_iter()).unwrap().error_waves(),
        map.error_waves()
    );
    assert_eq!(PupilFunctionFit::mix([(&map, 0.5), (&map, 0.5)].into_iter()).unwrap(), map);
    assert!(PupilFunctionFit::mix(std::iter::empty()).is_none());
}
