//! What the blur asks of a lens.

use glam::DVec2;
use ndarray::Array2;

use crate::RadialMap;

/// A rotationally symmetric lens in focus somewhere: where it puts light, how much, and how it spreads it.
///
/// Fields are tangents at the entrance pupil in the picture frame (x right, y up). The kernels of fields that
/// mirror each other must mirror each other: they are asked for once in eight.
pub trait Kernels: Sync {
    /// The wavelengths for which the lens is known, shortest and longest, nm.
    fn wavelengths_nm(&self) -> (f64, f64);

    /// The depths for which the lens is known, farthest and nearest, dioptres.
    fn dioptres(&self) -> (f64, f64);

    /// Whether the lens passes no light beyond the reach of its radial maps; if not, what comes there is not known.
    fn is_dark_beyond_reach(&self) -> bool;

    /// Returns the map from the film, up to `reach_mm` from the axis, to fields.
    fn radial_map(&self, dioptres: f64, wavelength_nm: f64, reach_mm: f64) -> RadialMap;

    /// Returns the light of a point on a raster of pixels, an odd number of them each way.
    ///
    /// The centroid lies on the middle of the middle pixel; row 0 is the top of the picture. The sum is the share
    /// of the transmitted light that falls inside the raster, close to 1.
    fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Array2<f32>;

    /// Returns the radius of the blur, mm: above 0 for objects nearer than the focus, below 0 beyond it.
    fn blur_radius_mm(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> f64;
}
