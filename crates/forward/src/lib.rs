//! From a scene and the image of a lens to spectral irradiance on the film.
//!
//! Each point of the film gathers what it sees: E(x) = I(x) `Σ_k` `w_k(x)` (L ∗ `h_k)(x`), with kernels `h_k` of sum 1 at the corners k of the tile that x lies in, weights
//! of sum 1, and the irradiance I of a uniform scene (`docs/forward.md`). Surfaces at different depths are blurred in layers and laid one behind the other, so that near
//! ones hide far ones.
//!
//! Radiance is W m⁻² sr⁻¹ nm⁻¹, irradiance W m⁻² nm⁻¹, absolute throughout. Row 0 of a picture is its top.
//!
//! This crate knows nothing of sensors, and of a lens only what [`LensImage`](dioptric_psf::LensImage) says.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod beyond;
mod blocks;
mod convolve;
mod coverage;
mod depth_check;
mod disc_lens;
mod error;
mod film;
mod gather;
mod ghosts;
mod halo;
mod hidden;
mod imaging;
mod irradiance;
mod kept;
mod lamps;
mod layers;
mod mixed;
mod narrow;
mod node_kernels;
mod occluded;
mod past_surfaces;
mod places;
mod plan;
mod points;
mod raster;
mod ray;
mod rectangle;
mod render;
mod sampler;
mod scene_layers;
mod sight;
mod source;
mod spec;
mod splines;
mod stopwatch;
mod surface;
mod surroundings;
mod symmetry;
mod tile;
mod tiling;
mod views;
mod visible;
mod wing;
mod work;

#[cfg(test)]
mod acceptance;
#[cfg(test)]
mod plan_tests;

pub use depth_check::check_depth_map;
pub use disc_lens::DiscLens;
pub use error::{ForwardError, SinkError};
pub use film::{BlurMode, Border, Film, Settings};
pub use ghosts::{GhostDetail, GhostFilm, GhostSources, LEAST_RAYS};
pub use irradiance::irradiance;
pub use kept::BandKernels;
pub use plan::ImagingPlan;
pub use render::render;
pub use source::{BandRadiance, OccludedLayer, SceneGeometry, SceneRadiance, Source};
pub use spec::{ImagingSpec, Sink};
pub use stopwatch::{Clock, ImagingTimes};
