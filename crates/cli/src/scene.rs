//! `dioptric scene`: what a file of a scene holds, and spectral EXR or a file of ISETCam of it.

use std::{fmt::Write as _, path::PathBuf};

use clap::{Args, Subcommand};
use dioptric_pipeline::{
    Crop, ExrSamples, SceneInfo, SceneRequest, SceneSpec, convert_irradiance, parse_illuminant, parse_numbers,
};

use crate::{
    common::Common,
    lens::tell,
    scene_args::SceneFileArgs,
    terminal::{print, print_json},
};

/// What to do with a file of a scene.
#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// Says what a file of a scene holds, how it is understood and what of it is not used
    Info(SceneInfoArgs),
    /// Writes a scene, or a part of it, as spectral EXR or for ISETCam; a file of irradiance as well
    Convert(SceneConvertArgs),
}

/// A file of a scene, and what of it is wanted.
#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// Scene: spectral EXR, ENVI, .mat, .h5, .npy, .npz, TIFF stack, folder of band pictures, table of reflectances (.csv), or a picture
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) says: SceneFileArgs,
    /// Horizontal field of view, degrees
    #[arg(long, value_name = "A")]
    pub(crate) fov_deg: Option<f64>,
    /// Depth of a scene that has none, m
    #[arg(long, value_name = "Z")]
    pub(crate) depth_m: Option<f64>,
    /// Light that reflectances and pictures are put under, as of `run` [default: D65; pictures keep their own]
    #[arg(long, value_name = "LIGHT")]
    pub(crate) illuminant: Option<String>,
    /// Illuminance on it, or of a picture's white, lux [default: 1000]
    #[arg(long, value_name = "LUX")]
    pub(crate) illuminance_lux: Option<f64>,
    /// Scales the radiance to this mean luminance, cd/m²
    #[arg(long, alias = "mean-luminance", value_name = "L")]
    pub(crate) mean_luminance_cd_m2: Option<f64>,
    /// Bands wanted, nm: a list or first:last:step [default: those of the file]
    #[arg(long, value_name = "LIST")]
    pub(crate) wavelengths_nm: Option<String>,
    /// Part that is wanted: first column and row, columns and rows
    #[arg(long, value_name = "X,Y,W,H")]
    pub(crate) crop: Option<Crop>,
    /// Averages so many samples into one, each way
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) bin: usize,
    /// Turns it clockwise: 90, 180 or 270
    #[arg(long, value_name = "A", default_value_t = 0)]
    pub(crate) rotate_deg: usize,
}

/// A file to be described.
#[derive(Debug, Args)]
pub(crate) struct SceneInfoArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Picture of the scene to write, PNG
    #[arg(long, short, value_name = "F.png")]
    pub(crate) out: Option<PathBuf>,
}

/// A file to be written as spectral EXR.
#[derive(Debug, Args)]
pub(crate) struct SceneConvertArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Scene to write: spectral radiance with depth and view, EXR; or .mat, as ISETCam has it
    #[arg(value_name = "OUT.exr")]
    pub(crate) out: PathBuf,
    /// How an EXR file holds its samples: single, half or uncompressed [default: single]
    #[arg(long, value_name = "KIND")]
    pub(crate) exr_samples: Option<ExrSamples>,
}

/// With less memory hardly any file can be read.
const LEAST_BYTES: u64 = 60_000_000;

pub(crate) fn run(command: &SceneCommand, common: &Common) -> anyhow::Result<()> {
    anyhow::ensure!(
        common.memory.is_none_or(|bytes| bytes >= LEAST_BYTES),
        "--memory is {} MB, expected 60 MB or more: the program itself takes most of that",
        common.memory.unwrap_or_default() / 1_000_000
    );
    let info = match command {
        SceneCommand::Info(arguments) => request(&arguments.scene)?.describe(arguments.out.as_deref())?,
        SceneCommand::Convert(arguments) => {
            if let Some(notes) = convert_irradiance(&request(&arguments.scene)?, &arguments.out, arguments.exr_samples)?
            {
                tell(&notes, common);
                return Ok(());
            }
            let info = request(&arguments.scene)?.convert(&arguments.out, arguments.exr_samples)?;
            if !common.json {
                tell(&[vec![info.understood.clone()], info.notes.clone()].concat(), common);
                return Ok(());
            }
            info
        }
    };
    match (common.json, common.quiet) {
        (true, _) => print_json(&info),
        (false, _) => print(&table(&info)),
    }
}

fn request(arguments: &SceneArgs) -> anyhow::Result<SceneRequest> {
    let mut scene = SceneSpec::of_file(arguments.file.clone());
    arguments.says.change(&mut scene)?;
    scene.field_of_view_deg = arguments.fov_deg;
    scene.depth_m = arguments.depth_m;
    scene.illuminance_lux = arguments.illuminance_lux;
    scene.mean_luminance_cd_m2 = arguments.mean_luminance_cd_m2;
    scene.illuminant = arguments.illuminant.as_deref().map(parse_illuminant).transpose()?;
    let wavelengths_nm =
        arguments.wavelengths_nm.as_deref().map(|list| parse_numbers("--wavelengths-nm", list)).transpose()?;
    if !arguments.rotate_deg.is_multiple_of(90) {
        anyhow::bail!("--rotate-deg is {}, expected 90, 180 or 270", arguments.rotate_deg);
    }
    Ok(SceneRequest {
        scene,
        wavelengths_nm,
        crop: arguments.crop,
        bin: arguments.bin,
        quarter_turns: arguments.rotate_deg / 90,
    })
}

fn table(info: &SceneInfo) -> String {
    let mut text = format!("{}\n\n", info.understood);
    for (label, value) in rows(info) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{label:<18}{value}");
    }
    for note in &info.notes {
        let _ = writeln!(text, "note: {note}");
    }
    text
}

fn rows(info: &SceneInfo) -> Vec<(&'static str, String)> {
    let mut rows = vec![
        ("samples", format!("{} × {}", info.columns, info.rows)),
        ("bands, nm", info.wavelengths_nm.iter().map(|nm| format!("{nm}")).collect::<Vec<_>>().join(", ")),
        // Of infrared bands sums are 0 but for rounding, to either side.
        ("mean luminance", format!("{:.4} cd/m²", (1e4 * info.mean_luminance_cd_m2).round() / 1e4 + 0.0)),
    ];
    let largest = info.largest_radiance.iter().copied().fold(0.0, f64::max);
    rows.push(("largest radiance", format!("{largest:.4e} W/m²/sr/nm")));
    let light = info.light.as_ref().map_or_else(
        || "not known".to_owned(),
        |light| {
            let [x, y] = light.illuminant.chromaticity();
            let lux = light.illuminance_lux.map_or_else(String::new, |lux| format!(", {lux:.1} lx"));
            format!("x {x:.4}, y {y:.4}{lux}")
        },
    );
    rows.push(("light", light));
    rows.push((
        "depth",
        match (info.depth_m, info.sky_fraction) {
            (Some([near, far]), Some(sky)) => format!("{near:.4} to {far:.4} m, {:.1} % infinitely far", 100.0 * sky),
            _ => "none".to_owned(),
        },
    ));
    rows.push((
        "view",
        match (info.view, info.field_of_view_deg) {
            (Some(view), Some(fov)) => format!(
                "{fov:.3}° wide, focal length {:.3} samples, axis at column {:.3}, row {:.3}",
                view.focal_px, view.center_x_px, view.center_y_px
            ),
            _ => "none".to_owned(),
        },
    ));
    if info.has_hidden_layer {
        rows.push(("hidden layer", "yes".to_owned()));
    }
    rows
}
