//! `dioptric measure`: a laboratory's measurements of pictures, frames and sensors.

use std::{fmt::Write, path::Path};

use dioptric_analysis::measure::{
    BenchRequest, ChartMeasurement, ChartRequest, CompareRequest, Comparison, EdgeMeasurement, EdgeRequest,
    MeasuredPicture, NoiseData, PictureViewing, PixelRegion, PointRequest, PointSet, RegionMeasurement, RegionRequest,
    TextureCurve, TextureMeasurement, TextureNoiseRequest, TextureRequest, measure_bench, measure_frames,
    notes_on_picture,
};
use dioptric_pipeline::{Binning, SensorSpec, Staged, open_display, parse_illuminant};

use crate::{
    args::Common,
    lens::tell,
    measure_args::{ColorArgs, MeasureCommand, MtfArgs, NoiseArgs, RegionArgs, SpotArgs, TextureArgs},
    measure_charts,
    measure_output::{Finish, curve, file_name, opened, or_dash},
};

/// The seed where the user gives none.
const SEED: u64 = 1;

pub(crate) fn run(command: &MeasureCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        MeasureCommand::Mtf(arguments) => mtf(arguments, common),
        MeasureCommand::Texture(arguments) => texture(arguments, common),
        MeasureCommand::Spot(arguments) => spot(arguments, common),
        MeasureCommand::Star(arguments) => measure_charts::star(arguments, common),
        MeasureCommand::Grid(arguments) => measure_charts::grid(arguments, common),
        MeasureCommand::Shading(arguments) => measure_charts::shading(arguments, common),
        MeasureCommand::Steps(arguments) => measure_charts::steps(arguments, common),
        MeasureCommand::Region(arguments) => region(arguments, common),
        MeasureCommand::Noise(arguments) => noise(arguments, common),
        MeasureCommand::Color(arguments) => color(arguments, common),
    }
}

fn mtf(arguments: &MtfArgs, common: &Common) -> anyhow::Result<()> {
    let request = EdgeRequest {
        region: arguments.region.as_deref().map(PixelRegion::parse).transpose()?,
        side: arguments.size,
        mosaic: arguments.mosaic.clone(),
        pixel_um: arguments.pixel_um,
        pixels_per_degree: arguments.pixels_per_degree,
    };
    let picture = match arguments.pictures.as_slice() {
        [picture] if !picture.is_dir() => picture,
        _ => return measure_charts::edges_of_pictures(request, arguments, common),
    };
    if arguments.all {
        return measure_charts::edges(request, picture, arguments, common);
    }
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("mtf", "Edge response"), file_name(picture), out, common)?;
    finish.with(&request.measure(&opened(picture, &arguments.picture_args, common)?)?, mtf_table)
}

fn texture(arguments: &TextureArgs, common: &Common) -> anyhow::Result<()> {
    let picture = opened(&arguments.picture, &arguments.picture_args, common)?;
    let beside = |path: &Path| opened(path, &arguments.picture_args, common);
    let region = |text: &Option<String>| text.as_deref().map(PixelRegion::parse).transpose();
    let request = TextureRequest {
        region: region(&arguments.region)?,
        noise: match (region(&arguments.flat)?, &arguments.second_frame) {
            (Some(patch), _) => TextureNoiseRequest::Flat(patch),
            (None, Some(second)) => TextureNoiseRequest::SecondFrame(beside(second)?),
            (None, None) => TextureNoiseRequest::None,
        },
        pixels_per_degree: arguments.pixels_per_degree,
    };
    let subject = format!("{} against {}", file_name(&arguments.picture), file_name(&arguments.reference));
    let finish = Finish::new(("texture", "Texture response"), subject, arguments.picture_args.out.as_deref(), common)?;
    finish.with(&request.measure(&picture, &beside(&arguments.reference)?)?, texture_table)
}

fn spot(arguments: &SpotArgs, common: &Common) -> anyhow::Result<()> {
    let request =
        PointRequest { window: arguments.window, pixel_um: arguments.pixel_um, background: arguments.background };
    let finish =
        Finish::new(("spot", "Points"), file_name(&arguments.picture), arguments.picture_args.out.as_deref(), common)?;
    finish.with(&request.measure(&opened(&arguments.picture, &arguments.picture_args, common)?)?, spot_table)
}

