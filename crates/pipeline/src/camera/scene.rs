//! What stands before the camera, as a camera file says it.

use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
};

use dioptric_scene::{Pattern, ReadOptions, Scene, SceneLight, StillLife, Target, TargetLight, read_scene};
use dioptric_spectrum::{Cancel, Illuminant, WavelengthGrid};
use serde::{Deserialize, Serialize};

use super::{check::Checker, world::WorldSpec};
use crate::{PaintingFolder, PipelineError};

/// What stands before the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Where its radiance comes from.
    pub source: SceneSource,
    /// Horizontal field of view from edge to edge, degrees; for files that hold no camera data, for targets, and for the still
    /// life, whose own is 34.
    #[serde(default)]
    pub field_of_view_deg: Option<f64>,
    /// One depth for the whole scene, m; for files that hold no depth, and for targets.
    #[serde(default)]
    pub depth_m: Option<f64>,
    /// The light that the scene is put under: it lights reflectances and targets (D65 if left out), and takes the place of
    /// the light on all others (their own if left out), where that is known.
    #[serde(default)]
    pub illuminant: Option<Illuminant>,
    /// Its illuminance, lux; for a picture, that of a white in it. Left out, 1000 for reflectances, targets and pictures, and
    /// its own for a scene that has one.
    #[serde(default)]
    pub illuminance_lux: Option<f64>,
    /// The light that is on a file of radiance, which does not state it itself: what white balance goes by, and what
    /// `illuminant` takes the place of.
    #[serde(default)]
    pub light: Option<Illuminant>,
    /// Scales the radiance to this mean luminance, cd/m²; nothing is scaled unless this is given.
    #[serde(default)]
    pub mean_luminance_cd_m2: Option<f64>,
}

