//! Spectral radiance with depth: scenes, their files, targets and a built-in still life.
//!
//! A [`Scene`] is what stands before the camera as seen from one point: spectral radiance (W m⁻² sr⁻¹ nm⁻¹), the
//! axial depth of each sample (m), and the pinhole geometry ([`View`]) that gives each sample a direction. Row 0 is
//! the top, upright as the photographer sees it.
//!
//! This crate knows nothing of lenses: what blurs a scene is another crate's concern.

mod error;
mod formats;
mod preview;
mod resample;
mod scene;
mod still_life;
mod targets;
mod view;

pub use error::SceneError;
pub use formats::{
    BandWriter, EnviCube, ExrParts, ReadOptions, SpectralFile, read_band_folder, read_envi, read_picture,
    read_planes_exr, read_scene, read_spectral_exr, write_planes_exr, write_scene_exr, write_spectral_exr,
};
pub use preview::{srgb_preview, write_preview_png};
pub use resample::{reflectance_under, resampled};
pub use scene::{HiddenLayer, Scene};
pub use still_life::StillLife;
pub use targets::{Pattern, Target, TargetLight};
pub use view::View;
