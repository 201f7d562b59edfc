//! Rays that are given as arrays, and rays that were traced.

use std::{borrow::Cow, sync::Arc};

use dioptric_optics::{Lens, MonoLens, RayBatch, RayFate, Vignetting, glam::DVec3};
use dioptric_pipeline::PipelineError;
use ndarray::{ArrayD, ArrayView, IxDyn};
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::{prelude::*, types::PyTuple};
use rayon::prelude::*;

use crate::{
    errors::{guarded, wrong},
    input::{array_f64, is_single, number},
    view::{Sample, view},
    worker::{Follower, install, run},
};

/// Points, directions and wavelengths of rays as Python gave them.
pub(crate) struct GivenRays<'py> {
    origins: PyReadonlyArrayDyn<'py, f64>,
    directions: PyReadonlyArrayDyn<'py, f64>,
    /// One of all rays, or one each, nm.
    wavelengths_nm: Vec<f64>,
    /// The shape that they have together, without the axis of x, y and z.
    shape: Vec<usize>,
}

impl<'py> GivenRays<'py> {
    /// Reads arrays of points and directions, x, y and z last, and one of wavelengths, whose other axes go together as NumPy has it;
    /// without any a single ray.
    pub(crate) fn read(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        wavelengths_nm: Option<&Bound<'py, PyAny>>,
        usual_nm: f64,
    ) -> PyResult<Self> {
        let (origins, directions) = (read_rows("origins", origins)?, read_rows("directions", directions)?);
        let wavelengths_nm = match wavelengths_nm {
            None => Wavelengths::One(usual_nm),
            Some(one) if is_single(one) => Wavelengths::One(number("wavelength_nm", one)?),
            Some(each) => Wavelengths::Each(array_f64("wavelength_nm", each)?),
        };
        let is_flat = origins.ndim() <= 2 && directions.ndim() <= 2 && origins.len() == directions.len();
        if let (true, Wavelengths::One(nm)) = (is_flat, &wavelengths_nm) {
            let shape = vec![origins.len() / 3];
            return Ok(Self { origins, directions, wavelengths_nm: vec![*nm], shape });
        }
        Self::together(origins, directions, &wavelengths_nm)
    }

    /// Repeats what has fewer axes, or axes of length 1, along the axes of the others.
    fn together(
        origins: PyReadonlyArrayDyn<'py, f64>,
        directions: PyReadonlyArrayDyn<'py, f64>,
        wavelengths_nm: &Wavelengths<'py>,
    ) -> PyResult<Self> {
        let numpy = origins.py().import("numpy")?;
        let of_rays = |array: &PyReadonlyArrayDyn<'py, f64>| array.shape()[..array.ndim() - 1].to_vec();
        let mut shape = of_rays(&origins);
        let others = [("directions", of_rays(&directions)), ("wavelength_nm", wavelengths_nm.shape())];
        for (key, other) in others {
            let py_shape = |shape: &[usize]| PyTuple::new(numpy.py(), shape);
            let both = numpy.call_method1("broadcast_shapes", (py_shape(&shape)?, py_shape(&other)?));
            shape = both
                .map_err(|_| {
                    wrong(key, format!("for rays of shape {other:?}"), &format!("one that goes with {shape:?}"))
                })?
                .extract()?;
        }
        let n_rays = shape.iter().product::<usize>();
        let spread = |array: &Bound<'py, PyAny>, tail: &[usize]| -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
            let wanted = PyTuple::new(numpy.py(), [&shape, tail].concat())?;
            let flat = PyTuple::new(numpy.py(), [&[n_rays], tail].concat())?;
            let spread = numpy.call_method1("broadcast_to", (array, wanted))?;
            let rows = numpy.call_method1("reshape", (spread, flat))?;
            Ok(numpy.call_method1("ascontiguousarray", (rows,))?.cast_into::<PyArrayDyn<f64>>()?.readonly())
        };
        let wavelengths_nm = match wavelengths_nm {
            Wavelengths::One(nm) => vec![*nm],
            Wavelengths::Each(each) => spread(each.as_any(), &[])?.as_array().iter().copied().collect(),
        };
        Ok(Self {
            origins: spread(origins.as_any(), &[3])?,
            directions: spread(directions.as_any(), &[3])?,
            wavelengths_nm,
            shape: if shape.is_empty() { vec![1] } else { shape },
        })
    }

    /// The shape of the rays; their number is its product.
    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The wavelengths: one of all rays, or one each, nm.
    pub(crate) fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// Returns the rays to read while the interpreter's lock is held, so that no other thread writes to the arrays meanwhile.
    pub(crate) fn rows(&self) -> RayRows<'_> {
        let (origins, directions) = (Rows::new(&self.origins), Rows::new(&self.directions));
        RayRows { n_rays: self.origins.len() / 3, origins, directions }
    }
}

