//! The window: the camera at the left, its picture in the middle, what else there is to know of it beneath.
//!
//! [`Studio::ui`] draws one frame of it into any place of egui's; the program `dioptric-studio` is a shell of a few lines around it.
//! Nothing here computes a picture: panels change the camera of the [`Session`], the engine delivers, views show.

mod bar;
mod fields;
mod panels;
mod views;

use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use dioptric_analysis::measure::NoiseData;
use dioptric_pipeline::{Camera, FocusSpec, SceneSpec, SensorSpec};
use egui::{
    CentralPanel, Context, Key, Modifiers, Panel, TextureHandle, TextureOptions, Ui,
    epaint::text::{FontInsert, FontPriority, InsertFontFamily},
};

use crate::{
    engine::{
        Asker, Delivery, Engine, EngineSettings, Fault, LensAnswer, LensQuestion, Probe, Product, Rung, Spread,
        sensor_answer,
    },
    session::{Autosave, Session, Snapshot},
};

use self::{
    panels::Desk,
    views::{images, picture},
};

pub use self::views::images::Shown;

/// How long a camera stays unsaved at most while it is changed.
const AUTOSAVE: Duration = Duration::from_millis(500);
/// How often progress is drawn.
const TICK: Duration = Duration::from_millis(50);
/// Amplification of the difference of A and B.
const DIFFERENCE_GAIN: f32 = 4.0;

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
}

/// The results that are shown.
#[derive(Clone, Debug)]
struct Results {
    delivery: Delivery,
    product: Arc<Product>,
}

impl Results {
    /// A number that tells these results from others.
    fn stamp(&self) -> u64 {
        4 * self.delivery.generation + self.delivery.rung.number() as u64
    }
}

