//! What imaging a scene asks of a lens.

use std::sync::Arc;

use glam::DVec2;

use crate::{FilmMap, Kernel, PsfError, PsfQuery};

/// The image that a focused lens forms: where it puts light, how much, and how it spreads it.
///
/// Fields are tangents at the entrance pupil in the picture frame (x right, y up). [`LensImageModel`](crate::LensImageModel)
/// is that of a traced lens; others may be given by a formula or by measurements.
pub trait LensImage: Sync {
    /// Whether fields that mirror each other, about the axes or their diagonals, have kernels that do: then those are asked
    /// for once in eight.
    fn is_symmetric(&self) -> bool;

    /// The wavelengths for which the lens is known, shortest and longest, nm.
    fn wavelengths_nm(&self) -> (f64, f64);

    /// The depths for which the lens is known, farthest and nearest, dioptres.
    fn dioptres(&self) -> (f64, f64);

    /// Whether the lens passes no light beyond the extent of its maps; if not, what comes there is not known.
    fn is_dark_beyond_extent(&self) -> bool;

    /// Whether none that it passes from beyond the extent of its maps lands on a rectangle of the film, given by its corners left below and right above, mm.
    fn is_dark_beyond_extent_on(&self, low_mm: DVec2, high_mm: DVec2) -> bool {
        let _ = (low_mm, high_mm);
        self.is_dark_beyond_extent()
    }

    /// Returns the map from the film, at least up to `extent_mm` from its middle where the lens is known so far, to fields: to those whose reference
    /// points lie there. Those are the centroids of their light or other places that follow smoothly from the field.
    fn film_map(&self, dioptres: f64, wavelength_nm: f64, extent_mm: f64) -> FilmMap;

    /// Returns the point spread function of a point about its reference point, which need not lie in the middle of the samples ([`Kernel::middle_px`]); of a dark
    /// point that of one near by.
    fn kernel(&self, query: PsfQuery) -> Kernel;

    /// Returns the images through so many parts of the pupil, which add up to that of the whole: views of the scene from as many
    /// places, each blurred by the width of its part. Their blur radii are those of the whole pupil.
    ///
    /// # Errors
    /// When the pupil of the lens cannot be divided, as it is here unless another way is given.
    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let _ = n_parts;
        Err(PsfError::Undividable { reason: "nothing is known of its parts" })
    }

    /// Returns the radius of the blur, mm: above 0 for objects nearer than the focus, below 0 beyond it.
    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64;

    /// Returns the radius of what a point becomes, mm: of its blur, and of what is left of it in focus where that is much.
    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan, dioptres, wavelength_nm).abs()
    }
}
