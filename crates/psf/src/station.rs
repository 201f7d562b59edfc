//! A point of the film, and what it sees through a lens.

use std::sync::Arc;

use glam::DVec2;

use crate::{
    bundle::{Bundle, FilmPointJob},
    decenter::Decenter,
    pupil::Outline,
    symmetry::Symmetry,
};

/// A lens, centered, whose film is surveyed at one wavelength.
#[derive(Clone, Copy)]
pub(crate) struct SurveyedLens<'a> {
    /// Of any point of the film.
    pub(crate) job: FilmPointJob<'a>,
    /// The same with a circle of as much area in place of the opening of blades, where they are all that keeps it from having an axis.
    pub(crate) round_job: Option<FilmPointJob<'a>>,
    pub(crate) symmetry: Symmetry,
    /// How it stands aside from where it is surveyed.
    pub(crate) decenter: Decenter,
    pub(crate) focus_dioptres: f64,
}

impl SurveyedLens<'_> {
    /// Looks out from a point of the film, seeded by the outline of another.
    pub(crate) fn station(&self, place_mm: DVec2, seed: Option<&Outline>) -> Station {
        let bundle = FilmPointJob { place_mm, ..self.job }.trace(seed, false);
        Station::new(place_mm, bundle, self.focus_dioptres)
    }
}

/// A point of the film and what it sees.
#[derive(Clone, Debug)]
pub(crate) struct Station {
    pub(crate) place_mm: DVec2,
    /// Tangents of half the angle of the chief ray.
    pub(crate) half_tan: Option<DVec2>,
    pub(crate) irradiance_sr: f64,
    /// None in darkness, and where a grid foresaw what is seen.
    pub(crate) bundle: Option<Arc<Bundle>>,
}

impl Station {
    /// A point whose bundle was traced; none in darkness.
    pub(crate) fn new(place_mm: DVec2, bundle: Option<Bundle>, focus_dioptres: f64) -> Self {
        let half_tan = bundle.as_ref().and_then(|bundle| {
            let chief = bundle.chief(focus_dioptres);
            let half_tan = chief.truncate() / (chief.z + chief.length());
            half_tan.is_finite().then_some(half_tan)
        });
        let irradiance_sr = bundle.as_ref().map_or(0.0, |bundle| bundle.irradiance_sr);
        Self { place_mm, half_tan, irradiance_sr, bundle: bundle.map(Arc::new) }
    }

    /// Returns it without the rays of its bundle, which take most of the memory: its outline and the light of cells stay.
    #[must_use]
    pub(crate) fn without_rays(self) -> Self {
        let bundle = self.bundle.map(|bundle| Arc::new(Arc::unwrap_or_clone(bundle).without_rays()));
        Self { bundle, ..self }
    }

    pub(crate) fn outline(&self) -> Option<&Outline> {
        self.bundle.as_ref().map(|bundle| &bundle.outline)
    }
}
