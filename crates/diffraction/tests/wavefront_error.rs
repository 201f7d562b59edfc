//! Lenses that are an ideal lens with a wavefront error, against what the error says.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::TAU;

use dioptric_diffraction::{
    PupilGrid, WaveQuality, WaveWindow, Wavefront, WavefrontReference, WindowCenter, wave_psf, zernike::noll,
};
use dioptric_optics::{
    DiffractiveSurface, Glass, Interface, Lens, ObjectPoint, PhaseProfile, RayBatch, Shape, Surface, Vignetting,
    WavefrontBand, WavefrontError, ZernikeTerms,
    glam::{DVec2, DVec3},
    quadrature::gauss_legendre_on,
};

const NM: f64 = 550.0;
const RADIUS_MM: f64 = 1.5;
const FAR: ObjectPoint = ObjectPoint::Infinite(DVec3::Z);

/// An ideal lens right before a stop with this error, µm in Noll's terms.
fn lens(focal_mm: f64, coefficients_um: Vec<f64>) -> Lens {
    let surface = |shape, semi_aperture_mm| Interface {
        surface: Surface { curvature_per_mm: 0.0, shape, semi_aperture_mm },
        medium_after: Glass::Air,
        thickness_after_mm: 0.0,
    };
    let ideal = Shape::ThinLens { power_per_mm: 1.0 / focal_mm };
    let error = WavefrontError {
        radius_mm: RADIUS_MM,
        terms: ZernikeTerms::Noll,
        bands: vec![WavefrontBand { wavelength_nm: NM, coefficients_um, ..WavefrontBand::default() }],
        turned_about_axis: false,
        chromatic_eye_nm: None,
    };
    let profile = PhaseProfile::Wavefront(error);
    Lens::new("error", "test", vec![surface(ideal, 10.0), surface(Shape::Sphere, RADIUS_MM)], 1)
        .unwrap()
        .with_diffractive(vec![DiffractiveSurface { surface: 1, order: 1, profile, blaze: None }])
        .unwrap()
}

fn one_term(j: usize, um: f64) -> Vec<f64> {
    let mut coefficients_um = vec![0.0; j];
    coefficients_um[j - 1] = um;
    coefficients_um
}

#[test]
fn traced_wavefronts_have_the_terms_that_were_stated() {
    // At f/80 and f/2.8.
    for (j, focal_mm) in (4..=15).flat_map(|j| [(j, 240.0), (j, 8.4)]) {
        let mono = lens(focal_mm, one_term(j, 0.02)).at(NM).unwrap();
        let traced = Wavefront::trace(&mono, &FAR, focal_mm, PupilGrid::STANDARD, WavefrontReference::Chief).unwrap();
        let found = traced.zernike_waves(15);
        let expected = 0.02 / (1e-3 * NM);
        // Terms found are over sines of directions, those stated over the flat pupil: discs that differ by half the square of the aperture.
        let tolerance = 2e-3 + 0.5 * (RADIUS_MM / focal_mm).powi(2);
        assert!((found[j - 1] / expected - 1.0).abs() < tolerance, "Z{j}: {} {expected}", found[j - 1]);
        let others = found.iter().enumerate().skip(3).filter(|(i, _)| i + 1 != j);
        assert!(others.into_iter().all(|(_, other)| other.abs() < tolerance * expected), "Z{j}: {found:?}");
    }
}

/// Coma moves the chief ray's place by much of a narrow pupil: what is taken out of a wavefront as tilt leaves the other terms alone.
#[test]
fn a_wavefront_without_its_tilt_has_the_other_terms() {
    let coefficients_um = vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.03, 0.05, 0.1, 0.0, 0.0, 0.08];
    let mono = lens(400.0, coefficients_um.clone()).at(NM).unwrap();
    let traced = Wavefront::trace(&mono, &FAR, 400.0, PupilGrid::STANDARD, WavefrontReference::Best).unwrap();
    for (found, stated_um) in traced.zernike_waves(15).iter().zip(coefficients_um.iter().chain(&[0.0; 4])).skip(3) {
        assert!((found * 1e-3 * NM - stated_um).abs() < 1e-4, "{found} {stated_um}");
    }
}

