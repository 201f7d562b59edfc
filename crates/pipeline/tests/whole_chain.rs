//! The whole chain held to physics: from the radiance of a target to the picture.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    f64::consts::PI,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use dioptric_pipeline::{
    Camera, Capture, Clock, CoatingSpec, Crop, Diffraction, ExrSamples, FilmSpec, FocusSpec, FramesSpec, ImagingTimes,
    KeptCamera, LensSpec, Movements, PipelineError, Progress, Quality, SceneSource, SceneSpec, SenseRequest,
    SensorSpec, Silent, Stage, StopSpec, WavelengthSpec, with_exposure_s,
};
use dioptric_scene::Pattern;
use dioptric_sensor::{NoiseSource, NoiseSources, Processing};
use dioptric_spectrum::{Bands, Cancel, Illuminant};

const FAR_M: f64 = 1000.0;

/// The demo's lens and sensor before a far target of 40°.
fn before(pattern: Pattern) -> Camera {
    let mut camera = Camera::demo().unwrap();
    camera.scene = SceneSpec {
        source: SceneSource::Target { pattern, columns: 120, rows: 90 },
        field_of_view_deg: Some(40.0),
        depth_m: Some(FAR_M),
        ..camera.scene
    };
    camera.focus = FocusSpec::DistanceMm(1e3 * FAR_M);
    camera.film = FilmSpec::Pixels { columns: 24, rows: 18, pitch_um: 330.0 };
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
    camera.noise = NoiseSources::NONE;
    camera
}

fn capture(camera: Camera) -> Capture {
    KeptCamera::new(camera).capture(&Silent, &Cancel::new()).unwrap()
}

fn mean(capture: &Capture, band: usize) -> f64 {
    let plane = capture.irradiance.band(band).unwrap();
    plane.iter().map(|&v| f64::from(v)).sum::<f64>() / plane.len() as f64
}

/// Returns the irradiance at the middle of the film, W m⁻² nm⁻¹.
fn at_middle(capture: &Capture, band: usize) -> f64 {
    let plane = capture.irradiance.band(band).unwrap();
    let (rows, columns) = plane.dim();
    f64::from(plane[(rows / 2, columns / 2)])
}

#[test]
fn plane_of_known_radiance_lights_the_film_absolutely() {
    let illuminance_lux = 1000.0;
    for n in [4.0, 8.0] {
        let mut camera = before(Pattern::Uniform);
        camera.stop = StopSpec::FNumber(n);
        camera.scene.illuminance_lux = Some(illuminance_lux);
        let grid = camera.wavelengths.grid().unwrap().unwrap();
        let shot = capture(camera);
        // A white under D65, seen by a lens of f/n from afar: π L T / (4 n²), T what surfaces let through.
        let radiance = Illuminant::D65.white_radiance(&grid, illuminance_lux);
        for (band, radiance) in radiance.iter().enumerate() {
            // The f-number is set at 550 nm and paraxial: spherical aberration of the pupil is .4 % at f/4 (README).
            let lens = shot.lens.lens.at(grid.centers_nm()[band]).unwrap();
            let (n, share) = (lens.first_order().f_number, lens.axial_transmission(f64::INFINITY).unwrap());
            let expected = PI * radiance * share / (4.0 * n * n);
            let ratio = at_middle(&shot, band) / expected;
            assert!((ratio - 1.0).abs() < 0.006, "f/{n}, band {band}: {ratio}");
        }
    }
}

#[test]
fn light_falls_with_the_square_of_the_f_number() {
    let at = |n: f64| {
        let mut camera = before(Pattern::Uniform);
        camera.stop = StopSpec::FNumber(n);
        camera.diffraction = Diffraction::None;
        at_middle(&capture(camera), 1)
    };
    assert!((at(5.6) / at(11.2) - 4.0).abs() < 0.01);
}

