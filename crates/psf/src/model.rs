//! The image of a traced lens, described from the film.

use std::sync::Arc;

use dioptric_optics::Lens;
use glam::{DVec2, DVec3};

use crate::{
    Diffraction, FilmMap, FilmQuery, ImageSettings, Kernel, LensImage, PointImage, PsfArray, PsfError, PupilDivision,
    PupilEdges,
    part_image::PartImage,
    stored::{StoredPoint, StoredPsfs},
    traced::Shared,
};

/// The image that a lens forms, from rays traced back from the film.
///
/// Nothing is sampled over depth or wavelength: the rays that a point of the film sees leave the front of the lens along straight
/// lines, which are at all depths at once. Directions and irradiances are tabulated over the film, to 1e-6 and 1e-4; the bundle of a
/// kernel is traced where it is asked for.
#[derive(Clone, Debug)]
pub struct LensImageModel {
    shared: Arc<Shared>,
    /// In place of the point spread functions of the lens.
    stored: Option<Arc<StoredPsfs>>,
}

impl LensImageModel {
    /// Returns the image of a lens at these wavelengths, nm.
    ///
    /// # Errors
    /// When the settings make no sense, the lens has no index at a wavelength, or no light reaches the film.
    pub fn new(lens: &Lens, wavelengths_nm: &[f64], settings: &ImageSettings) -> Result<Self, PsfError> {
        let shared = Shared::new(lens, wavelengths_nm, settings)?;
        Ok(Self { shared: Arc::new(shared), stored: None })
    }

    /// Returns the image with these point spread functions in place of those of the lens, whatever its diffraction. Where points lie on the film
    /// and how bright they are is still traced.
    ///
    /// # Errors
    /// When the functions are not known at one of its wavelengths, or their points do not lie before the lens.
    pub fn with_psfs(self, array: Arc<PsfArray>) -> Result<Self, PsfError> {
        self.wavelengths_nm().iter().try_for_each(|&nm| array.check_at(nm))?;
        let stored = StoredPsfs::behind(array, self.shared.projection_center_z_mm())?;
        Ok(Self { stored: Some(Arc::new(stored)), ..self })
    }

    /// Returns the stored functions and what a point of the film asks of them.
    fn stored_at(&self, query: FilmQuery) -> Option<(&Arc<StoredPsfs>, StoredPoint)> {
        let stored = self.stored.as_ref()?;
        let FilmQuery { place_mm, dioptres, wavelength_nm, .. } = query;
        let direction = self.shared.direction(place_mm, wavelength_nm);
        Some((stored, self.stored_point(direction, dioptres, wavelength_nm)))
    }

    /// Returns the point that a direction of the scene shows, as the lens on its own axis sees it.
    fn stored_point(&self, direction: DVec3, dioptres: f64, wavelength_nm: f64) -> StoredPoint {
        let moved = self.shared.decenter().mm() * (1e-3 * dioptres * direction.z);
        StoredPoint { direction: direction - moved.extend(0.0), dioptres, wavelength_nm }
    }

    fn stored_about(
        &self,
        place_mm: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> Option<(&Arc<StoredPsfs>, StoredPoint)> {
        self.stored_at(FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um: 1.0 })
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        self.shared.lens()
    }

    /// How the lens stands and is traced.
    pub fn settings(&self) -> &ImageSettings {
        self.shared.settings()
    }

    /// The wavelengths that it was made for, nm; it can be asked for others.
    pub fn wavelengths_nm(&self) -> &[f64] {
        self.shared.wavelengths_nm()
    }

    /// The depth in focus at the reference wavelength, dioptres; 0 where none is.
    pub fn focus_dioptres(&self) -> f64 {
        self.shared.focus_dioptres()
    }

