//! Light fields.

use std::sync::Arc;

use dioptric_pipeline::{DepthSearch, LightField as ViewField};
use ndarray::{Array2, Array3, Array4, Array5};
use pyo3::{prelude::*, types::PyDict};

use crate::{errors::wrong, options::count, view::view, worker::run_apart};

/// Samples each way that depth is sought over, where none are given.
const RADIUS_PX: usize = 3;

/// Pictures of one scene from a raster of viewpoints, linear sRGB in lux as an observer sees them.
///
/// Row 0 of the raster has the highest viewpoints, column 0 those farthest to the left.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct LightField {
    field: Arc<ViewField>,
}

impl LightField {
    pub(crate) fn new(field: ViewField) -> Self {
        Self { field: Arc::new(field) }
    }
}

#[pymethods]
impl LightField {
    /// Rows and columns of viewpoints, rows and columns of samples of each view, and channels.
    #[getter]
    fn shape(&self) -> (usize, usize, usize, usize, usize) {
        let ((rows, columns), (height, width)) = (self.field.n_views(), self.field.size());
        (rows, columns, height, width, self.field.view(0, 0).map_or(0, <[_]>::len))
    }

    /// All views, put together anew at each access; (view rows, view columns, rows, columns, channels) float32.
    #[getter]
    fn views<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let field = &self.field;
        let views = Array5::from_shape_fn(self.shape(), |(row, column, y, x, channel)| {
            field.view(row, column).map_or(0.0, |planes| planes[channel][(y, x)])
        });
        view(py, &Arc::new(views), |views| views.view())
    }

    /// Whether no rim of the pupil cuts off a part of each view's light; (view rows, view columns) bool.
    #[getter]
    fn whole<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let whole = Array2::from_shape_fn(self.field.n_views(), |(row, column)| self.field.is_whole(row, column));
        view(py, &Arc::new(whole), |whole| whole.view())
    }

    /// The true depth of what each sample sees, m from the center of the entrance pupil, put together anew at each access; (view rows, view
    /// columns, rows, columns) float32, inf where there is nothing, nan where no light comes.
    #[getter]
    fn true_depth_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (rows, columns, height, width, _) = self.shape();
        let field = &self.field;
        let depth_m = Array4::from_shape_fn((rows, columns, height, width), |(row, column, y, x)| {
            field.true_depth_m(row, column).map_or(f32::NAN, |plane| plane[(y, x)])
        });
        view(py, &Arc::new(depth_m), |depth_m| depth_m.view())
    }

    /// Returns how far apart neighboring views show a point at a depth from the entrance pupil, pixels.
    fn disparity_px(&self, depth_m: f64) -> PyResult<f64> {
        check_depth(depth_m)?;
        Ok(self.field.geometry().disparity_px(depth_m))
    }

    /// Returns the picture that is sharp at a depth, m from the entrance pupil: all views that are whole, moved and added; (rows, columns,
    /// channels) float32.
    fn refocus<'py>(&self, py: Python<'py>, depth_m: f64) -> PyResult<Bound<'py, PyAny>> {
        check_depth(depth_m)?;
        let field = self.field.clone();
        let planes = run_apart(py, move |_| Ok(field.refocused(field.geometry().disparity_px(depth_m))))?;
        let (rows, columns) = self.field.size();
        let shape = (rows, columns, planes.len());
        let picture = Array3::from_shape_fn(shape, |(row, column, channel)| planes[channel][(row, column)]);
        view(py, &Arc::new(picture), |picture| picture.view())
    }

    /// Estimates the depth of each sample of the middle view by the disparity at which the views agree best.
    ///
    /// Parameters
    /// ----------
    /// near_m, far_m : float
    ///     Where it is sought, m from the entrance pupil.
    /// radius_px : int
    ///     Samples each way that it is sought over. Default 3.
    ///
    /// Returns
    /// -------
    /// dict of ``depth_m``, ``disparity_px`` and ``confidence`` (0 to 1), (rows, columns) float32 each.
    #[pyo3(signature = (near_m, far_m, *, radius_px=None))]
    fn depth<'py>(
        &self,
        py: Python<'py>,
        near_m: f64,
        far_m: f64,
        radius_px: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let radius_px = radius_px.map_or(Ok(RADIUS_PX), |value| count("radius_px", value))?;
        let (field, search) = (self.field.clone(), DepthSearch { near_m, far_m, radius_px });
        let estimate = run_apart(py, move |cancel| field.depth(&search, cancel))?;
        let dict = PyDict::new(py);
        for (key, plane) in [
            ("depth_m", estimate.depth_m),
            ("disparity_px", estimate.disparity_px),
            ("confidence", estimate.confidence),
        ] {
            dict.set_item(key, view(py, &Arc::new(plane), |plane| plane.view())?)?;
        }
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let (rows, columns, height, width, _) = self.shape();
        format!("<LightField: {columns} × {rows} views of {width} × {height} samples>")
    }
}

fn check_depth(depth_m: f64) -> PyResult<()> {
    match depth_m > 0.0 {
        true => Ok(()),
        false => Err(wrong("depth_m", depth_m, "a number above 0, or inf")),
    }
}