fn region(arguments: &RegionArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    let parsed = |text: &Option<String>| text.as_deref().map(PixelRegion::parse).transpose();
    let request = RegionRequest { region: parsed(&arguments.region)?, reference: parsed(&arguments.reference)? };
    let out = arguments.picture_args.out.as_deref();
    let finish = Finish::new(("region", "Region"), file_name(&arguments.picture), out, common)?;
    let mut notes = vec![];
    let measured = request.measure_file(&arguments.picture, curve)?.told_in(&mut notes);
    tell(&notes, common);
    finish.with(&measured, region_table)
}

fn noise(arguments: &NoiseArgs, common: &Common) -> anyhow::Result<()> {
    let of_frames = || arguments.frames.as_deref().map(file_name).unwrap_or_default();
    let of_what = arguments.sensor.clone().unwrap_or_else(of_frames);
    let finish = Finish::new(("noise", "Noise"), of_what, arguments.out.as_deref(), common)?;
    let data = match (&arguments.frames, &arguments.sensor) {
        (Some(frames), _) => measure_frames(frames)?,
        (None, Some(sensor)) => {
            let request = BenchRequest {
                sensor: SensorSpec::named(sensor).open()?,
                filter: arguments.filter.clone(),
                side: arguments.size,
                n_levels: arguments.levels,
                n_stacked: arguments.stack,
                wavelength_nm: arguments.wavelength_nm,
                time_s: arguments.exposure_s,
                analog_gain: arguments.analog_gain,
                binning: arguments.binning.as_deref().map_or(Ok(None), Binning::parse)?,
                temperature_c: arguments.temperature_c,
                seed: common.seed.unwrap_or(SEED),
            };
            // Frames and numbers may go to the same folder.
            let is_shared = arguments.keep_frames == arguments.out;
            let own = arguments.keep_frames.as_deref().filter(|_| !is_shared);
            let kept = own.map(Staged::folder).transpose()?;
            let folder = if is_shared { finish.staged.as_ref() } else { kept.as_ref() };
            let data = measure_bench(&request, folder.map(Staged::path))?;
            kept.map_or(Ok(()), Staged::commit)?;
            data
        }
        (None, None) => anyhow::bail!("frames or --sensor are needed"),
    };
    tell(&data.notes, common);
    finish.with(&data, noise_table)
}

fn color(arguments: &ColorArgs, common: &Common) -> anyhow::Result<()> {
    let curve = curve(arguments.picture_args.curve);
    tell(&notes_on_picture(&arguments.picture, curve), common);
    let out = arguments.picture_args.out.as_deref();
    if let Some(against) = &arguments.against {
        let request = CompareRequest {
            viewing: viewing(arguments, common)?,
            patch: arguments.patch.as_deref().map(PixelRegion::parse).transpose()?,
        };
        let subject = format!("{} against {}", file_name(&arguments.picture), file_name(against));
        let finish = Finish::new(("compare", "Two pictures"), subject, out, common)?;
        tell(&notes_on_picture(against, curve), common);
        let open = |path: &Path| request.viewing.open(path, curve);
        return finish.with(&request.compare(&open(&arguments.picture)?, &open(against)?)?, comparison_table);
    }
    let request = ChartRequest {
        corners: arguments.corners.as_deref().map(ChartRequest::parse_corners).transpose()?,
        light: arguments.illuminant.as_deref().map(parse_illuminant).transpose()?,
    };
    let finish = Finish::new(("color", "Color chart"), file_name(&arguments.picture), out, common)?;
    finish.with(&request.measure(&MeasuredPicture::open(&arguments.picture, curve)?)?, chart_table)
}

fn viewing(arguments: &ColorArgs, common: &Common) -> anyhow::Result<PictureViewing> {
    Ok(match &arguments.display {
        Some(name) => {
            let (display, notes) = open_display(name)?;
            tell(&notes, common);
            PictureViewing::Display { display: Box::new(display), distance_m: arguments.distance_m }
        }
        None => PictureViewing::PixelsPerDegree(arguments.pixels_per_degree),
    })
}