/// Wavelengths as they were given.
enum Wavelengths<'py> {
    One(f64),
    Each(PyReadonlyArrayDyn<'py, f64>),
}

impl Wavelengths<'_> {
    fn shape(&self) -> Vec<usize> {
        match self {
            Self::One(_) => Vec::new(),
            Self::Each(each) => each.shape().to_vec(),
        }
    }
}

/// Reads an array whose last axis is x, y and z.
fn read_rows<'py>(key: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let array = array_f64(key, value)?;
    match array.shape().last() {
        Some(3) => Ok(array),
        _ => Err(wrong(key, format!("of shape {:?}", array.shape()), "an array of shape (n, 3), (3,) or (..., 3)")),
    }
}

/// Rays below which a trace is done at once, without giving up the interpreter's lock: some 50 µs of work.
const FEW_RAYS: usize = 500;

/// Through what rays are traced.
pub(crate) struct Traced<'a> {
    pub(crate) lens: &'a Lens,
    /// A film behind the last vertex, mm; else rays end on the last surface.
    pub(crate) film_mm: Option<f64>,
    pub(crate) rims: Vignetting,
}

impl Traced<'_> {
    fn trace_parallel(&self, mono: &MonoLens, rays: &mut RayBatch) {
        match self.film_mm {
            Some(film_mm) => mono.trace_to_film_parallel(rays, self.rims, film_mm),
            None => mono.trace_parallel(rays, self.rims),
        }
    }
}

/// Traces rays as Python gave them; `mono` is the lens at a wavelength.
pub(crate) fn trace(
    py: Python<'_>,
    given: &GivenRays<'_>,
    through: &Traced<'_>,
    mono: impl FnOnce(f64) -> PyResult<Arc<MonoLens>>,
) -> PyResult<Rays> {
    let (rows, shape) = (given.rows(), given.shape());
    let wavelength_nm = match given.wavelengths_nm() {
        &[wavelength_nm] => wavelength_nm,
        each => {
            let mut rays = install(py, || rows.batch_parallel())??;
            return run(py, &Follower::nobody(), |_, cancel| {
                trace_by_wavelength(&mut rays, each, |nm, bundle| -> Result<(), PipelineError> {
                    cancel.check()?;
                    through.trace_parallel(&through.lens.at(nm)?, bundle);
                    Ok(())
                })?;
                Ok(Rays::new(rays, shape))
            });
        }
    };
    let mono = guarded(|| mono(wavelength_nm))?;
    if rows.len() <= FEW_RAYS {
        return guarded(|| {
            let mut rays = rows.batch()?;
            match through.film_mm {
                Some(film_mm) => mono.trace_to_film(&mut rays, through.rims, film_mm),
                None => mono.trace(&mut rays, through.rims),
            }
            Ok(Rays::new(rays, shape))
        });
    }
    let mut rays = install(py, || rows.batch_parallel())??;
    run(py, &Follower::nobody(), |_, _| {
        through.trace_parallel(&mono, &mut rays);
        Ok(Rays::new(rays, shape))
    })
}

