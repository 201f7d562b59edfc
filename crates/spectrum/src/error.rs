//! What can be wrong with spectral data.

/// Spectral data that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectrumError {
    /// A wavelength list that is empty, not finite and positive, or not ascending.
    #[error("wavelengths must be finite, positive and ascending, but number {} is {value} nm", index + 1)]
    Wavelengths {
        /// 0-based place in the list.
        index: usize,
        /// What stood there; NaN for an empty list.
        value: f64,
    },
    /// A wavelength step that is not positive, or that gives too many bands.
    #[error("{first_nm}:{last_nm}:{step_nm} nm is not a wavelength range with a positive step and at most 10000 bands")]
    Range {
        /// First wavelength, nm.
        first_nm: f64,
        /// Last wavelength, nm.
        last_nm: f64,
        /// Step, nm.
        step_nm: f64,
    },
    /// Two lists or arrays that must be of one size.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// What was compared.
        what: &'static str,
        /// The size wanted.
        expected: usize,
        /// The size found.
        found: usize,
    },
    /// A value that is not finite.
    #[error("value {index} of the spectrum is {value}, expected a finite number")]
    Value {
        /// 0-based place in the list.
        index: usize,
        /// What stood there.
        value: f64,
    },
    /// A sample of an image that is NaN, infinite or negative.
    #[error(
        "the {wavelength_nm} nm band holds {value} at row {row}, column {column}: expected a finite number, 0 or more"
    )]
    Sample {
        /// Center of the band, nm.
        wavelength_nm: f64,
        /// Row of the sample.
        row: usize,
        /// Column of the sample.
        column: usize,
        /// What stood there.
        value: f32,
    },
    /// A depth that is not positive.
    #[error("the depth at row {row}, column {column} is {value} m: expected a number above 0")]
    Depth {
        /// Row of the sample.
        row: usize,
        /// Column of the sample.
        column: usize,
        /// What stood there, m.
        value: f32,
    },
    /// A light that there cannot be.
    #[error("{what} is {found}, expected {expected}")]
    Light {
        /// What of the light is wrong.
        what: &'static str,
        /// What stood there.
        found: String,
        /// What would do.
        expected: String,
    },
    /// A name that names nothing.
    #[error("no {kind} is named '{name}'; known: {known}")]
    Unknown {
        /// What was looked for.
        kind: &'static str,
        /// The name given.
        name: String,
        /// The names that would do.
        known: String,
    },
    /// A band that could not be had from where it is kept.
    #[error("band {band} could not be read: {reason}")]
    Band {
        /// 0-based band.
        band: usize,
        /// Why.
        reason: String,
    },
}
