//! Scenes that reach into the lens.

use dioptric_optics::Lens;
use dioptric_spectrum::{DepthMap, WavelengthGrid};

use crate::ForwardError;

/// Checks that no part of a scene lies inside a lens.
///
/// # Errors
/// Names the nearest sample, where it is no farther from the entrance pupil than the first surface of the lens is, or when the lens
/// has no index at the middle wavelength of the grid.
pub fn check_depth_map(lens: &Lens, grid: &WavelengthGrid, depth: &DepthMap) -> Result<(), ForwardError> {
    let nearest = depth.z_m().indexed_iter().min_by(|a, b| a.1.total_cmp(b.1));
    nearest.map_or(Ok(()), |(place, &z_m)| check_depth(lens, grid, f64::from(z_m), Some(place)))
}

fn check_depth(
    lens: &Lens,
    grid: &WavelengthGrid,
    depth_m: f64,
    place: Option<(usize, usize)>,
) -> Result<(), ForwardError> {
    let centers_nm = grid.centers_nm();
    let least_m = 1e-3 * lens.at(centers_nm[centers_nm.len() / 2])?.projection_center_z_mm();
    // Depths of a map are in single precision.
    if depth_m > 0.0 && depth_m <= least_m * (1.0 + 1e-6) {
        return Err(ForwardError::DepthInsideLens { depth_m, place, lens: lens.name().to_owned(), least_m });
    }
    Ok(())
}
