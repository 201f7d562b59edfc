//! Results that appear whole or not at all.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use serde::Serialize;

use crate::{
    PipelineError,
    hidden::{HiddenFolder, Leftover},
};

/// What stands in the names of hidden folders before the number of their process.
const PARTIAL: &str = ".partial-";

/// A file or folder of results that is written beside its place and moved there at the end.
///
/// It is written inside a hidden folder of its own, `.NAME.partial-PID` beside the target or `.run.partial-PID` in a folder that is
/// there. Dropped without [`commit`](Self::commit), it leaves nothing behind; files that were at the place before stay. What a
/// killed process left is removed when the next one writes to the same place; that of a process that lives is left alone.
#[derive(Debug)]
pub struct Staged {
    target: PathBuf,
    hidden: HiddenFolder,
    /// What is moved to the target.
    content: PathBuf,
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
        let staged = Self::begin(target, true).map_err(cannot)?;
        fs::create_dir(&staged.content).map_err(cannot)?;
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
        let staged = Self::begin(target, false).map_err(cannot)?;
        File::create(&staged.content).map_err(cannot)?;
        remove(leftovers(target, false));
        Ok(staged)
    }

    /// Makes the hidden folder and those above it, and locks it.
    fn begin(target: &Path, is_folder: bool) -> io::Result<Self> {
        let made_parents = make_parents(target)?;
        let made = Self::begin_in(target, is_folder, &made_parents);
        if made.is_err() {
            remove_empty(&made_parents);
        }
        made
    }

    fn begin_in(target: &Path, is_folder: bool, made_parents: &[PathBuf]) -> io::Result<Self> {
        let name = target.file_name().map_or_else(|| "out".into(), ToOwned::to_owned);
        let (folder, start) = places(target, is_folder);
        let numbered = |attempt: usize| match attempt {
            0 => format!("{start}{}", std::process::id()),
            _ => format!("{start}{}-{attempt}", std::process::id()),
        };
        let hidden = HiddenFolder::make(&folder, numbered)?;
        let content = hidden.path().join(if is_folder { "results".into() } else { name });
        let (target, made_parents) = (target.to_owned(), made_parents.to_vec());
        Ok(Self { target, hidden, content, is_folder, made_parents, is_committed: false })
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.content
    }

    /// The hidden folder, for what is not moved to the target; it is removed in the end.
    pub fn root(&self) -> &Path {
        self.hidden.path()
    }

    /// Returns the hidden folders that killed processes left for the same target.
    pub fn leftovers(&self) -> Vec<Leftover> {
        leftovers(&self.target, self.is_folder)
    }

    /// Moves what was written to its place, and removes what killed processes left for it.
    ///
    /// # Errors
    /// When a file cannot be moved.
    pub fn commit(mut self) -> Result<(), PipelineError> {
        let moved = if self.is_folder && self.target.is_dir() {
            move_entries(&self.content, &self.target)
        } else {
            fs::rename(&self.content, &self.target)
        };
        moved.map_err(|reason| PipelineError::Write { path: self.target.clone(), reason: reason.to_string() })?;
        self.is_committed = true;
        remove(self.leftovers());
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        self.hidden.remove();
        if !self.is_committed {
            remove_empty(&self.made_parents);
        }
    }
}

/// Removes folders, the last first, as far as they are empty.
fn remove_empty(folders: &[PathBuf]) {
    for folder in folders.iter().rev() {
        let _ = fs::remove_dir(folder);
    }
}

/// Returns the folder in which the hidden folders for a target lie, and how their names start.
fn places(target: &Path, is_folder: bool) -> (PathBuf, String) {
    // Inside an existing folder, so that a folder that cannot be written to is found out before the work.
    if is_folder && target.is_dir() {
        return (target.to_owned(), format!(".run{PARTIAL}"));
    }
    let name = target.file_name().map_or_else(|| "out".to_owned(), |name| name.to_string_lossy().into_owned());
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder.to_owned(), format!(".{name}{PARTIAL}"))
}

/// Returns what killed processes left for a target, in the target and beside it.
fn leftovers(target: &Path, is_folder: bool) -> Vec<Leftover> {
    let beside = places(target, false);
    let inside = is_folder.then(|| places(target, true)).filter(|inside| *inside != beside);
    let mut found: Vec<Leftover> =
        std::iter::once(beside).chain(inside).flat_map(|(folder, start)| Leftover::all_in(&folder, &start)).collect();
    found.sort_by(|a, b| a.path().cmp(b.path()));
    found
}

fn remove(leftovers: Vec<Leftover>) {
    leftovers.into_iter().for_each(Leftover::remove);
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

    /// Leaves what a killed process would: a hidden folder that nobody holds.
    fn leave(folder: &Path, name: &str, file: &str) {
        let left = folder.join(name);
        fs::create_dir_all(left.join("results")).unwrap();
        fs::write(left.join(file), "half").unwrap();
    }

    #[test]
    fn leftovers_of_the_dead_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir(&target).unwrap();
        leave(&target, ".run.partial-1", "results/half.txt");
        leave(root.path(), ".out.partial-2", "lock");
        leave(root.path(), ".other.partial-3", "lock");
        let alive = Staged::folder(&target).unwrap();
        assert_eq!(names_in(root.path()), [".other.partial-3", ".out.partial-2", "out"]);
        // Found, and held until they are let go.
        let found: Vec<PathBuf> = alive.leftovers().iter().map(|left| left.path().to_owned()).collect();
        assert_eq!(found, [root.path().join(".out.partial-2"), target.join(".run.partial-1")]);
        let second = Staged::folder(&target).unwrap();
        fs::write(second.path().join("a.txt"), "whole").unwrap();
        second.commit().unwrap();
        // The first is alive, though its process has the same number.
        assert_eq!(names_in(root.path()), [".other.partial-3", "out"]);
        assert_eq!(names_in(&target).len(), 2);
        fs::write(alive.path().join("b.txt"), "whole").unwrap();
        alive.commit().unwrap();
        assert_eq!(names_in(&target), ["a.txt", "b.txt"]);
    }

    #[test]
    fn leftovers_of_a_file_are_removed_at_once() {
        let root = tempfile::tempdir().unwrap();
        leave(root.path(), ".lens.svg.partial-77", "lens.svg");
        let staged = Staged::file(&root.path().join("lens.svg")).unwrap();
        assert_eq!(names_in(root.path()).len(), 1);
        drop(staged);
        assert!(names_in(root.path()).is_empty());
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
