//! Files written beside their place and renamed when whole.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use crate::SceneError;

static COUNTER: AtomicU64 = AtomicU64::new(0);

/// A file being written; dropped before [`finish`](Self::finish) it leaves nothing behind.
#[derive(Debug)]
pub(crate) struct PartialFile {
    file: Option<File>,
    partial: PathBuf,
    path: PathBuf,
}

impl PartialFile {
    /// Starts a file that will lie at `path`.
    pub(crate) fn create(path: &Path) -> Result<Self, SceneError> {
        let Some(name) = path.file_name() else {
            return Err(unwritable(path, "the path names no file"));
        };
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        let partial =
            path.with_file_name(format!(".{}.{}-{number}.partial", name.to_string_lossy(), std::process::id()));
        let file = File::options().read(true).write(true).create_new(true).open(&partial);
        let file = file.map_err(|error| unwritable(path, error))?;
        Ok(Self { file: Some(file), partial, path: path.to_owned() })
    }

    /// The file to write to.
    pub(crate) fn file(&mut self) -> &mut File {
        self.file.as_mut().expect("the file is open until finished")
    }

    /// Closes the file and moves it to its place.
    pub(crate) fn finish(mut self) -> Result<(), SceneError> {
        drop(self.file.take());
        fs::rename(&self.partial, &self.path).map_err(|error| unwritable(&self.path, error))
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        drop(self.file.take());
        // After `finish` it is no longer there; an error here cannot be reported.
        let _ = fs::remove_file(&self.partial);
    }
}

/// Returns the error of a file that cannot be written.
pub(crate) fn unwritable(path: &Path, reason: impl ToString) -> SceneError {
    SceneError::Unwritable { file: path.to_owned(), reason: reason.to_string() }
}

/// Returns the error of a file that cannot be read.
pub(crate) fn unreadable(path: &Path, reason: impl ToString) -> SceneError {
    SceneError::Unreadable { file: path.to_owned(), reason: reason.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let mut dropped = PartialFile::create(&path).unwrap();
        dropped.file().write_all(b"half").unwrap();
        drop(dropped);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);

        let mut kept = PartialFile::create(&path).unwrap();
        kept.file().write_all(b"whole").unwrap();
        assert!(!path.exists());
        kept.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let message = PartialFile::create(Path::new("no/such/folder/a.exr")).unwrap_err().to_string();
        assert!(message.starts_with("no/such/folder/a.exr: cannot be written"), "{message}");
        assert!(PartialFile::create(Path::new("..")).is_err());
    }
}
