//! What is wrong with the text of a file.

use crate::OpticsError;

/// What is wrong with the text of a lens file, and on which line where that is known.
pub(crate) struct TextError {
    pub(crate) line: Option<usize>,
    pub(crate) reason: String,
}

impl From<OpticsError> for TextError {
    fn from(error: OpticsError) -> Self {
        Self { line: None, reason: error.to_string() }
    }
}
