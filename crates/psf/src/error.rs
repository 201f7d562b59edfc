//! What can be wrong with a point spread function's settings.

use dioptric_diffraction::DiffractionError;
use dioptric_optics::OpticsError;
use dioptric_spectrum::Cancelled;

/// A lens's image or point spread function that cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum PsfError {
    /// The lens cannot be traced.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The waves of a point cannot be summed.
    #[error(transparent)]
    Diffraction(#[from] DiffractionError),
    /// A number out of range.
    #[error("{key} is {found}, expected {expected}")]
    Setting {
        /// The name of the setting.
        key: &'static str,
        /// The value.
        found: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// A lens through which no light reaches the film.
    #[error("no light of {wavelength_nm} nm reaches a film {film_distance_mm} mm behind {lens}")]
    Dark {
        /// Name of the lens.
        lens: String,
        /// Distance of the film behind the last vertex, mm.
        film_distance_mm: f64,
        /// Wavelength, nm.
        wavelength_nm: f64,
    },
    /// A lens whose pupil cannot be divided.
    #[error("the pupil of this lens cannot be divided: {reason}")]
    Undividable {
        /// Why, and what can be done.
        reason: &'static str,
    },
    /// Point spread functions of an array that cannot be used.
    #[error("{key} of the point spread functions: {reason}")]
    Array {
        /// The axis, or what else is wrong.
        key: &'static str,
        /// What was found and what was expected.
        reason: String,
    },
    /// The work was stopped on request.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
