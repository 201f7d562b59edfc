//! The built-in still life as a world, through a lens.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use dioptric_pipeline::{Camera, KeptCamera, RenderEffort, SceneSource, Silent, WavelengthSpec, WorldSpec};
use dioptric_spectrum::{Bands, Cancel};

const CAMERA: &str = r#"(
    name: "still life",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(5.6),
    focus: DistanceMm(960.0),
    film: Pixels(columns: 24, rows: 16, pitch_um: 1320.0),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "still-life", effort: Samples(8), size: (120, 80)))),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

fn camera() -> KeptCamera {
    KeptCamera::new(Camera::parse(CAMERA, "folder/camera.ron".as_ref()).unwrap())
}

#[test]
fn still_life_is_rendered_alike_by_one_thread_and_three() {
    let on = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let kept = camera();
        pool.install(|| kept.irradiance(&Silent, &Cancel::new()).unwrap().band(1).unwrap().into_owned())
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one, three);
    assert!(one.iter().all(|&value| value > 0.0));
}

#[test]
fn what_a_camera_sees_besides_light_is_of_the_still_life() {
    let kept = camera();
    let render = kept.world_render(&Silent, &Cancel::new()).unwrap();
    let seen = render.auxiliary(&Cancel::new()).unwrap();
    let (near, far) = seen.z_m.iter().fold((f32::INFINITY, 0.0_f32), |(n, f), &z| (n.min(z), f.max(z)));
    assert!(near < 0.9 && (3.0..4.3).contains(&far), "{near} {far}");
    for at in [(0, 0), (8, 12), (15, 23)] {
        let square: f32 = seen.normal.iter().map(|plane| plane[at].powi(2)).sum();
        // Single precision.
        assert!((square - 1.0).abs() < 1e-5 && seen.shape[at] >= 1.0 && seen.material[at] >= 1.0);
        assert!((0.0..=1.0).contains(&seen.albedo.planes()[1][at]));
    }
    // A checkpoint of a picture of the still life elsewhere is another's.
    let aside = kept.with(|camera| {
        if let SceneSource::World(spec) = &mut camera.scene.source {
            spec.aside_mm = (30.0, 0.0);
        }
    });
    let aside = aside.world_render(&Silent, &Cancel::new()).unwrap();
    assert_ne!(aside.identity(RenderEffort::Samples(8)), render.identity(RenderEffort::Samples(8)));
}

#[test]
fn what_the_still_life_cannot_be_is_refused() {
    let spec = WorldSpec::still_life((30, 20));
    assert!(spec.is_still_life() && !WorldSpec::of_file("still-life.pbrt".into()).is_still_life());
    let text = CAMERA.replace("effort:", "unit_m: 2.0, effort:");
    let error = Camera::parse(&text, "camera.ron".as_ref()).unwrap_err().to_string();
    assert!(error.contains("unit_m is 2"), "{error}");
    let outside = CAMERA.replace("effort:", "advance_mm: -9000.0, effort:");
    let kept = KeptCamera::new(Camera::parse(&outside, "camera.ron".as_ref()).unwrap());
    let error = kept.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("within the room"), "{error}");
}

/// Colors beyond 300 to 1100 nm would be those at the ends.
#[test]
fn bands_that_rays_do_not_know_are_refused() {
    let with = |wavelengths: &str, more: &str| {
        let text = CAMERA.replace("[450.0, 550.0, 650.0]", wavelengths).replace("effort:", &format!("{more} effort:"));
        Camera::parse(&text, "camera.ron".as_ref())
    };
    let wrong = [
        ("[550.0, 1000.0, 1150.0]", "", "325 to 1225 nm"),
        // 300 and 1100 stand for what is 50 nm around them, unless the value at the middle is asked for.
        ("[300.0, 400.0]", "", "250 to 450 nm"),
        ("[1000.0, 1100.5]", "bands: Center,", "1000 to 1100.5 nm"),
    ];
    for (wavelengths, more, reach) in wrong {
        let error = with(wavelengths, more).unwrap_err().to_string();
        assert!(error.contains(reach) && error.contains("within 300 to 1100 nm"), "{error}");
    }
    assert!(with("[300.0, 1100.0]", "bands: Center,").is_ok());
    // Views have colors of any wavelength.
    assert!(with("[1000.0, 1200.0]", "method: Forward,").is_ok());
    // A camera that is changed after it was read is found too.
    let changed = camera().with(|camera| camera.wavelengths = WavelengthSpec::ListNm(vec![1200.0]));
    let error = changed.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("within 300 to 1100 nm"), "{error}");
}
