//! The window: the camera at the left, its picture in the middle, what else there is to know of it beneath.
//!
//! [`Studio::ui`] draws one frame of it into any place of egui's; the program `dioptric-studio` is a shell of a few lines around it.
//! Nothing here computes a picture: panels change the camera of the [`Session`], the engine delivers, views show.

mod bar;
mod dialog;
mod fields;
mod files;
mod finish;
mod keys;
mod methods;
mod middle;
mod panels;
mod typed;
mod views;

use std::{
    cell::Cell,
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use dioptric_analysis::measure::NoiseData;
use dioptric_pipeline::{Camera, SensorSpec};
use dioptric_sensor::EdgeResponse;
use egui::{
    CentralPanel, Context, Panel, TextureHandle, TextureOptions, Ui,
    epaint::text::{FontInsert, FontPriority, InsertFontFamily},
};

use crate::{
    engine::{
        Asker, Delivery, Engine, EngineSettings, Fault, LensAnswer, LensQuestion, Probe, Product, Rung, Spread,
        sensor_answer,
    },
    session::{Autosave, Left, Session, Snapshot},
};

use self::{
    dialog::FileDialog,
    finish::Finish,
    methods::Comparison,
    panels::Desk,
    views::{camera_file::CameraText, images, picture},
};

pub use self::views::images::Shown;

/// How long a camera stays unsaved at most while it is changed.
const AUTOSAVE: Duration = Duration::from_millis(500);
/// How often progress is drawn.
const TICK: Duration = Duration::from_millis(50);
/// What a window is started with.
#[derive(Clone, Debug, Default)]
pub struct StudioSettings {
    /// What the engine is started with.
    pub engine: EngineSettings,
    /// Where the camera is kept at every change; nowhere if left out.
    pub autosave: Option<Autosave>,
    /// The camera file to open; without it the camera is as it was left, else the demo.
    pub camera: Option<PathBuf>,
}

/// What fills the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// The picture.
    #[default]
    Picture,
    /// The lens bench.
    LensBench,
    /// The sensor bench.
    SensorBench,
    /// The camera file as text.
    CameraFile,
}

/// The results that are shown.
#[derive(Clone, Debug)]
struct Results {
    delivery: Delivery,
    product: Arc<Product>,
    /// Counts all results of the window.
    number: u64,
}

impl Results {
    /// A number that tells these results from others.
    fn stamp(&self) -> u64 {
        self.number
    }
}

/// An image on the screen, and of what it was made.
struct Texture {
    key: (u64, Shown, u64),
    handle: TextureHandle,
    words: String,
}

/// The edge that was marked on the picture, and of which results.
#[derive(Clone, Debug)]
struct MarkedEdge {
    stamp: u64,
    region: [[f64; 2]; 2],
    response: Result<EdgeResponse, String>,
}

/// The window.
pub struct Studio {
    session: Session,
    engine: Engine,
    autosave: Option<Autosave>,
    unsaved: Option<Instant>,
    /// The number of the camera that was submitted last.
    generation: u64,
    is_paused: bool,
    results: Option<Results>,
    fault: Option<Fault>,
    /// Pictures of the cameras that are the snapshots, the best that there are.
    snapshots: [Option<Arc<Product>>; 2],
    /// What waits for a full picture, and who takes those of other cameras than that on the desk.
    finish: Finish,
    /// What the window is called.
    title: String,
    tab: Tab,
    shown: Shown,
    wavelength_nm: f64,
    placement: picture::Placement,
    texture: Option<Texture>,
    hover: Option<Probe>,
    cursor: [f64; 2],
    spreads: Asker<Option<Spread>>,
    spread: Option<(Spread, TextureHandle)>,
    spread_of: Option<(u64, [u64; 2])>,
    lens_answers: Asker<Result<LensAnswer, String>>,
    lens_answer: Option<Result<LensAnswer, String>>,
    lens_answer_of: Option<u64>,
    sensor_answers: Asker<Result<NoiseData, String>>,
    sensor_answer: Option<Result<NoiseData, String>>,
    sensor_answer_of: Option<SensorSpec>,
    region: Option<[[f64; 2]; 2]>,
    edge: Option<MarkedEdge>,
    camera_text: CameraText,
    dialog: Option<FileDialog>,
    /// Where a file was chosen last.
    folder: Option<PathBuf>,
    /// What came of writing files.
    exports: Asker<String>,
    comparison: Option<Comparison>,
    /// What was done last, or could not be.
    note: Option<String>,
}

