//! Choosing a file in the window itself: a folder's files of the right kind, a name that is typed, and the same keys on every system.

use std::{
    fs,
    path::{Path, PathBuf},
};

use egui::{Button, Id, Key, Modal, RichText, ScrollArea, TextEdit, Ui, vec2};

use super::fields;

/// What a file is chosen for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// To be opened, whatever it is.
    Open,
    /// A lens.
    Lens,
    /// A sensor.
    Sensor,
    /// A scene or a world.
    Scene,
    /// To hold the camera.
    SaveCamera,
    /// To hold the lens.
    SaveLens,
    /// To hold the picture.
    SavePicture,
    /// A folder for everything of a run.
    Export,
}

const LENSES: &[&str] = &["zmx", "seq", "dat", "json", "ron"];
const SENSORS: &[&str] = &["ron"];
const SCENES: &[&str] =
    &["exr", "hdr", "png", "jpg", "jpeg", "tif", "tiff", "mat", "pbrt", "gltf", "glb", "obj", "ply"];

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a camera, lens, sensor, scene or world",
            Self::Lens => "Choose a lens file",
            Self::Sensor => "Choose a sensor file",
            Self::Scene => "Choose a scene or a world",
            Self::SaveCamera => "Save the camera",
            Self::SaveLens => "Save the lens",
            Self::SavePicture => "Save the picture",
            Self::Export => "Export report, picture and frames into a folder",
        }
    }

    fn verb(self) -> &'static str {
        match self {
            Self::Open | Self::Lens | Self::Sensor | Self::Scene => "Open",
            Self::SaveCamera | Self::SaveLens | Self::SavePicture => "Save",
            Self::Export => "Export",
        }
    }

    /// What the name of a new file ends in; none of a folder, or where a file must be there.
    fn ending(self) -> Option<&'static str> {
        match self {
            Self::SaveCamera | Self::SaveLens => Some("ron"),
            Self::SavePicture => Some("png"),
            _ => None,
        }
    }

    fn is_listed(self, path: &Path) -> bool {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        let has = |endings: &[&str]| endings.contains(&ending.as_str());
        match self {
            Self::Open => has(LENSES) || has(SENSORS) || has(SCENES),
            Self::Lens => has(LENSES),
            Self::Sensor => has(SENSORS),
            Self::Scene => has(SCENES),
            _ => Some(ending.as_str()) == self.ending(),
        }
    }

    /// Whether the folder itself can be what is chosen.
    fn takes_folders(self) -> bool {
        matches!(self, Self::Scene | Self::Export)
    }
}

/// A file being chosen.
#[derive(Clone, Debug)]
pub(super) struct FileDialog {
    pub(super) purpose: Purpose,
    folder: PathBuf,
    name: String,
    shows_all: bool,
    /// Names in the folder, and whether they are folders.
    entries: Vec<(String, bool)>,
    fault: Option<String>,
    /// A file that is there and was to be written over.
    replaces: Option<PathBuf>,
    is_new: bool,
}

/// What became of a dialog in a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Open,
    Closed,
    Chosen(PathBuf),
}

impl FileDialog {
    /// Begins in a folder, with a name.
    pub(super) fn new(purpose: Purpose, folder: &Path, name: &str) -> Self {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let folder =
            fs::canonicalize(folder).or_else(|_| std::env::current_dir()).unwrap_or_else(|_| folder.to_owned());
        let name = name.to_owned();
        let mut dialog = Self {
            purpose,
            folder,
            name,
            shows_all: false,
            entries: Vec::new(),
            fault: None,
            replaces: None,
            is_new: true,
        };
        dialog.list();
        dialog
    }

