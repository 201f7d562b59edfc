//! The engine delivers the latest camera, rung by rung, and the last rung is the run.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    sync::mpsc::{self, Receiver},
    time::{Duration, Instant},
};

use dioptric_pipeline::{
    Camera, FilmSpec, FocusSpec, KeptCamera, LensSpec, PaintingFolder, RenderEffort, SceneSource, SceneSpec,
    SensorSpec, Silent, StopSpec, WavelengthSpec, WorldSpec, write_capture,
};
use dioptric_spectrum::Cancel;
use dioptric_studio::engine::{Delivery, Engine, EngineSettings, Field, Rung};

/// Longer than any work here takes on a busy machine.
const LONG: Duration = Duration::from_secs(120);

/// The demo on 960 / `n` columns.
fn demo(n: usize) -> Camera {
    let mut camera = Camera::demo().unwrap();
    camera.film = FilmSpec::Pixels { columns: 960 / n, rows: 640 / n, pitch_um: 33.0 * n as f64 };
    camera.scene.source = SceneSource::StillLife { columns: 1080 / n, rows: 720 / n };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 420.0, last_nm: 680.0, step_nm: 20.0 };
    camera
}

fn start() -> (Engine, Receiver<()>) {
    let (sender, woken) = mpsc::channel();
    let engine = Engine::start(EngineSettings::default(), move || _ = sender.send(())).unwrap();
    (engine, woken)
}

/// Waits for the last rung of a camera; returns all that was delivered until then.
fn wait(engine: &Engine, woken: &Receiver<()>, generation: u64, top: Rung) -> Vec<Delivery> {
    let (mut all, start) = (Vec::new(), Instant::now());
    while start.elapsed() < LONG {
        all.extend(engine.take());
        let is_last = |d: &Delivery| d.generation == generation && (d.rung == top || d.outcome.is_err());
        if all.iter().any(is_last) {
            return all;
        }
        _ = woken.recv_timeout(Duration::from_millis(100));
    }
    panic!("nothing came in {LONG:?}");
}

#[test]
fn the_last_rung_is_the_run() {
    let camera = demo(3);
    let (engine, woken) = start();
    // On the way there, other cameras.
    engine.submit(Camera { stop: StopSpec::FNumber(8.0), ..camera.clone() }, Rung::Preview);
    std::thread::sleep(Duration::from_millis(30));
    engine.submit(Camera { seed: 4, ..camera.clone() }, Rung::Full);
    std::thread::sleep(Duration::from_millis(300));
    let generation = engine.submit(camera.clone(), Rung::Full);
    let all = wait(&engine, &woken, generation, Rung::Full);
    let rungs: Vec<Rung> = all.iter().filter(|d| d.generation == generation).map(|d| d.rung).collect();
    assert_eq!(rungs, Rung::ALL);

    let folder = tempfile::tempdir().unwrap();
    let capture = KeptCamera::new(camera).capture(&Silent, &Cancel::new()).unwrap();
    let (_, png) = write_capture(&capture, None, folder.path()).unwrap();
    let product = all.last().unwrap().outcome.as_ref().unwrap();
    assert!(product.png().unwrap() == png && std::fs::read(folder.path().join("picture.png")).unwrap() == png);
}

