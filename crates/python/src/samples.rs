//! Files of results read back as arrays.

use std::{path::PathBuf, sync::Arc};

use dioptric_pipeline::PipelineError;
use dioptric_scene::{PictureSamples, SceneError, read_picture_samples, read_planes_exr, read_spectral_exr};
use ndarray::{Array2, Array3};
use pyo3::{IntoPyObjectExt, prelude::*};

use crate::{
    measure::warn,
    view::{Sample, view},
    worker::{Follower, run},
};

/// What a file holds.
enum Samples {
    /// Planes of names, of which one is a picture by itself.
    Planes(Vec<Array2<f32>>, Vec<String>),
    /// Bands by their centers, nm.
    Bands(Vec<Array2<f32>>, Vec<f64>),
    /// Codes of 8 or 16 bits.
    Codes(PictureSamples, u16),
}

/// Reads a file of a run or of a sweep's item: PNG, TIFF or EXR.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///
/// Returns
/// -------
/// array, names
///     Codes are uint8 or uint16, (rows, columns) or (rows, columns, 3); spectral EXR is (bands, rows, columns) float32 and its
///     names are the centers of the bands, nm; other EXR is (rows, columns) of one channel or (channels, rows, columns) float32. Arrays
///     are read-only.
#[pyfunction]
pub(crate) fn read_samples(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
    let (samples, notes) = run(py, &Follower::nobody(), |_, _| {
        let mut notes = vec![];
        read(&path, &mut notes).map(|samples| (samples, notes))
    })?;
    warn(py, &notes)?;
    match samples {
        Samples::Bands(planes, centers_nm) => Ok((stack(py, &planes, true)?, centers_nm.into_bound_py_any(py)?)),
        Samples::Planes(planes, names) => Ok((stack(py, &planes, planes.len() > 1)?, names.into_bound_py_any(py)?)),
        Samples::Codes(samples, top) => {
            let names: Vec<String> = samples.planes.iter().map(|(name, _)| name.clone()).collect();
            let codes = match u8::try_from(top) {
                Ok(_) => codes(py, &samples, |code| code as u8)?,
                Err(_) => codes(py, &samples, |code| code as u16)?,
            };
            Ok((codes, names.into_bound_py_any(py)?))
        }
    }
}

fn read(path: &std::path::Path, notes: &mut Vec<String>) -> Result<Samples, PipelineError> {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        let samples = read_picture_samples(path)?.told_in(notes);
        return Ok(match samples.top {
            Some(top) => Samples::Codes(samples, top),
            None => named(samples.planes),
        });
    }
    match read_spectral_exr(path) {
        Ok(file) => {
            let file = file.told_in(notes);
            let centers_nm = file.image.grid().centers_nm().to_vec();
            Ok(Samples::Bands(file.image.into_planes(), centers_nm))
        }
        Err(SceneError::NoBands { .. }) => Ok(named(read_planes_exr(path)?.told_in(notes))),
        Err(other) => Err(other.into()),
    }
}

fn named(planes: Vec<(String, Array2<f32>)>) -> Samples {
    let (names, planes) = planes.into_iter().unzip();
    Samples::Planes(planes, names)
}

/// Returns planes one behind the other, or the first alone.
fn stack<'py>(py: Python<'py>, planes: &[Array2<f32>], has_axis: bool) -> PyResult<Bound<'py, PyAny>> {
    let Some(first) = planes.first().filter(|_| !has_axis) else {
        let (rows, columns) = planes.first().map_or((0, 0), Array2::dim);
        let all = Array3::from_shape_fn((planes.len(), rows, columns), |(n, row, column)| planes[n][(row, column)]);
        return view(py, &Arc::new(all), |all| all.view());
    };
    view(py, &Arc::new(first.clone()), |plane| plane.view())
}

/// Returns codes with their channels last, where there are several.
fn codes<'py, E: Sample>(
    py: Python<'py>,
    samples: &PictureSamples,
    code: impl Fn(f32) -> E,
) -> PyResult<Bound<'py, PyAny>> {
    let planes = &samples.planes;
    if let [(_, plane)] = planes.as_slice() {
        return view(py, &Arc::new(plane.mapv(code)), |plane| plane.view());
    }
    let (rows, columns) = planes.first().map_or((0, 0), |(_, plane)| plane.dim());
    let shape = (rows, columns, planes.len());
    let all = Array3::from_shape_fn(shape, |(row, column, n)| code(planes[n].1[(row, column)]));
    view(py, &Arc::new(all), |all| all.view())
}
