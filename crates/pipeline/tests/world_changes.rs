//! Worlds that camera files and programs make and change.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{fs, path::Path, sync::Arc};

use dioptric_backward::{BandSampling, Bands, Camera as RayCamera, RenderSettings, Renderer};
use dioptric_optics::Lens;
use dioptric_pipeline::{
    Camera, FilmSpec, KeptCamera, LightAmount, LightPaths, RenderEffort, SceneSource, SceneSpec, Silent, WorldBuilder,
    WorldChange, WorldColor, WorldLight, WorldMaterial, WorldShape, WorldSky, WorldSpec, change_world, open_world,
    write_world,
};
use dioptric_spectrum::{Cancel, Illuminant, Observer, SpectralImage, Spectrum, WavelengthGrid};
use dioptric_world::{ReadOptions, World};

fn changed(changes: &[WorldChange]) -> WorldBuilder {
    let mut builder = WorldBuilder::new();
    changes.iter().for_each(|change| change_world(&mut builder, change, &Cancel::new()).unwrap());
    builder
}

fn named(name: &str) -> String {
    name.to_owned()
}

fn add(name: &str, shape: WorldShape, at_m: (f64, f64, f64), material: WorldMaterial) -> WorldChange {
    WorldChange::Add { name: named(name), shape, at_m, material }
}

fn matte(value: f64) -> WorldMaterial {
    WorldMaterial::Matte { color: WorldColor::Even(value) }
}

fn look(eye_m: (f64, f64, f64), look_at_m: (f64, f64, f64)) -> WorldChange {
    let look_at_m = Some(look_at_m);
    WorldChange::Camera { name: named("camera"), eye_m, look_at_m, up: None, fov_deg: 30.0, size: (48, 32) }
}

fn light(light: WorldLight) -> WorldChange {
    WorldChange::Light { name: named("light"), light }
}

/// The radiance that the world's first camera sees, and its standard error.
fn seen(world: &World, n_passes: u32) -> (SpectralImage, SpectralImage) {
    let grid = WavelengthGrid::uniform(400.0, 700.0, 50.0).unwrap();
    let bands = Bands { grid, sampling: BandSampling::Center };
    let own = dioptric_world::WorldCamera { resolution: (48, 32), ..world.cameras()[0].clone() };
    let camera = RayCamera::from_world(&own, &bands, &|_| Lens::pinhole(1.0)).unwrap();
    let paths = LightPaths::Full;
    let settings = RenderSettings { bands, paths, samples_per_pass: 8, seed: 1, clamp: None };
    let mut renderer = Renderer::new(world, &camera, settings).unwrap();
    for _ in 0..n_passes {
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
    }
    let rendering = renderer.rendering();
    (rendering.picture, rendering.standard_error)
}

fn middle(picture: &SpectralImage, band: usize) -> f64 {
    let plane = &picture.planes()[band];
    f64::from(plane[[plane.nrows() / 2, plane.ncols() / 2]])
}

const WALL: WorldShape = WorldShape::Plane { size_m: (4.0, 4.0) };

