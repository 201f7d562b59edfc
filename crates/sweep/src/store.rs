//! Where results are kept: a folder in which an item is there whole or not at all.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use dioptric_files::{HiddenFolder, Leftover};
use serde::{Deserialize, Serialize};

use crate::{ItemId, SweepError};

/// What folders of items that are being made are called, beside those of finished ones.
pub(crate) const UNFINISHED: &str = ".tmp-";

/// A folder of finished items: `items/` then the first two digits of the item's name, then its name.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// What came of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It has a picture.
    Done,
    /// Its camera was refused; `refused.json` has the reason.
    Refused,
    /// It is not there.
    Missing,
}

impl Store {
    /// A store in a folder, which is made when the first item is.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns where an item is, from the folder of the store.
    pub fn place(id: ItemId) -> PathBuf {
        let name = id.to_string();
        Path::new("items").join(&name[..2]).join(name)
    }

    /// Returns the folder of an item, whether it is there or not.
    pub fn item(&self, id: ItemId) -> PathBuf {
        self.folder.join(Self::place(id))
    }

    /// Whether an item is there, done or refused.
    pub fn has(&self, id: ItemId) -> bool {
        self.item(id).is_dir()
    }

    /// Returns what came of an item.
    pub fn status(&self, id: ItemId) -> Status {
        let folder = self.item(id);
        match (folder.join("refused.json").is_file(), folder.is_dir()) {
            (true, _) => Status::Refused,
            (false, true) => Status::Done,
            (false, false) => Status::Missing,
        }
    }

    /// Makes a place for items that are being made, and removes what makers left that are no more.
    ///
    /// # Errors
    /// When the store cannot be written to.
    pub fn begin(&self) -> Result<Workplace<'_>, SweepError> {
        self.remove_leftovers();
        self.workplace()
    }

    /// Makes a place for items that are being made. Of many makers that begin again and again each would look at all others to find
    /// what is left: that is for the first time, and for the end.
    ///
    /// # Errors
    /// When the store cannot be written to.
    pub fn workplace(&self) -> Result<Workplace<'_>, SweepError> {
        let cannot = SweepError::writing(&self.folder);
        fs::create_dir_all(&self.folder).map_err(&cannot)?;
        let name = |attempt| format!("{UNFINISHED}{}-{attempt}", std::process::id());
        Ok(Workplace { store: self, unfinished: HiddenFolder::make(&self.folder, name).map_err(&cannot)? })
    }

    /// Removes what makers left that are no more.
    pub fn remove_leftovers(&self) {
        Leftover::all_in(&self.folder, UNFINISHED).into_iter().for_each(Leftover::remove);
    }
}

/// A place for items that are being made, removed with all that is unfinished when it is dropped.
#[derive(Debug)]
pub struct Workplace<'a> {
    store: &'a Store,
    unfinished: HiddenFolder,
}

impl Workplace<'_> {
    /// The folder of all that is unfinished.
    pub fn path(&self) -> &Path {
        self.unfinished.path()
    }

    /// The store that the items are for.
    pub fn store(&self) -> &Store {
        self.store
    }

    /// Makes a folder for the files of an item.
    pub(crate) fn item(&self, id: ItemId) -> Result<PathBuf, SweepError> {
        let folder = self.unfinished(id);
        let cannot = SweepError::writing(&folder);
        match fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(cannot(error)),
            _ => {}
        }
        fs::create_dir(&folder).map_err(cannot)?;
        Ok(folder)
    }

    /// Removes what was made of an item that cannot be finished.
    pub(crate) fn discard(&self, id: ItemId) -> Result<(), SweepError> {
        let folder = self.unfinished(id);
        fs::remove_dir_all(&folder).map_err(SweepError::writing(&folder))
    }

    /// The folder of an item that is being made.
    pub(crate) fn unfinished(&self, id: ItemId) -> PathBuf {
        self.path().join(id.to_string())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns a name that differs from those of other numbers.
    pub(crate) fn id(n: u64) -> ItemId {
        format!("{n:064x}").parse().unwrap()
    }

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn first_maker_of_an_item_wins() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let (one, other) = (store.begin().unwrap(), store.begin().unwrap());
        for (maker, text) in [(&one, "one"), (&other, "other")] {
            fs::write(maker.item(id(1)).unwrap().join("report.json"), text).unwrap();
        }
        assert_eq!(store.status(id(1)), Status::Missing);
        one.keep_together(&[id(1)]).unwrap();
        other.keep_together(&[id(1)]).unwrap();
        assert_eq!(fs::read_to_string(store.item(id(1)).join("report.json")).unwrap(), "one");
        assert!(store.has(id(1)) && store.status(id(1)) == Status::Done);
        drop((one, other));
        assert_eq!(names(folder.path()), ["items"]);
    }

    #[test]
    fn leftovers_of_the_dead_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        for (name, file) in [(".tmp-killed", "lock"), (".tmp-newborn", "half.png")] {
            fs::create_dir(folder.path().join(name)).unwrap();
            fs::write(folder.path().join(name).join(file), "").unwrap();
        }
        let alive = store.begin().unwrap();
        let second = store.begin().unwrap();
        assert!(alive.path().is_dir() && second.path().is_dir());
        assert_eq!(names(folder.path()).len(), 2);
        fs::create_dir(folder.path().join(".tmp-dead")).unwrap();
        let third = store.workplace().unwrap();
        assert_eq!(names(folder.path()).len(), 4);
        drop(third);
        store.remove_leftovers();
        assert_eq!(names(folder.path()).len(), 2);
    }
}
