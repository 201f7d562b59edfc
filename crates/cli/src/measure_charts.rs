//! `dioptric measure` of targets that fill the field: edges all over a picture, stars, grids of dots, even planes and gray steps.

use std::{
    fmt::{Error, Write},
    path::Path,
};

use dioptric_analysis::measure::{
    EdgeBatch, EdgeBatchRequest, EdgeMap, EdgeMapRequest, EdgeRequest, GridMeasurement, PixelRegion,
    ShadingMeasurement, StarMeasurement, StarRequest, StepsMeasurement, StepsRequest,
};

use crate::{
    args::Common,
    lens::tell,
    measure_args::{GridArgs, MtfArgs, ShadingArgs, StarArgs, StepsArgs},
    measure_output::{Finish, curve, file_name, opened, or_dash},
};

/// Places of a map that cannot be measured and are still named.
const MOST_NAMED: usize = 3;

/// Measures the edges all over a picture.
pub(crate) fn edges(request: EdgeRequest, picture: &Path, arguments: &MtfArgs, common: &Common) -> anyhow::Result<()> {
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("mtf-field", "Edge responses over the field"), file_name(picture), out, common)?;
    let picture = opened(picture, &arguments.picture_args, common)?;
    finish.with(&EdgeMapRequest { edge: request }.measure(&picture)?, edge_map_table)
}

/// Measures the edge of each of several pictures.
pub(crate) fn edges_of_pictures(request: EdgeRequest, arguments: &MtfArgs, common: &Common) -> anyhow::Result<()> {
    anyhow::ensure!(!arguments.all, "--all is for the edges of one picture, expected one in place of several");
    let pictures = EdgeBatchRequest::pictures_of(&arguments.pictures)?;
    let out = arguments.picture_args.out.as_deref();
    let subject = format!("{} pictures", pictures.len());
    let finish = Finish::new(("mtf", "Edge responses of pictures"), subject, out, common)?;
    let batch = EdgeBatchRequest { edge: request, curve: curve(arguments.picture_args.curve) }.measure(&pictures)?;
    tell(&batch.notes, common);
    finish.with(&batch, edge_batch_table)
}

/// A row a picture: its luminance, or the last of its channels.
fn edge_batch_table(batch: &EdgeBatch) -> Result<String, Error> {
    let names = batch.pictures.iter().map(|measured| &measured.picture);
    let names = names.chain(batch.not_measured.iter().map(|picture| &picture.picture));
    let width = names.map(|name| name.chars().count()).max().unwrap_or(0).max("picture".len());
    let mut text =
        format!("{} of {} pictures\n\n", batch.pictures.len(), batch.pictures.len() + batch.not_measured.len());
    writeln!(
        text,
        "{:<width$} {:<12} {:>7} {:>11} {:>9} {:>12} {:>11} {:>11} {:>9}",
        "picture", "channel", "slant°", "MTF50 c/px", "± error", "MTF50P c/px", "MTF50 c/mm", "at 0.5 c/px", "acutance"
    )?;
    for measured in &batch.pictures {
        let Some(channel) = measured.channels.last() else { continue };
        writeln!(
            text,
            "{:<width$} {:<12} {:>7.2} {:>11} {:>9} {:>12} {:>11} {:>11} {:>9}",
            measured.picture,
            channel.channel,
            measured.slant_deg,
            or_dash(channel.mtf50_cycles_per_pixel, 4),
            or_dash(channel.mtf50_error_cycles_per_pixel, 4),
            or_dash(channel.mtf50p_cycles_per_pixel, 4),
            or_dash(channel.mtf50_cycles_per_mm, 2),
            or_dash(channel.response_at_nyquist, 4),
            or_dash(channel.acutance, 4)
        )?;
    }
    for picture in &batch.not_measured {
        writeln!(text, "{:<width$} {}", picture.picture, picture.reason)?;
    }
    Ok(text)
}

