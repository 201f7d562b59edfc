//! Worlds made and changed from a program.

use std::{
    path::PathBuf,
    sync::{Mutex, MutexGuard, PoisonError},
};

use dioptric_pipeline::{
    PipelineError, WorldBuilder, WorldChange, WorldSky, WorldSpec, change_world, open_world, parse_illuminant,
};
use pyo3::{
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    errors::exception,
    restorer::restorer,
    serial::{from_python, to_python},
    worker::run_apart,
};

/// A world that is changed by name: what `dioptric.World` holds.
#[pyclass(frozen, module = "dioptric._native")]
pub(crate) struct _World(Mutex<Changed>);

#[derive(Clone)]
struct Changed {
    spec: WorldSpec,
    builder: WorldBuilder,
}

impl _World {
    fn held(&self) -> MutexGuard<'_, Changed> {
        // What is held is replaced whole.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the part of a camera file that says this world.
    pub(crate) fn spec(&self) -> WorldSpec {
        self.held().spec.clone()
    }
}

impl _World {
    fn of_spec(py: Python<'_>, spec: WorldSpec) -> PyResult<Self> {
        let of_work = spec.clone();
        let builder = run_apart(py, move |cancel| {
            let mut builder = match of_work.is_file() {
                true => open_world(&of_work.file, &of_work.reading(), cancel)?,
                false => WorldBuilder::new(),
            };
            of_work.changes.iter().try_for_each(|change| change_world(&mut builder, change, cancel))?;
            Ok(builder)
        })?;
        Ok(Self(Mutex::new(Changed { spec, builder })))
    }
}

#[pymethods]
impl _World {
    /// Reads a file, or begins with nothing.
    #[new]
    #[pyo3(signature = (path=None, unit_m=1.0, time_s=None, animation=None, variant=None))]
    fn new(
        py: Python<'_>,
        path: Option<PathBuf>,
        unit_m: f64,
        time_s: Option<f64>,
        animation: Option<String>,
        variant: Option<String>,
    ) -> PyResult<Self> {
        let file = path.unwrap_or_else(|| PathBuf::from(WorldSpec::EMPTY));
        Self::of_spec(py, WorldSpec { unit_m, time_s, animation, variant, ..WorldSpec::of_file(file) })
    }

    /// Carries out a change, in the words of a camera file; one that cannot be leaves the world as it was.
    fn change(&self, py: Python<'_>, change: &Bound<'_, PyAny>) -> PyResult<()> {
        let change: WorldChange = from_python("the change", change)?;
        let (mut builder, of_work) = (self.held().builder.clone(), change.clone());
        let builder = run_apart(py, move |cancel| change_world(&mut builder, &of_work, cancel).map(|()| builder))?;
        let mut held = self.held();
        held.builder = builder;
        held.spec.changes.push(change);
        Ok(())
    }

    /// Returns what stands in it, a dictionary each.
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let objects = self.held().builder.objects();
        objects
            .into_iter()
            .map(|object| {
                let row = PyDict::new(py);
                row.set_item("name", object.name)?;
                row.set_item("parent", object.parent)?;
                row.set_item("kinds", object.kinds)?;
                row.set_item("materials", object.materials)?;
                row.set_item("n_primitives", object.n_primitives)?;
                let bounds_m = object.bounds_m.map(|[low, high]| (point(low.to_array()), point(high.to_array())));
                row.set_item("bounds_m", bounds_m)?;
                row.set_item("light", object.light.map(|light| (light.value, light.unit)))?;
                Ok(row)
            })
            .collect()
    }

    /// Returns the names of the objects that a name means.
    fn find(&self, name: &str) -> PyResult<Vec<String>> {
        self.held().builder.find_objects(name).map_err(exception)
    }

    /// Returns the corners of an upright box around objects, or around everything.
    fn bounds_m(&self, name: Option<&str>) -> PyResult<Option<[(f64, f64, f64); 2]>> {
        let held = self.held();
        let bounds = match name {
            None => held.builder.bounds(),
            Some(name) => held.builder.bounds_of_object(name).map_err(exception)?,
        };
        Ok(bounds.map(|corners| corners.map(|corner| point(corner.to_array()))))
    }

    /// Returns the names of the materials.
    fn materials(&self) -> Vec<String> {
        self.held().builder.material_names().map(str::to_owned).collect()
    }

    /// Returns the names of the cameras.
    fn cameras(&self) -> Vec<String> {
        self.held().builder.camera_names().map(str::to_owned).collect()
    }

    /// Returns what of the files isn't understood.
    fn notes(&self) -> Vec<String> {
        self.held().builder.notes()
    }

    /// Writes a file; returns what it doesn't hold.
    fn write(&self, py: Python<'_>, path: PathBuf, strict: bool) -> PyResult<Vec<String>> {
        let builder = self.held().builder.clone();
        run_apart(py, move |_| Ok::<_, PipelineError>(dioptric_pipeline::write_world(&builder, &path, strict)?))
    }

    /// Returns the light of a word, in the words of a camera file.
    #[staticmethod]
    fn light<'py>(py: Python<'py>, word: &str) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &parse_illuminant(word).map_err(exception)?)
    }

    /// Returns the sky of a word, in the words of a camera file.
    #[staticmethod]
    fn sky<'py>(py: Python<'py>, word: &str) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &word.parse::<WorldSky>().map_err(exception)?)
    }

    /// Returns the same world, to be changed apart from this one.
    fn copy(&self) -> Self {
        Self(Mutex::new(self.held().clone()))
    }

    /// Returns the part of a camera file that says it.
    fn words<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.spec())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        Ok((restorer(py, "_restore_world")?, PyTuple::new(py, [self.words(py)?])?))
    }
}

/// Makes a world again; pickles call it.
#[pyfunction]
pub(crate) fn _restore_world(py: Python<'_>, spec: &Bound<'_, PyAny>) -> PyResult<_World> {
    _World::of_spec(py, from_python("the world", spec)?)
}

fn point([x, y, z]: [f64; 3]) -> (f64, f64, f64) {
    (x, y, z)
}
