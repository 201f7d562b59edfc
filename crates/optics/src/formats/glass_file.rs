//! Files of glasses, told apart by their extension.

use std::path::Path;

use dioptric_files::text;

use crate::{GlassCatalogue, OpticsError};

use super::{agf, decode::bytes_of, rii_yaml, text_error::TextError};

impl GlassCatalogue {
    /// Reads a file of glasses, by its extension: `.agf` (Zemax), or `.yml` or `.yaml` (one material, as
    /// refractiveindex.info has them). The file's name is the maker's of the former, the material's of the latter.
    ///
    /// # Errors
    /// When the file cannot be read or is not what it should be; the message names the file, line and key.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        Self::from_bytes(path, &bytes_of(path)?)
    }

    /// Reads a file of glasses from its bytes; the path gives the format and the name, and is not opened.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, OpticsError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let read = match extension.as_str() {
            "agf" => agf::glasses_from_agf(&text::of_bytes(bytes), &name.to_uppercase()),
            "yml" | "yaml" => rii_yaml::glass_from_yaml(&text::of_bytes(bytes), &name).map(|glass| vec![glass]),
            _ => {
                let reason = format!("the extension '.{extension}' is no glass format; expected .agf, .yml or .yaml");
                return Err(OpticsError::Io { path: path.to_owned(), reason });
            }
        };
        let wrong = |TextError { line, reason }| OpticsError::File { path: path.to_owned(), line, reason };
        read.map(Self::new).map_err(wrong)
    }
}
