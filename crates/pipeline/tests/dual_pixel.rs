//! Photodiodes that see halves of the pupil, held to the closed form of a thin lens.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    f64::consts::PI,
    sync::atomic::{AtomicBool, Ordering},
};

use dioptric_pipeline::{
    Camera, Capture, Diffraction, DualPixelSpec, FilmSpec, FocusSpec, Given, KeptCamera, LensSpec, Photodiodes,
    PipelineError, Progress, Quality, SceneSource, SensorSpec, Silent, Stage, StopSpec, WavelengthSpec,
};
use dioptric_scene::{Scene, View};
use dioptric_sensor::{DisparityMap, DisparitySearch, NoiseSources, Processing};
use dioptric_spectrum::{Bands, Cancel, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, s};

const FOCAL_MM: f64 = 50.0;
const RADIUS_MM: f64 = 12.5;
const PITCH_UM: f64 = 10.0;
const FOCUS_MM: f64 = 2000.0;

fn image_mm(object_mm: f64) -> f64 {
    1.0 / (1.0 / FOCAL_MM - 1.0 / object_mm)
}

/// A plane with waves of many directions, none shorter than 40 pixels of the film, before a lens of f/2 focused at 2 m.
fn camera(depth_m: f64, dual_pixel: Option<DualPixelSpec>) -> KeptCamera {
    let grid = WavelengthGrid::uniform(500.0, 600.0, 100.0).unwrap();
    let size = (260, 330);
    let view = View { focal_px: 1e3 * image_mm(FOCUS_MM) / PITCH_UM, center_x_px: 164.5, center_y_px: 129.5 };
    let light = |(row, column): (usize, usize)| {
        let waves = [(0.11, 0.03, 0.2), (-0.08, 0.1, 2.0), (0.13, -0.07, 4.1), (0.04, -0.12, 1.1), (0.15, 0.01, 3.0)];
        let (x, y) = (column as f64, row as f64);
        let sum: f64 = waves.iter().map(|(p, q, phase)| (p * x + q * y + phase).sin()).sum();
        (0.01 * (1.0 + 0.18 * sum)) as f32
    };
    let planes = vec![Array2::from_shape_fn(size, light); 2];
    let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
    let depth = DepthMap::flat(size.0, size.1, depth_m).unwrap();
    let scene = Scene { depth: Some(depth), view: Some(view), ..Scene::new("waves", radiance) };
    let mut camera = Camera::demo().unwrap();
    camera.lens = LensSpec::Thin { focal_length_mm: FOCAL_MM, diameter_mm: 2.0 * RADIUS_MM };
    (camera.stop, camera.focus) = (StopSpec::AsGiven, FocusSpec::DistanceMm(FOCUS_MM));
    camera.film = FilmSpec::Pixels { columns: 240, rows: 192, pitch_um: PITCH_UM };
    camera.sensor = SensorSpec::BuiltIn("machine-vision-mono".to_owned());
    (camera.diffraction, camera.noise) = (Diffraction::None, NoiseSources::NONE);
    (camera.processing, camera.wavelengths) = (Processing::plain(), WavelengthSpec::Scene);
    camera.dual_pixel = dual_pixel;
    KeptCamera::new(camera).with_given_scene(Given::new(scene))
}

fn captured(camera: &KeptCamera) -> Capture {
    camera.capture(&Silent, &Cancel::new()).unwrap()
}

/// The median disparity of large blocks, pixels.
fn median_px(capture: &Capture) -> f64 {
    let reads = capture.frames.exposed.photodiodes.as_ref().unwrap();
    let search = DisparitySearch { window_px: 96, most_px: 40 };
    let halves = [&reads.frames[0], &reads.frames[reads.frames.len() - 1]];
    let map = DisparityMap::of(halves, reads.photodiodes.disparity_axis(), &search).unwrap();
    let known = map.known_px(0.1);
    // Blocks at the rims have nothing to be matched with.
    assert!(known.len() >= 4, "{} of {}", known.len(), map.disparity_px.len());
    known[known.len() / 2]
}

