//! What may be said of a scene beside its file.

use std::path::PathBuf;

use dioptric_spectrum::{Illuminant, WavelengthGrid};

use super::{reading::FileReading, unmeasured::FillDepth};
use crate::{Scene, SceneError};

/// A part of a scene's samples, and how many of them become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its first column and row, and how many columns and rows it has; all where `None`.
    pub window: Option<[usize; 4]>,
    /// Samples that become one, each way.
    pub bin: usize,
}

impl Part {
    /// Returns the part of a scene.
    ///
    /// # Errors
    /// When it is empty, reaches beyond the scene or is smaller than a block.
    pub fn of(self, mut scene: Scene) -> Result<Scene, SceneError> {
        if let Some([x, y, columns, rows]) = self.window {
            scene = scene.cropped(y..y.saturating_add(rows), x..x.saturating_add(columns))?;
        }
        let (rows, columns) = (scene.rows(), scene.columns());
        scene = scene.binned(self.bin)?;
        scene.notes.extend(self.left_over(&scene.name, columns, rows));
        Ok(scene)
    }

    /// Returns what of so many samples fills no block.
    pub(super) fn left_over(self, name: &str, columns: usize, rows: usize) -> Option<String> {
        let bin = self.bin.max(1);
        let (right, below) = (columns % bin, rows % bin);
        (right + below > 0).then(|| {
            format!(
                "{name}: of its {columns} × {rows} samples {right} columns at the right and {below} rows at the bottom fill no block of \
                 {bin} and are left out"
            )
        })
    }
}

/// What a file may leave open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The bands wanted; those of the file where `None`, and 400–700 nm every 10 nm for ordinary pictures.
    pub grid: Option<WavelengthGrid>,
    /// The light on a file of reflectances, D65 where `None`; an ordinary picture is put under it.
    pub light: Option<Illuminant>,
    /// Its illuminance, and that of the white of an ordinary picture, lx; 1000 where `None`, or what the file says of its white.
    pub illuminance_lux: Option<f64>,
    /// The number that a perfect white has in a cube that does not tell.
    pub white_level: Option<f64>,
    /// One depth for all samples of a scene that has none, m.
    pub depth_m: Option<f64>,
    /// The horizontal field of view, in place of the file's own camera data.
    pub horizontal_fov_deg: Option<f64>,
    /// How far apart the samples of a picture of one depth may be, as the tangent of the angle between neighbours on the axis: a
    /// picture that is finer is read as means of its pixels.
    pub finest_tangent: Option<f64>,
    /// The depth of places where none was measured; where `None`, those of a depth picture get the farther of the depths beside
    /// them, and a file that has such places is refused.
    pub fill_depth: Option<FillDepth>,
    /// The part of the samples that is wanted, and as what.
    pub part: Option<Part>,
    /// Whether means over blocks of samples do of a cube that is larger than the memory allows.
    pub summary: bool,
    /// A file of what lies behind the first surface: radiance and depth of the same samples, seen from the same place. Depth 0 or NaN says that
    /// nothing is known there: it becomes that of the first surface.
    pub hidden: Option<PathBuf>,
    /// What else the file does not say itself.
    pub reading: FileReading,
}
