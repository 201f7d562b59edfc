//! Pictures of the window in five states, for the documentation: `cargo run --release -p dioptric-studio --example screenshots -- DIR`.
//! Needs a screen; `scripts/screenshots` has one that is none.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a chore fails by panicking and says what it wrote")]

use std::{
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

/// Writes an image.
fn write(path: &Path, image: &ColorImage) {
    let codes: Vec<u8> = image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect();
    fs::write(path, encode_rgb8_png(&codes, (image.size[0], image.size[1])).unwrap()).unwrap();
    println!("{}: {} x {}", path.display(), image.size[0], image.size[1]);
}

fn main() {
    let folder = PathBuf::from(env::args_os().nth(1).unwrap_or_else(|| "docs/figures/studio".into()));
    fs::create_dir_all(&folder).unwrap();
    let viewport = egui::ViewportBuilder::default().with_inner_size([1280.0, 800.0]).with_title("dioptric studio");
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
