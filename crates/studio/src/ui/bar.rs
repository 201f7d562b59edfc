//! The bar above and the notes below.

use std::path::PathBuf;

use dioptric_pipeline::{Camera, display::code};
use egui::{Button, Color32, ProgressBar, Rect, RichText, Sense, Ui, vec2};

use super::{Studio, dialog::Purpose, fields, views::images};
use crate::{
    engine::{Field, Probe, three},
    session::{Autosave, Snapshot, as_command, as_python, as_ron, presets},
};

impl Studio {
    /// The bar above: files, undo, snapshots, pause, copies.
    pub(super) fn bar(&mut self, ui: &mut Ui) {
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
                        self.begin(other);
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
            let name = self.session.path().map_or("not saved yet".to_owned(), |path| path.display().to_string());
            ui.weak(name);
            let purposes = [
                (
                    "Open…",
                    "A camera, lens, sensor, scene or world (Ctrl-O); files can be dropped on the window",
                    Purpose::Open,
                ),
                ("Save as…", "The camera file (Ctrl-Shift-S)", Purpose::SaveCamera),
                ("Save the picture…", "The full picture, as dioptric run writes it (Ctrl-P)", Purpose::SavePicture),
                ("Export…", "Report, picture, irradiance, frames: the files of dioptric run (Ctrl-E)", Purpose::Export),
            ];
            for (words, hint, purpose) in purposes {
                if ui.button(words).on_hover_text(hint).clicked() {
                    self.choose(purpose);
                    ui.close();
                }
            }
            if ui.button("Save").on_hover_text("The camera file (Ctrl-S)").clicked() {
                self.save();
                ui.close();
            }
            let recent: Vec<PathBuf> = self.autosave.as_ref().map(Autosave::recent).unwrap_or_default();
            if !recent.is_empty() {
                ui.separator();
                ui.weak("Lately:");
            }
            for path in recent {
                if ui.button(path.display().to_string()).on_hover_text("Open it again").clicked() {
                    self.open(&path);
                    ui.close();
                }
            }
            self.left_unsaved(ui);
        });
    }

    /// Lists cameras that were left and are in no file.
    fn left_unsaved(&mut self, ui: &mut Ui) {
        let unsaved = self.autosave.as_ref().map(|autosave| autosave.unsaved(self.session.path())).unwrap_or_default();
        if !unsaved.is_empty() {
            ui.separator();
            ui.weak("Left unsaved:");
        }
        for left in unsaved {
            let name = match &left.document.path {
                Some(path) => path.display().to_string(),
                None => format!("{}, in no file", left.document.camera.name),
            };
            if ui.button(name).on_hover_text("Go on with it as it was left").clicked() {
                self.recover(left);
                ui.close();
            }
        }
    }

    /// Begins with another camera, which is in no file.
    fn begin(&mut self, camera: Camera) {
        self.keep_now();
        self.session.begin(camera);
        self.submit();
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
            let samples = results.product.n_samples.map_or(String::new(), |n| format!(" ({n} samples)"));
            format!("{} {}/3{samples}, {time}", delivery.rung.name(), delivery.rung.number())
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
            Some(probe) => {
                spectrum(ui, &probe.spectrum);
                ui.label(RichText::new(probe_words(probe)).monospace().small());
            }
            None => drop(
                ui.weak(
                    self.note
                        .as_deref()
                        .unwrap_or("Click focuses there; Ctrl moves + along; Shift drags a rectangle for the edge."),
                ),
            ),
        });
    }
}

/// Draws the irradiance of a pixel over its bands, each in the color of its light.
fn spectrum(ui: &mut Ui, spectrum: &[(f64, f64)]) {
    let (response, painter) = ui.allocate_painter(vec2(92.0, 14.0), Sense::hover());
    let rect = response.rect;
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let most = spectrum.iter().map(|(_, e)| *e).fold(f64::MIN_POSITIVE, f64::max);
    let width = rect.width() / spectrum.len().max(1) as f32;
    for (i, (nm, e)) in spectrum.iter().enumerate() {
        let left = rect.left() + width * i as f32;
        let top = rect.bottom() - rect.height() * (e / most) as f32;
        let [r, g, b] = images::tint(*nm).map(code);
        let bar = Rect::from_x_y_ranges(left..=left + width, top..=rect.bottom());
        painter.rect_filled(bar, 0.0, Color32::from_rgb(r, g, b));
    }
    response.accessible_name("spectrum under the pointer").on_hover_text("Irradiance on the film by wavelength");
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