/// A matte plane of reflectance ½ that a lamp of known intensity lights straight on at 2 m has radiance ½ · I / (π · 4).
#[test]
fn lights_have_their_units() {
    let plane = add("plane", WALL, (0.0, 0.0, 0.0), matte(0.5));
    let looking = look((0.0, 1.0, 1e-6), (0.0, 0.0, 0.0));
    let at_m = (0.0, 2.0, 0.0);
    let lux = |picture: &SpectralImage| {
        // Ring in the middle: the plane's own luminance, times π over its reflectance.
        let values: Vec<f64> = (0..7).map(|band| middle(picture, band)).collect();
        let fine = WavelengthGrid::uniform(400.0, 700.0, 1.0).unwrap();
        let spectrum = Spectrum::new((0..7).map(|i| 400.0 + 50.0 * f64::from(i)).collect(), values).unwrap();
        let luminance = Observer::Cie1931.xyz(&fine, &spectrum.sample_held(&fine)).luminance_cd_m2();
        luminance * std::f64::consts::PI / 0.5
    };
    let (illuminant, even) = (Illuminant::E, || Illuminant::E);
    let sphere = 4.0 * std::f64::consts::PI;
    let cone = 2.0 * std::f64::consts::PI * (1.0 - 20_f64.to_radians().cos());
    let spot = |level, soft| WorldLight::Spot {
        at_m,
        look_at_m: (0.0, 0.0, 0.0),
        cone_deg: 40.0,
        soft,
        level,
        spectrum: Illuminant::E,
    };
    let small = |level| WorldLight::Area {
        at_m,
        look_at_m: (0.0, 0.0, 0.0),
        size_m: (0.01, 0.02),
        level,
        spectrum: Illuminant::E,
    };
    for (name, made, expected_lux) in [
        ("cd", WorldLight::Point { at_m, level: LightAmount::Candela(80.0), spectrum: illuminant }, 20.0),
        ("lm", WorldLight::Point { at_m, level: LightAmount::Lumens(80.0 * sphere), spectrum: even() }, 20.0),
        ("spot cd", spot(LightAmount::Candela(80.0), 0.5), 20.0),
        ("spot lm", spot(LightAmount::Lumens(80.0 * cone), 0.0), 20.0),
        ("area cd/m²", small(LightAmount::CandelaPerM2(80.0 / 2e-4)), 20.0),
        ("area lm", small(LightAmount::Lumens(80.0 * std::f64::consts::PI)), 20.0),
        ("lx", WorldLight::Distant { from: (0.0, 3.0, 0.0), level: LightAmount::Lux(20.0), spectrum: even() }, 20.0),
    ] {
        let world = changed(&[plane.clone(), light(made), looking.clone()]).build().unwrap();
        let found = lux(&seen(&world, 4).0);
        // Seven bands that stand for the whole range, and an area that isn't quite a point.
        assert!((found / expected_lux - 1.0).abs() < 2e-3, "{name}: {found}");
    }
    // By its own number at 560 nm, and an even sky.
    let per_nm = WorldLight::Point { at_m, level: LightAmount::PerNm(4.0), spectrum: Illuminant::A };
    let world = changed(&[plane.clone(), light(per_nm), looking.clone()]).build().unwrap();
    let at = Illuminant::A.spectrum().at_held(550.0) / Illuminant::A.spectrum().at_held(560.0);
    let expected = 4.0 * at / 4.0 * 0.5 / std::f64::consts::PI;
    // The pixel beside the middle isn't straight below the lamp.
    assert!((middle(&seen(&world, 4).0, 3) / expected - 1.0).abs() < 2e-3);
    let sky = WorldLight::Sky { sky: WorldSky::Even(1.0), turn_deg: 30.0, mean_cd_m2: Some(500.0) };
    let builder = changed(&[light(sky)]);
    let level = builder.objects()[0].light.unwrap();
    assert!((level.value / 500.0 - 1.0).abs() < 1e-5 && level.unit == "cd/m²");
    let wrong = WorldLight::Distant { from: (0.0, 1.0, 0.0), level: LightAmount::Lumens(1.0), spectrum: even() };
    let error = change_world(&mut WorldBuilder::new(), &light(wrong), &Cancel::new()).unwrap_err().to_string();
    assert!(error.contains("parallel light isn't measured in Lumens, expected Lux, PerNm"), "{error}");
}

