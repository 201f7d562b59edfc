//! Files in and out: opened, dropped, saved, exported.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use dioptric_analysis::{Run, RunTimes};
use dioptric_optics::Lens;
use dioptric_pipeline::{
    Camera, KeptCamera, LensSpec, PipelineError, Quality, SceneSource, SceneSpec, SensorSpec, Staged, WorldSpec,
    write_file,
};
use dioptric_report::write_run;
use egui::Ui;

use super::{
    OPEN_ELSEWHERE, Studio, UNSAVED_IS_BACK,
    dialog::{FileDialog, Outcome, Purpose},
    finish::Waiting,
    panels::{self, Wanted},
};
use crate::{
    engine::Product,
    session::{Left, as_ron},
};

/// Endings of files that hold a world.
const WORLDS: [&str; 5] = ["pbrt", "gltf", "glb", "obj", "ply"];

fn ending(path: &Path) -> String {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase()
}

impl Studio {
    /// Opens files that were dropped on the window: cameras, lenses, sensors, scenes, worlds.
    pub(super) fn drops(&mut self, ui: &Ui) {
        let paths: Vec<PathBuf> =
            ui.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect());
        for path in paths {
            self.open(&path);
        }
    }

    /// Opens a file: a camera takes the place of the whole, a lens, a sensor, a scene or a world that of its part.
    pub fn open(&mut self, path: &Path) {
        let mut camera = self.session.camera().clone();
        match ending(path).as_str() {
            "ron" => match self.open_camera(path) {
                Ok(()) => return,
                // A file of the same ending may hold a lens or a sensor.
                Err(error) if SensorSpec::File(path.to_owned()).open().is_ok() => {
                    drop(error);
                    camera.sensor = SensorSpec::File(path.to_owned());
                }
                Err(error) if Lens::read(path).is_ok() => {
                    drop(error);
                    panels::lens::take_lens(&mut camera, LensSpec::File(path.to_owned()));
                }
                Err(error) => {
                    self.note = Some(error.to_string());
                    return;
                }
            },
            "zmx" | "seq" | "dat" | "json" => {
                panels::lens::take_lens(&mut camera, LensSpec::File(path.to_owned()));
            }
            _ => take_scene(&mut camera, path),
        }
        self.opened(path, camera);
    }

    /// Opens a camera file with what was left of it unsaved.
    fn open_camera(&mut self, path: &Path) -> Result<(), PipelineError> {
        self.keep_now();
        self.session.replace_by_file(path)?;
        self.remember(path);
        let left = self.autosave.as_ref().and_then(|autosave| autosave.left_of(path)).filter(Left::is_unsaved);
        if let Some(left) = left {
            self.session.change(left.document.camera, None);
            self.note = Some(UNSAVED_IS_BACK.to_owned());
        } else if self.autosave.as_ref().is_some_and(|autosave| autosave.is_open_elsewhere(path)) {
            self.note = Some(OPEN_ELSEWHERE.to_owned());
        }
        self.submit();
        Ok(())
    }

    /// Goes on with a camera that was left unsaved; the one on the desk can be gone back to.
    pub(super) fn recover(&mut self, left: Left) {
        self.keep_now();
        let Left { document, .. } = left;
        // Of a file that is gone the camera is all that there is.
        match document.path.as_deref().map(|path| self.session.replace_by_file(path)) {
            Some(Ok(())) => self.session.change(document.camera, None),
            Some(Err(_)) | None => self.session.begin(document.camera),
        }
        self.note = Some("the camera is as it was left; Undo goes back to the one before".to_owned());
        self.submit();
    }

    fn opened(&mut self, path: &Path, camera: Camera) {
        self.remember(path);
        self.note = Some(format!("opened {}", path.display()));
        self.take(camera, None);
    }

    fn remember(&self, path: &Path) {
        if let Some(autosave) = &self.autosave {
            autosave.remember(path);
        }
    }

    /// Begins to choose a file.
    pub(super) fn choose(&mut self, purpose: Purpose) {
        let of_camera = self.session.path().and_then(Path::parent);
        let folder = self.folder.clone().or_else(|| of_camera.map(Path::to_owned)).unwrap_or_default();
        let stem = self.session.path().and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
        let name = match purpose {
            Purpose::SaveCamera => stem.unwrap_or_else(|| "camera".to_owned()) + ".ron",
            Purpose::SaveLens => "lens.ron".to_owned(),
            Purpose::SavePicture => "picture.png".to_owned(),
            Purpose::Export => stem.unwrap_or_else(|| "dioptric".to_owned()) + "-out",
            _ => String::new(),
        };
        self.dialog = Some(FileDialog::new(purpose, &folder, &name));
    }

    /// Does what a panel asked for.
    pub(super) fn grant(&mut self, wanted: Wanted) {
        match wanted {
            Wanted::Lens => self.choose(Purpose::Lens),
            Wanted::LensOut => self.choose(Purpose::SaveLens),
            Wanted::Sensor => self.choose(Purpose::Sensor),
            Wanted::Scene => self.choose(Purpose::Scene),
            Wanted::BothMethods => self.compare_methods(),
        }
    }

    /// Draws the dialog, where one is open, and uses what is chosen.
    pub(super) fn dialogs(&mut self, ui: &Ui) {
        let Some(dialog) = &mut self.dialog else { return };
        let outcome = dialog.show(ui);
        let purpose = dialog.purpose;
        if outcome == Outcome::Open {
            return;
        }
        self.folder = Some(dialog.folder().to_owned());
        self.dialog = None;
        if let Outcome::Chosen(path) = outcome {
            self.use_file(purpose, &path);
        }
    }

    fn use_file(&mut self, purpose: Purpose, path: &Path) {
        let mut camera = self.session.camera().clone();
        match purpose {
            Purpose::Open => self.open(path),
            Purpose::Lens => {
                panels::lens::take_lens(&mut camera, LensSpec::File(path.to_owned()));
                self.opened(path, camera);
            }
            Purpose::Sensor => {
                camera.sensor = SensorSpec::File(path.to_owned());
                self.opened(path, camera);
            }
            Purpose::Scene => {
                take_scene(&mut camera, path);
                self.opened(path, camera);
            }
            Purpose::SaveCamera => self.save_as(path),
            Purpose::SaveLens => self.save_lens(path),
            Purpose::SavePicture => self.when_full(Waiting::Picture(path.to_owned())),
            Purpose::Export => self.when_full(Waiting::Export(path.to_owned())),
        }
    }

    /// Saves the camera where it came from, or asks where.
    pub(super) fn save(&mut self) {
        match self.session.path().map(Path::to_owned) {
            Some(path) if self.session.is_file_changed() => {
                self.note = Some(format!("{} was changed by another program: choose where to save", path.display()));
                self.choose(Purpose::SaveCamera);
            }
            Some(path) => self.save_as(&path),
            None => self.choose(Purpose::SaveCamera),
        }
    }

    fn save_as(&mut self, path: &Path) {
        self.note = Some(match self.session.save(path) {
            Ok(()) => {
                self.remember(path);
                self.unsaved.get_or_insert_with(Instant::now);
                format!("saved {}", path.display())
            }
            Err(error) => error.to_string(),
        });
    }

    /// Writes the lens as a file of its own, which the camera then names.
    fn save_lens(&mut self, path: &Path) {
        let mut camera = self.session.camera().clone();
        let written = camera.lens.open(&camera.lens_reading).and_then(|file| {
            let text = file.to_ron() + "\n";
            Ok(dioptric_files::write(path, text.as_bytes())?)
        });
        match written {
            Ok(()) => {
                // What was read with these options is whole in the new file.
                (camera.lens, camera.lens_reading) = (LensSpec::File(path.to_owned()), Default::default());
                self.opened(path, camera);
                self.note = Some(format!("saved {}; the camera has the lens from there", path.display()));
            }
            Err(error) => self.note = Some(error.to_string()),
        }
    }

    /// Writes what waited for this full picture.
    pub(super) fn write_full(&mut self, product: &Arc<Product>, waiting: Waiting) {
        match waiting {
            Waiting::Picture(path) => {
                let written = product
                    .png()
                    .map_err(|error| error.to_string())
                    .and_then(|png| dioptric_files::write(&path, &png).map_err(|error| error.to_string()));
                self.note = Some(written.map_or_else(|error| error, |()| format!("saved {}", path.display())));
            }
            Waiting::Export(folder) => self.export(product.clone(), folder),
        }
    }

    /// Writes the files of a run into a folder, on a thread of its own.
    fn export(&mut self, product: Arc<Product>, folder: PathBuf) {
        let work_s = self.work_s();
        self.note = Some(format!("writing {}", folder.display()));
        self.exports.ask(move || match export(&product, &folder, work_s) {
            Ok(files) => format!("{}: {files}", folder.display()),
            Err(error) => error.to_string(),
        });
    }

    /// How long the latest picture took, s.
    fn work_s(&self) -> f64 {
        self.results.as_ref().map_or(0.0, |results| results.delivery.work.as_secs_f64())
    }
}

