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

/// What is wrong with a file that is cut short.
pub(crate) const TRUNCATED: &str = "the file ends too early (truncated): expected all of it";
/// What libraries say of a file that ends before they have all.
const CUT: [&str; 9] = [
    "missing bytes",
    "unexpected eof",
    "unexpected end of file",
    "fill whole buffer",
    "find eocd",
    "no lzw end code",
    "end of image",
    "no more bytes",
    "not enough bytes",
];
/// What they say of one that does not begin as its format does.
const OTHER: [&str; 6] = [
    "identifier missing",
    "signature not found",
    "signature invalid",
    "invalid png signature",
    "illegal start bytes",
    "riff signature",
];
/// What they put before that.
const BEFORE: [&str; 9] = [
    "format error: ",
    "unsupported error: ",
    "invalid: ",
    "not supported: ",
    "invalid Zip archive: ",
    "unsupported Zip archive: ",
    "HDF5 format error: ",
    "Error parsing image. ",
    "filter error: ",
];

/// Says what is wrong with a file that a library refuses, and the way on: it is cut short, of another format than this, of a variant that is not
/// read (in whose place another is expected), or damaged.
pub(crate) fn fault(format: &str, error: impl ToString, expected_variant: Option<&str>) -> String {
    // By what it holds, whatever its name says.
    let text = error.to_string();
    let own = text.strip_prefix("Format error decoding ").and_then(|rest| rest.split(':').next());
    let format = own.map_or(format.to_owned(), str::to_uppercase);
    let said = said(text);
    let small = said.to_lowercase();
    let is_of = |words: &[&str]| words.iter().any(|words| small.contains(words));
    if is_of(&CUT) {
        return TRUNCATED.to_owned();
    }
    if is_of(&OTHER) && !small.contains("corrupt") {
        return format!("it is no {format}, as its name says: it begins otherwise");
    }
    // What is known by a name or number is whole.
    const VARIANT: [&str; 4] = ["version", "unsupported", "not supported", "cannot be enumerated"];
    let other = is_of(&VARIANT).then_some("it saved as an older version of the format, or another kind of it");
    match expected_variant.or(other) {
        Some(expected) => format!("it is {format} of a kind that is not read ({said}): expected {expected}"),
        None => format!("its {format} is damaged ({said}): expected an undamaged copy, or the file saved anew"),
    }
}

/// Refuses what stands in the place of a file: nothing, a pointer of Git LFS, a page of the web.
pub(crate) fn check_whole(path: &Path) -> Result<(), SceneError> {
    let mut start = vec![];
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    file.take(64).read_to_end(&mut start).map_err(|error| unreadable(path, error))?;
    let text = String::from_utf8_lossy(&start).trim_start().to_lowercase();
    let what = match text.as_str() {
        _ if start.is_empty() => "it is empty: expected a file with something in it",
        text if text.starts_with("version https://git-lfs") => {
            "it is a pointer of Git LFS in the place of the file: expected the file itself (git lfs pull)"
        }
        text if text.starts_with("<!doctype html") || text.starts_with("<html") => {
            "it is a page of the web in the place of the file: expected the file itself"
        }
        _ => return Ok(()),
    };
    Err(unreadable(path, what))
}

/// Returns the start of what another crate says is wrong, in a line, without the words that it puts before.
fn said(error: impl ToString) -> String {
    const MOST_CHARACTERS: usize = 200;
    let text = error.to_string().replace(['\n', '\r'], " ");
    let text = match text.strip_prefix("Format error decoding ").and_then(|rest| rest.split_once(": ")) {
        Some((_, rest)) => rest,
        None => &text,
    };
    let mut text = text;
    while let Some(rest) = BEFORE.iter().find_map(|before| text.strip_prefix(before)) {
        text = rest;
    }
    // A list of what a chunk is tells nobody anything.
    let text = text.split(" while decoding ChunkType").next().unwrap_or_default().replace("(invalid: ", "(");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_libraries_say_becomes_one_of_four_sentences() {
        for (error, variant, expected) in [
            ("reference to missing bytes", None, TRUNCATED),
            ("failed to fill whole buffer", Some("another"), TRUNCATED),
            ("invalid Zip archive: Could not find EOCD", None, TRUNCATED),
            ("invalid: file identifier missing", None, "it is no EXR, as its name says: it begins otherwise"),
            (
                "invalid data layout version: 5",
                None,
                "it is EXR of a kind that is not read (invalid data layout version: 5): expected it saved as an older version of the \
                 format, or another kind of it",
            ),
            (
                "not supported: deep data",
                Some("flat"),
                "it is EXR of a kind that is not read (deep data): expected flat",
            ),
            (
                "Format error decoding Png: CRC error: expected 1 have 2 while decoding ChunkType { type: IDAT }",
                None,
                "its PNG is damaged (CRC error: expected 1 have 2): expected an undamaged copy, or the file saved anew",
            ),
        ] {
            assert_eq!(fault("EXR", error, variant), expected, "{error}");
        }
    }

    #[test]
    fn what_stands_in_the_place_of_a_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for (text, word) in [
            ("", "it is empty"),
            ("version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
            ("\n<!DOCTYPE html>", "a page of the web"),
        ] {
            std::fs::write(&path, text).unwrap();
            assert!(check_whole(&path).unwrap_err().to_string().contains(word), "{text}");
        }
    }
}
