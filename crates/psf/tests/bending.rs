//! HURB as it is drawn, held to random deviations at the stop.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_diffraction::{CircularStop, Hurb, HurbForm, SampledHurb};
use dioptric_optics::{
    FilmPoint, Lens, MonoLens, ObjectPoint, PupilBoundary, RayBatch, Vignetting,
    glam::{DVec2, DVec3},
    rays_towards,
};
use dioptric_psf::{Diffraction, ImageSettings, Kernel, PointImage};

const PITCH_UM: f64 = 4.0;

/// Returns rays of a point spread evenly over its pupil, at the stop.
fn rays_at_stop(lens: &MonoLens, point: &ObjectPoint, n_rays: usize) -> RayBatch {
    let boundary = PupilBoundary::find(lens, point, 64).unwrap();
    // Vogel's spiral over the disc about the pupil; what is outside is vignetted.
    let extent_mm = boundary.rho_at_azimuths_mm().iter().copied().fold(0.0, f64::max);
    let targets: Vec<DVec2> = (0..n_rays)
        .map(|i| {
            let radius_mm = extent_mm * ((i as f64 + 0.5) / n_rays as f64).sqrt();
            boundary.center_mm() + DVec2::from_angle(2.399_963_229_728_653 * i as f64) * radius_mm
        })
        .collect();
    let mut rays = rays_towards(point, &targets, boundary.z_mm(), 0.0);
    lens.trace_surfaces(0..lens.stop() + 1, &mut rays, Vignetting::On);
    // Vignetting behind the stop clip the straight ray, not the bent one.
    let mut straight = rays.clone();
    if lens.stop() + 1 < lens.n_surfaces() {
        lens.trace_surfaces(lens.stop() + 1..lens.n_surfaces(), &mut straight, Vignetting::On);
    }
    let kept: Vec<usize> = (0..n_rays).filter(|&ray| straight.fate[ray].is_in_flight()).collect();
    let points: Vec<DVec3> = kept.iter().map(|&ray| rays.point_mm(ray)).collect();
    let directions: Vec<DVec3> = kept.iter().map(|&ray| rays.direction(ray)).collect();
    RayBatch::from_points(&points, &directions)
}

/// Returns the L1 difference of a kernel from deviated rays counted on its pixels, and what random counts alone would give.
fn difference(
    lens: &Lens,
    kernel: &Kernel,
    field_tan: f64,
    dioptres: f64,
    film_distance_mm: f64,
    gamma: f64,
) -> (f64, f64) {
    let mono = lens.at(550.0).unwrap();
    let point = ObjectPoint::from_field(&mono, DVec2::new(field_tan, 0.0), dioptres);
    let behind = rays_at_stop(&mono, &point, 100_000);
    let land = |mut rays: RayBatch| {
        if mono.stop() + 1 < mono.n_surfaces() {
            mono.trace_surfaces(mono.stop() + 1..mono.n_surfaces(), &mut rays, Vignetting::Off);
        }
        mono.to_film(&mut rays, film_distance_mm);
        mono.landed(&rays, film_distance_mm).map(FilmPoint::in_picture_mm).collect::<Vec<DVec2>>()
    };
    let straight = land(behind.clone());
    let centroid = straight.iter().sum::<DVec2>() / straight.len() as f64;
    let edge = CircularStop::new(mono.stop_semi_aperture_mm(), 550.0, mono.stop_medium_index());
    let n_rounds = 10;
    let side = kernel.samples.nrows();
    let mut counts = vec![0.0f64; side * side];
    for round in 0..n_rounds {
        let mut rays = behind.clone();
        let form = HurbForm::DirectionCosines;
        let hurb = SampledHurb { model: Hurb::with_gamma(gamma), edge: edge.into(), form, seed: round };
        hurb.apply(&mut rays, &mono.stop_placement());
        for at in land(rays) {
            let at = (at - centroid) * (1e3 / PITCH_UM);
            let (column, row) = (at.x + 0.5 * side as f64, 0.5 * side as f64 - at.y);
            if column >= 0.0 && row >= 0.0 && column < side as f64 && row < side as f64 {
                counts[row as usize * side + column as usize] += 1.0;
            }
        }
    }
    let n = (straight.len() as u64 * n_rounds) as f64;
    let expected = kernel.samples.iter().map(|&e| f64::from(e));
    let l1 = expected.clone().zip(&counts).map(|(e, c)| (e - c / n).abs()).sum();
    let noise = expected.map(|e| (2.0 / std::f64::consts::PI * e / n).sqrt()).sum();
    (l1, noise)
}

#[test]
fn kernels_are_those_of_rays_bent_at_random() {
    for (f_number, field_tan, dioptres, tolerance) in [
        (16.0, 0.1, 0.5, 0.01),
        (8.0, 0.1, 0.5, 0.01),
        (8.0, 0.0, 0.1, 0.02),
        (4.0, 0.1, 0.5, 0.02),
        (4.0, 0.1, 0.1, 0.02),
    ] {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
        let gamma = 1.0;
        let settings = ImageSettings::new(film_distance_mm, Diffraction::Hurb { gamma });
        let image = PointImage::trace(&lens, &settings, DVec2::X * field_tan, dioptres, 550.0).unwrap().unwrap();
        // Of the window of the kernel, which fades out at its borders.
        let (energies, _) = image.picture(PITCH_UM, image.kernel(PITCH_UM).0.samples.nrows());
        let kernel = Kernel::centered(energies.mapv(|energy| energy as f32), PITCH_UM);
        let (l1, noise) = difference(&lens, &kernel, field_tan, dioptres, film_distance_mm, gamma);
        println!(
            "f/{f_number}, {field_tan}, {dioptres} D: {l1:.4}, noise {noise:.4}, drawing {:.4}",
            (l1 * l1 - noise * noise).max(0.0).sqrt()
        );
        // The noise of the counts and the error of the drawing are independent.
        assert!(l1 < noise.hypot(tolerance), "f/{f_number}, {field_tan}, {dioptres} D: {l1}, noise {noise}");
    }
}

#[test]
fn light_beyond_the_edge_of_a_blur_is_even_around_it() {
    // 1 mm behind the focus of f/8: a disc of 62.5 µm radius; λN is 4.4 µm.
    let lens = Lens::thin(50.0, 6.25).unwrap();
    let settings = ImageSettings::new(51.0, Diffraction::Hurb { gamma: 1.0 });
    let image = PointImage::trace(&lens, &settings, DVec2::ZERO, 0.0, 550.0).unwrap().unwrap();
    let (picture, _) = image.picture(1.0, 241);
    for radius in [70.0, 80.0, 90.0] {
        // Between pixels, by straight lines.
        let at = |azimuth: f64| {
            let place = DVec2::splat(120.0) + DVec2::from_angle(azimuth) * radius;
            let (corner, part) = (place.floor(), place.fract());
            let pixel = |right: usize, down: usize| picture[(corner.y as usize + down, corner.x as usize + right)];
            let row = |down| pixel(0, down) * (1.0 - part.x) + pixel(1, down) * part.x;
            row(0) * (1.0 - part.y) + row(1) * part.y
        };
        let values: Vec<f64> = (0..720).map(|i| at(f64::from(i).to_radians() / 2.0)).collect();
        let mean = values.iter().sum::<f64>() / 720.0;
        let rms = (values.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / 720.0).sqrt();
        // 48 Gaussians that do not fan out leave 13 to 16 %.
        assert!(rms < 0.08, "{radius} µm: {rms}");
    }
}
