//! Files of scenes.

mod band_folder;
mod band_name;
mod camera;
mod depth_picture;
mod envi;
mod envi_header;
mod exr_attributes;
mod exr_samples;
mod exr_stream;
#[cfg(test)]
mod exr_tests;
mod exr_write;
mod light_unit;
mod mat;
#[cfg(test)]
mod payload_tests;
mod photons;
mod picture;
mod read_scene;
mod spectral_exr;
mod unmeasured;
mod unusable;

pub(crate) use picture::decode as decode_picture;
pub(crate) use unusable::{check_made, unwritable};

pub use band_folder::read_band_folder;
pub use envi::{EnviCube, read_envi};
pub use exr_samples::ExrSamples;
pub use exr_stream::{SpectralHead, read_exr_light};
pub use exr_write::{ExrParts, write_planes_exr, write_scene_exr, write_spectral_exr};
pub use mat::{IsetScene, read_iset_mat};
pub use picture::{PictureSamples, read_picture, read_picture_samples};
pub use read_scene::{ReadOptions, read_hidden_layer, read_scene};
pub use spectral_exr::{SpectralFile, read_planes_exr, read_spectral_exr};
pub use unmeasured::FillDepth;
