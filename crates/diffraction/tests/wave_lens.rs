//! The wave sum through traced lenses: against an exact integral, against Huygens and Fresnel, and against itself.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::f64::consts::{PI, TAU};

use dioptric_diffraction::{
    DiffractionError, HuygensSources, Propagation, PupilGrid, PupilSamples, WavePsf, WaveQuality, WaveWindow,
    WindowCenter, airy::bessel_j, polychromatic_psf, pupil_samples, wave_psf,
};
use dioptric_optics::{
    Glass, Interface, Lens, MonoLens, ObjectPoint, Surface,
    glam::{DVec2, DVec3},
    quadrature::gauss_legendre_on,
};

fn dgauss(f_number: f64) -> MonoLens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap().at(550.0).unwrap()
}

fn field(lens: &MonoLens, degrees: f64, dioptres: f64) -> ObjectPoint {
    ObjectPoint::from_field(lens, DVec2::new(0.6, 0.8) * degrees.to_radians().tan(), dioptres)
}

fn window(pitch_um: f64, n: usize) -> WaveWindow {
    WaveWindow { pitch_um, rows: n, columns: n, center: WindowCenter::Centroid }
}

fn l1(found: &WavePsf, expected: &WavePsf) -> f64 {
    (&found.samples - &expected.samples).mapv(f64::abs).sum() / expected.samples.sum()
}

/// Returns the irradiance of an ideal thin lens of focal length 50 mm for a far axial point: an even pupil, whose
/// directions are h / √(h² + f²), as a Hankel transform.
fn thin_lens_irradiance(radius_mm: f64, wavelength_nm: f64, r_mm: f64) -> f64 {
    let (f, wave_number) = (50.0, TAU / (wavelength_nm * 1e-6));
    let amplitude: f64 = gauss_legendre_on(40, 0.0, radius_mm)
        .iter()
        .map(|(h, w)| {
            let slant = (h * h + f * f).sqrt();
            let (sine, by_height) = (h / slant, f * f / slant.powi(3));
            // Energy 2 h dh / R², over direction area 2π s ds.
            let density = h / (PI * radius_mm * radius_mm * sine * by_height);
            w * by_height * TAU * sine * density.sqrt() * bessel_j(0, wave_number * sine * r_mm)
        })
        .sum();
    (amplitude / (wavelength_nm * 1e-6)).powi(2)
}

#[test]
fn traced_thin_lens_has_the_pattern_of_its_hankel_transform() {
    for (f_number, wavelength_nm) in [(2.0, 400.0), (2.0, 700.0), (8.0, 550.0), (22.0, 550.0)] {
        let lens = Lens::thin(50.0, 50.0 / f_number).unwrap().at(wavelength_nm).unwrap();
        let unit_um = wavelength_nm * 1e-3 * f_number;
        let nodes =
            PupilSamples::trace(&lens, &ObjectPoint::Infinite(DVec3::Z), 50.0, PupilGrid::STANDARD, None).unwrap();
        assert_eq!(nodes.propagation, Propagation::Fresnel);
        let psf = nodes.psf(&window(unit_um / 6.0, 41), Some(1)).unwrap();
        let (mut difference, mut sum) = (0.0, 0.0);
        for ((row, column), share) in psf.samples.indexed_iter() {
            let r_mm = psf.pixel_mm(row, column).length();
            let expected = thin_lens_irradiance(25.0 / f_number, wavelength_nm, r_mm) * (unit_um * 1e-3 / 6.0).powi(2);
            difference += (share - expected).abs();
            sum += expected;
        }
        // Single-precision sums, and difference quotients of 1e-8.
        assert!(difference / sum < 1e-6, "f/{f_number}: {:e}", difference / sum);
    }
}

