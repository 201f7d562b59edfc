//! Files of this crate: RON texts, built in or read.

use std::path::Path;

use serde::{Serialize, de::DeserializeOwned};

use crate::SensorError;

/// Returns the text of a file.
///
/// # Errors
/// Names a file that cannot be read.
pub(crate) fn read_text(path: &Path) -> Result<String, SensorError> {
    let read_error = |e: std::io::Error| SensorError::Read { path: path.to_owned(), reason: e.to_string() };
    dioptric_files::text::read(path).map_err(read_error)
}

/// Returns what a text holds; `origin` names it in errors.
///
/// # Errors
/// Names the line that cannot be read.
pub(crate) fn parse<T: DeserializeOwned>(text: &str, origin: &str) -> Result<T, SensorError> {
    dioptric_files::ron::from_text(text).map_err(|error| SensorError::Syntax {
        origin: origin.to_owned(),
        line: error.line,
        column: error.column,
        reason: error.reason,
    })
}

/// Returns a value as text, which reads back the same.
pub(crate) fn write(value: &impl Serialize) -> String {
    ron::ser::to_string_pretty(value, ron::ser::PrettyConfig::default()).expect("what this crate keeps can be written")
}
