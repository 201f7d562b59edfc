//! Numbers and arrays from Python, each wrong one named in one sentence.

use ndarray::ArrayD;
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::{intern, prelude::*, sync::PyOnceLock, types::PyDict};

use crate::errors::{wrong, wrong_type};

/// Returns the name of an object's type.
pub(crate) fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string())
}

/// Returns the path that a value is.
pub(crate) fn path(key: &str, value: &Bound<'_, PyAny>) -> PyResult<std::path::PathBuf> {
    value.extract().map_err(|_| wrong_type(key, type_name(value), "a path"))
}

/// Returns a number.
pub(crate) fn number(key: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    value.extract().map_err(|_| wrong_type(key, type_name(value), "a number"))
}

/// Returns a list of numbers, or a single one as a list of one.
pub(crate) fn numbers(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    refuse_masked(key, value)?;
    if value.len().is_err() {
        let one = value.extract().map_err(|_| wrong_type(key, type_name(value), "a number or a list of numbers"))?;
        return Ok(vec![one]);
    }
    let list: Vec<f64> =
        value.extract().map_err(|_| wrong_type(key, type_name(value), "a number or a list of numbers"))?;
    match list.is_empty() {
        true => Err(wrong(key, "empty", "at least one number")),
        false => Ok(list),
    }
}

/// Refuses NumPy's masked arrays, whose masked numbers would count.
fn refuse_masked(key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let is_masked = value.hasattr(intern!(value.py(), "mask"))? && value.hasattr(intern!(value.py(), "filled"))?;
    match is_masked {
        true => Err(wrong_type(key, "a masked array", "an array without a mask: array.filled(value) makes one")),
        false => Ok(()),
    }
}

/// Whether an argument is a single number, whose axis results leave out.
pub(crate) fn is_single(value: &Bound<'_, PyAny>) -> bool {
    value.len().is_err()
}

/// Returns an array of 64-bit floats; lists and arrays of other real numbers are converted.
pub(crate) fn array_f64<'py>(key: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let array = real_array(key, value, "float64")?;
    let array = array.cast_into::<PyArrayDyn<f64>>().map_err(|_| wrong_type(key, type_name(value), "an array"))?;
    Ok(array.readonly())
}

/// Returns an owned array of 32-bit floats with so many axes.
pub(crate) fn owned_f32(key: &str, value: &Bound<'_, PyAny>, shape: &str, n_axes: &[usize]) -> PyResult<ArrayD<f32>> {
    let array = real_array(key, value, "float32")?;
    let array = array.cast_into::<PyArrayDyn<f32>>().map_err(|_| wrong_type(key, type_name(value), "an array"))?;
    check_axes(key, array.as_untyped(), shape, n_axes)?;
    Ok(array.readonly().as_array().to_owned())
}

fn check_axes(key: &str, array: &Bound<'_, PyUntypedArray>, shape: &str, n_axes: &[usize]) -> PyResult<()> {
    match n_axes.contains(&array.ndim()) {
        true => Ok(()),
        false => Err(wrong(key, format!("of shape {:?}", array.shape()), &format!("an array of shape {shape}"))),
    }
}

/// Returns an array of a type of floats, which is the object itself where it is one.
fn real_array<'py>(key: &str, value: &Bound<'py, PyAny>, kind: &str) -> PyResult<Bound<'py, PyAny>> {
    static AS_ARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = value.py();
    refuse_masked(key, value)?;
    let as_array = AS_ARRAY.import(py, "numpy", "asarray")?;
    let array = as_array.call1((value,)).map_err(|_| wrong_type(key, type_name(value), "an array of numbers"))?;
    let dtype = array.getattr(intern!(py, "dtype"))?;
    let letter: String = dtype.getattr(intern!(py, "kind"))?.extract()?;
    if !["f", "i", "u"].contains(&letter.as_str()) {
        return Err(wrong_type(key, format!("an array of {dtype}"), "an array of real numbers"));
    }
    let with_kind = PyDict::new(py);
    with_kind.set_item(intern!(py, "dtype"), kind)?;
    as_array.call((array,), Some(&with_kind))
}
