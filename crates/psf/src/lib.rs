//! Point spread functions over field, depth and wavelength.
//!
//! A [`PsfBank`] keeps where rays land, interpolates rays, and draws them on pixels with exact energy. [`Picture`]
//! measures any point spread function.
//!
//! Lengths are millimetres in the lens and on the film, micrometres on pixels; wavelengths nanometres; fields are
//! tangents at the entrance pupil and depths dioptres from it. Pictures are in the picture frame: the film turned by
//! 180°, x to the right, y up, row 0 the top.
//!
//! This crate knows nothing of scenes or sensors.
#![doc = include_str!("../README.md")]

mod adaptive;
mod axis;
mod bank;
mod bend;
mod blend;
mod count;
mod dispersion;
mod drawing;
mod energy;
mod error;
mod field_bank;
mod field_geometry;
mod geometry;
mod imaging;
mod kernel;
mod mesh;
mod metrics;
pub mod paper;
mod power;
mod profile;
mod pupil;
mod raster;
mod ray_map;
mod render;
mod ring;
mod settings;
mod splat;
mod store;
mod stroke;

pub use adaptive::{AdaptiveSettings, ErrorPlaces, MeasuredError};
pub use bank::PsfBank;
pub use count::{AuthorsBending, CountingFilm, FrontGrid, mean_place_mm, trace_as_authors};
pub use drawing::{ModelUse, PsfQuery};
pub use energy::EnclosedEnergy;
pub use error::PsfError;
pub use field_bank::{FieldBank, FieldBankSettings};
pub use field_geometry::FieldGeometry;
pub use geometry::RadialGeometry;
pub use imaging::ImagingBank;
pub use kernel::Kernel;
pub use metrics::{Picture, Profile};
pub use raster::Raster;
pub use settings::{BankSettings, Diffraction, Interpolation};
