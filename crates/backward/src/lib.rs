//! Backward rendering: from the film through a lens into a spectral three-dimensional world, in absolute units.
//!
//! A [`Renderer`] makes passes over a picture of a [`World`](dioptric_world::World) as a [`Camera`] sees it; each is an independent, unbiased
//! estimate of spectral irradiance on the film (W m⁻² nm⁻¹), and their spread the standard error of the picture. Eight
//! wavelengths are sampled at once, each through its own path in the lens and, where those differ, its own in the world.
//! Pictures depend on the seed and not on threads.
//!
//! [`gathered_view`] is the quick, clean picture of what a pinhole sees, for previews.
//!
//! Lens lengths are millimeters in the frame of `dioptric-optics`; worlds are in meters. Pictures are upright as the
//! photographer sees them, row 0 at the top. This crate knows nothing of sensors.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod auxiliary;
mod camera;
mod checkpoint;
mod error;
mod film;
mod gathered;
mod integrator;
mod lens_camera;
mod media;
mod micro_array;
mod output;
mod packets;
mod peeling;
mod placement;
mod renderer;
mod sampler;
mod world_camera;

/// Planes and cubes of this crate are arrays of it.
pub use ndarray;

pub use auxiliary::{Auxiliary, auxiliary, depth_along, layered_depth};
pub use camera::{Camera, Panorama, Parallel, Pinhole, ThinLens};
pub use error::BackwardError;
pub use gathered::{GatheredView, ViewDetail, gathered_view};
pub use integrator::LightPaths;
pub use lens_camera::{FilmLine, LensCamera, LensCameraSettings, LensOrigin};
pub use micro_array::{MicroArray, MicroElements, MicroLayout};
pub use output::{write_auxiliary_exr, write_rendering_exr};
pub use packets::BandSampling;
pub use placement::{PixelGrid, Placement, Rendering};
pub use renderer::{Bands, RenderSettings, Renderer};
pub use sampler::{SOBOL_DIMENSIONS, Sampler, scrambled_sobol};
pub use world_camera::distance_ahead_m;
