//! Files of scenes.

mod axes;
mod band_folder;
mod band_name;
mod belonging;
mod camera;
mod camera_files;
mod camera_models;
mod camera_yaml;
mod chart_table;
mod column_names;
mod contents;
mod cube_folder;
mod depth;
mod depth_names;
mod depth_numbers;
#[cfg(test)]
mod depth_tests;
mod distortion;
mod envi;
mod envi_data;
mod envi_header;
mod exr_attributes;
mod exr_colors;
mod exr_depth;
mod exr_depth_file;
mod exr_layers;
mod exr_samples;
mod exr_stream;
#[cfg(test)]
mod exr_tests;
mod exr_write;
mod flat_size;
mod gray_picture;
mod hidden_layer;
#[cfg(test)]
mod input_tests;
#[cfg(test)]
mod kinds_tests;
mod length_unit;
mod light_file;
mod light_unit;
mod lighting;
mod mat;
#[cfg(test)]
mod mutation_tests;
mod no_data;
mod npy;
mod npz;
mod panorama;
#[cfg(test)]
mod payload_tests;
mod pfm;
mod photons;
mod picture;
mod picture_parts;
mod point_table;
mod primaries;
mod radiance_header;
mod raw_depth;
mod read_contents;
mod read_options;
mod read_scene;
mod reading;
mod reduced;
mod scene_depth;
#[cfg(test)]
mod secondary_tests;
mod smooth_lift;
mod spectral_exr;
mod stated;
#[cfg(test)]
mod statement_tests;
mod text_depth;
mod tiff_bands;
mod tiff_depth_map;
mod tiff_directory;
mod tiff_file;
mod tiff_gdal;
mod tiff_page;
mod understood;
mod unmeasured;
mod unusable;
mod wavelength_unit;
#[cfg(test)]
mod word_tests;
#[cfg(test)]
mod written_tests;

pub(crate) use picture::decode as decode_picture;
pub(crate) use understood::note_of_gaps;
pub(crate) use unusable::{check_made, unwritable};

pub use belonging::may_be_read_with;
pub use envi::envi_bytes;
pub use exr_samples::ExrSamples;
pub use exr_stream::{SpectralHead, is_irradiance_exr, read_exr_text};
pub use exr_write::{ExrParts, write_planes_exr, write_scene_exr, write_spectral_exr};
pub use flat_size::flat_size_of;
pub use light_file::{is_light_file, read_light};
pub use mat::{
    IsetIrradiance, holds_iset_irradiance, read_iset_display, read_iset_irradiance, read_mat_matrices,
    write_iset_irradiance, write_iset_scene,
};
pub use npz::{NamedArray, read_npz_arrays, write_npz_arrays};
pub use photons::joules_per_photon;
pub use picture::{PictureSamples, notes_on_samples, read_picture, read_picture_samples};
pub use point_table::PointTable;
pub use read_options::{Part, ReadOptions};
pub use read_scene::read_scene;
pub use reading::{DepthKind, FileQuantity, FileReading, NoData, Panorama};
pub use spectral_exr::{NamedPlanes, SpectralFile, read_planes_exr, read_spectral_exr};
pub use stated::Noted;
pub use unmeasured::{FillDepth, filled_depth};