impl std::fmt::Debug for Studio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Studio").field("session", &self.session).field("engine", &self.engine).finish_non_exhaustive()
    }
}

impl Studio {
    /// Starts the engine and submits the first camera. What is wrong with a file that cannot be opened is shown in the window.
    ///
    /// # Errors
    /// When the system starts no thread.
    pub fn new(context: &Context, settings: StudioSettings) -> io::Result<Self> {
        let StudioSettings { engine, autosave, camera } = settings;
        add_signs(context);
        let Opened { session, note, view } = opened(camera.as_deref(), autosave.as_ref());
        let (tab, shown) = view.as_deref().map_or_else(Default::default, view_of);
        let wake = |context: &Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let mut studio = Self {
            session,
            finish: Finish::start(engine.clone(), wake(context))?,
            engine: Engine::start(engine, wake(context))?,
            autosave,
            unsaved: None,
            generation: 0,
            is_paused: false,
            results: None,
            fault: None,
            snapshots: [None, None],
            title: String::new(),
            tab,
            shown,
            wavelength_nm: 550.0,
            placement: picture::Placement::default(),
            texture: None,
            hover: None,
            cursor: [0.5; 2],
            spreads: Asker::start(wake(context)),
            spread: None,
            spread_of: None,
            lens_answers: Asker::start(wake(context)),
            lens_answer: None,
            lens_answer_of: None,
            sensor_answers: Asker::start(wake(context)),
            sensor_answer: None,
            sensor_answer_of: None,
            region: None,
            edge: None,
            camera_text: CameraText::default(),
            dialog: None,
            folder: None,
            exports: Asker::start(wake(context)),
            comparison: None,
            note,
        };
        studio.submit();
        // What was opened is no change yet.
        studio.unsaved = None;
        Ok(studio)
    }

    /// The camera, and what can be taken back.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The latest results; those of the present camera once [`is_settled`](Self::is_settled).
    pub fn product(&self) -> Option<&Product> {
        self.results.as_ref().map(|results| &*results.product)
    }

    /// What is wrong with the camera, if something is.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// Whether the full picture of the present camera is shown, or what is wrong with it.
    pub fn is_settled(&self) -> bool {
        let of_results =
            |results: &Results| results.delivery.generation == self.generation && results.delivery.rung == Rung::Full;
        self.fault.is_some() || self.results.as_ref().is_some_and(of_results)
    }

    /// Chooses what fills the middle.
    pub fn show_tab(&mut self, tab: Tab, shown: Shown) {
        (self.tab, self.shown) = (tab, shown);
    }

    /// Changes the camera as a panel does.
    pub fn change(&mut self, change: impl FnOnce(&mut Camera)) {
        let mut camera = self.session.camera().clone();
        change(&mut camera);
        self.take(camera, None);
    }

    /// Keeps the camera and its picture as a snapshot.
    pub fn keep_snapshot(&mut self, which: Snapshot) {
        self.session.keep_snapshot(which);
        let of_camera = |product: &Arc<Product>| product.camera() == self.session.camera();
        // Pictures on their way to that of the camera are of others.
        self.snapshots[which as usize] = self.results.as_ref().map(|results| results.product.clone()).filter(of_camera);
        self.unsaved.get_or_insert_with(Instant::now);
    }

