//! The middle and the bottom: what came of the camera.

pub(super) mod camera_file;
pub(super) mod charts;
pub(super) mod images;
pub(super) mod lens_bench;
pub(super) mod picture;
pub(super) mod sensor_bench;
