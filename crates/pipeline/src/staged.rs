//! Results that appear whole or not at all.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::Serialize;

use crate::PipelineError;

/// A file or folder of results that is written beside its place and moved there at the end.
///
/// Dropped without [`commit`](Self::commit), it leaves nothing behind; files that were at the place before stay.
#[derive(Debug)]
pub struct Staged {
    target: PathBuf,
    partial: PathBuf,
    is_folder: bool,
    /// Folders above the target that were made for it, outermost first.
    made_parents: Vec<PathBuf>,
    is_committed: bool,
}

impl Staged {
    /// Makes a folder to fill; its files take the place of those of the same name in `target` at the end.
    ///
    /// # Errors
    /// When the folder, or the one above it, cannot be written to.
    pub fn folder(target: &Path) -> Result<Self, PipelineError> {
        let cannot = |reason: io::Error| PipelineError::Write { path: target.to_owned(), reason: reason.to_string() };
        if target.exists() && !target.is_dir() {
            return Err(PipelineError::Write { path: target.to_owned(), reason: "it is not a folder".to_owned() });
        }
        let made_parents = make_parents(target).map_err(cannot)?;
        // Inside an existing folder, so that a folder that cannot be written to is found out before the work.
        let partial = if target.is_dir() { target.join(partial_name("run")) } else { beside(target) };
        let staged = Self { target: target.to_owned(), partial, is_folder: true, made_parents, is_committed: false };
        fs::create_dir(&staged.partial).map_err(cannot)?;
        Ok(staged)
    }

    /// Chooses where to write a file that takes the place of `target` at the end.
    ///
    /// # Errors
    /// When nothing can be written beside `target`.
    pub fn file(target: &Path) -> Result<Self, PipelineError> {
        let cannot = |reason: io::Error| PipelineError::Write { path: target.to_owned(), reason: reason.to_string() };
        if target.is_dir() {
            return Err(PipelineError::Write { path: target.to_owned(), reason: "it is a folder".to_owned() });
        }
        let made_parents = make_parents(target).map_err(cannot)?;
        let staged = Self {
            target: target.to_owned(),
            partial: beside(target),
            is_folder: false,
            made_parents,
            is_committed: false,
        };
        fs::File::create(&staged.partial).map_err(cannot)?;
        Ok(staged)
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.partial
    }

    /// Moves what was written to its place.
    ///
    /// # Errors
    /// When a file cannot be moved.
    pub fn commit(mut self) -> Result<(), PipelineError> {
        let moved = if self.is_folder && self.target.is_dir() {
            move_entries(&self.partial, &self.target)
        } else {
            fs::rename(&self.partial, &self.target)
        };
        moved.map_err(|reason| PipelineError::Write { path: self.target.clone(), reason: reason.to_string() })?;
        self.is_committed = true;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if self.is_committed {
            return;
        }
        // Nothing can be done about what cannot be removed; empty folders only are taken away above it.
        let _ = if self.is_folder { fs::remove_dir_all(&self.partial) } else { fs::remove_file(&self.partial) };
        for parent in self.made_parents.iter().rev() {
            let _ = fs::remove_dir(parent);
        }
    }
}

fn partial_name(name: &str) -> String {
    format!(".{name}.partial-{}", std::process::id())
}

/// Returns a hidden name in the folder of `target`.
fn beside(target: &Path) -> PathBuf {
    let name = target.file_name().map_or_else(|| "out".to_owned(), |name| name.to_string_lossy().into_owned());
    let extension = target.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    target.with_file_name(partial_name(&name) + &extension)
}

/// Makes the folders above `target` and returns those that were missing.
fn make_parents(target: &Path) -> io::Result<Vec<PathBuf>> {
    let parents: Vec<PathBuf> =
        target.ancestors().skip(1).filter(|p| !p.as_os_str().is_empty()).map(Path::to_owned).collect();
    let mut missing: Vec<PathBuf> = parents.into_iter().take_while(|parent| !parent.exists()).collect();
    missing.reverse();
    if let Some(parent) = missing.last() {
        fs::create_dir_all(parent)?;
    }
    Ok(missing)
}

fn move_entries(from: &Path, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::rename(entry.path(), to.join(entry.file_name()))?;
    }
    fs::remove_dir(from)
}

/// Writes a value as JSON.
///
/// # Errors
/// When the file cannot be written.
pub fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<(), PipelineError> {
    let json = serde_json::to_vec_pretty(value)
        .map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })?;
    write_file(path, &json)
}

/// Writes bytes to a file.
///
/// # Errors
/// When it cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    fs::write(path, bytes).map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_abandoned_folder_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("a/b/out");
        let staged = Staged::folder(&target).unwrap();
        fs::write(staged.path().join("half.txt"), "half").unwrap();
        drop(staged);
        assert!(names_in(root.path()).is_empty());
    }

    #[test]
    fn a_committed_folder_replaces_only_what_it_has() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("old.txt"), "old").unwrap();
        fs::write(target.join("both.txt"), "old").unwrap();
        let staged = Staged::folder(&target).unwrap();
        fs::write(staged.path().join("both.txt"), "new").unwrap();
        assert_eq!(fs::read_to_string(target.join("both.txt")).unwrap(), "old");
        staged.commit().unwrap();
        assert_eq!(names_in(&target), ["both.txt", "old.txt"]);
        assert_eq!(fs::read_to_string(target.join("both.txt")).unwrap(), "new");
    }

    #[test]
    fn a_file_appears_at_the_end() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("deep/lens.svg");
        let staged = Staged::file(&target).unwrap();
        fs::write(staged.path(), "whole").unwrap();
        assert!(!target.exists());
        assert_eq!(staged.path().extension().unwrap(), "svg");
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "whole");
        assert_eq!(names_in(target.parent().unwrap()), ["lens.svg"]);
    }

    #[test]
    fn a_place_that_cannot_be_written_to_is_named() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        for error in [
            Staged::folder(&file).unwrap_err(),
            Staged::folder(&file.join("out")).unwrap_err(),
            Staged::file(&file.join("out.csv")).unwrap_err(),
            Staged::file(root.path()).unwrap_err(),
        ] {
            assert!(error.to_string().contains("cannot write"), "{error}");
        }
        assert_eq!(names_in(root.path()), ["file"]);
    }
}
