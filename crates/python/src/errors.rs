//! Errors as Python exceptions.

use std::{any::Any, panic::AssertUnwindSafe};

use dioptric_pipeline::PipelineError;
use dioptric_scene::SceneError;
use dioptric_sensor::SensorError;
use dioptric_sweep::SweepError;
use pyo3::{
    PyErr, PyResult,
    exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError},
};

/// Returns the exception of an error, with its sentence: `OSError` where a file is to blame, else `ValueError`.
pub(crate) fn exception(error: impl Into<PipelineError>) -> PyErr {
    let error = error.into();
    let sentence = error.to_string();
    match error {
        PipelineError::Write { .. }
        | PipelineError::Spill { .. }
        | PipelineError::Sensor(SensorError::Write { .. })
        | PipelineError::Scene(SceneError::Unwritable { .. }) => PyOSError::new_err(sentence),
        unreadable if unreadable.is_unreadable() => PyOSError::new_err(sentence),
        PipelineError::Cancelled(_) => PyRuntimeError::new_err(sentence),
        _ => PyValueError::new_err(sentence),
    }
}

/// Returns the exception of a plan or a store: `OSError` where a file is to blame, else `ValueError`.
pub(crate) fn sweep_exception(error: SweepError) -> PyErr {
    match error {
        SweepError::Pipeline(error) => exception(error),
        SweepError::Cancelled(cancelled) => exception(PipelineError::Cancelled(cancelled)),
        SweepError::Read { .. } | SweepError::Write { .. } | SweepError::Changed { .. } => {
            PyOSError::new_err(error.to_string())
        }
        other => PyValueError::new_err(other.to_string()),
    }
}

/// Returns the exception of an argument that cannot be.
pub(crate) fn wrong(key: &str, found: impl std::fmt::Display, expected: &str) -> PyErr {
    PyValueError::new_err(format!("{key} is {found}, expected {expected}"))
}

/// Returns the exception of an argument of another type.
pub(crate) fn wrong_type(key: &str, found: impl std::fmt::Display, expected: &str) -> PyErr {
    PyTypeError::new_err(format!("{key} is {found}, expected {expected}"))
}

/// Runs library code; a panic becomes a `RuntimeError`, which `except Exception` catches, unlike what PyO3 makes of it.
pub(crate) fn guarded<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    // What was half done is dropped with the panic: classes are frozen, and kept results are stored only when whole.
    std::panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| Err(of_panic(payload.as_ref())))
}

/// Returns the exception of a panic.
pub(crate) fn of_panic(payload: &(dyn Any + Send)) -> PyErr {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    let text = text.unwrap_or_else(|| "no message".to_owned());
    PyRuntimeError::new_err(format!("a fault of dioptric, please report it: {text}"))
}
