//! The path of a scene or a world.

use std::path::PathBuf;

use egui::Ui;

use super::{
    super::fields::{text, with_choice_of_file},
    Desk, Wanted,
};

/// The path of a file of a scene or a world.
pub(super) fn show(ui: &mut Ui, path: &mut PathBuf, words: &str, desk: &Desk<'_>) {
    let now = path.display().to_string();
    let words = format!("{words}; files can be dropped on the window");
    let hint = "Choose a scene or a world";
    let (typed, is_asked) = with_choice_of_file(ui, hint, |ui| text(ui, "path", &words, &now));
    if is_asked {
        desk.ask_for(Wanted::Scene);
    }
    if let Some(typed) = typed {
        *path = PathBuf::from(typed);
    }
}