fn mtf_table(measured: &EdgeMeasurement) -> Result<String, std::fmt::Error> {
    let PixelRegion { column, row, columns, rows } = measured.region;
    let mut text = format!(
        "edge slanted by {:.2}° in {columns} × {rows} pixels from column {column}, row {row}\n\n",
        measured.slant_deg
    );
    writeln!(
        text,
        "{:<12} {:>13} {:>9} {:>13} {:>13} {:>13} {:>11} {:>9} {:>9} {:>9}",
        "channel",
        "MTF50 c/px",
        "± error",
        "MTF50P c/px",
        "MTF50 c/mm",
        "MTF50P c/mm",
        "at 0.5 c/px",
        "aliased",
        "acutance",
        "SQRI jnd"
    )?;
    for channel in &measured.channels {
        writeln!(
            text,
            "{:<12} {:>13} {:>9} {:>13} {:>13} {:>13} {:>11} {:>9} {:>9} {:>9}",
            channel.channel,
            or_dash(channel.mtf50_cycles_per_pixel, 4),
            or_dash(channel.mtf50_error_cycles_per_pixel, 4),
            or_dash(channel.mtf50p_cycles_per_pixel, 4),
            or_dash(channel.mtf50_cycles_per_mm, 2),
            or_dash(channel.mtf50p_cycles_per_mm, 2),
            or_dash(channel.response_at_nyquist, 4),
            or_dash(channel.aliasing_share, 4),
            or_dash(channel.acutance, 4),
            or_dash(channel.square_root_integral_jnd, 2)
        )?;
    }
    for channel in &measured.not_measured {
        writeln!(text, "{:<12} {}", channel.channel, channel.reason)?;
    }
    let beside_green: Vec<String> = measured
        .channels
        .iter()
        .filter(|channel| !["G", "luminance"].contains(&channel.channel.as_str()))
        .filter_map(|channel| {
            let (px, error) = (channel.offset_px?, channel.offset_error_px?);
            Some(format!("{} by {px:.3} ± {error:.3}", channel.channel))
        })
        .collect();
    if !beside_green.is_empty() {
        writeln!(text, "\nacross the edge, pixels from G (lateral color): {}", beside_green.join(", "))?;
    }
    let shading = measured.channels.iter().map(|channel| channel.shading).fold(0.0, f64::max);
    if shading > 0.0 {
        writeln!(
            text,
            "\nlight changes by up to {:.1} % of the step beside the edge, which was taken off; even light is more certain",
            100.0 * shading
        )?;
    }
    if measured.clipped_share > TOLD_CLIPPED {
        writeln!(
            text,
            "\n{:.0} % of the region lies at 0 or at the highest code: an edge that is clipped there looks sharper than it is",
            100.0 * measured.clipped_share
        )?;
    }
    Ok(text)
}

/// The share of a region at the ends of the codes from which on it is told.
const TOLD_CLIPPED: f64 = 0.02;

fn texture_table(measured: &TextureMeasurement) -> Result<String, std::fmt::Error> {
    let PixelRegion { column, row, columns, rows } = measured.region;
    let mut text = format!("texture in {columns} × {rows} pixels from column {column}, row {row}\n\n");
    writeln!(text, "{:<12} {:<15} {:>11} {:>11} {:>9}", "channel", "method", "MTF50 c/px", "at 0.5 c/px", "acutance")?;
    for channel in &measured.channels {
        let mut line = |method: &str, curve: &TextureCurve| {
            writeln!(
                text,
                "{:<12} {method:<15} {:>11} {:>11.4} {:>9.4}",
                channel.channel,
                or_dash(curve.mtf50_cycles_per_pixel, 4),
                curve.response_at_nyquist,
                curve.acutance
            )
        };
        line("direct", &channel.direct)?;
        match &channel.full_reference {
            Some(curve) => line("full reference", curve)?,
            None => writeln!(
                text,
                "{:<12} {:<15} the reference does not show this part of the texture (coherence {:.2})",
                channel.channel, "full reference", channel.coherence
            )?,
        }
    }
    for channel in &measured.channels {
        if let Some(frequency) = channel.noise_from_cycles_per_pixel {
            writeln!(
                text,
                "{}: the noise has all of the power at {frequency:.3} c/px and perhaps beyond; the direct response is 0 there",
                channel.channel
            )?;
        }
    }
    Ok(text)
}

