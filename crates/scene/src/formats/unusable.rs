//! Errors of files of scenes, by their paths.

use std::{fs::File, io::Read, path::Path};

use dioptric_files::{Staged, WriteError, memory};

use crate::SceneError;

impl From<WriteError> for SceneError {
    fn from(WriteError { path, reason, .. }: WriteError) -> Self {
        Self::Unwritable { file: path, reason }
    }
}

/// Opens what becomes the file at `path` for writing and for reading what was written.
pub(crate) fn open_new(staged: &Staged, path: &Path) -> Result<File, SceneError> {
    let opened = File::options().read(true).write(true).create(true).truncate(true).open(staged.path());
    opened.map_err(|error| unwritable(path, error))
}

/// Returns the error of a file that cannot be written.
pub(crate) fn unwritable(path: &Path, reason: impl ToString) -> SceneError {
    SceneError::Unwritable { file: path.to_owned(), reason: reason.to_string() }
}

/// Returns the error of a file that cannot be read.
pub(crate) fn unreadable(path: &Path, reason: impl ToString) -> SceneError {
    SceneError::Unreadable { file: path.to_owned(), reason: reason.to_string() }
}

/// Returns an error of what was made of a file with the file's name.
pub(crate) fn in_file(path: &Path, error: &SceneError) -> SceneError {
    SceneError::Units { file: path.to_owned(), reason: error.to_string() }
}

/// Returns the start of what another crate says is wrong, in a line.
pub(crate) fn said(error: impl ToString) -> String {
    const MOST_CHARACTERS: usize = 200;
    let text = error.to_string().replace(['\n', '\r'], " ");
    match text.char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

/// Checks before a file is read that the memory it takes is allowed.
pub(crate) fn check_memory(path: &Path, bytes: u64, length: u64) -> Result<(), SceneError> {
    memory::check(bytes, length).map_err(|reason| SceneError::TooLarge { file: path.to_owned(), reason })
}

/// Checks that what is made of a file fits the memory that the program may take, however small the file.
pub(crate) fn check_made(path: &Path, bytes: u64) -> Result<(), SceneError> {
    check_memory(path, bytes, u64::MAX)
}

/// Whether a file begins with these bytes.
pub(crate) fn starts_with(path: &Path, start: &[u8]) -> Result<bool, SceneError> {
    let mut bytes = vec![];
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    file.take(start.len() as u64).read_to_end(&mut bytes).map_err(|error| unreadable(path, error))?;
    Ok(bytes == start)
}