/// A sphere moved by d is at d in the depth map, and light twice as strong is twice the radiance.
#[test]
fn changes_of_a_camera_file_are_followed() {
    let text = r#"[
        Add(name: "ball", shape: Sphere(radius_m: 0.5), at_m: (0, 0, -4), material: Plastic(color: Rgb((0.8, 0.1, 0.1)))),
        Light(name: "lamp", light: Distant(from: (0, 0, 1), level: Lux(1000), spectrum: E)),
        Camera(name: "eye", eye_m: (0, 0, 0), look_at_m: Some((0, 0, -1)), fov_deg: 30, size: (48, 32)),
        MoveTo(object: "ball", to_m: (0, 0, -5)),
    ]"#;
    let changes: Vec<WorldChange> = ron::from_str(text).unwrap();
    let captured = |more: &[WorldChange]| {
        let spec = WorldSpec {
            changes: changes.iter().chain(more).cloned().collect(),
            effort: RenderEffort::Samples(16),
            ..WorldSpec::of_file(WorldSpec::EMPTY.into())
        };
        let mut camera = Camera::demo().unwrap();
        let source = SceneSource::World(spec);
        camera.scene = SceneSpec { source, ..SceneSpec::of_file("".into()) };
        camera.film = FilmSpec::Scene;
        let kept = KeptCamera::new(camera);
        let depth = kept.depth(&Silent, &Cancel::new()).unwrap();
        let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
        (depth.z_m()[[16, 24]], capture.irradiance.summary.mean_lux)
    };
    let (near_m, lux) = captured(&[]);
    assert!((near_m - 4.5).abs() < 2e-3, "{near_m}");
    let (far_m, _) = captured(&[WorldChange::Move { object: named("b*"), by_m: (0.0, 0.0, -2.0) }]);
    assert!((far_m - 6.5).abs() < 4e-3, "{far_m}");
    let (_, twice) = captured(&[WorldChange::Brighten { object: named("lamp"), factor: 2.0 }]);
    assert!((twice / lux - 2.0).abs() < 1e-5, "{lux} {twice}");
}

fn room() -> WorldSpec {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/worlds/room.pbrt");
    WorldSpec { size: Some((60, 60)), ..WorldSpec::of_file(file) }
}

/// The level that is asked for is that of what is seen, and both kinds of level scale all light alike.
#[test]
fn levels_of_worlds_are_what_is_asked_for() {
    let of = |scene: &dyn Fn(&mut SceneSpec)| {
        let mut camera = Camera::demo().unwrap();
        camera.scene = SceneSpec { source: SceneSource::World(room()), ..SceneSpec::of_file("".into()) };
        scene(&mut camera.scene);
        KeptCamera::new(camera)
    };
    let leveled = of(&|scene| scene.mean_luminance_cd_m2 = Some(250.0));
    let world: Arc<World> = leveled.world(&Silent, &Cancel::new()).unwrap();
    let note = world.notes().last().unwrap();
    assert!(note.contains("all of its lights are multiplied by") && note.contains("250 cd/m² is asked for"), "{note}");
    // By other samples than those that it was brought there by.
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let bands = Bands { grid: grid.clone(), sampling: BandSampling::Mean };
    let own = dioptric_world::WorldCamera { resolution: (60, 60), ..world.cameras()[0].clone() };
    let camera = RayCamera::from_world(&own, &bands, &|_| Lens::pinhole(1.0)).unwrap();
    let settings = RenderSettings { bands, paths: LightPaths::Full, samples_per_pass: 64, seed: 7, clamp: None };
    let mut renderer = Renderer::new(&world, &camera, settings).unwrap();
    (0..8).for_each(|_| {
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
    });
    let picture = renderer.picture();
    let mean: Vec<f64> = picture.planes().iter().map(|plane| f64::from(plane.mean().unwrap())).collect();
    let found = Observer::Cie1931.xyz(&grid, &mean).luminance_cd_m2();
    // Three thousandths of each of the two means.
    assert!((found / 250.0 - 1.0).abs() < 0.012, "{found}");
    let dark = of(&|scene| {
        scene.mean_luminance_cd_m2 = Some(250.0);
        let SceneSource::World(spec) = &mut scene.source else { unreachable!() };
        spec.changes = vec![WorldChange::Remove { object: named("*") }];
        spec.sky = Some(WorldSky::Even(1e-12));
    });
    assert!(dark.world(&Silent, &Cancel::new()).is_ok());
}

