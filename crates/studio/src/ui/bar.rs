//! The bar above and the notes below.

use std::path::PathBuf;

use dioptric_pipeline::{Camera, write_capture};
use egui::{Button, ProgressBar, RichText, Ui};

use super::{Studio, fields};
use crate::{
    engine::{Field, Probe, Rung, three},
    session::{Autosave, Snapshot, as_command, as_python, as_ron, presets, write_beside},
};

impl Studio {
    /// The bar above: files, undo, snapshots, pause, copies.
    pub(super) fn bar(&mut self, ui: &mut Ui, camera: &mut Camera) {
        ui.horizontal_wrapped(|ui| {
            self.files(ui);
            ui.separator();
            let history = self.session.history();
            let (n_past, n_future) = (history.n_past(), history.n_future());
            if ui
                .add_enabled(n_past > 0, Button::new("Undo"))
                .on_hover_text(format!("{n_past} changes (Ctrl-Z)"))
                .clicked()
            {
                self.undo();
            }
            if ui
                .add_enabled(n_future > 0, Button::new("Redo"))
                .on_hover_text(format!("{n_future} changes (Ctrl-Y)"))
                .clicked()
            {
                self.redo();
            }
            ui.separator();
            self.compare(ui);
            ui.separator();
            let words = if self.is_paused { "Go on" } else { "Pause" };
            if ui.button(words).on_hover_text("Changes without pictures (Space)").clicked() {
                self.pause();
            }
            self.copies(ui);
            ui.menu_button("Presets", |ui| {
                for preset in presets() {
                    if ui.button(preset.name).on_hover_text(preset.words).clicked()
                        && let Ok(other) = preset.camera()
                    {
                        *camera = other;
                        ui.close();
                    }
                }
            });
            let is_dark = ui.visuals().dark_mode;
            if ui.button(if is_dark { "Light" } else { "Dark" }).on_hover_text("Colors of the window").clicked() {
                ui.ctx().set_theme(if is_dark { egui::Theme::Light } else { egui::Theme::Dark });
            }
            self.progress(ui);
        });
    }

    fn files(&mut self, ui: &mut Ui) {
        let mark = if self.session.is_changed() { "Camera •" } else { "Camera" };
        ui.menu_button(mark, |ui| {
            ui.set_min_width(420.0);
            ui.label("Camera file, or any lens, sensor, scene or world:");
            let edit = egui::TextEdit::singleline(&mut self.path).desired_width(400.0).hint_text("camera.ron");
            ui.add(edit).accessible_name("path of the file");
            ui.horizontal(|ui| {
                if ui.button("Open").on_hover_text("Ctrl-O; files can be dropped on the window too").clicked() {
                    self.open_typed();
                    ui.close();
                }
                if ui.button("Save").on_hover_text("Ctrl-S").clicked() {
                    self.save();
                    ui.close();
                }
                if ui
                    .button("Export results beside it")
                    .on_hover_text("picture, irradiance, volts, raw: the files of dioptric run")
                    .clicked()
                {
                    self.export();
                    ui.close();
                }
            });
            let recent: Vec<PathBuf> = self.autosave.as_ref().map(Autosave::recent).unwrap_or_default();
            for path in recent {
                if ui.button(path.display().to_string()).clicked() {
                    self.open(&path);
                    ui.close();
                }
            }
        });
    }

    fn compare(&mut self, ui: &mut Ui) {
        for (which, name, key) in [(Snapshot::A, "A", "A"), (Snapshot::B, "B", "B")] {
            let is_here = self.session.snapshot(which) == Some(self.session.camera());
            let is_kept = self.session.snapshot(which).is_some();
            let words = format!("Go to snapshot {name} (key {key})");
            if ui.add_enabled(is_kept, Button::selectable(is_here, name)).on_hover_text(words).clicked() {
                self.recall(which);
            }
            if ui
                .button(format!("→{name}"))
                .on_hover_text(format!("Keep the camera and its picture as snapshot {name}"))
                .clicked()
            {
                self.keep_snapshot(which);
            }
        }
    }

    fn copies(&mut self, ui: &mut Ui) {
        ui.menu_button("Copy as", |ui| {
            let mut copied = None;
            if ui.button("command").on_hover_text("A command for a shell that takes this picture").clicked() {
                copied = Some(as_command(&self.session));
            }
            if ui.button("RON").on_hover_text("The camera file").clicked() {
                copied = Some(as_ron(self.session.camera()));
            }
            if ui.button("Python").on_hover_text("Lines of Python that take this picture").clicked() {
                copied = Some(as_python(&self.session));
            }
            if let Some(text) = copied {
                ui.ctx().copy_text(text);
                ui.close();
            }
        });
    }