/// Returns the L1 difference of plane-wave and spherical-wave sums over a window of `n`² places.
fn against_huygens(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, pitch_um: f64, n_rings: usize) -> f64 {
    let points = WaveQuality { points_per_pixel: Some(1), ..WaveQuality::default() };
    let psf = wave_psf(lens, point, film_distance_mm, &window(pitch_um, 25), points).unwrap();
    let places: Vec<DVec2> = psf.samples.indexed_iter().map(|((row, column), _)| psf.pixel_mm(row, column)).collect();
    let huygens = HuygensSources::trace(lens, point, film_distance_mm, psf.center_mm, 2 * n_rings).unwrap();
    let area = (pitch_um * 1e-3).powi(2);
    let expected = huygens.irradiance_per_mm2(&places);
    let difference: f64 = psf.samples.iter().zip(&expected).map(|(a, b)| (a - b * area).abs()).sum();
    difference / expected.iter().map(|b| b * area).sum::<f64>()
}

#[test]
fn plane_waves_agree_with_spherical_waves_written_out() {
    for (f_number, degrees) in [(8.0, 0.0), (8.0, 10.0), (4.0, 0.0), (4.0, 10.0)] {
        let lens = dgauss(f_number);
        let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
        let error = against_huygens(&lens, &field(&lens, degrees, 0.5), film_distance_mm, 0.55 * f_number / 3.0, 50);
        assert!(error < 0.005, "f/{f_number} at {degrees}°: {error}");
    }
}

#[test]
fn half_again_as_many_nodes_change_little() {
    // In focus, out of focus by up to 8 waves, off axis and vignetted.
    for (f_number, degrees, shift_mm) in [(8.0, 0.0, 0.0), (8.0, 12.0, 0.15), (4.0, 0.0, 0.3), (4.0, 12.0, 0.0)] {
        let lens = dgauss(f_number);
        let (point, film_distance_mm) =
            (field(&lens, degrees, 0.5), lens.film_distance_mm_for(2000.0).unwrap() + shift_mm);
        let window = window(2.0, 48);
        let nodes = pupil_samples(&lens, &point, film_distance_mm, &window, WaveQuality::default()).unwrap();
        let more = PupilSamples::trace(&lens, &point, film_distance_mm, nodes.grid.scaled(1.5), None).unwrap();
        let error = l1(&nodes.psf(&window, None).unwrap(), &more.psf(&window, None).unwrap());
        assert!(error < 1e-3, "f/{f_number} at {degrees}°, {shift_mm} mm: {error}");
    }
}

#[test]
fn energy_in_a_wide_window_is_nearly_all() {
    let lens = dgauss(8.0);
    let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
    for degrees in [0.0, 10.0] {
        // ±40 λN.
        let psf =
            wave_psf(&lens, &field(&lens, degrees, 0.5), film_distance_mm, &window(4.4, 80), WaveQuality::default());
        let psf = psf.unwrap();
        assert!((0.994..1.0).contains(&psf.captured), "{degrees}°: {}", psf.captured);
        // A film's row of the picture is the same energy, mirrored.
        assert_eq!(psf.in_film_frame()[(3, 0)], psf.samples[(3, 79)]);
    }
}

#[test]
fn window_may_lie_anywhere_and_is_in_the_picture_frame() {
    // A scene point to the right and above lands in the film's left lower part, and its comatic tail is vignetted.
    let lens = dgauss(4.0);
    let (point, film_distance_mm) = (field(&lens, 12.0, 0.5), lens.film_distance_mm_for(2000.0).unwrap());
    // The same places in a pixel for both windows, whichever way of summing suits each.
    let quality = WaveQuality { points_per_pixel: Some(3), ..WaveQuality::default() };
    let all = wave_psf(&lens, &point, film_distance_mm, &window(1.0, 61), quality).unwrap();
    assert!(all.center_mm.x < 0.0 && all.center_mm.y < 0.0 && all.center_mm == all.centroid_mm);
    let mut moment = DVec2::ZERO;
    for ((row, column), share) in all.samples.indexed_iter() {
        moment += *share * (all.pixel_mm(row, column) - all.center_mm);
    }
    // What the window leaves out, 2 % at 30 µm and more, may lie to one side.
    assert!((moment / all.captured).length() < 1e-3, "{moment}");
    // Part of the window, 7 columns to the right and 4 rows up in the picture.
    let center = all.pixel_mm(30 - 4, 30 + 7);
    let part = WaveWindow { rows: 11, columns: 9, center: WindowCenter::At(center), ..window(1.0, 0) };
    let part = wave_psf(&lens, &point, film_distance_mm, &part, quality).unwrap();
    for ((row, column), share) in part.samples.indexed_iter() {
        let expected = all.samples[(row + 26 - 5, column + 37 - 4)];
        assert!((share - expected).abs() < 1e-5 * all.samples[(30, 30)], "{row} {column}: {share} {expected}");
    }
}

