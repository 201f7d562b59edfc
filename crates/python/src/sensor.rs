//! Sensors.

use std::{path::PathBuf, sync::Arc};

use dioptric_pipeline::{Camera, Given, KeptCamera, SensorSpec};
use dioptric_sensor::Sensor as SensorSheet;
use ndarray::Array2;
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    errors::{exception, guarded},
    input::numbers,
    restorer::restorer,
    serial::{from_python, to_python},
    view::view,
};

/// The data sheet of an image sensor: pixels, filters, noise, converter. It never changes.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Sensor {
    sheet: SensorSheet,
    /// What a camera file says of it, where it can.
    spec: Option<SensorSpec>,
}

impl Sensor {
    fn of_spec(spec: SensorSpec) -> PyResult<Self> {
        guarded(|| Ok(Self { sheet: spec.open().map_err(exception)?, spec: Some(spec) }))
    }

    /// Returns the sensor of a data sheet, and of what a camera file says of it.
    pub(crate) fn restored(sheet: SensorSheet, spec: Option<SensorSpec>) -> Self {
        Self { sheet, spec }
    }

    /// The data sheet.
    pub(crate) fn sheet(&self) -> &SensorSheet {
        &self.sheet
    }

    /// Returns the sensor as a part of a camera.
    pub(crate) fn given(&self) -> Given<SensorSheet> {
        Given::new(self.sheet.clone())
    }

    /// Returns the sensor of a camera.
    pub(crate) fn of_camera(kept: &KeptCamera) -> PyResult<Self> {
        match &kept.given().sensor {
            Some(sheet) => Ok(Self { sheet: (**sheet).clone(), spec: None }),
            None => Self::of_spec(kept.camera().sensor.clone()),
        }
    }

    /// Returns a camera with this sensor.
    pub(crate) fn put_into(&self, kept: &KeptCamera) -> KeptCamera {
        let Some(spec) = &self.spec else { return kept.with_given_sensor(Given::new(self.sheet.clone())) };
        let mut given = kept.given().clone();
        given.sensor = None;
        kept.with_camera(Camera { sensor: spec.clone(), ..kept.camera().clone() }, given)
    }
}

#[pymethods]
impl Sensor {
    /// Returns the names of the built-in sensors.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        SensorSheet::built_in_names().collect()
    }

    /// Returns a built-in sensor.
    #[staticmethod]
    fn built_in(name: &str) -> PyResult<Self> {
        Self::of_spec(SensorSpec::BuiltIn(name.to_owned()))
    }

    /// Reads a data sheet, a RON file.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Self::of_spec(SensorSpec::File(path))
    }

    /// Returns the sensor of a data sheet's text, in RON.
    #[staticmethod]
    fn from_ron(text: &str) -> PyResult<Self> {
        guarded(|| Ok(Self { sheet: SensorSheet::from_ron(text, "the data sheet").map_err(exception)?, spec: None }))
    }

    /// Returns the sensor of a dictionary as `to_dict` makes it.
    #[staticmethod]
    fn from_dict(data: &Bound<'_, PyDict>) -> PyResult<Self> {
        let sheet: SensorSheet = from_python("the sensor", data.as_any())?;
        // Checked as a file is.
        Self::from_ron(&sheet.to_ron())
    }

    /// Returns the sensor with entries of its data sheet changed, as ``sensor.with_(read_noise_v=0.0)``; names and units are those
    /// of `to_dict`.
    #[pyo3(signature = (**changes))]
    fn with_(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let data = self.to_dict(py)?.cast_into::<PyDict>()?;
        if let Some(changes) = changes {
            data.update(changes.as_mapping())?;
        }
        Self::from_dict(&data)
    }

    /// What the sensor is called.
    #[getter]
    fn name(&self) -> &str {
        &self.sheet.name
    }

    /// Rows and columns of pixels.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.sheet.rows, self.sheet.columns)
    }

    /// Distance between pixels, µm.
    #[getter]
    fn pixel_pitch_um(&self) -> f64 {
        self.sheet.pixel_pitch_um
    }

    /// The names of the filters.
    #[getter]
    fn filters(&self) -> Vec<String> {
        self.sheet.filters.iter().map(|filter| filter.name.clone()).collect()
    }

    /// Returns the quantum efficiency of each filter, electrons a photon; (filters, wavelengths) float64.
    fn quantum_efficiency<'py>(
        &self,
        py: Python<'py>,
        wavelengths_nm: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let list = numbers("wavelengths_nm", wavelengths_nm)?;
        let (n_filters, sheet) = (self.sheet.filters.len(), &self.sheet);
        let table = guarded(|| {
            Ok(Array2::from_shape_fn((n_filters, list.len()), |(filter, at)| {
                sheet.quantum_efficiency(filter, list[at])
            }))
        })?;
        view(py, &Arc::new(table), |table| table.view())
    }

    /// Returns the data sheet as a dictionary.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.sheet)
    }

    /// Returns the data sheet as RON text, which reads back the same.
    fn to_ron(&self) -> String {
        self.sheet.to_ron()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.sheet == other.sheet
    }

    fn __repr__(&self) -> String {
        let SensorSheet { name, rows, columns, pixel_pitch_um, .. } = &self.sheet;
        format!("<Sensor {name}: {columns} × {rows} pixels of {pixel_pitch_um} µm>")
    }

    /// Copies by the text of the data sheet and the name or path that a camera file has for it, so that sensors can be sent to other
    /// processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let arguments = [self.to_ron().into_bound_py_any(py)?, to_python(py, &self.spec)?];
        Ok((restorer(py, "_restore_sensor")?, PyTuple::new(py, arguments)?))
    }

    fn __copy__(own: Py<Self>) -> Py<Self> {
        own
    }

    fn __deepcopy__(own: Py<Self>, memo: &Bound<'_, PyAny>) -> Py<Self> {
        let _ = memo;
        own
    }
}
