//! Raw files of any camera, developed.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use dioptric_analysis::DngReport;
use dioptric_pipeline::{DevelopedFile, PipelineError, Staged, picture_png, write_json};
use ndarray::Array3;
use pyo3::{
    prelude::*,
    types::{PyBytes, PyDict},
};

use crate::{
    changes::changed_processing,
    save::{is_picture, write_picture},
    serial::to_python,
    view::{plane_or_planes, raw_planes, rgb8, view},
    worker::{Follower, run},
};

/// A raw file and the picture that was made of it.
///
/// Arrays are read-only views of the results; they hold what they need, and outlive the object. Row 0 is the top.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Developed {
    of: Arc<DevelopedFile>,
    rgb: OnceLock<Arc<Array3<u8>>>,
}

impl Developed {
    fn save_into(&self, folder: &Path) -> Result<Vec<String>, PipelineError> {
        let staged = Staged::folder(folder)?;
        let mut names = self.of.write_pictures(&[], staged.path())?;
        write_json(&staged.path().join("report.json"), &DngReport::new(&self.of))?;
        names.push("report.json".to_owned());
        staged.commit()?;
        Ok(names)
    }
}

/// Reads a raw file (DNG) of any camera and develops its frame, as ``dioptric develop`` does.
///
/// Parameters
/// ----------
/// path : str or path
///     A DNG file.
/// white, demosaic, denoise, highlights, color, sharpen_px, local_tone, perspective, brightness, curve, space, defect_threshold
///     As of `Camera.with_`. ``lens_corrections`` need a simulated lens and are refused.
///
/// Returns
/// -------
/// Developed
///
/// Raises
/// ------
/// OSError
///     The file cannot be read, or is no DNG file that is known.
/// ValueError
///     The processing asks for what a raw file does not hold.
#[pyfunction]
#[pyo3(signature = (path, **options))]
pub(crate) fn develop(py: Python<'_>, path: PathBuf, options: Option<&Bound<'_, PyDict>>) -> PyResult<Developed> {
    let processing = changed_processing("develop", options)?;
    let of = run(py, &Follower::nobody(), |_, _| DevelopedFile::read(&path, processing))?;
    Ok(Developed { of: Arc::new(of), rgb: OnceLock::new() })
}

#[pymethods]
impl Developed {
    /// Rows and columns of the picture.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let picture = &self.of.developed.picture;
        (picture.rows(), picture.columns())
    }

    /// The raw samples that are shown; (rows, columns) uint16, a tuple of planes where every pixel has several filters.
    #[getter]
    fn raw<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, raw_planes(py, &self.of, |of| &of.file.raw)?)
    }

    /// The picture's codes, 0 to 1; (rows, columns, 3) float32.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.of, |of| of.developed.picture.codes.view())
    }

    /// The picture's 8-bit codes; (rows, columns, 3) uint8, rounded at the first access.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rgb = self.rgb.get_or_init(|| rgb8(&self.of.developed.picture));
        view(py, rgb, |rgb| rgb.view())
    }

    /// What the file asks for and was not done, a sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        DngReport::new(&self.of).notes
    }

    /// Returns what the file holds and what was made of it; the keys of ``report.json`` of ``dioptric develop``.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &DngReport::new(&self.of))
    }

    /// Returns the picture as the bytes of a PNG file, equal to the ``picture.png`` of ``dioptric develop``.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let png = run(py, &Follower::nobody(), |_, _| picture_png(&self.of.developed.picture))?;
        Ok(PyBytes::new(py, &png))
    }

    /// Writes the picture to a path that ends in ``.png``, else ``picture.png`` and ``report.json`` into a folder. Files appear whole or not at all.
    ///
    /// Returns
    /// -------
    /// list of str, the names of the files.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<String>> {
        let is_picture = is_picture(&path)?;
        run(py, &Follower::nobody(), |_, _| match is_picture {
            true => write_picture(&self.of.developed.picture, &path),
            false => self.save_into(&path),
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.png(py)
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        let shot = &self.of.file.shot;
        let name = [&shot.make, &shot.model].into_iter().flatten().map(String::as_str).collect::<Vec<_>>().join(" ");
        format!("<Developed {name}: {columns} × {rows} pixels>")
    }
}
