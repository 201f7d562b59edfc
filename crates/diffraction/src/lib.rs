//! Diffraction: uncertainty bending of rays (HURB) at the stop and the theory it is held to.
//!
//! Lengths are millimetres, wavelengths nanometres (vacuum), angles radians, in the lens frame of `dioptric-optics`.
//! Theory curves ([`airy`], [`Hurb::lsf`]) are in units of λN, N being the working f-number.
//!
//! This crate knows nothing of pixels, scenes or sensors. It bends rays between two calls of the tracer, and says how
//! far each ray is spread on the film.
#![doc = include_str!("../README.md")]

pub mod airy;
mod bend;
mod covariance;
mod hurb;
pub mod quadrature;
mod stop_ray;
mod width;

pub use bend::{BendForm, Edge, bend};
pub use covariance::Covariance;
pub use hurb::{Hurb, Spread};
pub use stop_ray::{StopRay, trace_stop_rays};
pub use width::full_width_at_half_maximum;