    /// The folder that is shown.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn list(&mut self) {
        self.entries.clear();
        self.fault = None;
        match fs::read_dir(&self.folder) {
            Ok(read) => {
                for entry in read.flatten() {
                    let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
                    let (is_folder, is_hidden) = (path.is_dir(), name.starts_with('.'));
                    if self.shows_all || (!is_hidden && (is_folder || self.purpose.is_listed(&path))) {
                        self.entries.push((name, is_folder));
                    }
                }
                let key = |(name, is_folder): &(String, bool)| (!is_folder, name.to_lowercase());
                self.entries.sort_by_key(key);
            }
            Err(error) => self.fault = Some(format!("{} cannot be listed: {error}", self.folder.display())),
        }
    }

    fn enter(&mut self, folder: PathBuf) {
        (self.folder, self.replaces) = (folder, None);
        self.list();
    }

    /// Draws the dialog over the window.
    pub(super) fn show(&mut self, ui: &Ui) -> Outcome {
        let mut outcome = Outcome::Open;
        let modal = Modal::new(Id::unique("file dialog")).show(ui.ctx(), |ui| {
            ui.set_width(560.0_f32.min(ui.ctx().content_rect().width() - 60.0));
            ui.heading(self.purpose.title());
            self.path_bar(ui);
            let chosen = self.files(ui);
            let is_entered = self.name_field(ui);
            if let Some(fault) = &self.fault {
                fields::wrong(ui, fault);
            }
            ui.horizontal(|ui| {
                let verb = if self.replaces.is_some() { "Replace it" } else { self.purpose.verb() };
                let is_accepted = ui.button(verb).on_hover_text("Enter").clicked() || is_entered || chosen;
                if is_accepted && let Some(path) = self.accepted() {
                    outcome = Outcome::Chosen(path);
                }
                if ui.button("Cancel").on_hover_text("Escape").clicked() {
                    outcome = Outcome::Closed;
                }
                if ui.checkbox(&mut self.shows_all, "all files").on_hover_text("Whatever their names end in").changed()
                {
                    self.list();
                }
            });
        });
        if outcome == Outcome::Open && modal.should_close() {
            outcome = Outcome::Closed;
        }
        outcome
    }

    fn path_bar(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let parent = self.folder.parent().map(Path::to_owned);
            let up = ui.add_enabled(parent.is_some(), Button::new("↑ up")).on_hover_text("The folder above");
            if let Some(parent) = parent.filter(|_| up.clicked()) {
                self.enter(parent);
            }
            ui.label(RichText::new(self.folder.display().to_string()).monospace().small());
        });
    }

    /// Lists the files; whether one was double-clicked.
    fn files(&mut self, ui: &mut Ui) -> bool {
        let (mut entered, mut is_chosen) = (None, false);
        ScrollArea::vertical().max_height(280.0).min_scrolled_height(160.0).auto_shrink([false, true]).show(ui, |ui| {
            for (name, is_folder) in &self.entries {
                let shown = if *is_folder { format!("{name}/") } else { name.clone() };
                let is_named = !is_folder && self.name == *name;
                let row = Button::selectable(is_named, shown).min_size(vec2(ui.available_width(), 0.0));
                let response = ui.add(row);
                if response.clicked() && *is_folder {
                    entered = Some(self.folder.join(name));
                } else if response.clicked() {
                    (self.name, self.replaces) = (name.clone(), None);
                }
                is_chosen |= response.double_clicked() && !is_folder;
            }
            if self.entries.is_empty() {
                ui.weak("No files of this kind here.");
            }
        });
        if let Some(folder) = entered {
            self.enter(folder);
        }
        is_chosen
    }

    /// Shows the name; whether Enter was pressed in it.
    fn name_field(&mut self, ui: &mut Ui) -> bool {
        let words = match self.purpose.takes_folders() {
            true => "A name in this folder, or a path; a folder will do",
            false => "A name in this folder, or a path",
        };
        let edit = TextEdit::singleline(&mut self.name).desired_width(f32::INFINITY).hint_text(words);
        let response = ui.add(edit).on_hover_text(words).accessible_name("file name");
        if self.is_new {
            response.request_focus();
            self.is_new = false;
        }
        if response.changed() {
            self.replaces = None;
        }
        response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter))
    }

    /// Returns what is named, where it can be had; a folder that is no answer is entered, and a file is written over at the second asking.
    fn accepted(&mut self) -> Option<PathBuf> {
        let name = self.name.trim();
        if name.is_empty() {
            return self.purpose.takes_folders().then(|| self.folder.clone());
        }
        let mut path = self.folder.join(name);
        if path.is_dir() && !self.purpose.takes_folders() {
            self.name.clear();
            self.enter(path);
            return None;
        }
        if let Some(ending) = self.purpose.ending() {
            if path.extension().is_none() {
                path.set_extension(ending);
            }
            if path.exists() && self.replaces.as_ref() != Some(&path) {
                self.fault = Some(format!("{} is there already", path.display()));
                self.replaces = Some(path);
                return None;
            }
        } else if self.purpose != Purpose::Export && !path.exists() {
            self.fault = Some(format!("there is no {}", path.display()));
            return None;
        }
        Some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_paths() {
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir(root.join("inner")).unwrap();
        for name in ["a.ron", "b.zmx", "c.txt", ".hidden.ron"] {
            fs::write(root.join(name), "").unwrap();
        }
        let mut dialog = FileDialog::new(Purpose::Lens, &root, "");
        let names = |dialog: &FileDialog| dialog.entries.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&dialog), ["inner", "a.ron", "b.zmx"]);
        dialog.name = "none.zmx".to_owned();
        assert_eq!(dialog.accepted(), None);
        assert!(dialog.fault.as_ref().unwrap().contains("there is no"));
        // A folder is entered, a file of it taken.
        dialog.name = "inner".to_owned();
        assert_eq!((dialog.accepted(), dialog.folder()), (None, root.join("inner").as_path()));
        dialog.name = "../b.zmx".to_owned();
        assert_eq!(dialog.accepted(), Some(root.join("inner/../b.zmx")));
        // What is there is written over at the second asking only.
        let mut save = FileDialog::new(Purpose::SaveCamera, &root, "a");
        assert_eq!((save.accepted(), save.accepted()), (None, Some(root.join("a.ron"))));
        save.name = "new".to_owned();
        assert_eq!(save.accepted(), Some(root.join("new.ron")));
        assert_eq!(FileDialog::new(Purpose::Export, &root, "").accepted(), Some(root));
    }
}
