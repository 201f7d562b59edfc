//! Hidden folders that their owners hold as long as they live: what a killed process left is told from what another is making.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
    sync::{LazyLock, Mutex, MutexGuard, PoisonError},
};

/// The file in a hidden folder that its owner holds locked, so that nobody needs to know of processes.
const LOCK: &str = "lock";

/// Names that are tried: processes of many machines may have one number.
const MOST_NAMES: usize = 10_000;

/// The hidden folders of this process.
static UNFINISHED: LazyLock<Mutex<Vec<PathBuf>>> = LazyLock::new(Mutex::default);

/// Returns the hidden folders of this process: what is to be removed when it is interrupted. None is finished as long as the list is held.
pub fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A folder for what is not finished, removed with all that is in it when it is dropped.
///
/// Its owner holds a lock in it as long as it lives. On file systems that know no locks what the dead left stays.
#[derive(Debug)]
pub struct HiddenFolder {
    path: PathBuf,
    // Given up before the folder is removed: a file that is open cannot be removed everywhere.
    lock: Option<File>,
}

impl HiddenFolder {
    /// Makes a folder in another one, under the first of the names `name(0)`, `name(1)` and so on that is free.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn make(folder: &Path, name: impl Fn(usize) -> String) -> io::Result<Self> {
        for attempt in 0..MOST_NAMES {
            let path = folder.join(name(attempt));
            match fs::create_dir(&path) {
                // An earlier process may have had this number, or one of another machine has it.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                made => made?,
            }
            // Another may take the folder for a leftover until it is locked.
            if let Lock::Held(lock) | Lock::Unknown(lock) = lock(&path) {
                unfinished().push(path.clone());
                return Ok(Self { path, lock: Some(lock) });
            }
        }
        Err(io::Error::other("no hidden folder in it can be locked"))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the folder now; nothing can be done about what cannot be removed.
    pub(crate) fn remove(&mut self) {
        if self.lock.take().is_some() {
            drop(fs::remove_dir_all(&self.path));
            unfinished().retain(|path| *path != self.path);
        }
    }
}

impl Drop for HiddenFolder {
    fn drop(&mut self) {
        self.remove();
    }
}

/// The hidden folder that a killed process left; nobody else takes it while this is held.
#[derive(Debug)]
pub struct Leftover {
    path: PathBuf,
    lock: File,
}

impl Leftover {
    /// Returns those in a folder whose names start so, sorted; none where it cannot be read.
    pub fn all_in(folder: &Path, start: &str) -> Vec<Self> {
        let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        let hidden = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(start));
        let mut found: Vec<Self> = hidden
            .filter_map(|entry| {
                let path = entry.path();
                if !path.is_dir() {
                    return None;
                }
                if let Lock::Held(lock) = lock(&path) { Some(Self { path, lock }) } else { None }
            })
            .collect();
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the folder; what cannot be removed is left for the next one.
    pub fn remove(self) {
        drop(self.lock);
        drop(fs::remove_dir_all(self.path));
    }
}

/// What came of locking a hidden folder.
enum Lock {
    /// It is ours.
    Held(File),
    /// Another holds it, or has removed the folder.
    Taken,
    /// The file system knows no locks: leftovers stay there.
    Unknown(File),
}

fn lock(folder: &Path) -> Lock {
    let path = folder.join(LOCK);
    let Ok(file) = OpenOptions::new().create(true).truncate(false).write(true).open(&path) else {
        return Lock::Taken;
    };
    match file.try_lock() {
        // It may have been removed between being opened and being locked.
        Ok(()) if path.exists() => Lock::Held(file),
        Ok(()) | Err(TryLockError::WouldBlock) => Lock::Taken,
        Err(TryLockError::Error(_)) => Lock::Unknown(file),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_living_are_left_alone() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir(root.path().join(".a-0")).unwrap();
        let name = |n: usize| format!(".a-{n}");
        let (first, second) =
            (HiddenFolder::make(root.path(), name).unwrap(), HiddenFolder::make(root.path(), name).unwrap());
        assert_eq!((first.path(), second.path()), (&*root.path().join(".a-1"), &*root.path().join(".a-2")));
        fs::write(first.path().join("half"), "half").unwrap();
        let left = Leftover::all_in(root.path(), ".a-");
        assert_eq!(left.iter().map(Leftover::path).collect::<Vec<_>>(), [root.path().join(".a-0")]);
        // Nobody else finds what is held.
        assert!(Leftover::all_in(root.path(), ".a-").is_empty());
        left.into_iter().for_each(Leftover::remove);
        drop((first, second));
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
        assert!(HiddenFolder::make(&root.path().join("none"), name).is_err());
    }
}
