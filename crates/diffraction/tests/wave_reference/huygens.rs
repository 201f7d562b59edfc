//! Plane waves, against spherical waves written out, for every lens there is.
//!
//! The sum of spherical waves tries rays on a square grid, follows rims through its cells, and takes each wave's exact
//! distance; it shares no node, area or phase with the sum of plane waves. Each case first shows that it has converged:
//! with half again as many cells along each side it changes by less than .001.

use dioptric_diffraction::{HuygensSources, PupilGrid, PupilSamples, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{Glass, Interface, Lens, MonoLens, ObjectPoint, PupilBoundary, Surface, glam::DVec2};

use crate::{
    lens::Reference,
    reader::{NAMES, json, number},
};

/// Phases over the pupil's radius, with the window's, up to which a lens is compared; a faster one is stopped down.
const BANDWIDTH: f64 = 80.0;
/// Places along each side of a window of ±3 λN.
const N: usize = 11;
/// What the plane-wave sum may differ by in L1: two errors of the check itself. The bar of the project is .005.
const BAR: f64 = 0.002;

fn l1(found: &[f64], expected: &[f64]) -> f64 {
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).sum::<f64>() / expected.iter().sum::<f64>()
}

/// Compares both sums about the centroid of the light; `false` where there are too many phases.
#[track_caller]
fn compare(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, what: &str) -> bool {
    let Ok(nodes) = PupilSamples::trace(lens, point, film_distance_mm, PupilGrid::STANDARD, None) else { return false };
    let pitch_um = 6e3 * nodes.airy_unit_mm() / (N - 1) as f64;
    let window = WaveWindow { pitch_um, rows: N, columns: N, center: WindowCenter::Centroid };
    let quality = WaveQuality { points_per_pixel: Some(1), ..WaveQuality::default() };
    let psf = match wave_psf(lens, point, film_distance_mm, &window, quality) {
        Ok(psf) if psf.bandwidth <= BANDWIDTH => psf,
        _ => return false,
    };
    let places: Vec<DVec2> = psf.samples.indexed_iter().map(|((row, column), _)| psf.pixel_mm(row, column)).collect();
    let found: Vec<f64> = psf.samples.iter().map(|share| share / (pitch_um * 1e-3).powi(2)).collect();
    let sum = |n_across: usize| {
        let sources = HuygensSources::trace(lens, point, film_distance_mm, psf.center_mm, n_across).unwrap();
        sources.irradiance_per_mm2(&places)
    };
    let n = (1.1 * psf.bandwidth).max(48.0) as usize;
    let (coarse, expected) = (sum(n), sum(n * 3 / 2));
    let (own, error) = (l1(&coarse, &expected), l1(&found, &expected));
    println!("{what}: B {:.0}, L1 {error:.5}; {n} and {} cells across: {own:.5}", psf.bandwidth, n * 3 / 2);
    assert!(own < 1e-3, "{what}: the check has not converged: {own}");
    assert!(error < BAR, "{what}: {error}");
    true
}

/// Stops a lens down until its phases are few enough, and compares.
fn compare_stopped(lens: &Lens, wavelength_nm: f64, what: &str, at: impl Fn(&MonoLens) -> Option<(ObjectPoint, f64)>) {
    let full_mm = 2.0 * lens.at(wavelength_nm).unwrap().stop_semi_aperture_mm();
    for steps in 0..9 {
        let stopped = lens.clone().with_stop_diameter_mm(full_mm * 0.75f64.powi(steps)).unwrap();
        let lens = stopped.at(wavelength_nm).unwrap();
        let Some((point, film_distance_mm)) = at(&lens) else { break };
        if compare(
            &lens,
            &point,
            film_distance_mm,
            &format!("{what}, {wavelength_nm} nm, stop {:.2}", 0.75f64.powi(steps)),
        ) {
            return;
        }
    }
    panic!("{what} at {wavelength_nm} nm was not compared");
}

