//! `dioptric lens analyze`: a lens by real rays, as tables, JSON and plots.

use std::{fmt::Write, fs};

use anyhow::Context;
use dioptric_analysis::{
    AnalysisFields, AnalysisRequest, FieldPlace, FieldRow, LensAnalysis, LensDefaults, LensPageData,
};
use dioptric_pipeline::{Staged, parse_directions, parse_pairs};
use dioptric_report::{AnalysisPlots, DRAWS_PNG, LensPage, chart_svg, write_drawing};

use crate::{
    args::Common,
    lens::{USUAL_NM, list_of, pairs_in_words, tell_taken},
    lens_args::{AnalysisArgs, LensAnalyzeArgs},
    terminal::{Bar, fixed, print, print_json, remark, remark_on_png},
};

/// Pixels of the plots as PNG for each of the drawing's own.
const PNG_SCALE: f64 = 1.5;

pub(crate) fn run(arguments: &LensAnalyzeArgs, common: &Common) -> anyhow::Result<()> {
    let used = arguments.lens.open(common)?;
    let request = request(&arguments.asked, &used, common)?;
    let used = arguments.lens.state.apply(used, &request.wavelengths_nm, common)?;
    // The place is tried before the work.
    let staged = arguments.out.as_ref().map(|path| Staged::folder(path)).transpose()?;
    let bar = Bar::new(common.quiet);
    bar.show("tracing the lens", 0.0);
    let analysis = request.compute(&used.lens)?;
    let shown = arguments.out.is_some().then(|| LensPageData::of(&request, &used, &analysis)).transpose()?;
    drop(bar);
    if let (Some(staged), Some(shown), Some(path)) = (staged, shown, &arguments.out) {
        let cannot = || format!("cannot write {}", path.display());
        let json = serde_json::to_string_pretty(&analysis)? + "\n";
        let plots = AnalysisPlots(&analysis);
        fs::write(staged.path().join("analysis.json"), json).with_context(cannot)?;
        for (name, svg) in [
            ("analysis", plots.page_svg()),
            ("spots", plots.spots_svg()),
            ("focus_spots", plots.focus_spots_svg(&shown.focus_spots)),
            ("opd", plots.opd_svg()),
            ("distortion", plots.grid_svg()),
            ("footprints", plots.footprints_svg(&shown.footprints)),
        ] {
            write_drawing(&svg, staged.path(), name, PNG_SCALE)?;
        }
        for (name, chart) in &shown.curves.0 {
            write_drawing(&chart_svg(chart, 640.0, 420.0), staged.path(), name, PNG_SCALE)?;
            fs::write(staged.path().join(format!("{name}.csv")), chart.to_csv()).with_context(cannot)?;
        }
        match &shown.modulation {
            Ok(modulation) => {
                for (name, chart) in modulation.charts() {
                    write_drawing(&chart_svg(chart, 640.0, 420.0), staged.path(), name, PNG_SCALE)?;
                    fs::write(staged.path().join(format!("{name}.csv")), chart.to_csv()).with_context(cannot)?;
                }
            }
            Err(reason) => remark(common.quiet, &format!("note: no modulation is shown: {reason}")),
        }
        let page = LensPage { plots, shown: &shown, tables: &tables(&analysis)? };
        fs::write(staged.path().join("analysis.html"), page.html()?).with_context(cannot)?;
        staged.commit()?;
        remark(
            common.quiet,
            &format!(
                "wrote analysis.json, analysis.html, and analysis, spots, focus_spots, opd, distortion, footprints, mtf \
                 and curves over field, focus and wavelength as {} (curves as .csv too), in {}",
                if DRAWS_PNG { ".svg and .png" } else { ".svg" },
                path.display()
            ),
        );
        remark_on_png(common.quiet);
    }
    if common.json { print_json(&analysis) } else { print(&tables(&analysis)?) }
}

