//! A lens analysed by real rays: numbers and plots.

mod compute;
mod page;
mod rows;

pub use compute::{AnalysisFilm, AnalysisRequest};
pub use rows::{AxialColorRow, FanRow, FieldRow, FocusData, LensAnalysis, PupilRow, SpotRow, WavefrontRow};
