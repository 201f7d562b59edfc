//! The camera on the desk: changed, taken back, compared, kept. It knows of no window and of no pictures.

mod autosave;
mod copy;
mod history;
mod prescription;
mod presets;

use std::path::{Path, PathBuf};

use dioptric_pipeline::{Camera, PipelineError};
use serde::{Deserialize, Serialize};

pub use autosave::{Autosave, Left};
pub use copy::{as_command, as_python, as_ron};
pub use history::History;
pub use prescription::Prescription;
pub use presets::{Preset, presets};

/// One of the two snapshots that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Snapshot {
    /// The first.
    A,
    /// The second.
    B,
}

impl Snapshot {
    /// Both.
    pub const ALL: [Self; 2] = [Self::A, Self::B];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
        }
    }
}

/// A camera, and the file that it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// The camera.
    pub camera: Camera,
    /// The file that it was opened from or saved to; none of one that was never saved.
    pub path: Option<PathBuf>,
}

impl Document {
    /// A camera that is in no file.
    pub fn untitled(camera: Camera) -> Self {
        Self { camera, path: None }
    }

    /// Returns it with paths that hold from any folder.
    #[must_use]
    fn absolute(&self) -> Self {
        let path = self.path.as_deref().map(|path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()));
        Self { camera: absolute(&self.camera), path }
    }
}

/// Returns the camera with paths that hold from any folder: such cameras are compared with those of files.
fn absolute(camera: &Camera) -> Camera {
    let mut absolute = camera.clone();
    if let Ok(folder) = std::env::current_dir() {
        absolute.resolve_paths(&folder);
    }
    absolute
}

/// A camera being changed. What can be taken back are changes of the camera and of the file that it belongs to.
#[derive(Clone, Debug)]
pub struct Session {
    document: Document,
    history: History<Document>,
    snapshots: [Option<Document>; 2],
    /// Each file's camera as it was opened or saved last; without a path the camera that is no change yet.
    kept: Vec<Document>,
}

impl Session {
    /// A session of a camera that is in no file.
    pub fn new(camera: Camera) -> Self {
        Self::of(Document::untitled(camera))
    }

    fn of(document: Document) -> Self {
        Self { kept: vec![document.clone()], document, history: History::default(), snapshots: [None, None] }
    }

    /// Opens a camera file.
    ///
    /// # Errors
    /// As [`Camera::read`].
    pub fn open(path: &Path) -> Result<Self, PipelineError> {
        Ok(Self::of(Document { camera: Camera::read(path)?, path: Some(path.to_owned()) }))
    }

    /// Goes on with what was left; of a file that is still there, what differs from it is a change.
    pub fn resume(left: Left) -> Self {
        let Left { document, snapshots, .. } = left;
        let of_file = document.path.as_deref().and_then(|path| Camera::read(path).ok());
        let kept = match (&document.path, of_file) {
            (Some(_), Some(camera)) => vec![Document { camera, path: document.path.clone() }],
            // The file is gone: nothing holds the camera.
            (Some(_), None) => Vec::new(),
            (None, _) => vec![document.clone()],
        };
        Self { kept, snapshots, ..Self::of(document) }
    }

    /// Returns what there is to keep for another time; `view` are words of the window.
    pub fn left(&self, view: String) -> Left {
        let snapshots = self.snapshots.each_ref().map(|snapshot| snapshot.as_ref().map(Document::absolute));
        Left { document: self.document.absolute(), snapshots, view }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.document.camera
    }

    /// The file that it was opened from or saved to.
    pub fn path(&self) -> Option<&Path> {
        self.document.path.as_deref()
    }

    /// The camera as its file has it, or as one that is in no file began.
    pub(crate) fn kept(&self) -> Option<&Camera> {
        self.kept.iter().find(|kept| kept.path == self.document.path).map(|kept| &kept.camera)
    }

    /// Whether it was changed since it was opened or saved.
    pub fn is_changed(&self) -> bool {
        self.kept() != Some(self.camera())
    }

