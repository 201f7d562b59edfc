//! What is wrong with the text of a file.

use crate::OpticsError;

/// What is wrong with the text of a lens file, and on which line where that is known.
#[derive(Clone, Debug)]
pub(crate) struct TextError {
    pub(crate) line: Option<usize>,
    pub(crate) reason: String,
}

impl TextError {
    /// Returns it as one sentence, with its line where that is known.
    pub(crate) fn in_words(&self) -> String {
        match self.line {
            Some(line) => format!("line {line}: {}", self.reason),
            None => self.reason.clone(),
        }
    }
}

impl From<OpticsError> for TextError {
    fn from(error: OpticsError) -> Self {
        Self { line: None, reason: error.to_string() }
    }
}
