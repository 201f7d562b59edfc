//! Where paintings of the still life are kept from run to run.

use std::path::PathBuf;

use dioptric_pipeline::PaintingFolder;
use pyo3::prelude::*;

/// Returns the user's folder of paintings, which the program shares; `None` where there is none or none is wanted.
pub(crate) fn painting_folder(py: Python<'_>) -> Option<PaintingFolder> {
    // The file of this module, not the interpreter's, tells builds apart.
    let module: PathBuf = py.import("dioptric._native").ok()?.getattr("__file__").ok()?.extract().ok()?;
    PaintingFolder::of_user(&module)
}
