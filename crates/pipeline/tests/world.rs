//! A world as the scene of a camera file.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{f64::consts::PI, fs};

use dioptric_optics::Lens;
use dioptric_pipeline::{Camera, Crop, KeptCamera, RenderEffort, RenderMethod, SceneSource, Silent, WorldSpec};
use dioptric_spectrum::{Bands, Cancel, Illuminant, WavelengthGrid};
use ndarray::Array2;

/// A gray wall 2 m before the camera under a lamp.
const WORLD: &str = r#"
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
LookAt 0 0 0  0 0 1  0 1 0
Camera "perspective" "float fov" 14
WorldBegin
LightSource "point" "point3 from" [ 0.5 0.5 1 ] "spectrum I" [ 300 1 900 1 ]
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -1 -1 2  -1 1 2  1 1 2  1 -1 2 ]
"#;

const CAMERA: &str = r#"(
    name: "wall",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(5.0),
    focus: NearObject,
    film: Pixels(columns: 40, rows: 24, pitch_um: 150.0),
    sensor: BuiltIn("nikon-d5100"),
    scene: (source: World((file: "wall.pbrt", effort: Samples(32), size: (96, 64)))),
    wavelengths: ListNm([450.0, 550.0, 650.0]),
)"#;

fn camera(text: &str) -> (tempfile::TempDir, KeptCamera) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.pbrt"), WORLD).unwrap();
    let camera = Camera::parse(text, &folder.path().join("camera.ron")).unwrap();
    (folder, KeptCamera::new(camera))
}

#[test]
fn both_methods_end_in_a_picture() {
    for text in [CAMERA.to_owned(), CAMERA.replace("effort:", "method: Forward, effort:")] {
        let (_folder, kept) = camera(&text);
        let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
        assert!((capture.scene.near_m - 2.0).abs() < 1e-6 && capture.place.columns == 40);
        // A change of the sensor's noise renders nothing anew.
        let before = kept.stage_counts();
        kept.with(|camera| camera.seed = 9).capture(&Silent, &Cancel::new()).unwrap();
        assert_eq!(kept.stage_counts().irradiance, before.irradiance);
        assert!(capture.irradiance.summary.mean.iter().all(|mean| *mean > 0.0));
    }
}

/// Radiance of the wall, ρ/π I cos θ / d².
fn wall_radiance(x_m: f64, y_m: f64) -> f64 {
    0.5 / PI * ((x_m - 0.5).powi(2) + (y_m - 0.5).powi(2) + 1.0).powf(-1.5)
}

