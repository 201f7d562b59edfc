//! The items of a sweep made, one after the other.

use std::path::Path;

use dioptric_pipeline::{Camera, PaintingFolder, Progress, Silent};
use dioptric_spectrum::Cancel;
use serde::Serialize;

use crate::{
    ItemId, Plan, Shard, Status, Store, Sweep, SweepError, Workplace,
    cameras::Cameras,
    item::{Bench, Taken},
    keep::Keeper,
};

/// Receives how far a sweep is, beside how far the item is that is being made.
pub trait SweepProgress: Progress {
    /// So many items of all that are to be made are there.
    fn items(&self, n_made: usize, n_all: usize) {
        let _ = (n_made, n_all);
    }
}

impl SweepProgress for Silent {}

/// What came of a sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Made {
    /// Items that were there before.
    pub n_there: usize,
    /// Items made now.
    pub n_done: usize,
    /// Items made now whose camera was refused.
    pub n_refused: usize,
    /// Items whose files cannot be read: they are not there, and tried again by the next sweep.
    pub n_failed: usize,
    /// Why the first of these could not be made.
    pub first_failure: Option<String>,
    /// Items left to be made.
    pub n_left: usize,
}

/// What came of making one item.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was there before.
    There,
    /// It has a picture.
    Done,
    /// Its camera was refused.
    Refused,
    /// A file that it is made from cannot be read, for this reason: the item is not there, and may be tried again.
    Failed(String),
}

impl Made {
    fn count(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::There => self.n_there += 1,
            Outcome::Done => self.n_done += 1,
            Outcome::Refused => self.n_refused += 1,
            Outcome::Failed(reason) => {
                self.n_failed += 1;
                self.first_failure.get_or_insert(reason);
            }
        }
    }

    /// Items that were tried now.
    fn n_tried(&self) -> usize {
        self.n_done + self.n_refused + self.n_failed
    }
}

impl Sweep {
    /// Makes those items of a shard that are not in the store of a workplace, as many as `limit` at most.
    ///
    /// Each item is there whole or not at all, whenever the work ends. Items are the same to the byte whatever else was made
    /// before, beside or after them, and for any number of threads. An item whose files cannot be read is left out, and the others
    /// are made. Finished items are brought to the disk while others are made, up to 16 of them together; all are there on return.
    ///
    /// # Errors
    /// When the store cannot be written to, a file that a camera is made from changed, or the work is cancelled.
    pub fn make(
        &self,
        place: &Workplace<'_>,
        shard: Shard,
        limit: Option<usize>,
        progress: &dyn SweepProgress,
        cancel: &Cancel,
    ) -> Result<Made, SweepError> {
        let mut missing: Vec<usize> = self.items(shard).collect();
        let n_all = missing.len();
        missing.retain(|item| !place.store().has(self.id(*item)));
        place.keeping(|keeper| self.make_missing(&missing, n_all, (place, keeper), limit, (progress, cancel)))
    }

    fn make_missing(
        &self,
        missing: &[usize],
        n_all: usize,
        (place, keeper): (&Workplace<'_>, &Keeper<'_>),
        limit: Option<usize>,
        (progress, cancel): (&dyn SweepProgress, &Cancel),
    ) -> Result<Made, SweepError> {
        let n_there = n_all - missing.len();
        let mut made = Made { n_there, ..Made::default() };
        let mut bench = Bench::new(self.paintings().cloned(), &self.plan().keep);
        for (n, &item) in missing.iter().enumerate() {
            cancel.check()?;
            if limit.is_some_and(|limit| made.n_tried() >= limit) {
                made.n_left = missing.len() - n;
                break;
            }
            progress.items(n_there + n, n_all);
            let id = self.id(item);
            // Two points of a plan may be one item, and others may make items too.
            if keeper.has(place, id) {
                made.count(Outcome::There);
                continue;
            }
            let camera = self.camera(item)?;
            made.count(make_item(self.cameras(), (&camera, id), (place, keeper), &mut bench, (progress, cancel))?);
        }
        Ok(made)
    }

    /// Counts the items of a shard by what came of them: done, refused, missing.
    pub fn counts(&self, store: &Store, shard: Shard) -> [usize; 3] {
        let mut counts = [0; 3];
        for item in self.items(shard) {
            counts[match store.status(self.id(item)) {
                Status::Done => 0,
                Status::Refused => 1,
                Status::Missing => 2,
            }] += 1;
        }
        counts
    }
}

/// Makes items of a plan that another process drew up, each known by its number and its name.
///
/// Stages are shared by items that follow one another, from one call to the next as well.
#[derive(Debug)]
pub struct Maker {
    cameras: Cameras,
    bench: Bench,
}

impl Maker {
    /// Opens a plan; `path` names it in errors, and its paths are relative to that one's folder. No item is drawn up yet.
    ///
    /// # Errors
    /// When the base of the plan cannot be read.
    pub fn of(plan: Plan, path: &Path, paintings: Option<PaintingFolder>) -> Result<Self, SweepError> {
        let bench = Bench::new(paintings, &plan.keep);
        Ok(Self { cameras: Cameras::of(plan, path)?, bench })
    }

    /// Makes those of some items that are not there, one after the other; returns what came of each.
    ///
    /// # Errors
    /// As [`Sweep::make`], and when an item has another name here: then its files, or the version of the program, differ from those
    /// of the process that drew up the plan.
    pub fn make(
        &mut self,
        place: &Workplace<'_>,
        items: &[(usize, ItemId)],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Vec<Outcome>, SweepError> {
        place.keeping(|keeper| {
            items.iter().map(|item| self.make_one(*item, (place, keeper), (progress, cancel))).collect()
        })
    }

    fn make_one(
        &mut self,
        (item, id): (usize, ItemId),
        (place, keeper): (&Workplace<'_>, &Keeper<'_>),
        (progress, cancel): (&dyn Progress, &Cancel),
    ) -> Result<Outcome, SweepError> {
        cancel.check()?;
        if keeper.has(place, id) {
            return Ok(Outcome::There);
        }
        if item >= self.cameras.plan().count() {
            let reason = format!("it has no item {item}, but {} items", self.cameras.plan().count());
            return Err(SweepError::Plan { path: self.cameras.path().to_owned(), reason });
        }
        let camera = self.cameras.camera(item)?;
        let found = self.cameras.key(&camera)?.id;
        if found != id {
            return Err(SweepError::Other { item, found: found.to_string(), expected: id.to_string() });
        }
        make_item(&self.cameras, (&camera, id), (place, keeper), &mut self.bench, (progress, cancel))
    }
}

/// Makes an item that is not there and has it put into the store.
fn make_item(
    cameras: &Cameras,
    (camera, id): (&Camera, ItemId),
    (place, keeper): (&Workplace<'_>, &Keeper<'_>),
    bench: &mut Bench,
    (progress, cancel): (&dyn Progress, &Cancel),
) -> Result<Outcome, SweepError> {
    let taken = bench.make(camera, &place.item(id)?, progress, cancel)?;
    cameras.inputs().check_unchanged(camera)?;
    let outcome = match taken {
        Taken::Picture => Outcome::Done,
        Taken::Refused => Outcome::Refused,
        Taken::Unreadable(reason) => {
            place.discard(id)?;
            return Ok(Outcome::Failed(reason));
        }
    };
    keeper.keep(id)?;
    Ok(outcome)
}
