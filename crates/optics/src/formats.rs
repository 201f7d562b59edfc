//! Lens files, told apart by their extension.

mod agf;
mod bench;
mod configuration;
mod dat;
mod decode;
mod deeplens;
mod glass_file;
mod glasses;
mod iset_json;
mod json;
mod len;
mod lens_file;
mod number;
mod pbrt_list;
mod prescription;
mod read;
mod rii_yaml;
mod scale;
mod seq;
mod shapes;
mod system;
mod system_states;
mod text_error;
mod write;
mod write_seq;
mod write_zmx;
mod zar;
mod zmx;

pub use lens_file::{
    Configuration, Field, LensFile, Microlens, MissingGlass, REFERENCE_WAVELENGTH_NM, ReadOptions, SeqNumbers,
    nearest_to_reference_nm,
};
pub(crate) use prescription::lens_from_ron;
