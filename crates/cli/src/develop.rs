//! `dioptric develop`: a raw file of any camera to a picture.

use std::fmt::Write;

use dioptric_analysis::DngReport;
use dioptric_pipeline::{
    Camera, DevelopedFile, DngBlack, DngOpcodes, DngReading, DngRendering, FrameFile, ProfileFile, Staged, write_json,
};

use crate::{
    args::{Common, DevelopArgs},
    lens::tell,
    terminal::{print, print_json},
};

pub(crate) fn run(arguments: &DevelopArgs, common: &Common) -> anyhow::Result<()> {
    let mut processing = match &arguments.camera {
        Some(camera) => Camera::read(camera)?.processing,
        None => Default::default(),
    };
    arguments.picture.0.apply(&mut processing)?;
    let also = arguments.also.as_deref().map_or(Ok(Vec::new()), FrameFile::parse_list)?;
    let staged = Staged::folder(&arguments.out)?;
    let reading = DngReading {
        opcodes: if arguments.ignore_opcodes { DngOpcodes::Ignored } else { DngOpcodes::Applied },
        rendering: arguments.rendering.map_or_else(DngRendering::default, DngRendering::from),
        black: arguments.black.as_deref().map_or(Ok(DngBlack::default()), DngBlack::parse)?,
        profile: arguments.profile.as_deref().map(ProfileFile::read).transpose()?,
    };
    let developed = DevelopedFile::read_with(&arguments.raw, processing, &reading)?;
    let report = DngReport::new(&developed);
    developed.write_pictures(&also, staged.path())?;
    write_json(&staged.path().join("report.json"), &report)?;
    staged.commit()?;
    tell(&report.notes, common);
    match (common.json, common.quiet) {
        (true, _) => print_json(&report),
        (false, true) => Ok(()),
        (false, false) => print(&table(&report)?),
    }
}

fn table(report: &DngReport) -> Result<String, std::fmt::Error> {
    let name = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".to_owned());
    let (columns, rows) = report.shown_px;
    let mut text = format!(
        "{} {}: {columns} × {rows} pixels, {} bits",
        name(&report.shot.make),
        name(&report.shot.model),
        report.bits
    );
    if let Some(mosaic) = &report.mosaic {
        write!(text, ", {}", mosaic.join(" "))?;
    }
    writeln!(
        text,
        "\nblack {:.1}, saturation {:.1}, {:.3} % saturated",
        report.black,
        report.white,
        100.0 * report.saturated_fraction
    )?;
    let number = |value: Option<f64>, unit: &str| value.map_or_else(String::new, |value| format!("  {value}{unit}"));
    if let Some(time_s) = report.shot.exposure_time_s {
        write!(text, "{time_s} s")?;
    }
    write!(text, "{}", number(report.shot.focal_length_mm, " mm"))?;
    write!(text, "{}", report.shot.f_number.map_or_else(String::new, |value| format!("  f/{value}")))?;
    writeln!(text, "{}", report.shot.iso_speed.map_or_else(String::new, |value| format!("  ISO {value}")))?;
    if !report.opcodes.is_empty() {
        writeln!(text, "corrected as the file asks: {}", report.opcodes.join(", "))?;
    }
    let gains: Vec<String> = report.white_balance.iter().map(|gain| format!("{gain:.3}")).collect();
    write!(text, "white by {}", gains.join(" "))?;
    writeln!(text, "{}", report.white_kelvin.map_or_else(String::new, |kelvin| format!(", {kelvin:.0} K")))?;
    Ok(text)
}