#[test]
fn electrons_and_numbers_are_linear_in_time() {
    let kept = KeptCamera::new(before(Pattern::Uniform));
    let at = |time_s: f64| {
        let camera = kept.with(|camera| camera.exposure = with_exposure_s(camera.exposure, time_s));
        camera.capture(&Silent, &Cancel::new()).unwrap()
    };
    let electrons = |shot: &Capture| {
        let plane = &shot.frames.exposed.electrons.planes_e[0];
        plane.iter().map(|&e| f64::from(e)).sum::<f64>() / plane.len() as f64
    };
    // Pixels of 330 µm fill within 13 µs.
    let (short, long) = (at(1e-6), at(4e-6));
    let rate = &short.rate.planes_e_per_s[0];
    let expected = 1e-6 * rate.iter().map(|&e| f64::from(e)).sum::<f64>() / rate.len() as f64;
    assert!((electrons(&short) / expected - 1.0).abs() < 1e-5, "{} {expected}", electrons(&short));
    assert!((electrons(&long) / electrons(&short) - 4.0).abs() < 1e-4);
    assert_eq!(kept.stage_counts().irradiance, 1);
    // Beyond the well there is no more.
    let full = at(1e3);
    assert!((electrons(&full) / full.sensor.full_well_e - 1.0).abs() < 1e-3);
}

#[test]
fn white_target_is_neutral_in_the_picture() {
    // Coatings tint the light: colors are calibrated with the lens.
    for (light, coating) in [
        (Illuminant::D65, None),
        (Illuminant::A, None),
        (Illuminant::D65, Some(CoatingSpec::Ideal)),
        (Illuminant::A, Some(CoatingSpec::Bare)),
    ] {
        let mut camera = before(Pattern::Uniform);
        camera.scene.illuminant = Some(light.clone());
        camera.lens_reading.coating = coating;
        camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 10.0 };
        let shot = capture(camera);
        let codes = &shot.developed.picture.codes;
        let middle = [0, 1, 2].map(|channel| codes[(9, 12, channel)]);
        let (least, most) = middle.iter().fold((f32::MAX, 0.0_f32), |(a, b), &v| (a.min(v), b.max(v)));
        // The color matrix is fitted to a chart, not to white alone: half a unit of ΔE.
        assert!(least > 0.5 && most - least < 0.01, "{light:?}: {middle:?}");
    }
}

/// Rise and shift choose the part of the lens's image that the film sees: they give the picture of a lens that stays before
/// a larger film, with the rays bent at the stop where that stands.
#[test]
fn moved_lens_shows_the_unmoved_one_re_framed() {
    let (rows, columns, right_px, up_px) = (18, 24, 5, 3);
    let pitch_um = 330.0;
    let of = |movements: Movements, rows: usize, columns: usize| {
        let mut camera = before(Pattern::SiemensStar { n_cycles: 6 });
        camera.stop = StopSpec::FNumber(5.6);
        camera.movements = movements;
        camera.film = FilmSpec::Pixels { columns, rows, pitch_um };
        capture(camera)
    };
    let px_mm = 1e-3 * pitch_um;
    let movements =
        Movements { rise_mm: f64::from(up_px) * px_mm, shift_mm: f64::from(right_px) * px_mm, ..Movements::default() };
    let moved = of(movements, rows, columns);
    // The lens moved up and to the right carries its axis with it over the film, of which the picture is turned by 180°.
    assert_eq!(moved.place.exit_pupil_axis_mm, [-movements.shift_mm, movements.rise_mm]);
    let whole = of(Movements::default(), rows + 2 * up_px as usize, columns + 2 * right_px as usize);
    for band in 0..3 {
        let (moved, whole) = (moved.irradiance.band(band).unwrap(), whole.irradiance.band(band).unwrap());
        // What lies further up and to the right comes into the picture.
        let framed = whole.slice(ndarray::s![..rows, 2 * right_px as usize..]);
        let mean = framed.iter().map(|&v| f64::from(v)).sum::<f64>() / framed.len() as f64;
        let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
        let rms = (moved.iter().zip(framed).map(square).sum::<f64>() / framed.len() as f64).sqrt() / mean;
        println!("band {band}: rms {rms:.5} of the mean");
        // Both are sampled along a radius: what is left is that of fields to a farther corner, and of kernels at other places.
        assert!(rms < 5e-4, "band {band}: {rms}");
    }
}

