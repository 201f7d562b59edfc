//! The words of `dioptric render`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use dioptric_pipeline::{
    Crop, Diffraction, LensReflections, PipelineError, WorldLamp, WorldSky, WorldSpec, WorldView, parse_numbers,
};

use crate::lens_args::{BandArgs, FilmArgs, LensStateArgs};

/// What diffraction rays from the film can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RayDiffraction {
    /// Rays only
    None,
    /// Heisenberg-uncertainty ray bending, γ = 1 (the paper, Freniere)
    Hurb,
    /// Heisenberg-uncertainty ray bending, γ = √2 (`Scene3D` since 2015)
    HurbScene3d,
    /// Ray bending with constants fitted to Airy's pattern
    HurbCalibrated,
}

impl From<RayDiffraction> for Diffraction {
    fn from(kind: RayDiffraction) -> Self {
        match kind {
            RayDiffraction::None => Self::None,
            RayDiffraction::Hurb => Self::Hurb { gamma: 1.0 },
            RayDiffraction::HurbScene3d => Self::Hurb { gamma: std::f64::consts::SQRT_2 },
            RayDiffraction::HurbCalibrated => Self::HurbCalibrated,
        }
    }
}

/// A world, and the camera that renders it.
#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// World to render: .pbrt, .gltf, .glb, .obj, .ply or .stl; or still-life, the built-in scene of the demo
    pub(crate) world: PathBuf,
    /// Camera file (.ron), whose scene the world takes the place of; or a camera of the world's file, by its name or its number from 1
    /// [default: the first one of the world's file]
    #[arg(long, value_name = "CAMERA", help_heading = "Lens")]
    pub(crate) camera: Option<String>,
    /// Lens in place of the camera's: a file, the name of a built-in one, thin:50mm:f2 or pinhole:0.1mm
    #[arg(long, value_name = "LENS", help_heading = "Lens")]
    pub(crate) lens: Option<String>,
    #[command(flatten)]
    pub(crate) state: LensStateArgs,
    #[command(flatten)]
    pub(crate) place: FilmArgs,
    /// Horizontal field of view of a world whose file states none, degrees
    #[arg(long, value_name = "A", help_heading = "World")]
    pub(crate) fov_deg: Option<f64>,
    /// Size of the picture in pixels, e.g. 640x480 [default: that of the camera]
    #[arg(long, value_name = "WxH", help_heading = "Film and sensor")]
    pub(crate) pixels: Option<String>,
    /// Renders a part of the picture: first column and row, columns and rows; without sensor and report
    #[arg(long, value_name = "X,Y,W,H", help_heading = "Film and sensor")]
    pub(crate) crop: Option<Crop>,
    /// Width of the film, mm [default: that of the camera, or what its field of view needs]
    #[arg(long, value_name = "W", help_heading = "Film and sensor")]
    pub(crate) film_width_mm: Option<f64>,
    /// Diffraction at the stop [default: the camera's]
    #[arg(long, value_name = "KIND", value_enum, help_heading = "Simulation")]
    pub(crate) diffraction: Option<RayDiffraction>,
    /// Light that surfaces of the lens reflect: 'off', it is left out; 'ghosts', what two of them reflect, once each, falls on the film;
    /// 'film:0.1', the film is one of them, a mirror of 10 % [default: the camera's]
    #[arg(long, value_name = "KIND", help_heading = "Simulation")]
    pub(crate) lens_reflections: Option<LensReflections>,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
    /// Sensor, a file or the name of a built-in one
    #[arg(long, value_name = "SENSOR", help_heading = "Film and sensor")]
    pub(crate) sensor: Option<String>,
    /// Exposure time, s [default: automatic]
    #[arg(long, value_name = "T", help_heading = "Exposure and picture")]
    pub(crate) exposure_s: Option<f64>,
    /// What the picture makes white, as for `run` [default: scene, the light on what is seen]
    #[arg(long, value_name = "WHITE", help_heading = "Exposure and picture")]
    pub(crate) white: Option<String>,
    #[command(flatten)]
    pub(crate) view: ViewArgs,
    /// Scales all lights so that what is seen has this mean luminance, cd/m²
    #[arg(long, alias = "mean-luminance", value_name = "L", help_heading = "World")]
    pub(crate) mean_luminance_cd_m2: Option<f64>,
    /// Scales all lights so that the mean illuminance of the film is this, lux
    #[arg(long, value_name = "LUX", conflicts_with = "mean_luminance_cd_m2", help_heading = "World")]
    pub(crate) mean_lux: Option<f64>,
    #[command(flatten)]
    pub(crate) reading: WorldReadArgs,
    /// Follows light over at most so many scatterings: 0 shows what glows, 1 direct light [default: all]
    #[arg(long, value_name = "N", help_heading = "Simulation")]
    pub(crate) bounces: Option<u32>,
    /// Samples a pixel, rounded up to a multiple of 8 [default: 64, unless noise or time is given]
    #[arg(long, value_name = "N", conflicts_with_all = ["noise", "seconds"], help_heading = "Simulation")]
    pub(crate) samples: Option<u32>,
    /// Renders until the relative standard error of a pixel over all bands is this, e.g. 0.02; of a dark one as a share of a
    /// tenth of the mean
    #[arg(long, value_name = "R", help_heading = "Simulation")]
    pub(crate) noise: Option<f64>,
    /// Renders for so long, s, or until the noise is reached where that is given too
    #[arg(long, value_name = "S", help_heading = "Simulation")]
    pub(crate) seconds: Option<f64>,
    /// Writes scene.exr too, a scene for `run --scene`: radiance and depth as the middle of the entrance pupil sees them and, of 2
    /// layers, what that hides
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=2), help_heading = "Results")]
    pub(crate) layers: Option<u32>,
    /// Goes on from where an earlier rendering into the same folder was stopped; the bits are those of one without a stop
    #[arg(long, help_heading = "Results")]
    pub(crate) resume: bool,
    /// Folder for the results
    #[arg(long, short, value_name = "DIR", default_value = "dioptric-render", help_heading = "Results")]
    pub(crate) out: PathBuf,
}

