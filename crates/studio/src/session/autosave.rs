//! The camera kept in a file at every change, so that nothing is lost.

use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions, TryLockError},
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::{SystemTime, UNIX_EPOCH},
};

use dioptric_files::write;
use dioptric_pipeline::Camera;
use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Deserialize, Serialize};

use super::{Document, absolute};

/// The most files that are remembered.
const MOST_RECENT: usize = 8;
/// The most documents that are kept as they were left.
const MOST_LEFT: usize = 50;

/// What a window leaves: its camera with the file that it belongs to, the snapshots, and what was looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Left {
    /// The camera.
    pub document: Document,
    /// A and B.
    pub snapshots: [Option<Document>; 2],
    /// Words of the window.
    pub view: String,
}

impl Left {
    /// Whether its file does not hold its camera.
    pub fn is_unsaved(&self) -> bool {
        let of_file = self.document.path.as_deref().and_then(|path| Camera::read(path).ok());
        of_file.as_ref().map(absolute) != Some(absolute(&self.document.camera))
    }
}

/// A folder of the user's that holds each document as it was left, and which files were open lately.
///
/// A document that is in no file has a place of its own for each window. That of a file belongs to the window that kept it first, as long as that lives;
/// others keep theirs beside it.
#[derive(Clone, Debug)]
pub struct Autosave {
    folder: PathBuf,
    /// What tells the documents of this window from those of others.
    window: String,
    /// The places that this window has locked.
    locked: Arc<Mutex<BTreeMap<String, File>>>,
}

