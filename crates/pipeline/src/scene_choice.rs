//! What stands before the camera, as a camera file says it.

use std::path::{Path, PathBuf};

use dioptric_spectrum::Illuminant;
use serde::{Deserialize, Serialize};

use crate::{PipelineError, check::Checker};

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
    /// The light on a scene that holds reflectances.
    #[serde(default = "noon")]
    pub illuminant: Illuminant,
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
    /// A checkerboard.
    Checkerboard {
        /// Samples along a side of the square picture.
        samples: usize,
        /// Samples along a side of a check.
        check_samples: usize,
    },
    /// A bright half plane with a slanted edge.
    SlantedBar {
        /// Samples along a side of the square picture.
        samples: usize,
        /// Columns the edge moves a row.
        slope: f64,
    },
    /// Bright lines through the centre.
    RadialLines {
        /// Samples along a side of the square picture.
        samples: usize,
        /// Number of lines.
        lines: usize,
    },
    /// Bright points on a grid.
    Points {
        /// Samples along a side of the square picture.
        samples: usize,
        /// Samples between points.
        spacing_samples: usize,
    },
    /// The 24-patch chart.
    ColorChart {
        /// Samples along a side of a patch.
        patch_samples: usize,
    },
    /// A plane of one reflectance.
    Uniform {
        /// Samples along a side of the square picture.
        samples: usize,
        /// Reflectance, 0–1.
        reflectance: f64,
    },
}

fn noon() -> Illuminant {
    Illuminant::D65
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
            illuminant: noon(),
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
        let sizes: &[(&'static str, usize)] = match &self.source {
            SceneSource::File(_) => &[],
            SceneSource::StillLife { columns, rows } => &[("columns", *columns), ("rows", *rows)],
            SceneSource::Checkerboard { samples, check_samples } => {
                &[("samples", *samples), ("check_samples", *check_samples)]
            }
            SceneSource::SlantedBar { samples, slope } => {
                checker.finite("slope", *slope)?;
                &[("samples", *samples)]
            }
            SceneSource::RadialLines { samples, lines } => &[("samples", *samples), ("lines", *lines)],
            SceneSource::Points { samples, spacing_samples } => {
                &[("samples", *samples), ("spacing_samples", *spacing_samples)]
            }
            SceneSource::ColorChart { patch_samples } => &[("patch_samples", *patch_samples)],
            SceneSource::Uniform { samples, reflectance } => {
                checker.positive("reflectance", *reflectance)?;
                &[("samples", *samples)]
            }
        };
        sizes.iter().try_for_each(|&(key, size)| checker.count(key, size, 1..=65_536))
    }

    pub(crate) fn resolve_paths(&mut self, folder: &Path) {
        if let SceneSource::File(path) = &mut self.source {
            *path = folder.join(&path);
        }
    }
}