/// How the file of a world is read.
#[derive(Debug, Args)]
#[command(next_help_heading = "World")]
pub(crate) struct WorldReadArgs {
    /// Length of the file's unit, m
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    unit_m: f64,
    /// How far the animations of a glTF file have come, s [default: everything stands as it is written]
    #[arg(long = "time", value_name = "S")]
    time_s: Option<f64>,
    /// Which animation moves it, by its name or its number from 1; without --time from its beginning on [default: the first, and others
    /// that move what none before them does]
    #[arg(long, value_name = "NAME|N")]
    animation: Option<String>,
    /// Which of the variants of its materials a glTF file shows [default: the file's own materials]
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
}

impl WorldReadArgs {
    /// Returns a world that is read so.
    pub(crate) fn spec_of(&self, file: &Path) -> WorldSpec {
        let Self { unit_m, time_s, animation, variant } = self;
        WorldSpec {
            unit_m: *unit_m,
            time_s: *time_s,
            animation: animation.clone(),
            variant: variant.clone(),
            ..WorldSpec::of_file(file.to_owned())
        }
    }
}

/// From where a world is seen, and what lights it besides its own lights.
#[derive(Debug, Args)]
#[command(next_help_heading = "World")]
pub(crate) struct ViewArgs {
    /// Sees the whole world, a quarter round from its front and from above [default where its file has no camera]
    #[arg(long, conflicts_with = "eye")]
    pub(crate) frame: bool,
    /// Where the camera stands, m
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point)]
    pub(crate) eye: Option<(f64, f64, f64)>,
    /// What is in the middle of the picture, m [default: the middle of the world]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, requires = "eye")]
    pub(crate) look_at: Option<(f64, f64, f64)>,
    /// What is up in the picture [default: what is up in the world]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, requires = "eye")]
    pub(crate) up: Option<(f64, f64, f64)>,
    /// Light from beyond: even:RADIANCE (W m⁻² sr⁻¹ nm⁻¹), day:ELEVATION,AZIMUTH,TURBIDITY (degrees; day alone is day:45,30,3), or a picture
    /// of all directions, its rows by height [default: even:1 where nothing else gives light]
    #[arg(long, value_name = "SKY", value_parser = parse_sky)]
    pub(crate) sky: Option<WorldSky>,
    /// Lamps at a place, m, of a luminous flux, lm, and the color of daylight
    #[arg(long, value_name = "X,Y,Z,LM", value_parser = parse_lamp)]
    pub(crate) light: Vec<WorldLamp>,
}

impl ViewArgs {
    /// Returns the view that is asked for; `camera` is the name or the number of one of the file's.
    pub(crate) fn view(&self, camera: Option<&str>) -> WorldView {
        match (self.eye, camera) {
            _ if self.frame => WorldView::Whole,
            (Some(eye_m), _) => WorldView::From { eye_m, look_at_m: self.look_at, up: self.up },
            (None, Some(camera)) => WorldView::Camera(camera.to_owned()),
            (None, None) => WorldView::OfFile,
        }
    }
}

