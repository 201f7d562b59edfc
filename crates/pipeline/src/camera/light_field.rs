//! What makes a light-field camera of a camera.

use dioptric_backward::{BackwardError, MicroArray};
use serde::{Deserialize, Serialize};

use super::check::Checker;
use crate::PipelineError;

/// What makes a light-field camera of a camera. What stands before it must be a world, rendered by rays from the film.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum LightFieldSpec {
    /// An array of small lenses or holes that stands where the focus puts the film; the film lies behind it.
    Array(MicroArray),
    /// A raster of equal, parallel cameras side by side, the middle of it where the camera stands. A picture is that of a
    /// camera in the middle.
    Cameras {
        /// Cameras across.
        columns: usize,
        /// Cameras above each other.
        rows: usize,
        /// Distance between neighbors, mm.
        spacing_mm: f64,
    },
}

impl LightFieldSpec {
    /// The array before the film, where there is one.
    pub(crate) fn micro_array(&self) -> Option<MicroArray> {
        if let Self::Array(array) = self { Some(*array) } else { None }
    }

    pub(super) fn check(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        match self {
            Self::Array(array) => match array.check() {
                Err(BackwardError::Setting { what, found, expected }) => {
                    checker.wrong("light_field", &format!("an array of which {what} is {found}"), expected)
                }
                other => Ok(other?),
            },
            Self::Cameras { columns, rows, spacing_mm } => {
                checker.count("columns", *columns, 1..=MOST_CAMERAS)?;
                checker.count("rows", *rows, 1..=MOST_CAMERAS)?;
                checker.number("spacing_mm", *spacing_mm)
            }
        }
    }
}

/// The most cameras of a raster along each side.
const MOST_CAMERAS: usize = 64;
