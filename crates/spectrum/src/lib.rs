//! Wavelength grids, spectra, spectral images, illuminants, observers and color.
//!
//! Wavelengths are nanometers. Spectral radiance is W m⁻² sr⁻¹ nm⁻¹, spectral irradiance
//! W m⁻² nm⁻¹. Row 0 of an image is its top, upright as the photographer sees it.
//!
//! This crate is the bottom layer: it knows nothing of lenses, scenes, sensors or files, but for [`sort_exr_attributes`], which
//! all who write EXR need.
//!
//! ```
//! use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid, Xyz};
//! let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0)?;
//! let white = Illuminant::D65.spectrum().sample_held(&grid);
//! let xyz: Xyz = Observer::Cie1931.xyz(&grid, &white);
//! assert!((xyz.chromaticity()[0] - 0.3127).abs() < 0.002);
//! # Ok::<(), dioptric_spectrum::SpectrumError>(())
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod cancel;
mod color;
mod display;
mod error;
mod exr_header;
mod grid;
mod illuminant;
mod image;
mod lanes;
mod smooth_reflectance;
mod spectrum;

/// Planes and cubes of this crate are arrays of it.
pub use ndarray;

pub use cancel::{Cancel, Cancelled};
pub use color::{Lab, Observer, Xyz, adapt_bradford, delta_e_2000, srgb_decode, srgb_encode};
pub use display::Display;
pub use error::SpectrumError;
pub use exr_header::sort_exr_attributes;
pub use grid::WavelengthGrid;
pub use illuminant::{
    ColorTemperature, Illuminant, blackbody, blackbody_peak, color_checker_reflectances, daylight, planck,
};
pub use image::{Bands, DepthMap, Quantity, SpectralImage};
pub use lanes::lanes;
pub use smooth_reflectance::SmoothReflectance;
pub use spectrum::Spectrum;
