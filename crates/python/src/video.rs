//! Videos of a camera that turns.

use std::sync::Arc;

use dioptric_pipeline::{Video as Taken, VideoFrame as TakenFrame};
use pyo3::{exceptions::PyIndexError, prelude::*};

use crate::{
    serial::to_python,
    view::{plane_or_planes, raw_planes, rgb8, view},
    worker::run_apart,
};

/// A video of a camera that turns: a sequence whose frames are taken when they are asked for.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Video {
    video: Arc<Taken>,
}

impl Video {
    pub(crate) fn new(video: Taken) -> Self {
        Self { video: Arc::new(video) }
    }
}

#[pymethods]
impl Video {
    /// Rows and columns of a frame.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.video.size()
    }

    /// Frames a second.
    #[getter]
    fn frames_per_s(&self) -> f64 {
        self.video.spec.frames_per_s
    }

    /// The exposure of each row, s.
    #[getter]
    fn exposure_s(&self) -> f64 {
        self.video.exposure.time_s
    }

    /// From the start of one row to that of the next, µs; 0 for a global shutter.
    #[getter]
    fn row_time_us(&self) -> f64 {
        self.video.row_time_us
    }

    /// What a user should know, a sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.video.notes.clone()
    }

    fn __len__(&self) -> usize {
        self.video.spec.frames
    }

    /// Takes a frame, counted from 0, or from the end below it.
    fn __getitem__(&self, py: Python<'_>, frame: isize) -> PyResult<VideoFrame> {
        let n = self.video.spec.frames;
        let number = if frame < 0 { n.checked_sub(frame.unsigned_abs()) } else { Some(frame.unsigned_abs()) };
        let Some(number) = number.filter(|number| *number < n) else {
            return Err(PyIndexError::new_err(format!("frame is {frame}, expected one of {n}")));
        };
        let video = self.video.clone();
        let frame = run_apart(py, move |_| video.frame(number))?;
        Ok(VideoFrame { frame: Arc::new(frame) })
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.video.size();
        format!("<Video: {} frames of {columns} × {rows} pixels>", self.video.spec.frames)
    }
}

/// A frame of a video.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct VideoFrame {
    frame: Arc<TakenFrame>,
}

#[pymethods]
impl VideoFrame {
    /// When its first row's exposure begins, s, and where the camera points in the middle of its first and last row's exposure: pan, tilt and
    /// roll, degrees.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.frame.facts)
    }

    /// The frame as the converter gives it, as of `Shot.raw`.
    #[getter]
    fn raw<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, raw_planes(py, &self.frame, |frame| &frame.raw)?)
    }

    /// The picture's codes, 0 to 1; (rows, columns, 3) float32.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.frame, |frame| frame.developed.picture.codes.view())
    }

    /// The picture's 8-bit codes; (rows, columns, 3) uint8, rounded at each access.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &rgb8(&self.frame.developed.picture), |rgb| rgb.view())
    }

    fn __repr__(&self) -> String {
        format!("<VideoFrame at {:.4} s>", self.frame.facts.start_s)
    }
}
