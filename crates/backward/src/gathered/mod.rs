//! A picture of any world that is clean at once: light gathered by a few rays and smoothed over surfaces.
//!
//! Outlines, textures and mirrors are sharp, since only the light on surfaces is smoothed, not the picture. Pixels share what is seen
//! through their corners, and more points are looked at only where the corners of one are not alike. Light straight from its sources is
//! gathered at each corner, or at every other one each way; light that has bounced, by paths, at every other one. Both are smoothed
//! (Dammertz et al. 2010; edges of light stop the last pass alone) and taken from between the corners. What is scattered evenly is the
//! irradiance times the reflectance of each point, so that no texture is smoothed; gloss is smoothed as it is sent out.
//!
//! It is no unbiased estimate, as [`Renderer`](crate::Renderer) makes: edges of shadows are as wide as the smoothing, the light of single
//! paths is limited, all wavelengths are refracted as the first. `docs/backward.md` has what that comes to.

mod light;
mod look;
mod paint;
mod smooth;

use dioptric_spectrum::{Cancel, DepthMap, SpectralImage, WavelengthGrid};
use dioptric_world::World;
use ndarray::Array2;

use crate::{BackwardError, Camera, Pinhole};
use paint::Painter;

/// How carefully a view is gathered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewDetail {
    /// For pictures.
    #[default]
    Fine,
    /// For previews, in a third of the time: edges and shadows are rougher, and things much thinner than a pixel can be missed.
    Quick,
}

/// What a pinhole sees.
#[derive(Clone, Debug, PartialEq)]
pub struct GatheredView {
    /// The radiance, at the centers of the bands.
    pub radiance: SpectralImage,
    /// The depth along the axis at the middle of each pixel; infinite where nothing is met.
    pub depth: DepthMap,
}

/// Returns what a pinhole sees of a world; `progress` gets the part that is done, 0–1, from any thread.
///
/// Random rays are drawn from the seed; the result does not depend on the number of threads.
///
/// # Errors
/// When the view makes no sense, or it was cancelled.
pub fn gathered_view(
    world: &World,
    view: &Pinhole,
    grid: &WavelengthGrid,
    (detail, seed): (ViewDetail, u64),
    progress: &(dyn Fn(f64) + Sync),
    cancel: &Cancel,
) -> Result<GatheredView, BackwardError> {
    Camera::Pinhole(*view).check()?;
    let n_lanes = if grid.len() <= 8 { 8 } else { 32 };
    let n_parts = grid.len().div_ceil(n_lanes);
    let mut planes = Vec::with_capacity(grid.len());
    let mut z_m = Array2::zeros((0, 0));
    for part in 0..n_parts {
        let bands = &grid.centers_nm()[part * n_lanes..grid.len().min((part + 1) * n_lanes)];
        let report = |share: f64| progress((part as f64 + share) / n_parts as f64);
        let watch = (&report as &(dyn Fn(f64) + Sync), cancel);
        let (of_part, depths) = match n_lanes {
            8 => Painter::<8>::paint(world, view, bands, (detail, seed), watch)?,
            _ => Painter::<32>::paint(world, view, bands, (detail, seed), watch)?,
        };
        planes.extend(of_part);
        z_m = depths;
    }
    let radiance = SpectralImage::new(dioptric_spectrum::Quantity::Radiance, grid.clone(), planes)?;
    Ok(GatheredView { radiance, depth: DepthMap::new(z_m)? })
}
