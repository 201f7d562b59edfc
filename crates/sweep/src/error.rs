//! What can go wrong between a plan and its store.

use std::path::{Path, PathBuf};

use dioptric_pipeline::PipelineError;
use dioptric_spectrum::Cancelled;

/// A plan that cannot be read, or a store that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// A file that cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A plan that is not RON, or whose words are not ours.
    #[error("{}:{line}:{column}: {reason}", path.display())]
    Syntax {
        /// The plan.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// An axis that varies nothing, or something that no camera has.
    #[error("{}: '{key}': {reason}", path.display())]
    Axis {
        /// The plan.
        path: PathBuf,
        /// What the axis sets.
        key: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A plan that makes no sense as a whole.
    #[error("{}: {reason}", path.display())]
    Plan {
        /// The plan.
        path: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A share of a sweep that is none.
    #[error("the shard is '{found}', expected I/N with I from 1 to N, as 3/100")]
    Shard {
        /// What was found.
        found: String,
    },
    /// A name that no item has.
    #[error("the name of an item is '{found}', expected 64 hexadecimal digits")]
    Id {
        /// What was found.
        found: String,
    },
    /// A store in which items are being made, or that an older system left without locks.
    #[error("a sweep is making items in {}: {} is in use; prune the store when it has ended", store.display(), by.display())]
    Busy {
        /// The store.
        store: PathBuf,
        /// What is in use.
        by: PathBuf,
    },
    /// An item that has another name here than where the plan was drawn up.
    #[error(
        "item {item} is called {found} here and {expected} where the plan was drawn up: its files, or the versions of dioptric, differ"
    )]
    Other {
        /// Its number.
        item: usize,
        /// Its name here.
        found: String,
        /// Its name there.
        expected: String,
    },
    /// A place of the store that cannot be written to.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that a camera is read from and that changed while the sweep ran.
    #[error("{} changed while the sweep ran; items after the change are not kept: start it again", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The camera, or the writing of its picture.
    #[error(transparent)]
    Pipeline(PipelineError),
    /// Work that was stopped on request.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<dioptric_files::WriteError> for SweepError {
    fn from(error: dioptric_files::WriteError) -> Self {
        Self::Pipeline(error.into())
    }
}

impl SweepError {
    /// Returns what makes of an error of the system that a file cannot be read.
    pub(crate) fn reading(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |error| Self::Read { path: path.to_owned(), reason: error.to_string() }
    }

    /// Returns what makes of an error of the system that a file cannot be written.
    pub(crate) fn writing(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |error| Self::Write { path: path.to_owned(), reason: error.to_string() }
    }
}

impl From<PipelineError> for SweepError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Pipeline(other),
        }
    }
}
