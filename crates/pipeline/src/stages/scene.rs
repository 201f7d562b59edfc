//! What stands before the camera, at the resolution and on the bands that a quality asks for.

use std::path::Path;

use dioptric_scene::{PointLight, PointTable, Scene, SceneLight};
use dioptric_spectrum::WavelengthGrid;
use serde::{Deserialize, Serialize};

use super::{
    Watch,
    canvas::Viewing,
    lens::ResolvedLens,
    painting::Paintings,
    spec::{GeometryInputs, SceneInputs},
};
use crate::{PipelineError, Quality, SceneSource, SceneSpec, camera::bands_or_own};

/// A scene in brief: what the stages after the imaging need of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSummary {
    /// Where it came from.
    pub name: String,
    /// Columns of samples.
    pub columns: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Nearest depth, m.
    pub near_m: f64,
    /// Farthest depth, m.
    pub far_m: f64,
    /// Mean luminance, cd/m².
    pub mean_luminance_cd_m2: f64,
    /// The light on it, where that is known.
    pub light: Option<SceneLight>,
    /// Centers of its bands, nm.
    pub wavelengths_nm: Vec<f64>,
    /// The tangent between two samples, where it is a picture of samples.
    #[serde(default)]
    pub sample_tangent: Option<f64>,
    /// Samples of its source that are one of it, each way.
    #[serde(default = "one")]
    pub binning: usize,
    /// What was done to its samples to make it, a sentence each: depths filled, bands resampled.
    #[serde(default)]
    pub notes: Vec<String>,
}

fn one() -> usize {
    1
}

impl SceneSummary {
    pub(super) fn of(ResolvedScene { scene, binning }: &ResolvedScene) -> Result<Self, PipelineError> {
        let (near_m, far_m) = scene.require_depth()?.range_m();
        Ok(Self {
            name: scene.name.clone(),
            columns: scene.columns(),
            rows: scene.rows(),
            near_m,
            far_m,
            mean_luminance_cd_m2: scene.mean_luminance_cd_m2(),
            light: scene.light.clone(),
            wavelengths_nm: scene.radiance.grid().centers_nm().to_vec(),
            sample_tangent: scene.view.map(|view| 1.0 / view.focal_px),
            binning: *binning,
            notes: scene.notes.clone(),
        })
    }

    /// Returns that of the scene under light that is so many times as strong.
    pub(super) fn brightened(&self, factor: f64) -> Self {
        let mut brighter = self.clone();
        brighter.mean_luminance_cd_m2 *= factor;
        if let Some(lux) = brighter.light.as_mut().and_then(|light| light.illuminance_lux.as_mut()) {
            *lux *= factor;
        }
        let note = format!(
            "its light is multiplied by {factor:.4e}, to {:.4} cd/m² on average, for the mean illuminance asked for on the film",
            brighter.mean_luminance_cd_m2
        );
        brighter.notes.push(note);
        brighter
    }

    /// The bands.
    ///
    /// # Errors
    /// When a summary that was read from a file has wavelengths that are no bands.
    pub fn grid(&self) -> Result<WavelengthGrid, PipelineError> {
        Ok(WavelengthGrid::new(self.wavelengths_nm.clone())?)
    }
}

/// A scene as it is imaged.
#[derive(Clone, Debug)]
pub struct ResolvedScene {
    /// The scene.
    pub scene: Scene,
    /// Samples of the source that are one of the scene, each way.
    pub binning: usize,
}

/// Samples of a large picture for a pixel of the film, each way, at least: beyond what optics resolve within a pixel.
const SAMPLES_PER_PIXEL: f64 = 8.0;

/// Returns how far apart samples may be that pixels behind a lens see, as the tangent between them; `None` of a lens without a focal length.
pub(super) fn finest_tangent(lens: &ResolvedLens, pitch_um: f64) -> Option<f64> {
    let tangent = 1e-3 * pitch_um / (SAMPLES_PER_PIXEL * lens.reference.first_order().efl_mm.abs());
    Some(tangent).filter(|tangent| *tangent > 0.0 && tangent.is_finite())
}