impl Autosave {
    /// Keeps everything in this folder, which need not exist yet.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis());
        // Windows of one process may be opened within a millisecond.
        let locked = Arc::<Mutex<_>>::default();
        let window = format!("untitled-{now}-{}-{:x}", std::process::id(), Arc::as_ptr(&locked) as usize);
        Self { folder: folder.into(), window, locked }
    }

    /// Returns the usual one of the user, where the system has one.
    pub fn of_user() -> Option<Self> {
        let base = choose_base_strategy().ok()?;
        let state = base.state_dir().unwrap_or_else(|| base.data_dir());
        Some(Self::new(state.join("dioptric").join("studio")))
    }

    /// The name of the file that keeps a document.
    fn name(&self, path: Option<&Path>) -> String {
        let Some(path) = path else { return format!("{}.ron", self.window) };
        let mut hasher = DefaultHasher::new();
        std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).hash(&mut hasher);
        format!("{:016x}.ron", hasher.finish())
    }

    /// The name of the file that keeps a document of this window: its own, unless another window has that.
    fn own_name(&self, path: Option<&Path>) -> String {
        let name = self.name(path);
        if self.takes(&name) {
            return name;
        }
        let name = format!("{}-{}.ron", name.trim_end_matches(".ron"), self.window);
        self.takes(&name);
        name
    }

    /// Takes a place, unless another window has it: whether it is this window's. On file systems that know no locks all are.
    fn takes(&self, name: &str) -> bool {
        let mut locked = self.locked.lock().unwrap_or_else(PoisonError::into_inner);
        if locked.contains_key(name) {
            return true;
        }
        let open = || {
            fs::create_dir_all(self.documents())?;
            OpenOptions::new().create(true).truncate(false).write(true).open(self.lock_of(name))
        };
        // Where no file can be made, none is kept either.
        let Ok(file) = open() else { return true };
        let is_free = !matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        if is_free {
            locked.insert(name.to_owned(), file);
        }
        is_free
    }

    /// Whether another window has a place.
    fn is_taken(&self, name: &str) -> bool {
        let is_own = self.locked.lock().unwrap_or_else(PoisonError::into_inner).contains_key(name);
        let lock = (!is_own).then(|| OpenOptions::new().write(true).open(self.lock_of(name)).ok()).flatten();
        lock.is_some_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
    }

    fn lock_of(&self, name: &str) -> PathBuf {
        self.documents().join(name).with_extension("lock")
    }

    /// Whether another window has a camera file open.
    pub fn is_open_elsewhere(&self, path: &Path) -> bool {
        self.is_taken(&self.name(Some(path)))
    }

    fn documents(&self) -> PathBuf {
        self.folder.join("left")
    }

    /// Keeps what a window leaves. That it cannot be written is no reason to stop anybody's work: whether it was.
    pub fn keep(&self, left: &Left) -> bool {
        let name = self.own_name(left.document.path.as_deref());
        let text = ron::ser::to_string_pretty(left, ron::ser::PrettyConfig::new());
        let is_kept = fs::create_dir_all(self.documents()).is_ok()
            && text.is_ok_and(|text| write(&self.documents().join(&name), text.as_bytes()).is_ok())
            && write(&self.folder.join("last"), name.as_bytes()).is_ok();
        self.prune();
        is_kept
    }

    /// Removes what was left longest ago, beyond so many documents.
    fn prune(&self) {
        let mut files = self.files();
        for (path, _) in files.drain(MOST_LEFT.min(files.len())..) {
            // What cannot be removed stays.
            _ = fs::remove_file(path.with_extension("lock"));
            _ = fs::remove_file(path);
        }
    }

    /// The files of documents, the one that was kept last first.
    fn files(&self) -> Vec<(PathBuf, SystemTime)> {
        let entries = fs::read_dir(self.documents()).into_iter().flatten().flatten();
        let dated = entries.filter_map(|entry| Some((entry.path(), entry.metadata().ok()?.modified().ok()?)));
        let mut files: Vec<_> = dated.filter(|(path, _)| path.extension().is_some_and(|e| e == "ron")).collect();
        files.sort_by_key(|(_, modified)| std::cmp::Reverse(*modified));
        files
    }

    /// Returns what was kept last, if it can be read and no other window has it.
    pub fn left(&self) -> Option<Left> {
        let name = fs::read_to_string(self.folder.join("last")).ok()?;
        if self.is_taken(&name) { None } else { read(&self.documents().join(name)) }
    }

    /// Returns what was left of a camera file, if it can be read and no other window has it open.
    pub fn left_of(&self, path: &Path) -> Option<Left> {
        if self.is_open_elsewhere(path) {
            return None;
        }
        let left = read(&self.documents().join(self.name(Some(path))))?;
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        (left.document.path.as_deref() == Some(&path)).then_some(left)
    }

    /// Returns what was left of other documents and is in no file, the latest first, but for those of other windows.
    pub fn unsaved(&self, besides: Option<&Path>) -> Vec<Left> {
        let own = self.documents().join(self.own_name(besides));
        let is_taken = |path: &Path| path.file_name().is_some_and(|name| self.is_taken(&name.to_string_lossy()));
        let files = self.files().into_iter().filter(|(path, _)| *path != own && !is_taken(path));
        files.filter_map(|(path, _)| read(&path)).filter(Left::is_unsaved).take(MOST_RECENT).collect()
    }

    /// Returns the files that were open lately, the last first.
    pub fn recent(&self) -> Vec<PathBuf> {
        let text = fs::read_to_string(self.folder.join("recent")).unwrap_or_default();
        text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
    }

    /// Remembers a file that was opened or saved.
    pub fn remember(&self, path: &Path) {
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

/// What cannot be read is as if it were not there.
fn read(path: &Path) -> Option<Left> {
    ron::from_str(&fs::read_to_string(path).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(seed: u64, path: Option<&Path>) -> Left {
        let camera = Camera { seed, ..Camera::demo().unwrap() };
        let document = Document { camera, path: path.map(Path::to_owned) };
        Left { snapshots: [Some(document.clone()), None], document, view: "Picture Depth".to_owned() }
    }

    #[test]
    fn what_was_left_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let autosave = Autosave::new(folder.path().join("deeper"));
        assert_eq!(autosave.left(), None);
        assert!(autosave.keep(&left(77, None)));
        assert_eq!(autosave.left(), Some(left(77, None)));
        // What cannot be read is as if it were not there.
        let name = fs::read_to_string(folder.path().join("deeper/last")).unwrap();
        fs::write(folder.path().join("deeper/left").join(name), "(").unwrap();
        assert_eq!(autosave.left(), None);
    }

    #[test]
    fn each_document_has_its_own_place() {
        let folder = tempfile::tempdir().unwrap();
        let autosave = Autosave::new(folder.path());
        let [a, b] = ["a.ron", "b.ron"].map(|name| folder.path().join(name));
        for (seed, path) in [(1, Some(a.as_path())), (2, Some(&b)), (3, None)] {
            assert!(autosave.keep(&left(seed, path)));
        }
        assert_eq!(autosave.left_of(&a), Some(left(1, Some(&a))));
        assert_eq!(autosave.left_of(&b), Some(left(2, Some(&b))));
        assert_eq!(autosave.left(), Some(left(3, None)));
        // Another window's camera takes the place of none.
        let other = Autosave::new(folder.path());
        assert!(other.keep(&left(4, None)));
        // What is in its file need not be recovered, nor what a window has that lives.
        fs::write(&a, left(1, None).document.camera.to_ron()).unwrap();
        assert_eq!(other.unsaved(None), []);
        drop(autosave);
        let seeds: Vec<u64> = other.unsaved(None).iter().map(|left| left.document.camera.seed).collect();
        assert!(seeds.contains(&2) && seeds.contains(&3) && seeds.len() == 2, "{seeds:?}");
    }

    #[test]
    fn two_windows_on_one_file_lose_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ron");
        fs::write(&path, left(1, None).document.camera.to_ron()).unwrap();
        let [first, second] = [0, 1].map(|_| Autosave::new(folder.path()));
        assert!(first.keep(&left(2, Some(&path))));
        // The second begins with what is in the file, not with what the first is about to do.
        assert!(second.is_open_elsewhere(&path) && !first.is_open_elsewhere(&path));
        assert_eq!((second.left_of(&path), second.left()), (None, None));
        assert!(second.keep(&left(3, Some(&path))));
        assert!(first.keep(&left(4, Some(&path))) && second.keep(&left(5, Some(&path))));
        assert_eq!((first.unsaved(Some(&path)), second.unsaved(Some(&path))), (vec![], vec![]));
        // Both windows are killed: a third has what either left.
        drop((first, second));
        let third = Autosave::new(folder.path());
        assert_eq!(third.left_of(&path), Some(left(4, Some(&path))));
        assert_eq!(third.unsaved(Some(&path)), [left(5, Some(&path))]);
    }

    #[test]
    fn recent_files_come_latest_first() {
        let folder = tempfile::tempdir().unwrap();
        let autosave = Autosave::new(folder.path());
        for name in ["/a.ron", "/b.ron", "/a.ron"] {
            autosave.remember(Path::new(name));
        }
        assert_eq!(autosave.recent(), [PathBuf::from("/a.ron"), PathBuf::from("/b.ron")]);
        (0..20).for_each(|i| autosave.remember(&PathBuf::from(format!("/{i}.ron"))));
        assert_eq!(autosave.recent().len(), MOST_RECENT);
    }
}
