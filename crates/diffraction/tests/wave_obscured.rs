//! Pupils with holes, corners and sides: against closed forms, and against Huygens' sum.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::f64::consts::{PI, TAU};

use dioptric_diffraction::{
    DiffractionError, HuygensSources, PupilGrid, PupilSamples, WaveQuality, WaveWindow, Wavefront, WavefrontReference,
    WindowCenter, airy::bessel_j, wave_psf,
};
use dioptric_optics::{
    Aperture, Glass, Interface, Lens, MonoLens, ObjectPoint, Outline, Shape, Surface,
    glam::{DVec2, DVec3},
    quadrature::gauss_legendre_on,
};

const FOCAL_MM: f64 = 500.0;
const DIAMETER_MM: f64 = 5.0;
const WAVELENGTH_NM: f64 = 550.0;
/// λN of an ideal lens of f/100, mm. Sines are tangents there to 1.3e-5, and brightness even to that.
const UNIT_MM: f64 = WAVELENGTH_NM * 1e-6 * FOCAL_MM / DIAMETER_MM;

fn aperture(outline: Outline, center_mm: [f64; 2], is_obscuration: bool) -> Aperture {
    Aperture { surface: 0, outline, center_mm, is_obscuration }
}

fn disc(radius_mm: f64, center_mm: [f64; 2]) -> Aperture {
    aperture(Outline::Circle { radius_mm }, center_mm, true)
}

fn with(lens: &Lens, apertures: Vec<Aperture>) -> MonoLens {
    let lens = Lens::new_with_apertures(lens.name(), lens.source(), lens.interfaces().to_vec(), lens.stop(), apertures);
    lens.unwrap().at(WAVELENGTH_NM).unwrap()
}

fn thin(apertures: Vec<Aperture>) -> MonoLens {
    with(&Lens::thin(FOCAL_MM, DIAMETER_MM).unwrap(), apertures)
}

/// A paraboloid of the focal length and diameter of the ideal lens.
fn paraboloid(apertures: Vec<Aperture>) -> MonoLens {
    let surface =
        Surface { shape: Shape::Conic { conic: -1.0 }, ..Surface::sphere(-2.0 * FOCAL_MM, 0.5 * DIAMETER_MM) };
    let mirror = vec![Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 }];
    let lens = Lens::new_with_apertures("paraboloid", "test", mirror, 0, apertures).unwrap();
    lens.with_mirrors([0]).unwrap().at(WAVELENGTH_NM).unwrap()
}

fn far() -> ObjectPoint {
    ObjectPoint::Infinite(DVec3::Z)
}

/// 2 J₁(v)/v.
fn jinc(v: f64) -> f64 {
    if v.abs() < 1e-9 { 1.0 } else { 2.0 * bessel_j(1, v) / v }
}

/// sin(π t)/(π t).
fn sinc(t: f64) -> f64 {
    if t.abs() < 1e-9 { 1.0 } else { (PI * t).sin() / (PI * t) }
}

/// Irradiance of an annulus, per (λN)², for unit energy, at a radius in λN; its hole has the share `hole` of the diameter.
fn annulus(hole: f64, radius: f64) -> f64 {
    let amplitude = jinc(PI * radius) - hole * hole * jinc(PI * hole * radius);
    0.25 * PI * amplitude * amplitude / (1.0 - hole * hole)
}

/// Compares the sum at places of a window of ±`reach` λN with a closed form per mm².
#[track_caller]
fn check_places(nodes: &PupilSamples, reach: f64, expected: impl Fn(DVec2) -> f64, tolerance: f64) {
    let (mut difference, mut sum) = (0.0, 0.0);
    for k in 0..33 * 33 {
        let at = DVec2::new(f64::from(k % 33) - 16.0, f64::from(k / 33) - 16.0) * (reach / 16.0 * UNIT_MM);
        let (found, expected) = (nodes.irradiance_per_mm2(at), expected(at));
        difference += (found - expected).abs();
        sum += expected;
    }
    assert!(difference / sum < tolerance, "L1 {:e}", difference / sum);
}

