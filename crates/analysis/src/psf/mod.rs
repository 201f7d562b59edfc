//! Point spread functions over field, distance and wavelength, and what is measured of them.

mod charts;
mod polychromatic;
mod request;
mod row;
pub(crate) mod spot;
mod table;
mod through_focus;
mod windowed;

pub use polychromatic::PolychromaticPsf;
pub use request::{PsfRequest, PsfSampling};
pub use row::{MtfRow, PsfRow, psf_csv};
pub use table::PsfSet;
pub use through_focus::ThroughFocus;
