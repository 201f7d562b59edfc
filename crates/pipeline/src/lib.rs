//! The whole camera: scene, lens, sensor and processing chained as in Figure 1.

mod display;
mod error;
mod numbers;
mod plots;
mod staged;

pub use error::PipelineError;
pub use numbers::parse_numbers;
pub use plots::{LineChart, Series};
pub use staged::Staged;
