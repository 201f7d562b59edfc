//! What can be wrong with a sensor, a shot or a raw frame.

use std::path::PathBuf;

use dioptric_spectrum::SpectrumError;

/// A sensor, exposure, frame or picture that cannot be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A name that names no built-in sensor.
    #[error("no sensor is named '{name}'; known: {known}")]
    Unknown {
        /// The name given.
        name: String,
        /// The names that would do.
        known: String,
    },
    /// A name that names no built-in filter.
    #[error("no filter is named '{name}'; known: {known}")]
    UnknownFilter {
        /// The name given.
        name: String,
        /// The names that would do.
        known: String,
    },
    /// A file that cannot be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A data sheet whose text is not one.
    #[error("{origin}:{line}:{column}: {reason}")]
    Syntax {
        /// The file, or the name of the text.
        origin: String,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// What was wrong, and what was expected.
        reason: String,
    },
    /// A number of a data sheet or of a setting that makes no sense.
    #[error("{key} of {owner} is {value}, expected {expected}")]
    Value {
        /// The sensor or the setting.
        owner: String,
        /// The field.
        key: String,
        /// What stood there.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// A word that names nothing.
    #[error("{what}: '{found}' is not known, expected one of {expected}")]
    Word {
        /// What was looked for.
        what: &'static str,
        /// The word given.
        found: String,
        /// The words that would do.
        expected: String,
    },
    /// A color filter array that is not a full rectangle of known filters.
    #[error("the color filter array of {owner}: {reason}")]
    Cfa {
        /// The sensor.
        owner: String,
        /// What was wrong, and what was expected.
        reason: String,
    },
    /// A spectral image that is not an irradiance.
    #[error("a sensor needs spectral irradiance in {}, but the image is in {found}", dioptric_spectrum::Quantity::Irradiance.unit())]
    NotIrradiance {
        /// The unit of the image.
        found: &'static str,
    },
    /// Frames or channels that must agree in size or number.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// What was compared.
        what: &'static str,
        /// What was wanted.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A method that does not work on these frames.
    #[error("{what} {reason}")]
    Unsuitable {
        /// The method.
        what: &'static str,
        /// Why not, and what would do.
        reason: String,
    },
    /// Spectral data that cannot be used.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
}

impl SensorError {
    /// Returns the error of a number that makes no sense.
    pub(crate) fn value(owner: &str, key: &str, value: f64, expected: &'static str) -> Self {
        Self::Value { owner: owner.to_owned(), key: key.to_owned(), value, expected }
    }
}