/// A part of the film sees what it sees as a part of the whole, wherever it lies and whatever the symmetry of the lens.
#[test]
fn crop_is_a_part_of_the_whole_picture() {
    let (x, y, columns, rows) = (33, 5, 22, 18);
    for movements in [Movements::default(), Movements { tilt_deg: 3.0, shift_mm: 0.7, ..Movements::default() }] {
        let of = |crop: Option<Crop>| {
            let mut camera = before(Pattern::SiemensStar { n_cycles: 6 });
            camera.film = FilmSpec::Pixels { columns: 60, rows: 40, pitch_um: 132.0 };
            camera.stop = StopSpec::FNumber(5.6);
            camera.movements = movements;
            camera.crop = crop;
            capture(camera)
        };
        let (whole, part) = (of(None), of(Some(Crop { x, y, columns, rows })));
        assert_eq!((part.place.rows, part.place.columns), (rows, columns));
        // Where the axis is does not depend on what of the film is looked at.
        let middle_mm =
            [x as f64 + 0.5 * (columns as f64 - 60.0), y as f64 + 0.5 * (rows as f64 - 40.0)].map(|px| 0.132 * px);
        for (i, middle_mm) in middle_mm.into_iter().enumerate() {
            let axis_mm = [&whole, &part].map(|shot| shot.place.exit_pupil_axis_mm[i]);
            assert!((axis_mm[1] + middle_mm - axis_mm[0]).abs() < 1e-12, "{axis_mm:?}");
        }
        for band in 0..3 {
            let (whole, part) = (whole.irradiance.band(band).unwrap(), part.irradiance.band(band).unwrap());
            let framed = whole.slice(ndarray::s![y..y + rows, x..x + columns]);
            let mean = framed.iter().map(|&v| f64::from(v)).sum::<f64>() / framed.len() as f64;
            let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
            let rms = (part.iter().zip(framed).map(square).sum::<f64>() / framed.len() as f64).sqrt() / mean;
            println!("band {band}: rms {rms:.6} of the mean");
            // Kernels are known at other places, and of a tilted lens fields are sampled over another rectangle.
            assert!(rms < if movements == Movements::default() { 5e-4 } else { 5e-3 }, "band {band}: {rms}");
        }
        // An odd column begins with the mosaic's second one.
        assert_eq!(part.sensor.cfa, whole.sensor.cfa.from_pixel(y, x));
    }
}

#[test]
fn sensed_irradiance_is_the_picture_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = before(Pattern::SiemensStar { n_cycles: 5 });
    camera.noise = NoiseSources::ALL;
    camera.seed = 11;
    let shot = capture(camera.clone());
    let path = folder.path().join("irradiance.exr");
    shot.irradiance.write_exr_under(&shot.white_of(), &path, ExrSamples::Single).unwrap();
    let request = SenseRequest {
        filters: Vec::new(),
        sensor: camera.sensor.clone(),
        pixel_um: Some(330.0),
        exposure: camera.exposure,
        frames: camera.frames.clone(),
        processing: camera.processing.clone(),
        noise: camera.noise,
        illuminant: Some(Illuminant::D65),
        exit_pupil_mm: shot.place.exit_pupil_distance_mm,
        f_number: None,
        seed: camera.seed,
        chip_seed: camera.chip_seed,
        outputs: camera.outputs.clone(),
    };
    let sensed = request.sense(&path).unwrap();
    assert_eq!(sensed.frames.exposed.raw, shot.frames.exposed.raw);
    assert_eq!(sensed.developed.picture, shot.developed.picture);
    assert!(sensed.notes.is_empty(), "{:?}", sensed.notes);
}

#[test]
fn each_noise_is_switched_by_itself() {
    let kept = KeptCamera::new(before(Pattern::Uniform));
    let deviation = |noise: NoiseSources| {
        let camera = kept.with(|camera| {
            camera.noise = noise;
            camera.exposure = with_exposure_s(camera.exposure, 2e-9);
        });
        let shot = camera.capture(&Silent, &Cancel::new()).unwrap();
        // Pixels of one filter.
        let green: Vec<f64> = shot.frames.exposed.volts.planes_v[0]
            .slice(ndarray::s![1..;2, ..;2])
            .iter()
            .map(|&v| f64::from(v))
            .collect();
        let mean = green.iter().sum::<f64>() / green.len() as f64;
        (green.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / green.len() as f64).sqrt()
    };
    let none = deviation(NoiseSources::NONE);
    for source in [NoiseSource::Photon, NoiseSource::Read] {
        assert!(deviation(NoiseSources::only(&[source])) > 1.2 * none, "{source:?}");
    }
    assert!(deviation(NoiseSources::ALL) > deviation(NoiseSources::only(&[NoiseSource::Read])));
}

