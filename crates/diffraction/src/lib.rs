//! Diffraction: uncertainty bending of rays (HURB) at the stop, point spread functions and wavefronts of wave optics,
//! and the theory that both are held to.
//!
//! Lengths are millimetres, wavelengths nanometres (vacuum), angles radians, in the lens frame of `dioptric-optics`.
//! Theory curves ([`airy`], [`Hurb::lsf`]) are in units of λN, N being the working f-number.
//!
//! This crate knows nothing of scenes or sensors. It deviates rays between two calls of the tracer, computes how far each ray
//! is spread on the film, and sums the waves of one point there.
#![doc = include_str!("../README.md")]

pub mod airy;
mod covariance;
mod error;
mod hurb;
mod huygens;
mod opd;
mod sampled_hurb;
mod stop_edge;
mod stop_ray;
mod wave;
mod wavefront;
mod width;
pub mod zernike;

pub use covariance::Covariance;
pub use error::DiffractionError;
pub use hurb::{AngularSpread, CircularStop, Hurb};
pub use huygens::HuygensSources;
pub use opd::{best_wavefront_film_mm, opd_waves_at};
pub use sampled_hurb::{HurbForm, SampledHurb};
pub use stop_edge::StopEdge;
pub use stop_ray::{StopRay, trace_stop_rays};
pub use wave::{
    Encircled, LineSpread, Peak, PhaseRange, Propagation, PupilFunctionFit, PupilGrid, PupilOutline, PupilSamples,
    TransferFunction, TransferMethod, TransferQuality, TransferSpokes, WavePsf, WaveQuality, WaveWindow, WindowCenter,
    polychromatic_psf, pupil_samples, wave_psf,
};
pub use wavefront::{ReferenceSphere, Wavefront, WavefrontReference};
pub use width::full_width_at_half_maximum;
