//! `dioptric camera` and `dioptric sensor`: files to begin with, what they may hold, and whether they are right.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use anyhow::bail;
use clap::{Args, Subcommand};
use dioptric_analysis::{built_in_sensors, pixel_optics_rows};
use dioptric_files::{is_stream, write};
use dioptric_pipeline::{CAMERA_SCHEMA, CAMERA_TEMPLATE, Camera, KeptCamera, SENSOR_SCHEMA, SensorSpec, parse_numbers};
use serde_json::json;

use crate::{
    common::Common,
    terminal::{print, print_json, remark},
};

/// Something to do with camera files.
#[derive(Debug, Subcommand)]
pub(crate) enum CameraCommand {
    /// Writes a camera file with every key, its default and its choices in comments
    Init {
        /// File to write [default: standard output]
        #[arg(long, short, value_name = "F.ron")]
        output: Option<PathBuf>,
    },
    /// Prints the JSON schema of camera files
    Schema,
    /// Reads a camera file and checks its numbers, lens, glasses and sensor, without taking the picture
    Check {
        /// The camera file
        camera: PathBuf,
    },
}

/// Something to do with sensors.
#[derive(Debug, Subcommand)]
pub(crate) enum SensorCommand {
    /// Lists the built-in sensors
    List,
    /// Prints the data sheet of a sensor as a sensor file
    Show {
        /// Sensor, a file or the name of a built-in one
        sensor: String,
    },
    /// Writes the data sheet of a built-in sensor to a file, to begin with
    Init {
        /// Sensor to begin with, a file or the name of a built-in one
        #[arg(default_value = "nikon-d5100")]
        sensor: String,
        /// File to write [default: standard output]
        #[arg(long, short, value_name = "F.ron")]
        output: Option<PathBuf>,
    },
    /// Prints the share of a lens's light that the optics of a sensor's pixels lead to the photodiodes, by image height and f-number
    Optics(PixelOpticsArgs),
    /// Prints the JSON schema of sensor files
    Schema,
}

/// The light before pixels of a stack.
#[derive(Debug, Args)]
pub(crate) struct PixelOpticsArgs {
    /// Sensor, a file or the name of a built-in one
    sensor: String,
    /// F-numbers of the cone of light; inf for collimated light
    #[arg(long, value_name = "LIST", default_value = "1.4,2,2.8,4,8,inf")]
    f_numbers: String,
    /// Image heights towards a corner, mm [default: from the middle of the sensor to its corner]
    #[arg(long, value_name = "LIST")]
    heights_mm: Option<String>,
    /// Distance of the exit pupil from the sensor, mm [default: a telecentric lens]
    #[arg(long, value_name = "D")]
    exit_pupil_mm: Option<f64>,
}

pub(crate) fn run(command: &CameraCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        CameraCommand::Init { output } => write_new(output.as_deref(), CAMERA_TEMPLATE, common),
        CameraCommand::Schema => print(CAMERA_SCHEMA),
        CameraCommand::Check { camera } => check(camera, common),
    }
}

pub(crate) fn run_sensor(command: &SensorCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        SensorCommand::List => list(common),
        SensorCommand::Show { sensor } => print(&(SensorSpec::named(sensor).open()?.to_ron() + "\n")),
        SensorCommand::Init { sensor, output } => {
            write_new(output.as_deref(), &(SensorSpec::named(sensor).open()?.to_ron() + "\n"), common)
        }
        SensorCommand::Optics(arguments) => optics(arguments, common),
        SensorCommand::Schema => print(SENSOR_SCHEMA),
    }
}

fn optics(arguments: &PixelOpticsArgs, common: &Common) -> anyhow::Result<()> {
    let heights_mm = arguments.heights_mm.as_deref().map(|list| parse_numbers("--heights-mm", list)).transpose()?;
    let f_numbers = parse_numbers("--f-numbers", &arguments.f_numbers)?;
    let distance_mm = arguments.exit_pupil_mm.unwrap_or(f64::INFINITY);
    let sensor = SensorSpec::named(&arguments.sensor).open()?;
    let rows = pixel_optics_rows(&sensor, distance_mm, &f_numbers, heights_mm.as_deref())?;
    if common.json {
        return print_json(&rows);
    }
    let mut text = format!(
        "{:>9} {:>10} {:>12} {:>10} {:>8} {:>8}\n",
        "f-number", "height mm", "chief ray °", "shift µm", "share", "factor"
    );
    for row in rows {
        let f_number = row.f_number.unwrap_or(f64::INFINITY);
        writeln!(
            text,
            "{f_number:>9} {:>10.3} {:>12.2} {:>10.3} {:>8.4} {:>8.4}",
            row.height_mm, row.chief_ray_deg, row.microlens_shift_um, row.share, row.factor
        )?;
    }
    print(&text)
}

/// Writes a file that is not there yet, or to standard output.
pub(crate) fn write_new(path: Option<&Path>, text: &str, common: &Common) -> anyhow::Result<()> {
    let Some(path) = path else { return print(text) };
    if path.exists() && !is_stream(path) {
        bail!("{} is there already; expected the name of a new file", path.display());
    }
    write(path, text.as_bytes())?;
    remark(common.quiet, &format!("wrote {}", path.display()));
    Ok(())
}

fn check(path: &Path, common: &Common) -> anyhow::Result<()> {
    let camera = Camera::read(path)?;
    let lens = KeptCamera::new(camera.clone()).check()?;
    let (first, t_number) = (lens.reference.first_order(), lens.reference.t_number(f64::INFINITY));
    if common.json {
        return print_json(&json!({
            "camera": camera.name, "lens": lens.lens.name(), "efl_mm": first.efl_mm, "f_number": first.f_number,
            "t_number": t_number, "notes": lens.notes,
        }));
    }
    lens.notes.iter().for_each(|note| remark(common.quiet, note));
    print(&format!(
        "{}: {}: {}, f = {:.3} mm, f/{:.2}{}\n",
        path.display(),
        camera.name,
        lens.lens.name(),
        first.efl_mm,
        first.f_number,
        t_number.map_or_else(String::new, |t| format!(", T/{t:.2}"))
    ))
}

fn list(common: &Common) -> anyhow::Result<()> {
    let rows = built_in_sensors()?;
    if common.json {
        return print_json(&rows);
    }
    let mut text = format!(
        "{:<20} {:>12} {:>8} {:>8} {:>9} {:>10}  {}\n",
        "name", "pixels", "pitch µm", "mosaic", "well e⁻", "read noise", "what it is"
    );
    for row in rows {
        let pixels = format!("{} × {}", row.columns, row.rows);
        writeln!(
            text,
            "{:<20} {pixels:>12} {:>8} {:>8} {:>9.0} {:>10.2}  {}",
            row.name, row.pixel_pitch_um, row.mosaic, row.full_well_e, row.read_noise_e, row.title
        )?;
    }
    print(&text)
}