/// Where a scene's radiance comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum SceneSource {
    /// A spectral EXR, an ENVI header, a folder of band pictures, or an ordinary picture.
    File(PathBuf),
    /// The built-in still life, with objects at several depths.
    StillLife {
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// A flat target that faces the camera; needs a field of view and a depth.
    Target {
        /// What is drawn on it.
        pattern: Pattern,
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// A three-dimensional world, with lights of its own.
    World(WorldSpec),
}

/// The illuminance on what has none of its own, lux.
const USUAL_LUX: f64 = 1000.0;

impl SceneSpec {
    /// A file, with the defaults for all else.
    pub fn of_file(path: PathBuf) -> Self {
        Self {
            source: SceneSource::File(path),
            field_of_view_deg: None,
            depth_m: None,
            illuminant: None,
            illuminance_lux: None,
            light: None,
            mean_luminance_cd_m2: None,
        }
    }

    pub(crate) fn check(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if let Some(angle) = self.field_of_view_deg
            && !(angle > 0.0 && angle < 180.0)
        {
            return checker.wrong("field_of_view_deg", &angle.to_string(), "an angle above 0 and below 180 degrees");
        }
        if let Some(depth) = self.depth_m {
            checker.positive("depth_m", depth)?;
        }
        if let Some(luminance) = self.mean_luminance_cd_m2 {
            checker.positive("mean_luminance_cd_m2", luminance)?;
        }
        if let Some(lux) = self.illuminance_lux {
            checker.positive("illuminance_lux", lux)?;
        }
        for (key, light) in [("illuminant", &self.illuminant), ("light", &self.light)] {
            if let Some(Err(error)) = light.as_ref().map(Illuminant::check) {
                return checker.wrong(key, &error.to_string(), "a light");
            }
        }
        match self.source {
            SceneSource::File(_) => Ok(()),
            SceneSource::World(ref world) => {
                let others = [self.illuminance_lux, self.mean_luminance_cd_m2, self.depth_m];
                if self.illuminant.is_some() || others.iter().any(Option::is_some) {
                    let expected = "field_of_view_deg and light at most: a world has lights and depths of its own";
                    return checker.wrong("scene", "a world under another light or at another depth", expected);
                }
                world.check(checker)
            }
            SceneSource::StillLife { columns, rows } => check_size(checker, columns, rows),
            SceneSource::Target { columns, rows, .. } => {
                check_size(checker, columns, rows)?;
                let missing = |key| checker.wrong(key, "missing", "a number: a target has none of its own");
                match (self.field_of_view_deg, self.depth_m) {
                    (None, _) => missing("field_of_view_deg"),
                    (_, None) => missing("depth_m"),
                    _ => Ok(()),
                }
            }
        }
    }

    /// Returns the scene on the bands wanted, or on its own.
    ///
    /// # Errors
    /// When a file cannot be read, lacks what is needed or holds what cannot be.
    pub fn open(&self, wanted: Option<&WavelengthGrid>) -> Result<Scene, PipelineError> {
        self.open_with(wanted, None, &|_| {}, &Cancel::new())
    }

    /// As [`open`](Self::open); the still life is taken from `paintings` where it is there, and kept there. `progress` gets the part that is done, 0–1, where a scene is painted, which a cancel ends
    /// within milliseconds. Reading a file is one step.
    ///
    /// # Errors
    /// As [`open`](Self::open), and when the work is cancelled.
    pub fn open_with(
        &self,
        wanted: Option<&WavelengthGrid>,
        paintings: Option<&PaintingFolder>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Scene, PipelineError> {
        let own_or = || wanted.cloned().map_or_else(|| WavelengthGrid::uniform(400.0, 700.0, 10.0), Ok);
        let light = self.illuminant.clone().unwrap_or(Illuminant::D65);
        let illuminance_lux = self.illuminance_lux.unwrap_or(USUAL_LUX);
        let mut scene = match &self.source {
            SceneSource::File(path) => {
                let options = ReadOptions {
                    grid: wanted.cloned(),
                    light,
                    illuminance_lux,
                    picture_white_cd_m2: illuminance_lux / PI,
                    depth_m: self.depth_m,
                    horizontal_fov_deg: self.field_of_view_deg,
                    ..ReadOptions::default()
                };
                read_scene(path, &options)?
            }
            SceneSource::World(world) => {
                let reason = format!("{} is no picture but a world, expected to be rendered", world.file.display());
                return Err(PipelineError::Unsuitable { what: "scene", reason });
            }
            SceneSource::StillLife { columns, rows } => {
                let usual = StillLife::new(*columns, *rows);
                let horizontal_fov_deg = self.field_of_view_deg.unwrap_or(usual.horizontal_fov_deg);
                let (life, grid) = (StillLife { horizontal_fov_deg, ..usual }, own_or()?);
                match paintings {
                    Some(folder) => folder.scene(&life, &grid, progress, cancel)?,
                    None => life.scene_with(&grid, progress, cancel)?,
                }
            }
            SceneSource::Target { pattern, columns, rows } => Target {
                pattern: *pattern,
                rows: *rows,
                columns: *columns,
                light: TargetLight::Illuminant(light),
                luminance_cd_m2: illuminance_lux / PI,
                dark: 0.02,
                supersampling: 4,
                horizontal_fov_deg: self.field_of_view_deg.unwrap_or(f64::NAN),
                distance_m: self.depth_m.unwrap_or(f64::NAN),
            }
            .scene(&own_or()?)?,
        };
        self.light_up(&mut scene)?;
        Ok(scene)
    }

    /// Returns a scene that is in no file, with what it leaves open taken from here, on the bands wanted.
    ///
    /// # Errors
    /// When it lacks what is needed, or holds what cannot be.
    pub(crate) fn finish(&self, mut scene: Scene, wanted: Option<&WavelengthGrid>) -> Result<Scene, PipelineError> {
        if let Some(depth_m) = self.depth_m {
            scene = scene.or_flat_depth_m(depth_m)?;
        }
        if let Some(fov_deg) = self.field_of_view_deg {
            scene = scene.or_horizontal_fov_deg(fov_deg)?;
        }
        if let Some(grid) = wanted.filter(|grid| *grid != scene.radiance.grid()) {
            scene = scene.resampled(grid)?;
        }
        scene.validate()?;
        self.light_up(&mut scene)?;
        Ok(scene)
    }

    /// Puts a scene under the light that is asked for, and checks that it is whole.
    fn light_up(&self, scene: &mut Scene) -> Result<(), PipelineError> {
        if let (None, Some(illuminant)) = (&scene.light, &self.light) {
            scene.light = Some(SceneLight { illuminant: illuminant.clone(), illuminance_lux: None });
        }
        if self.illuminant.is_some() || self.illuminance_lux.is_some() {
            scene.relight(self.illuminant.as_ref(), self.illuminance_lux)?;
        }
        scene.require_depth_and_view()?;
        if let Some(wanted_cd_m2) = self.mean_luminance_cd_m2 {
            scene.scale(wanted_cd_m2 / scene.mean_luminance_cd_m2())?;
        }
        Ok(())
    }

    pub(crate) fn resolve_paths(&mut self, folder: &Path) {
        match &mut self.source {
            SceneSource::File(path) => *path = folder.join(&path),
            SceneSource::World(world) => world.file = folder.join(&world.file),
            SceneSource::StillLife { .. } | SceneSource::Target { .. } => {}
        }
    }
}

fn check_size(checker: &Checker<'_>, columns: usize, rows: usize) -> Result<(), PipelineError> {
    checker.count("columns", columns, 1..=65_536)?;
    checker.count("rows", rows, 1..=65_536)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use dioptric_scene::{ExrParts, write_spectral_exr};
    use dioptric_spectrum::{Quantity, SpectralImage};
    use ndarray::Array2;

    use super::*;

    /// A file of gray under 100 lx of D65, which does not say so.
    fn radiance_file(folder: &Path) -> PathBuf {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let white = Illuminant::D65.white_radiance(&grid, 100.0);
        let planes = white.iter().map(|&w| Array2::from_elem((4, 6), 0.18 * w as f32)).collect();
        let image = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
        let path = folder.join("room.exr");
        write_spectral_exr(&path, &image, &ExrParts::default()).unwrap();
        path
    }

    #[test]
    fn only_scenes_of_known_light_are_relit() {
        let folder = tempfile::tempdir().unwrap();
        let of_file = SceneSpec::of_file(radiance_file(folder.path()));
        let bare = SceneSpec { depth_m: Some(2.0), field_of_view_deg: Some(20.0), ..of_file };
        // As it is, it is opened, and what light it is under is not known.
        assert!(bare.open(None).unwrap().light.is_none());
        for asked in [
            SceneSpec { illuminant: Some(Illuminant::A), ..bare.clone() },
            SceneSpec { illuminance_lux: Some(5.0), ..bare.clone() },
        ] {
            let message = asked.open(None).unwrap_err().to_string();
            assert!(message.contains("room.exr") && message.contains("not known"), "{message}");
        }
        // Once its light is stated, it is put under another: the same gray, of the same luminance.
        let stated = SceneSpec { light: Some(Illuminant::D65), illuminant: Some(Illuminant::A), ..bare.clone() };
        let relit = stated.open(None).unwrap();
        let white = Illuminant::A.white_radiance(relit.radiance.grid(), 100.0);
        for (found, white) in relit.radiance.spectrum_at(1, 2).iter().zip(white) {
            // Single precision.
            assert_relative_eq!(*found, 0.18 * white, max_relative = 1e-6);
        }
        assert_eq!(relit.light.unwrap().illuminant, Illuminant::A);
        // Its illuminance is still not known.
        assert!(SceneSpec { illuminance_lux: Some(5.0), ..stated }.open(None).is_err());
    }
}