/// Traces rays of several wavelengths, each bundle of one wavelength by `trace`.
///
/// # Errors
/// That of the first bundle, by wavelength, that cannot be traced.
fn trace_by_wavelength<E: Send>(
    rays: &mut RayBatch,
    wavelengths_nm: &[f64],
    trace: impl Fn(f64, &mut RayBatch) -> Result<(), E> + Sync,
) -> Result<(), E> {
    let mut order: Vec<usize> = (0..rays.len()).collect();
    order.sort_by(|&a, &b| wavelengths_nm[a].total_cmp(&wavelengths_nm[b]));
    let bundles: Vec<&[usize]> = order.chunk_by(|&a, &b| wavelengths_nm[a] == wavelengths_nm[b]).collect();
    let traced = |bundle: &&[usize]| {
        let mut own = RayBatch::with_capacity(bundle.len());
        bundle.iter().for_each(|&ray| own.push(rays.point_mm(ray), rays.direction(ray), 0.0));
        trace(wavelengths_nm[bundle[0]], &mut own).map(|()| own)
    };
    let traced: Vec<RayBatch> = bundles.par_iter().map(traced).collect::<Result<_, E>>()?;
    for (bundle, own) in bundles.iter().zip(&traced) {
        for (from, &to) in bundle.iter().enumerate() {
            let places = [&mut rays.x_mm, &mut rays.y_mm, &mut rays.z_mm, &mut rays.l, &mut rays.m, &mut rays.n];
            let values = [&own.x_mm, &own.y_mm, &own.z_mm, &own.l, &own.m, &own.n];
            places.into_iter().zip(values).for_each(|(place, value)| place[to] = value[from]);
            rays.opl_mm[to] = own.opl_mm[from];
            rays.fate[to] = own.fate[from];
        }
    }
    Ok(())
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
/// Every array has one entry a ray, in the order and the shape given; ``len(rays)`` is their number. Positions are millimetres in the lens frame
/// (+z the way light travels, origin at the first vertex), directions unit vectors.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Rays {
    batch: Arc<RayBatch>,
    // Invariant: its product is the number of rays.
    shape: Vec<usize>,
}

impl Rays {
    /// Rays in an array of this shape.
    pub(crate) fn new(batch: RayBatch, shape: &[usize]) -> Self {
        Self { batch: Arc::new(batch), shape: shape.to_vec() }
    }

    fn column<'py>(&self, py: Python<'py>, pick: impl FnOnce(&RayBatch) -> &Vec<f64>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.batch, |rays| {
            ArrayView::from_shape(IxDyn(&self.shape), pick(rays).as_slice()).expect("a number a ray")
        })
    }

    fn list<'py, E: Sample>(&self, py: Python<'py>, of: impl Fn(&RayFate) -> E) -> PyResult<Bound<'py, PyAny>> {
        let list = self.batch.fate.iter().map(of).collect();
        let array = ArrayD::from_shape_vec(IxDyn(&self.shape), list).expect("an entry a ray");
        view(py, &Arc::new(array), |array| array.view())
    }

    fn rows<'py>(&self, py: Python<'py>, pick: impl Fn(&RayBatch, usize) -> [f64; 3]) -> PyResult<Bound<'py, PyAny>> {
        let rays = &*self.batch;
        let flat: Vec<f64> = (0..rays.len()).flat_map(|ray| pick(rays, ray)).collect();
        let shape: Vec<usize> = self.shape.iter().copied().chain([3]).collect();
        let rows = ArrayD::from_shape_vec(IxDyn(&shape), flat).expect("three numbers a ray");
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

    /// The shape of the arrays.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.shape)
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
        self.list(py, |fate| fate.is_in_flight())
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
        self.list(py, code)
    }

    /// The 0-based surface that ended each ray, -1 for one that got through; (n,) int16.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let place = |fate: &RayFate| fate.surface().map_or(-1, |surface| surface as i16);
        self.list(py, place)
    }
}
