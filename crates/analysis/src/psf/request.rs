//! Which point-spread functions to compute, and how.

use std::{borrow::Cow, sync::Arc};

use dioptric_optics::{Lens, MonoLens, ObjectPoint};
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel, PointImage, PsfArray, PsfError};

use crate::{
    AfocalView, AnalysisFilm, FilmPlace, FilmUse,
    field_angles::{FieldAngles, KNOWN_ANGLES},
};
use dioptric_pipeline::PipelineError;

/// Pixels along the side of the largest picture that is made.
pub(crate) const LARGEST: usize = 4097;
/// Rings and azimuths of the rays through a pupil.
const RINGS: usize = 24;
const AZIMUTHS: usize = 96;

/// Which point-spread functions to compute, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfRequest {
    /// Field angles at the entrance pupil, to the right of the picture and upwards, degrees; of far points up to 120 along one of
    /// them.
    pub fields_deg: Vec<[f64; 2]>,
    /// Distances of the points before the first vertex, mm; infinity for a star.
    pub distances_mm: Vec<f64>,
    /// Wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Where the film is.
    pub film: AnalysisFilm,
    /// Wavelengths that are in focus together on a film that is sought, nm; none for those of the pictures.
    pub focus_nm: Vec<f64>,
    /// The main wavelength of the lens's file, nm, where it states one: of paraxial images, fields and f-numbers.
    pub main_nm: Option<f64>,
    /// Diffraction at the stop.
    pub diffraction: Diffraction,
    /// Side of a pixel, µm.
    pub pixel_um: f64,
    /// Pixels along the side of a picture; `None` to hold the spot.
    pub size: Option<usize>,
    /// How the light is sampled.
    pub sampling: PsfSampling,
    /// Spatial frequencies of the MTF tables, cycles per mm.
    pub mtf_per_mm: Vec<f64>,
    /// The seed of the paper mode's jitter and diffraction.
    pub seed: u64,
    /// Weights of the wavelengths in the light of all of them; none for all alike.
    pub spectral_weights: Vec<f64>,
}

/// How the light of a point is sampled.
#[derive(Clone, Debug, PartialEq)]
pub enum PsfSampling {
    /// Rays through the true pupil, drawn with exact energy.
    Pupil,
    /// The paper's: rays on a square grid over the front rim, counted a pixel.
    Paper {
        /// Rays along the side of the grid.
        n_across: usize,
        /// Whether each ray is moved by up to half a step of the grid both ways, drawn from the seed, as the authors did: an exact grid beats
        /// with the pixels, so that rows of them get several times the rays of their neighbors.
        jitter: bool,
    },
    /// Not at all: point spread functions of an array take the place of those of the lens.
    Stored(Arc<PsfArray>),
}

/// One point-spread function to compute.
#[derive(Clone, Copy)]
pub(crate) struct Item {
    pub(crate) field_deg: f64,
    pub(crate) field_y_deg: f64,
    pub(crate) distance_mm: f64,
    pub(crate) wavelength_nm: f64,
    pub(crate) dioptres: f64,
}

impl Item {
    pub(crate) fn angles(&self) -> FieldAngles {
        FieldAngles::of_deg([self.field_deg, self.field_y_deg])
    }

    /// Returns the point, seen through the lens at the reference wavelength.
    pub(crate) fn point(&self, reference: &MonoLens) -> ObjectPoint {
        self.angles().point(reference, self.dioptres)
    }

    /// Returns the point as a lens with the functions of an array images it; `None` of a dark one.
    pub(crate) fn stored_image(&self, model: &LensImageModel) -> Option<PointImage> {
        let angles = self.angles();
        model.point(angles.direction * angles.angle_deg.to_radians().tan(), self.dioptres, self.wavelength_nm)
    }

    /// Returns the point as the lens images it; `None` of a dark one.
    pub(crate) fn image(&self, lens: &Lens, settings: &ImageSettings) -> Result<Option<PointImage>, PipelineError> {
        let point = self.point(&lens.at(settings.reference_wavelength_nm)?);
        Ok(PointImage::of_point(lens, settings, point, self.wavelength_nm)?)
    }
}

impl PsfRequest {
    /// Returns the lens at [`reference_nm`](Self::reference_nm).
    pub(crate) fn reference(&self, lens: &Lens) -> Result<MonoLens, PipelineError> {
        self.film_use().reference(lens)
    }

    /// The wavelength of fields, focus and f-numbers, nm, as [`FilmUse::reference`] has it.
    ///
    /// # Errors
    /// When the lens is not known at that wavelength.
    pub fn reference_nm(&self, lens: &Lens) -> Result<f64, PipelineError> {
        Ok(self.reference(lens)?.wavelength_nm())
    }