    /// Returns the image of a point of the scene, traced forward, at these tangents of field angles; `None` if none of its light reaches the
    /// film, or the lens is not known at the wavelength.
    pub fn point(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<PointImage> {
        if let Some(stored) = &self.stored {
            let map = self.shared.survey_of_film(&self.shared.color(wavelength_nm), 0.0).map.clone();
            // The map is that of points in focus.
            let out_of_focus = self.shared.decenter().mm() * (1e-3 * (dioptres - self.focus_dioptres()));
            let place_mm =
                map.place_mm(field_tan - out_of_focus).filter(|place_mm| map.irradiance_sr(*place_mm) > 0.0)?;
            let point = self.stored_point(field_tan.extend(1.0), dioptres, wavelength_nm);
            return Some(PointImage::stored(stored.clone(), point, place_mm));
        }
        PointImage::trace(self.lens(), self.settings(), field_tan, dioptres, wavelength_nm).ok().flatten()
    }

    /// Returns how much of the kernel of a point of the film is wave optics, and not HURB: 1 or 0, or between them where they are
    /// blended. It is 0 unless the settings have [`Diffraction::Wave`](crate::Diffraction::Wave), and in darkness.
    ///
    /// It falls with the range of phases B over the pupil that the diffraction integral has to follow, on a scale of its
    /// logarithm: from 1 at B = 200 to 0 at B = 400, a blur of about ten waves of defocus.
    pub fn wave_fraction(&self, query: FilmQuery) -> f64 {
        if self.stored.is_some() { 0.0 } else { self.shared.wave_fraction(query) }
    }

    /// Returns the images through the parts of a division of the pupil, whose irradiances add up to that of the whole: views of the scene
    /// from as many places, each blurred by what goes through its part. Blur radii are those of the whole pupil.
    ///
    /// The pupil of each point of the film is divided as that point sees it, vignetted or not.
    ///
    /// # Errors
    /// For diffraction integrals, which parts of a pupil do not add up to, and for point spread functions of an array.
    pub fn through(&self, division: PupilDivision) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        if self.stored.is_some() {
            return Err(PsfError::Undividable {
                reason: "the point spread functions of an array are those of all of it",
            });
        }
        let images = PartImage::all(&self.shared, division)?;
        Ok(images.into_iter().map(|image| Arc::new(image) as Arc<dyn LensImage + Send>).collect())
    }
}

impl LensImage for LensImageModel {
    fn is_symmetric(&self) -> bool {
        let is_stored_so = self.stored.as_ref().is_none_or(|stored| stored.is_symmetric());
        self.shared.is_rotational() && self.shared.decenter().is_none() && is_stored_so
    }

    fn known_wavelengths_nm(&self) -> &[f64] {
        self.stored.as_ref().map_or(&[], |stored| &stored.array().parts().wavelengths_nm)
    }

    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        self.shared.survey_of_film(&self.shared.color(wavelength_nm), reach_mm).map.clone()
    }

    fn kernel(&self, query: FilmQuery) -> Kernel {
        match self.stored_at(query) {
            Some((stored, point)) => stored.kernel(&point, query.pitch_um),
            None => self.shared.kernel(query, None),
        }
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match self.stored_about(place_mm, dioptres, wavelength_nm) {
            Some((stored, point)) => stored.blur_radius_mm(&point),
            None => self.shared.blur_radius_mm(place_mm, dioptres, wavelength_nm),
        }
    }

    fn spread_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match self.stored_about(place_mm, dioptres, wavelength_nm) {
            Some((stored, point)) => stored.spread_mm(&point),
            None => self.shared.spread_mm(place_mm, dioptres, wavelength_nm),
        }
    }

    fn pupil_edges(&self) -> Option<PupilEdges> {
        if self.stored.is_some() || self.settings().diffraction == Diffraction::None {
            return None;
        }
        let color = self.shared.color(*self.wavelengths_nm().first()?);
        let pieces = color.lens.stop_edges()?.pieces();
        Some(PupilEdges { pieces, diameter_mm: 2.0 * color.lens.stop_semi_aperture_mm() })
    }

    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        self.through(PupilDivision::new(n_parts))
    }
}
