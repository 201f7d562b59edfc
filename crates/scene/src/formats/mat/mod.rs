//! MATLAB files of the scenes that `ISETCam` and its relatives save.

mod container;
mod isetcam;
#[cfg(test)]
mod tests;

pub use isetcam::{IsetScene, read_iset_mat};