/// Returns what is asked for; where it is not said, what the lens's file says.
pub(crate) fn request(
    arguments: &AnalysisArgs,
    used: &LensDefaults,
    common: &Common,
) -> anyhow::Result<AnalysisRequest> {
    let mut taken = Vec::new();
    let asked_nm = arguments.bands.nm()?;
    let wavelengths_nm = asked_nm.clone().unwrap_or_else(|| used.wavelengths_or(&USUAL_NM));
    if asked_nm.is_none() && wavelengths_nm != USUAL_NM {
        taken.push(format!("wavelengths of {} nm", list_of(&wavelengths_nm)));
    }
    let mut request = AnalysisRequest {
        fields: AnalysisFields::ByLight,
        main_wavelength_nm: used.reference_nm,
        wavelength_weights: used.weights_of(&wavelengths_nm),
        field_weights: Vec::new(),
        wavelengths_nm,
        distance_mm: arguments.distance_mm.unwrap_or(used.distance_mm),
        film: arguments.film.of(used),
        n_rings: arguments.rings,
    };
    if arguments.distance_mm.is_none() && request.distance_mm.is_finite() {
        taken.push(format!("an object at {} mm", list_of(&[request.distance_mm])));
    }
    let of_file = used.analysis_fields(request.reference_nm());
    request.fields = match (&arguments.fields_deg, &arguments.fields_mm, of_file) {
        (Some(list), _, _) => AnalysisFields::AnglesDeg(parse_directions("--fields-deg", list)?),
        (None, Some(list), _) => AnalysisFields::HeightsMm(parse_pairs("--fields-mm", list)?),
        // Places of an object elsewhere say nothing of this one.
        (None, None, Some(AnalysisFields::HeightsMm(_))) if arguments.distance_mm.is_some() => AnalysisFields::ByLight,
        (None, None, Some(fields)) => {
            taken.push(summary(&fields));
            request.field_weights = used.field_weights(fields.count());
            fields
        }
        (None, None, None) => AnalysisFields::ByLight,
    };
    tell_taken(&taken, common);
    Ok(request)
}

/// Returns fields as people name them.
fn summary(fields: &AnalysisFields) -> String {
    match fields {
        AnalysisFields::ByLight => "fields by light".to_owned(),
        AnalysisFields::AnglesDeg(pairs) => format!("fields of {} degrees", pairs_in_words(pairs)),
        AnalysisFields::HeightsMm(pairs) => format!("object points at {} mm", pairs_in_words(pairs)),
    }
}

fn tables(analysis: &LensAnalysis) -> Result<String, std::fmt::Error> {
    let mut text = head(analysis)?;
    text += "\n";
    text += &focus_table(analysis)?;
    text += "\n";
    text += &spot_table(analysis);
    text += "\n";
    text += &field_table(analysis);
    text += "\n";
    text += &line(&["λ nm", "axial mm", "by spot mm"].map(|name| in_units(name, analysis)));
    for row in &analysis.axial_color {
        text += &line(&[
            format!("{:.2}", row.wavelength_nm),
            format!("{:.4}", row.paraxial_shift_mm),
            cell(row.rms_shift_mm, 4),
        ]);
    }
    Ok(text)
}

/// Returns the part about the whole lens.
/// Returns the lens in one line: its focal length, f-number and T-number, at which wavelength, and its film.
pub(crate) fn lens_line(analysis: &LensAnalysis) -> String {
    let LensAnalysis { lens, efl_mm, f_number, reference_nm, film_distance_mm, film, .. } = analysis;
    let t_number = analysis.t_number.map_or_else(String::new, |t| format!(", T/{t:.3}"));
    match &analysis.afocal {
        Some(view) => format!(
            "{lens}: afocal, exit pupil {:.4} mm across, {:.4} mm behind the last vertex\n",
            view.exit_pupil_diameter_mm, view.exit_pupil_z_mm
        ),
        None => format!(
            "{lens}: f = {efl_mm:.4} mm, f/{f_number:.3}{t_number} at {reference_nm} nm, \
             film {film_distance_mm:.4} mm behind the last vertex: {film}\n"
        ),
    }
}

fn head(analysis: &LensAnalysis) -> Result<String, std::fmt::Error> {
    let mut text = lens_line(analysis);
    if let Some(x) = analysis.x_plane {
        writeln!(text, "along x: f = {:.4} mm, f/{:.3}", x.efl_mm, x.f_number)?;
    }
    if let Some(radius_mm) = analysis.film_radius_mm {
        writeln!(text, "the film is curved by a radius of {radius_mm:.4} mm")?;
    }
    if let Some(aperture) = analysis.object_na {
        let image = cell(analysis.image_na, 4);
        writeln!(text, "NA {aperture:.4} at the object in n = {:.5}, {image} at the image", analysis.object_index)?;
    }
    for note in &analysis.notes {
        writeln!(text, "note: {note}")?;
    }
    Ok(text)
}

fn focus_table(analysis: &LensAnalysis) -> Result<String, std::fmt::Error> {
    let focus = &analysis.focus;
    let mut text = String::new();
    for (what, place, size, unit) in [
        ("paraxial image", focus.paraxial_film_mm, None, ""),
        ("paraxial image along x", focus.paraxial_x_film_mm, None, ""),
        ("least spot on the axis", focus.axis_film_mm, focus.axis_rms_um, "µm rms"),
        ("least spots of all fields", focus.fields_film_mm, focus.fields_rms_um, "µm rms"),
        ("least wavefront on the axis", focus.wavefront_film_mm, focus.wavefront_rms_waves, "waves rms"),
    ] {
        if place.is_none() && what.ends_with("along x") {
            continue;
        }
        let size = size
            .filter(|size| size.is_finite())
            .map_or(String::new(), |size| format!("  {size:.4} {}", in_units(unit, analysis)));
        writeln!(text, "{what:<28} film {:>10} mm{size}", cell(place, 4))?;
    }
    Ok(text)
}