/// The sum of waves from the places of a pupil to a point of the film, about the focus.
fn direct(focal_mm: f64, coefficients_um: &[f64], at_mm: DVec2) -> f64 {
    let wave_number_per_mm = TAU / (1e-6 * NM);
    let (radii, n_azimuths) = (gauss_legendre_on(24, 0.0, 1.0), 96);
    let focus = DVec3::Z * focal_mm;
    let mut sum = DVec2::ZERO;
    for (rho, weight) in &radii {
        for i in 0..n_azimuths {
            let place = DVec2::from_angle(TAU * f64::from(i) / f64::from(n_azimuths)) * *rho;
            let ahead_um: f64 = coefficients_um.iter().enumerate().map(|(i, um)| um * noll(i + 1, place)).sum();
            let from = (RADIUS_MM * place).extend(0.0);
            let longer_mm = (focus + at_mm.extend(0.0)).distance(from) - focus.distance(from) - 1e-3 * ahead_um;
            sum += DVec2::from_angle((wave_number_per_mm * longer_mm).rem_euclid(TAU)) * (rho * weight);
        }
    }
    (2.0 * sum / f64::from(n_azimuths)).length_squared()
}

#[test]
fn point_spreads_are_those_of_a_direct_sum() {
    // At f/20 and f/2.8.
    for (focal_mm, pitch_um) in [(60.0, 4.0), (8.4, 0.56)] {
        point_spreads_of(focal_mm, pitch_um);
    }
}

fn point_spreads_of(focal_mm: f64, pitch_um: f64) {
    // Waves count by their slopes in the sum of the program, all alike in the direct one.
    let tolerance = 1e-3 + 0.15 * (RADIUS_MM / focal_mm).powi(2);
    let n = 21;
    let window = WaveWindow { pitch_um, rows: n, columns: n, center: WindowCenter::At(DVec2::ZERO) };
    let quality = WaveQuality { nodes: None, points_per_pixel: Some(1) };
    let peak_of = |coefficients_um: Vec<f64>| {
        let mono = lens(focal_mm, coefficients_um).at(NM).unwrap();
        wave_psf(&mono, &FAR, focal_mm, &window, quality).unwrap()
    };
    let unaberrated = peak_of(vec![]).samples[(n / 2, n / 2)];
    let cases =
        (2..=11).map(|j| one_term(j, 0.15)).chain([vec![], vec![0.0, 0.0, 0.0, 0.2, -0.1, 0.05, 0.1, 0.0, 0.08]]);
    for coefficients_um in cases {
        let psf = peak_of(coefficients_um.clone());
        let film = psf.in_film_frame();
        let mut worst: f64 = 0.0;
        for ((row, column), energy) in film.indexed_iter() {
            let from_middle = |i: usize| 1e-3 * pitch_um * (i as f64 - (n / 2) as f64);
            let at_mm = DVec2::new(from_middle(column), from_middle(row));
            worst = worst.max((energy / unaberrated - direct(focal_mm, &coefficients_um, at_mm)).abs());
        }
        assert!(worst < tolerance, "{focal_mm} {coefficients_um:?}: {worst:e}");
    }
}

/// The lens with coma along y that grows in step with the field, to 0.1 µm at 10° upwards.
fn with_coma_by_field(turned_about_axis: bool) -> Lens {
    let lens = lens(240.0, vec![]);
    let band = |y_deg: f64, um: f64| WavefrontBand {
        wavelength_nm: NM,
        field_deg: [0.0, y_deg],
        coefficients_um: one_term(7, um),
    };
    let error = WavefrontError {
        radius_mm: RADIUS_MM,
        terms: ZernikeTerms::Noll,
        bands: vec![band(0.0, 0.0), band(10.0, 0.1)],
        turned_about_axis,
        chromatic_eye_nm: None,
    };
    let profile = PhaseProfile::Wavefront(error);
    lens.with_diffractive(vec![DiffractiveSurface { surface: 1, order: 1, profile, blaze: None }]).unwrap()
}

/// A point at a field, to the right and upwards, far away or so far before the lens.
fn point(x_deg: f64, y_deg: f64, distance_mm: f64) -> ObjectPoint {
    let toward = DVec3::new(x_deg.to_radians().tan(), y_deg.to_radians().tan(), -1.0);
    match distance_mm.is_finite() {
        true => ObjectPoint::Finite(distance_mm * toward),
        false => ObjectPoint::Infinite(-toward.normalize()),
    }
}