/// An image on the screen, and of what it was made.
struct Texture {
    key: (u64, Shown, u64),
    handle: TextureHandle,
    words: String,
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
    /// Full pictures of the snapshots.
    snapshots: [Option<Arc<Product>>; 2],
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
    path: String,
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
        let (session, note) = opened(camera.as_deref(), autosave.as_ref());
        let wake = |context: &Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let mut studio = Self {
            path: session.path().map(|path| path.display().to_string()).unwrap_or_default(),
            session,
            engine: Engine::start(engine, wake(context))?,
            autosave,
            unsaved: None,
            generation: 0,
            is_paused: false,
            results: None,
            fault: None,
            snapshots: [None, None],
            tab: Tab::default(),
            shown: Shown::default(),
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
            note,
        };
        studio.submit();
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
        self.snapshots[which as usize] = self.results.as_ref().map(|results| results.product.clone());
    }

    /// Draws one frame of the window.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.receive(ui.ctx());
        self.keys(ui);
        self.drops(ui);
        let before = self.session.camera().clone();
        let mut camera = before.clone();
        Panel::top("bar").show(ui, |ui| self.bar(ui, &mut camera));
        Panel::bottom("notes").show(ui, |ui| self.notes(ui, &mut camera));
        Panel::left("camera").default_size(330.0).size_range(280.0..=520.0).show(ui, |ui| {
            let product = self.results.as_ref().map(|results| &*results.product);
            let stamp = self.results.as_ref().map_or(0, Results::stamp);
            panels::show(ui, &mut camera, &Desk { fault: self.fault.as_ref(), product, stamp });
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
        self.keep(ui.ctx());
        if self.engine.is_busy() {
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
                Ok(product) => self.results = Some(Results { delivery, product }),
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
        self.ask();
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
        // Rays know nothing of rungs, but the film's corner moves by a part of a pixel.
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
        self.unsaved = None;
        if let Some(autosave) = &self.autosave
            && !autosave.keep(self.session.camera())
        {
            self.note = Some("the camera cannot be kept in the user's folder of states".to_owned());
        }
    }

    fn middle(&mut self, ui: &mut Ui, camera: &mut Camera) {
        ui.horizontal(|ui| {
            for (tab, name) in
                [(Tab::Picture, "Film"), (Tab::LensBench, "Lens bench"), (Tab::SensorBench, "Sensor bench")]
            {
                ui.selectable_value(&mut self.tab, tab, name);
            }
            ui.separator();
            if self.tab == Tab::Picture {
                for (shown, name) in Shown::ALL {
                    ui.selectable_value(&mut self.shown, shown, name);
                }
            }
        });
        match self.tab {
            Tab::Picture => self.picture(ui, camera),
            Tab::LensBench => match &self.lens_answer {
                Some(Ok(answer)) => views::lens_bench::show(ui, answer),
                Some(Err(words)) => fields::wrong(ui, words),
                None => drop(ui.weak("The lens is being analyzed.")),
            },
            Tab::SensorBench => self.sensor_bench(ui),
        }
    }

    fn sensor_bench(&mut self, ui: &mut Ui) {
        let edge = self.region.zip(self.results.as_ref()).map(|(region, results)| results.product.edge(region));
        let noise = match &self.sensor_answer {
            Some(Err(words)) => {
                fields::wrong(ui, words);
                None
            }
            Some(Ok(noise)) => Some(noise),
            None => None,
        };
        views::sensor_bench::show(ui, noise, edge.as_ref());
    }

    fn picture(&mut self, ui: &mut Ui, camera: &mut Camera) {
        let Some(results) = self.results.clone() else {
            ui.centered_and_justified(|ui| {
                if self.fault.is_none() {
                    ui.spinner();
                }
            });
            return;
        };
        if self.shown == Shown::Irradiance {
            self.wavelengths(ui, &results.product);
        }
        let Some(texture) = self.texture(ui.ctx(), &results) else {
            ui.weak("Keep two pictures of one size as A and B: their difference is shown here.");
            return;
        };
        let (handle, words) = (texture.handle.clone(), texture.words.clone());
        ui.horizontal(|ui| {
            if ui.button("Fit").on_hover_text("The whole picture (F); a double click does the same").clicked() {
                self.placement = picture::Placement::default();
            }
            if ui
                .button("100 %")
                .on_hover_text("A pixel of the film is a pixel of the screen (1); the wheel zooms, dragging moves")
                .clicked()
            {
                self.placement.zoom = Some(1.0 / ui.ctx().pixels_per_point());
            }
            ui.small(words);
        });
        let place = &results.product.capture.place;
        let film = [place.columns * place.binning, place.rows * place.binning];
        let marks = picture::Marks { cursor: Some(self.cursor), region: self.region };
        let pointed = picture::show(ui, &mut self.placement, &handle, film, &marks);
        self.hover = pointed.hover.and_then(|share| results.product.probe(share));
        if let Some(share) = pointed.click {
            self.cursor = share;
            if let Some(mm) = results.product.focus_distance_mm(share) {
                camera.focus = FocusSpec::DistanceMm((10.0 * mm).round() / 10.0);
            }
        }
        if let Some(share) = pointed.hover.filter(|_| ui.input(|input| input.modifiers.ctrl)) {
            self.cursor = share;
        }
        if pointed.dragged.is_some() {
            self.region = pointed.dragged;
        }
    }

    fn wavelengths(&mut self, ui: &mut Ui, product: &Product) {
        let (first_nm, last_nm) = product.capture.grid().range_nm();
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = 260.0;
            let slider = egui::Slider::new(&mut self.wavelength_nm, first_nm..=last_nm).suffix(" nm").fixed_decimals(0);
            ui.add(slider)
                .accessible_name("wavelength")
                .on_hover_text("The nearest band is shown; the full picture has all of them");
        });
    }

    /// Returns the image that is shown, made now where it is not at hand.
    fn texture(&mut self, context: &Context, results: &Results) -> Option<&Texture> {
        let product = &results.product;
        let of_snapshots = || self.snapshots.iter().flatten().map(|product| Arc::as_ptr(product).addr() as u64).sum();
        let detail = match self.shown {
            Shown::Irradiance => self.wavelength_nm.to_bits(),
            Shown::Difference => of_snapshots(),
            _ => 0,
        };
        let key = (results.stamp(), self.shown, detail);
        if self.texture.as_ref().is_none_or(|texture| texture.key != key) {
            let (image, words) = match self.shown {
                Shown::Picture => (images::picture(product), String::new()),
                Shown::Raw => (images::raw(product), "raw samples from black to saturation".to_owned()),
                Shown::Irradiance => {
                    let (image, nm) = images::irradiance(product, self.wavelength_nm);
                    (image, format!("irradiance at {nm:.0} nm, full scale its brightest pixel"))
                }
                Shown::Depth => {
                    let (near_m, far_m) = product.depth.range_m();
                    (
                        images::depth(product),
                        format!("depth of the scene, {near_m:.2} m (yellow) to {far_m:.2} m (violet)"),
                    )
                }
                Shown::Difference => {
                    let [Some(a), Some(b)] = &self.snapshots else { return None };
                    let image = images::difference(a, b, DIFFERENCE_GAIN)?;
                    let rms = 100.0 * images::difference_rms(a, b)?;
                    (image, format!("A − B about gray, {DIFFERENCE_GAIN} times; rms {rms:.2} % of full scale"))
                }
            };
            let options = TextureOptions { magnification: egui::TextureFilter::Nearest, ..TextureOptions::LINEAR };
            let handle = context.load_texture("picture", image, options);
            self.texture = Some(Texture { key, handle, words });
        }
        self.texture.as_ref()
    }

    fn charts(&mut self, ui: &mut Ui) {
        let Some(results) = self.results.clone() else { return };
        let spread = self.spread.as_ref();
        ui.columns(4, |columns| {
            let [of_spread, of_modulation, of_histogram, of_light] = columns else { return };
            of_spread.strong("Point spread at +");
            views::charts::spread(of_spread, spread.map(|(_, texture)| texture), spread.map(|(spread, _)| spread));
            of_modulation.strong("Modulation at +");
            views::charts::modulation(of_modulation, spread.map(|(spread, _)| spread));
            of_histogram.strong("Histogram, raw");
            views::charts::histogram(of_histogram, &results.product);
            of_light.strong("Light");
            views::charts::light(of_light, &results.product);
        });
    }

    /// Takes keys that hold wherever the pointer is, but not while something is typed.
    fn keys(&mut self, ui: &Ui) {
        let pressed = |modifiers: Modifiers, key: Key| ui.input_mut(|input| input.consume_key(modifiers, key));
        let redo = pressed(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || pressed(Modifiers::COMMAND, Key::Y);
        if redo {
            self.redo();
        } else if pressed(Modifiers::COMMAND, Key::Z) {
            self.undo();
        }
        if pressed(Modifiers::COMMAND, Key::S) {
            self.save();
        }
        if pressed(Modifiers::COMMAND, Key::O) {
            self.open_typed();
        }
        if ui.memory(|memory| memory.focused()).is_some() {
            return;
        }
        let plain = |key| pressed(Modifiers::NONE, key);
        if plain(Key::Space) {
            self.pause();
        }
        if plain(Key::A) {
            self.recall(Snapshot::A);
        }
        if plain(Key::B) {
            self.recall(Snapshot::B);
        }
        if plain(Key::F) {
            self.placement = picture::Placement::default();
        }
        if plain(Key::Num1) {
            self.placement.zoom = Some(1.0 / ui.ctx().pixels_per_point());
        }
        for (key, tab) in [(Key::F1, Tab::Picture), (Key::F2, Tab::LensBench), (Key::F3, Tab::SensorBench)] {
            if plain(key) {
                self.tab = tab;
            }
        }
    }

    /// Opens files that were dropped on the window: cameras, lenses, sensors, scenes, worlds.
    fn drops(&mut self, ui: &Ui) {
        let paths: Vec<PathBuf> =
            ui.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect());
        for path in paths {
            self.open(&path);
        }
    }

    /// Opens a file: a camera takes the place of the whole, a lens, a sensor, a scene or a world that of its part.
    pub fn open(&mut self, path: &Path) {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        let mut camera = self.session.camera().clone();
        match ending.as_str() {
            "ron" => match self.session.replace_by_file(path) {
                Ok(()) => {
                    self.path = path.display().to_string();
                    self.remember(path);
                    self.submit();
                    return;
                }
                // A file of the same ending may hold a lens or a sensor.
                Err(error) if SensorSpec::File(path.to_owned()).open().is_ok() => {
                    drop(error);
                    camera.sensor = SensorSpec::File(path.to_owned());
                }
                Err(error) if dioptric_optics::Lens::read(path).is_ok() => {
                    drop(error);
                    panels::lens::take_lens(&mut camera, &path.display().to_string());
                }
                Err(error) => {
                    self.note = Some(error.to_string());
                    return;
                }
            },
            "zmx" | "seq" | "dat" | "json" => panels::lens::take_lens(&mut camera, &path.display().to_string()),
            "pbrt" | "gltf" | "glb" | "obj" | "ply" => {
                camera.scene = SceneSpec::of_file(path.to_owned());
                camera.scene.source =
                    dioptric_pipeline::SceneSource::World(dioptric_pipeline::WorldSpec::of_file(path.to_owned()));
            }
            _ => camera.scene = SceneSpec::of_file(path.to_owned()),
        }
        self.note = Some(format!("opened {}", path.display()));
        self.take(camera, None);
    }

    fn remember(&self, path: &Path) {
        if let Some(autosave) = &self.autosave {
            autosave.remember(path);
        }
    }

    fn undo(&mut self) {
        if self.session.undo() {
            self.submit();
        }
    }

    fn redo(&mut self) {
        if self.session.redo() {
            self.submit();
        }
    }

    fn recall(&mut self, which: Snapshot) {
        if self.session.recall(which) {
            self.submit();
        }
    }

    fn pause(&mut self) {
        self.is_paused = !self.is_paused;
        if self.is_paused {
            self.engine.stop();
        } else {
            self.submit();
        }
    }

    fn open_typed(&mut self) {
        let path = PathBuf::from(self.path.trim());
        self.open(&path);
    }

    fn save(&mut self) {
        let typed = self.path.trim();
        let path = PathBuf::from(if typed.is_empty() { "camera.ron" } else { typed });
        self.note = Some(match self.session.save(&path) {
            Ok(()) => {
                self.remember(&path);
                format!("saved {}", path.display())
            }
            Err(error) => error.to_string(),
        });
        self.path = path.display().to_string();
    }
}

/// Adds a font for the signs that egui's own lacks.
fn add_signs(context: &Context) {
    let families = [egui::FontFamily::Proportional, egui::FontFamily::Monospace];
    let families = families.map(|family| InsertFontFamily { family, priority: FontPriority::Lowest });
    let font = egui::FontData::from_static(dejavu::sans::regular());
    context.add_font(FontInsert::new("DejaVu Sans", font, families.to_vec()));
}

/// Returns the session to start with, and what there is to tell of it.
fn opened(camera: Option<&Path>, autosave: Option<&Autosave>) -> (Session, Option<String>) {
    let demo = || Camera::demo().map(Session::new);
    let fallback = |words: Option<String>| {
        let session = demo().unwrap_or_else(|error| unreachable!("the demo is a camera: {error}"));
        (session, words)
    };
    match camera {
        Some(path) => match Session::open(path) {
            Ok(session) => {
                if let Some(autosave) = autosave {
                    autosave.remember(path);
                }
                (session, None)
            }
            Err(error) => fallback(Some(error.to_string())),
        },
        None => match autosave.and_then(Autosave::camera) {
            Some(camera) => (Session::new(camera), Some("the camera is as it was left".to_owned())),
            None => fallback(None),
        },
    }
}
