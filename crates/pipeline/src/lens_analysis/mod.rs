//! A lens analysed by real rays: numbers and plots.

mod compute;
mod html;
mod maps;
mod page;
mod request;
mod rows;

pub use request::{AnalysisFields, AnalysisFilm, AnalysisRequest};
pub use rows::{
    AxialColorRow, FanRow, FieldPlace, FieldRow, FocusData, GridRow, LensAnalysis, OpdMap, PupilRow, SpotRow,
    WavefrontRow,
};
