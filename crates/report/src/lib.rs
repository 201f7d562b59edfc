//! Pictures, plots and pages of what the other crates compute.
//!
//! This crate alone draws: line charts, lens drawings, panels of an analysis, mosaics of point spread functions, the
//! paper's figures, and the page of a run. A program that shows data in its own way does without it.
#![doc = include_str!("../README.md")]

mod axis;
mod drawing_file;
mod figures;
mod lens;
mod lettering;
mod light_field;
mod measurement;
mod mesh;
mod methods;
mod page;
mod panel;
mod plots;
mod png;
mod psf;
mod run;
#[cfg(feature = "png")]
mod svg_png;

pub use drawing_file::{DRAWS_PNG, PNG_REMEDY, check_drawing_name, drawing_file, write_drawing};
pub use figures::{Drawing, draw_all, draw_figure4};
pub use lens::{AnalysisPlots, LensComparisonPage, LensDrawing, LensPage};
pub use light_field::{CamerasAlike, DepthError, LightFieldReport, ViewFiles, write_light_field};
pub use measurement::{MeasurementWords, write_measurement};
pub use methods::{comparison_picture, write_comparison};
pub use plots::chart_svg;
pub use psf::{MosaicPlan, PsfFormat, PsfMosaic, psf_mosaic, psf_page, write_psfs};
pub use run::{write_run, write_sensed};
#[cfg(feature = "png")]
pub use svg_png::svg_to_png;
