//! What came of all items of a plan.

use std::{fs, path::Path};

use dioptric_pipeline::PipelineError;
use rayon::prelude::*;

use crate::{
    ItemId, Status, Store, Sweep, SweepError, Value,
    item::{REFUSED, Refusal},
    metrics::{Metrics, metrics},
};

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

/// What came of all items of a plan, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Index {
    /// What to call it: the name of the plan's file.
    pub name: String,
    /// The keys that are varied.
    pub keys: Vec<String>,
    /// A row an item.
    pub rows: Vec<IndexRow>,
}

impl Index {
    /// Reads what came of the items of a plan from the store.
    ///
    /// # Errors
    /// When a file of the store cannot be read.
    pub fn of(sweep: &Sweep, store: &Store) -> Result<Self, SweepError> {
        let rows = (0..sweep.len()).into_par_iter().map(|item| IndexRow::of(sweep, store, item));
        Ok(Self {
            name: sweep.path().file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            keys: sweep.plan().keys().into_iter().map(str::to_owned).collect(),
            rows: rows.collect::<Result<_, _>>()?,
        })
    }

    /// The names of all metrics, in the order of a report.
    pub fn metrics(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for row in &self.rows {
            let mut after = 0;
            for (name, _) in &row.metrics {
                match names.iter().position(|known| known == name) {
                    Some(place) => after = place + 1,
                    None => {
                        names.insert(after, name);
                        after += 1;
                    }
                }
            }
        }
        names
    }
}

impl IndexRow {
    fn of(sweep: &Sweep, store: &Store, item: usize) -> Result<Self, SweepError> {
        let id = sweep.id(item);
        let status = store.status(id);
        let folder = store.item(id);
        let read = |name: &str| {
            let path = folder.join(name);
            fs::read(&path).map(|bytes| (bytes, path.clone())).map_err(SweepError::reading(&path))
        };
        let wrong = |path: &Path, error: serde_json::Error| {
            SweepError::Pipeline(PipelineError::Read { path: path.to_owned(), reason: error.to_string() })
        };
        let (mut reason, mut numbers) = (None, Metrics::new());
        match status {
            Status::Done => {
                let (bytes, path) = read("report.json")?;
                numbers = metrics(&bytes).map_err(|error| wrong(&path, error))?;
            }
            Status::Refused => {
                let (bytes, path) = read(REFUSED)?;
                reason = Some(serde_json::from_slice::<Refusal>(&bytes).map_err(|error| wrong(&path, error))?.reason);
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
