//! A lens's image with places counted from the middle of a film that lies off the axis.

use std::{ops::Deref, sync::Arc};

use dioptric_psf::{FilmMap, Kernel, LensImage, PsfError, PsfQuery};
use glam::DVec2;

/// The image of a lens, places on the film counted from another place than the axis.
pub(crate) struct Framed<L> {
    pub(crate) lens: L,
    /// The place that they are counted from, mm from where they were.
    pub(crate) center_mm: DVec2,
}

impl<L> LensImage for Framed<L>
where
    L: Deref<Target: LensImage> + Sync,
{
    /// About the middle of the film nothing is.
    fn is_symmetric(&self) -> bool {
        false
    }

    fn wavelengths_nm(&self) -> (f64, f64) {
        self.lens.wavelengths_nm()
    }

    fn dioptres(&self) -> (f64, f64) {
        self.lens.dioptres()
    }

    fn is_dark_beyond_extent(&self) -> bool {
        self.lens.is_dark_beyond_extent()
    }

    fn is_dark_beyond_extent_on(&self, low_mm: DVec2, high_mm: DVec2) -> bool {
        self.lens.is_dark_beyond_extent_on(low_mm + self.center_mm, high_mm + self.center_mm)
    }

    fn film_map(&self, dioptres: f64, wavelength_nm: f64, extent_mm: f64) -> FilmMap {
        let extent_mm = extent_mm + self.center_mm.length();
        self.lens.film_map(dioptres, wavelength_nm, extent_mm).counted_from(self.center_mm)
    }

    fn kernel(&self, query: PsfQuery) -> Kernel {
        self.lens.kernel(query)
    }

    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let framed = |lens| Arc::new(Framed { lens, center_mm: self.center_mm }) as Arc<dyn LensImage + Send>;
        Ok(self.lens.through_parts(n_parts)?.into_iter().map(framed).collect())
    }

    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.blur_radius_mm(field_tan, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.spread_mm(field_tan, dioptres, wavelength_nm)
    }
}
