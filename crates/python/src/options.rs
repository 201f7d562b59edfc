//! Arguments by keyword: which there are, and what the words among them mean.

use dioptric_pipeline::{Diffraction, parse_illuminant};
use dioptric_spectrum::Illuminant;
use pyo3::{
    conversion::FromPyObjectOwned,
    exceptions::PyTypeError,
    prelude::*,
    types::{PyDict, PyInt},
};

use crate::{
    errors::{exception, wrong, wrong_type},
    input::type_name,
};

/// Calls `act` for each argument that is given and not `None`, in the order of those known.
pub(crate) fn each_option(
    function: &str,
    options: Option<&Bound<'_, PyDict>>,
    known: &[&str],
    mut act: impl FnMut(&str, &Bound<'_, PyAny>) -> PyResult<()>,
) -> PyResult<()> {
    let Some(options) = options else { return Ok(()) };
    for key in options.keys() {
        let key: String = key.extract()?;
        if !known.contains(&key.as_str()) {
            let known = known.join(", ");
            return Err(PyTypeError::new_err(format!("{function}() has no argument '{key}'; it has {known}")));
        }
    }
    for key in known {
        if let Some(value) = options.get_item(key)?.filter(|value| !value.is_none()) {
            act(key, &value)?;
        }
    }
    Ok(())
}

/// Returns the text of a string.
pub(crate) fn word(key: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.extract().map_err(|_| wrong_type(key, type_name(value), "a string"))
}

/// Returns a count.
pub(crate) fn count(key: &str, value: &Bound<'_, PyAny>) -> PyResult<usize> {
    whole(key, value)
}

/// Returns the seed of random numbers.
pub(crate) fn seed(key: &str, value: &Bound<'_, PyAny>) -> PyResult<u64> {
    whole(key, value)
}

/// Returns a whole number: of another type it is a `TypeError`, below 0 or too large a `ValueError`.
fn whole<'py, T: FromPyObjectOwned<'py>>(key: &str, value: &Bound<'py, PyAny>) -> PyResult<T> {
    const EXPECTED: &str = "a whole number of 0 or more";
    value.extract().map_err(|_| match value.is_instance_of::<PyInt>() {
        true => wrong(key, value, EXPECTED),
        false => wrong_type(key, type_name(value), EXPECTED),
    })
}

/// Returns the light of a name, a temperature, a chromaticity or a CSV file.
pub(crate) fn light(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Illuminant> {
    parse_illuminant(&word(key, value)?).map_err(exception)
}

/// Returns the diffraction of a word of the command line.
pub(crate) fn diffraction(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Diffraction> {
    Ok(match word(key, value)?.as_str() {
        "none" => Diffraction::None,
        "hurb" => Diffraction::Hurb { gamma: 1.0 },
        "hurb-scene3d" => Diffraction::Hurb { gamma: std::f64::consts::SQRT_2 },
        "hurb-calibrated" => Diffraction::HurbCalibrated,
        "wave" => Diffraction::Wave,
        other => {
            let expected = "'none', 'hurb', 'hurb-scene3d', 'hurb-calibrated' or 'wave'";
            return Err(wrong(key, format!("'{other}'"), expected));
        }
    })
}

/// Returns HURB of another strength.
pub(crate) fn with_gamma(choice: Diffraction, gamma: f64) -> PyResult<Diffraction> {
    match choice {
        Diffraction::Hurb { .. } => Ok(Diffraction::Hurb { gamma }),
        _ => Err(wrong("gamma", gamma, "diffraction='hurb' with it, whose strength it is")),
    }
}
