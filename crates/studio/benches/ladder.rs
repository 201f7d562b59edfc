//! How soon pictures of a changed camera come, of the built-in demo: `cargo bench -p dioptric-studio --bench ladder [-- EDITS] [sketch|preview|full] [CHANGE]`.
//! Prints, for each kind of change and each rung, the median and the 95th percentile of 200 edits (10 for the full picture), milliseconds
//! from the submission of the camera, and the median of what the processors worked for the sketch, which other programs disturb less; then the difference of each rung from the full picture, the time from a stop to rest, and the memory.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a bench fails by panicking and prints what it measured")]

use std::{
    env,
    sync::mpsc::{self, Receiver},
    thread,
    time::{Duration, Instant},
};

use cpu_time::ProcessTime;
use dioptric_pipeline::{
    Camera, FocusSpec, LensSpec, SceneSource, SensorSpec, StopSpec, SurfaceChange, with_analog_gain, with_exposure_s,
};
use dioptric_sensor::{Demosaic, NoiseSource, NoiseSources};
use dioptric_studio::engine::{Delivery, Engine, EngineSettings, Product, Rung};

/// Edits whose full picture is waited for.
const FULL: usize = 10;

/// A kind of change: its name, the bar for the first rung in milliseconds, and the change by its number.
type Kind = (&'static str, f64, fn(&mut Camera, usize));

const KINDS: &[Kind] = &[
    ("exposure", 30.0, |camera, i| camera.exposure = with_exposure_s(camera.exposure, 1e-3 * (1.0 + 0.01 * i as f64))),
    ("gain", 30.0, |camera, i| camera.exposure = with_analog_gain(camera.exposure, 1.0 + 0.05 * i as f64)),
    ("noise", 30.0, |camera, i| {
        camera.noise = if i % 2 == 0 { NoiseSources::ALL } else { NoiseSources::only(&[NoiseSource::Photon]) };
        camera.seed = i as u64;
    }),
    ("processing", 30.0, |camera, i| {
        camera.processing.demosaic = Demosaic::NAMES[i % Demosaic::NAMES.len()].1;
        camera.processing.denoise = Some(0.005 * i as f64);
    }),
    ("sensor", 50.0, |camera, i| {
        let names = ["imx363", "nikon-d5100", "nikon-d100", "mt9v024"];
        camera.sensor = SensorSpec::BuiltIn(names[i % names.len()].to_owned());
        // No sensor comes twice with the same frames.
        camera.seed = i as u64;
    }),
    ("f-number", 100.0, |camera, i| camera.stop = StopSpec::FNumber(2.8 + 0.05 * i as f64)),
    ("focus", 100.0, |camera, i| camera.focus = FocusSpec::DistanceMm(700.0 + 5.0 * i as f64)),
    ("movements: rise", 100.0, |camera, i| camera.movements.rise_mm = 0.01 * (1.0 + i as f64)),
    ("movements: swing", 100.0, |camera, i| camera.movements.swing_deg = 0.03 * (1.0 + i as f64)),
    ("lens: curvature", 250.0, |camera, i| {
        let change = SurfaceChange { surface: 0, curvature_per_mm: Some(0.02 + 1e-5 * i as f64), thickness_mm: None };
        camera.lens = camera.lens.with_changes(vec![change]);
    }),
    ("lens", 250.0, |camera, i| {
        let names = ["tessar-50mm", "cooke-50mm", "canon-50mm", "dgauss-50mm-schott", "achromat-100mm"];
        camera.lens = LensSpec::BuiltIn(names[i % names.len()].to_owned());
        camera.stop = StopSpec::FNumber(8.0 + 0.01 * i as f64);
    }),
    ("scene: field of view", 250.0, |camera, i| camera.scene.field_of_view_deg = Some(36.0 + 0.1 * i as f64)),
    ("scene: size", 250.0, |camera, i| {
        camera.scene.source = SceneSource::StillLife { columns: 1080 - 6 * (i % 50), rows: 720 - 6 * (i / 50) };
    }),
    ("scene: light", 250.0, |camera, i| camera.scene.illuminance_lux = Some(200.0 + 10.0 * i as f64)),
];

struct Bench {
    engine: Engine,
    woken: Receiver<()>,
}

impl Bench {
    /// Submits a camera and returns its deliveries up to a rung.
    fn climb(&self, camera: &Camera, top: Rung) -> Vec<Delivery> {
        let generation = self.engine.submit(camera.clone(), top);
        let mut all: Vec<Delivery> = Vec::new();
        while !all.iter().any(|d| d.rung == top) {
            self.woken.recv_timeout(Duration::from_secs(600)).unwrap();
            all.extend(self.engine.take().into_iter().filter(|d| d.generation == generation));
            for delivery in &all {
                assert!(delivery.outcome.is_ok(), "{:?}", delivery.outcome.as_ref().err());
            }
        }
        all
    }
}

fn percentile(times_ms: &mut [f64], share: f64) -> f64 {
    times_ms.sort_by(f64::total_cmp);
    if times_ms.is_empty() {
        return f64::NAN;
    }
    times_ms[((times_ms.len() - 1) as f64 * share).round() as usize]
}

/// Returns the rms over the pixels of a picture of the difference from the full one, averaged over them, as a share of full scale.
fn rms(few: &Product, whole: &Product) -> f64 {
    let ([columns, rows], [full_columns, _]) = (few.size(), whole.size());
    let n = full_columns / columns;
    let at =
        |row: usize, column: usize, channel: usize| f64::from(whole.rgb8[3 * (row * full_columns + column) + channel]);
    let mut sum = 0.0;
    for row in 0..rows {
        for column in 0..columns {
            for channel in 0..3 {
                let block = (0..n * n).map(|i| at(n * row + i / n, n * column + i % n, channel)).sum::<f64>();
                let code = f64::from(few.rgb8[3 * (row * columns + column) + channel]);
                sum += (code - block / (n * n) as f64).powi(2);
            }
        }
    }
    (sum / (3 * rows * columns) as f64).sqrt() / 255.0
}

/// Returns a line of the kernel's account of this process, MiB; 0 where there is none.
fn memory_mib(key: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with(key)).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kib| kib.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

/// What was asked for on the command line.
struct Wanted {
    top: Rung,
    n_edits: usize,
    /// Beginnings of the names of kinds; empty for all.
    kinds: Vec<String>,
}

impl Wanted {
    fn of_arguments() -> Self {
        let mut wanted = Self { top: Rung::Full, n_edits: 200, kinds: Vec::new() };
        for word in env::args().skip(1).filter(|argument| !argument.starts_with('-')) {
            match (word.as_str(), word.parse()) {
                ("sketch", _) => wanted.top = Rung::Sketch,
                ("preview", _) => wanted.top = Rung::Preview,
                ("full", _) => wanted.top = Rung::Full,
                (_, Ok(n_edits)) => wanted.n_edits = n_edits,
                _ => wanted.kinds.push(word),
            }
        }
        wanted
    }

    fn has(&self, name: &str) -> bool {
        self.kinds.is_empty() || self.kinds.iter().any(|kind| name.starts_with(kind.as_str()))
    }
}

/// Prints how long the first picture takes, the rungs of a camera of which nothing is kept, and how far they are from the full one.
fn first_pictures(bench: &Bench, demo: &Camera, top: Rung, begin: Instant) {
    drop(bench.climb(demo, Rung::Sketch));
    println!("start to the first picture {:.0} ms", 1e3 * begin.elapsed().as_secs_f64());
    let all = bench.climb(demo, top);
    let times: Vec<String> = all.iter().map(|d| format!("{:.0}", 1e3 * d.work.as_secs_f64())).collect();
    println!("nothing kept: rungs of {} ms", times.join(", "));
    let [sketch, preview, full] = &*all else { return };
    let product = |delivery: &Delivery| delivery.outcome.clone().unwrap();
    let rms_of = |few: &Delivery| format!("{:.2} %", 100.0 * rms(&product(few), &product(full)));
    println!(
        "rms from the full picture: sketch {}, preview {}, full {}",
        rms_of(sketch),
        rms_of(preview),
        rms_of(full)
    );
}

/// Changes the camera again and again in one way, and prints median and 95th percentile of the time to each rung, and of the work for the
/// first.
fn edits(bench: &Bench, demo: &Camera, &(name, bar_ms, change): &Kind, wanted: &Wanted) {
    let mut times_ms: [Vec<f64>; 3] = Default::default();
    let mut work_ms = Vec::new();
    for i in 0..wanted.n_edits {
        let mut camera = demo.clone();
        change(&mut camera, i);
        let begin = ProcessTime::now();
        let sketch = bench.climb(&camera, Rung::Sketch);
        work_ms.push(1e3 * begin.elapsed().as_secs_f64());
        times_ms[0].push(1e3 * sketch[0].elapsed.as_secs_f64());
        let is_full = i % wanted.n_edits.div_ceil(FULL) == 0;
        let top = wanted.top.min(if is_full { Rung::Full } else { Rung::Preview });
        if top == Rung::Sketch {
            continue;
        }
        // Of the first rung the results are kept by now, so that what follows counts from its end.
        for delivery in bench.climb(&camera, top).into_iter().skip(1) {
            times_ms[delivery.rung.number() - 1].push(1e3 * (sketch[0].elapsed + delivery.elapsed).as_secs_f64());
        }
    }
    let both = |times: &mut Vec<f64>| format!("{:>7.1} {:>8.1} ", percentile(times, 0.5), percentile(times, 0.95));
    let cells: Vec<String> = times_ms.each_mut().map(both).into();
    println!("{name:<24} {bar_ms:>5} {}  {}", both(&mut work_ms), cells.join(" "));
}

/// Prints how soon the engine rests once it is stopped.
fn stops(bench: &Bench, demo: &Camera) {
    let mut late_ms: Vec<f64> = (0..40)
        .map(|i| {
            let camera = Camera { stop: StopSpec::FNumber(3.0 + 0.1 * f64::from(i)), ..demo.clone() };
            bench.engine.submit(camera, Rung::Full);
            thread::sleep(Duration::from_millis(40 * i as u64));
            let asked = Instant::now();
            bench.engine.stop();
            while bench.engine.is_busy() {
                thread::sleep(Duration::from_micros(100));
            }
            1e3 * asked.elapsed().as_secs_f64()
        })
        .collect();
    println!("from stop to rest, ms: {:.1} {:.1}", percentile(&mut late_ms, 0.5), percentile(&mut late_ms, 0.95));
}

/// Returns how many programs wait for processors; what times by the clock are worth.
fn load() -> String {
    std::fs::read_to_string("/proc/loadavg")
        .map_or("unknown".to_owned(), |text| text.split(' ').take(2).collect::<Vec<_>>().join(", "))
}

fn main() {
    let wanted = Wanted::of_arguments();
    println!("load before (1 and 5 minutes): {}", load());
    let (sender, woken) = mpsc::channel();
    let begin = Instant::now();
    let engine = Engine::start(EngineSettings::default(), move || _ = sender.send(())).unwrap();
    let bench = Bench { engine, woken };
    let demo = Camera::demo().unwrap();
    first_pictures(&bench, &demo, wanted.top, begin);
    println!(
        "{} edits of each kind, median and 95th percentile, ms; work is that of all threads for the sketch",
        wanted.n_edits
    );
    println!("{:<24} {:>5} {:^17}  {:^17}  {:^17}  {:^17}", "change", "bar", "work", "sketch", "preview", "full");
    for kind in KINDS.iter().filter(|(name, ..)| wanted.has(name)) {
        edits(&bench, &demo, kind, &wanted);
    }
    stops(&bench, &demo);
    println!("memory: {:.0} MiB, at most {:.0} MiB", memory_mib("VmRSS"), memory_mib("VmHWM"));
    println!("load after (1 and 5 minutes): {}", load());
}
