//! Camera profiles in files of their own (DCP): TIFF files that hold the fields of a DNG file's profile (DNG 1.6, chapter 6).

use std::{fs, path::Path, sync::Arc};

use dioptric_files::memory;

use super::{
    tags::{COLOR_MATRIX_1, MODEL, PROFILE_NAME, UNIQUE_CAMERA_MODEL},
    tiff_reader::{Fields, TiffReader},
};
use crate::SensorError;

/// A camera profile from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileFile {
    // Invariant: a profile or a DNG file, whose first directory has a color matrix.
    bytes: Arc<[u8]>,
}

impl ProfileFile {
    /// Reads a camera profile (`.dcp`), or the one that a DNG file has.
    ///
    /// # Errors
    /// When the file cannot be read, is neither, or has no color matrix.
    pub fn read(path: &Path) -> Result<Self, SensorError> {
        let wrong = |reason: String| SensorError::Read { path: path.to_owned(), reason };
        let length = fs::metadata(path).map_err(|e| wrong(e.to_string()))?.len();
        memory::check(length, length).map_err(|e| wrong(e.to_string()))?;
        let bytes = fs::read(path).map_err(|e| wrong(e.to_string()))?;
        Self::from_bytes(&bytes).map_err(wrong)
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let profile = Self { bytes: bytes.into() };
        if !profile.fields()?.has(COLOR_MATRIX_1) {
            return Err("has no color matrix, expected a camera profile (DCP) or a DNG file with one".to_owned());
        }
        Ok(profile)
    }

    pub(super) fn fields(&self) -> Result<Fields<'_>, String> {
        let neither =
            |_| "is no camera profile, expected a DCP file, which begins with IIRC or MMCR, or a DNG file".to_owned();
        let (file, first) = match TiffReader::of_profile(&self.bytes) {
            Some(found) => found?,
            None => TiffReader::new(&self.bytes).map_err(neither)?,
        };
        file.fields_at(first)
    }

    /// The name of the profile, where it has one.
    pub fn name(&self) -> Option<String> {
        self.fields().ok()?.text(PROFILE_NAME)
    }

    /// Says that it is for another camera than that of a file, if it is.
    pub(super) fn note(&self, file: &Fields<'_>) -> Option<String> {
        let of = self.fields().ok()?.text(UNIQUE_CAMERA_MODEL)?;
        let camera = file.text(UNIQUE_CAMERA_MODEL).or_else(|| file.text(MODEL))?;
        (of != camera).then(|| {
            format!("the profile is for {of}, the frame is of {camera}: its colors may be those of another camera")
        })
    }
}
