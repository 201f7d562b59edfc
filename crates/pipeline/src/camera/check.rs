//! Checks of numbers in a file, which say where they stand.

use std::{ops::RangeInclusive, path::Path};

use dioptric_sensor::SensorError;

use crate::{PipelineError, ranges::range_of};

/// Where numbers come from, for the error that names them.
pub(crate) struct Checker<'a> {
    origin: String,
    text: &'a str,
}

impl<'a> Checker<'a> {
    /// Numbers of a file with this text.
    pub(crate) fn of_file(path: &Path, text: &'a str) -> Self {
        Self { origin: path.display().to_string(), text }
    }

    /// Numbers that are in no file.
    pub(crate) fn of_settings(name: &str) -> Self {
        Self { origin: name.to_owned(), text: "" }
    }

    /// Checks that a number is in the range of its key.
    ///
    /// # Panics
    /// When the key has none, which is a mistake of the program's.
    pub(crate) fn number(&self, key: &'static str, found: f64) -> Result<(), PipelineError> {
        let range = range_of(key).unwrap_or_else(|| panic!("'{key}' has a range"));
        if range.holds(found) {
            return Ok(());
        }
        self.wrong(key, &found.to_string(), &range.to_string())
    }

    /// Checks that a number is one of a range.
    pub(crate) fn count(
        &self,
        key: &'static str,
        found: usize,
        allowed: RangeInclusive<usize>,
    ) -> Result<(), PipelineError> {
        if allowed.contains(&found) {
            return Ok(());
        }
        self.wrong(key, &found.to_string(), &format!("{} to {}", allowed.start(), allowed.end()))
    }

    /// Says that the value of a key is wrong.
    pub(crate) fn wrong(&self, key: &'static str, found: &str, expected: &str) -> Result<(), PipelineError> {
        let origin = match self.line_of(key) {
            Some(line) => format!("{}:{line}", self.origin),
            None => self.origin.clone(),
        };
        Err(PipelineError::Value { origin, key, found: found.to_owned(), expected: expected.to_owned() })
    }

    /// Says what another crate finds wrong with the value of a key.
    pub(crate) fn refused(&self, key: &'static str, reason: &impl ToString) -> Result<(), PipelineError> {
        self.wrong(key, "", &reason.to_string())
    }

    /// Returns an error of the sensor's with the place of its key.
    pub(crate) fn of_sensor(&self, error: SensorError) -> PipelineError {
        let SensorError::Value { key, .. } = &error else { return error.into() };
        // The last part of a key is its word in the file.
        let line = self.line_of(key.rsplit('.').next().unwrap_or(key));
        let origin = line.map_or_else(|| self.origin.clone(), |line| format!("{}:{line}", self.origin));
        PipelineError::Setting { origin, reason: error }
    }

    /// Returns the 1-based line where a key first stands as a whole word, outside comments.
    fn line_of(&self, key: &str) -> Option<usize> {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let has_key = |line: &str| {
            let code = line.split("//").next().unwrap_or_default();
            code.split(|c| !is_word(c)).any(|word| word == key)
        };
        self.text.lines().position(has_key).map(|index| index + 1)
    }
}
