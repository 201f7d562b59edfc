//! The camera on the desk: changed, taken back, compared, kept. It knows of no window and of no pictures.

mod autosave;
mod copy;
mod history;
mod prescription;
mod presets;

use std::path::{Path, PathBuf};

use dioptric_pipeline::{Camera, PipelineError};

pub use autosave::Autosave;
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

/// A camera being changed.
#[derive(Clone, Debug)]
pub struct Session {
    camera: Camera,
    history: History,
    snapshots: [Option<Camera>; 2],
    path: Option<PathBuf>,
    /// As it was opened or saved last.
    kept: Camera,
}

impl Session {
    /// A session of a camera that is in no file.
    pub fn new(camera: Camera) -> Self {
        Self { kept: camera.clone(), camera, history: History::default(), snapshots: [None, None], path: None }
    }

    /// Opens a camera file.
    ///
    /// # Errors
    /// As [`Camera::read`].
    pub fn open(path: &Path) -> Result<Self, PipelineError> {
        let camera = Camera::read(path)?;
        Ok(Self { path: Some(path.to_owned()), ..Self::new(camera) })
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The file that it was opened from or saved to.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// Whether it was changed since it was opened or saved.
    pub fn is_changed(&self) -> bool {
        self.camera != self.kept
    }

    /// Replaces the camera. Changes of one gesture, such as a slider being dragged, are one step to undo; a gesture ends with
    /// [`end_gesture`](Self::end_gesture).
    pub fn change(&mut self, camera: Camera, gesture: Option<u64>) {
        if camera != self.camera {
            self.history.note(std::mem::replace(&mut self.camera, camera), gesture);
        }
    }

    /// Ends a gesture.
    pub fn end_gesture(&mut self) {
        self.history.end_gesture();
    }

    /// Opens another camera file in place of this camera, which can be gone back to.
    ///
    /// # Errors
    /// As [`Camera::read`]; the camera then stays.
    pub fn replace_by_file(&mut self, path: &Path) -> Result<(), PipelineError> {
        let camera = Camera::read(path)?;
        self.change(camera.clone(), None);
        (self.path, self.kept) = (Some(path.to_owned()), camera);
        Ok(())
    }

    /// Takes back the last change; whether there was one.
    pub fn undo(&mut self) -> bool {
        self.history.undo(&mut self.camera)
    }

    /// Makes the change again that was taken back last; whether there was one.
    pub fn redo(&mut self) -> bool {
        self.history.redo(&mut self.camera)
    }

    /// The changes that can be taken back and made again.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Keeps the camera as a snapshot.
    pub fn keep_snapshot(&mut self, which: Snapshot) {
        self.snapshots[which as usize] = Some(self.camera.clone());
    }

    /// Keeps another camera as a snapshot.
    pub fn keep_snapshot_of(&mut self, which: Snapshot, camera: Camera) {
        self.snapshots[which as usize] = Some(camera);
    }

    /// The camera of a snapshot.
    pub fn snapshot(&self, which: Snapshot) -> Option<&Camera> {
        self.snapshots[which as usize].as_ref()
    }

    /// Goes to a snapshot, which is a change that can be taken back; whether there is one.
    pub fn recall(&mut self, which: Snapshot) -> bool {
        let Some(camera) = self.snapshots[which as usize].clone() else { return false };
        self.change(camera, None);
        true
    }

    /// Writes the camera file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&mut self, path: &Path) -> Result<(), PipelineError> {
        let text = as_ron(&self.camera);
        dioptric_files::write(path, text.as_bytes())?;
        (self.path, self.kept) = (Some(path.to_owned()), self.camera.clone());
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
}
