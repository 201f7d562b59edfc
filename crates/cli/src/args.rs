//! The words of the command line, and nothing else.

use std::{any::TypeId, ffi::OsString, path::PathBuf};

use clap::{Arg, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use dioptric_pipeline::{
    BlurSpec, BorderSpec, Crop, DngRendering, DualPixelSpec, ExrSamples, FilterSpec, LensReflections, PipelineError,
};

pub(crate) use crate::common::Common;
use crate::{
    camera::{CameraCommand, SensorCommand},
    examples::with_examples,
    filter::FilterCommand,
    lens_args::{BandArgs, FilmArgs, GlassCommand, LensArgs, LensCommand, LensFilmArgs, LensStateArgs},
    measure_args::MeasureCommand,
    paintings::CacheCommand,
    picture_args::PictureArgs,
    ranges,
    render_args::{CompareArgs, LightFieldArgs, RenderArgs, WorldCommand},
    scene::SceneCommand,
    scene_args::SceneFileArgs,
    show::ShowArgs,
    sweep::SweepArgs,
    video_args::TurnArgs,
};

/// Simulates a camera from the scene's spectral radiance to the final picture.
#[derive(Debug, Parser)]
#[command(name = "dioptric", version, propagate_version = true, max_term_width = 110)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Options of every command.
    #[command(flatten)]
    pub(crate) common: Common,
}

impl Cli {
    /// Returns the words of the program.
    pub(crate) fn words() -> clap::Command {
        with_examples(takes_negative_numbers(Self::command()))
    }

    /// Reads a command line, the name of the program first, with whether its numbers are in their ranges.
    pub(crate) fn read<T: Into<OsString> + Clone>(
        line: impl IntoIterator<Item = T>,
    ) -> Result<(Self, anyhow::Result<()>), clap::Error> {
        let mut words = Self::words();
        let mut matches = words.try_get_matches_from_mut(line)?;
        let in_range = ranges::check(&words, &matches);
        Ok((Self::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut words))?, in_range))
    }
}

/// Lets every option take a value that begins as a negative number does, as `-5`, `-1000/m` or `-1,2`, but files: whether it makes sense is for
/// those to say who know what it is.
fn takes_negative_numbers(command: clap::Command) -> clap::Command {
    let is_file = |arg: &Arg| arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    // An option whose value may be left out would take the next option for it.
    let takes_one = |arg: &Arg| {
        arg.get_long().is_some()
            && arg.get_action().takes_values()
            && arg.get_num_args().is_none_or(|n| n.min_values() > 0)
    };
    command
        .mut_args(|arg| if takes_one(&arg) && !is_file(&arg) { arg.allow_hyphen_values(true) } else { arg })
        .mut_subcommands(takes_negative_numbers)
}

/// What the options of a long help are grouped under.
mod heading {
    pub(super) const SCENE: &str = "Scene";
    pub(super) const LENS: &str = "Lens";
    pub(super) const FILM: &str = "Film and sensor";
    pub(super) const EXPOSURE: &str = "Exposure and picture";
    pub(super) const SIMULATION: &str = "Simulation";
    pub(super) const POINTS: &str = "Points";
    pub(super) const RESULTS: &str = "Results";
}

