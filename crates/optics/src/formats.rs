//! Lens files, told apart by their extension.

mod agf;
mod dat;
mod decode;
mod deeplens;
mod glass_file;
mod glasses;
mod iset_json;
mod json;
mod lens_file;
mod pbrt_list;
mod rii_yaml;
mod seq;
mod shapes;
mod system;
mod write;
mod write_zmx;
mod zmx;

use std::path::Path;

use crate::{Lens, OpticsError};

pub use lens_file::{Field, LensFile, Microlens, MissingGlass, ReadOptions, SeqNumbers};

/// Reads a lens file, and gives the lens alone.
pub(crate) fn read(path: &Path) -> Result<Lens, OpticsError> {
    LensFile::read(path, &ReadOptions::default()).map(|file| file.lens)
}