/// Both ways, and by `E = π L cos⁴θ / (4 N_w²)`.
#[test]
fn both_methods_have_the_light_of_the_wall() {
    let (columns, rows, pitch_um) = (20, 12, 300.0);
    let text = CAMERA
        .replace("FNumber(5.0)", "FNumber(8.0)")
        // Of bands 100 nm wide, rays through all of the band and kernels of its center lose light that differs by 1 % in the blue.
        .replace("focus: NearObject", "lens_reading: (coating: Ideal), focus: NearObject")
        .replace("columns: 40, rows: 24, pitch_um: 150.0", "columns: 20, rows: 12, pitch_um: 300.0")
        .replace("Samples(32)", "Samples(512)");
    let (_folder, kept) = camera(&text);
    let render = kept.world_render(&Silent, &Cancel::new()).unwrap();
    let mut renderer = render.renderer().unwrap();
    render.refine(&mut renderer, RenderEffort::Samples(512), &Silent, &Cancel::new(), &mut |_| Ok(true)).unwrap();
    let backward = renderer.rendering();
    let forward = kept.with(|camera| {
        if let SceneSource::World(spec) = &mut camera.scene.source {
            spec.method = RenderMethod::Forward;
        }
    });
    let forward = forward.irradiance(&Silent, &Cancel::new()).unwrap();
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    for (band, nm) in [450.0, 550.0, 650.0].into_iter().enumerate() {
        let mono = lens.at(nm).unwrap();
        let distance_mm = 2_000.0 - mono.projection_center_z_mm();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(distance_mm).unwrap();
        let n_w = mono.working_f_number(distance_mm);
        let expected = |row: usize, column: usize| {
            let at_mm = |i: usize, n: usize| 1e-3 * pitch_um * (i as f64 + 0.5 - 0.5 * n as f64);
            let (x, y) = (at_mm(column, columns), -at_mm(row, rows));
            let to_pupil_mm = film_distance_mm - mono.first_order().exit_pupil_z_mm;
            let cos2 = 1.0 / (1.0 + (x * x + y * y) / (to_pupil_mm * to_pupil_mm));
            let m_per_mm = 2.0 / mono.film_scale_mm(film_distance_mm).abs();
            PI / (4.0 * n_w * n_w) * cos2 * cos2 * wall_radiance(x * m_per_mm, y * m_per_mm)
        };
        let mean = |value: &dyn Fn(usize, usize) -> f64| {
            let sum: f64 = (0..rows).flat_map(|row| (0..columns).map(move |column| value(row, column))).sum();
            sum / (rows * columns) as f64
        };
        let of = |plane: &Array2<f32>| mean(&|row, column| f64::from(plane[(row, column)]));
        let (closed, blurred) = (mean(&expected), of(&forward.band(band).unwrap()));
        let traced = of(&backward.picture.planes()[band]);
        let variance = mean(&|row, column| f64::from(backward.standard_error.planes()[band][(row, column)]).powi(2));
        let noise = (variance / (rows * columns) as f64).sqrt() / traced;
        // What is asked of light that no rim takes is 0.3 %; the rendering's noise stands beside it.
        assert!(noise < 1e-3, "{nm}: {noise}");
        assert!((blurred / traced - 1.0).abs() < 0.003 + 3.0 * noise, "{nm}: {blurred} {traced} {noise}");
        assert!((traced / closed - 1.0).abs() < 0.003 + 3.0 * noise, "{nm}: {traced} {closed} {noise}");
        assert!((blurred / closed - 1.0).abs() < 0.003, "{nm}: {blurred} {closed}");
    }
}

/// Light of an ideal lens is counted by solid angles on the film's side both ways, close up too.
#[test]
fn methods_agree_through_an_ideal_lens() {
    let text = CAMERA
        .replace("BuiltIn(\"dgauss-50mm\")", "Thin(focal_length_mm: 50.0, diameter_mm: 30.0)")
        .replace("    stop: FNumber(5.0),\n", "")
        .replace("NearObject", "FilmMm(137.0)")
        .replace("columns: 40, rows: 24, pitch_um: 150.0", "columns: 12, rows: 12, pitch_um: 500.0")
        .replace("Samples(32), size: (96, 64)", "Samples(512), size: (96, 64), advance_mm: 1921.0")
        .replace("wavelengths:", "diffraction: None,\n    wavelengths:");
    let (_folder, kept) = camera(&text);
    let backward = kept.irradiance(&Silent, &Cancel::new()).unwrap();
    let forward = kept.with(|camera| {
        if let SceneSource::World(spec) = &mut camera.scene.source {
            spec.method = RenderMethod::Forward;
        }
    });
    let forward = forward.irradiance(&Silent, &Cancel::new()).unwrap();
    for band in 0..3 {
        let found = forward.summary.mean[band] / backward.summary.mean[band];
        assert!((found - 1.0).abs() < 0.004, "{found}");
    }
}