#[test]
fn a_term_that_grows_with_the_field_is_that_share_of_itself() {
    for (distance_mm, film_mm) in [(f64::INFINITY, 240.0), (600.0, 400.0)] {
        let coma_waves = |lens: &Lens, x_deg: f64, y_deg: f64| {
            let (mono, point) = (lens.at(NM).unwrap(), point(x_deg, y_deg, distance_mm));
            let traced = Wavefront::trace(&mono, &point, film_mm, PupilGrid::STANDARD, WavefrontReference::Chief);
            let terms = traced.unwrap().zernike_waves(8);
            [terms[6], terms[7]]
        };
        // Along y and along x, of 0.1 µm.
        let most = 0.1 / (1e-3 * NM);
        let (fixed, turned) = (with_coma_by_field(false), with_coma_by_field(true));
        let diagonal_deg = (2_f64.sqrt() * 5_f64.to_radians().tan()).atan().to_degrees();
        for (lens, x_deg, y_deg, expected) in [
            (&fixed, 0.0, 0.0, [0.0, 0.0]),
            (&fixed, 0.0, 2.5, [0.25, 0.0]),
            (&fixed, 3.0, 7.5, [0.75, 0.0]),
            (&fixed, 0.0, -5.0, [0.0, 0.0]),
            (&fixed, 0.0, 14.0, [1.0, 0.0]),
            (&turned, 0.0, 5.0, [0.5, 0.0]),
            (&turned, 0.0, -5.0, [-0.5, 0.0]),
            (&turned, 5.0, 0.0, [0.0, 0.5]),
            (&turned, 5.0, 5.0, [0.1 * diagonal_deg * 0.5_f64.sqrt(), 0.1 * diagonal_deg * 0.5_f64.sqrt()]),
        ] {
            let found = coma_waves(lens, x_deg, y_deg);
            // The pupil is foreshortened by the cosine of the field, which is 3 % at 14°.
            let off = [0, 1].map(|i| (found[i] / most - expected[i]).abs());
            assert!(
                off.iter().all(|off| *off < 0.04),
                "{x_deg} {y_deg} {distance_mm}: {found:?} of {most}: {expected:?}"
            );
        }
    }
}

#[test]
fn halfway_the_point_spread_is_that_of_the_mean_coefficients() {
    let window = WaveWindow { pitch_um: 8.0, rows: 21, columns: 21, center: WindowCenter::Centroid };
    let quality = WaveQuality { nodes: None, points_per_pixel: Some(1) };
    for (distance_mm, film_mm) in [(f64::INFINITY, 240.0), (600.0, 400.0)] {
        let psf = |lens: &Lens| {
            wave_psf(&lens.at(NM).unwrap(), &point(0.0, 5.0, distance_mm), film_mm, &window, quality).unwrap()
        };
        for turned in [false, true] {
            let (found, expected) =
                (psf(&with_coma_by_field(turned)).samples, psf(&lens(240.0, one_term(7, 0.05))).samples);
            let peak = expected.iter().copied().fold(0.0, f64::max);
            let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-9 * peak, "{distance_mm} {turned}: {:e}", worst / peak);
        }
    }
}

/// Back along the way that it came, light is turned as it was: the field is that of the side of the object.
#[test]
fn rays_from_the_film_go_back_to_the_scene() {
    for turned in [false, true] {
        let mono = with_coma_by_field(turned).at(NM).unwrap();
        let reversed = mono.reversed();
        for (x_deg, y_deg) in [(0.0, 5.0), (4.0, 2.0), (-3.0, 8.0)] {
            let ObjectPoint::Infinite(direction) = point(x_deg, y_deg, f64::INFINITY) else { unreachable!() };
            let place = DVec3::new(0.7, -0.9, 0.0);
            let mut rays = RayBatch::from_points(&[place], &[direction]);
            mono.trace(&mut rays, Vignetting::On);
            let mut back = RayBatch::from_points(&[rays.point_mm(0)], &[-rays.direction(0)]);
            reversed.trace(&mut back, Vignetting::On);
            assert!((back.direction(0) + direction).length() < 1e-12, "{turned} {x_deg} {y_deg}");
        }
    }
}
