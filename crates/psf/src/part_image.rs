//! The image of a lens through a part of its pupil.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec2;

use crate::{
    Diffraction, FilmMap, FilmQuery, Kernel, LensImage, PsfError, PupilEdges, pupil_division::PupilDivision,
    survey::Survey, traced::Shared,
};

/// The image that a lens forms through a part of its pupil: a view from that part, blurred by what is left of its width.
///
/// Points of the film look in the same directions as through the whole pupil; the irradiances of all parts add up. Blur radii are those
/// of the whole, so that all parts are imaged in the same layers of depth.
#[derive(Debug)]
pub(crate) struct PartImage {
    shared: Arc<Shared>,
    division: Arc<PupilDivision>,
    part: usize,
    /// By the surveys that they were made from.
    maps: Mutex<Vec<(Arc<Survey>, Arc<FilmMap>)>>,
}

impl PartImage {
    /// Returns the images through the parts of the pupil of a lens.
    ///
    /// # Errors
    /// For diffraction integrals, which parts of a pupil do not add up to.
    pub(crate) fn all(shared: &Arc<Shared>, division: PupilDivision) -> Result<Vec<Self>, PsfError> {
        if shared.settings().diffraction == Diffraction::Wave {
            return Err(PsfError::Undividable { reason: "its waves interfere: take HURB or no diffraction" });
        }
        let division = Arc::new(division);
        let image =
            |part: usize| Self { shared: shared.clone(), division: division.clone(), part, maps: Mutex::default() };
        Ok((0..division.n_parts()).map(image).collect())
    }
}

impl LensImage for PartImage {
    fn is_symmetric(&self) -> bool {
        false
    }

    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        let survey = self.shared.survey_of_film(&self.shared.color(wavelength_nm), reach_mm);
        let mut maps = self.maps.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, map)) = maps.iter().find(|(known, _)| Arc::ptr_eq(known, &survey)) {
            return map.clone();
        }
        let map = Arc::new(survey.part_map(self.shared.settings().mesh(), &self.division, self.part));
        maps.push((survey, map.clone()));
        map
    }

    fn kernel(&self, query: FilmQuery) -> Kernel {
        self.shared.kernel(query, Some((&self.division, self.part)))
    }

    /// Those of a part are not those of the whole.
    fn pupil_edges(&self) -> Option<PupilEdges> {
        None
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.shared.blur_radius_mm(place_mm, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.shared.spread_mm(place_mm, dioptres, wavelength_nm)
    }
}