#[test]
fn part_has_the_samples_of_the_whole() {
    let (_folder, kept) = camera(CAMERA);
    let render = kept.world_render(&Silent, &Cancel::new()).unwrap();
    let part = render.clone().cropped((5, 3), (7, 4)).unwrap();
    let crop = Crop { x: 5, y: 3, columns: 7, rows: 4 };
    let of_camera = kept.with(|camera| camera.crop = Some(crop)).world_render(&Silent, &Cancel::new()).unwrap();
    let [whole, part, of_camera] = [render, part, of_camera].map(|render| {
        let mut renderer = render.renderer().unwrap();
        let effort = RenderEffort::Samples(16);
        render.refine(&mut renderer, effort, &Silent, &Cancel::new(), &mut |_| Ok(true)).unwrap();
        renderer.rendering().picture
    });
    assert_eq!((part.rows(), part.columns()), (4, 7));
    assert_eq!(part, of_camera);
    for (row, column) in [(0, 0), (3, 6), (2, 1)] {
        assert_eq!(part.spectrum_at(row, column), whole.spectrum_at(row + 3, column + 5));
    }
}

#[test]
fn camera_file_states_the_same_lens_for_both() {
    let (_folder, kept) = camera(CAMERA);
    // What is kept is an irradiance of this film, and nothing else is taken for it.
    let image = kept.irradiance(&Silent, &Cancel::new()).unwrap();
    assert_eq!(image.size(), (24, 40));
    let scene = kept.world(&Silent, &Cancel::new()).unwrap();
    assert_eq!(scene.cameras().len(), 1);
    let still_life = kept.with(|camera| camera.scene.source = SceneSource::StillLife { columns: 8, rows: 8 });
    assert!(still_life.world(&Silent, &Cancel::new()).unwrap_err().to_string().contains("it is no world"));
}

#[test]
fn worlds_keep_their_own_light() {
    let spec = WorldSpec::of_file("wall.pbrt".into());
    assert_eq!(spec.effort, RenderEffort::Samples(64));
    for (from, to, words) in [
        ("scene: (", "scene: (illuminance_lux: 100.0, ", "lights and depths of its own"),
        ("Samples(32)", "Samples(0)", "Samples is 0"),
        ("Samples(32)", "Noise(-1.0)", "Noise is -1"),
        ("effort:", "unit_m: 0.0, effort:", "unit_m is 0"),
    ] {
        let error = Camera::parse(&CAMERA.replace(from, to), "camera.ron".as_ref()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let (_folder, kept) = camera(&CAMERA.replace("sensor:", "diffraction: Wave,\n    sensor:"));
    let error = kept.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("diffraction: Wave") && error.contains("carry no waves"), "{error}");
}

#[test]
fn light_on_the_scene_is_that_of_its_lamps() {
    // A lamp of daylight, and another of incandescence that a wall hides from what is seen.
    let lamp = |from: &str, kind: &str| {
        format!("LightSource \"point\" \"point3 from\" [ {from} ] \"spectrum I\" \"stdillum-{kind}\"\n")
    };
    let start = WORLD.find("LightSource").unwrap();
    let end = start + WORLD[start..].find('\n').unwrap() + 1;
    let lamps = lamp("0.5 0.5 1", "D65") + &lamp("0.5 0.5 3", "A");
    let (folder, kept) = camera(CAMERA);
    fs::write(folder.path().join("wall.pbrt"), WORLD.replace(&WORLD[start..end], &lamps)).unwrap();
    let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
    let light = capture.scene.light.clone().unwrap();
    let Illuminant::Spectrum(found) = &light.illuminant else { panic!("{light:?}") };
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let daylight = Illuminant::D65.white_radiance(&grid, 100.0);
    let middle = found.values()[15] / daylight[15];
    for (found, daylight) in found.values().iter().zip(daylight) {
        // The file's table of D65 has steps of 5 nm or so, and the world evaluates it in single precision.
        assert!((found / daylight / middle - 1.0).abs() < 0.01, "{found} {daylight}");
    }
}

#[test]
fn cancelled_rendering_ends() {
    let (_folder, kept) = camera(CAMERA);
    let cancel = Cancel::new();
    cancel.cancel();
    assert!(kept.capture(&Silent, &cancel).is_err());
}