/// Reads or makes the scene.
///
/// A full scene has the samples and bands of its source. Of a lower quality a computed scene is made with fewer of both,
/// and one from a file is averaged over blocks of samples and over wider bands; a depth is that of the middle of its block.
/// A flat scene by its size is seen from an entrance pupil `pupil_z_mm` behind the first vertex.
pub(super) fn open(
    inputs: &SceneInputs,
    pupil_z_mm: Option<f64>,
    finest: Option<f64>,
    paintings: Paintings<'_>,
    watch: &Watch<'_>,
) -> Result<ResolvedScene, PipelineError> {
    let GeometryInputs { source, wavelengths, quality, .. } = &inputs.geometry;
    let viewing = inputs.geometry.viewing();
    let read = |scene, wanted| read(scene, wanted, finest, viewing, paintings, watch);
    let wanted = wavelengths.grid()?;
    let whole = inputs.choice();
    let whole = match pupil_z_mm {
        Some(pupil_z_mm) => whole.seen_from(pupil_z_mm)?,
        None => whole,
    };
    let choice = |source| SceneSpec { source, ..whole.clone() };
    if let Some(given) = inputs.geometry.given.as_deref() {
        let whole = whole.finish(given.clone(), wanted.as_ref())?;
        let bands = quality.bands_of(whole.radiance.grid())?;
        let binning = quality.scene_binning(whole.columns());
        let scene = if bands == *whole.radiance.grid() { whole } else { whole.resampled(&bands)? };
        return Ok(ResolvedScene { scene: scene.binned(binning)?, binning });
    }
    let fewer = |n: usize, binning: usize| (n / binning).max(1);
    let computed = match source {
        SceneSource::File(_) | SceneSource::World(_) => None,
        // Fewer samples would make its squares and lines larger.
        SceneSource::Target { pattern, .. } if pattern.counts_samples() => None,
        SceneSource::StillLife { columns, rows } => {
            let binning = quality.scene_binning(*columns);
            let (columns, rows) = (fewer(*columns, binning), fewer(*rows, binning));
            Some((SceneSource::StillLife { columns, rows }, binning))
        }
        SceneSource::Target { pattern, columns, rows } => {
            let binning = quality.scene_binning(*columns);
            let (columns, rows) = (fewer(*columns, binning), fewer(*rows, binning));
            Some((SceneSource::Target { pattern: pattern.clone(), columns, rows }, binning))
        }
    };
    match computed {
        _ if *quality == Quality::Full => {
            Ok(ResolvedScene { scene: read(choice(source.clone()), wanted)?, binning: 1 })
        }
        Some((thinned, binning)) => {
            let bands = bands_or_own(wanted.as_ref())?;
            Ok(ResolvedScene { scene: read(choice(thinned), Some(quality.bands_of(&bands)?))?, binning })
        }
        None => {
            let whole = read(choice(source.clone()), wanted)?;
            let bands = quality.bands_of(whole.radiance.grid())?;
            let binning = quality.scene_binning(whole.columns());
            watch.run(move || Ok(ResolvedScene { scene: whole.resampled(&bands)?.binned(binning)?, binning }))
        }
    }
}

fn read(
    scene: SceneSpec,
    wanted: Option<WavelengthGrid>,
    finest: Option<f64>,
    viewing: Viewing,
    paintings: Paintings<'_>,
    watch: &Watch<'_>,
) -> Result<Scene, PipelineError> {
    match scene.source {
        SceneSource::StillLife { columns, rows } => {
            let (life, grid) = (scene.still_life(columns, rows), bands_or_own(wanted.as_ref())?);
            let painting = paintings.scene(&life, &grid, viewing, watch)?;
            watch.run(move || scene.open_with(Some(&grid), None, |_, _| Ok(painting)))
        }
        SceneSource::File(_) | SceneSource::Target { .. } | SceneSource::World(_) => {
            watch.run(move || scene.open_with(wanted.as_ref(), finest, |_, _| unreachable!("it is no still life")))
        }
    }
}

/// Puts the points of a table beside a scene.
pub(super) fn put_points(scene: &mut Scene, path: &Path) -> Result<(), PipelineError> {
    let table = PointTable::read(path)?;
    scene.points = table.on(scene.radiance.grid())?;
    let is_dark = |point: &&PointLight| point.light.by_band().iter().all(|value| *value == 0.0);
    let n_dark = scene.points.iter().filter(is_dark).count();
    let dark = if n_dark > 0 { format!(", {n_dark} of them without light in these bands") } else { String::new() };
    let points = if table.len() == 1 { "point" } else { "points" };
    scene.notes.push(format!("{} {points} of {}{dark}", table.len(), path.display()));
    Ok(())
}
