//! The camera kept in a file at every change, so that nothing is lost.

use std::{fs, path::PathBuf};

use dioptric_pipeline::Camera;
use etcetera::{BaseStrategy, choose_base_strategy};

use dioptric_files::write;

use super::copy::as_ron;

/// The most files that are remembered.
const MOST_RECENT: usize = 8;

/// A folder of the user's that holds the camera as it was left, and which files were open lately.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Autosave {
    folder: PathBuf,
}

impl Autosave {
    /// Keeps everything in this folder, which need not exist yet.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// Returns the usual one of the user, where the system has one.
    pub fn of_user() -> Option<Self> {
        let base = choose_base_strategy().ok()?;
        let state = base.state_dir().unwrap_or_else(|| base.data_dir());
        Some(Self::new(state.join("dioptric").join("studio")))
    }

    fn camera_file(&self) -> PathBuf {
        self.folder.join("camera.ron")
    }

    /// Keeps a camera. That it cannot be written is no reason to stop anybody's work: whether it was.
    pub fn keep(&self, camera: &Camera) -> bool {
        fs::create_dir_all(&self.folder).is_ok() && write(&self.camera_file(), as_ron(camera).as_bytes()).is_ok()
    }

    /// Returns the camera that was kept last, if it can be read.
    pub fn camera(&self) -> Option<Camera> {
        Camera::read(&self.camera_file()).ok()
    }

    /// Returns the files that were open lately, the last first.
    pub fn recent(&self) -> Vec<PathBuf> {
        let text = fs::read_to_string(self.folder.join("recent")).unwrap_or_default();
        text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
    }

    /// Remembers a file that was opened or saved.
    pub fn remember(&self, path: &std::path::Path) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let mut recent = self.recent();
        recent.retain(|other| *other != path);
        recent.insert(0, path);
        recent.truncate(MOST_RECENT);
        let text: String = recent.iter().map(|path| format!("{}\n", path.display())).collect();
        if fs::create_dir_all(&self.folder).is_ok() {
            // As above.
            _ = write(&self.folder.join("recent"), text.as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_camera_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let autosave = Autosave::new(folder.path().join("deeper"));
        assert_eq!(autosave.camera(), None);
        let mut camera = Camera::demo().unwrap();
        camera.seed = 77;
        assert!(autosave.keep(&camera));
        assert_eq!(autosave.camera(), Some(camera));
        // What cannot be read is as if it were not there.
        fs::write(folder.path().join("deeper/camera.ron"), "(").unwrap();
        assert_eq!(autosave.camera(), None);
    }

    #[test]
    fn recent_files_come_latest_first() {
        let folder = tempfile::tempdir().unwrap();
        let autosave = Autosave::new(folder.path());
        for name in ["/a.ron", "/b.ron", "/a.ron"] {
            autosave.remember(std::path::Path::new(name));
        }
        assert_eq!(autosave.recent(), [PathBuf::from("/a.ron"), PathBuf::from("/b.ron")]);
        (0..20).for_each(|i| autosave.remember(&PathBuf::from(format!("/{i}.ron"))));
        assert_eq!(autosave.recent().len(), MOST_RECENT);
    }
}