/// A command.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs the whole camera: scene, lens, sensor, picture; with no arguments, the built-in demo
    Run(Box<RunArgs>),
    /// Takes the frames of a camera that turns, each row at its own time
    Video(Box<VideoArgs>),
    /// Lists, describes, analyzes, draws and converts lenses
    #[command(subcommand)]
    Lens(LensCommand),
    /// Describes files of scenes, and makes spectral EXR of them
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Writes, describes and checks camera files
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Lists sensors, and writes and describes sensor files
    #[command(subcommand)]
    Sensor(SensorCommand),
    /// Lists and describes filters that go before a lens
    #[command(subcommand)]
    Filter(FilterCommand),
    /// Lists and describes glasses
    #[command(subcommand)]
    Glass(GlassCommand),
    /// Traces rays from a table through a lens
    Trace(TraceArgs),
    /// Computes point-spread functions over field, distance and wavelength
    Psf(PsfArgs),
    /// Renders a three-dimensional world: rays from the film through the lens, then sensor and picture
    Render(Box<RenderArgs>),
    /// Describes worlds
    #[command(subcommand)]
    World(WorldCommand),
    /// Renders the world of a camera file both ways and compares: rays from the film, and the view blurred
    Compare(CompareArgs),
    /// Takes a light field apart: views of the parts of the pupil, refocused pictures, depth
    #[command(name = "lightfield")]
    LightField(LightFieldArgs),
    /// Exposes a sensor to an irradiance image and processes the picture
    Sense(SenseArgs),
    /// Develops a raw file (DNG) of any camera as simulated frames are
    Develop(DevelopArgs),
    /// Views a picture as on a given display: the scene of its spectral radiance
    Show(ShowArgs),
    /// Takes many pictures of a varied camera from a plan, into a store that can be gone on with
    Sweep(SweepArgs),
    /// Measures pictures, frames and sensors as a laboratory does
    #[command(subcommand)]
    Measure(MeasureCommand),
    /// Opens the window in which anything of a camera is changed and its picture seen at once: the program dioptric-studio
    Studio(StudioArgs),
    /// Says what is kept from run to run, and removes it
    #[command(subcommand)]
    Cache(CacheCommand),
    /// Prints what completes these words in a shell: bash, elvish, fish, powershell or zsh
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Writes manual pages, one a command
    Man {
        /// Folder for the pages
        #[arg(long, short, value_name = "DIR", default_value = "man")]
        out: PathBuf,
    },
}

/// A camera to be changed in the window.
#[derive(Debug, Args)]
pub(crate) struct StudioArgs {
    /// The camera file; without it, the camera as it was left, or the demo
    pub(crate) camera: Option<PathBuf>,
}

/// How finely a picture is simulated.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum QualityKind {
    /// At most 160 columns and 4 bands: a thumbnail
    Sketch,
    /// At most 480 columns and 5 bands: at once
    Preview,
    /// At most 960 columns and 11 bands
    Draft,
    /// Every pixel and every band
    Full,
}

