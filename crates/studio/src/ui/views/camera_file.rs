//! The camera file as text, to be edited: every key is there, those that no panel has too.

use std::path::PathBuf;

use dioptric_pipeline::Camera;
use egui::{ScrollArea, TextEdit, Ui};

use super::super::fields::wrong;
use crate::session::as_ron;

/// The text, and the camera that it is of.
#[derive(Clone, Debug, Default)]
pub(in crate::ui) struct CameraText {
    text: String,
    of: Option<Camera>,
    fault: Option<String>,
}

/// Shows the text; what is changed there changes the camera once it can be read.
pub(in crate::ui) fn show(ui: &mut Ui, kept: &mut CameraText, camera: &mut Camera) {
    if kept.of.as_ref() != Some(camera) {
        *kept = CameraText { text: as_ron(camera), of: Some(camera.clone()), fault: None };
    }
    ui.weak("Every key that differs from or has a default; `dioptric camera schema` has all. Paths are from the folder of the program.");
    if let Some(fault) = &kept.fault {
        wrong(ui, &format!("{fault}; the camera stays as it was"));
    }
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        let edit = TextEdit::multiline(&mut kept.text).code_editor().desired_width(f32::INFINITY).desired_rows(40);
        let response = ui.add(edit).accessible_name("camera file");
        if response.changed() {
            let path = std::env::current_dir().unwrap_or_else(|_| PathBuf::new()).join("camera.ron");
            let parsed = Camera::parse(&kept.text, &path).and_then(|parsed| parsed.validate().map(|()| parsed));
            match parsed {
                Ok(parsed) => {
                    (kept.of, kept.fault) = (Some(parsed.clone()), None);
                    *camera = parsed;
                }
                Err(error) => kept.fault = Some(error.to_string()),
            }
        }
    });
}
