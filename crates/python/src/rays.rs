//! Rays that are given as arrays, and rays that were traced.

use std::{borrow::Cow, sync::Arc};

use dioptric_optics::{RayBatch, RayFate, glam::DVec3};
use ndarray::{Array2, ArrayView1};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::{
    errors::wrong,
    input::array_f64,
    view::{list, view},
};

/// Points and directions of rays as Python gave them.
pub(crate) struct GivenRays<'py> {
    origins: PyReadonlyArrayDyn<'py, f64>,
    directions: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> GivenRays<'py> {
    /// Reads two arrays of shape (n, 3), or (3,) for a single ray.
    pub(crate) fn read(origins: &Bound<'py, PyAny>, directions: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (origins, directions) = (read_rows("origins", origins)?, read_rows("directions", directions)?);
        let (n_origins, n_directions) = (origins.len() / 3, directions.len() / 3);
        match n_origins == n_directions {
            true => Ok(Self { origins, directions }),
            false => Err(wrong("directions", format!("{n_directions} rows"), &format!("{n_origins}, as origins"))),
        }
    }

    /// Returns the rays to read while the interpreter's lock is held, so that no other thread writes to the arrays meanwhile.
    pub(crate) fn rows(&self) -> RayRows<'_> {
        let (origins, directions) = (Rows::new(&self.origins), Rows::new(&self.directions));
        RayRows { n_rays: self.origins.len() / 3, origins, directions }
    }
}

/// Reads an array of shape (n, 3) or (3,).
fn read_rows<'py>(key: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    const SHAPE: &str = "(n, 3) or (3,)";
    let array = array_f64(key, value, SHAPE, &[1, 2])?;
    match array.shape().last() {
        Some(3) => Ok(array),
        _ => Err(wrong(key, format!("of shape {:?}", array.shape()), &format!("an array of shape {SHAPE}"))),
    }
}

/// Rows of three numbers, in the order that they lie in memory.
enum Rows<'a> {
    /// One row after the other.
    ByRow(Cow<'a, [f64]>),
    /// One column after the other, as where an array of shape (3, n) is transposed.
    ByColumn([&'a [f64]; 3]),
}

impl<'a> Rows<'a> {
    /// Shares the numbers of an array of shape (n, 3) or (3,), or copies them where they lie in yet another order.
    fn new(array: &'a PyReadonlyArrayDyn<'_, f64>) -> Self {
        let view = array.as_array();
        if let Some(rows) = view.to_slice() {
            return Self::ByRow(Cow::Borrowed(rows));
        }
        let columns = view.clone().reversed_axes().to_slice().filter(|_| view.ndim() == 2);
        match columns.map(|columns| columns.split_at(columns.len() / 3)) {
            Some((x, rest)) => {
                let (y, z) = rest.split_at(x.len());
                Self::ByColumn([x, y, z])
            }
            None => Self::ByRow(Cow::Owned(view.iter().copied().collect())),
        }
    }

    fn row(&self, row: usize) -> DVec3 {
        match self {
            Self::ByRow(rows) => DVec3::from_slice(&rows[3 * row..3 * row + 3]),
            Self::ByColumn([x, y, z]) => DVec3::new(x[row], y[row], z[row]),
        }
    }
}

/// Points and directions of so many rays.
pub(crate) struct RayRows<'a> {
    n_rays: usize,
    origins: Rows<'a>,
    directions: Rows<'a>,
}

impl RayRows<'_> {
    /// The number of rays.
    pub(crate) fn len(&self) -> usize {
        self.n_rays
    }

    /// Returns the rays, made in this thread.
    pub(crate) fn batch(&self) -> PyResult<RayBatch> {
        let mut rays = RayBatch::with_capacity(self.len());
        for ray in 0..self.len() {
            let (point_mm, direction) = self.ray(ray)?;
            rays.push(point_mm, direction, 0.0);
        }
        Ok(rays)
    }

    /// Returns the rays, made on the threads of the current pool.
    pub(crate) fn batch_parallel(&self) -> PyResult<RayBatch> {
        RayBatch::try_from_fn(self.len(), |ray| self.ray(ray))
    }

    /// Returns a ray's point and unit direction.
    fn ray(&self, ray: usize) -> PyResult<(DVec3, DVec3)> {
        let (point_mm, direction) = (self.origins.row(ray), self.directions.row(ray));
        if !point_mm.is_finite() {
            return Err(wrong("origins", format!("{point_mm} in row {ray}"), "finite numbers"));
        }
        let squared = direction.length_squared();
        // Directions that are of unit length to their last digit stay as they are.
        if (squared - 1.0).abs() <= 1e-15 {
            return Ok((point_mm, direction));
        }
        let length = squared.sqrt();
        match length.is_finite() && length > 0.0 {
            true => Ok((point_mm, direction / length)),
            false => Err(wrong("directions", format!("{direction} in row {ray}"), "a direction")),
        }
    }
}

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