#[test]
fn field_of_view_is_painted_ahead_and_holds_nothing_up() {
    let folder = tempfile::tempdir().unwrap();
    let settings = EngineSettings { paintings: Some(PaintingFolder::new(folder.path(), "test")) };
    let (sender, woken) = mpsc::channel();
    let engine = Engine::start(settings, move || _ = sender.send(())).unwrap();
    // A preview's paintings are large enough to be kept in files: its own, and one each for narrower and wider fields of view.
    let n_paintings = || std::fs::read_dir(folder.path()).map_or(0, Iterator::count);
    // How much a lens off its axis sees is not known.
    let mut camera = demo(1);
    camera.movements.rise_mm = 0.1;
    let generation = engine.submit(camera.clone(), Rung::Preview);
    wait(&engine, &woken, generation, Rung::Preview);
    // The next camera comes in the middle of it, and is not kept waiting for its end.
    let generation = engine.submit(Camera { seed: 4, ..camera }, Rung::Preview);
    wait(&engine, &woken, generation, Rung::Preview);
    assert!(n_paintings() < 3);
    let start = Instant::now();
    while n_paintings() < 3 {
        assert!(start.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(!engine.is_busy());
}

#[test]
fn the_latest_camera_wins() {
    let (engine, woken) = start();
    let cameras: Vec<Camera> =
        (0..40).map(|i| Camera { stop: StopSpec::FNumber(4.0 + 0.1 * f64::from(i)), ..demo(6) }).collect();
    let mut last = 0;
    for camera in &cameras {
        last = engine.submit(camera.clone(), Rung::Preview);
        std::thread::sleep(Duration::from_millis(7));
    }
    let all = wait(&engine, &woken, last, Rung::Preview);
    // Each picture is that of its own camera, in the order of submission.
    assert!(all.windows(2).all(|pair| pair[0].generation <= pair[1].generation));
    for delivery in &all {
        let product = delivery.outcome.as_ref().unwrap();
        assert_eq!(*product.camera(), cameras[delivery.generation as usize - 1]);
    }
    assert_eq!((all.last().unwrap().generation, all.last().unwrap().rung), (40, Rung::Preview));
}

#[test]
fn going_back_gives_the_same_bits() {
    let (engine, woken) = start();
    let (first, other) = (demo(6), Camera { stop: StopSpec::FNumber(11.0), ..demo(6) });
    let picture = |camera: &Camera| {
        let generation = engine.submit(camera.clone(), Rung::Full);
        wait(&engine, &woken, generation, Rung::Full).last().unwrap().outcome.as_ref().unwrap().rgb8.clone()
    };
    let before = picture(&first);
    assert_ne!(picture(&other), before);
    assert_eq!(picture(&first), before);
}

#[test]
fn cancelled_work_ends_long_before_its_picture() {
    let (engine, woken) = start();
    let mut late = Vec::new();
    // A film of the demo's size, so that the full rung takes seconds, stopped ever later in it.
    let mut camera = demo(1);
    for i in 0..8 {
        camera.stop = StopSpec::FNumber(4.0 + f64::from(i));
        let generation = engine.submit(camera.clone(), Rung::Full);
        wait(&engine, &woken, generation, Rung::Preview);
        std::thread::sleep(Duration::from_millis(90 * i as u64));
        let asked = Instant::now();
        engine.stop();
        while engine.is_busy() {
            assert!(asked.elapsed() < LONG);
            std::thread::sleep(Duration::from_micros(200));
        }
        late.push(asked.elapsed());
    }
    late.sort();
    println!("from stop to rest: {late:?}");
    // The picture would take seconds; other tests run beside this one, so that the 20 ms of a quiet machine are no bound here.
    assert!(late[late.len() / 2] <= Duration::from_millis(300), "{late:?}");
    assert!(engine.take().is_empty());
}

#[test]
fn a_wrong_camera_is_a_fault_at_its_field() {
    let (engine, woken) = start();
    let wrong = Camera { sensor: SensorSpec::BuiltIn("no such".to_owned()), ..demo(6) };
    let generation = engine.submit(wrong, Rung::Full);
    let all = wait(&engine, &woken, generation, Rung::Full);
    let fault = all[0].outcome.as_ref().unwrap_err();
    assert_eq!((all.len(), fault.field), (1, Field::Sensor));
    assert!(fault.message.contains("no such"), "{}", fault.message);
    // The engine goes on.
    let generation = engine.submit(demo(6), Rung::Sketch);
    assert!(wait(&engine, &woken, generation, Rung::Sketch).last().unwrap().outcome.is_ok());
}

#[test]
fn progress_tells_the_rung_and_its_stage() {
    let (engine, woken) = start();
    let generation = engine.submit(demo(2), Rung::Full);
    let mut seen = Vec::new();
    let start = Instant::now();
    while start.elapsed() < LONG && !engine.take().iter().any(|d| d.rung == Rung::Full) {
        if let Some(busy) = engine.busy() {
            assert!(busy.generation == generation && (0.0..=1.0).contains(&busy.fraction));
            seen.push((busy.rung, busy.stage));
        }
        _ = woken.recv_timeout(Duration::from_millis(2));
    }
    let full: Vec<_> = seen.iter().filter(|(rung, _)| *rung == Rung::Full).collect();
    assert!(!full.is_empty() && full.windows(2).all(|pair| pair[0] <= pair[1]), "{seen:?}");
}

#[test]
fn a_world_refines_to_the_bits_of_the_run() {
    let mut world =
        WorldSpec::of_file(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/worlds/room.pbrt"));
    (world.effort, world.size) = (RenderEffort::Samples(64), Some((30, 20)));
    let camera = Camera {
        lens: LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 12.5 },
        stop: StopSpec::AsGiven,
        focus: FocusSpec::DistanceMm(3000.0),
        film: FilmSpec::Pixels { columns: 24, rows: 16, pitch_um: 1400.0 },
        scene: SceneSpec { source: SceneSource::World(world), ..SceneSpec::of_file("room.pbrt".into()) },
        wavelengths: WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]),
        ..demo(6)
    };
    let (engine, woken) = start();
    let generation = engine.submit(camera.clone(), Rung::Full);
    let all = wait(&engine, &woken, generation, Rung::Full);
    let products: Vec<_> = all.iter().map(|delivery| delivery.outcome.as_ref().unwrap()).collect();
    // Passes of 8 samples: after 1, 2 and 4 of them, and all 8.
    let on_its_way: Vec<Option<u32>> = products.iter().map(|product| product.n_samples).collect();
    assert_eq!(on_its_way, [None, None, Some(8), Some(16), Some(32), None]);
    assert!(products.iter().all(|product| *product.camera() == camera));
    let kept = KeptCamera::new(camera);
    let run = kept.capture(&Silent, &Cancel::new()).unwrap();
    let full = products.last().unwrap();
    assert_eq!(full.capture.irradiance.cube(), run.irradiance.cube());
    assert_eq!(full.rgb8, run.developed.picture.to_rgb8());
    // Each is nearer to it than the one before, as noise falls by √2.
    let off = |few: &dioptric_studio::engine::Product| {
        let (few, whole) = (few.capture.irradiance.cube().unwrap(), run.irradiance.cube().unwrap());
        few.iter().zip(whole).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let offs: Vec<f64> = products[2..5].iter().map(|product| off(product)).collect();
    assert!(offs[0] > offs[1] && offs[1] > offs[2] && offs[2] > 0.0, "{offs:?}");
}