fn spot_table(measured: &PointSet) -> Result<String, std::fmt::Error> {
    let mut text = format!("pixels of {} µm\n\n", measured.pixel_um);
    writeln!(
        text,
        "{:>4} {:<8} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "spot", "channel", "column", "row", "rms µm", "σx µm", "σy µm", "EE50 µm", "EE80 µm", "LSF µm"
    )?;
    for spot in &measured.spots {
        writeln!(
            text,
            "{:>4} {:<8} {:>10.3} {:>10.3} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {:>9}",
            spot.spot,
            spot.channel,
            spot.column,
            spot.row,
            spot.rms_radius_um,
            spot.sigma_x_um,
            spot.sigma_y_um,
            spot.ee50_radius_um,
            spot.ee80_radius_um,
            or_dash(spot.lsf_fwhm_um, 3)
        )?;
    }
    Ok(text)
}

fn region_table(measured: &RegionMeasurement) -> Result<String, std::fmt::Error> {
    let PixelRegion { column, row, columns, rows } = measured.region;
    let mut text = format!("{columns} × {rows} pixels from column {column}, row {row}; {}\n\n", measured.unit);
    writeln!(
        text,
        "{:<12} {:>12} {:>12} {:>9} {:>8} {:>12} {:>12} {:>12} {:>12} {:>12} {:>11}",
        "channel",
        "mean",
        "σ",
        "SNR",
        "SNR dB",
        "σ of rows",
        "σ of columns",
        "least",
        "median",
        "largest",
        "uniformity"
    )?;
    for channel in &measured.channels {
        let median = channel.percentiles.iter().find(|(percent, _)| *percent == 50.0).map(|(_, value)| *value);
        writeln!(
            text,
            "{:<12} {:>12.6} {:>12.6} {:>9} {:>8} {:>12.6} {:>12.6} {:>12.6} {:>12} {:>12.6} {:>11}",
            channel.channel,
            channel.mean,
            channel.deviation,
            or_dash(channel.signal_to_noise, 2),
            or_dash(channel.signal_to_noise_db, 2),
            channel.row_deviation,
            channel.column_deviation,
            channel.least,
            or_dash(median, 6),
            channel.most,
            or_dash(channel.uniformity, 4)
        )?;
    }
    if let Some(color) = &measured.color {
        let ([x, y], [cx, cy, cz]) = (color.xy, color.xyz);
        writeln!(
            text,
            "\nXYZ {cx:.5} {cy:.5} {cz:.5}   x, y {x:.4}, {y:.4}   {:.0} K, Duv {:.4}",
            color.cct_kelvin, color.duv
        )?;
        if let Some([l, a, b]) = color.lab {
            writeln!(text, "L*a*b* {l:.2} {a:.2} {b:.2}")?;
        }
    }
    if let Some(difference) = &measured.difference {
        writeln!(
            text,
            "from the reference: ΔE76 {:.3}, ΔE94 {:.3}, ΔE00 {:.3}, ΔE*uv {:.3}",
            difference.delta_e_76, difference.delta_e_94, difference.delta_e_2000, difference.delta_e_uv
        )?;
    }
    Ok(text)
}

