//! What stands before the camera, as a camera file says it.

use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
};

use dioptric_scene::{Pattern, ReadOptions, Scene, StillLife, Target, TargetLight, read_scene};
use dioptric_spectrum::{Illuminant, WavelengthGrid};
use serde::{Deserialize, Serialize};

use super::check::Checker;
use crate::PipelineError;

/// What stands before the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneChoice {
    /// Where its radiance comes from.
    pub source: SceneSource,
    /// Horizontal field of view from edge to edge, degrees; for files that hold no camera data, and for targets.
    #[serde(default)]
    pub field_of_view_deg: Option<f64>,
    /// One depth for the whole scene, m; for files that hold no depth, and for targets.
    #[serde(default)]
    pub depth_m: Option<f64>,
    /// The light on the scene: it lights reflectances and targets (D65 if left out), and is what white balance goes by.
    #[serde(default)]
    pub illuminant: Option<Illuminant>,
    /// Its illuminance, lux; for a picture, that of a white in it.
    #[serde(default = "thousand")]
    pub illuminance_lux: f64,
    /// Scales the radiance to this mean luminance, cd/m²; nothing is scaled unless this is given.
    #[serde(default)]
    pub mean_luminance_cd_m2: Option<f64>,
}

/// Where a scene's radiance comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}

fn thousand() -> f64 {
    1000.0
}

impl SceneChoice {
    /// A file, with the defaults for all else.
    pub fn of_file(path: PathBuf) -> Self {
        Self {
            source: SceneSource::File(path),
            field_of_view_deg: None,
            depth_m: None,
            illuminant: None,
            illuminance_lux: thousand(),
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
        checker.positive("illuminance_lux", self.illuminance_lux)?;
        match self.source {
            SceneSource::File(_) => Ok(()),
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
        let own_or = || wanted.cloned().map_or_else(|| WavelengthGrid::uniform(400.0, 700.0, 10.0), Ok);
        let light = self.illuminant.unwrap_or(Illuminant::D65);
        let mut scene = match &self.source {
            SceneSource::File(path) => {
                let options = ReadOptions {
                    grid: wanted.cloned(),
                    light,
                    illuminance_lux: self.illuminance_lux,
                    picture_white_cd_m2: self.illuminance_lux / PI,
                    depth_m: self.depth_m,
                    horizontal_fov_deg: self.field_of_view_deg,
                    ..ReadOptions::default()
                };
                read_scene(path, &options)?
            }
            SceneSource::StillLife { columns, rows } => StillLife::new(*columns, *rows).scene(&own_or()?)?,
            SceneSource::Target { pattern, columns, rows } => Target {
                pattern: *pattern,
                rows: *rows,
                columns: *columns,
                light: TargetLight::Illuminant(light),
                luminance_cd_m2: self.illuminance_lux / PI,
                dark: 0.02,
                supersampling: 4,
                horizontal_fov_deg: self.field_of_view_deg.unwrap_or(f64::NAN),
                distance_m: self.depth_m.unwrap_or(f64::NAN),
            }
            .scene(&own_or()?)?,
        };
        scene.light = self.illuminant.or(scene.light);
        scene.require_depth()?;
        scene.require_view()?;
        if let Some(wanted_cd_m2) = self.mean_luminance_cd_m2 {
            scene.scale(wanted_cd_m2 / scene.mean_luminance_cd_m2())?;
        }
        Ok(scene)
    }

    pub(crate) fn resolve_paths(&mut self, folder: &Path) {
        if let SceneSource::File(path) = &mut self.source {
            *path = folder.join(&path);
        }
    }
}

fn check_size(checker: &Checker<'_>, columns: usize, rows: usize) -> Result<(), PipelineError> {
    checker.count("columns", columns, 1..=65_536)?;
    checker.count("rows", rows, 1..=65_536)
}
