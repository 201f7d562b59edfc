//! From a scene and the PSFs of a lens to spectral irradiance on the film.
//!
//! Every sample of the scene is put where the centroid of its PSF lies (distortion and lateral color included),
//! given the irradiance that the pupil passes, and spread by the PSF of its place, depth and wavelength. Surfaces at
//! different depths are blurred in layers and laid one behind the other, so that near ones hide far ones.
//!
//! Radiance is W m⁻² sr⁻¹ nm⁻¹, irradiance W m⁻² nm⁻¹, absolute throughout. Row 0 of a picture is its top.
//!
//! This crate knows nothing of sensors, and of a lens only what [`LensImage`](dioptric_psf::LensImage) asks.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod active;
mod basis;
mod block_layers;
mod block_search;
mod blur;
mod by_knots;
mod convolve;
mod cost;
mod coverage;
mod disc_lens;
mod error;
mod expansion;
mod film;
mod film_lens;
mod framed;
mod geometry;
mod halo;
mod hidden;
mod irradiance;
mod knot_kernels;
mod lateral_color;
mod layers;
mod layout;
mod level;
mod mesh;
mod mixed;
mod narrow;
mod neighbors;
mod occluded;
mod occlusion;
mod patch;
mod patch_samples;
mod plan;
mod probe;
mod raster;
mod rectangle;
mod render;
mod sample_density;
mod sampler;
mod seams;
mod smoothing;
mod source;
mod spec;
mod squares;
mod stopwatch;
mod stream;
mod tiles;
mod uniform_response;
mod views;
mod work;

#[cfg(test)]
mod acceptance;
#[cfg(test)]
mod plan_tests;

pub use basis::BandKernels;
pub use coverage::{PsfDomain, check_depth_map};
pub use disc_lens::DiscLens;
pub use error::{ForwardError, SinkError};
pub use film::{BlurMode, Film, Settings};
pub use irradiance::irradiance;
pub use plan::ImagingPlan;
pub use render::render;
pub use source::{BandRadiance, OccludedLayer, SceneGeometry, SceneRadiance, Source};
pub use spec::{ImagingSpec, Sink};
pub use stopwatch::{Clock, ImagingTimes};
