//! How far a run is, for whoever wants to know.

use std::sync::Arc;

pub use dioptric_forward::{Clock, ImagingTimes};

/// A stage of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Reading or making the scene.
    Scene,
    /// Tracing the lens into a bank of point-spread functions.
    Lens,
    /// Laying layers of depth and point spread functions over the film.
    Plan,
    /// From the scene to irradiance on the film.
    Irradiance,
    /// Electrons, exposure, noise, conversion.
    Sensor,
    /// From the raw frame to the picture.
    Picture,
    /// Measuring and drawing for the report, and writing files.
    Report,
}

impl Stage {
    /// All stages, in their order.
    pub const ALL: [Self; 7] =
        [Self::Scene, Self::Lens, Self::Plan, Self::Irradiance, Self::Sensor, Self::Picture, Self::Report];

    /// What the stage does, in a few words.
    pub fn title(self) -> &'static str {
        match self {
            Self::Scene => "reading the scene",
            Self::Lens => "tracing the lens",
            Self::Plan => "planning the imaging",
            Self::Irradiance => "scene to irradiance",
            Self::Sensor => "exposing the sensor",
            Self::Picture => "developing the picture",
            Self::Report => "writing the report",
        }
    }
}

/// Receives how far a run is.
pub trait Progress: Sync {
    /// A stage is done to this part, 0–1. Called from any thread; 0 is the start of the stage.
    fn at(&self, stage: Stage, fraction: f64);

    /// The clock by which the parts of imaging are timed; where there is none they are not.
    fn clock(&self) -> Option<Arc<Clock>> {
        None
    }

    /// The imaging of a scene is done, and its parts took so long, summed over threads. Called where the plan of the imaging has
    /// a clock.
    fn imaged(&self, times: &ImagingTimes) {
        let _ = times;
    }
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn at(&self, _: Stage, _: f64) {}
}
