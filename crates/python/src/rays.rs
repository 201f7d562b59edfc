//! Rays that were traced.

use std::sync::Arc;

use dioptric_optics::{RayBatch, RayFate};
use ndarray::{Array2, ArrayView1};
use pyo3::prelude::*;

use crate::view::{list, view};

/// Rays where a trace left them: on the last surface or on the film, bent into the image space, or where they ended.
///
/// Every array has one entry a ray, in the order given; ``len(rays)`` is their number. Positions are millimetres in the lens frame
/// (+z the way light travels, origin at the first vertex), directions unit vectors.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Rays {
    batch: Arc<RayBatch>,
}

impl Rays {
    pub(crate) fn new(batch: RayBatch) -> Self {
        Self { batch: Arc::new(batch) }
    }

    fn column<'py>(&self, py: Python<'py>, pick: impl FnOnce(&RayBatch) -> &Vec<f64>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.batch, |rays| ArrayView1::from(pick(rays).as_slice()))
    }

    fn rows<'py>(&self, py: Python<'py>, pick: impl Fn(&RayBatch, usize) -> [f64; 3]) -> PyResult<Bound<'py, PyAny>> {
        let rays = &*self.batch;
        let flat: Vec<f64> = (0..rays.len()).flat_map(|ray| pick(rays, ray)).collect();
        let rows = Array2::from_shape_vec((rays.len(), 3), flat).expect("three numbers a ray");
        view(py, &Arc::new(rows), |rows| rows.view())
    }
}

#[pymethods]
impl Rays {
    /// What the numbers in ``fate`` stand for: a ray's fate is ``Rays.FATES[rays.fate[i]]``.
    #[classattr]
    #[pyo3(name = "FATES")]
    const FATES: [&'static str; 4] = ["passed", "vignetted", "missed", "total_reflection"];

    fn __len__(&self) -> usize {
        self.batch.len()
    }

    fn __repr__(&self) -> String {
        format!("<Rays: {} of {} passed>", self.batch.n_in_flight(), self.batch.len())
    }

    /// x of each ray's point, mm; (n,) float64.
    #[getter]
    fn x_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.x_mm)
    }

    /// y of each ray's point, mm; (n,) float64.
    #[getter]
    fn y_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.y_mm)
    }

    /// z of each ray's point from the first vertex, mm; (n,) float64.
    #[getter]
    fn z_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.z_mm)
    }

    /// Direction cosine along x; (n,) float64.
    #[getter]
    fn l<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.l)
    }

    /// Direction cosine along y; (n,) float64.
    #[getter]
    fn m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.m)
    }

    /// Direction cosine along z; (n,) float64.
    #[getter]
    fn n<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.n)
    }

    /// Optical path length from the ray's start, mm; (n,) float64.
    #[getter]
    fn opl_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |rays| &rays.opl_mm)
    }

    /// The points as rows, mm; (n, 3) float64, put together anew at each access: `x_mm`, `y_mm`, `z_mm` are views.
    #[getter]
    fn positions_mm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |rays, ray| rays.point_mm(ray).to_array())
    }

    /// The unit directions as rows; (n, 3) float64, put together anew at each access: `l`, `m`, `n` are views.
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |rays, ray| rays.direction(ray).to_array())
    }

    /// Whether each ray got through; (n,) bool.
    #[getter]
    fn passed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        list(py, self.batch.fate.iter().map(|fate| fate.is_in_flight()).collect())
    }

    /// How each ray ended, a place in `FATES`; (n,) uint8.
    #[getter]
    fn fate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let code = |fate: &RayFate| match fate {
            RayFate::InFlight => 0u8,
            RayFate::Vignetted { .. } => 1,
            RayFate::Missed { .. } => 2,
            RayFate::TotalReflection { .. } => 3,
        };
        list(py, self.batch.fate.iter().map(code).collect())
    }

    /// The 0-based surface that ended each ray, -1 for one that got through; (n,) int16.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let place = |fate: &RayFate| fate.surface().map_or(-1, |surface| surface as i16);
        list(py, self.batch.fate.iter().map(place).collect())
    }
}
