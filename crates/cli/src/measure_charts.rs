//! `dioptric measure` of targets that fill the field: edges all over a picture, stars, grids of dots, even planes and gray steps.

use std::fmt::{Error, Write};

use dioptric_analysis::measure::{
    EdgeMap, EdgeMapRequest, EdgeRequest, GridMeasurement, GridRequest, PixelRegion, ShadingMeasurement,
    ShadingRequest, StarMeasurement, StarRequest, StepsMeasurement, StepsRequest, notes_on_picture,
};

use crate::{
    args::Common,
    lens::tell,
    measure_args::{GridArgs, ShadingArgs, StarArgs, StepsArgs},
    measure_output::{Finish, curve, file_name, or_dash},
};

/// Places of a map that cannot be measured and are still named.
const MOST_NAMED: usize = 3;

/// Measures the edges all over a picture.
pub(crate) fn edges(
    request: EdgeRequest,
    arguments: &crate::measure_args::MtfArgs,
    common: &Common,
) -> anyhow::Result<()> {
    let finish = Finish::new(
        ("mtf-field", "Edge responses over the field"),
        file_name(&arguments.picture),
        arguments.picture_args.out.as_deref(),
        common,
    )?;
    finish.with(&EdgeMapRequest { edge: request }.measure(&arguments.picture)?, edge_map_table)
}

pub(crate) fn star(arguments: &StarArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    tell(&notes_on_picture(&arguments.picture, curve), common);
    let request = StarRequest {
        region: arguments.region.as_deref().map(PixelRegion::parse).transpose()?,
        n_cycles: arguments.cycles,
        is_binary: arguments.binary,
        modulation: arguments.modulation,
        curve,
    };
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("star", "Siemens star"), file_name(&arguments.picture), out, common)?;
    finish.with(&request.measure(&arguments.picture)?, star_table)
}

pub(crate) fn grid(arguments: &GridArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    tell(&notes_on_picture(&arguments.picture, curve), common);
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("grid", "Distortion and lateral color"), file_name(&arguments.picture), out, common)?;
    finish.with(&GridRequest { curve }.measure(&arguments.picture)?, grid_table)
}

pub(crate) fn shading(arguments: &ShadingArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    tell(&notes_on_picture(&arguments.picture, curve), common);
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("shading", "Shading"), file_name(&arguments.picture), out, common)?;
    finish.with(&ShadingRequest { curve }.measure(&arguments.picture)?, shading_table)
}

pub(crate) fn steps(arguments: &StepsArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    tell(&notes_on_picture(&arguments.picture, curve), common);
    let request = StepsRequest { steps: StepsRequest::read_steps(&arguments.steps)?, curve };
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("steps", "Gray steps"), file_name(&arguments.picture), out, common)?;
    let measured = request.measure(&arguments.picture)?;
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
