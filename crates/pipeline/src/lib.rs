//! The whole camera, chained as in Figure 1 of the paper: scene, lens, irradiance, sensor, picture.
//!
//! A [`Camera`] is a file: it says everything about a shot. A [`Shot`] is a camera with all that it names opened, a
//! [`Capture`] what came of it, stage by stage; [`Capture::write`] leaves frames, a picture and a report in a folder.
//! Beside it stand the tables that the command line prints (lenses, glasses, traced rays, point-spread functions), what
//! a laboratory would [`measure`], and the [`figures`] of the paper, each a function that returns data.
//!
//! This crate alone sees every stage. It knows nothing of terminals: it prints nothing and reads no clock, and tells
//! how far it is through [`Progress`].
#![doc = include_str!("../README.md")]

mod band_stream;
mod bank_choice;
mod camera;
mod camera_bank;
mod capture;
mod check;
mod convert;
mod display;
mod error;
pub mod figures;
mod frame_files;
mod frames_choice;
mod glass_table;
mod lens_analysis;
mod lens_choice;
mod lens_drawing;
mod lens_table;
mod lens_use;
pub mod measure;
mod mosaic;
mod movements;
mod numbers;
mod panel;
mod plots;
mod progress;
mod psf_focus;
mod psf_light;
mod psf_mosaic;
mod psf_plots;
mod psf_request;
mod psf_row;
mod psf_source;
mod psf_table;
mod report;
mod scene_choice;
mod sense;
mod shot;
mod spot;
mod staged;
mod surface_table;
mod svg_png;
mod trace_table;

pub use bank_choice::{BankChoice, BankData};
pub use camera::{
    BlurChoice, Camera, DiffractionChoice, FilmChoice, FocusChoice, LensChoice, ProcessingChoice, SensorChoice,
    StopChoice, WavelengthChoice, WhiteChoice,
};
pub use camera_bank::CameraBank;
pub use capture::{Capture, IrradianceSummary};
pub use convert::{ConvertedLens, convert_lens};
pub use error::PipelineError;
pub use frame_files::{FrameFile, Outputs};
pub use frames_choice::{Exposed, FramesChoice};
pub use glass_table::{GlassData, GlassRow, glass_data, glass_rows};
pub use lens_analysis::{
    AnalysisFields, AnalysisFilm, AnalysisRequest, AxialColorRow, FanRow, FieldPlace, FieldRow, FocusData, GridRow,
    LensAnalysis, OpdMap, PupilRow, SpotRow, WavefrontRow,
};
pub use lens_choice::{LensReading, MissingGlass, REFERENCE_WAVELENGTH_NM, SeqNumbersChoice};
pub use lens_drawing::LensDrawing;
pub use lens_table::{ImageData, LensData, LensQuestion, LensRow, PlaneData, built_in_lenses};
pub use lens_use::LensUse;
pub use mosaic::{MosaicPlan, PsfMosaic};
pub use movements::Movements;
pub use numbers::{parse_numbers, parse_pairs};
pub use plots::{Corner, LineChart, Series};
pub use progress::{Progress, Silent, Stage};
pub use psf_focus::ThroughFocus;
pub use psf_light::WholeLight;
pub use psf_request::{PsfRequest, PsfSampling};
pub use psf_row::{MtfRow, PsfRow, psf_csv};
pub use psf_table::PsfSet;
pub use report::{ChannelStatistics, FilmData, IrradianceData, LossRow, Report, SceneData, SensorStatistics};
pub use scene_choice::{SceneChoice, SceneSource};
pub use sense::{SenseRequest, parse_illuminant, sense_irradiance, with_exposure_s};
pub use shot::Shot;
pub use staged::Staged;
pub use surface_table::{SurfaceRow, placement_lines, surface_rows};
pub use svg_png::{drawing_file, svg_to_png};
pub use trace_table::{RayTable, TraceError, TraceSettings};