impl RenderArgs {
    /// The camera file, where one is named.
    pub(crate) fn camera_file(&self) -> Option<&Path> {
        let camera = self.camera.as_deref().map(Path::new)?;
        let is_file = camera.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("ron")) || camera.is_file();
        is_file.then_some(camera)
    }

    /// The camera of the world's file, where one is named.
    pub(crate) fn camera_of_world(&self) -> Option<&str> {
        self.camera.as_deref().filter(|_| self.camera_file().is_none())
    }
}

fn parse_point(text: &str) -> Result<(f64, f64, f64), String> {
    match parse_numbers("a point", text).as_deref() {
        Ok(&[x, y, z]) => Ok((x, y, z)),
        _ => Err("expected X,Y,Z: a place in m".to_owned()),
    }
}

fn parse_lamp(text: &str) -> Result<WorldLamp, String> {
    match parse_numbers("a lamp", text).as_deref() {
        Ok(&[x, y, z, lumens]) => Ok(WorldLamp { at_m: (x, y, z), lumens }),
        _ => Err("expected X,Y,Z,LM: a place in m and lumens".to_owned()),
    }
}

fn parse_sky(text: &str) -> Result<WorldSky, String> {
    text.parse().map_err(|error| match error {
        PipelineError::Value { expected, .. } => format!("expected {expected}"),
        other => other.to_string(),
    })
}

/// Something to do with worlds.
#[derive(Debug, Subcommand)]
pub(crate) enum WorldCommand {
    /// Describes the file of a world: size, cameras, lights, materials, and what of it isn't understood
    Info {
        /// World: .pbrt, .gltf, .glb, .obj, .ply or .stl
        world: PathBuf,
        #[command(flatten)]
        reading: WorldReadArgs,
    },
    /// Writes a world as another format; what that doesn't hold is told
    Convert {
        /// World: .pbrt, .gltf, .glb, .obj, .ply or .stl
        input: PathBuf,
        /// File to write: .glb or .gltf, or .pbrt (version 4) with its pictures and large meshes in a folder beside it
        output: PathBuf,
        #[command(flatten)]
        reading: WorldReadArgs,
        /// Refuses to write where not all of the world was read, or the format does not hold all of it
        #[arg(long)]
        strict: bool,
    },
}

/// A world that is rendered both ways.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// Camera file whose scene is a world, `scene: (source: World((file: "room.pbrt")))`, or the built-in still life
    pub(crate) camera: PathBuf,
    /// Samples a pixel, of both [default: those of the camera file]
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<u32>,
    /// Folder for the results
    #[arg(long, short, value_name = "DIR", default_value = "dioptric-compare")]
    pub(crate) out: PathBuf,
}

/// A light-field camera, and what is made of what it takes.
#[derive(Debug, Args)]
pub(crate) struct LightFieldArgs {
    /// Camera file with `light_field: Array((...))` or `light_field: Cameras(...)`, its scene a world
    pub(crate) camera: PathBuf,
    /// Irradiance that was rendered with this camera, as `irradiance.exr` of `run` or `render` [default: rendered now]
    #[arg(long, value_name = "FILE.exr")]
    pub(crate) irradiance: Option<PathBuf>,
    /// Frame that was taken behind the array, a DNG file as it left the sensor, or linear light
    #[arg(long, value_name = "FILE", conflicts_with_all = ["irradiance", "samples"])]
    pub(crate) frame: Option<PathBuf>,
    /// Frame of an even white that evens out the other, and in which the array's pitch, turn and offset are found
    #[arg(long, value_name = "FILE", requires = "frame")]
    pub(crate) white: Option<PathBuf>,
    /// Samples a pixel, where it is rendered now [default: those of the camera file]
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<u32>,
    /// Views along each side of the pupil, behind an array [default: one a pixel]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) views: Option<u16>,
    /// Depths to refocus on, m from the entrance pupil, e.g. 0.4,0.5 [default: eight over the range]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) refocus_m: Vec<f64>,
    /// Nearest depth that is sought, m [default: that of the scene]
    #[arg(long, value_name = "Z")]
    pub(crate) near_m: Option<f64>,
    /// Farthest depth that is sought, m [default: that of the scene]
    #[arg(long, value_name = "Z")]
    pub(crate) far_m: Option<f64>,
    /// Samples each way that depth is sought over: more for noise, fewer for small objects
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) radius_px: usize,
    /// Writes each view as linear light too, with the true depth and disparity of each sample
    #[arg(long)]
    pub(crate) exr: bool,
    /// Writes views and true disparity as the 4D Light Field Benchmark (HCI) lays them out, too
    #[arg(long)]
    pub(crate) hci: bool,
    /// Folder for the results
    #[arg(long, short, value_name = "DIR", default_value = "dioptric-lightfield")]
    pub(crate) out: PathBuf,
}
