//! The whole camera: scene, lens, sensor and processing chained as in Figure 1.

mod camera;
mod check;
mod display;
mod error;
mod numbers;
mod plots;
mod scene_choice;
mod staged;

pub use camera::{
    BlurChoice, Camera, DemosaicChoice, DiffractionChoice, FilmChoice, FocusChoice, LensChoice, Outputs,
    ProcessingChoice, SensorChoice, StopChoice, WavelengthChoice, WhiteChoice,
};
pub use error::PipelineError;
pub use numbers::parse_numbers;
pub use plots::{LineChart, Series};
pub use scene_choice::{SceneChoice, SceneSource};
pub use staged::Staged;
