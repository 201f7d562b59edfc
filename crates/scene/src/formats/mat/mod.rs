//! MATLAB and HDF5 files of the scenes that `ISETCam` and its relatives save, and of other cubes.

mod container;
mod dimensions;
mod elements;
#[cfg(test)]
pub(super) mod fixtures;
mod hdf5;
mod iset_display;
mod iset_film;
mod iset_kinds;
mod iset_write;
mod isetcam;
mod links;
mod packing;
mod plane;
#[cfg(test)]
mod tests;

pub use iset_display::read_iset_display;
pub use iset_film::{IsetIrradiance, holds_iset_irradiance, read_iset_irradiance, write_iset_irradiance};
pub use iset_write::write_iset_scene;
#[cfg(test)]
use isetcam::IsetScene;
pub(super) use isetcam::{MatScene, UnitOf, read_mat};
pub(super) use packing::{Nearness, nearest_list, rank_of_waves};
pub use plane::read_mat_matrices;
pub(super) use plane::{DEPTHS, Plane, has_variable, read_plane};