/// Where a built-in lens is looked at: degrees off the axis, and how far before its first vertex it is focused, mm.
const FIELDS: [(&str, f64, f64); 16] = [
    ("paper-2el", 12.0, 2000.0),
    ("dgauss-50mm", 18.0, 2000.0),
    ("dgauss-50mm-schott", 18.0, 2000.0),
    ("canon-50mm", 18.0, 2000.0),
    ("tessar-50mm", 20.0, 2000.0),
    ("cooke-50mm", 20.0, 2000.0),
    ("singlet-50mm", 10.0, 2000.0),
    ("achromat-100mm", 5.0, 2000.0),
    ("asphere-15mm", 5.0, 2000.0),
    ("wide-100deg", 45.0, 2000.0),
    ("wide-6mm", 35.0, 2000.0),
    ("fisheye-12.5mm", 75.0, 2000.0),
    ("telephoto-127mm", 18.0, 2000.0),
    ("telephoto-250mm", 9.0, 2000.0),
    ("microscope-20x", 1.0, f64::INFINITY),
    ("relay-1to1", 3.0, 94.0),
];

/// The point at a field of a lens, and the film on which the axis is sharp.
fn point_and_film(lens: &MonoLens, field_tan: DVec2, distance_mm: f64) -> Option<(ObjectPoint, f64)> {
    let dioptres = 1e3 / (distance_mm + lens.projection_center_z_mm());
    Some((ObjectPoint::from_field(lens, field_tan, dioptres), lens.film_distance_mm_for(distance_mm).ok()?))
}

#[test]
fn every_built_in_lens_on_the_axis() {
    for (name, _, distance_mm) in FIELDS {
        let lens = Lens::built_in(name).unwrap();
        compare_stopped(&lens, 650.0, name, |lens| point_and_film(lens, DVec2::ZERO, distance_mm));
    }
}

#[test]
fn every_built_in_lens_off_the_axis_and_vignetted() {
    assert_eq!(FIELDS.map(|(name, ..)| name).to_vec(), Lens::built_in_names().collect::<Vec<_>>());
    for (name, degrees, distance_mm) in FIELDS {
        let lens = Lens::built_in(name).unwrap();
        let field_tan = DVec2::new(0.6, 0.8) * degrees.to_radians().tan();
        compare_stopped(&lens, 450.0, &format!("{name} at {degrees}°"), |lens| {
            point_and_film(lens, field_tan, distance_mm)
        });
    }
}

#[test]
fn far_points_and_sharp_corners() {
    // Where two rims cross at an edge of the pupil; the telephoto's is half covered there.
    for (name, degrees, n_corners) in [("telephoto-127mm", 20.0, 2), ("tessar-50mm", 20.0, 2), ("cooke-50mm", 18.0, 2)]
    {
        let lens = Lens::built_in(name).unwrap();
        compare_stopped(&lens, 550.0, &format!("{name} at {degrees}°, far"), |lens| {
            let field_tan = DVec2::new(-0.8, 0.6) * f64::to_radians(degrees).tan();
            let point = ObjectPoint::from_field(lens, field_tan, 0.0);
            let corners = PupilBoundary::find(lens, &point, 64)?.corners_rad(lens, &point);
            assert!(corners.len() >= n_corners, "{name}: {corners:?}");
            Some((point, lens.film_distance_mm_for(f64::INFINITY).ok()?))
        });
    }
}

#[test]
fn images_in_a_medium() {
    let glass = |index: f64| {
        let surface = Surface::sphere(20.0, 2.0);
        let interface = Interface { surface, medium_after: Glass::Constant { index }, thickness_after_mm: 0.0 };
        Lens::new("one surface", "made up", vec![interface], 0).unwrap()
    };
    for (index, degrees) in [(1.33, 0.0), (1.5, 5.0), (1.9, 8.0)] {
        let field_tan = DVec2::new(0.6, 0.8) * f64::to_radians(degrees).tan();
        for (wavelength_nm, distance_mm) in [(450.0, f64::INFINITY), (650.0, 300.0)] {
            compare_stopped(
                &glass(index),
                wavelength_nm,
                &format!("one surface of index {index}, {degrees}°"),
                |lens| point_and_film(lens, field_tan, distance_mm),
            );
        }
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn every_reference_lens() {
    for name in NAMES {
        let (Some(reference), Some(psf)) = (Reference::open(name), json(&format!("{name}.psf"))) else { return };
        let film_distance_mm = number(&psf["image_z"]) - reference.lens.last_vertex_z_mm();
        for (field, wavelength_nm) in [(0.0, 650.0), (1.0, 450.0)] {
            let row = serde_json::json!({ "field": [0.0, field] });
            let point = reference.point(&row);
            compare_stopped(&reference.lens, wavelength_nm, &format!("{name} at {field} of its field"), |_| {
                Some((point, film_distance_mm))
            });
        }
    }
}
