//! `dioptric lens analyze`: a lens by real rays, as tables, JSON and plots.

use std::{fmt::Write, fs};

use anyhow::Context;
use dioptric_pipeline::{
    AnalysisFilm, AnalysisRequest, LensAnalysis, Staged, StopChoice, open_lens, parse_numbers, svg_to_png,
};

use crate::{
    args::{Common, LensAnalyzeArgs},
    terminal::{Bar, guarded, print, print_json, remark},
};

/// Pixels of the plots as PNG for each of the drawing's own.
const PNG_SCALE: f64 = 1.5;

pub(crate) fn run(arguments: &LensAnalyzeArgs, common: &Common) -> anyhow::Result<()> {
    let lens = open_lens(&arguments.lens, arguments.stop_mm)?;
    let lens = arguments.f_number.map_or(StopChoice::AsGiven, StopChoice::FNumber).apply(lens)?;
    let request = AnalysisRequest {
        fields_deg: arguments.fields_deg.as_ref().map(|list| parse_numbers("--fields-deg", list)).transpose()?,
        wavelengths_nm: parse_numbers("--wavelengths-nm", &arguments.wavelengths_nm)?,
        distance_mm: arguments.distance_mm,
        film: match (arguments.film_mm, arguments.focus_mm) {
            (Some(film_mm), _) => AnalysisFilm::FilmMm(film_mm),
            (None, Some(distance_mm)) => AnalysisFilm::FocusMm(distance_mm),
            (None, None) => AnalysisFilm::BestFocus,
        },
        n_rings: arguments.rings,
    };
    // The place is tried before the work.
    let staged = arguments.out.as_ref().map(|path| Staged::folder(path)).transpose()?.map(guarded);
    let bar = Bar::new(common.quiet);
    bar.show("tracing the lens", 0.0);
    let analysis = request.compute(&lens)?;
    drop(bar);
    if let (Some(staged), Some(path)) = (staged, &arguments.out) {
        let cannot = || format!("cannot write {}", path.display());
        let json = serde_json::to_string_pretty(&analysis)? + "\n";
        fs::write(staged.path().join("analysis.json"), json).with_context(cannot)?;
        for (name, svg) in [("analysis", analysis.page_svg()), ("spots", analysis.spots_svg())] {
            let png = svg_to_png(&svg, PNG_SCALE)?;
            fs::write(staged.path().join(format!("{name}.svg")), svg).with_context(cannot)?;
            fs::write(staged.path().join(format!("{name}.png")), png).with_context(cannot)?;
        }
        staged.commit()?;
        remark(
            common.quiet,
            &format!("wrote analysis.json, and analysis and spots as .svg and .png, in {}", path.display()),
        );
    }
    if common.json { print_json(&analysis) } else { print(&tables(&analysis)?) }
}

fn tables(analysis: &LensAnalysis) -> Result<String, std::fmt::Error> {
    let LensAnalysis { lens, efl_mm, f_number, film_mm, focus, .. } = analysis;
    let mut text =
        format!("{lens}: f = {efl_mm:.4} mm, f/{f_number:.3}, film {film_mm:.4} mm behind the last vertex\n\n");
    for (what, place, size, unit) in [
        ("paraxial image", focus.paraxial_film_mm, None, ""),
        ("least spot on the axis", focus.axis_film_mm, focus.axis_rms_um, "µm rms"),
        ("least spots of all fields", focus.fields_film_mm, focus.fields_rms_um, "µm rms"),
        ("least wavefront on the axis", focus.wavefront_film_mm, focus.wavefront_rms_waves, "waves rms"),
    ] {
        let size = size.map_or(String::new(), |size| format!("  {size:.4} {unit}"));
        writeln!(text, "{what:<28} film {:>10} mm{size}", cell(place, 4))?;
    }
    let header = [
        "field °",
        "λ nm",
        "height mm",
        "rms µm",
        "chief µm",
        "radius µm",
        "σx µm",
        "σy µm",
        "passes",
        "rms waves",
        "Strehl",
    ];
    text += "\n";
    text += &line(&header.map(str::to_owned));
    for spot in &analysis.spots {
        let wavefront = spot.wavefront.as_ref();
        text += &line(&[
            format!("{:.3}", spot.field_deg),
            format!("{:.2}", spot.wavelength_nm),
            cell(spot.height_mm, 4),
            cell(spot.rms_um, 3),
            cell(spot.rms_about_chief_um, 3),
            cell(spot.radius_um, 3),
            cell(spot.sigma_x_um, 3),
            cell(spot.sigma_y_um, 3),
            format!("{:.4}", spot.transmission),
            cell(wavefront.map(|w| w.rms_waves), 4),
            cell(wavefront.map(|w| w.strehl), 4),
        ]);
    }
    text += "\n";
    text += &line(&["field °", "height mm", "f tan θ %", "f θ %", "sag. mm", "tan. mm", "light"].map(str::to_owned));
    for row in &analysis.fields {
        text += &line(&[
            format!("{:.3}", row.field_deg),
            cell(row.height_mm, 4),
            cell(row.distortion_tangent_percent, 4),
            cell(row.distortion_angle_percent, 4),
            cell(row.sagittal_focus_mm, 4),
            cell(row.tangential_focus_mm, 4),
            cell(row.relative_illumination, 4),
        ]);
    }
    text += "\n";
    text += &line(&["λ nm", "axial mm", "by spot mm"].map(str::to_owned));
    for row in &analysis.axial_color {
        text += &line(&[
            format!("{:.2}", row.wavelength_nm),
            format!("{:.4}", row.paraxial_shift_mm),
            cell(row.rms_shift_mm, 4),
        ]);
    }
    Ok(text)
}

fn line(cells: &[String]) -> String {
    cells.iter().map(|cell| format!("{cell:>11}")).collect::<String>() + "\n"
}

fn cell(value: Option<f64>, decimals: usize) -> String {
    match value {
        Some(value) if value.is_finite() => format!("{value:.decimals$}"),
        _ => "–".to_owned(),
    }
}