fn spot_table(analysis: &LensAnalysis) -> String {
    let header = [
        "field",
        "λ nm",
        height_header(analysis),
        "rms µm",
        "chief µm",
        "radius µm",
        "σx µm",
        "σy µm",
        "rays",
        "rms waves",
        "Strehl",
    ];
    let mut text = line(&header.map(|name| in_units(name, analysis)));
    for spot in &analysis.spots {
        let wavefront = spot.wavefront.as_ref();
        text += &line(&[
            field_cell(&spot.place),
            format!("{:.2}", spot.wavelength_nm),
            height_cell(spot.height_mm, analysis),
            cell(spot.rms_um, 3),
            cell(spot.rms_about_chief_um, 3),
            cell(spot.radius_um, 3),
            cell(spot.sigma_x_um, 3),
            cell(spot.sigma_y_um, 3),
            format!("{:.4}", spot.ray_share),
            cell(wavefront.map(|w| w.rms_waves), 4),
            cell(wavefront.and_then(|w| w.strehl), 4),
        ]);
    }
    let reasons = analysis.spots.iter().filter_map(|spot| spot.wavefront.as_ref()?.no_strehl.as_deref());
    let (n, first) = (reasons.clone().count(), reasons.into_iter().next());
    if let Some(reason) = first {
        let more = if n > 1 { format!(" (and {} more rows)", n - 1) } else { String::new() };
        text += &format!("no Strehl ratio: {reason}{more}\n");
    }
    text
}

fn field_table(analysis: &LensAnalysis) -> String {
    let is_round = analysis.x_plane.is_none();
    let (first, second) = if is_round { ("sag. mm", "tan. mm") } else { ("x foc. mm", "y foc. mm") };
    let header = ["field", height_header(analysis), "f tan θ %", "f θ %", "f θ cal. %", first, second, "light"];
    let mut text = line(&header.map(|name| in_units(name, analysis)));
    let foci = |row: &FieldRow| match is_round {
        true => [row.sagittal_focus_mm, row.tangential_focus_mm],
        false => [row.x_focus_mm, row.y_focus_mm],
    };
    for row in &analysis.fields {
        let [first, second] = foci(row).map(|focus| cell(focus, 4));
        text += &line(&[
            field_cell(&row.place),
            height_cell(row.height_mm, analysis),
            cell(row.distortion_tangent_percent, 4),
            cell(row.distortion_angle_percent, 4),
            cell(row.distortion_calibrated_percent, 4),
            first,
            second,
            cell(row.relative_illumination, 4),
        ]);
    }
    text
}

/// Returns the head of a column of heights: of light that leaves in parallel, of angles.
fn height_header(analysis: &LensAnalysis) -> &'static str {
    if analysis.afocal.is_some() { "angle °" } else { "height mm" }
}

fn height_cell(height_mm: Option<f64>, analysis: &LensAnalysis) -> String {
    let value = height_mm.map(|height_mm| analysis.afocal.map_or(height_mm, |view| view.angle_deg(height_mm)));
    cell(value, 4)
}

/// Returns the head of a column in the units of what is analyzed: on the film of the ideal lens of 1000 mm behind an afocal lens 1 µm is
/// 1 µrad, and 1 mm of focus 1/1000 dioptre.
fn in_units(name: &str, analysis: &LensAnalysis) -> String {
    match analysis.afocal {
        // Columns have room for ten letters.
        Some(_) => name.replace("radius µm", "max µrad").replace("µm", "µrad").replace("mm", "mD"),
        None => name.to_owned(),
    }
}

/// Returns the name of a field: degrees with three decimals where it lies above the axis.
fn field_cell(place: &FieldPlace) -> String {
    match (place.object_mm, place.field_xy_deg) {
        (None, [0.0, y_deg]) => format!("{y_deg:.3}°"),
        _ => place.label(),
    }
}

fn line(cells: &[String]) -> String {
    cells.iter().map(|cell| format!("{cell:>11}")).collect::<String>() + "\n"
}

fn cell(value: Option<f64>, decimals: usize) -> String {
    match value {
        Some(value) if value.is_finite() => fixed(value, decimals),
        _ => "–".to_owned(),
    }
}