#[test]
fn annulus_has_its_closed_form() {
    // A paraboloid with a hole, whose light runs back, is as good as an ideal lens.
    let cases = [0.2, 0.5, 0.8].map(|hole| [(hole, false), (hole, true)]);
    for (hole, is_mirror) in cases.into_iter().flatten() {
        let apertures = vec![disc(0.5 * DIAMETER_MM * hole, [0.0; 2])];
        let lens = if is_mirror { paraboloid(apertures) } else { thin(apertures) };
        let nodes = PupilSamples::trace(&lens, &far(), FOCAL_MM, PupilGrid::STANDARD, None).unwrap();
        assert!((nodes.collected / (PI / 4.0 * DIAMETER_MM.powi(2) * (1.0 - hole * hole)) - 1.0).abs() < 1e-9);
        assert!((nodes.energy.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let irradiance = |radius: f64| nodes.irradiance_per_mm2(DVec2::X * (radius * UNIT_MM)) * UNIT_MM * UNIT_MM;
        // What is left is sines against tangents, 1.3e-5 of the radius.
        check_places(&nodes, 4.0, |at| annulus(hole, at.length() / UNIT_MM) / UNIT_MM.powi(2), 1e-4);
        // The first dark ring, to the .05 % of Airy's.
        let amplitude = |r: f64| jinc(PI * r) - hole * hole * jinc(PI * hole * r);
        let (mut inside, mut outside) = (0.5, 1.22);
        for _ in 0..50 {
            let middle = 0.5 * (inside + outside);
            *(if amplitude(middle) > 0.0 { &mut inside } else { &mut outside }) = middle;
        }
        let step = 1e-3;
        let around = [inside - step, inside, inside + step].map(irradiance);
        let dark = inside + 0.5 * step * (around[0] - around[2]) / (around[0] - 2.0 * around[1] + around[2]);
        assert!((dark / inside - 1.0).abs() < 5e-4, "{dark} {inside}");
        assert!(around[1] < 1e-8 * irradiance(0.0));
        // The brightest place of the first ring, over the middle.
        let ring = |of: &dyn Fn(f64) -> f64| (0..400).map(|i| of(inside + 1e-3 * f64::from(i))).fold(0.0, f64::max);
        let (found, expected) = (ring(&irradiance), ring(&|r| annulus(hole, r)));
        assert!((found / irradiance(0.0) - expected / annulus(hole, 0.0)).abs() < 1e-4, "{found} {expected}");
        // Encircled energies.
        for reach in [0.5, 1.0, 2.0, 5.0] {
            let circles = gauss_legendre_on(60, 0.0, reach);
            let encircled = |of: &dyn Fn(f64) -> f64| circles.iter().map(|(r, w)| w * TAU * r * of(*r)).sum::<f64>();
            let (found, expected) = (encircled(&irradiance), encircled(&|r| annulus(hole, r)));
            assert!((found - expected).abs() < 1e-4, "{hole} {reach}: {found} {expected}");
        }
    }
}

#[test]
fn rectangle_has_its_sinc() {
    for (half_x_mm, half_y_mm, center_mm) in [(1.5, 1.5, [0.0; 2]), (2.0, 0.7, [0.0; 2]), (0.8, 1.1, [-0.6, 0.9])] {
        let lens = thin(vec![aperture(Outline::Rectangle { half_x_mm, half_y_mm }, center_mm, false)]);
        let grid = PupilGrid { n_radii: 16, n_azimuths: 64 };
        let nodes = PupilSamples::trace(&lens, &far(), FOCAL_MM, grid, None).unwrap();
        assert!((nodes.collected / (4.0 * half_x_mm * half_y_mm) - 1.0).abs() < 1e-6, "{}", nodes.collected);
        let turns_per_mm = 1.0 / (WAVELENGTH_NM * 1e-6 * FOCAL_MM);
        let expected = |at: DVec2| {
            let u = at * DVec2::new(half_x_mm, half_y_mm) * (2.0 * turns_per_mm);
            4.0 * half_x_mm * half_y_mm * (turns_per_mm * sinc(u.x) * sinc(u.y)).powi(2)
        };
        // A decentered opening sees the lens's slopes up to 2 mm of 500 off the axis.
        check_places(&nodes, 3.0, expected, 2e-4);
    }
}

#[test]
fn ellipse_has_airys_pattern_stretched() {
    let (half_x_mm, half_y_mm) = (2.0, 0.9);
    let lens = thin(vec![aperture(Outline::Ellipse { half_x_mm, half_y_mm }, [0.2, -0.1], false)]);
    let nodes = PupilSamples::trace(&lens, &far(), FOCAL_MM, PupilGrid::STANDARD, None).unwrap();
    let per_mm = 1.0 / (WAVELENGTH_NM * 1e-6 * FOCAL_MM);
    let expected = |at: DVec2| {
        let v = TAU * per_mm * (at * DVec2::new(half_x_mm, half_y_mm)).length();
        PI * half_x_mm * half_y_mm * (per_mm * jinc(v)).powi(2)
    };
    check_places(&nodes, 3.0, expected, 1e-4);
}

#[test]
fn decentered_discs_and_a_spider_are_a_sum_of_their_transforms() {
    // Two vanes that cross under a disc, and a disc by itself off the middle.
    let vane = |half_x_mm, half_y_mm| aperture(Outline::Rectangle { half_x_mm, half_y_mm }, [0.0; 2], true);
    let (hub_mm, vane_mm, spot_mm, spot) = (0.6, 0.1, 0.3, DVec2::new(1.3, 0.9));
    let outer_mm = 0.5 * DIAMETER_MM;
    let lens = thin(vec![vane(3.0, vane_mm), disc(hub_mm, [0.0; 2]), disc(spot_mm, spot.to_array())]);
    let nodes = PupilSamples::trace(&lens, &far(), FOCAL_MM, PupilGrid { n_radii: 20, n_azimuths: 80 }, None).unwrap();
    let per_mm = TAU / (WAVELENGTH_NM * 1e-6 * FOCAL_MM);
    // The hub and the vane by lines along the vane, of the length that both leave open.
    let amplitude = |at: DVec2| {
        let k = at * per_mm;
        let circle = |radius_mm: f64| PI * radius_mm * radius_mm * jinc(k.length() * radius_mm);
        let strip = |radius_mm: f64| -> f64 {
            let ends = |y: f64| (radius_mm * radius_mm - y * y).sqrt();
            let lines = gauss_legendre_on(24, -vane_mm, vane_mm);
            lines.iter().map(|(y, w)| w * (k.y * y).cos() * 2.0 * ends(*y) * sinc(k.x * ends(*y) / PI)).sum()
        };
        let symmetric = circle(outer_mm) - circle(hub_mm) - strip(outer_mm) + strip(hub_mm);
        let (sine, cosine) = k.dot(spot).sin_cos();
        (symmetric - circle(spot_mm) * cosine).hypot(circle(spot_mm) * sine)
    };
    let open_mm2 = amplitude(DVec2::ZERO);
    assert!((nodes.collected / open_mm2 - 1.0).abs() < 1e-6, "{} {open_mm2}", nodes.collected);
    let expected = |at: DVec2| (amplitude(at) * per_mm / TAU).powi(2) / open_mm2;
    check_places(&nodes, 4.0, expected, 2e-4);
}

#[test]
fn holes_of_a_real_lens_agree_with_huygens() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(5.6, 550.0).unwrap();
    let stop = lens.stop();
    let at_stop = |outline, center_mm, is_obscuration| Aperture { surface: stop, outline, center_mm, is_obscuration };
    let disc = |radius_mm| Outline::Circle { radius_mm };
    let vane = Outline::Rectangle { half_x_mm: 0.4, half_y_mm: 9.0 };
    let cases = [
        (vec![at_stop(disc(1.5), [0.0; 2], true)], 0.0),
        (vec![at_stop(disc(1.5), [0.0; 2], true)], 17.0),
        // A baffle before the lens moves over the pupil with the field, and over its edge.
        (vec![Aperture { surface: 0, outline: disc(3.0), center_mm: [1.0, 0.5], is_obscuration: true }], 15.0),
        (vec![at_stop(disc(1.2), [0.3, 0.0], true), at_stop(vane, [0.0; 2], true)], 12.0),
        (vec![at_stop(Outline::Rectangle { half_x_mm: 2.0, half_y_mm: 1.0 }, [0.5, 0.2], false)], 10.0),
    ];
    for (apertures, degrees) in cases {
        let lens = with(&lens, apertures.clone());
        let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.6, 0.8) * f64::to_radians(degrees).tan(), 0.5);
        let window = WaveWindow { pitch_um: 1.5, rows: 15, columns: 15, center: WindowCenter::Centroid };
        let points = WaveQuality { points_per_pixel: Some(1), ..WaveQuality::default() };
        let psf = wave_psf(&lens, &point, film_distance_mm, &window, points).unwrap();
        let places: Vec<DVec2> = psf.samples.indexed_iter().map(|((row, col), _)| psf.pixel_mm(row, col)).collect();
        let sum = |n: usize| {
            HuygensSources::trace(&lens, &point, film_distance_mm, psf.center_mm, n)
                .unwrap()
                .irradiance_per_mm2(&places)
        };
        let (coarse, expected) = (sum(96), sum(144));
        let total: f64 = expected.iter().sum();
        let l1 = |found: &mut dyn Iterator<Item = f64>| -> f64 {
            found.zip(&expected).map(|(a, b)| (a - b).abs()).sum::<f64>() / total
        };
        let own = l1(&mut coarse.iter().copied());
        let error = l1(&mut psf.samples.iter().map(|share| share / 1.5e-3f64.powi(2)));
        assert!(own < 1e-3 && error < 2e-3, "{apertures:?} at {degrees}°: {error}, the check's own {own}");
    }
}

