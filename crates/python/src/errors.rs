//! Errors as Python exceptions.

use std::{any::Any, panic::AssertUnwindSafe, path::Path};

use dioptric_pipeline::PipelineError;
use dioptric_sweep::SweepError;
use pyo3::{
    exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError},
    prelude::*,
};

/// How the standard library ends what it says of an error of the system.
const SYSTEM_ERROR: &str = "(os error ";

/// Returns the exception of an error, with its sentence: `OSError` where a file is to blame, else `ValueError`.
pub(crate) fn exception(error: impl Into<PipelineError>) -> PyErr {
    let error = error.into();
    let sentence = error.to_string();
    match error.file() {
        Some(file) => of_file(file, &sentence),
        None => match error {
            PipelineError::Spill { .. } => PyOSError::new_err(sentence),
            PipelineError::Cancelled(_) => PyRuntimeError::new_err(sentence),
            // Keys of the command line are the arguments of functions here.
            PipelineError::Value { origin, key, found, expected } if origin == "the command line" => {
                wrong(&key.trim_start_matches('-').replace('-', "_"), found, &expected)
            }
            _ => PyValueError::new_err(sentence),
        },
    }
}

/// Returns the `OSError` of a file: with the number of the system's error where there was one, so that Python makes a
/// `FileNotFoundError` or `PermissionError` of it, and then with the file's name.
fn of_file(file: &Path, sentence: &str) -> PyErr {
    let stated = sentence
        .rfind(SYSTEM_ERROR)
        .and_then(|place| sentence[place + SYSTEM_ERROR.len()..].split(')').next()?.parse::<i32>().ok());
    // Of files that are read some sentences say more than the system does.
    let is_written = sentence.contains("write") || sentence.contains("written");
    let found = || if is_written { None } else { std::fs::metadata(file).err().and_then(|error| error.raw_os_error()) };
    if let Some(number) = stated.or_else(found) {
        let of_system = std::io::Error::from_raw_os_error(number).to_string();
        let of_system = of_system.split(SYSTEM_ERROR).next().unwrap_or_default().trim().to_owned();
        let is_plain = stated.is_some() || sentence.contains("no such file");
        let reason = if is_plain { of_system } else { sentence.to_owned() };
        return PyOSError::new_err((number, reason, file.to_path_buf()));
    }
    // Python shows the sentence of an error without a number only where it has no file's name beside.
    PyOSError::new_err(sentence.to_owned())
}

/// Returns the exception of a plan or a store: `OSError` where a file is to blame, else `ValueError`.
pub(crate) fn sweep_exception(error: SweepError) -> PyErr {
    match error {
        SweepError::Pipeline(error) => exception(error),
        SweepError::Cancelled(cancelled) => exception(PipelineError::Cancelled(cancelled)),
        SweepError::Read { ref path, .. } | SweepError::Write { ref path, .. } | SweepError::Changed { ref path } => {
            of_file(path, &error.to_string())
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
