//! What can be wrong with a rendering.

use std::path::PathBuf;

use dioptric_files::WriteError;
use dioptric_optics::OpticsError;
use dioptric_spectrum::{Cancelled, SpectrumError};

/// A rendering that cannot be made, or was stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackwardError {
    /// It was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A lens that cannot be used.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// Bands or samples that make no sense.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// A number that makes no sense.
    #[error("{what} is {found}, expected {expected}")]
    Setting {
        /// Which number, with its unit.
        what: &'static str,
        /// What was given.
        found: String,
        /// What is expected.
        expected: &'static str,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {reason}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A checkpoint that cannot be used.
    #[error("{}: {reason}", file.display())]
    Checkpoint {
        /// The file.
        file: PathBuf,
        /// What is wrong with it and what was expected.
        reason: String,
    },
}

impl BackwardError {
    pub(crate) fn setting(what: &'static str, found: impl ToString, expected: &'static str) -> Self {
        Self::Setting { what, found: found.to_string(), expected }
    }
}

impl From<WriteError> for BackwardError {
    fn from(WriteError { path, reason, .. }: WriteError) -> Self {
        Self::Write { file: path, reason }
    }
}