fn noise_table(data: &NoiseData) -> Result<String, std::fmt::Error> {
    let filter = data.filter.as_ref().map(|name| format!(", filter {name}")).unwrap_or_default();
    let mut text =
        format!("{}{filter}: {} frames of {} × {} pixels\n\n", data.source, data.n_frames, data.columns, data.rows);
    if data.raised_black_dn > 0 {
        let dn = data.raised_black_dn;
        writeln!(text, "The black level was raised by {dn} DN, since the sensor's own level clips the dark noise.\n")?;
    }
    let sheet = data.data_sheet.as_ref();
    // Below a dark variance of 0.24 DN² rounding hides the noise: the most that it may be is stated.
    let dark_noise = if data.dark_noise_is_limit { "dark noise σd, e, less than" } else { "dark noise σd, e" };
    writeln!(text, "{:<34} {:>12} {:>12}", "", "measured", "data sheet")?;
    for (name, measured, expected, digits) in [
        ("system gain K, DN/e", Some(data.gain_dn_per_e), sheet.map(|s| s.gain_dn_per_e), 5),
        ("quantum efficiency", data.quantum_efficiency, sheet.map(|s| s.quantum_efficiency), 4),
        (dark_noise, data.dark_noise_e, sheet.map(|s| s.dark_noise_e), 3),
        ("saturation, e", data.saturation_e, sheet.map(|s| s.saturation_e), 0),
        ("DSNU, e", data.dsnu_e, sheet.map(|s| s.dsnu_e), 3),
        ("  ± one standard error", data.dsnu_error_e, None, 3),
        ("  of rows", data.dsnu_parts_e.map(|p| p.row), None, 3),
        ("  of columns", data.dsnu_parts_e.map(|p| p.column), None, 3),
        ("  of single pixels", data.dsnu_parts_e.map(|p| p.pixel), None, 3),
        ("PRNU, %", data.prnu_percent, sheet.map(|s| s.prnu_percent), 3),
        ("  ± one standard error", data.prnu_error_percent, None, 3),
        ("  of rows", data.prnu_parts_percent.map(|p| p.row), None, 3),
        ("  of columns", data.prnu_parts_percent.map(|p| p.column), None, 3),
        ("  of single pixels", data.prnu_parts_percent.map(|p| p.pixel), None, 3),
        (
            "nonwhiteness of DSNU along rows",
            data.patterns.as_ref().and_then(|p| p.dsnu_nonwhiteness).map(|n| n[0]),
            None,
            2,
        ),
        (
            "nonwhiteness of DSNU along columns",
            data.patterns.as_ref().and_then(|p| p.dsnu_nonwhiteness).map(|n| n[1]),
            None,
            2,
        ),
        ("linearity error, %", data.linearity_error_percent, None, 3),
        ("dark current by mean, e/s", data.dark_current_by_mean_e_per_s, sheet.map(|s| s.dark_current_e_per_s), 3),
        (
            "dark current by variance, e/s",
            data.dark_current_by_variance_e_per_s,
            sheet.map(|s| s.dark_current_e_per_s),
            3,
        ),
        ("absolute threshold, photons", data.threshold_photons, None, 2),
        ("largest SNR, dB", data.max_snr_db, None, 2),
        ("dynamic range, dB", data.dynamic_range_db, None, 2),
        ("dynamic range, stops", data.dynamic_range_stops, None, 2),
        ("ISO by saturation (D55)", None, sheet.map(|s| s.iso_by_saturation), 1),
        ("ISO by noise, SNR 40", None, sheet.and_then(|s| s.iso_by_noise_40), 1),
        ("ISO by noise, SNR 10", None, sheet.and_then(|s| s.iso_by_noise_10), 1),
    ] {
        writeln!(text, "{name:<34} {:>12} {:>12}", or_dash(measured, digits), or_dash(expected, digits))?;
    }
    Ok(text)
}

fn chart_table(measured: &ChartMeasurement) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "ΔE00: mean {:.3}, median {:.3}, largest {:.3}; brightness spreads by {:.3} stops rms\n\n",
        measured.mean_delta_e, measured.median_delta_e, measured.max_delta_e, measured.brightness_spread_stops
    );
    for patch in &measured.patches {
        let [l, a, b] = patch.lab;
        let [wl, wa, wb] = patch.wanted_lab;
        writeln!(
            text,
            "{:<16} ΔE00 {:>7.3}   L*a*b* {l:>6.2} {a:>7.2} {b:>7.2}   wanted {wl:>6.2} {wa:>7.2} {wb:>7.2}",
            patch.name, patch.delta_e
        )?;
    }
    Ok(text)
}

fn comparison_table(measured: &Comparison) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    let psnr = measured.psnr_db.map_or_else(|| "equal".to_owned(), |v| format!("{v:.2} dB"));
    writeln!(text, "{:<28} {psnr}", "PSNR")?;
    writeln!(text, "{:<28} {:.4}", "SSIM", measured.ssim)?;
    let scielab = &measured.scielab;
    writeln!(
        text,
        "{:<28} mean {:.3}, median {:.3}, 95 % {:.3}, largest {:.3}",
        format!("S-CIELAB ΔE00 at {} px/°", measured.pixels_per_degree),
        scielab.mean,
        scielab.median,
        scielab.p95,
        scielab.max
    )?;
    if measured.vsnr.is_some() || measured.against_vsnr.is_some() {
        writeln!(text, "{:<28} {} and {}", "VSNR", or_dash(measured.vsnr, 3), or_dash(measured.against_vsnr, 3))?;
    }
    Ok(text)
}
