//! What of a scene is narrower than the pupil: there layers of depth are least exact.

use dioptric_forward::ImagingPlan;
use dioptric_scene::Scene;
use serde::{Deserialize, Serialize};

/// The share that is worth a note.
const LEAST_NOTED: f64 = 1e-2;

/// What of a scene that was imaged in layers of depth is narrower than the pupil of the lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NarrowSurfaces {
    /// The share of the scene's samples on surfaces narrower than the pupil before what lies behind them.
    pub fraction: f64,
    /// Whether the scene has a second layer, which shows what lies behind.
    pub is_known_behind: bool,
}

impl NarrowSurfaces {
    /// Returns those of a scene; `None` where nothing is narrow.
    pub(super) fn of(plan: &ImagingPlan, scene: &Scene) -> Option<Self> {
        let fraction = plan.narrow_fraction();
        (fraction > 0.0).then_some(Self { fraction, is_known_behind: scene.hidden.is_some() })
    }

    /// Returns a note for the user, where there is something to do about it.
    pub fn note(&self) -> Option<String> {
        if self.fraction < LEAST_NOTED {
            return None;
        }
        let narrow = format!(
            "{:.0} % of the scene is narrower than the pupil before what lies behind it, ",
            100.0 * self.fraction
        );
        Some(match self.is_known_behind {
            true => {
                narrow
                    + "and layers of depth are off by some per cent there where both are out of focus: \
                       --blur views:16 (blur: Views(16) of the camera file) images it through parts of the pupil"
            }
            false => {
                narrow
                    + "which is guessed: a second layer of the scene (--hidden, or hidden of the camera file) and --blur views:16 \
                       (blur: Views(16)) show it"
            }
        })
    }
}