#[test]
fn image_in_a_medium_is_smaller_by_its_index() {
    // One refracting surface in front of glass, focused inside: the same aperture, the wavelength shortened.
    let glass = |index: f64| {
        let surface = Surface::sphere(20.0, 2.0);
        let interface = Interface { surface, medium_after: Glass::Constant { index }, thickness_after_mm: 0.0 };
        Lens::new("one surface", "made up", vec![interface], 0).unwrap().at(550.0).unwrap()
    };
    let lens = glass(1.5);
    let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
    let far = ObjectPoint::Infinite(DVec3::Z);
    let nodes = PupilSamples::trace(&lens, &far, film_distance_mm, PupilGrid::STANDARD, None).unwrap();
    // NA is that of a pupil of 2 mm at 40 mm, in air: it does not change on a plane window behind.
    assert!((nodes.numerical_aperture() / 0.05 - 1.0).abs() < 0.01, "{}", nodes.numerical_aperture());
    let error = against_huygens(&lens, &far, film_distance_mm, 1.5, 40);
    assert!(error < 5e-3, "{error}");
}

#[test]
fn pinhole_sends_spherical_waves() {
    let lens = Lens::pinhole(0.3).unwrap().at(550.0).unwrap();
    for (point, film_distance_mm) in [
        (ObjectPoint::Infinite(DVec3::Z), 50.0),
        (ObjectPoint::Finite(DVec3::new(30.0, -10.0, -400.0)), 30.0),
        (ObjectPoint::Infinite(DVec3::Z), 10.0),
    ] {
        let nodes = PupilSamples::trace(&lens, &point, film_distance_mm, PupilGrid::STANDARD, None).unwrap();
        assert_eq!(nodes.propagation, Propagation::Fresnel);
        let error = against_huygens(&lens, &point, film_distance_mm, 0.6 * film_distance_mm, 40);
        assert!(error < 5e-3, "{film_distance_mm} mm: {error}");
    }
}