#[test]
fn burst_is_less_noisy_than_a_frame() {
    let kept = KeptCamera::new(Camera { noise: NoiseSources::ALL, ..before(Pattern::Uniform) });
    let noise = |frames: FramesSpec| {
        let camera = kept.with(|camera| {
            camera.frames = frames;
            camera.exposure = with_exposure_s(camera.exposure, 1e-7);
        });
        let linear =
            camera.capture(&Silent, &Cancel::new()).unwrap().frames.exposed.developed_from().linear().remove(0);
        let green: Vec<f64> = linear.slice(ndarray::s![1..;2, ..;2]).iter().map(|&v| f64::from(v)).collect();
        let mean = green.iter().sum::<f64>() / green.len() as f64;
        (green.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / green.len() as f64).sqrt()
    };
    let (single, burst) = (noise(FramesSpec::Single), noise(FramesSpec::Burst(16)));
    // A quarter, to the standard errors of 108 pixels and the fixed pattern that stays.
    assert!(burst < 0.4 * single, "{burst} {single}");
}

#[test]
fn pinhole_and_thin_lens_light_the_film_by_geometry() {
    // A disc of the half angle a as seen from the film: π L sin² a, of a hole as of a lens.
    let of_disc = |radius_mm: f64| (radius_mm / 50.0).atan().sin().powi(2);
    for (lens, focus, per_pi_l) in [
        (LensSpec::Pinhole { diameter_mm: 0.5 }, FocusSpec::FilmMm(50.0), of_disc(0.25)),
        (
            LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 5.0 },
            FocusSpec::DistanceMm(f64::INFINITY),
            of_disc(2.5),
        ),
    ] {
        let mut camera = before(Pattern::Uniform);
        (camera.lens, camera.focus, camera.stop) = (lens.clone(), focus, StopSpec::AsGiven);
        camera.diffraction = Diffraction::None;
        let grid = camera.wavelengths.grid().unwrap().unwrap();
        let radiance = Illuminant::D65.white_radiance(&grid, 1000.0);
        let found = at_middle(&capture(camera), 1);
        // The pixels beside the axis, 0.23 mm from it, get a few 1e-5 less.
        assert!((found / (PI * radiance[1] * per_pi_l) - 1.0).abs() < 2e-4, "{lens:?}: {found}");
    }
}

#[test]
fn draft_has_the_light_of_the_full_picture() {
    let mut camera = before(Pattern::SiemensStar { n_cycles: 4 });
    camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 10.0 };
    let kept = KeptCamera::new(camera);
    let full = kept.capture(&Silent, &Cancel::new()).unwrap();
    let draft = kept.with_quality(Quality::Draft).capture(&Silent, &Cancel::new()).unwrap();
    assert_eq!((full.grid().len(), draft.grid().len()), (31, 11));
    let ratio = draft.irradiance.summary.mean_lux / full.irradiance.summary.mean_lux;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

/// Cancels a run at the first news of a stage.
struct CancelAt<'a>(Stage, &'a Cancel);

impl Progress for CancelAt<'_> {
    fn at(&self, stage: Stage, _: f64) {
        if stage == self.0 {
            self.1.cancel();
        }
    }
}

#[test]
fn every_stage_is_cancelled_and_begins_again() {
    let camera = || {
        let mut camera = before(Pattern::Uniform);
        camera.scene.source = SceneSource::StillLife { columns: 60, rows: 40 };
        (camera.scene.field_of_view_deg, camera.scene.depth_m) = (None, None);
        camera
    };
    let expected = capture(camera());
    for stage in [Stage::Scene, Stage::Lens, Stage::Plan, Stage::Irradiance, Stage::Sensor, Stage::Picture] {
        let (kept, cancel) = (KeptCamera::new(camera()), Cancel::new());
        let ended = kept.capture(&CancelAt(stage, &cancel), &cancel);
        assert!(matches!(ended, Err(PipelineError::Cancelled(_))), "{stage:?}");
        let again = kept.capture(&Silent, &Cancel::new()).unwrap();
        assert_eq!(again.developed.picture, expected.developed.picture, "{stage:?}");
        // What was done before the cancel is kept.
        assert_eq!(kept.stage_counts().lens, 1, "{stage:?}");
    }
}

/// Keeps all news, and times the parts of imaging where it is timed.
#[derive(Default)]
struct News {
    stages: Mutex<Vec<(Stage, f64)>>,
    imaged: Mutex<Vec<ImagingTimes>>,
    is_timed: bool,
}

