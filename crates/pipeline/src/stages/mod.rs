//! Figure 1 of the paper as stages whose results are kept.
//!
//! | stage | made from |
//! |---|---|
//! | lens | lens, what its file leaves open, stop, blades, movements |
//! | painting | the still life of a preview: size, field of view, bands |
//! | scene | source, field of view, depth, bands; its light |
//! | film | lens, geometry of the scene, focus, raster |
//! | bank | film, diffraction, sampling |
//! | plan | bank, kind of blur |
//! | irradiance | plan, light in the scene; of photodiodes that see parts of the pupil, a plan for each |
//! | electrons | irradiance, sensor |
//! | frames | electrons, exposure, number of frames, noise |
//! | picture | frames, processing |
//!
//! A stage is a function of its inputs and keeps its latest results beside them ([`slot`]); [`spec`] has the inputs of each
//! as data. Nothing is ever declared out of date: equal inputs have equal results. Files are written by others.

mod ahead;
mod band_store;
mod bank;
mod canvas;
mod capture;
mod chain;
mod electrons;
mod film;
mod film_reach;
mod frames;
mod ghosts;
mod given;
mod irradiance;
mod kept;
mod kept_world;
mod lens;
mod lens_tables;
mod light_field;
mod memory;
mod narrow_surfaces;
mod painting;
mod part;
mod plan;
mod rendering;
mod results;
mod resume;
mod scene;
mod slot;
mod spec;
mod unseen_points;
mod video;
mod watch;
mod white_of;
mod with_given;
mod world;
mod world_camera;
mod world_change;
mod world_level;
mod world_light;
mod world_sky;
mod world_summary;
mod world_view;

pub(crate) use frames::{MovedLight, expose};
pub(crate) use irradiance::photodiode_irradiance_file;
pub(crate) use spec::ShutterInputs;
pub(crate) use watch::Watch;

pub use band_store::has_kept_bands;
pub use capture::Capture;
pub use film::{FilmPart, FilmPlace};
pub use frames::FrameSet;
pub use given::{Given, GivenParts};
pub use irradiance::{IRRADIANCE_FILE, Irradiance, IrradianceSummary};
pub use kept::KeptCamera;
pub use lens::ResolvedLens;
pub use lens_tables::{AberrationSummary, LensAberrations};
pub use narrow_surfaces::NarrowSurfaces;
pub use painting::PaintReach;
pub use rendering::{RenderingSummary, write_seen_png};
pub use results::StageCounts;
pub use resume::{Imaged, RESUME_FILE, Resumed};
pub use scene::{ResolvedScene, SceneSummary};
pub use unseen_points::UnseenPoints;
pub use video::{Video, VideoFrame, VideoFrameFacts};
pub use white_of::WhiteOf;
pub use world::WorldRender;
pub use world_change::change_world;
pub use world_summary::{AnimationSummary, CameraSummary, WorldSummary};
pub use world_view::world_camera;
