//! Files written whole or not at all, and the memory that files read may take.
#![doc = include_str!("../README.md")]

mod hidden;
pub mod memory;
pub mod ron;
mod staged;
mod target;
pub mod text;

use std::{
    io,
    path::{Path, PathBuf},
};

pub use hidden::{HiddenFolder, Leftover, unfinished};
pub use staged::{Staged, write};
pub use target::is_stream;

/// A file or folder that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {reason}", path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// Why.
    pub reason: String,
    /// Whether whoever read it is gone: the closed end of a pipe.
    pub is_closed: bool,
}

impl WriteError {
    /// Returns the error of a path.
    pub fn of(path: &Path, reason: impl ToString) -> Self {
        Self { path: path.to_owned(), reason: reason.to_string(), is_closed: false }
    }

    fn of_io(path: &Path, error: &io::Error) -> Self {
        Self { is_closed: error.kind() == io::ErrorKind::BrokenPipe, ..Self::of(path, error) }
    }
}