#[test]
fn wavefront_of_an_annulus_has_its_defocus() {
    // Over an annulus of hole ε, defocus of W waves at the edge has the rms W (1 − ε²)/√12.
    let hole: f64 = 0.5;
    let lens = thin(vec![disc(0.5 * DIAMETER_MM * hole, [0.0; 2])]);
    let shift_mm = 8.0 * (FOCAL_MM / DIAMETER_MM).powi(2) * WAVELENGTH_NM * 1e-6 * 0.2;
    let film_distance_mm = FOCAL_MM - shift_mm;
    let wavefront =
        Wavefront::trace(&lens, &far(), film_distance_mm, PupilGrid::STANDARD, WavefrontReference::Best).unwrap();
    let edge_waves = 0.2 * FOCAL_MM / film_distance_mm;
    let expected = edge_waves * (1.0 - hole * hole) / 12f64.sqrt();
    assert!((wavefront.rms_waves() / expected - 1.0).abs() < 3e-3, "{} {expected}", wavefront.rms_waves());
    assert!((wavefront.zernike_waves(11)[3].abs() / (edge_waves / 12f64.sqrt()) - 1.0).abs() < 3e-3);
    // What is nowhere in the light does not count between the highest and the lowest; radii are a fortieth apart there.
    let fine = PupilGrid { n_radii: 60, n_azimuths: 16 };
    let fine = Wavefront::trace(&lens, &far(), film_distance_mm, fine, WavefrontReference::Best).unwrap();
    let found = fine.peak_to_valley_waves() / edge_waves;
    assert!(found < 1.0 - hole * hole && found > 1.0 - (hole + 0.026).powi(2), "{found}");
    let expected = sinc(edge_waves * (1.0 - hole * hole)).powi(2);
    assert!((wavefront.strehl() - expected).abs() < 2e-3, "{} {expected}", wavefront.strehl());
    let nodes = PupilSamples::trace(&lens, &far(), film_distance_mm, PupilGrid::STANDARD, None).unwrap();
    assert!((nodes.peak().unwrap().strehl - expected).abs() < 2e-3, "{:?}", nodes.peak());
}

#[test]
fn pupil_that_is_all_hole_is_dark() {
    let lens = thin(vec![disc(3.0, [0.0; 2])]);
    let dark = PupilSamples::trace(&lens, &far(), FOCAL_MM, PupilGrid::STANDARD, None).unwrap_err();
    assert_eq!(dark, DiffractionError::NoLight { wavelength_nm: WAVELENGTH_NM });
}
