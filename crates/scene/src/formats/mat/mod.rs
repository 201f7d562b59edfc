//! MATLAB files of the scenes that `ISETCam` and its relatives save, and of other cubes.

mod container;
mod isetcam;
#[cfg(test)]
mod tests;

#[cfg(test)]
use isetcam::IsetScene;
pub(super) use isetcam::{MatScene, read_mat};
