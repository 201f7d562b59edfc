//! The whole camera, chained as in Figure 1 of the paper: scene, lens, irradiance, sensor, picture.
//!
//! A [`Camera`] is a file: it states everything about a shot. A [`KeptCamera`] keeps the results of its stages, so that a
//! changed camera computes what the change touches; a [`Capture`] is what came of it, stage by stage. Beside it stand the
//! [`figures`] of the paper, each a function that returns data.
//!
//! This crate alone sees every stage. It knows nothing of terminals, tables or plots: it prints nothing, reads no clock and
//! draws nothing, and reports how far it is through [`Progress`].
#![doc = include_str!("../README.md")]

mod camera;
mod capture_files;
mod develop;
pub mod display;
mod error;
pub mod figures;
mod film_files;
mod frame_files;
mod gathered;
mod json;
mod keys;
mod light_field;
mod lights;
mod numbers;
mod paintings;
mod progress;
mod psf_file;
mod quality;
mod ranges;
mod scene_files;
mod schema;
mod sense;
mod shown;
mod stages;
mod still_life;
mod video_files;
mod words;

/// Planes and cubes of this crate are arrays of it.
pub use ndarray;

pub use dioptric_backward::{BandSampling, LightPaths, MicroArray, MicroElements, MicroLayout, Renderer, Rendering};
pub use dioptric_optics::{GlassRange, Iris, MissingGlass, SeqNumbers, SurfaceChange};
pub use dioptric_psf::Diffraction;
pub use dioptric_scene::{
    DepthKind, ExrSamples, FileQuantity, FileReading, FillDepth, NoData, Panorama,
    may_be_read_with as may_be_read_with_scene,
};
pub use dioptric_sensor::{Binning, DngBlack, DngOpcodes, DngReading, DngRendering, ProfileFile};
pub use dioptric_world::{ObjectInfo, WorldBuilder, open_world, write_world};

pub use camera::{
    BlurSpec, BorderSpec, CAMERA_SCHEMA, Camera, CameraTurn, CoatingSpec, Crop, DrawnEye, DualPixelSpec, Exposed,
    FilmSpec, FilterSpec, FlatSize, FocusSpec, FramesSpec, LensReadOptions, LensReflections, LensSpec, LightAmount,
    LightFieldSpec, Movements, PhotodiodeReads, Photodiodes, REFERENCE_WAVELENGTH_NM, RenderEffort, RenderMethod,
    RetiredBank, SceneSource, SceneSpec, SensorOptions, SensorSpec, StopSpec, TurnPath, VideoSpec, WavelengthSpec,
    WorldChange, WorldColor, WorldLamp, WorldLight, WorldMaterial, WorldShape, WorldSky, WorldSpec, WorldView,
    nearest_to_reference_nm, reference_nm_of, with_blades,
};
pub use capture_files::{irradiance_files, write_capture, write_frames_and_depth, write_irradiance, write_scene};
pub use develop::DevelopedFile;
pub use dioptric_files::Staged;
pub use error::{PipelineError, SceneLack};
pub use film_files::convert_irradiance;
pub use frame_files::{FrameFile, Frames, LensFacts, Outputs, picture_png, write_frames};
pub use json::{write_file, write_json};
pub use keys::{Key, PICTURE, PictureOptions, light_word, white_word};
pub use light_field::{ArrayFrame, DepthEstimate, DepthSearch, LightField, ParallelCameras, ViewGeometry};
pub use lights::{parse_illuminant, parse_white};
pub use numbers::{number, parse_bytes, parse_directions, parse_numbers, parse_pairs};
pub use paintings::{PaintingFolder, program_build};
pub use progress::{Clock, ImagingTimes, Progress, Silent, Stage};
pub use psf_file::PsfFile;
pub use quality::Quality;
pub use ranges::{Range, range_of};
pub use scene_files::{SceneInfo, SceneRequest};
#[cfg(feature = "schema")]
pub use schema::generated_schemas;
pub use schema::{CAMERA_TEMPLATE, SENSOR_SCHEMA};
pub use sense::{SenseRequest, Sensed};
pub use shown::{ShowRequest, ShownPicture, open_display};
pub use stages::{
    AberrationSummary, AnimationSummary, CameraSummary, Capture, FilmPart, FilmPlace, FrameSet, Given, GivenParts,
    IRRADIANCE_FILE, Imaged, Irradiance, IrradianceSummary, KeptCamera, LensAberrations, NarrowSurfaces, PaintReach,
    RESUME_FILE, RenderingSummary, ResolvedLens, ResolvedScene, Resumed, SceneSummary, StageCounts, UnseenPoints,
    Video, VideoFrame, VideoFrameFacts, WhiteOf, WorldRender, WorldSummary, change_world, has_kept_bands, world_camera,
    write_seen_png,
};
pub use video_files::{VideoFacts, write_video_frame};
pub use words::{with_analog_gain, with_auto_exposure, with_exposure_s};
