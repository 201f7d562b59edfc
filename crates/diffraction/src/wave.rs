//! Point spread functions of wave optics, from traced rays.
//!
//! Every node of the true, vignetted pupil sends a wave to the film from the sphere about the image through the middle of the
//! exit pupil, with the phase that its optical path gives it (the angular eikonal) and the amplitude of the energy that it
//! carries per range of directions. On the film the waves are as good as plane. They are
//! summed at the Gauss–Legendre points of each pixel, and their square is integrated over the pixel. Nothing is resampled, so any
//! pitch, origin, field, vignetting and image medium will do.
//!
//! The derivation is in `docs/wave.md`. What comes out is normalised by the pupil's energy, never by the window's: the sum is the share of the light that
//! the window holds. Polarisation is left out.

mod axis;
mod cells;
pub(crate) mod cis;
mod grid;
mod gridded;
mod map;
mod nodes;
mod otf;
mod pixel_mean;
mod polychromatic;
mod propagation;
mod smooth;
mod strehl;
mod transform;

use dioptric_optics::{MonoLens, ObjectPoint};
use glam::DVec2;
use ndarray::{Array2, s};

use crate::DiffractionError;
use axis::SampleAxis;
pub(crate) use cells::PupilCells;
pub use grid::{PhaseRange, PupilGrid};
use gridded::Grid;
pub use map::{PupilFunctionFit, PupilOutline};
pub use nodes::PupilSamples;
pub use otf::{Encircled, LineSpread, TransferFunction, TransferMethod, TransferQuality, TransferSpokes};
pub use polychromatic::polychromatic_psf;
pub(crate) use propagation::FilmRays;
pub use propagation::Propagation;
pub use strehl::Peak;

/// Where the middle of a window lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WindowCenter {
    /// On the centroid of the light.
    Centroid,
    /// So far from the centroid, mm along the film's own x and y.
    FromCentroid(DVec2),
    /// At this place of the film, mm along its own x and y.
    At(DVec2),
}

impl WindowCenter {
    /// Returns the place on the film, mm along its own x and y.
    fn on_film_mm(self, centroid_mm: impl FnOnce() -> DVec2) -> DVec2 {
        match self {
            Self::Centroid => centroid_mm(),
            Self::FromCentroid(aside_mm) => centroid_mm() + aside_mm,
            Self::At(on_film_mm) => on_film_mm,
        }
    }
}

/// A window of square pixels on the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveWindow {
    /// Side of a pixel, µm.
    pub pitch_um: f64,
    /// Rows of pixels.
    pub rows: usize,
    /// Columns of pixels.
    pub columns: usize,
    /// Where its middle lies: the middle of the middle pixel where the numbers are odd.
    pub center: WindowCenter,
}

/// How finely a point spread function is computed. The default follows the node rule.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WaveQuality {
    /// The nodes of the pupil; `None` takes as many as the rule asks for, and at least 12 × 48.
    pub nodes: Option<PupilGrid>,
    /// Gauss–Legendre points along each side of a pixel; `None` takes ⌈2 p / λN⌉ + 1. With 1 the irradiance at the
    /// middle of the pixel stands for all of it.
    pub points_per_pixel: Option<usize>,
}

/// A point spread function on pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct WavePsf {
    /// The share of the point's transmitted energy on each pixel, in the picture frame: the film turned by 180°, row
    /// 0 at the top, so that columns run towards −x and rows towards +y of the film.
    pub samples: Array2<f64>,
    /// Side of a pixel, µm.
    pub pitch_um: f64,
    /// The place on the film in the middle of the window, mm along its own x and y.
    pub center_mm: DVec2,
    /// The centroid of all the light, mm along the film's own x and y; of the light outside the window too.
    pub centroid_mm: DVec2,
    /// The share of the transmitted energy that the window holds: the sum of the samples.
    pub captured: f64,
    /// Nodes in the pupil.
    pub n_nodes: usize,
    /// The range of phases over the pupil's radius, radians.
    pub bandwidth: f64,
    /// Points along each side of a pixel; many waves are integrated another way, and as well as by these or better.
    pub points_per_pixel: usize,
}

impl WavePsf {
    /// Returns the samples in the film's own frame: rows ascend with y, columns with x.
    pub fn in_film_frame(&self) -> Array2<f64> {
        self.samples.slice(s![.., ..;-1]).to_owned()
    }

    /// Returns the place on the film in the middle of a pixel, mm along its own x and y.
    pub fn pixel_mm(&self, row: usize, column: usize) -> DVec2 {
        let from_middle = |i: usize, n: usize| i as f64 - 0.5 * (n as f64 - 1.0);
        let (rows, columns) = self.samples.dim();
        let offset = DVec2::new(-from_middle(column, columns), from_middle(row, rows));
        self.center_mm + offset * (self.pitch_um * 1e-3)
    }
}

/// The largest range of phases that is accepted: a hundred and fifty thousand nodes.
const LARGEST_BANDWIDTH: f64 = 1000.0;

/// Returns the point spread function of an object point on a window of the film, `film_distance_mm` behind the last vertex.
///
/// # Errors
/// When no light gets through, the window makes no sense, more nodes are needed than are asked for, or the blur and
/// window are so large that they need more than a wave sum can have.
pub fn wave_psf(
    lens: &MonoLens,
    point: &ObjectPoint,
    film_distance_mm: f64,
    window: &WaveWindow,
    quality: WaveQuality,
) -> Result<WavePsf, DiffractionError> {
    pupil_samples(lens, point, film_distance_mm, window, quality)?.psf(window, quality.points_per_pixel)
}

