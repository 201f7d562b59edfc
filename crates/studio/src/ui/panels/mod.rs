//! The left side: the camera as parameters.

mod drawing;
mod exposure;
mod focus_plane;
pub(super) mod lens;
mod lens_drawing;
mod path;
mod processing;
mod scene;
mod sensor;
mod simulation;
mod surfaces;
mod target;
mod world;

use std::cell::Cell;

use egui::{Button, CollapsingHeader, ScrollArea, Ui};

use crate::engine::{Fault, Field, Product};

use super::fields::wrong;
use dioptric_pipeline::Camera;

/// What the panels show beside the camera.
pub(super) struct Desk<'a> {
    /// What is wrong with the camera.
    pub(super) fault: Option<&'a Fault>,
    /// The latest results.
    pub(super) product: Option<&'a Product>,
    /// A number that tells these results from others.
    pub(super) stamp: u64,
    /// What a panel asks the window for.
    pub(super) wanted: Cell<Option<Wanted>>,
}

/// What a panel cannot do alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// A lens file is to be chosen.
    Lens,
    /// A file is to be chosen that the lens is written to.
    LensOut,
    /// A sensor file is to be chosen.
    Sensor,
    /// A scene or a world is to be chosen.
    Scene,
    /// The pictures of a world by both methods are to be compared.
    BothMethods,
}

impl Desk<'_> {
    /// Tells what is wrong with a part, where something is, and offers what would do.
    fn tell(&self, ui: &mut Ui, field: Field, camera: &mut Camera) {
        let Some(fault) = self.fault.filter(|fault| fault.field == field) else { return };
        wrong(ui, &fault.message);
        if let Some((words, mended)) = &fault.remedy
            && ui.add(Button::new(format!("✔ {words}"))).clicked()
        {
            camera.clone_from(mended);
        }
    }

    /// Asks the window for something, once the panels are drawn.
    fn ask_for(&self, wanted: Wanted) {
        self.wanted.set(Some(wanted));
    }

    /// Whether something of a section is wrong.
    fn has_fault(&self, fields: &[Field]) -> bool {
        self.fault.is_some_and(|fault| fields.contains(&fault.field))
    }
}

/// Shows all parameters and changes the camera.
pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        section(ui, "Scene", &[Field::Scene], desk, true, |ui| scene::show(ui, camera, desk));
        let of_lens = [Field::Lens, Field::Stop, Field::Focus, Field::Movements];
        section(ui, "Lens", &of_lens, desk, true, |ui| lens::show(ui, camera, desk));
        section(ui, "Movements", &[Field::Movements], desk, true, |ui| lens::movements(ui, camera, desk));
        section(ui, "Film and sensor", &[Field::Film, Field::Sensor], desk, true, |ui| sensor::show(ui, camera, desk));
        section(ui, "Exposure", &[Field::Exposure], desk, true, |ui| exposure::show(ui, camera, desk));
        section(ui, "Noise", &[], desk, false, |ui| sensor::noise(ui, camera));
        section(ui, "Processing", &[Field::Processing], desk, false, |ui| processing::show(ui, camera, desk));
        section(ui, "Simulation", &[Field::Simulation], desk, false, |ui| simulation::show(ui, camera, desk));
        section(ui, "Output", &[], desk, false, |ui| simulation::output(ui, camera));
    });
}

fn section(ui: &mut Ui, title: &str, fields: &[Field], desk: &Desk<'_>, is_open: bool, contents: impl FnOnce(&mut Ui)) {
    // What is wrong is never hidden.
    let open = desk.has_fault(fields).then_some(true);
    CollapsingHeader::new(title).default_open(is_open).open(open).show(ui, contents);
}
