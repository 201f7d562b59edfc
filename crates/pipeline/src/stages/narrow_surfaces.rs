//! Where layers of depth are least exact: beside what is narrower than the pupil, and behind what is known.

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
    /// The share of the film from which a part of the pupil looks behind all that the scene tells, or that is guessed of it.
    #[serde(default)]
    pub unknown_fraction: f64,
}

impl NarrowSurfaces {
    /// Returns those of a scene; `None` where nothing is narrow.
    pub(super) fn of(plan: &ImagingPlan, scene: &Scene) -> Option<Self> {
        let (fraction, unknown_fraction) = (plan.narrow_fraction(), plan.unknown_fraction());
        let is_known_behind = scene.hidden.is_some();
        (fraction.max(unknown_fraction) > 0.0).then_some(Self { fraction, is_known_behind, unknown_fraction })
    }

    /// Returns a note on what is not known at all, where it is worth one.
    pub fn note_on_unknown(&self) -> Option<String> {
        (self.unknown_fraction >= LEAST_NOTED).then(|| {
            format!(
                "{:.0} % of the film looks past the edges of two surfaces, one behind the other: the scene has no more than two layers, and what lies \
                 behind both is taken for what is seen beside it",
                100.0 * self.unknown_fraction
            )
        })
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
