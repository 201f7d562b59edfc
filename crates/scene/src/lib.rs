//! Spectral radiance with depth: scenes, their files, and targets.
//!
//! A [`Scene`] is what stands before the camera as seen from one point: spectral radiance (W m⁻² sr⁻¹ nm⁻¹), the
//! axial depth of each sample (m), and the pinhole geometry ([`View`]) that gives each sample a direction. Row 0 is
//! the top, upright as the photographer sees it.
//!
//! This crate knows nothing of lenses: what blurs a scene is another crate's concern.
//!
//! ```
//! use dioptric_scene::{Pattern, Target, TargetLight};
//! use dioptric_spectrum::{Illuminant, WavelengthGrid};
//! let target = Target {
//!     pattern: Pattern::SiemensStar { n_cycles: 36 },
//!     rows: 20,
//!     columns: 30,
//!     light: TargetLight::Illuminant(Illuminant::D65),
//!     luminance_cd_m2: 200.0,
//!     dark: 0.02,
//!     supersampling: 4,
//!     horizontal_fov_deg: 20.0,
//!     distance_m: 2.0,
//! };
//! let scene = target.scene(&WavelengthGrid::uniform(450.0, 650.0, 50.0)?)?;
//! assert_eq!(scene.require_depth()?.range_m(), (2.0, 2.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod display_model;
mod error;
mod formats;
mod light;
mod point_lights;
mod preview;
mod reframe;
mod resample;
mod scene;
mod shown;
mod targets;
mod view;

/// Planes and cubes of this crate are arrays of it.
pub use dioptric_pictures::StatedColors;
pub use ndarray;

pub use display_model::{DisplayCurve, DisplayModel, PixelLayout};
pub use error::SceneError;
pub use formats::{
    DepthKind, ExrParts, ExrSamples, FileQuantity, FileReading, FillDepth, IsetIrradiance, NamedArray, NamedPlanes,
    NoData, Noted, Panorama, Part, PictureSamples, PointTable, ReadOptions, SpectralFile, SpectralHead, envi_bytes,
    filled_depth, flat_size_of, holds_iset_irradiance, is_irradiance_exr, is_light_file, joules_per_photon,
    may_be_read_with, notes_on_samples, read_exr_text, read_iset_display, read_iset_irradiance, read_light,
    read_mat_matrices, read_npz_arrays, read_picture, read_picture_samples, read_planes_exr, read_scene,
    read_spectral_exr, write_iset_irradiance, write_iset_scene, write_npz_arrays, write_planes_exr, write_scene_exr,
    write_spectral_exr,
};
pub use light::SceneLight;
pub use point_lights::{PointBrightness, PointLight, PointPlace};
pub use preview::{srgb_preview, write_preview_png};
pub use resample::{reflectance_under, resampled};
pub use scene::{HiddenLayer, Scene};
pub use targets::{Pattern, Target, TargetLight, Wave};
pub use view::View;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
