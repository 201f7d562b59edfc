//! Point spread functions of lenses, and where the points of a film look.
//!
//! A [`LensImageModel`] describes a lens from its film, by rays traced back into the scene, and draws them on pixels with exact energy;
//! [`LensImage`] is what imaging a scene asks of it. A [`PsfArray`] takes the place of the functions that it draws. [`Picture`] measures any
//! point spread function.
//!
//! Lengths are millimetres in the lens and on the film, micrometres on pixels; wavelengths nanometres; fields are
//! tangents at the entrance pupil and depths dioptres from it. Pictures are in the picture frame: the film turned by
//! 180°, x to the right, y up, row 0 the top.
//!
//! This crate knows nothing of scenes or sensors.
#![doc = include_str!("../README.md")]

mod bladed;
mod blurred_edge;
mod bundle;
mod count;
mod decenter;
mod energy;
mod error;
mod film_map;
mod hurb_splatter;
mod kernel;
mod lattice;
mod lens_image;
mod mesh;
mod metrics;
mod model;
mod narrow_gaussian;
mod part_image;
mod point_image;
mod power;
mod psf_array;
mod pupil;
mod pupil_division;
mod raster;
mod render;
mod ring;
mod settings;
mod splat;
mod spots;
mod station;
mod stored;
mod survey;
mod symmetry;
mod traced;

pub use count::{AuthorsBending, CountingFilm, FrontGrid, mean_place_mm, trace_as_authors};
pub use decenter::lens_on_axis;
pub use energy::EnclosedEnergy;
pub use error::PsfError;
pub use film_map::{FieldsAlong, FilmMap};
pub use kernel::Kernel;
pub use lens_image::{FilmQuery, LensImage, PupilEdges};
pub use metrics::{Picture, Profile};
pub use model::LensImageModel;
pub use point_image::PointImage;
pub use psf_array::{ArrayFields, PsfArray, PsfArrayParts};
pub use pupil_division::{PupilDivision, PupilSides, Sides};
pub use raster::Raster;
pub use render::ModelUse;
pub use settings::{Diffraction, ImageSettings};