    /// Whether its file holds another camera than it was opened with or saved, so that saving would destroy what another program wrote.
    pub fn is_file_changed(&self) -> bool {
        let Some(path) = self.path().filter(|path| path.exists()) else { return false };
        Camera::read(path).ok().as_ref().map(absolute) != self.kept().map(absolute)
    }

    /// What a window of it is called: the file's name, with a mark where changes are not saved.
    pub fn title(&self) -> String {
        let name = self.path().map(|path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned());
        let mark = if self.is_changed() { " •" } else { "" };
        format!("{}{mark} – dioptric studio", name.unwrap_or_else(|| "not saved yet".to_owned()))
    }

    /// Replaces the camera. Changes of one gesture, such as a slider being dragged, are one step to undo; a gesture ends with
    /// [`end_gesture`](Self::end_gesture).
    pub fn change(&mut self, camera: Camera, gesture: Option<u64>) {
        let path = self.document.path.clone();
        self.go_to(Document { camera, path }, gesture);
    }

    fn go_to(&mut self, document: Document, gesture: Option<u64>) {
        if document != self.document {
            self.history.note(std::mem::replace(&mut self.document, document), gesture);
        }
    }

    /// Ends a gesture.
    pub fn end_gesture(&mut self) {
        self.history.end_gesture();
    }

    /// Begins with a camera that is in no file, in place of this one, which can be gone back to.
    pub fn begin(&mut self, camera: Camera) {
        let document = Document::untitled(camera);
        self.keep(document.clone());
        self.go_to(document, None);
    }

    /// Opens another camera file in place of this camera, which can be gone back to.
    ///
    /// # Errors
    /// As [`Camera::read`]; the camera then stays.
    pub fn replace_by_file(&mut self, path: &Path) -> Result<(), PipelineError> {
        let document = Document { camera: Camera::read(path)?, path: Some(path.to_owned()) };
        self.keep(document.clone());
        self.go_to(document, None);
        Ok(())
    }

    /// Notes what a file holds.
    fn keep(&mut self, document: Document) {
        self.kept.retain(|kept| kept.path != document.path);
        self.kept.push(document);
    }

    /// Takes back the last change; whether there was one.
    pub fn undo(&mut self) -> bool {
        self.history.undo(&mut self.document)
    }

    /// Makes the change again that was taken back last; whether there was one.
    pub fn redo(&mut self) -> bool {
        self.history.redo(&mut self.document)
    }

    /// The changes that can be taken back and made again.
    pub fn history(&self) -> &History<Document> {
        &self.history
    }

    /// Keeps the camera as a snapshot.
    pub fn keep_snapshot(&mut self, which: Snapshot) {
        self.snapshots[which as usize] = Some(self.document.clone());
    }

    /// Keeps another camera as a snapshot.
    pub fn keep_snapshot_of(&mut self, which: Snapshot, camera: Camera) {
        self.snapshots[which as usize] = Some(Document { camera, path: self.document.path.clone() });
    }

    /// The camera of a snapshot.
    pub fn snapshot(&self, which: Snapshot) -> Option<&Camera> {
        self.snapshots[which as usize].as_ref().map(|snapshot| &snapshot.camera)
    }

    /// Goes to a snapshot and the file that it belongs to, which is a change that can be taken back; whether there is one.
    pub fn recall(&mut self, which: Snapshot) -> bool {
        let Some(document) = self.snapshots[which as usize].clone() else { return false };
        self.go_to(document, None);
        true
    }

    /// Writes the camera file. What came before the camera and after it belongs to this file from then on.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&mut self, path: &Path) -> Result<(), PipelineError> {
        let text = as_ron(self.camera());
        dioptric_files::write(path, text.as_bytes())?;
        let before = self.document.path.replace(path.to_owned());
        self.history.rename(|document| {
            let is_own = document.path == before;
            if is_own {
                document.path = Some(path.to_owned());
            }
            is_own
        });
        self.keep(self.document.clone());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use dioptric_pipeline::StopSpec;

    use super::*;

