//! Points beside a scene that its picture does not show.

use dioptric_forward::ImagingPlan;
use dioptric_scene::Scene;
use serde::{Deserialize, Serialize};

/// Of the points beside a scene those that no pixel sees, whatever the blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnseenPoints {
    /// Points in all.
    pub n_points: usize,
    /// Those behind the first surface of the scene: past its edges some of their light is seen.
    pub n_hidden: usize,
    /// Those where no point of the film looks.
    pub n_beyond: usize,
}

impl UnseenPoints {
    /// Returns those of a scene; `None` where it has no points.
    pub(super) fn of(plan: &ImagingPlan, scene: &Scene) -> Option<Self> {
        let (n_hidden, n_beyond) = plan.points_unseen();
        (!scene.points.is_empty()).then_some(Self { n_points: scene.points.len(), n_hidden, n_beyond })
    }

    /// Returns a note for the user, where any are not seen.
    pub fn note(&self) -> Option<String> {
        let Self { n_points, n_hidden, n_beyond } = *self;
        let parts = [
            (n_hidden, "behind the scene, which hides them but for what is seen past edges"),
            (n_beyond, "beyond what the film sees"),
        ];
        let parts = parts.into_iter().filter(|(n, _)| *n > 0).map(|(n, where_)| format!("{n} lie {where_}"));
        let parts: Vec<String> = parts.collect();
        (!parts.is_empty()).then(|| format!("of {n_points} points {}", parts.join(", ")))
    }
}
