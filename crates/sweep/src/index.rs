//! What came of all items of a plan.

use std::fs;

use dioptric_pipeline::PipelineError;
use rayon::prelude::*;

use crate::{
    ItemId, Status, Store, Sweep, SweepError, Value,
    item::{REFUSED, Refusal, read_metrics},
    metrics::Metrics,
};

/// So many items are read at a time, by all threads.
const ROWS_AT_ONCE: usize = 1024;

/// What came of one item.
#[derive(Clone, Debug, PartialEq)]
pub struct IndexRow {
    /// Its number in the plan, from 0.
    pub item: usize,
    /// Its name.
    pub id: ItemId,
    /// Whether it is there.
    pub status: Status,
    /// Why its camera was refused.
    pub reason: Option<String>,
    /// What it sets, in the order of the plan's keys.
    pub values: Vec<Value>,
    /// Numbers of its report.
    pub metrics: Metrics,
}

/// What came of all items of a plan, in its order, read from a store as it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Index<'a> {
    pub(crate) sweep: &'a Sweep,
    pub(crate) store: &'a Store,
}

impl<'a> Index<'a> {
    /// The index of a plan and a store; nothing is read yet.
    pub fn of(sweep: &'a Sweep, store: &'a Store) -> Self {
        Self { sweep, store }
    }

    /// What to call it: the name of the plan's file.
    pub fn name(&self) -> String {
        self.sweep.path().file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The keys that are varied.
    pub fn keys(&self) -> Vec<&'a str> {
        self.sweep.plan().keys()
    }

    /// Reads what came of each item, a row an item; about a thousand are held at a time.
    ///
    /// A row is an error where a file of the store cannot be read.
    pub fn rows(&self) -> impl Iterator<Item = Result<IndexRow, SweepError>> + use<'a> {
        let (Self { sweep, store }, n_items) = (*self, self.sweep.len());
        (0..n_items).step_by(ROWS_AT_ONCE).flat_map(move |first| {
            let items = first..n_items.min(first + ROWS_AT_ONCE);
            items.into_par_iter().map(|item| IndexRow::of(sweep, store, item)).collect::<Vec<_>>()
        })
    }
}

impl IndexRow {
    fn of(sweep: &Sweep, store: &Store, item: usize) -> Result<Self, SweepError> {
        let id = sweep.id(item);
        let status = store.status(id);
        let folder = store.item(id);
        let (mut reason, mut numbers) = (None, Metrics::new());
        match status {
            Status::Done => numbers = read_metrics(&folder, &sweep.plan().keep)?,
            Status::Refused => {
                let path = folder.join(REFUSED);
                let bytes = fs::read(&path).map_err(SweepError::reading(&path))?;
                let refusal: Refusal = serde_json::from_slice(&bytes)
                    .map_err(|error| PipelineError::Read { path, reason: error.to_string() })?;
                reason = Some(refusal.reason);
            }
            Status::Missing => {}
        }
        Ok(Self { item, id, status, reason, values: sweep.values(item), metrics: numbers })
    }
}

impl Status {
    /// The status in one word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Refused => "refused",
            Self::Missing => "missing",
        }
    }
}
