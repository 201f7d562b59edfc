//! The bytes of a file.

use std::{fs, path::Path};

use crate::OpticsError;

/// The largest lens file, bytes: far more than any lens needs.
const LARGEST_FILE: u64 = 16 << 20;

/// Returns what a file holds, unless it is larger than any that this crate reads.
pub(super) fn bytes_of(path: &Path) -> Result<Vec<u8>, OpticsError> {
    let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
    let n_bytes = fs::metadata(path).map_err(|error| failed(error.to_string()))?.len();
    if n_bytes > LARGEST_FILE {
        return Err(failed(format!("the file has {n_bytes} bytes; expected at most {LARGEST_FILE}")));
    }
    fs::read(path).map_err(|error| failed(error.to_string()))
}