    fn film_use(&self) -> FilmUse<'_> {
        let is_own = self.focus_nm.is_empty() || self.focus_nm == self.wavelengths_nm;
        let (wavelengths_nm, weights) = match is_own {
            true => (&self.wavelengths_nm, self.spectral_weights.as_slice()),
            false => (&self.focus_nm, [].as_slice()),
        };
        let distance_mm = self.distances_mm.first().copied().unwrap_or(f64::INFINITY);
        FilmUse { main_nm: self.main_nm, wavelengths_nm, weights, distance_mm }
    }

    /// Returns the lens that is looked through: where its light leaves in parallel and no film is given, the lens with an ideal one
    /// behind it.
    pub(crate) fn lens_with_image<'a>(
        &self,
        lens: &'a Lens,
    ) -> Result<(Cow<'a, Lens>, Option<AfocalView>), PipelineError> {
        AfocalView::applied(lens, self.film, &self.film_use())
    }

    /// Returns where the film is: of a focus to be found, that of the first distance.
    ///
    /// # Errors
    /// When the lens is not known at a wavelength, or has no image to focus on.
    pub fn film_place(&self, lens: &Lens) -> Result<FilmPlace, PipelineError> {
        self.film.place(lens, self.film_use())
    }

    /// Returns the lens with the functions of an array, where they take the place of its own.
    ///
    /// # Errors
    /// When they are not known at a wavelength, or no light reaches the film.
    pub(crate) fn stored_model(
        &self,
        lens: &Lens,
        settings: &ImageSettings,
    ) -> Result<Option<LensImageModel>, PipelineError> {
        let PsfSampling::Stored(array) = &self.sampling else { return Ok(None) };
        Ok(Some(LensImageModel::new(lens, &self.wavelengths_nm, settings)?.with_psfs(array.clone())?))
    }

    /// Returns the points: fields outermost, then distances, then wavelengths.
    pub(crate) fn items(&self, lens: &Lens) -> Result<Vec<Item>, PipelineError> {
        let reference = self.reference(lens)?;
        let pupil_z_mm = reference.projection_center_z_mm();
        let mut items = Vec::new();
        for &[field_deg, field_y_deg] in &self.fields_deg {
            for &distance_mm in &self.distances_mm {
                let z_mm = distance_mm + pupil_z_mm;
                if z_mm <= 0.0 {
                    let found = distance_mm.to_string();
                    return Err(self.wrong("distances_mm", &found, "points before the entrance pupil"));
                }
                let dioptres = 1e3 / z_mm;
                items.extend(self.wavelengths_nm.iter().map(|&wavelength_nm| Item {
                    field_deg,
                    field_y_deg,
                    distance_mm,
                    wavelength_nm,
                    dioptres,
                }));
            }
        }
        Ok(items)
    }

    /// Returns how a lens stands before a film.
    pub(crate) fn image_settings(&self, lens: &Lens, film_distance_mm: f64) -> Result<ImageSettings, PipelineError> {
        Ok(ImageSettings {
            film_distance_mm,
            reference_wavelength_nm: self.reference_nm(lens)?,
            diffraction: self.diffraction,
            n_rings: RINGS,
            n_azimuths: AZIMUTHS,
        })
    }

    pub(crate) fn check(&self) -> Result<(), PipelineError> {
        for &distance in &self.distances_mm {
            if distance.is_nan() || distance <= 0.0 {
                return Err(self.wrong("distances_mm", &distance.to_string(), "numbers above 0, or inf"));
            }
        }
        // The paper's rays go to a grid across the axis, and stored functions are looked up by tangents.
        let is_paper = !matches!(self.sampling, PsfSampling::Pupil);
        let nearest_mm = self.distances_mm.iter().copied().fold(f64::INFINITY, f64::min);
        for &field in &self.fields_deg {
            if !FieldAngles::are_known(field, if is_paper { 0.0 } else { nearest_mm }) {
                let [x, y] = field;
                let found = if x.abs() > y.abs() || x.is_nan() { x } else { y };
                let expected = match self.sampling {
                    PsfSampling::Pupil => KNOWN_ANGLES,
                    PsfSampling::Paper { .. } => "angles below 90 degrees in the paper mode",
                    PsfSampling::Stored(_) => "angles below 90 degrees with functions of a file",
                };
                return Err(self.wrong("fields_deg", &found.to_string(), expected));
            }
        }
        for &wavelength in &self.wavelengths_nm {
            if !(wavelength.is_finite() && wavelength > 0.0) {
                return Err(self.wrong("wavelengths_nm", &wavelength.to_string(), "numbers above 0"));
            }
        }
        if let Err(PsfError::Setting { key, found, expected }) = self.diffraction.check() {
            return Err(self.wrong(key, &found.to_string(), expected));
        }
        if !(self.pixel_um.is_finite() && self.pixel_um > 0.0) {
            return Err(self.wrong("pixel_um", &self.pixel_um.to_string(), "a number above 0"));
        }
        if let Some(size) = self.size
            && !(1..=LARGEST).contains(&size)
        {
            return Err(self.wrong("size", &size.to_string(), &format!("1 to {LARGEST}")));
        }
        if let PsfSampling::Paper { n_across, .. } = self.sampling
            && !(2..=20_000).contains(&n_across)
        {
            return Err(self.wrong("rays", &n_across.to_string(), "2 to 20000"));
        }
        if matches!(self.sampling, PsfSampling::Paper { .. }) && self.diffraction == Diffraction::Wave {
            return Err(self.wrong("diffraction", "wave", "HURB or none in the paper mode"));
        }
        if matches!(self.sampling, PsfSampling::Stored(_)) && self.diffraction != Diffraction::None {
            return Err(self.wrong(
                "diffraction",
                "of the lens",
                "none, with functions of a file, which have their own",
            ));
        }
        let (weights, n) = (&self.spectral_weights, self.wavelengths_nm.len());
        let are_weights = weights.iter().all(|w| w.is_finite() && *w >= 0.0) && weights.iter().any(|w| *w > 0.0);
        if !weights.is_empty() && (weights.len() != n || !are_weights) {
            let expected = format!("{n} numbers of 0 or more, one a wavelength");
            return Err(self.wrong("spectral_weights", &format!("{weights:?}"), &expected));
        }
        match self.mtf_per_mm.iter().find(|f| !f.is_finite()) {
            Some(found) => Err(self.wrong("mtf_per_mm", &found.to_string(), "finite numbers")),
            None => Ok(()),
        }
    }

    pub(crate) fn wrong(&self, key: &'static str, found: &str, expected: &str) -> PipelineError {
        PipelineError::Value { origin: "psf".to_owned(), key, found: found.to_owned(), expected: expected.to_owned() }
    }
}