impl Progress for News {
    fn at(&self, stage: Stage, fraction: f64) {
        self.stages.lock().unwrap().push((stage, fraction));
    }

    /// Counts its calls: each piece of work takes 1 ns.
    fn clock(&self) -> Option<Arc<Clock>> {
        let calls = AtomicU64::new(0);
        self.is_timed
            .then(|| -> Arc<Clock> { Arc::new(move || Duration::from_nanos(calls.fetch_add(1, Ordering::Relaxed))) })
    }

    fn imaged(&self, times: &ImagingTimes) {
        self.imaged.lock().unwrap().push(*times);
    }
}

#[test]
fn progress_begins_every_stage_in_order() {
    let news = News::default();
    let camera = before(Pattern::Uniform);
    KeptCamera::new(camera).capture(&news, &Cancel::new()).unwrap();
    assert!(news.imaged.into_inner().unwrap().is_empty());
    let news = news.stages.into_inner().unwrap();
    assert!(news.iter().all(|(_, fraction)| (0.0..=1.0).contains(fraction)));
    let mut stages: Vec<Stage> = news.iter().map(|(stage, _)| *stage).collect();
    stages.dedup();
    let wanted = [Stage::Scene, Stage::Lens, Stage::Plan, Stage::Irradiance, Stage::Sensor, Stage::Picture];
    assert_eq!(stages, wanted);
}

#[test]
fn imaging_is_timed_where_there_is_a_clock() {
    let news = News { is_timed: true, ..News::default() };
    let mut camera = before(Pattern::Uniform);
    // More bands with kernels of their own than the plan has looked at for seams.
    camera.film = FilmSpec::Pixels { columns: 24, rows: 18, pitch_um: 5.0 };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 20.0 };
    let kept = KeptCamera::new(camera);
    kept.capture(&news, &Cancel::new()).unwrap();
    // Kept irradiance is not imaged again.
    kept.with(|camera| camera.seed += 1).capture(&news, &Cancel::new()).unwrap();
    let imaged = news.imaged.into_inner().unwrap();
    assert_eq!(imaged.len(), 1);
    assert!(imaged[0].kernels > Duration::ZERO && imaged[0].sampling > Duration::ZERO, "{imaged:?}");
    assert!(imaged[0].compositing > Duration::ZERO, "{imaged:?}");
}

#[test]
fn check_finds_wrong_parts_before_any_work() {
    let error = |change: fn(&mut Camera)| {
        let kept = KeptCamera::new(before(Pattern::Uniform)).with(change);
        let message = kept.check().unwrap_err().to_string();
        assert_eq!(kept.stage_counts().scene, 0);
        message
    };
    let message = error(|camera| camera.stop = StopSpec::FNumber(0.5));
    assert!(message.contains("f-number") || message.contains("f/"), "{message}");
    assert!(error(|camera| camera.sensor = SensorSpec::BuiltIn("none".to_owned())).contains("none"));
    assert!(error(|camera| camera.wavelengths = WavelengthSpec::ListNm(vec![-1.0])).contains("ListNm"));
    assert!(error(|camera| camera.scene = SceneSpec::of_file("none.exr".into())).contains("none.exr"));
    let lens = KeptCamera::new(before(Pattern::Uniform)).check().unwrap();
    assert!((lens.reference.first_order().f_number - 4.0).abs() < 1e-9);
}

#[test]
fn paper_processing_has_no_balance() {
    let mut camera = before(Pattern::Uniform);
    camera.processing = Processing::paper();
    let developed = capture(camera).developed;
    assert!(developed.balance.iter().all(|&gain| gain == 1.0), "{:?}", developed.balance);
}

#[test]
fn dark_film_beyond_the_scene_gets_no_light() {
    let mut camera = before(Pattern::Uniform);
    camera.scene.field_of_view_deg = Some(4.0);
    let narrow = capture(camera);
    let plane = narrow.irradiance.band(1).unwrap();
    // 4° are 3.5 mm of the 7.9 mm of the film.
    assert_eq!(plane[(0, 0)], 0.0);
    let wide = capture(before(Pattern::Uniform));
    let share = mean(&narrow, 1) / mean(&wide, 1);
    let side_mm = 2.0 * 50.36 * 2.0_f64.to_radians().tan();
    let expected = side_mm * (0.75 * side_mm) / (24.0 * 0.33 * 18.0 * 0.33);
    assert!((share / expected - 1.0).abs() < 0.02, "{share} {expected}");
}
