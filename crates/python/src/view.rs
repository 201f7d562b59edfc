//! Results as NumPy arrays that are views of our memory: no copy, read-only.
//!
//! An object that owns the memory describes it by NumPy's array interface (version 3: address, shape, type, read-only), and
//! `numpy.asarray` makes the array, whose `base` is that object. The object holds an [`Arc`] of the result and the class is
//! frozen, so memory neither moves nor changes while an array is left. An address is a number, so that this takes no `unsafe`,
//! where `numpy::PyArray::borrow_from_array` does; NumPy refuses to make such an array writeable.

use std::{any::Any, sync::Arc};

use dioptric_sensor::{Picture, Raw, RawPlane};
use ndarray::{Array3, ArrayView, CowArray, Dimension};
use pyo3::{
    intern,
    prelude::*,
    sync::PyOnceLock,
    types::{PyDict, PyTuple},
};

/// A type of samples that NumPy has.
pub(crate) trait Sample: Clone + Send + Sync + 'static {
    /// Kind and bytes, as `f4`.
    const KIND: &'static str;
}

impl Sample for f32 {
    const KIND: &'static str = "f4";
}
impl Sample for f64 {
    const KIND: &'static str = "f8";
}
impl Sample for u8 {
    const KIND: &'static str = "u1";
}
impl Sample for u16 {
    const KIND: &'static str = "u2";
}
impl Sample for u32 {
    const KIND: &'static str = "u4";
}
impl Sample for u64 {
    const KIND: &'static str = "u8";
}
impl Sample for i16 {
    const KIND: &'static str = "i2";
}
impl Sample for bool {
    const KIND: &'static str = "b1";
}

/// Memory of a result, which NumPy arrays are views of; the ``base`` of these arrays.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Memory {
    /// What owns the memory; never looked at, only held.
    _owner: Box<dyn Any + Send + Sync>,
    address: usize,
    shape: Vec<usize>,
    kind: &'static str,
}

#[pymethods]
impl Memory {
    /// Address, shape and type of the memory, which is read-only (NumPy's array interface, version 3).
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let order = match self.kind {
            "u1" | "b1" => "|",
            _ if cfg!(target_endian = "little") => "<",
            _ => ">",
        };
        let interface = PyDict::new(py);
        interface.set_item(intern!(py, "version"), 3)?;
        interface.set_item(intern!(py, "shape"), PyTuple::new(py, &self.shape)?)?;
        interface.set_item(intern!(py, "typestr"), format!("{order}{}", self.kind))?;
        interface.set_item(intern!(py, "data"), (self.address, true))?;
        Ok(interface)
    }

    /// Where the memory begins.
    #[getter]
    fn address(&self) -> usize {
        self.address
    }
}

/// Returns an array for each plane of a raw frame: digital numbers of 16 bits, or volts.
pub(crate) fn raw_planes<'py, T: Send + Sync + 'static>(
    py: Python<'py>,
    owner: &Arc<T>,
    raw: impl Fn(&T) -> &Raw,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let plane = |n: usize| match &raw(owner).planes[n] {
        RawPlane::Dn(_) => view(py, owner, |of| raw(of).planes[n].dn().expect("it holds digital numbers").view()),
        RawPlane::Volts(plane) | RawPlane::Evened(plane) => view(py, &Arc::new(plane.clone()), |plane| plane.view()),
    };
    (0..raw(owner).planes.len()).map(plane).collect()
}

/// Returns the 8-bit codes of a picture; rows × columns × 3.
pub(crate) fn rgb8(picture: &Picture) -> Arc<Array3<u8>> {
    let shape = (picture.rows(), picture.columns(), 3);
    Arc::new(Array3::from_shape_vec(shape, picture.to_rgb8()).expect("three codes a pixel"))
}

/// Returns the plane of a frame that has one, else all of them.
pub(crate) fn plane_or_planes<'py>(py: Python<'py>, mut planes: Vec<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
    match planes.len() {
        1 => Ok(planes.swap_remove(0)),
        _ => Ok(PyTuple::new(py, planes)?.into_any()),
    }
}

/// Returns a read-only array of a part of a result; the part is copied only where it does not lie in C order.
pub(crate) fn view<'py, T, E, D>(
    py: Python<'py>,
    owner: &Arc<T>,
    part: impl FnOnce(&T) -> ArrayView<'_, E, D>,
) -> PyResult<Bound<'py, PyAny>>
where
    T: Send + Sync + 'static,
    E: Sample,
    D: Dimension + 'static,
{
    let samples = part(owner);
    let shape = samples.shape().to_vec();
    if samples.is_standard_layout() {
        let address = samples.as_ptr().addr();
        return array(py, Memory { _owner: Box::new(owner.clone()), address, shape, kind: E::KIND });
    }
    let copied = Arc::new(CowArray::from(samples).as_standard_layout().into_owned());
    let address = copied.as_ptr().addr();
    array(py, Memory { _owner: Box::new(copied), address, shape, kind: E::KIND })
}

fn array(py: Python<'_>, memory: Memory) -> PyResult<Bound<'_, PyAny>> {
    static AS_ARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    AS_ARRAY.import(py, "numpy", "asarray")?.call1((memory,))
}
