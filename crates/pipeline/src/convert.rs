//! Lenses from one file format to another.

use std::path::Path;

use dioptric_optics::LensFile;

use crate::{LensChoice, PipelineError};

/// Writes the lens that `input` means (a file or a built-in name) in the format that `target`'s extension tells, to
/// `path`, which may be another place.
///
/// # Errors
/// When there is no such lens, or the format cannot be written.
pub fn convert_lens(input: &str, target: &Path, path: &Path) -> Result<(), PipelineError> {
    let lens = LensChoice::named(input).open()?;
    let extension = target.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let cannot = |reason: String| PipelineError::Write { path: target.to_owned(), reason };
    let file = LensFile::from(lens);
    let text = match extension.as_str() {
        "ron" => file.lens.to_ron(),
        "dat" => file.to_dat()?,
        "json" => file.to_omni_json()?,
        "zmx" => file.to_zmx()?,
        _ => {
            let expected = "expected .ron, .dat, .json (ISET) or .zmx";
            return Err(cannot(format!("'.{extension}' is no lens format that can be written; {expected}")));
        }
    };
    std::fs::write(path, text).map_err(|e| cannot(e.to_string()))
}
