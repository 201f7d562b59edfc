//! The items of a sweep made, one after the other.

use dioptric_pipeline::{Progress, Silent};
use dioptric_spectrum::Cancel;
use serde::Serialize;

use crate::{Shard, Status, Store, Sweep, SweepError, Workplace, item::Bench};

/// Receives how far a sweep is, beside how far the item is that is being made.
pub trait SweepProgress: Progress {
    /// So many items of all that are to be made are there.
    fn items(&self, n_made: usize, n_all: usize) {
        let _ = (n_made, n_all);
    }
}

impl SweepProgress for Silent {}

/// What came of a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Made {
    /// Items that were there before.
    pub n_there: usize,
    /// Items made now.
    pub n_done: usize,
    /// Items made now whose camera was refused.
    pub n_refused: usize,
    /// Items left to be made.
    pub n_left: usize,
}

impl Sweep {
    /// Makes those items of a shard that are not in the store of a workplace, as many as `limit` at most.
    ///
    /// Each item is there whole or not at all, whenever the work ends. Items are the same to the byte whatever else was made
    /// before, beside or after them, and for any number of threads.
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
        let store = place.store();
        let mut missing: Vec<usize> = self.items(shard).collect();
        let n_all = missing.len();
        missing.retain(|item| !store.has(self.id(*item)));
        let mut made = Made { n_there: n_all - missing.len(), ..Made::default() };
        let mut bench = Bench::default();
        for (n, &item) in missing.iter().enumerate() {
            cancel.check()?;
            if limit.is_some_and(|limit| made.n_done + made.n_refused >= limit) {
                made.n_left = missing.len() - n;
                break;
            }
            progress.items(made.n_there + n, n_all);
            let id = self.id(item);
            // Two points of a plan may be one item, and others may make items too.
            if store.has(id) {
                made.n_there += 1;
                continue;
            }
            let camera = self.camera(item)?;
            let has_picture = bench.make(&camera, &place.item(id)?, progress, cancel)?;
            self.inputs().check_unchanged(&camera)?;
            place.keep(id)?;
            if has_picture { made.n_done += 1 } else { made.n_refused += 1 }
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
