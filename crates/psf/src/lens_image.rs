//! What imaging a scene asks of a lens: what each point of the film sees.

use std::sync::Arc;

use dioptric_optics::EdgePiece;
use glam::DVec2;

use crate::{FilmMap, Kernel, PsfError};

/// A point of the film that looks at one depth, at one wavelength, on pixels of a pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmQuery {
    /// The point of the film, mm from its middle, picture frame (x right, y up).
    pub place_mm: DVec2,
    /// Depth, dioptres: one over the axial distance from the projection centre in metres.
    pub dioptres: f64,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Side of a pixel of the kernel, µm.
    pub pitch_um: f64,
}

/// The edges of a pupil that is not round.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilEdges {
    /// In the stop.
    pub pieces: Vec<EdgePiece>,
    /// Diameter of the circle of as much area, mm.
    pub diameter_mm: f64,
}

/// The image that a lens forms, described from the film: where each point looks, how much light reaches it, and what it gathers.
///
/// The irradiance at a point x of the film is `I(x) Σ_s L(s) h(x − s)`: L is the radiance seen by the chief ray of the film point s
/// (`FilmMap::field_tan`), I the irradiance per radiance of a uniform scene (`FilmMap::irradiance_sr`), h the kernel, of sum 1.
pub trait LensImage: Sync {
    /// Whether film points that mirror each other, about the axes or their diagonals, have kernels that do.
    fn is_symmetric(&self) -> bool;

    /// The wavelengths, nm, at which kernels are known, where they are interpolated linearly between these; none where they are known at all.
    fn known_wavelengths_nm(&self) -> &[f64] {
        &[]
    }

    /// Returns where film points up to `reach_mm` from the middle of the film look, and how much light reaches them. Beyond the
    /// light of the lens the directions go on smoothly.
    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap>;

    /// Returns the normalised point spread function that a film point sees: sum 1, about that point. A ray of the point that meets the
    /// scene where the chief ray of film point s does is at x − s. In darkness it is [`Kernel::identity`].
    fn kernel(&self, query: FilmQuery) -> Kernel;

    /// Returns the signed radius of the blur of defocus, mm on the film: above 0 for objects nearer than the focus; of an even disc it
    /// holds 95 % of the light.
    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64;

    /// Returns the radius of what a point becomes, mm: of its blur, and of what aberrations and diffraction leave of it in focus.
    fn spread_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(place_mm, dioptres, wavelength_nm).abs()
    }

    /// Returns the edges that diffraction bends light about, along the axes of the picture; `None` where they are one circle, or nothing is bent.
    fn pupil_edges(&self) -> Option<PupilEdges>;

    /// Returns the images through so many parts of the pupil: their irradiances add up to that of the whole, and each has kernels of sum 1 about the
    /// same film points (`film_map` has the same directions).
    ///
    /// # Errors
    /// When the pupil of the lens cannot be divided, as it is here unless another way is given.
    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let _ = n_parts;
        Err(PsfError::Undividable { reason: "nothing is known of its parts" })
    }
}
