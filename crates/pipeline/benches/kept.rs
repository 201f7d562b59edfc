//! How long a change of a kept camera takes to the picture, and how soon a cancelled one returns, on the built-in demo:
//! `cargo bench -p dioptric-pipeline --bench kept`. Prints seconds: median and worst of a few runs each.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a bench fails by panicking and prints what it measured")]

use std::{
    fs, thread,
    time::{Duration, Instant},
};

use dioptric_pipeline::{
    Camera, FocusSpec, KeptCamera, Quality, SensorSpec, Silent, StopSpec, with_analog_gain, with_exposure_s,
};
use dioptric_sensor::{Demosaic, Sensor};
use dioptric_spectrum::Cancel;

/// Runs a row of changes, each of another value.
const REPEATS: usize = 5;

fn seconds(kept: &KeptCamera) -> f64 {
    let start = Instant::now();
    kept.capture(&Silent, &Cancel::new()).unwrap();
    start.elapsed().as_secs_f64()
}

fn row(name: &str, mut times_s: Vec<f64>) {
    times_s.sort_by(f64::total_cmp);
    println!("{name:<44} {:>8.3} {:>8.3}", times_s[times_s.len() / 2], times_s[times_s.len() - 1]);
}

fn changes(kept: &KeptCamera, sensors: &[std::path::PathBuf]) {
    let of = |name: &str, change: &dyn Fn(&mut Camera, usize)| {
        let times_s = (0..REPEATS).map(|i| seconds(&kept.with(|camera| change(camera, i)))).collect();
        row(name, times_s);
    };
    of("seed", &|camera, i| camera.seed = 100 + i as u64);
    of("exposure", &|camera, i| camera.exposure = with_exposure_s(camera.exposure, 1e-3 * (1.0 + i as f64)));
    of("gain", &|camera, i| camera.exposure = with_analog_gain(camera.exposure, 2.0 + i as f64));
    of("processing: demosaic", &|camera, i| {
        let methods = [Demosaic::Bilinear, Demosaic::Malvar, Demosaic::Directional];
        camera.processing.demosaic = methods[i % methods.len()];
        camera.processing.denoise = 1e-6 * (i / methods.len()) as f64;
    });
    of("sensor: quantum efficiency", &|camera, i| camera.sensor = SensorSpec::File(sensors[i].clone()));
    of("focus", &|camera, i| camera.focus = FocusSpec::DistanceMm(900.0 + 50.0 * i as f64));
    of("f-number", &|camera, i| camera.stop = StopSpec::FNumber(5.0 + i as f64));
    of("rise", &|camera, i| camera.movements.rise_mm = 0.1 * (1.0 + i as f64));
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let demo = Camera::demo().unwrap();
    let sensor = match &demo.sensor {
        SensorSpec::BuiltIn(name) => Sensor::built_in(name).unwrap(),
        SensorSpec::File(path) => Sensor::read(path).unwrap(),
    };
    // The same sensor with smaller photodiodes.
    let sensors: Vec<_> = (0..REPEATS)
        .map(|i| {
            let mut changed = sensor.clone();
            changed.fill_factor *= 1.0 - 0.01 * (1 + i) as f64;
            changed.name = format!("{} {i}", sensor.name);
            let path = folder.path().join(format!("{i}.ron"));
            fs::write(&path, changed.to_ron()).unwrap();
            path
        })
        .collect();

    println!("{:<44} {:>8} {:>8}", "seconds to the picture of the demo", "median", "worst");
    let kept = KeptCamera::new(demo.clone());
    let whole_s = seconds(&kept);
    row("full quality: nothing kept", vec![whole_s]);
    changes(&kept, &sensors);
    for quality in [Quality::Draft, Quality::Preview] {
        let kept = KeptCamera::new(demo.clone()).with_quality(quality);
        row(&format!("{quality:?}: nothing kept"), vec![seconds(&kept)]);
        changes(&kept, &sensors);
    }

    // Cancelled at moments spread over a whole run, all stages made anew.
    let late_s = (0..40).map(|i| {
        let (kept, cancel) = (KeptCamera::new(demo.clone()), Cancel::new());
        let canceller = cancel.clone();
        let after = Duration::from_secs_f64(whole_s * (f64::from(i) + 0.5) / 40.0);
        let at = thread::spawn(move || {
            thread::sleep(after);
            canceller.cancel();
            Instant::now()
        });
        let ended = kept.capture(&Silent, &cancel).map(drop);
        let returned = Instant::now();
        match ended {
            Ok(()) => 0.0,
            Err(_) => returned.duration_since(at.join().unwrap()).as_secs_f64(),
        }
    });
    row("from cancel to return", late_s.collect());
}