/// A run of the whole camera.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The camera file; without it, the built-in demo camera
    pub(crate) camera: Option<PathBuf>,
    /// Scene to photograph: spectral EXR, ENVI, .mat, .h5, .npy, .npz, TIFF stack, folder of band pictures, table of reflectances (.csv), or a picture
    #[arg(long, value_name = "FILE", help_heading = heading::SCENE)]
    pub(crate) scene: Option<PathBuf>,
    /// Folder for the results [default: dioptric-out; with --from DIR, DIR-changed]
    #[arg(long, short, value_name = "DIR", help_heading = heading::RESULTS)]
    pub(crate) out: Option<PathBuf>,
    /// Continues from the folder of a finished run: its camera, and its irradiance where no change touches it
    #[arg(long, value_name = "DIR", conflicts_with = "camera", help_heading = heading::RESULTS)]
    pub(crate) from: Option<PathBuf>,
    /// Continues a killed run to the same folder from the bands that it finished
    #[arg(long, conflicts_with = "from", help_heading = heading::RESULTS)]
    pub(crate) resume: bool,
    /// How finely the picture is simulated
    #[arg(long, value_name = "QUALITY", value_enum, default_value = "full", help_heading = heading::SIMULATION)]
    pub(crate) quality: QualityKind,
    /// Lens: a file, the name of a built-in one, thin:50mm:f2 or pinhole:0.1mm
    #[arg(long, value_name = "LENS", help_heading = heading::LENS)]
    pub(crate) lens: Option<String>,
    #[command(flatten)]
    pub(crate) state: LensStateArgs,
    #[command(flatten)]
    pub(crate) place: FilmArgs,
    /// Horizontal field of view of the scene, degrees
    #[arg(long, value_name = "A", help_heading = heading::SCENE)]
    pub(crate) fov_deg: Option<f64>,
    /// Depth of a scene that has none, m
    #[arg(long, value_name = "Z", help_heading = heading::SCENE)]
    pub(crate) depth_m: Option<f64>,
    /// Width of a flat scene from edge to edge, mm: a slide, a document, a wafer
    #[arg(long, value_name = "W", requires = "distance_mm", conflicts_with_all = ["fov_deg", "depth_m"], help_heading = heading::SCENE)]
    pub(crate) width_mm: Option<f64>,
    /// Distance of a flat scene from the first vertex of the lens, mm
    #[arg(long, value_name = "D", requires = "width_mm", help_heading = heading::SCENE)]
    pub(crate) distance_mm: Option<f64>,
    /// What lies behind the first surface of the scene's file: a file of radiance and depth of the same samples
    #[arg(long, value_name = "FILE", help_heading = heading::SCENE)]
    pub(crate) hidden: Option<PathBuf>,
    /// Points that shine beside the scene, a table (.csv): `x_deg`, `y_deg` or `x_mm`, `y_mm`; magnitude, lux, candela or `w_per_sr`; `depth_m`, light
    #[arg(long, value_name = "FILE", help_heading = heading::SCENE)]
    pub(crate) points: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scene_file: SceneFileArgs,
    /// Light to put the scene under: A, D50, D55, D65, D75, E, FL2, FL11, LED-B3, a temperature (3200K), a chromaticity
    /// (0.46,0.414) or a CSV file of its spectrum; scenes of unknown light cannot be relit
    #[arg(long, value_name = "LIGHT", help_heading = heading::SCENE)]
    pub(crate) illuminant: Option<String>,
    /// Illuminance on the scene, or of a picture's white, lux
    #[arg(long, value_name = "LUX", help_heading = heading::SCENE)]
    pub(crate) illuminance_lux: Option<f64>,
    /// Scales the radiance to this mean luminance, cd/m²
    #[arg(long, alias = "mean-luminance", value_name = "L", help_heading = heading::SCENE)]
    pub(crate) mean_luminance_cd_m2: Option<f64>,
    /// Scales the light of the scene so that the film gets this illuminance on average, lux
    #[arg(long, value_name = "LUX", conflicts_with = "mean_luminance_cd_m2", help_heading = heading::SCENE)]
    pub(crate) mean_lux: Option<f64>,
    /// Light that is on a scene of radiance whose file does not state it, as --illuminant has it
    #[arg(long, value_name = "LIGHT", help_heading = heading::SCENE)]
    pub(crate) scene_light: Option<String>,
    /// Sensor, a file or the name of a built-in one
    #[arg(long, value_name = "SENSOR", help_heading = heading::FILM)]
    pub(crate) sensor: Option<String>,
    /// Size of the film: that of the sensor, or what the scene covers of it, or a pixel for each sample of the scene [default: with --sensor
    /// 'field', and 'sensor' before the still life and worlds; else that of the camera]
    #[arg(long, value_name = "SIZE", value_enum, conflicts_with_all = ["pixels", "pixel_um"], help_heading = heading::FILM)]
    pub(crate) film: Option<FilmKind>,
    /// Pixels of the film, e.g. 640x480; without --pixel-um the film stays as large as it is [default: those of the camera]
    #[arg(long, value_name = "WxH", help_heading = heading::FILM)]
    pub(crate) pixels: Option<String>,
    /// Distance between pixels, µm; without --pixels the film stays as large as it is [default: that of the camera]
    #[arg(long, value_name = "P", help_heading = heading::FILM)]
    pub(crate) pixel_um: Option<f64>,
    /// Part of the film to simulate in place of all of it: first column and row, columns and rows, e.g. 100,80,64,48
    #[arg(long, value_name = "X,Y,W,H", help_heading = heading::FILM)]
    pub(crate) crop: Option<Crop>,
    /// Reads the photodiodes below each microlens one by one: 'left-right', 'top-bottom' or 'quad', with crosstalk and transition in degrees if
    /// they are to be others than 'left-right:0.05:3'; 'none' for whole pixels [default: none]
    #[arg(long, value_name = "KIND", value_parser = parse_dual_pixel, help_heading = heading::FILM)]
    pub(crate) dual_pixel: Option<DualPixelArg>,
    /// Exposure time, s [default: automatic]
    #[arg(long, value_name = "T", help_heading = heading::EXPOSURE)]
    pub(crate) exposure_s: Option<f64>,
    #[command(flatten)]
    pub(crate) frames: FrameArgs,
    /// Diffraction at the stop
    #[arg(long, value_name = "KIND", value_enum, help_heading = heading::SIMULATION)]
    pub(crate) diffraction: Option<DiffractionKind>,
    /// Strength γ of ray bending, in place of that of its kind
    #[arg(long, value_name = "G", help_heading = heading::SIMULATION)]
    pub(crate) gamma: Option<f64>,
    /// Point spread functions of a file (.npz) in place of those of the lens, as `psf LENS -o F.npz` writes them; 'none' for the lens's own
    #[arg(long, value_name = "F.npz", help_heading = heading::SIMULATION)]
    pub(crate) psfs: Option<PathBuf>,
    /// Light that surfaces of the lens reflect: 'off', it is left out; 'ghosts', what two of them reflect, once each, falls on the film;
    /// 'film:0.1', the film is one of them, a mirror of 10 % [default: off]
    #[arg(long, value_name = "KIND", help_heading = heading::SIMULATION)]
    pub(crate) lens_reflections: Option<LensReflections>,
    /// Of older command lines, ignored: point spreads are no longer sampled
    #[arg(long, value_name = "KIND", hide = true)]
    pub(crate) bank: Option<String>,
    /// The same
    #[arg(long, value_name = "E", hide = true)]
    pub(crate) bank_error: Option<f64>,
    /// How the scene is blurred: 'layered', in layers of depth of which near ones hide far ones; 'views:N', such layers through N parts of the
    /// pupil, for occluders narrower than it; 'pointwise', every sample on its own, as in the paper [default: layered]
    #[arg(long, value_name = "MODE", help_heading = heading::SIMULATION)]
    pub(crate) blur: Option<BlurSpec>,
    /// What lies beyond the edges of the scene, for the blur near them: 'hold', its outermost samples go on; 'mirror'; 'black' [default: hold]
    #[arg(long, value_name = "KIND", help_heading = heading::SIMULATION)]
    pub(crate) border: Option<BorderSpec>,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
}

