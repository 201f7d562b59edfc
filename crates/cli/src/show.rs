//! `dioptric show`: a picture viewed as on a given display.

use std::path::PathBuf;

use clap::Args;
use dioptric_pipeline::{ShowRequest, ShownPicture, open_display, parse_numbers};

use crate::{
    common::Common,
    lens::tell,
    terminal::{print, print_json, remark},
};

/// A picture and a display.
#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// Picture: PNG, JPEG or TIFF
    pub(crate) picture: PathBuf,
    /// Scene to write: spectral radiance with depth and view, EXR
    #[arg(long, short, value_name = "F.exr")]
    pub(crate) out: PathBuf,
    /// Display, a RON file, a display of `ISETCam` (.mat), or the name of a built-in one: srgb, display-p3, rec2020, apple-studio
    #[arg(long, value_name = "DISPLAY", default_value = "srgb")]
    pub(crate) display: String,
    /// How far away the display is, m
    #[arg(long, value_name = "D", default_value_t = 0.6)]
    pub(crate) distance_m: f64,
    /// The luminance of its white, cd/m² [default: its own]
    #[arg(long, value_name = "L")]
    pub(crate) white_cd_m2: Option<f64>,
    /// Wavelengths, nm: a list or first:last:step [default: 400:700:10]
    #[arg(long, value_name = "LIST")]
    pub(crate) wavelengths_nm: Option<String>,
}

pub(crate) fn run(arguments: &ShowArgs, common: &Common) -> anyhow::Result<()> {
    let (mut display, notes) = open_display(&arguments.display)?;
    tell(&notes, common);
    display.white_cd_m2 = arguments.white_cd_m2.or(display.white_cd_m2);
    let wavelengths_nm =
        arguments.wavelengths_nm.as_deref().map(|list| parse_numbers("--wavelengths-nm", list)).transpose()?;
    let request = ShowRequest { display, distance_m: arguments.distance_m, wavelengths_nm };
    let shown = request.write(&arguments.picture, &arguments.out)?;
    if shown.band_error > 0.01 {
        let percent = 100.0 * shown.band_error;
        remark(common.quiet, &format!("the bands miss a primary by {percent:.1} % of white, expected finer ones"));
    }
    match (common.json, common.quiet) {
        (true, _) => print_json(&shown),
        (false, true) => Ok(()),
        (false, false) => print(&table(&shown)),
    }
}

fn table(shown: &ShownPicture) -> String {
    let (columns, rows) = shown.samples;
    let [r, g, b, w] = shown.chromaticities.map(|[x, y]| format!("{x:.3} {y:.3}"));
    format!(
        "{}: white of {:.1} cd/m² at {w}, primaries {r}, {g}, {b}\n{columns} × {rows} samples, {:.1}° wide, {:.1} pixels a degree, mean \
         luminance {:.2} cd/m²\n",
        shown.display, shown.white_cd_m2, shown.field_of_view_deg, shown.pixels_per_degree, shown.mean_luminance_cd_m2
    )
}
