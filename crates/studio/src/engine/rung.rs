//! The ladder of qualities.

use dioptric_pipeline::{Camera, Quality, RenderEffort, SceneSource};

/// A step of the ladder from the first look to the picture that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rung {
    /// At most 160 columns and 4 bands.
    Sketch,
    /// At most 480 columns and 5 bands.
    Preview,
    /// The full picture of a world on its way, of fewer samples; no step of its own.
    Refining,
    /// The picture of `dioptric run`, to the byte.
    Full,
}

impl Rung {
    /// The steps, lowest first.
    pub const ALL: [Self; 3] = [Self::Sketch, Self::Preview, Self::Full];

    /// The quality that is simulated.
    pub fn quality(self) -> Quality {
        match self {
            Self::Sketch => Quality::Sketch,
            Self::Preview => Quality::Preview,
            Self::Refining | Self::Full => Quality::Full,
        }
    }

    /// Returns the camera whose picture is taken on this rung: the camera itself, but of a world whose rays start at the film fewer
    /// of them on lower rungs.
    pub fn camera(self, camera: &Camera) -> Camera {
        let most = match self {
            Self::Sketch => 2,
            Self::Preview => 8,
            Self::Refining | Self::Full => return camera.clone(),
        };
        let mut camera = camera.clone();
        if let SceneSource::World(world) = &mut camera.scene.source {
            world.effort = match world.effort {
                RenderEffort::Samples(n) => RenderEffort::Samples(n.min(most)),
                RenderEffort::Noise(_) => RenderEffort::Samples(most),
            };
        }
        camera
    }

    /// The number of its step, 1 for the lowest.
    pub fn number(self) -> usize {
        match self {
            Self::Sketch => 1,
            Self::Preview => 2,
            Self::Refining | Self::Full => 3,
        }
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sketch => "sketch",
            Self::Preview => "preview",
            Self::Refining => "refining",
            Self::Full => "full",
        }
    }
}
