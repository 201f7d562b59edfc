//! The words of `dioptric measure`, and nothing else.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// Something to measure.
#[derive(Debug, Subcommand)]
pub(crate) enum MeasureCommand {
    /// Spatial frequency response of a slanted edge: SFR, MTF50, MTF50P of each channel
    Mtf(MtfArgs),
    /// Response of a texture (dead leaves, IEEE 1858) by its power and by a reference: MTF50, acutance of each channel
    Texture(TextureArgs),
    /// Pictures of points: centroid, second moments, encircled energy
    Spot(SpotArgs),
    /// Response of a Siemens star, sinusoidal or black and white: MTF50, MTF10 of each channel and segment
    Star(StarArgs),
    /// Distortion (ISO 17850) and lateral color (ISO 19084) of a grid of dots
    Grid(GridArgs),
    /// Shading of an even plane in luminance and color (ISO 17957)
    Shading(ShadingArgs),
    /// Gray steps of known luminance: conversion (ISO 14524), noise and dynamic range (ISO 15739)
    Steps(StepsArgs),
    /// Numbers of a region: mean, noise, percentiles, uniformity, profiles, color
    Region(RegionArgs),
    /// Photon transfer after EMVA 1288, of flat and dark frames or of a sensor on a simulated bench
    Noise(NoiseArgs),
    /// Colors of a 24-patch chart (ΔE00), or two pictures compared (S-CIELAB, VSNR, PSNR, SSIM)
    #[command(alias = "colour")]
    Color(ColorArgs),
}

/// How a picture is read and where results go.
#[derive(Debug, Args)]
pub(crate) struct PictureArgs {
    /// How samples stand for light
    #[arg(long, value_name = "KIND", value_enum, default_value_t = CurveKind::ByFile)]
    pub(crate) curve: CurveKind,
    /// Folder for a page (report.html), the numbers as JSON and the plots as SVG; as PNG too in a build with the feature png
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// How samples stand for light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CurveKind {
    /// Linear for 16-bit gray, EXR and DNG; for everything else the curve that the file states, or sRGB
    ByFile,
    /// Linear
    Linear,
    /// The curve of sRGB
    Srgb,
}

