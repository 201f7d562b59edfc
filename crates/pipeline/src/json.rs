//! Files of results within a folder that is staged as a whole.

use std::{fs, path::Path};

use serde::Serialize;

use crate::PipelineError;

/// Writes a value as JSON.
///
/// # Errors
/// When the file cannot be written.
pub fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<(), PipelineError> {
    let json = serde_json::to_vec_pretty(value)
        .map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })?;
    write_file(path, &json)
}

/// Writes bytes to a file.
///
/// # Errors
/// When it cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    fs::write(path, bytes).map_err(|e| PipelineError::Write { path: path.to_owned(), reason: e.to_string() })
}
