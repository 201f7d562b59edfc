//! What is to be imaged: geometry on one side, light on the other.

use dioptric_scene::{PointLight, Scene, View};
use dioptric_spectrum::{Bands, DepthMap, Quantity, SpectrumError, WavelengthGrid};
use ndarray::Array2;

use crate::ForwardError;

/// Radiance, depth and geometry of the samples of a scene.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Spectral radiance.
    pub radiance: &'a dyn Bands,
    /// Axial depth of each sample.
    pub depth: &'a DepthMap,
    /// Directions of the samples.
    pub view: View,
    /// What lies behind the first surface, where that is known; elsewhere it is estimated.
    pub occluded: Option<OccludedLayer<'a>>,
    /// Stars and lamps beside the samples.
    pub points: &'a [PointLight],
}

/// What would be seen if the first surface of a scene were taken away.
#[derive(Clone, Copy)]
pub struct OccludedLayer<'a> {
    /// Spectral radiance, on the bands and samples of the first surface.
    pub radiance: &'a dyn Bands,
    /// Axial depth; no deeper than the first surface where nothing lies behind it.
    pub depth: &'a DepthMap,
}

impl<'a> Source<'a> {
    /// Returns a scene as a source.
    ///
    /// # Errors
    /// When the scene has no depth or no view.
    pub fn of_scene(scene: &'a Scene) -> Result<Self, ForwardError> {
        let depth = scene.depth.as_ref().ok_or_else(|| ForwardError::MissingDepth { scene: scene.name.clone() })?;
        let view = scene.view.ok_or_else(|| ForwardError::MissingView { scene: scene.name.clone() })?;
        let occluded =
            scene.hidden.as_ref().map(|layer| OccludedLayer { radiance: &layer.radiance, depth: &layer.depth });
        Ok(Self { radiance: &scene.radiance, depth, view, occluded, points: &scene.points })
    }

    /// The part that an imaging plan is made from.
    pub fn geometry(&self) -> SceneGeometry<'a> {
        let occluded_depth = self.occluded.map(|layer| layer.depth);
        SceneGeometry { depth: self.depth, view: self.view, occluded_depth, points: self.points }
    }

    /// The part that may change without another plan.
    pub fn light(&self) -> SceneRadiance<'a> {
        SceneRadiance { front: self.radiance, occluded: self.occluded.map(|layer| layer.radiance), points: self.points }
    }
}

/// Where the samples of a scene are.
#[derive(Clone, Copy, Debug)]
pub struct SceneGeometry<'a> {
    /// Axial depth of each sample of the first surface.
    pub depth: &'a DepthMap,
    /// Directions of the samples.
    pub view: View,
    /// Axial depth of what lies behind the first surface, where that is known; no deeper than the first surface
    /// where nothing lies behind it.
    pub occluded_depth: Option<&'a DepthMap>,
    /// Stars and lamps beside the samples.
    pub points: &'a [PointLight],
}

impl SceneGeometry<'_> {
    /// The rows and columns of samples.
    pub fn size(&self) -> (usize, usize) {
        self.depth.z_m().dim()
    }

    pub(crate) fn check(&self) -> Result<(), ForwardError> {
        match self.occluded_depth {
            Some(depth) => check_size("the depth of the hidden layer", depth.z_m().dim(), self.size()),
            None => Ok(()),
        }
    }
}

/// The spectral radiance of a scene's samples, all bands.
#[derive(Clone, Copy)]
pub struct SceneRadiance<'a> {
    /// Of the first surface.
    pub front: &'a dyn Bands,
    /// Of what lies behind it; needed where a plan was made with its depth.
    pub occluded: Option<&'a dyn Bands>,
    /// Stars and lamps beside the samples, those of which the places were planned.
    pub points: &'a [PointLight],
}

impl SceneRadiance<'_> {
    /// Checks that the radiance is that of samples and bands that a plan was made for.
    pub(crate) fn check(&self, size: (usize, usize), grid: &WavelengthGrid) -> Result<(), ForwardError> {
        for (what, bands_of, bands) in [
            ("the radiance", "bands of the radiance", Some(self.front)),
            ("the radiance of the hidden layer", "bands of the hidden layer", self.occluded),
        ] {
            let Some(bands) = bands else { continue };
            check_size(what, bands.size(), size)?;
            if bands.quantity() != Quantity::Radiance {
                return Err(ForwardError::NotRadiance { unit: bands.quantity().unit() });
            }
            let (expected, found) = (grid.len(), bands.grid().len());
            if expected != found {
                return Err(SpectrumError::Shape { what: bands_of, expected, found }.into());
            }
        }
        self.points.iter().try_for_each(|point| point.check(grid.len()))?;
        let planned = grid.centers_nm().iter();
        let differs = |(_, (planned, found)): &(usize, (&f64, &f64))| (*planned - *found).abs() > 1e-3;
        match planned.zip(self.front.grid().centers_nm()).enumerate().find(differs) {
            Some((band, (&planned_nm, &found_nm))) => Err(ForwardError::OtherBand { band, found_nm, planned_nm }),
            None => Ok(()),
        }
    }
}

/// The spectral radiance of a scene's samples in one band, W m⁻² sr⁻¹ nm⁻¹, rows × columns.
#[derive(Clone, Copy, Debug)]
pub struct BandRadiance<'a> {
    /// Of the first surface.
    pub front: &'a Array2<f32>,
    /// Of what lies behind it; needed where a plan was made with its depth.
    pub occluded: Option<&'a Array2<f32>>,
    /// How bright each point is in the band, as [`PointBrightness`](dioptric_scene::PointBrightness) has it.
    pub points: &'a [f32],
}

impl BandRadiance<'_> {
    pub(crate) fn check(&self, size: (usize, usize), needs_occluded: bool) -> Result<(), ForwardError> {
        check_size("the radiance", self.front.dim(), size)?;
        match self.occluded {
            Some(plane) => check_size("the radiance of the hidden layer", plane.dim(), size),
            None if needs_occluded => Err(ForwardError::MissingOccludedRadiance),
            None => Ok(()),
        }
    }
}

fn check_size(
    what: &'static str,
    (found_rows, found_columns): (usize, usize),
    (rows, columns): (usize, usize),
) -> Result<(), ForwardError> {
    if (found_rows, found_columns) == (rows, columns) {
        return Ok(());
    }
    Err(ForwardError::Size { what, found_rows, found_columns, rows, columns })
}
