//! What pickles call to make things again, by name.

use dioptric_pipeline::Quality;
use pyo3::prelude::*;

/// Returns the function of this module of a name, which a pickle calls.
pub(crate) fn restorer<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("dioptric._native")?.getattr(name)
}

/// Returns the quality of a word.
pub(crate) fn quality_of(word: &str) -> Option<Quality> {
    Some(match word {
        "full" => Quality::Full,
        "draft" => Quality::Draft,
        "preview" => Quality::Preview,
        "sketch" => Quality::Sketch,
        _ => return None,
    })
}