/// A slanted edge.
#[derive(Debug, Args)]
pub(crate) struct MtfArgs {
    /// Picture or raw frame: PNG, TIFF, JPEG, EXR, or DNG, whose mosaic is its own; several, or a folder of them, are measured one by one, a row
    /// each
    #[arg(required = true, value_name = "PICTURE")]
    pub(crate) pictures: Vec<PathBuf>,
    /// Where the edge is, pixels [default: the most edge-like square of the picture]
    #[arg(long, value_name = "x,y,w,h")]
    pub(crate) region: Option<String>,
    /// Side of the square that is looked for, pixels [default: 64 samples of a channel, more where noise asks for it]
    #[arg(long, value_name = "N", conflicts_with = "region")]
    pub(crate) size: Option<usize>,
    /// Measure every slanted edge of the picture: the response over the field
    #[arg(long, conflicts_with = "region")]
    pub(crate) all: bool,
    /// Mosaic of a raw frame, a letter a filter from the top left pixel on, e.g. RGGB
    #[arg(long, value_name = "LETTERS")]
    pub(crate) mosaic: Option<String>,
    /// Distance between pixels, µm, for cycles/mm
    #[arg(long, value_name = "P")]
    pub(crate) pixel_um: Option<f64>,
    /// Pixels a degree of the viewer's field, for acutance and square-root integral [default: 60]
    #[arg(long, value_name = "N")]
    pub(crate) pixels_per_degree: Option<f64>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// A texture.
#[derive(Debug, Args)]
pub(crate) struct TextureArgs {
    /// Picture of the texture: PNG, TIFF, JPEG, EXR
    pub(crate) picture: PathBuf,
    /// Picture of the same framing by an ideal camera, which the texture is compared with
    #[arg(long, value_name = "PICTURE")]
    pub(crate) reference: PathBuf,
    /// Where the texture is in both, pixels [default: all of the picture]
    #[arg(long, value_name = "x,y,w,h")]
    pub(crate) region: Option<String>,
    /// An even patch of the picture, whose noise power is subtracted from that of the texture
    #[arg(long, value_name = "x,y,w,h", conflicts_with = "second_frame")]
    pub(crate) flat: Option<String>,
    /// Another frame of the same camera, whose difference is the temporal noise, which is subtracted
    #[arg(long, value_name = "PICTURE")]
    pub(crate) second_frame: Option<PathBuf>,
    /// Pixels a degree of the viewer's field, for acutance [default: 60]
    #[arg(long, value_name = "N")]
    pub(crate) pixels_per_degree: Option<f64>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// Pictures of points.
#[derive(Debug, Args)]
pub(crate) struct SpotArgs {
    /// Picture: PNG, TIFF, JPEG, EXR
    pub(crate) picture: PathBuf,
    /// Side of the window about each point, an odd number of pixels [default: half way to its neighbors]
    #[arg(long, value_name = "N")]
    pub(crate) window: Option<usize>,
    /// Distance between pixels, µm; at 1, lengths are in pixels
    #[arg(long, value_name = "P", default_value_t = 1.0)]
    pub(crate) pixel_um: f64,
    /// Light between the points, highest code 1 [default: the median of the picture]
    #[arg(long, value_name = "L")]
    pub(crate) background: Option<f64>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// A Siemens star.
#[derive(Debug, Args)]
pub(crate) struct StarArgs {
    /// Picture: PNG, TIFF, JPEG, EXR
    pub(crate) picture: PathBuf,
    /// The square about the star, pixels [default: all of the picture]
    #[arg(long, value_name = "x,y,w,h")]
    pub(crate) region: Option<String>,
    /// Cycles of the star, 8 to 360 [default: the strongest wave about its center]
    #[arg(long, value_name = "N")]
    pub(crate) cycles: Option<usize>,
    /// The star is black and white, not sinusoidal
    #[arg(long)]
    pub(crate) binary: bool,
    /// Modulation of the star itself, (most − least) / (most + least) [default: the response is 1 at the coarsest ring]
    #[arg(long, value_name = "M")]
    pub(crate) modulation: Option<f64>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// A grid of dots.
#[derive(Debug, Args)]
pub(crate) struct GridArgs {
    /// Picture of dots, brighter or darker than what lies between them: PNG, TIFF, JPEG, EXR
    pub(crate) picture: PathBuf,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// An even plane.
#[derive(Debug, Args)]
pub(crate) struct ShadingArgs {
    /// Picture or raw frame of an even plane: PNG, TIFF, JPEG, EXR, DNG
    pub(crate) picture: PathBuf,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// Gray steps.
#[derive(Debug, Args)]
pub(crate) struct StepsArgs {
    /// Picture or raw frame of the steps: PNG, TIFF, JPEG, EXR, DNG
    pub(crate) picture: PathBuf,
    /// Table of the steps: a header x,y,w,h,luminance and a line a step, pixels and cd/m² or any unit that all share
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) steps: PathBuf,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// A region.
#[derive(Debug, Args)]
pub(crate) struct RegionArgs {
    /// Picture, raw frame, volts, spectral scene or irradiance: PNG, TIFF, JPEG, DNG, EXR
    pub(crate) picture: PathBuf,
    /// The region, pixels [default: all of the picture]
    #[arg(long, value_name = "x,y,w,h")]
    pub(crate) region: Option<String>,
    /// A region of the same file whose color it is compared with; of a spectral file it is the white
    #[arg(long, value_name = "x,y,w,h")]
    pub(crate) reference: Option<String>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}

/// Flat and dark frames, or a sensor.
#[derive(Debug, Args)]
pub(crate) struct NoiseArgs {
    /// Flat and dark frames, 16-bit PNG or TIFF, or DNG: an EMVA descriptor file, or a folder with descriptor.txt or with
    /// dark-0.png, dark-1.png, flat-01-0.png, flat-01-1.png …
    #[arg(required_unless_present = "sensor", conflicts_with = "sensor")]
    pub(crate) frames: Option<PathBuf>,
    /// Sensor to put on a simulated bench, a file or the name of a built-in one
    #[arg(long, value_name = "SENSOR")]
    pub(crate) sensor: Option<String>,
    /// Filter of the sensor [default: the one that sees the light best]
    #[arg(long, value_name = "NAME", requires = "sensor")]
    pub(crate) filter: Option<String>,
    /// Wavelength of the light, nm [default: 550]
    #[arg(long, value_name = "W", requires = "sensor")]
    pub(crate) wavelength_nm: Option<f64>,
    /// Side of the square of pixels [default: 512]
    #[arg(long, value_name = "N", requires = "sensor")]
    pub(crate) size: Option<usize>,
    /// Levels of light, two frames each [default: 40]
    #[arg(long, value_name = "N", requires = "sensor")]
    pub(crate) levels: Option<usize>,
    /// Frames of the stacks that show DSNU and PRNU [default: 64]
    #[arg(long, value_name = "N", requires = "sensor")]
    pub(crate) stack: Option<usize>,
    /// Exposure time, s [default: 0.01]
    #[arg(long, value_name = "T", requires = "sensor")]
    pub(crate) exposure_s: Option<f64>,
    /// Factor on the voltage [default: 1]
    #[arg(long, value_name = "G", requires = "sensor")]
    pub(crate) analog_gain: Option<f64>,
    /// Reads so many pixels each way as one: charge:2, voltage:2, digital:2, none [default: none]
    #[arg(long, value_name = "KIND:N", requires = "sensor")]
    pub(crate) binning: Option<String>,
    /// Temperature of the chip, °C [default: 25]
    #[arg(long, value_name = "C", requires = "sensor")]
    pub(crate) temperature_c: Option<f64>,
    /// Keeps the frames as 16-bit PNG with a descriptor in this folder
    #[arg(long, value_name = "DIR", requires = "sensor")]
    pub(crate) keep_frames: Option<PathBuf>,
    /// Folder for a page (report.html), the numbers as JSON and the plots as SVG; as PNG too in a build with the feature png
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// A chart, or two pictures.
#[derive(Debug, Args)]
pub(crate) struct ColorArgs {
    /// Picture: PNG, TIFF, JPEG, EXR
    pub(crate) picture: PathBuf,
    /// Corners of the chart, clockwise from the one beside dark skin, pixels [default: found in the picture]
    #[arg(long, value_name = "x1,y1,…,x4,y4", conflicts_with = "against")]
    pub(crate) corners: Option<String>,
    /// Light on the chart: A, D50, D55, D65, D75, E, FL2, FL11, LED-B3 [default: D65]
    #[arg(long, value_name = "NAME", conflicts_with = "against")]
    pub(crate) illuminant: Option<String>,
    /// Compares with this picture instead
    #[arg(long, value_name = "PICTURE")]
    pub(crate) against: Option<PathBuf>,
    /// Pixels a degree of the viewer's field, for S-CIELAB and VSNR
    #[arg(long, value_name = "N", default_value_t = 60.0)]
    pub(crate) pixels_per_degree: f64,
    /// Sees both pictures on a display in place of that: a RON file or srgb, display-p3, rec2020, apple-studio
    #[arg(long, value_name = "DISPLAY", requires = "against", conflicts_with = "pixels_per_degree")]
    pub(crate) display: Option<String>,
    /// How far away the display is, m
    #[arg(long, value_name = "D", default_value_t = 0.6, requires = "display")]
    pub(crate) distance_m: f64,
    /// An even patch, whose visual SNR is measured
    #[arg(long, value_name = "x,y,w,h", requires = "against")]
    pub(crate) patch: Option<String>,
    /// The picture and the results
    #[command(flatten)]
    pub(crate) picture_args: PictureArgs,
}
