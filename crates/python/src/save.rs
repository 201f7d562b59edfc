//! Where results are written.

use std::path::Path;

use dioptric_pipeline::{PipelineError, picture_png};
use dioptric_sensor::Picture;
use pyo3::PyResult;

use crate::errors::wrong;

/// Returns whether a path is that of a picture, and not of a folder.
pub(crate) fn is_picture(path: &Path) -> PyResult<bool> {
    if path.is_dir() {
        return Ok(false);
    }
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("png") => Ok(true),
        Some(_) => Err(wrong("path", format!("'{}'", path.display()), "a folder, or a file that ends in .png")),
        None => Ok(false),
    }
}

/// Writes a picture whole or not at all; returns the name of the file.
pub(crate) fn write_picture(picture: &Picture, path: &Path) -> Result<Vec<String>, PipelineError> {
    dioptric_files::write(path, &picture_png(picture)?)?;
    Ok(vec![path.file_name().unwrap_or_default().to_string_lossy().into_owned()])
}
