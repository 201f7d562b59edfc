//! Lenses as tables: first-order data, surfaces, glasses, explicit rays, and an analysis by real rays.

mod afocal;
mod comparison;
mod compute;
mod convert;
mod curves;
mod defaults;
mod film;
mod focus_spots;
mod footprint;
mod ghosts;
mod glass_table;
mod modulation;
mod page_data;
mod request;
mod rows;
mod sharp;
mod surface_table;
mod table;
mod trace_table;

pub use afocal::AfocalView;
pub use comparison::{ComparedLens, ComparisonRow, LensComparison};
pub use compute::GRID_LINES;
pub use convert::{ConvertedLens, convert_lens};
pub use curves::{LensCurves, ends_of};
pub use defaults::LensDefaults;
pub use film::{AnalysisFilm, FilmPlace, FilmUse};
pub use focus_spots::FocusSpot;
pub use footprint::Footprint;
pub use ghosts::{GhostField, GhostPair, GhostRow, GhostTable, GhostTableRequest, Landing};
pub use glass_table::{GlassData, GlassRow, glass_data, glass_rows};
pub use modulation::LensModulation;
pub use page_data::LensPageData;
pub use request::{AnalysisFields, AnalysisRequest};
pub use rows::{
    AxialColorRow, FanRow, FieldPlace, FieldRow, FocusData, GridRow, LensAnalysis, OpdMap, PupilRow, SpotRow,
    WavefrontRow,
};
pub use sharp::SharpDepths;
pub use surface_table::{SurfaceRow, placement_lines, surface_rows};
pub use table::{ConfigurationData, ImageData, LensData, LensInfoRequest, LensRow, PlaneData, built_in_lenses};
pub use trace_table::{RayTable, TraceError, TraceSettings};
