//! Pictures of the window in five states, for the documentation and for the check: `cargo run --release -p dioptric-studio --example
//! screenshots -- DIR`. Needs a screen; `scripts/screenshots` and `.ci/window` have one that is none. Each picture is looked at as far as a program
//! can: it has the size of the window, and every panel shows something.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a chore fails by panicking and says what it wrote")]

use std::{
    collections::HashMap,
    env, fs,
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, Sender},
    time::{Duration, Instant},
};

use dioptric_pictures::encode_rgb8_png;
use dioptric_pipeline::{Camera, StopSpec};
use dioptric_studio::{
    engine::EngineSettings,
    session::{Snapshot, presets},
    ui::{Shown, Studio, StudioSettings, Tab},
};
use eframe::{
    Frame, NativeOptions,
    egui::{self, ColorImage, ScreenshotCallback, ViewportCommand},
};

/// How long charts may take after the full picture.
const REST: Duration = Duration::from_millis(1500);

/// Width and height of the window, points.
const SIZE: [f32; 2] = [1280.0, 800.0];

/// A state of the window: its name, what is done for it in turn, the picture awaited after each.
type State = (&'static str, bool, &'static [fn(&mut Studio)]);

fn preset(name: &str) -> Camera {
    presets().iter().find(|preset| preset.name == name).unwrap().camera().unwrap()
}

const STATES: [State; 5] = [
    ("demo", true, &[|studio| studio.show_tab(Tab::Picture, Shown::Picture)]),
    ("view-camera", true, &[|studio| studio.change(|camera| *camera = preset("View camera"))]),
    ("night", true, &[|studio| studio.change(|camera| *camera = preset("Phone at night"))]),
    (
        "lens-bench",
        false,
        &[|studio| {
            studio.change(|camera| *camera = preset("Demo"));
            studio.show_tab(Tab::LensBench, Shown::Picture);
        }],
    ),
    (
        "compare",
        true,
        &[
            |studio| studio.keep_snapshot(Snapshot::A),
            |studio| studio.change(|camera| camera.stop = StopSpec::FNumber(11.0)),
            |studio| {
                studio.keep_snapshot(Snapshot::B);
                studio.show_tab(Tab::Picture, Shown::Difference);
            },
        ],
    ),
];

struct Shots {
    studio: Studio,
    folder: PathBuf,
    state: usize,
    step: usize,
    /// When the picture of a step came.
    settled: Option<Instant>,
    is_asked: bool,
    sender: Sender<ColorImage>,
    images: Receiver<ColorImage>,
}

impl eframe::App for Shots {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut Frame) {
        self.studio.ui(ui);
        ui.ctx().request_repaint();
        let Some((name, is_dark, steps)) = STATES.get(self.state) else {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            return;
        };
        if let Ok(image) = self.images.try_recv() {
            check(name, &image, ui.ctx().pixels_per_point());
            write(&self.folder.join(format!("{name}.png")), &image);
            (self.state, self.step, self.settled, self.is_asked) = (self.state + 1, 0, None, false);
            return;
        }
        if self.step < steps.len() && (self.step == 0 || self.settled.is_some()) {
            ui.ctx().set_theme(if *is_dark { egui::Theme::Dark } else { egui::Theme::Light });
            steps[self.step](&mut self.studio);
            (self.step, self.settled) = (self.step + 1, None);
            return;
        }
        if self.settled.is_none() && self.studio.is_settled() {
            self.settled = Some(Instant::now());
        }
        if self.settled.is_some_and(|at| at.elapsed() > REST) && self.step == steps.len() && !self.is_asked {
            self.is_asked = true;
            let sender = self.sender.clone();
            let callback = ScreenshotCallback::new(move |image| _ = sender.send((*image).clone()));
            ui.ctx().send_viewport_cmd(ViewportCommand::Screenshot(callback));
        }
    }
}

/// The parts of the window: a name, left, top, right and bottom edges as shares of it, and the least number of colors that it shows.
const PARTS: [(&str, [f64; 4], usize); 4] = [
    ("the bar", [0.0, 0.0, 1.0, 0.05], 12),
    ("the panels of the camera", [0.0, 0.06, 0.24, 0.93], 40),
    ("the middle", [0.28, 0.12, 1.0, 0.68], 40),
    ("the charts", [0.28, 0.75, 1.0, 0.95], 40),
];
/// The largest share of a part that may have one color.
const MOST_ALIKE: f64 = 0.985;

/// Checks that a picture of the window has its size, points times pixels a point, and something in every part.
fn check(name: &str, image: &ColorImage, pixels_per_point: f32) {
    let expected = SIZE.map(|points| (points * pixels_per_point).round() as usize);
    assert_eq!(image.size, expected, "{name}: pixels of the window");
    for (part, [left, top, right, bottom], least) in PARTS {
        let at = |share: f64, n: usize| (share * n as f64) as usize;
        let (columns, rows) =
            (at(left, expected[0])..at(right, expected[0]), at(top, expected[1])..at(bottom, expected[1]));
        let mut counts: HashMap<[u8; 4], usize> = HashMap::new();
        for row in rows.clone() {
            for column in columns.clone() {
                *counts.entry(image.pixels[row * image.size[0] + column].to_array()).or_default() += 1;
            }
        }
        let most = counts.values().copied().max().unwrap_or(0) as f64 / (rows.len() * columns.len()) as f64;
        assert!(
            counts.len() >= least && most <= MOST_ALIKE,
            "{name}: {part} has {} colors, expected {least} or more, and {:.1} % of it are alike, expected at most {:.1} %",
            counts.len(),
            100.0 * most,
            100.0 * MOST_ALIKE
        );
    }
}

/// Writes an image.
fn write(path: &Path, image: &ColorImage) {
    let codes: Vec<u8> = image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect();
    fs::write(path, encode_rgb8_png(&codes, (image.size[0], image.size[1])).unwrap()).unwrap();
    println!("{}: {} x {}", path.display(), image.size[0], image.size[1]);
}

fn main() {
    let folder = PathBuf::from(env::args_os().nth(1).unwrap_or_else(|| "docs/figures/studio".into()));
    fs::create_dir_all(&folder).unwrap();
    let viewport = egui::ViewportBuilder::default().with_inner_size(SIZE).with_title("dioptric studio");
    let options = NativeOptions { viewport, ..NativeOptions::default() };
    let (sender, images) = mpsc::channel();
    eframe::run_native(
        "dioptric-studio",
        options,
        Box::new(move |context| {
            let settings = StudioSettings { engine: EngineSettings::default(), autosave: None, camera: None };
            let studio = Studio::new(&context.egui_ctx, settings)?;
            Ok(Box::new(Shots { studio, folder, state: 0, step: 0, settled: None, is_asked: false, sender, images }))
        }),
    )
    .unwrap();
}
