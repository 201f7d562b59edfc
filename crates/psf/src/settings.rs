//! How a lens stands before its film, and how its image is computed.

use dioptric_diffraction::Hurb;
use serde::{Deserialize, Serialize};

use crate::{PsfError, mesh::Mesh};

/// How diffraction is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Diffraction {
    /// Not at all: geometric optics.
    None,
    /// Heisenberg uncertainty ray bending (HURB) at the stop.
    Hurb {
        /// The factor γ, above 0: 1 as in the paper and in Freniere's, √2 in `Scene3D` since 2015.
        gamma: f64,
    },
    /// HURB with constants fitted to Airy's pattern: better in focus, not in defocus.
    HurbCalibrated,
    /// The diffraction integral while the blur is small enough for it, HURB (γ = 1) beyond, blended over an octave:
    /// see [`ModelUse::wave_fraction`](crate::ModelUse::wave_fraction).
    Wave,
}

impl Default for Diffraction {
    /// HURB as in the paper.
    fn default() -> Self {
        Self::Hurb { gamma: 1.0 }
    }
}

impl Diffraction {
    /// Checks that γ is a finite number above 0.
    ///
    /// # Errors
    /// When it is not.
    pub fn check(self) -> Result<(), PsfError> {
        match self {
            Self::Hurb { gamma } if !(gamma.is_finite() && gamma > 0.0) => {
                Err(PsfError::Setting { key: "gamma", found: gamma, expected: "a finite number above 0" })
            }
            _ => Ok(()),
        }
    }

    /// Returns the constants of HURB, or `None` without diffraction; with waves, those of what takes their place where the
    /// blur is large.
    pub fn hurb(self) -> Option<Hurb> {
        match self {
            Self::None => None,
            Self::Hurb { gamma } => Some(Hurb::with_gamma(gamma)),
            Self::Wave => Some(Hurb::PAPER),
            Self::HurbCalibrated => Some(Hurb::CALIBRATED),
        }
    }
}

/// How a lens stands before its film, and how finely its pupil is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSettings {
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// The wavelength whose paraxial entrance pupil fields and depths count from, nm.
    pub reference_wavelength_nm: f64,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
    /// Rings of the mesh in the pupil, at least 2: 12 give the outlines of blurs to about 1 %.
    pub n_rings: usize,
    /// Nodes on a ring, at least 8: 48 go with 12 rings.
    pub n_azimuths: usize,
}

impl ImageSettings {
    /// Returns the settings of a film so far behind the last vertex, mm: fields and depths count from the entrance pupil at 550 nm,
    /// and 12 × 48 rays draw a blur.
    pub fn new(film_distance_mm: f64, diffraction: Diffraction) -> Self {
        Self { film_distance_mm, reference_wavelength_nm: 550.0, diffraction, n_rings: 12, n_azimuths: 48 }
    }

    /// Returns the settings with a coarser mesh, for previews: half the rays, outlines of blurs to about 3 %.
    #[must_use]
    pub fn for_preview(self) -> Self {
        Self { n_rings: 8, n_azimuths: 32, ..self }
    }

    pub(crate) fn mesh(&self) -> Mesh {
        Mesh { n_rings: self.n_rings, n_azimuths: self.n_azimuths }
    }

    /// Checks that the numbers make sense.
    pub(crate) fn check(&self) -> Result<(), PsfError> {
        let setting = |key, found, expected| Err(PsfError::Setting { key, found, expected });
        if !(self.film_distance_mm.is_finite() && self.film_distance_mm > 0.0) {
            return setting("film_distance_mm", self.film_distance_mm, "a finite distance above 0");
        }
        if self.n_rings < 2 {
            return setting("n_rings", self.n_rings as f64, "2 or more");
        }
        if self.n_azimuths < 8 {
            return setting("n_azimuths", self.n_azimuths as f64, "8 or more");
        }
        self.diffraction.check()
    }
}