/// Puts a scene or a world before the camera.
fn take_scene(camera: &mut Camera, path: &Path) {
    camera.scene = SceneSpec::of_file(path.to_owned());
    if WORLDS.contains(&ending(path).as_str()) {
        camera.scene.source = SceneSource::World(WorldSpec::of_file(path.to_owned()));
    }
}

/// Writes report, picture and frames as `dioptric run` does, and the camera file; returns the names of the files.
fn export(product: &Product, folder: &Path, work_s: f64) -> Result<String, PipelineError> {
    let staged = Staged::folder(folder)?;
    let run = Run { capture: &product.capture, model: &product.model, depth: Some(&product.depth) };
    let times = || RunTimes { stages_s: vec![("full picture".to_owned(), work_s)], imaging_s: Vec::new() };
    write_run(&run, staged.path(), &times)?;
    write_file(&staged.path().join("camera.ron"), as_ron(product.camera()).as_bytes())?;
    if product.camera().outputs.irradiance {
        let kept = KeptCamera::new(product.camera().clone()).with_quality(Quality::Full);
        kept.write_resume_file(&product.capture, staged.path())?;
    }
    let names = std::fs::read_dir(staged.path()).into_iter().flatten().flatten();
    let mut names: Vec<String> = names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    staged.commit()?;
    Ok(names.join(", "))
}
