//! Finished items brought to the disk together, while others are made.

use std::{
    collections::{BTreeSet, HashSet},
    fs::{self, File, OpenOptions},
    io,
    iter::once,
    panic,
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
        mpsc::{self, Receiver, SyncSender},
    },
    thread,
};

use dioptric_spectrum::Cancelled;

use crate::{ItemId, SweepError, Workplace};

/// So many finished items wait at most for being put into the store together; a maker that is killed loses them.
const MOST_WAITING: usize = 16;
/// So many files are brought to the disk at once. A journal is written once for all that wait for it, so that eight files
/// take hardly longer than one.
const N_SYNCING: usize = 8;

/// Takes finished items and puts them into the store on a thread of its own.
pub(crate) struct Keeper<'a> {
    finished: SyncSender<ItemId>,
    waiting: &'a Waiting,
}

/// The items that are finished and not yet in the store.
type Waiting = Mutex<HashSet<ItemId>>;

impl Keeper<'_> {
    /// Whether an item is in the store, or about to be.
    pub(crate) fn has(&self, place: &Workplace<'_>, id: ItemId) -> bool {
        // In this order: an item is in the store before it ceases to wait.
        locked(self.waiting).contains(&id) || place.store().has(id)
    }

    /// Has an item put into the store whose folder is finished.
    ///
    /// # Errors
    /// When an item before could not be put there: the work is to end, and [`Workplace::keeping`] returns why.
    pub(crate) fn keep(&self, id: ItemId) -> Result<(), SweepError> {
        locked(self.waiting).insert(id);
        self.finished.send(id).map_err(|_| Cancelled.into())
    }
}

impl Workplace<'_> {
    /// Does work that finishes items; returns when all of these are in the store, also those that were finished before the work failed.
    ///
    /// # Errors
    /// As the work, and when an item cannot be put into the store.
    pub(crate) fn keeping<T>(&self, work: impl FnOnce(&Keeper<'_>) -> Result<T, SweepError>) -> Result<T, SweepError> {
        let waiting = Waiting::default();
        thread::scope(|scope| {
            let (finished, received) = mpsc::sync_channel(MOST_WAITING);
            let keeping = scope.spawn(|| self.keep_all(received, &waiting));
            let result = work(&Keeper { finished, waiting: &waiting });
            // The sender is gone, so that the thread ends with what it received.
            keeping.join().unwrap_or_else(|cause| panic::resume_unwind(cause))?;
            result
        })
    }

    fn keep_all(&self, finished: Receiver<ItemId>, waiting: &Waiting) -> Result<(), SweepError> {
        while let Ok(first) = finished.recv() {
            let ids: Vec<ItemId> = once(first).chain(finished.try_iter().take(MOST_WAITING)).collect();
            self.keep_together(&ids)?;
            locked(waiting).retain(|id| !ids.contains(id));
        }
        Ok(())
    }

    /// Puts items into the store: first their files are brought to the disk, then they are moved, then the folders above are brought there.
    /// Where another maker was first, its item stays.
    pub(crate) fn keep_together(&self, ids: &[ItemId]) -> Result<(), SweepError> {
        let folders: Vec<PathBuf> = ids.iter().map(|id| self.unfinished(*id)).collect();
        let mut files = Vec::new();
        for folder in &folders {
            let cannot = SweepError::writing(folder);
            for entry in fs::read_dir(folder).map_err(&cannot)? {
                files.push(entry.map_err(&cannot)?.path());
            }
        }
        sync_all(files.iter().chain(&folders))?;
        let mut above = BTreeSet::new();
        for (id, made) in ids.iter().zip(&folders) {
            let place = self.store().item(*id);
            above.extend(make_above(self.store().folder(), &place).map_err(SweepError::writing(&place))?);
            move_into(made, &place).map_err(SweepError::writing(&place))?;
        }
        sync_all(above.iter())
    }
}