/// A video to take.
#[derive(Debug, Args)]
pub(crate) struct VideoArgs {
    #[command(flatten)]
    pub(crate) camera: RunArgs,
    #[command(flatten)]
    pub(crate) turn: TurnArgs,
}

/// Photodiodes that are read one by one, or whole pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DualPixelArg(pub(crate) Option<DualPixelSpec>);

fn parse_dual_pixel(text: &str) -> Result<DualPixelArg, PipelineError> {
    if text == "none" { Ok(DualPixelArg(None)) } else { text.parse().map(|spec| DualPixelArg(Some(spec))) }
}

/// How large the film is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FilmKind {
    /// The pixels of the sensor
    Sensor,
    /// The pixels of the sensor, as many as the scene's field covers
    Field,
    /// As many pixels as the scene has samples, which see the scene's field
    Scene,
}

/// Which exposures are taken, and which files are written of them.
#[derive(Debug, Args)]
pub(crate) struct FrameArgs {
    /// Puts a filter before the lens: a built-in one (`filter list`), a file, nd:0.9, polarizer, polarizers:60, longpass:590nm, shortpass:650nm,
    /// bandpass:550nm:40nm or glass:N-BK7:3mm; once for each of several
    #[arg(long = "filter", value_name = "FILTER", help_heading = heading::FILM)]
    pub(crate) filters: Vec<FilterSpec>,
    /// Takes so many frames and merges them
    #[arg(long, value_name = "N", conflicts_with = "bracket_stops", help_heading = heading::EXPOSURE)]
    pub(crate) burst: Option<usize>,
    /// Moves the camera between the frames of a burst, at the last one by so many pixels; they are aligned and merged where they
    /// agree
    #[arg(long, value_name = "P", requires = "burst", help_heading = heading::EXPOSURE)]
    pub(crate) burst_motion_px: Option<f64>,
    /// Takes exposures that differ by powers of two and merges them, e.g. -4,-2,0
    #[arg(long, value_name = "LIST", help_heading = heading::EXPOSURE)]
    pub(crate) bracket_stops: Option<String>,
    /// Reads each pixel of the frame with both gains of a dual-gain sensor, or of one with an overflow capacitor (LOFIC), and merges them
    #[arg(long, conflicts_with_all = ["burst", "bracket_stops", "interleaved_ratio", "interleaved_gain_ratio", "interleaved_rows"], help_heading = heading::EXPOSURE)]
    pub(crate) both_gains: bool,
    /// Exposes rows for the chosen time and for one so many times shorter in turn, and merges them
    #[arg(long, value_name = "R", conflicts_with_all = ["burst", "bracket_stops"], help_heading = heading::EXPOSURE)]
    pub(crate) interleaved_ratio: Option<f64>,
    /// Reads rows with the chosen analog gain and with one so many times lower in turn, and merges them; with --interleaved-ratio both differ
    #[arg(long, value_name = "G", conflicts_with_all = ["burst", "bracket_stops"], help_heading = heading::EXPOSURE)]
    pub(crate) interleaved_gain_ratio: Option<f64>,
    /// How many neighboring rows share time and gain [default: 2]
    #[arg(long, value_name = "N", help_heading = heading::EXPOSURE)]
    pub(crate) interleaved_rows: Option<usize>,
    /// Writes these files too: electrons, raw-tiff, raw-dng, picture-png16, picture-tiff8, picture-tiff16, picture-exr
    #[arg(long, value_name = "LIST", help_heading = heading::RESULTS)]
    pub(crate) also: Option<String>,
    /// How EXR files hold their samples: single (floats, compressed without loss), half (floats, a quarter of the size, off by at
    /// most .05 %) or uncompressed [default: single]
    #[arg(long, value_name = "KIND", help_heading = heading::RESULTS)]
    pub(crate) exr_samples: Option<ExrSamples>,
    /// Switches noise on: all, none, or a list of photon, dark-current, read, reset, row, prnu, dsnu, column, defects, telegraph;
    /// all,-NAME leaves one out [default: all]
    #[arg(long, value_name = "LIST", help_heading = heading::EXPOSURE)]
    pub(crate) noise: Option<String>,
    /// Factor on the voltage after the pixel [default: 1]
    #[arg(long, value_name = "G", help_heading = heading::EXPOSURE)]
    pub(crate) analog_gain: Option<f64>,
    /// Readout of dual-gain pixels: low or high [default: low]
    #[arg(long, value_name = "MODE", help_heading = heading::EXPOSURE)]
    pub(crate) gain_mode: Option<String>,
    /// Reads so many pixels of one filter each way as one: charge:2 (electrons summed before they are read), voltage:2 (the mean after the source
    /// followers), digital:2 (numbers summed), none [default: none]
    #[arg(long, value_name = "KIND:N", help_heading = heading::EXPOSURE)]
    pub(crate) binning: Option<String>,
    /// Temperature of the chip, °C [default: 25]
    #[arg(long, value_name = "C", help_heading = heading::EXPOSURE)]
    pub(crate) temperature_c: Option<f64>,
    /// What an automatic exposure looks at: mean, center, peak, percentile:99 (of all pixels) or filters:99 (of each filter's pixels, of which the
    /// brightest counts) [default: percentile:99]
    #[arg(long, value_name = "METERING", help_heading = heading::EXPOSURE)]
    pub(crate) metering: Option<String>,
    /// Which chip of its kind the sensor is, a seed: of PRNU, DSNU, columns and defects [default: 0]
    #[arg(long, value_name = "N", help_heading = heading::EXPOSURE)]
    pub(crate) chip_seed: Option<u64>,
    #[command(flatten)]
    pub(crate) picture: PictureArgs,
}