const IDEAL: DualPixelSpec = DualPixelSpec { photodiodes: Photodiodes::LeftRight, crosstalk: 0.0, transition_deg: 0.0 };

/// The halves lie (centroid separation) × (defocus) / (image distance) apart: 8/(3π) A (v − d)/v, with the image at v and the film at d; above
/// 0 for what is nearer than the focus, below 0 beyond it.
#[test]
fn disparity_of_a_plane_is_that_of_the_centroids_of_half_pupils() {
    let film_mm = image_mm(FOCUS_MM);
    let check = |spec: DualPixelSpec, depth_m: f64| {
        let capture = captured(&camera(depth_m, Some(spec)));
        let image_mm = image_mm(1e3 * depth_m);
        // A thin lens of f/2 in air: the sine of the edge of its cone is 1 / (2 N) to first order.
        let f_number = film_mm / (2.0 * RADIUS_MM);
        let separation_mm = RADIUS_MM * spec.centroid_separation(f_number);
        // The film sees the pupil by projected solid angle, cos⁴ of the angle from the axis: its halves' centroids lie nearer to the axis by as much.
        let edge = RADIUS_MM / film_mm;
        let moment = |power: i32| -> f64 {
            let places = (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0);
            places.map(|r| r.powi(power) * (1.0 + (edge * r).powi(2)).powi(-2)).sum()
        };
        let inwards = 1.5 * moment(2) / moment(1);
        let expected_px = inwards * 1e3 / PITCH_UM * separation_mm * (image_mm - film_mm) / image_mm;
        let found_px = median_px(&capture);
        println!("{spec} at {depth_m} m: {found_px:.4} px, closed form {expected_px:.4} px");
        assert!((found_px / expected_px - 1.0).abs() < 0.01, "{spec} {depth_m}: {found_px} {expected_px}");
    };
    let half = 8.0 / (3.0 * PI);
    assert!((IDEAL.centroid_separation(2.0) / half - 1.0).abs() < 1e-4);
    check(IDEAL, 1.6);
    check(IDEAL, 2.6);
    // Where light of both sides mixes, blurs are skew, and details as fine as they are lie farther apart than centroids: nearer to the
    // focus, where waves are more than ten radii of the blur long, that is below .5 %.
    check(DualPixelSpec { crosstalk: 0.1, ..IDEAL }, 1.85);
    check(DualPixelSpec { transition_deg: 5.0, ..IDEAL }, 2.2);
    check(DualPixelSpec { photodiodes: Photodiodes::TopBottom, ..IDEAL }, 1.6);
    let in_focus_px = median_px(&captured(&camera(1e-3 * FOCUS_MM, Some(IDEAL))));
    assert!(in_focus_px.abs() < 0.01, "{in_focus_px}");
}

/// What the halves get is what the whole pupil gets.
#[test]
fn halves_share_the_light_of_the_whole_pupil() {
    let whole = captured(&camera(1.6, None));
    for photodiodes in [Photodiodes::LeftRight, Photodiodes::Quad] {
        let capture = captured(&camera(1.6, Some(DualPixelSpec::of(photodiodes))));
        let parts = capture.irradiance.photodiodes();
        assert_eq!(parts.len(), photodiodes.names().len());
        for band in 0..2 {
            let [found, expected] =
                [&capture, &whole].map(|capture| capture.irradiance.band(band).unwrap().into_owned());
            let summed =
                parts.iter().fold(Array2::<f32>::zeros(found.dim()), |sum, part| sum + &*part.band(band).unwrap());
            // To the rounding of single floats: the sum is made of them in the same order.
            assert!(found.iter().zip(&summed).all(|(a, b)| (a - b).abs() <= 1e-6 * a), "{photodiodes:?}");
            let inner = s![20..172, 20..220];
            let mean = f64::from(expected.mean().unwrap());
            let errors = (&found.slice(inner) - &expected.slice(inner)).mapv(|e| f64::from(e).abs() / mean);
            let (rms, most) = (errors.mapv(|e| e * e).mean().unwrap().sqrt(), errors.fold(0.0, |a: f64, b| a.max(*b)));
            println!(
                "{photodiodes:?} band {band}: sum against the whole pupil, rms {rms:.2e}, most {most:.2e} of the mean"
            );
            // Each part is drawn from kernels and maps of its own, which are good to some 1e-4.
            assert!(rms < 5e-4 && most < 2e-3, "{photodiodes:?}: {rms} {most}");
        }
        // The frame of the sum is in the codes of the whole pixel: two roundings more.
        let [found, expected] = [&capture, &whole].map(|capture| capture.frames.exposed.raw.linear()[0].clone());
        let apart = (&found.slice(s![20..172, 20..220]) - &expected.slice(s![20..172, 20..220])).mapv(f32::abs);
        assert!(apart.fold(0.0, |a: f32, b| a.max(*b)) < 4e-3, "{photodiodes:?}");
    }
}