/// Written and read again a world gives the same picture.
#[test]
fn written_worlds_are_what_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("checks.png");
    let checks = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([if (x + y) % 2 == 0 { 220 } else { 40 }; 3]));
    checks.save(&picture).unwrap();
    let room = open_world(&room().file, &ReadOptions::default(), &Cancel::new()).unwrap();
    let made = changed(&[
        add("floor", WALL, (0.0, 0.0, 0.0), WorldMaterial::Matte { color: WorldColor::Picture(picture) }),
        add(
            "gold",
            WorldShape::Sphere { radius_m: 0.4 },
            (-0.5, 0.4, 0.0),
            WorldMaterial::Metal { metal: named("gold"), roughness: 0.4 },
        ),
        add(
            "glass",
            WorldShape::Sphere { radius_m: 0.3 },
            (0.5, 0.3, 0.4),
            WorldMaterial::Glass { glass: named("N-SF11"), roughness: 0.0 },
        ),
        add(
            "red",
            WorldShape::Box { size_m: (0.4, 0.6, 0.4) },
            (0.5, 0.3, -0.6),
            WorldMaterial::Plastic { color: WorldColor::Rgb((0.7, 0.1, 0.05)), roughness: 0.3 },
        ),
        WorldChange::Turn { object: named("red"), axis: (0.0, 1.0, 0.0), angle_deg: 30.0, about_m: None },
        light(WorldLight::Area {
            at_m: (0.0, 2.0, 1.0),
            look_at_m: (0.0, 0.0, 0.0),
            size_m: (0.5, 0.5),
            level: LightAmount::Lumens(2000.0),
            spectrum: Illuminant::Fl11,
        }),
        light(WorldLight::Sky { sky: WorldSky::Even(0.01), turn_deg: 0.0, mean_cd_m2: None }),
        look((0.0, 1.2, 3.0), (0.0, 0.3, 0.0)),
    ]);
    for (name, builder) in [("room", room), ("made", made)] {
        for kind in KINDS {
            let file = folder.path().join(format!("{name}.{kind}"));
            let losses = write_world(&builder, &file, false).unwrap();
            // What glTF has no words for stands in it beside them.
            let losses: Vec<_> = losses.iter().filter(|loss| !loss.contains("this program alone")).collect();
            assert!(losses.is_empty(), "{name}.{kind}: {losses:?}");
            let again = open_world(&file, &ReadOptions::default(), &Cancel::new()).unwrap();
            let names = |builder: &WorldBuilder| {
                let mut names: Vec<String> = builder.objects().into_iter().map(|object| object.name).collect();
                names.sort();
                names
            };
            assert_eq!(names(&again), names(&builder), "{name}.{kind}");
            let again = again.build().unwrap();
            assert!(again.notes().is_empty(), "{name}.{kind}: {:?}", again.notes());
            let (before, error) = seen(&builder.clone().build().unwrap(), 8);
            let (after, error_after) = seen(&again, 8);
            for band in 0..7 {
                let mean = |image: &SpectralImage| f64::from(image.planes()[band].mean().unwrap());
                let n = before.planes()[band].len() as f64;
                let of = |image: &SpectralImage| {
                    image.planes()[band].iter().map(|e| f64::from(*e).powi(2)).sum::<f64>().sqrt() / n
                };
                let (a, b, noise) = (mean(&before), mean(&after), of(&error).hypot(of(&error_after)));
                assert!((a - b).abs() < 4.0 * noise + 1e-3 * a, "{name}.{kind}: {a} {b} ± {noise} in band {band}");
            }
        }
    }
    let error = write_world(&WorldBuilder::new(), &folder.path().join("a.xyz"), false).unwrap_err().to_string();
    assert!(error.contains("a.xyz"), "{error}");
    assert!(fs::metadata(folder.path().join("a.xyz")).is_err());
}

const KINDS: [&str; 3] = ["pbrt", "glb", "gltf"];