/// A raw file to be developed.
#[derive(Debug, Args)]
pub(crate) struct DevelopArgs {
    /// Raw frame, DNG: a mosaic or linear planes of 8 to 16 bits or floats, plain, deflated, as JPEG or JPEG XL
    pub(crate) raw: PathBuf,
    /// Takes the frame as the sensor gave it: without the corrections that the file asks for (opcodes: gains, bad pixels, distortion)
    #[arg(long, help_heading = heading::EXPOSURE)]
    pub(crate) ignore_opcodes: bool,
    /// How far the profile of the file makes the picture [default: colors]
    #[arg(long, value_enum, hide_possible_values = false, help_heading = heading::EXPOSURE)]
    pub(crate) rendering: Option<RenderingKind>,
    /// Camera profile in place of the file's own: a DCP file, or a DNG file whose profile is taken
    #[arg(long, value_name = "FILE", help_heading = heading::EXPOSURE)]
    pub(crate) profile: Option<PathBuf>,
    /// What stands for darkness: stated (the file's black level), masked (the mean of its masked pixels, which have dark current too)
    /// [default: stated]
    #[arg(long, value_name = "KIND", help_heading = heading::EXPOSURE)]
    pub(crate) black: Option<String>,
    /// Folder for the results
    #[arg(long, short, value_name = "DIR", help_heading = heading::RESULTS)]
    pub(crate) out: PathBuf,
    /// Camera file whose `processing` is used [default: that of the program]
    #[arg(long, value_name = "FILE", help_heading = heading::EXPOSURE)]
    pub(crate) camera: Option<PathBuf>,
    /// Writes these files too: picture-png16, picture-tiff8, picture-tiff16
    #[arg(long, value_name = "LIST", help_heading = heading::RESULTS)]
    pub(crate) also: Option<String>,
    #[command(flatten)]
    pub(crate) picture: PictureArgs,
}

