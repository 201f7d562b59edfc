//! What the blur asks of a lens.

use glam::DVec2;
use ndarray::Array2;

use crate::FilmMap;

/// A lens in focus somewhere: where it puts light, how much, and how it spreads it.
///
/// Fields are tangents at the entrance pupil in the picture frame (x right, y up).
pub trait Kernels: Sync {
    /// Whether fields that mirror each other, about the axes or their diagonals, have kernels that do: then those are asked
    /// for once in eight.
    fn is_symmetric(&self) -> bool;

    /// The wavelengths for which the lens is known, shortest and longest, nm.
    fn wavelengths_nm(&self) -> (f64, f64);

    /// The depths for which the lens is known, farthest and nearest, dioptres.
    fn dioptres(&self) -> (f64, f64);

    /// Whether the lens passes no light beyond the reach of its maps; if not, what comes there is not known.
    fn is_dark_beyond_reach(&self) -> bool;

    /// Returns the map from the film, at least up to `reach_mm` from the axis where the lens is known so far, to fields.
    fn film_map(&self, dioptres: f64, wavelength_nm: f64, reach_mm: f64) -> FilmMap;

    /// Returns the light of a point on a raster of pixels, an odd number of them each way.
    ///
    /// The centroid lies on the middle of the middle pixel; row 0 is the top of the picture. The sum is the share
    /// of the transmitted light that falls inside the raster, close to 1.
    fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Array2<f32>;

    /// Returns the radius of the blur, mm: above 0 for objects nearer than the focus, below 0 beyond it.
    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64;

    /// Returns the radius of what a point becomes, mm: of its blur, and of what is left of it in focus where that is much.
    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan, dioptres, wavelength_nm).abs()
    }
}