fn locked(waiting: &Waiting) -> std::sync::MutexGuard<'_, HashSet<ItemId>> {
    waiting.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes the folders above a place, from that of the store down; returns those whose entries change.
fn make_above(store: &Path, place: &Path) -> io::Result<Vec<PathBuf>> {
    let above = place.parent().unwrap_or(store);
    if above.is_dir() {
        return Ok(vec![above.to_owned()]);
    }
    fs::create_dir_all(above)?;
    Ok(above.ancestors().take_while(|folder| folder.starts_with(store)).map(Path::to_owned).collect())
}

fn move_into(made: &Path, place: &Path) -> io::Result<()> {
    match fs::rename(made, place) {
        // A folder that is not empty is never replaced.
        Err(_) if place.is_dir() => fs::remove_dir_all(made),
        other => other,
    }
}

/// Brings files and the entries of folders to the disk, some at a time.
fn sync_all<'a>(paths: impl Iterator<Item = &'a PathBuf>) -> Result<(), SweepError> {
    let paths: Vec<&PathBuf> = paths.collect();
    let next = AtomicUsize::new(0);
    let sync_some = || {
        while let Some(path) = paths.get(next.fetch_add(1, Ordering::Relaxed)) {
            sync(path).map_err(SweepError::writing(path))?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let others: Vec<_> = (1..N_SYNCING.min(paths.len())).map(|_| scope.spawn(sync_some)).collect();
        let own = sync_some();
        let others = others.into_iter().map(|other| other.join().unwrap_or_else(|cause| panic::resume_unwind(cause)));
        others.fold(own, Result::and)
    })
}

/// Brings a file or the entries of a folder to the disk; the latter where the system can.
fn sync(path: &Path) -> io::Result<()> {
    match path.is_dir() {
        false => OpenOptions::new().write(true).open(path)?.sync_all(),
        true if cfg!(unix) => File::open(path)?.sync_all(),
        true => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Store, store::tests::id};

    fn finish(place: &Workplace<'_>, id: ItemId) {
        fs::write(place.item(id).unwrap().join("report.json"), id.to_string()).unwrap();
    }

    #[test]
    fn what_is_finished_is_kept_when_the_work_fails() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(&folder.path().join("new/store"));
        let place = store.begin().unwrap();
        let ids: Vec<ItemId> = (0..3 * MOST_WAITING as u64).map(id).collect();
        let failed: Result<(), SweepError> = place.keeping(|keeper| {
            for id in &ids {
                assert!(!keeper.has(&place, *id));
                finish(&place, *id);
                keeper.keep(*id)?;
                assert!(keeper.has(&place, *id));
            }
            Err(SweepError::Id { found: "the work".to_owned() })
        });
        assert!(failed.unwrap_err().to_string().contains("the work"));
        for id in ids {
            assert_eq!(fs::read_to_string(store.item(id).join("report.json")).unwrap(), id.to_string());
        }
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1, "the lock");
    }

    #[test]
    fn an_item_that_cannot_be_kept_ends_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let place = store.begin().unwrap();
        // Where the items belong there is a file.
        fs::write(folder.path().join("items"), "").unwrap();
        let outcome = place.keeping(|keeper| {
            for n in 0.. {
                finish(&place, id(n));
                keeper.keep(id(n))?;
            }
            Ok(())
        });
        assert!(matches!(outcome, Err(SweepError::Write { .. })), "{outcome:?}");
    }

    #[test]
    fn folders_that_are_new_are_brought_to_the_disk_too() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("items/ab/abcd");
        let names = |paths: Vec<PathBuf>| -> Vec<String> {
            let of = |path: &PathBuf| path.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned();
            paths.iter().map(of).collect()
        };
        assert_eq!(names(make_above(folder.path(), &place).unwrap()), ["items/ab", "items", ""]);
        assert_eq!(names(make_above(folder.path(), &place).unwrap()), ["items/ab"]);
    }
}
