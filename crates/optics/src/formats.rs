//! Lens files, told apart by their extension.

mod dat;

use std::{fs, path::Path};

use crate::{
    Lens, OpticsError,
    prescription::{TextError, lens_from_ron},
};

/// Reads a lens file.
pub(crate) fn read(path: &Path) -> Result<Lens, OpticsError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let reader: fn(&str, &str) -> Result<Lens, TextError> = match extension.as_str() {
        "ron" => |text, _| lens_from_ron(text),
        "dat" | "txt" => dat::lens_from_dat,
        _ => {
            let reason = format!("the extension '.{extension}' is no lens format; expected .ron or .dat");
            return Err(OpticsError::Io { path: path.to_owned(), reason });
        }
    };
    let text = fs::read_to_string(path)
        .map_err(|error| OpticsError::Io { path: path.to_owned(), reason: error.to_string() })?;
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    reader(&text, &name).map_err(|TextError { line, reason }| OpticsError::File { path: path.to_owned(), line, reason })
}
