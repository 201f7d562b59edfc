//! What can be wrong with a point spread function's settings.

use dioptric_diffraction::DiffractionError;
use dioptric_optics::OpticsError;
use dioptric_spectrum::Cancelled;

/// A bank or point spread function that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PsfError {
    /// The lens cannot be traced.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The waves of a point cannot be summed.
    #[error(transparent)]
    Diffraction(#[from] DiffractionError),
    /// An axis of the bank that is empty, or whose values do not ascend or are out of range.
    #[error("{axis} must be an ascending list of {expected}, found {found:?}")]
    Axis {
        /// The name of the setting.
        axis: &'static str,
        /// What its values must be.
        expected: &'static str,
        /// The list.
        found: Vec<f64>,
    },
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
    /// A lens that lets no light of an axial point through to the film.
    #[error("no light of an axial point at {dioptres} dioptres and {wavelength_nm} nm reaches the film through {lens}")]
    Dark {
        /// Name of the lens.
        lens: String,
        /// The point's vergence, 1/m.
        dioptres: f64,
        /// Wavelength, nm.
        wavelength_nm: f64,
    },
    /// A lens whose pupil cannot be divided.
    #[error("the pupil of this lens cannot be divided: {reason}")]
    Undividable {
        /// Why, and what can be done.
        reason: &'static str,
    },
    /// The work was stopped on request.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
