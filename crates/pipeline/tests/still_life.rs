//! The built-in still life as a world: the painting against rays, through a pinhole and through a lens.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use dioptric_pipeline::{Camera, KeptCamera, RenderEffort, SceneSource, Silent, WavelengthSpec, WorldSpec};
use dioptric_scene::StillLife;
use dioptric_spectrum::{Bands, Cancel, WavelengthGrid};
use glam::DVec3;

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

/// The means of blocks of pixels, by rays and by the painter: what is left is the painter's 4 or 16 points a pixel.
#[test]
fn rays_from_the_eye_see_the_painting() {
    let life = StillLife::new(180, 120);
    let grid = WavelengthGrid::new(vec![450.0, 550.0, 650.0]).unwrap();
    let painting = life.scene(&grid).unwrap();
    let lit = life.lit(&|_| {}, &Cancel::new()).unwrap();
    let (eye, view) = (lit.world_from_eye(), painting.view.unwrap());
    let depth = painting.require_depth().unwrap();
    let (block, per_side) = (6, 4);
    let (mut difference, mut sum, mut n_close, mut n) = (0.0, 0.0, 0, 0);
    for (block_row, block_column) in (0..120 / block).flat_map(|r| (0..180 / block).map(move |c| (r, c))) {
        let (mut by_rays, mut painted) = ([0.0_f32; 3], [0.0_f32; 3]);
        for i in 0..block * block {
            let (row, column) = (block_row * block + i / block, block_column * block + i % block);
            for point in 0..per_side * per_side {
                let at = |cell: usize| (cell as f64 + 0.5) / per_side as f64 - 0.5;
                let (x, y) = view.tan_at(row as f64 + at(point / per_side), column as f64 + at(point % per_side));
                let direction = (eye.matrix3 * DVec3::new(x, y, 1.0)).normalize();
                // Any numbers that fill the square.
                let k = (i * per_side * per_side + point) as f32;
                let random = |number: u32| [0.618_034 * k + 0.3 * number as f32, 0.754_878 * k].map(f32::fract);
                let mut radiance = [0.0; 3];
                lit.add_radiance((eye.translation, direction), &[450.0, 550.0, 650.0], &random, &mut radiance);
                by_rays.iter_mut().zip(radiance).for_each(|(sum, value)| *sum += value / (per_side * per_side) as f32);
            }
            for (painted, value) in painted.iter_mut().zip(painting.radiance.spectrum_at(row, column)) {
                *painted += value as f32;
            }
            let (x, y) = view.tan_at(row as f64, column as f64);
            let seen = lit.look(eye.translation, (eye.matrix3 * DVec3::new(x, y, 1.0)).normalize(), &[550.0]).unwrap();
            let z_m = (seen.point_m - eye.translation).dot(eye.matrix3.z_axis);
            assert!((z_m / f64::from(depth.z_m()[(row, column)]) - 1.0).abs() < 1e-6);
        }
        let off: f32 = by_rays.iter().zip(painted).map(|(rays, painted)| (rays - painted).abs()).sum();
        let all: f32 = painted.iter().sum();
        (difference, sum) = (difference + f64::from(by_rays.iter().sum::<f32>() - all), sum + f64::from(all));
        n_close += usize::from(off < 0.02 * all);
        n += 1;
    }
    // Bulbs and glints are a pixel wide: blocks that hold them differ by how the points fall.
    assert!((difference / sum).abs() < 0.01, "{}", difference / sum);
    assert!(n_close as f64 > 0.8 * n as f64, "{n_close} of {n}");
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
    for (to, words) in [
        ("unit_m: 2.0, effort:", "unit_m is 2"),
        ("paths: Direct, effort:", "the light in the still life was followed before"),
    ] {
        let error = Camera::parse(&CAMERA.replace("effort:", to), "camera.ron".as_ref()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
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
    // The painter has colors of any wavelength.
    assert!(with("[1000.0, 1200.0]", "method: Forward,").is_ok());
    // A camera that is changed after it was read is found too.
    let changed = camera().with(|camera| camera.wavelengths = WavelengthSpec::ListNm(vec![1200.0]));
    let error = changed.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("within 300 to 1100 nm"), "{error}");
}
