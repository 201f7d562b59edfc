//! What people ask of lenses, point spread functions, sensors and runs, as data: tables, metrics and charts.
//!
//! [`AnalysisRequest`] and [`LensData`] are about lenses, [`PsfRequest`] about point spread functions, [`measure`] about
//! pictures, frames and sensors, [`RunReport`] about a run of the whole camera. A chart is a [`LineChart`]: lines, axes
//! and labels, which the crate `report` draws.
//!
//! This crate draws nothing, writes no pages and knows nothing of terminals.
#![doc = include_str!("../README.md")]

mod chart;
mod field_angles;
mod filter_table;
mod lens;
pub mod measure;
mod methods;
mod palette;
mod psf;
mod run;
mod sensor_table;

pub use chart::{Corner, LineChart, Scale, Series};
pub use filter_table::{FilterRow, built_in_filters};
pub use lens::{
    AfocalView, AnalysisFields, AnalysisFilm, AnalysisRequest, AxialColorRow, ComparedLens, ComparisonRow,
    ConfigurationData, ConvertedLens, FanRow, FieldPlace, FieldRow, FilmPlace, FilmUse, FocusData, FocusSpot,
    Footprint, GRID_LINES, GhostField, GhostPair, GhostRow, GhostTable, GhostTableRequest, GlassData, GlassRow,
    GridRow, ImageData, Landing, LensAnalysis, LensComparison, LensCurves, LensData, LensDefaults, LensInfoRequest,
    LensModulation, LensPageData, LensRow, OpdMap, PlaneData, PupilRow, RayTable, SharpDepths, SpotRow, SurfaceRow,
    TraceError, TraceSettings, WavefrontRow, built_in_lenses, convert_lens, ends_of, glass_data, glass_rows,
    placement_lines, surface_rows,
};
pub use methods::{Fit, MethodComparison, MethodRow};
pub use palette::line as line_color;
pub use psf::{MtfRow, PolychromaticPsf, PsfRequest, PsfRow, PsfSampling, PsfSet, ThroughFocus, psf_csv};
pub use run::{
    ChannelStatistics, DisparityData, DngReport, DualPixelData, FilmData, IrradianceData, LossRow, MOST_ERROR_PX,
    PixelOpticsData, PixelOpticsRow, PixelPlace, ReflectionData, Run, RunCharts, RunOptics, RunPlaces, RunReport,
    RunTimes, SceneData, SensorStatistics, pixel_optics_rows,
};
pub use sensor_table::{SensorRow, built_in_sensors};