/// How far the profile of a raw file makes its picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RenderingKind {
    /// By its color matrices alone
    Matrices,
    /// Also by its map of hues and saturations
    Colors,
    /// Also as bright as it asks, with its look table and its tone curve
    Look,
}

impl From<RenderingKind> for DngRendering {
    fn from(kind: RenderingKind) -> Self {
        match kind {
            RenderingKind::Matrices => Self::Matrices,
            RenderingKind::Colors => Self::Colors,
            RenderingKind::Look => Self::Look,
        }
    }
}

/// What diffraction to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DiffractionKind {
    /// Rays only
    None,
    /// Heisenberg-uncertainty ray bending, γ = 1 (the paper, Freniere)
    Hurb,
    /// Heisenberg-uncertainty ray bending, γ = √2 (`Scene3D` since 2015)
    HurbScene3d,
    /// Ray bending with constants fitted to Airy's pattern
    HurbCalibrated,
    /// The diffraction integral while the blur is small enough for it, HURB (γ = 1) beyond
    Wave,
}

/// Rays to trace.
#[derive(Debug, Args)]
pub(crate) struct TraceArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    /// Table of rays with the columns `x_mm,y_mm,z_mm,l,m,n,wavelength_nm`
    #[arg(long, value_name = "IN.csv")]
    pub(crate) rays: PathBuf,
    /// Table to write [default: standard output]
    #[arg(long, short, value_name = "OUT.csv")]
    pub(crate) output: Option<PathBuf>,
    /// Also takes the rays to a film this far behind the last vertex, mm, curved as the lens file says
    #[arg(long, value_name = "D")]
    pub(crate) film_mm: Option<f64>,
    /// Ignores the rims of the surfaces
    #[arg(long)]
    pub(crate) no_clip: bool,
}

