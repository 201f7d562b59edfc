//! The surfaces of the lens as numbers: curvature and spacing, what was changed, and the way back.

use std::sync::Arc;

use dioptric_optics::SurfaceChange;
use dioptric_pipeline::{Camera, LensReadOptions, LensSpec};
use egui::{CollapsingHeader, Ui};

use super::{
    super::fields::{NumberField, count, wrong},
    Desk, Wanted,
};
use crate::session::Prescription;

/// What is remembered between frames: the prescription, and of which lens.
type Kept = Option<(LensSpec, LensReadOptions, Option<Arc<Prescription>>)>;

/// Returns the prescription of the lens as it stands in the camera, kept until that changes; none of an ideal lens or pinhole, or where
/// there is no such lens.
pub(super) fn prescription(ui: &Ui, camera: &Camera) -> Option<Arc<Prescription>> {
    if !matches!(camera.lens.base(), LensSpec::BuiltIn(_) | LensSpec::File(_)) {
        return None;
    }
    let id = egui::Id::unique("prescription of the lens");
    let kept = ui.data(|data| data.get_temp::<Kept>(id)).flatten();
    if let Some((choice, reading, found)) = kept
        && (&choice, &reading) == (&camera.lens, &camera.lens_reading)
    {
        return found;
    }
    let found = Prescription::open(&camera.lens, &camera.lens_reading).ok().map(Arc::new);
    let kept: Kept = Some((camera.lens.clone(), camera.lens_reading.clone(), found.clone()));
    ui.data_mut(|data| data.insert_temp(id, kept));
    found
}

/// Shows the numbers of one surface, and what of the lens was changed.
pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let Some(prescription) = prescription(ui, camera) else { return };
    CollapsingHeader::new("Surfaces").show(ui, |ui| {
        let id = ui.make_persistent_id("surface");
        let mut surface = ui.data(|data| data.get_temp::<usize>(id)).unwrap_or(0).min(prescription.n_surfaces() - 1);
        let last = prescription.n_surfaces() - 1;
        if count(
            ui,
            "surface",
            "The surface whose numbers stand below, counted from 0 along the light",
            0..=last,
            &mut surface,
        ) {
            ui.data_mut(|data| data.insert_temp(id, surface));
        }
        numbers(ui, camera, &prescription, surface);
    });
    let n_changed = camera.lens.changes().len();
    if n_changed > 0 {
        ui.horizontal_wrapped(|ui| {
            let words = if n_changed == 1 { "surface is" } else { "surfaces are" };
            ui.label(format!("{n_changed} {words} changed: this is no longer {}", name(camera.lens.base())));
            if ui.button("Give them back").on_hover_text("The lens as it is in its file").clicked() {
                camera.lens = camera.lens.base().clone();
            }
            if ui.button("Save the lens…").on_hover_text("As a lens file, which the camera then has").clicked() {
                desk.ask_for(Wanted::LensOut);
            }
        });
    }
}

fn name(lens: &LensSpec) -> String {
    lens.text().unwrap_or_else(|| "the lens that it was".to_owned())
}

fn numbers(ui: &mut Ui, camera: &mut Camera, prescription: &Prescription, surface: usize) {
    let mut change = None;
    if let Some(mut curvature_per_mm) = prescription.curvature_per_mm(surface) {
        let most = prescription.steepest_per_mm(surface);
        let field = NumberField {
            label: "curvature",
            unit: "1/mm",
            range: -most..=most,
            slider: -0.6 * most..=0.6 * most,
            is_logarithmic: false,
            words: "One over the radius; above 0 the center lies behind the surface, 0 is a plane",
        };
        if field.show(ui, &mut curvature_per_mm) {
            change = Some(SurfaceChange { surface, curvature_per_mm: Some(curvature_per_mm), thickness_mm: None });
        }
        if curvature_per_mm != 0.0 {
            ui.weak(format!("radius {:.4} mm", 1.0 / curvature_per_mm));
        }
    }
    if let Some(mut spacing_mm) = prescription.spacing_mm(surface) {
        let field = NumberField {
            label: "spacing",
            unit: "mm",
            range: -1e4..=1e4,
            slider: spacing_mm.min(0.0)..=(1.5 * spacing_mm).max(5.0),
            is_logarithmic: false,
            words: "Distance from this vertex to the next; what lies behind moves along",
        };
        if field.show(ui, &mut spacing_mm) {
            change = Some(SurfaceChange { surface, curvature_per_mm: None, thickness_mm: Some(spacing_mm) });
        }
    }
    let id = ui.make_persistent_id("refused");
    if let Some(change) = change {
        let choice = prescription.changed(change);
        ui.data_mut(|data| data.insert_temp(id, choice.is_none()));
        if let Some(choice) = choice {
            camera.lens = choice;
        }
    }
    if ui.data(|data| data.get_temp::<bool>(id)).unwrap_or(false) {
        wrong(ui, "surfaces would cross or a rim would not fit; the lens stays as it was");
    }
}