#[test]
fn polychromatic_psf_is_the_weighted_mean() {
    let lens = Lens::built_in("paper-2el").unwrap().with_f_number(12.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let point = ObjectPoint::from_field(&lens.at(550.0).unwrap(), DVec2::new(0.1, 0.0), 0.5);
    let spectrum = [(500.0, 1.0), (550.0, 3.0)];
    let window = WaveWindow { rows: 30, ..window(4.0, 33) };
    let sum = polychromatic_psf(&lens, &point, film_distance_mm, &window, &spectrum, WaveQuality::default()).unwrap();
    let at = WaveWindow { center: WindowCenter::At(sum.center_mm), ..window };
    let [short, long] = [500.0, 550.0]
        .map(|nm| wave_psf(&lens.at(nm).unwrap(), &point, film_distance_mm, &at, WaveQuality::default()).unwrap());
    let expected = &short.samples * 0.25 + &long.samples * 0.75;
    assert!((&sum.samples - &expected).mapv(f64::abs).sum() < 1e-12);
    assert!((sum.centroid_mm - 0.25 * short.centroid_mm - 0.75 * long.centroid_mm).length() < 1e-5);
    let no_light = polychromatic_psf(&lens, &point, film_distance_mm, &window, &[(500.0, 0.0)], WaveQuality::default());
    assert_eq!(no_light.unwrap_err(), DiffractionError::Weights);
}

#[test]
fn what_cannot_be_had_is_an_error() {
    let lens = dgauss(4.0);
    let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
    let far_off = field(&lens, 60.0, 0.5);
    let default = WaveQuality::default();
    let error = wave_psf(&lens, &far_off, film_distance_mm, &window(2.0, 8), default).unwrap_err();
    assert_eq!(error, DiffractionError::NoLight { wavelength_nm: 550.0 });
    let point = field(&lens, 0.0, 0.5);
    let error = wave_psf(&lens, &point, film_distance_mm + 10.0, &window(2.0, 8), default).unwrap_err();
    assert!(matches!(error, DiffractionError::TooBlurred { .. }), "{error}");
    for window in [window(0.0, 8), window(f64::NAN, 8), window(2.0, 0)] {
        let error = wave_psf(&lens, &point, film_distance_mm, &window, default).unwrap_err();
        assert!(matches!(error, DiffractionError::Setting { .. }), "{error}");
    }
    let few = WaveQuality { nodes: Some(PupilGrid { n_radii: 8, n_azimuths: 20 }), ..default };
    let error = wave_psf(&lens, &point, film_distance_mm + 0.2, &window(2.0, 32), few).unwrap_err();
    assert!(matches!(error, DiffractionError::TooFewNodes { n_radii: 8, n_azimuths: 20, .. }), "{error}");
}

#[test]
fn strehl_ratio_of_small_aberrations_is_that_of_their_rms() {
    let lens = dgauss(8.0);
    let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
    let point = field(&lens, 0.0, 0.5);
    for shift_mm in [-0.02, 0.02] {
        let nodes = PupilSamples::trace(&lens, &point, film_distance_mm + shift_mm, PupilGrid::STANDARD, None).unwrap();
        let peak = nodes.peak().unwrap();
        let wavefront = dioptric_diffraction::Wavefront::trace(
            &lens,
            &point,
            film_distance_mm + shift_mm,
            PupilGrid::STANDARD,
            dioptric_diffraction::WavefrontReference::Best,
        )
        .unwrap();
        let marechal = (-(TAU * wavefront.rms_waves()).powi(2)).exp();
        assert!((peak.strehl - wavefront.strehl()).abs() < 2e-3 && (peak.strehl - marechal).abs() < 0.02);
        assert!((peak.on_film_mm - wavefront.center_mm).length() < 1e-5);
    }
}

/// A mirror of f/1 off its axis, beside Huygens' sum over the mirror itself: 250 x 800 of its points, and the exact paths from a plane wave
/// to each and from there to the film, its highest point searched for along the picture's axis of symmetry.
#[dioptric_golden::needs_shared]
#[test]
fn strehl_ratio_of_coma_is_that_of_exact_paths() {
    let path = dioptric_golden::shared("data/lenses/more/paraboloid.seq").unwrap();
    let lens = Lens::read(&path).unwrap().at(550.0).unwrap();
    for (field_deg, expected) in [(0.1, 0.025_219), (0.2, 0.010_185), (0.3, 0.005_972_4)] {
        let point = field(&lens, field_deg, 0.0);
        let found = PupilSamples::peak_of(&lens, &point, 100.0).unwrap().strehl;
        assert!((found / expected - 1.0).abs() < 3e-4, "{field_deg}: {found} {expected}");
    }
}

/// Among the many summits of a large blur the peak is the highest: no pixel of a finer raster over all of it is higher.
#[test]
fn peak_of_a_large_blur_is_above_all_its_pixels() {
    let lens = Lens::built_in("canon-50mm").unwrap().at(550.0).unwrap();
    let film_distance_mm = lens.first_order().bfl_mm - 0.1;
    for degrees in [0.0, 4.0, 8.0, 10.0] {
        let point = field(&lens, degrees, 0.0);
        let peak = PupilSamples::peak_of(&lens, &point, film_distance_mm).unwrap();
        let nodes = pupil_samples(&lens, &point, film_distance_mm, &window(0.15, 801), WaveQuality::default()).unwrap();
        let psf = nodes.psf(&window(0.15, 801), None).unwrap();
        assert!(psf.captured > 0.9, "{degrees}: {}", psf.captured);
        let highest = psf.samples.iter().copied().fold(0.0, f64::max) / (0.15e-3f64).powi(2);
        let over_peak = highest / nodes.perfect_peak_per_mm2() / peak.strehl;
        // A pixel of 0.15 λN takes 1 % of a peak in its middle and 4 % of one at its corner.
        assert!(over_peak <= 1.0 + 1e-6 && over_peak > 0.95, "{degrees}: {over_peak}, {}", peak.strehl);
    }
}
