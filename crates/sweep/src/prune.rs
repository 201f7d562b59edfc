//! Items of a store that no plan asks for any more.

use std::{
    collections::HashSet,
    fs, io,
    path::{Path, PathBuf},
};

use crate::{ItemId, Store, Sweep, SweepError, store::UNFINISHED};

/// What was removed from a store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pruned {
    /// Items that were removed.
    pub n_items: usize,
    /// What their files held, bytes.
    pub bytes: u64,
}

impl Store {
    /// Returns the items that are there, done or refused, which none of these plans asks for, in the order of their names: of plans as they were
    /// before, or of others that share the store.
    ///
    /// # Errors
    /// When the store cannot be read.
    pub fn others<'a>(&self, sweeps: impl IntoIterator<Item = &'a Sweep>) -> Result<Vec<ItemId>, SweepError> {
        let asked_for: HashSet<ItemId> =
            sweeps.into_iter().flat_map(|sweep| (0..sweep.len()).map(|item| sweep.id(item))).collect();
        let mut others = Vec::new();
        for above in entries(&self.folder().join("items"))? {
            // What is no name of an item is none of ours.
            let ids = entries(&above)?.into_iter().filter_map(|path| path.file_name()?.to_str()?.parse().ok());
            others.extend(ids.filter(|id| !asked_for.contains(id) && self.has(*id)));
        }
        others.sort_unstable();
        Ok(others)
    }

    /// Removes items, each whole or not at all; returns how many there were.
    ///
    /// # Errors
    /// When the store cannot be written to, or a sweep is making items in it.
    pub fn prune(&self, items: &[ItemId]) -> Result<Pruned, SweepError> {
        let place = self.begin()?;
        if let Some(other) = entries(self.folder())?.iter().find(|path| is_unfinished(path) && *path != place.path()) {
            return Err(SweepError::Busy { store: self.folder().to_owned(), by: other.clone() });
        }
        let mut pruned = Pruned::default();
        for &id in items {
            let (from, to) = (self.item(id), place.unfinished(id));
            match fs::rename(&from, &to) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                moved => moved.map_err(SweepError::writing(&from))?,
            }
            pruned.n_items += 1;
            for file in entries(&to)? {
                pruned.bytes += fs::metadata(&file).map_err(SweepError::reading(&file))?.len();
            }
            fs::remove_dir_all(&to).map_err(SweepError::writing(&to))?;
            // The folder above it, where that was the last of it.
            if let Some(above) = from.parent() {
                fs::remove_dir(above).ok();
            }
        }
        Ok(pruned)
    }
}

/// Returns what is in a folder; nothing where there is none.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, SweepError> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let cannot = SweepError::reading(folder);
    fs::read_dir(folder).and_then(|all| all.map(|entry| Ok(entry?.path())).collect()).map_err(cannot)
}

fn is_unfinished(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(UNFINISHED))
}