/// Returns the nodes that [`wave_psf`] sums: as many as `quality` has, or the window needs.
///
/// # Errors
/// Those of [`wave_psf`].
pub fn pupil_samples(
    lens: &MonoLens,
    point: &ObjectPoint,
    film_distance_mm: f64,
    window: &WaveWindow,
    quality: WaveQuality,
) -> Result<PupilSamples, DiffractionError> {
    let reference_mm = match window.center {
        WindowCenter::Centroid | WindowCenter::FromCentroid(_) => None,
        WindowCenter::At(on_film_mm) => Some(on_film_mm),
    };
    let trace = |grid| PupilSamples::trace(lens, point, film_distance_mm, grid, reference_mm);
    let extent_mm = window.check()?;
    if let Some(grid) = quality.nodes {
        let nodes = trace(grid)?;
        nodes.check(extent_mm)?;
        return Ok(nodes);
    }
    let mut nodes = trace(PupilGrid::STANDARD)?;
    while let Some(grid) = nodes.finer_grid(extent_mm, LARGEST_BANDWIDTH)? {
        nodes = trace(grid)?;
    }
    Ok(nodes)
}

impl WaveWindow {
    /// Checks the numbers, and returns the distance to the farthest corner, mm, from the middle or, where that is stated from the centroid, from there.
    fn check(&self) -> Result<f64, DiffractionError> {
        let setting = |what, found, expected| Err(DiffractionError::Setting { what, found, expected });
        if !(self.pitch_um > 0.0 && self.pitch_um.is_finite()) {
            return setting("the pixel pitch in µm", self.pitch_um, "a positive number");
        }
        let n = self.rows.min(self.columns);
        if n == 0 {
            return setting("the number of rows or columns of a window", 0.0, "at least 1");
        }
        let (rows, columns) = (self.rows as f64, self.columns as f64);
        let aside_mm = match self.center {
            WindowCenter::FromCentroid(aside_mm) => aside_mm.length(),
            WindowCenter::Centroid | WindowCenter::At(_) => 0.0,
        };
        Ok(0.5e-3 * self.pitch_um * rows.hypot(columns) + aside_mm)
    }
}

impl PupilSamples {
    /// Returns the grid that is to be tried instead of this one for places up to `extent_mm` from the reference, or `None`
    /// if this one does; refused beyond a range of phases.
    fn finer_grid(&self, extent_mm: f64, limit: f64) -> Result<Option<PupilGrid>, DiffractionError> {
        let range = self.phase_range(extent_mm);
        if self.grid.covers(PupilGrid::needed(range)) {
            return Ok(None);
        }
        let bandwidth = range.total();
        if bandwidth > limit {
            return Err(DiffractionError::TooBlurred { bandwidth, limit });
        }
        // More nodes reach nearer to the edge, and may find that still more are needed: hence the hundredth to spare.
        let needed = PupilGrid::needed(range.scaled(1.01));
        Ok(Some(needed.max(self.grid)))
    }

    /// Returns the point spread function on a window, with this many points along each side of a pixel (`None`:
    /// ⌈2 p / λN⌉ + 1).
    ///
    /// # Errors
    /// When the window makes no sense or needs more nodes than there are.
    pub fn psf(&self, window: &WaveWindow, points_per_pixel: Option<usize>) -> Result<WavePsf, DiffractionError> {
        let centroid_mm = self.centroid_mm();
        let center_mm = window.center.on_film_mm(|| centroid_mm);
        let window = WaveWindow { center: WindowCenter::At(center_mm), ..*window };
        // Phases range as far as places lie from the centroid, which the rule adds to those from the reference.
        let reach_mm = window.check()? + center_mm.distance(centroid_mm);
        let bandwidth = self.check(reach_mm - self.reference_mm.distance(centroid_mm))?;
        self.psf_about(center_mm, &window, points_per_pixel, bandwidth)
    }

    /// Returns the same about a place, be the nodes too few for some places of the window or not; B is that of those that count.
    fn psf_about(
        &self,
        center_mm: DVec2,
        window: &WaveWindow,
        points_per_pixel: Option<usize>,
        bandwidth: f64,
    ) -> Result<WavePsf, DiffractionError> {
        let from_reference_mm = center_mm - self.reference_mm;
        let (pitch_mm, unit_mm) = (window.pitch_um * 1e-3, self.airy_unit_mm());
        let is_rule = points_per_pixel.is_none();
        let points_per_pixel = match points_per_pixel {
            Some(0) => {
                let (what, expected) = ("the number of points along a pixel", "at least 1");
                return Err(DiffractionError::Setting { what, found: 0.0, expected });
            }
            Some(n) => n,
            // A hundredth to spare, so that a pitch of just λN/2 is not pushed over by rounding.
            None => (2.0 * pitch_mm / unit_mm - 0.01).ceil().max(1.0) as usize + 1,
        };
        let grid = Grid::new(window.rows, window.columns, pitch_mm, unit_mm);
        let mean = if is_rule && grid.is_cheaper(self.len(), points_per_pixel) {
            gridded::mean_square(|waves| self.fill_plane_waves(waves, from_reference_mm + grid.origin_mm()), grid)
        } else {
            let axis = |n_pixels| SampleAxis::new(n_pixels, pitch_mm, points_per_pixel);
            transform::mean_square(&self.plane_waves(from_reference_mm), &axis(window.columns), &axis(window.rows))
        };
        // In a film's rows y ascends, as it does down a picture; its x ascends to the picture's left.
        let samples = mean.slice(s![.., ..;-1]).mapv(|per_mm2| per_mm2 * pitch_mm * pitch_mm);
        Ok(WavePsf {
            captured: samples.sum(),
            samples,
            pitch_um: window.pitch_um,
            center_mm,
            centroid_mm: self.centroid_mm(),
            n_nodes: self.len(),
            bandwidth,
            points_per_pixel,
        })
    }
}
