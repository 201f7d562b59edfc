//! MATLAB and HDF5 files of the scenes that `ISETCam` and its relatives save, and of other cubes.

mod container;
mod elements;
#[cfg(test)]
pub(super) mod fixtures;
mod hdf5;
mod iset_write;
mod isetcam;
#[cfg(test)]
mod tests;

pub use iset_write::write_iset_scene;
#[cfg(test)]
use isetcam::IsetScene;
pub(super) use isetcam::{MatScene, WAVES, read_mat};
