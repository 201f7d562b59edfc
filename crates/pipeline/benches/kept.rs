//! How long a change of a kept camera takes to the picture, and how soon a cancelled one returns, on the built-in demo:
//! `cargo bench -p dioptric-pipeline --bench kept [-- full draft preview sketch cancel] [--only CHANGE]`. Prints seconds of the clock,
//! median and worst of a few runs each.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a bench fails by panicking and prints what it measured")]

use std::{
    env, fs,
    sync::Mutex,
    thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::{
    Camera, FocusSpec, KeptCamera, LensSpec, PaintReach, PaintingFolder, Progress, Quality, SceneSource, SensorSpec,
    Silent, Stage, StopSpec, with_analog_gain, with_exposure_s,
};
use dioptric_scene::Pattern;
use dioptric_sensor::{Demosaic, Sensor};
use dioptric_spectrum::{Cancel, Illuminant};

/// Runs a row of changes, each of another value.
const REPEATS: usize = 5;

fn seconds(kept: &KeptCamera) -> f64 {
    let start = Instant::now();
    kept.capture(&Silent, &Cancel::new()).unwrap();
    start.elapsed().as_secs_f64()
}

/// When each stage was first heard of.
#[derive(Default)]
struct Starts(Mutex<Vec<(Stage, Instant)>>);

impl Progress for Starts {
    fn at(&self, stage: Stage, _: f64) {
        let mut starts = self.0.lock().unwrap();
        if starts.last().is_none_or(|(last, _)| *last != stage) {
            starts.push((stage, Instant::now()));
        }
    }
}

/// Prints the milliseconds from the start of each stage to that of the next.
fn print_stages(kept: &KeptCamera) {
    let (starts, begin) = (Starts::default(), Instant::now());
    kept.capture(&starts, &Cancel::new()).unwrap();
    let end = Instant::now();
    let starts = starts.0.into_inner().unwrap();
    let mut before = begin;
    for (i, (stage, at)) in starts.iter().enumerate() {
        let next = starts.get(i + 1).map_or(end, |(_, next)| *next);
        let (waited, took) = (at.duration_since(before), next.duration_since(*at));
        println!(
            "    {:>7.1} ms before, {:>7.1} ms {}",
            1e3 * waited.as_secs_f64(),
            1e3 * took.as_secs_f64(),
            stage.title()
        );
        before = next;
    }
}

fn row(name: &str, mut times_s: Vec<f64>) {
    times_s.sort_by(f64::total_cmp);
    println!("{name:<44} {:>8.3} {:>8.3}", times_s[times_s.len() / 2], times_s[times_s.len() - 1]);
}

fn changes(kept: &KeptCamera, sensors: &[std::path::PathBuf], only: Option<&str>) {
    let of = |name: &str, change: &dyn Fn(&mut Camera, usize)| {
        if only.is_some_and(|only| !name.starts_with(only)) {
            return;
        }
        let times_s = (0..REPEATS).map(|i| seconds(&kept.with(|camera| change(camera, i)))).collect();
        row(name, times_s);
        if only.is_some() {
            print_stages(&kept.with(|camera| change(camera, REPEATS)));
        }
    };
    of("seed", &|camera, i| camera.seed = 100 + i as u64);
    of("exposure", &|camera, i| camera.exposure = with_exposure_s(camera.exposure, 1e-3 * (1.0 + i as f64)));
    of("gain", &|camera, i| camera.exposure = with_analog_gain(camera.exposure, 2.0 + i as f64));
    of("processing: demosaic", &|camera, i| {
        let methods = [Demosaic::Bilinear, Demosaic::Malvar, Demosaic::Directional];
        camera.processing.demosaic = methods[i % methods.len()];
        camera.processing.denoise = Some(1e-6 * (i / methods.len()) as f64);
    });
    of("sensor: quantum efficiency", &|camera, i| camera.sensor = SensorSpec::File(sensors[i].clone()));
    of("focus", &|camera, i| camera.focus = FocusSpec::DistanceMm(900.0 + 50.0 * i as f64));
    of("f-number", &|camera, i| camera.stop = StopSpec::FNumber(5.0 + i as f64));
    of("rise", &|camera, i| camera.movements.rise_mm = 0.1 * (1.0 + i as f64));
    of("tilt", &|camera, i| camera.movements.tilt_deg = 0.5 * (1.0 + i as f64));
    of("scene: another light", &|camera, i| {
        let lights = [Illuminant::A, Illuminant::D50, Illuminant::D55, Illuminant::D65, Illuminant::E, Illuminant::Fl2];
        camera.scene.illuminant = Some(lights[i].clone());
    });
    of("scene: another painting", &|camera, i| {
        camera.scene.source = SceneSource::StillLife { columns: 1080 + 30 * (1 + i), rows: 720 + 20 * (1 + i) };
    });
    // Of another shape each, by a fiftieth.
    of("scene: another shape", &|camera, i| {
        camera.scene.source = SceneSource::StillLife { columns: 1080, rows: 720 - 15 * (1 + i) };
    });
    let fov = |deg: f64| move |camera: &mut Camera| camera.scene.field_of_view_deg = Some(deg);
    of("scene: field of view", &|camera, i| fov(36.0 * 1.12_f64.powi(i as i32))(camera));
    of("scene: field of view, jumps", &|camera, i| fov([60.0, 12.0, 95.0, 25.0, 7.0, 50.0][i])(camera));
    // Of which it is not known how much the film sees: each painted anew.
    of("scene: field of view, lens moved", &|camera, i| {
        camera.movements.rise_mm = 0.1;
        fov(38.0 * 1.12_f64.powi(i as i32))(camera);
    });
    if only.is_none_or(|only| "scene: field of view, lens moved, painted ahead".starts_with(only)) {
        // Steps of a sixth, the next of which is prepared while the picture is looked at.
        let kept = kept.with(|camera| camera.movements.rise_mm = 0.2);
        let times_s = (0..REPEATS).map(|i| {
            let at = |i: usize| kept.with(fov(34.0 * 1.16_f64.powi(i as i32)));
            at(i).paint_ahead(PaintReach::Next, &Silent, &Cancel::new()).unwrap();
            seconds(&at(i + 1))
        });
        row("scene: field of view, lens moved, painted ahead", times_s.collect());
    }
    of("scene: a target", &|camera, i| {
        (camera.scene.field_of_view_deg, camera.scene.depth_m) = (Some(34.0), Some(1.5));
        camera.scene.source =
            SceneSource::Target { pattern: Pattern::Checkerboard { check_px: 10 + i }, columns: 1080, rows: 720 };
    });
    of("lens", &|camera, i| {
        let lenses = ["tessar-50mm", "dgauss-50mm", "canon-50mm", "paper-2el", "dgauss-50mm-schott", "singlet-50mm"];
        camera.lens = LensSpec::BuiltIn(lenses[i].into());
        camera.stop = StopSpec::FNumber(5.0);
    });
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let demo = Camera::demo().unwrap();
    let sensor = match &demo.sensor {
        SensorSpec::BuiltIn(name) => Sensor::built_in(name).unwrap(),
        SensorSpec::File(path) => Sensor::read(path).unwrap(),
    };
    // The same sensor with smaller photodiodes.
    let sensors: Vec<_> = (0..=REPEATS)
        .map(|i| {
            let mut changed = sensor.clone();
            changed.fill_factor *= 1.0 - 0.01 * (1 + i) as f64;
            changed.name = format!("{} {i}", sensor.name);
            let path = folder.path().join(format!("{i}.ron"));
            fs::write(&path, changed.to_ron()).unwrap();
            path
        })
        .collect();

    let mut arguments: Vec<String> = env::args().skip(1).collect();
    let only = arguments.iter().position(|argument| argument == "--only").and_then(|at| arguments.drain(at..).nth(1));
    let sections: Vec<String> = arguments.into_iter().filter(|argument| !argument.starts_with('-')).collect();
    let is_wanted = |section: &str| sections.is_empty() || sections.iter().any(|wanted| wanted == section);
    println!("{:<44} {:>8} {:>8}", "seconds to the picture of the demo", "median", "worst");
    for (section, quality) in
        [("full", Quality::Full), ("draft", Quality::Draft), ("preview", Quality::Preview), ("sketch", Quality::Sketch)]
    {
        if is_wanted(section) {
            // As in the programs, what was painted once is kept for other light.
            let paintings = PaintingFolder::new(folder.path(), "bench");
            let kept = KeptCamera::new(demo.clone()).with_quality(quality).with_paintings(Some(paintings));
            row(&format!("{quality:?}: nothing kept"), vec![seconds(&kept)]);
            changes(&kept, &sensors, only.as_deref());
        }
    }
    if is_wanted("cancel") {
        let whole_s = seconds(&KeptCamera::new(demo.clone()));
        let mut late: Vec<(f64, String)> =
            (0..40).map(|i| cancelled(&demo, whole_s * (i as f64 + 0.5) / 40.0)).collect();
        row("from cancel to return", late.iter().map(|(seconds, _)| *seconds).collect());
        late.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (seconds, stage) in &late[..5] {
            println!("    {seconds:.3} in {stage}");
        }
    }
}

/// Where a run is.
#[derive(Default)]
struct Place(Mutex<String>);

impl Progress for Place {
    fn at(&self, stage: Stage, fraction: f64) {
        *self.0.lock().unwrap() = format!("{}, {:.0} %", stage.title(), 100.0 * fraction);
    }
}

/// Returns the time from a cancel after so many seconds of a run, all stages made anew, to its return, and where it was.
fn cancelled(demo: &Camera, after_s: f64) -> (f64, String) {
    let (kept, cancel, place) = (KeptCamera::new(demo.clone()), Cancel::new(), Place::default());
    thread::scope(|scope| {
        let at = scope.spawn(|| {
            thread::sleep(Duration::from_secs_f64(after_s));
            let stage = place.0.lock().unwrap().clone();
            cancel.cancel();
            (Instant::now(), stage)
        });
        let ended = kept.capture(&place, &cancel).map(drop);
        let returned = Instant::now();
        let (at, stage) = at.join().unwrap();
        (if ended.is_ok() { 0.0 } else { returned.duration_since(at).as_secs_f64() }, stage)
    })
}