/// Point-spread functions to compute.
#[derive(Debug, Args)]
pub(crate) struct PsfArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    /// Field angles, degrees: to the right as 0,10, along x and y as 5/10, or from the axis and about it as 100@30 [default: those of
    /// the lens's file, else 0]
    #[arg(long, value_name = "LIST", help_heading = heading::POINTS)]
    pub(crate) fields_deg: Option<String>,
    /// How far above the axis all of these fields lie, degrees
    #[arg(long, value_name = "A", default_value_t = 0.0, help_heading = heading::POINTS)]
    pub(crate) field_y_deg: f64,
    /// Distances of the points from the first vertex, mm; inf for a star [default: that of the lens's file, else that of --focus-mm, else inf]
    #[arg(long, value_name = "LIST", help_heading = heading::POINTS)]
    pub(crate) distances_mm: Option<String>,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
    #[command(flatten)]
    pub(crate) film: LensFilmArgs,
    /// Diffraction at the stop
    #[arg(long, value_name = "KIND", value_enum, default_value_t = DiffractionKind::None, help_heading = heading::SIMULATION)]
    pub(crate) diffraction: DiffractionKind,
    /// Strength γ of ray bending, in place of that of its kind
    #[arg(long, value_name = "G", help_heading = heading::SIMULATION)]
    pub(crate) gamma: Option<f64>,
    /// Pixel of the pictures and of the metrics, µm
    #[arg(long, value_name = "P", default_value_t = 1.0, help_heading = heading::RESULTS)]
    pub(crate) pixel_um: f64,
    /// Width and height of the pictures, pixels [default: to hold the spot]
    #[arg(long, value_name = "N", help_heading = heading::RESULTS)]
    pub(crate) size: Option<usize>,
    /// Point spread functions of a file (.npz) in place of those of the lens
    #[arg(long, value_name = "F.npz", conflicts_with = "mode", help_heading = heading::SIMULATION)]
    pub(crate) psfs: Option<PathBuf>,
    /// How the light is sampled
    #[arg(long, value_name = "MODE", value_enum, default_value_t = PsfMode::Pupil, help_heading = heading::SIMULATION)]
    pub(crate) mode: PsfMode,
    /// Rays along the side of the paper mode's square grid
    #[arg(long, value_name = "N", default_value_t = 201, help_heading = heading::SIMULATION)]
    pub(crate) rays: usize,
    /// Keeps the paper mode's rays on the exact grid, which beats with the pixels; without it each is moved by up to half a step, drawn from --seed
    #[arg(long, help_heading = heading::SIMULATION)]
    pub(crate) exact_grid: bool,
    /// Of older command lines, ignored: each point is traced
    #[arg(long, value_name = "KIND", hide = true)]
    pub(crate) bank: Option<String>,
    /// The same
    #[arg(long, value_name = "E", hide = true)]
    pub(crate) bank_error: Option<f64>,
    /// Adds MTF tables at these frequencies, cycles/mm
    #[arg(long, value_name = "LIST", help_heading = heading::RESULTS)]
    pub(crate) mtf_per_mm: Option<String>,
    /// Writes the pictures: an EXR with a layer a PSF, a PNG mosaic, or an archive of arrays (.npz) for `run --psfs`
    #[arg(long, short, value_name = "F", help_heading = heading::RESULTS)]
    pub(crate) output: Option<PathBuf>,
    /// Writes the table as CSV
    #[arg(long, value_name = "F", help_heading = heading::RESULTS)]
    pub(crate) csv: Option<PathBuf>,
    /// Writes plots into this folder: line and edge spread, MTF, encircled and ensquared energy, MTF through focus;
    /// SVG and the lines as CSV; PNG too in a build with the feature png; and a page with pictures, plots and numbers, report.html
    #[arg(long, value_name = "DIR", help_heading = heading::RESULTS)]
    pub(crate) plots: Option<PathBuf>,
    /// Adds a row for the light of all wavelengths together to those of each point
    #[arg(long, alias = "whole-light", help_heading = heading::POINTS)]
    pub(crate) polychromatic: bool,
    /// Weights of the wavelengths in the light of all together: rows, plots and mosaic [default: all alike]
    #[arg(long, value_name = "LIST", help_heading = heading::POINTS)]
    pub(crate) spectral_weights: Option<String>,
}

/// How a point-spread function is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PsfMode {
    /// Rays through the entrance pupil, exact rasteriser
    Pupil,
    /// The paper's: rays on a square grid over the front rim, counted a pixel
    Paper,
}

/// A sensor to expose.
#[derive(Debug, Args)]
pub(crate) struct SenseArgs {
    /// Spectral irradiance: EXR, or an optical image of `ISETCam` (.mat)
    pub(crate) irradiance: PathBuf,
    /// Sensor, a file or the name of a built-in one
    #[arg(long, value_name = "SENSOR", help_heading = heading::FILM)]
    pub(crate) sensor: String,
    /// Distance between the sensor's pixels, µm [default: the sensor's own]; that of the image's samples makes each a pixel
    #[arg(long, value_name = "P", help_heading = heading::FILM)]
    pub(crate) pixel_um: Option<f64>,
    /// Folder for the results
    #[arg(long, short, value_name = "DIR", help_heading = heading::RESULTS)]
    pub(crate) out: PathBuf,
    /// Exposure time, s [default: automatic]
    #[arg(long, value_name = "T", help_heading = heading::EXPOSURE)]
    pub(crate) exposure_s: Option<f64>,
    /// Distance of the exit pupil from the sensor, mm, for the chief-ray angle [default: light along the axis]
    #[arg(long, value_name = "D", help_heading = heading::FILM)]
    pub(crate) exit_pupil_mm: Option<f64>,
    /// The f-number of the cone of light on the sensor, for pixels whose data sheet states a `pixel_stack` [default: collimated light]
    #[arg(long, value_name = "N", help_heading = heading::FILM)]
    pub(crate) f_number: Option<f64>,
    /// The light on the scene, which is made white: a name, a temperature, a chromaticity or a CSV file, as for `run`
    /// [default: unknown]
    #[arg(long, value_name = "LIGHT", help_heading = heading::EXPOSURE)]
    pub(crate) illuminant: Option<String>,
    #[command(flatten)]
    pub(crate) frames: FrameArgs,
}