    /// Draws one frame of the window.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.receive(ui.ctx());
        self.keys(ui);
        self.drops(ui);
        let before = self.session.camera().clone();
        let mut camera = before.clone();
        Panel::top("bar").show(ui, |ui| self.bar(ui));
        Panel::bottom("notes").show(ui, |ui| self.notes(ui, &mut camera));
        let mut wanted = None;
        Panel::left("camera").default_size(330.0).size_range(280.0..=520.0).show(ui, |ui| {
            let product = self.results.as_ref().map(|results| &*results.product);
            let stamp = self.results.as_ref().map_or(0, Results::stamp);
            let desk = Desk { fault: self.fault.as_ref(), product, stamp, wanted: Cell::new(None) };
            panels::show(ui, &mut camera, &desk);
            wanted = desk.wanted.get();
        });
        Panel::bottom("charts")
            .default_size(190.0)
            .size_range(120.0..=420.0)
            .resizable(true)
            .show(ui, |ui| self.charts(ui));
        CentralPanel::default().show(ui, |ui| self.middle(ui, &mut camera));
        let gesture = ui.ctx().dragged_id().or_else(|| ui.memory(|memory| memory.focused())).map(|id| id.value());
        // A camera that was opened or gone back to meanwhile is not what the panels changed.
        if *self.session.camera() == before {
            self.take(camera, gesture);
        }
        if gesture.is_none() {
            self.session.end_gesture();
        }
        if let Some(wanted) = wanted {
            self.grant(wanted);
        }
        self.dialogs(ui);
        self.keep(ui.ctx());
        self.name_window(ui.ctx());
        if self.engine.is_busy() || self.finish.is_busy() {
            ui.ctx().request_repaint_after(TICK);
        }
    }

    /// Takes a changed camera over and has its pictures taken.
    fn take(&mut self, camera: Camera, gesture: Option<u64>) {
        if camera != *self.session.camera() {
            self.session.change(camera, gesture);
            self.submit();
        }
    }

    fn submit(&mut self) {
        if !self.is_paused {
            self.fault = None;
            self.generation = self.engine.submit(self.session.camera().clone(), Rung::Full);
        }
        self.unsaved.get_or_insert_with(Instant::now);
    }

    /// Takes what the engine and the askers have to deliver.
    fn receive(&mut self, context: &Context) {
        for delivery in self.engine.take() {
            match delivery.outcome.clone() {
                Ok(product) => {
                    self.improve(&product);
                    let number = self.results.as_ref().map_or(1, |results| results.number + 1);
                    self.results = Some(Results { delivery, product, number });
                }
                // What is wrong with an older camera is no matter.
                Err(fault) if delivery.generation == self.generation => self.fault = Some(fault),
                Err(_) => {}
            }
        }
        if let Some(Some(spread)) = self.spreads.answer() {
            let image = images::of_linear(&spread.rgb, spread.side);
            let handle = context.load_texture("spread", image, TextureOptions::NEAREST);
            self.spread = Some((spread, handle));
        }
        if let Some(answer) = self.lens_answers.answer() {
            self.lens_answer = Some(answer);
        }
        if let Some(answer) = self.sensor_answers.answer() {
            self.sensor_answer = Some(answer);
        }
        if let Some(words) = self.exports.answer() {
            self.note = Some(words);
        }
        self.go_on_comparing();
        self.finish();
        self.ask();
    }

    /// Names the window after the camera's file.
    fn name_window(&mut self, context: &Context) {
        let title = self.session.title();
        if title != self.title {
            context.send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    /// Asks what the visible views need.
    fn ask(&mut self) {
        let Some(results) = &self.results else { return };
        let stamp = results.stamp();
        let spread_of = (stamp, self.cursor.map(f64::to_bits));
        if self.spread_of != Some(spread_of) {
            self.spread_of = Some(spread_of);
            let (product, cursor) = (results.product.clone(), self.cursor);
            self.spreads.ask(move || product.spread(cursor));
        }
        if let Some(region) = self.region
            && self.edge.as_ref().is_none_or(|edge| (edge.stamp, edge.region) != (stamp, region))
        {
            self.edge = Some(MarkedEdge { stamp, region, response: results.product.edge(region) });
        }
        // Rays do not depend on the rung, but the film's corner moves by a part of a pixel.
        if self.tab == Tab::LensBench && self.lens_answer_of != Some(stamp) {
            self.lens_answer_of = Some(stamp);
            let question = LensQuestion::of(&results.product);
            self.lens_answers.ask(move || question.answer().map_err(|error| error.to_string()));
        }
        if self.tab == Tab::SensorBench && self.sensor_answer_of.as_ref() != Some(&results.product.camera().sensor) {
            let sensor = results.product.camera().sensor.clone();
            self.sensor_answer_of = Some(sensor.clone());
            self.sensor_answers.ask(move || sensor_answer(&sensor).map_err(|error| error.to_string()));
        }
    }

    /// Keeps the camera once it has been unsaved for a while.
    fn keep(&mut self, context: &Context) {
        let Some(since) = self.unsaved else { return };
        if since.elapsed() < AUTOSAVE {
            context.request_repaint_after(AUTOSAVE);
            return;
        }
        self.keep_now();
    }

    /// Keeps the camera as it stands, if it was changed since it was kept: before another takes its place, and at the end.
    fn keep_now(&mut self) {
        if self.unsaved.take().is_none() {
            return;
        }
        if let Some(autosave) = &self.autosave {
            let view = format!("{:?} {:?}", self.tab, self.shown);
            if !autosave.keep(&self.session.left(view)) {
                self.note = Some("the camera cannot be kept in the user's folder of states".to_owned());
            }
        }
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        self.keep_now();
    }
}

/// Returns the tab and the picture that were looked at, in words that [`Studio`] left.
fn view_of(words: &str) -> (Tab, Shown) {
    let mut words = words.split(' ');
    let (tab, shown) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let tabs = [Tab::Picture, Tab::LensBench, Tab::SensorBench, Tab::CameraFile];
    let tab = tabs.into_iter().find(|own| format!("{own:?}") == tab);
    let shown = Shown::ALL.into_iter().map(|(own, _)| own).find(|own| format!("{own:?}") == shown);
    (tab.unwrap_or_default(), shown.unwrap_or_default())
}

/// Adds a font for the signs that egui's own lacks.
fn add_signs(context: &Context) {
    let families = [egui::FontFamily::Proportional, egui::FontFamily::Monospace];
    let families = families.map(|family| InsertFontFamily { family, priority: FontPriority::Lowest });
    let font = egui::FontData::from_static(dejavu::sans::regular());
    context.add_font(FontInsert::new("DejaVu Sans", font, families.to_vec()));
}

/// The session to start with, what there is to tell of it, and what was looked at.
struct Opened {
    session: Session,
    note: Option<String>,
    view: Option<String>,
}

/// Returns the session to start with: of a file with what was left of it unsaved, else as the last window left it, else of the demo.
fn opened(camera: Option<&Path>, autosave: Option<&Autosave>) -> Opened {
    let fallback = |note: Option<String>| {
        let demo = Camera::demo().unwrap_or_else(|error| unreachable!("the demo is a camera: {error}"));
        Opened { session: Session::new(demo), note, view: None }
    };
    let Some(path) = camera else {
        return match autosave.and_then(Autosave::left) {
            Some(left) => {
                let view = Some(left.view.clone());
                Opened { session: Session::resume(left), note: Some("the camera is as it was left".to_owned()), view }
            }
            None => fallback(None),
        };
    };
    match Session::open(path) {
        Ok(mut session) => {
            if let Some(autosave) = autosave {
                autosave.remember(path);
            }
            let left = autosave.and_then(|autosave| autosave.left_of(path)).filter(Left::is_unsaved);
            let is_elsewhere = autosave.is_some_and(|autosave| autosave.is_open_elsewhere(path));
            let note = left.map(|left| {
                session.change(left.document.camera, None);
                UNSAVED_IS_BACK.to_owned()
            });
            let note = note.or(is_elsewhere.then(|| OPEN_ELSEWHERE.to_owned()));
            Opened { session, note, view: None }
        }
        Err(error) => fallback(Some(error.to_string())),
    }
}

/// What is told where two windows have one file open.
const OPEN_ELSEWHERE: &str =
    "another window has this file open: each keeps its own changes, and whoever saves last has the file";

/// What is told where changes that were never saved are back.
const UNSAVED_IS_BACK: &str = "changes that were not saved are back; Undo goes to the camera of the file";