pub(crate) fn star(arguments: &StarArgs, common: &Common) -> anyhow::Result<()> {
    let picture = opened(&arguments.picture, &arguments.picture_args, common)?;
    let request = StarRequest {
        region: arguments.region.as_deref().map(PixelRegion::parse).transpose()?,
        n_cycles: arguments.cycles,
        is_binary: arguments.binary,
        modulation: arguments.modulation,
    };
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("star", "Siemens star"), file_name(&arguments.picture), out, common)?;
    finish.with(&request.measure(&picture)?, star_table)
}

pub(crate) fn grid(arguments: &GridArgs, common: &Common) -> anyhow::Result<()> {
    let picture = opened(&arguments.picture, &arguments.picture_args, common)?;
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("grid", "Distortion and lateral color"), file_name(&arguments.picture), out, common)?;
    finish.with(&GridMeasurement::of(&picture)?, grid_table)
}

pub(crate) fn shading(arguments: &ShadingArgs, common: &Common) -> anyhow::Result<()> {
    let picture = opened(&arguments.picture, &arguments.picture_args, common)?;
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("shading", "Shading"), file_name(&arguments.picture), out, common)?;
    finish.with(&ShadingMeasurement::of(&picture)?, shading_table)
}

pub(crate) fn steps(arguments: &StepsArgs, common: &Common) -> anyhow::Result<()> {
    let picture = opened(&arguments.picture, &arguments.picture_args, common)?;
    let request = StepsRequest { steps: StepsRequest::read_steps(&arguments.steps)? };
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("steps", "Gray steps"), file_name(&arguments.picture), out, common)?;
    let measured = request.measure(&picture)?;
    tell(&measured.notes, common);
    finish.with(&measured, steps_table)
}

fn edge_map_table(measured: &EdgeMap) -> Result<String, Error> {
    let mut text = format!("{} edges\n\n", measured.edges.len());
    writeln!(
        text,
        "{:>7} {:>7} {:>6} {:>7} {:<12} {:>11} {:>9} {:>11}",
        "column", "row", "field", "slant°", "channel", "MTF50 c/px", "± error", "at 0.5 c/px"
    )?;
    for edge in &measured.edges {
        let PixelRegion { column, row, columns, rows } = edge.region;
        for channel in &edge.channels {
            writeln!(
                text,
                "{:>7} {:>7} {:>6.3} {:>7.2} {:<12} {:>11} {:>9} {:>11}",
                column + columns / 2,
                row + rows / 2,
                edge.field,
                edge.slant_deg,
                channel.channel,
                or_dash(channel.mtf50_cycles_per_pixel, 4),
                or_dash(channel.mtf50_error_cycles_per_pixel, 4),
                or_dash(channel.response_at_nyquist, 4)
            )?;
        }
    }
    if !measured.not_measured.is_empty() {
        writeln!(text, "\n{} places look like edges and cannot be measured:", measured.not_measured.len())?;
        for place in measured.not_measured.iter().take(MOST_NAMED) {
            writeln!(text, "column {}, row {}: {}", place.region.column, place.region.row, place.reason)?;
        }
    }
    Ok(text)
}

fn star_table(measured: &StarMeasurement) -> Result<String, Error> {
    let [column, row] = measured.center_px;
    let mut text = format!(
        "a star of {} cycles about column {column:.2}, row {row:.2}, measured out to {:.0} pixels\n\n",
        measured.n_cycles, measured.radius_px
    );
    writeln!(text, "{:<12} {:>11} {:>11} {:>21}", "channel", "MTF50 c/px", "MTF10 c/px", "MTF50 of segments")?;
    for channel in &measured.channels {
        let known: Vec<f64> = channel.mtf50_of_segments.iter().flatten().copied().collect();
        let (least, most) = known.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        let spread = if known.is_empty() { "–".to_owned() } else { format!("{least:.4} to {most:.4}") };
        writeln!(
            text,
            "{:<12} {:>11} {:>11} {spread:>21}",
            channel.channel,
            or_dash(channel.mtf50_cycles_per_pixel, 4),
            or_dash(channel.mtf10_cycles_per_pixel, 4)
        )?;
    }
    if measured.is_relative {
        let coarsest = measured.channels.first().and_then(|channel| channel.frequencies_cycles_per_pixel.first());
        let coarsest = coarsest.copied().unwrap_or(0.0);
        writeln!(
            text,
            "\nthe response counts as 1 at the coarsest ring, {coarsest:.4} c/px; --modulation states that of the star"
        )?;
    }
    Ok(text)
}