/// The irradiances of photodiodes are kept like any other: what the lens does not change is not imaged again.
#[test]
fn another_exposure_images_nothing_again() {
    let first = camera(1.6, Some(IDEAL));
    captured(&first);
    let counts = first.stage_counts();
    assert_eq!((counts.plan, counts.irradiance, counts.bank), (2, 1, 1));
    captured(&first.with(|camera| camera.seed = 7));
    assert_eq!(first.stage_counts().irradiance, 1);
    captured(&first.with(|camera| camera.dual_pixel = None));
    let counts = first.stage_counts();
    assert_eq!((counts.bank, counts.plan, counts.irradiance), (1, 3, 2));
}

/// Whether the imaging has begun.
#[derive(Default)]
struct Imaging(AtomicBool);

impl Progress for Imaging {
    fn at(&self, stage: Stage, _: f64) {
        self.0.fetch_or(stage == Stage::Irradiance, Ordering::Relaxed);
    }
}

/// The plan of one photodiode may take more than that of another: a budget that holds only one of them is refused before that one is imaged.
#[test]
fn no_photodiode_is_imaged_within_a_budget_too_small_for_another() {
    let mut camera = Camera::demo().unwrap();
    camera.scene.source = SceneSource::StillLife { columns: 150, rows: 100 };
    camera.film = FilmSpec::Pixels { columns: 120, rows: 80, pitch_um: 64.0 };
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
    camera.stop = StopSpec::FNumber(4.0);
    camera.movements.shift_mm = 9.0;
    camera.dual_pixel = Some(DualPixelSpec { crosstalk: 0.2, ..DualPixelSpec::of(Photodiodes::LeftRight) });
    let ends = (32_u64 << 20, 256_u64 << 20);
    let (mut too_small, mut enough) = ends;
    while enough - too_small > 1 << 12 {
        let budget = u64::midpoint(too_small, enough);
        let imaging = Imaging::default();
        let kept = KeptCamera::new(camera.clone()).with_quality(Quality::Draft).with_memory_budget(budget);
        match kept.irradiance(&imaging, &Cancel::new()) {
            Ok(_) => enough = budget,
            Err(error) => {
                assert!(matches!(error, PipelineError::Memory { .. }), "{error}");
                assert!(!imaging.0.into_inner(), "{budget} bytes: {error}");
                too_small = budget;
            }
        }
    }
    assert!(too_small > ends.0 && enough < ends.1, "{too_small} to {enough}");
}

/// A stack works out itself how much of the pupil's light arrives, which a `dual_pixel` states.
#[test]
fn pixels_of_a_stack_are_refused() {
    let mut sensor = dioptric_sensor::Sensor::built_in("machine-vision-mono").unwrap();
    sensor.pixel_stack = Some(dioptric_sensor::PixelStack {
        photodiode_um: 2.0,
        layers: Vec::new(),
        microlens: None,
        interfaces: dioptric_sensor::Interfaces::Coated,
        quantum_efficiency: dioptric_sensor::QuantumEfficiencyOf::Pixel,
    });
    let camera = camera(2.0, Some(DualPixelSpec::of(Photodiodes::LeftRight))).with_given_sensor(Given::new(sensor));
    let message = camera.capture(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("pixel_stack") && message.contains("dual_pixel"), "{message}");
}
