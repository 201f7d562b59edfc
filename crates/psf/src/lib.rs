//! Point spread functions over field, depth and wavelength.
//!
//! A [`LensImageModel`] keeps where rays land, interpolates rays, and draws them on pixels with exact energy; [`LensImage`] is
//! what imaging a scene asks of it. [`Picture`]
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
mod blend;
mod blurred_edge;
mod count;
mod dark_fields;
mod decenter;
mod dispersion;
mod drawing;
mod energy;
mod error;
mod field_geometry;
mod field_to_film;
mod fields_along;
mod film_map;
mod gathering;
mod general;
mod geometry;
mod hurb_splatter;
mod kernel;
mod lens_image;
mod lit_fields;
mod mesh;
mod metrics;
mod middle_rays;
mod mirror;
mod model;
mod model_image;
mod narrow_gaussian;
pub mod paper;
mod part_image;
mod power;
mod pupil;
mod pupil_division;
mod raster;
mod ray_map;
mod render;
mod ring;
mod rotational;
mod settings;
mod splat;
mod watch;

pub use adaptive::{AdaptiveSettings, ErrorPlaces, MeasuredError};
pub use count::{AuthorsBending, CountingFilm, FrontGrid, mean_place_mm, trace_as_authors};
pub use decenter::lens_on_axis;
pub use drawing::{ModelUse, PsfQuery};
pub use energy::EnclosedEnergy;
pub use error::PsfError;
pub use field_geometry::FieldGeometry;
pub use fields_along::FieldsAlong;
pub use film_map::{FilmMap, PartOfPoint, RadialMap, ShiftedMap};
pub use gathering::GatheredFields;
pub use geometry::RadialGeometry;
pub use kernel::Kernel;
pub use lens_image::LensImage;
pub use lit_fields::LitFields;
pub use metrics::{Picture, Profile};
pub use model::LensImageModel;
pub use pupil_division::{PupilDivision, PupilSides, Sides};
pub use raster::Raster;
pub use settings::{BankSettings, Diffraction, FieldSampling, Interpolation, SampleCounts, WIDEST_FIELD_TAN};