    fn session() -> Session {
        Session::new(Camera::demo().unwrap())
    }

    fn at(session: &Session, f_number: f64) -> Camera {
        Camera { stop: StopSpec::FNumber(f_number), ..session.camera().clone() }
    }

    #[test]
    fn undo_gives_the_camera_back() {
        let mut session = session();
        let first = session.camera().clone();
        session.change(at(&session, 8.0), None);
        session.change(at(&session, 8.0), None);
        assert!(session.is_changed() && session.undo() && !session.undo());
        assert_eq!(*session.camera(), first);
        assert!(session.redo() && !session.redo());
        assert_eq!(*session.camera(), at(&session, 8.0));
    }

    #[test]
    fn a_drag_is_one_step() {
        let mut session = session();
        let first = session.camera().clone();
        for tenth in 50..80 {
            session.change(at(&session, 0.1 * f64::from(tenth)), Some(1));
        }
        session.end_gesture();
        session.change(at(&session, 11.0), Some(1));
        assert!(session.undo());
        assert_eq!(session.camera().stop, StopSpec::FNumber(7.9));
        assert!(session.undo());
        assert_eq!(*session.camera(), first);
    }

    #[test]
    fn a_saved_camera_reads_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.ron");
        let mut session = session();
        session.change(at(&session, 5.6), None);
        session.save(&path).unwrap();
        assert!(!session.is_changed() && session.path() == Some(&path));
        assert_eq!(Session::open(&path).unwrap().camera(), session.camera());
        let mut other = Session::new(Camera::demo().unwrap());
        other.replace_by_file(&path).unwrap();
        assert_eq!(other.camera(), session.camera());
        assert!(other.undo() && *other.camera() == Camera::demo().unwrap());
        assert!(other.replace_by_file(&folder.path().join("none.ron")).is_err());
    }

    #[test]
    fn snapshots_are_recalled_and_taken_back() {
        let mut session = session();
        let first = session.camera().clone();
        session.keep_snapshot(Snapshot::A);
        session.change(at(&session, 16.0), None);
        session.keep_snapshot(Snapshot::B);
        assert!(session.recall(Snapshot::A) && *session.camera() == first);
        assert!(session.undo() && session.snapshot(Snapshot::B) == Some(session.camera()));
    }

    /// Opens a, opens b, goes back: the camera is a's, and so is the file that a save writes.
    #[test]
    fn the_file_goes_back_with_the_camera() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.ron", "b.ron"].map(|name| folder.path().join(name));
        let mut session = session();
        for (path, f_number) in [(&a, 8.0), (&b, 11.0)] {
            std::fs::write(path, at(&session, f_number).to_ron()).unwrap();
        }
        session.replace_by_file(&a).unwrap();
        session.replace_by_file(&b).unwrap();
        assert!(session.title().starts_with("b.ron – ") && session.undo());
        assert_eq!((session.path(), session.camera().stop), (Some(a.as_path()), StopSpec::FNumber(8.0)));
        assert!(!session.is_changed() && session.title().starts_with("a.ron – "));
        session.change(at(&session, 4.0), None);
        assert!(session.title().starts_with("a.ron • – "));
        session.save(&a).unwrap();
        assert_eq!(Camera::read(&b).unwrap().stop, StopSpec::FNumber(11.0));
        // A preset belongs to no file.
        session.begin(Camera::demo().unwrap());
        assert_eq!((session.path(), session.is_changed()), (None, false));
        // Going back over a save stays with the file, and shows that the camera is not the one in it.
        assert!(session.undo() && session.undo());
        assert_eq!((session.path(), session.is_changed()), (Some(a.as_path()), true));
    }

    #[test]
    fn what_another_program_wrote_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ron");
        let mut session = session();
        session.save(&path).unwrap();
        assert!(!session.is_file_changed());
        std::fs::write(&path, at(&session, 22.0).to_ron()).unwrap();
        assert!(session.is_file_changed());
        std::fs::remove_file(&path).unwrap();
        assert!(!session.is_file_changed());
    }
}