fn grid_table(measured: &GridMeasurement) -> Result<String, Error> {
    let mut text = format!(
        "{} dots in order, {} left out; {:.3} pixels apart in the middle, turned by {:.3}°\n\n",
        measured.n_dots, measured.n_left_out, measured.pitch_px, measured.turn_deg
    );
    writeln!(text, "{:<40} {:>9.3}", "largest distortion of a dot, %", measured.largest_distortion_percent)?;
    writeln!(text, "{:<40} {:>9.3}", "distortion at the corner, by the fit, %", measured.corner_distortion_percent)?;
    writeln!(text, "{:<40} {:>9.3}", "left of the dots beyond the fit, px rms", measured.left_px)?;
    for color in &measured.lateral_color {
        let name = |what: &str| format!("lateral color of {}, {what}", color.channel);
        writeln!(text, "{:<40} {:>9.3}", name("largest, px"), color.largest_px)?;
        writeln!(text, "{:<40} {:>9.4}", name("% of half diagonal"), color.largest_percent)?;
        writeln!(text, "{:<40} {:>9.3}", name("outwards at the border, px"), color.outward_px)?;
    }
    Ok(text)
}

fn shading_table(measured: &ShadingMeasurement) -> Result<String, Error> {
    let [across, down] = measured.blocks;
    let mut text = format!("means of {across} × {down} blocks\n\n");
    writeln!(
        text,
        "{:<12} {:>10} {:>8} {:>10} {:>10} {:>12} {:>13} {:>16}",
        "channel", "shading %", "± %", "top left", "top right", "bottom left", "bottom right", "brightest at"
    )?;
    for channel in &measured.channels {
        let [top_left, top_right, bottom_left, bottom_right] = channel.corners;
        let [column, row] = channel.brightest_px;
        writeln!(
            text,
            "{:<12} {:>10.3} {:>8.3} {top_left:>10.4} {top_right:>10.4} {bottom_left:>12.4} {bottom_right:>13.4} {:>16}",
            channel.channel,
            channel.shading_percent,
            channel.error_percent,
            format!("{column:.0}, {row:.0}")
        )?;
    }
    if let Some(shading) = measured.color_shading {
        writeln!(text, "\ncolor shading, largest distance in a* b* at L* 50: {shading:.3}")?;
    }
    Ok(text)
}

fn steps_table(measured: &StepsMeasurement) -> Result<String, Error> {
    let mut text = String::new();
    for channel in &measured.channels {
        writeln!(
            text,
            "{}: saturated {} {:.5}, dynamic range {} dB ({} stops), signal as luminance to the power {:.3}",
            channel.channel,
            if channel.is_saturated { "at" } else { "beyond" },
            channel.saturation_luminance,
            or_dash(channel.dynamic_range_db, 2),
            or_dash(channel.dynamic_range_stops, 2),
            channel.exponent
        )?;
        writeln!(text, "{:>14} {:>12} {:>12} {:>14} {:>10} {:>9}", "luminance", "mean", "σ", "gain", "SNR", "blown %")?;
        for step in &channel.steps {
            writeln!(
                text,
                "{:>14.6} {:>12.6} {:>12.6} {:>14.6e} {:>10} {:>9.2}",
                step.luminance,
                step.mean,
                step.deviation,
                step.gain,
                or_dash(step.signal_to_noise, 2),
                100.0 * step.blown
            )?;
        }
        writeln!(text)?;
    }
    Ok(text)
}
