//! Where the film is: one rule for everything that is asked of a lens.

use dioptric_optics::{
    Lens, MonoLens, ObjectPoint,
    analysis::{Autofocus, PupilRule},
    glam::DVec2,
};

use dioptric_pipeline::{PipelineError, REFERENCE_WAVELENGTH_NM, nearest_to_reference_nm};

/// The focal length of the ideal lens through which afocal light is looked at, mm: on its film 1 mm is 1/1000 of a tangent, and so
/// 1 µm is 1 µrad near the axis, and 1 mm of focus is 1/1000 of a dioptre.
pub(crate) const IDEAL_MM: f64 = 1000.0;

/// Where the film is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnalysisFilm {
    /// At the image plane that the file of the lens states, this far behind the last vertex, mm.
    OfFile(f64),
    /// Where the spot on the axis is smallest, all wavelengths together by their weights.
    BestFocus,
    /// At the paraxial image, at the wavelength of its focus ([`FilmUse::reference`]), of an object this far before the first vertex, mm.
    FocusMm(f64),
    /// This far behind the last vertex, mm.
    FilmMm(f64),
    /// In the focal plane of an ideal lens behind the lens, which forms no image itself ([`AfocalView`](super::AfocalView)).
    Afocal,
}

/// For what a film is looked for.
#[derive(Clone, Copy, Debug)]
pub struct FilmUse<'a> {
    /// The main wavelength of the lens's file, nm, where it states one.
    pub main_nm: Option<f64>,
    /// The wavelengths that are looked at, nm: those that are to be in focus together.
    pub wavelengths_nm: &'a [f64],
    /// How much each of them counts for the smallest spot; empty where all count alike.
    pub weights: &'a [f64],
    /// Distance of the object before the first vertex, mm; infinite for a far one.
    pub distance_mm: f64,
}

impl FilmUse<'_> {
    /// Returns the lens at the wavelength of paraxial images: the main one of its file, else 550 nm, so that the film stays where it is
    /// whatever wavelengths are looked at; where the lens is not known there, theirs that is nearest to 550 nm.
    ///
    /// # Errors
    /// When the lens is not known there either.
    pub fn reference(&self, lens: &Lens) -> Result<MonoLens, PipelineError> {
        let usual = lens.at(self.main_nm.unwrap_or(REFERENCE_WAVELENGTH_NM));
        Ok(usual.or_else(|_| lens.at(nearest_to_reference_nm(self.wavelengths_nm)))?)
    }
}

/// A film that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmPlace {
    /// Distance behind the last vertex, mm.
    pub distance_mm: f64,
    /// What is there, in a few words.
    pub origin: String,
}

/// What is at a film that is sought where no light comes in along the axis.
pub(crate) const DARK_AXIS: &str = "the paraxial image, since the axis is dark";

/// Rings of the rays by which a film is found.
pub(super) const RINGS: usize = 12;

impl AnalysisFilm {
    /// Returns where the film is.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength, or there is no image to focus on.
    pub fn place(self, lens: &Lens, of: FilmUse<'_>) -> Result<FilmPlace, PipelineError> {
        let reference = of.reference(lens)?;
        let paraxial = |distance_mm| Ok::<f64, PipelineError>(reference.film_distance_mm_for(distance_mm)?);
        let mut origin = self.origin(reference.wavelength_nm());
        let distance_mm = match self {
            Self::OfFile(film_mm) | Self::FilmMm(film_mm) => film_mm,
            Self::FocusMm(distance_mm) => paraxial(distance_mm)?,
            Self::Afocal => IDEAL_MM,
            Self::BestFocus => {
                let from = paraxial(of.distance_mm);
                let lenses = of.wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<Vec<MonoLens>, _>>()?;
                let dioptres = 1e3 / (of.distance_mm + reference.projection_center_z_mm());
                let axis = [ObjectPoint::from_field(&reference, DVec2::ZERO, dioptres)];
                let wavelength_weights = if of.weights.len() == lenses.len() { of.weights } else { &[] };
                let autofocus =
                    Autofocus { wavelength_weights, ..Autofocus::alike(&lenses, &axis, PupilRule::of_rings(RINGS)) };
                let found = from.as_ref().ok().and_then(|&from_mm| autofocus.best_film_mm(from_mm));
                if found.is_none() {
                    DARK_AXIS.clone_into(&mut origin);
                }
                found.map_or(from, |(film_mm, _)| Ok(film_mm))?
            }
        };
        Ok(FilmPlace { distance_mm, origin })
    }

    /// Returns what is at the film, in a few words; paraxial images are at this wavelength, nm.
    fn origin(self, reference_nm: f64) -> String {
        match self {
            Self::OfFile(_) => "the image plane of the lens's file".to_owned(),
            Self::BestFocus => "the smallest spot on the axis".to_owned(),
            Self::FocusMm(distance_mm) if distance_mm.is_infinite() => {
                format!("the paraxial image of a far object at {reference_nm} nm")
            }
            Self::FocusMm(distance_mm) => {
                format!("the paraxial image of an object at {distance_mm} mm at {reference_nm} nm")
            }
            Self::FilmMm(_) => "where it was asked for".to_owned(),
            Self::Afocal => "the focal plane of an ideal lens".to_owned(),
        }
    }
}