    fn progress(&self, ui: &mut Ui) {
        let done = self.results.as_ref().map(|results| {
            let delivery = &results.delivery;
            let seconds = delivery.work.as_secs_f64();
            let time = if seconds < 1.0 { format!("{:.0} ms", 1e3 * seconds) } else { format!("{seconds:.1} s") };
            format!("{} {}/3, {time}", delivery.rung.name(), delivery.rung.number())
        });
        ui.separator();
        ui.label(RichText::new(done.unwrap_or_default()).monospace());
        if let Some(busy) = self.engine.busy() {
            let words = format!("{} {}: {}", busy.rung.name(), busy.rung.number(), busy.stage.title());
            ui.add(ProgressBar::new(busy.fraction as f32).desired_width(210.0).text(RichText::new(words).small()));
        } else if self.is_paused {
            ui.label("paused");
        }
    }

    /// The notes below: what is under the pointer, what was done, what is wrong nowhere else.
    pub(super) fn notes(&mut self, ui: &mut Ui, camera: &mut Camera) {
        if let Some(fault) = self.fault.clone() {
            ui.horizontal_wrapped(|ui| {
                let words = match fault.field {
                    Field::Elsewhere => fault.message.clone(),
                    _ => format!("{}; the picture is that of the camera before", fault.message),
                };
                fields::wrong(ui, &words);
                if let Some((words, mended)) = &fault.remedy
                    && ui.button(words).clicked()
                {
                    camera.clone_from(mended);
                }
                if ui.button("take it back").clicked() {
                    self.undo();
                }
            });
        }
        ui.horizontal(|ui| match &self.hover {
            Some(probe) => drop(ui.label(RichText::new(probe_words(probe)).monospace().small())),
            None => drop(
                ui.weak(
                    self.note
                        .as_deref()
                        .unwrap_or("Click focuses there; Ctrl moves + along; Shift drags a rectangle for the edge."),
                ),
            ),
        });
    }

    /// Writes the files of a run beside the camera file.
    fn export(&mut self) {
        let Some(results) = &self.results else { return };
        let product = results.product.clone();
        if results.delivery.rung != Rung::Full {
            self.note = Some("the full picture is not there yet".to_owned());
            return;
        }
        let stem = PathBuf::from(self.path.trim());
        let stem = stem.file_stem().map_or_else(|| "dioptric-out".into(), std::ffi::OsStr::to_owned);
        let folder = PathBuf::from(self.path.trim()).with_file_name(stem);
        let written = std::fs::create_dir_all(&folder).map_err(|error| error.to_string()).and_then(|()| {
            let files =
                write_capture(&product.capture, Some(&product.depth), &folder).map_err(|error| error.to_string())?.0;
            let camera = as_ron(product.camera());
            write_beside(&folder.join("camera.ron"), camera.as_bytes()).map_err(|error| error.to_string())?;
            Ok(files.join(", "))
        });
        self.note = Some(match written {
            Ok(files) => format!("{}: {files}, camera.ron", folder.display()),
            Err(error) => format!("cannot write to {}: {error}", folder.display()),
        });
    }
}

/// Returns what is under the pointer in one line.
fn probe_words(probe: &Probe) -> String {
    let [column, row] = probe.pixel;
    let mut parts = vec![format!("({column}, {row})"), format!("RGB {:?}", probe.rgb)];
    let filter = probe.filter.as_ref().map_or(String::new(), |filter| format!(" behind {filter}"));
    let list = |values: &[f64]| values.iter().map(|value| three(*value)).collect::<Vec<_>>().join("/");
    parts.push(format!("{} e⁻{filter}", list(&probe.electrons)));
    parts.push(format!("{} DN", list(&probe.samples)));
    if let Some(depth_m) = probe.depth_m {
        parts.push(format!("depth {} m", three(depth_m)));
    }
    if let Some(field_deg) = probe.field_deg {
        parts.push(format!("field {field_deg:.1}°"));
    }
    if let Some((nm, most)) = probe.spectrum.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)) {
        parts.push(format!("most light {} W/m²/nm at {nm:.0} nm", three(most)));
    }
    parts.join("  ")
}
