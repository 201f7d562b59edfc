//! `dioptric lens`: built-in lenses, first-order data, drawings, formats.

use std::{fmt::Write, fs, path::Path};

use anyhow::Context;
use dioptric_analysis::{
    AfocalView, ConfigurationData, ConvertedLens, FilmPlace, FilmUse, LensData, LensInfoRequest, SurfaceRow,
    built_in_lenses, convert_lens, ends_of, placement_lines, surface_rows,
};
use dioptric_files::{Staged, write};
use dioptric_pipeline::{LensReadOptions, PipelineError, REFERENCE_WAVELENGTH_NM, parse_directions, parse_numbers};
use dioptric_report::{LensDrawing, check_drawing_name, drawing_file};

use crate::{
    args::Common,
    lens_args::{LensCommand, LensDrawArgs, LensInfoArgs},
    terminal::{print, print_json, remark},
};

/// Wavelengths that are in focus together where neither the command nor the lens's file names some, nm.
pub(crate) const USUAL_NM: [f64; 3] = [450.0, 550.0, 650.0];

pub(crate) fn run(command: &LensCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        LensCommand::List => list(common),
        LensCommand::Info(arguments) => info(arguments, common),
        LensCommand::Analyze(arguments) => crate::analyze::run(arguments, common),
        LensCommand::Compare(arguments) => crate::lens_compare::run(arguments, common),
        LensCommand::Draw(arguments) => draw(arguments, common),
        LensCommand::Ghosts(arguments) => crate::lens_ghosts::run(arguments, common),
        LensCommand::Convert { input, output, strict, reading } => {
            convert((input, output), *strict, &reading.reading(), common)
        }
    }
}

/// Returns numbers as a list for people: of many the first three and the last.
pub(crate) fn list_of(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|number| format!("{}", (number * 1e4).round() / 1e4)).collect();
    match words.as_slice() {
        [a, b, c, .., last] if words.len() > 6 => format!("{a}, {b}, {c}, … {last}"),
        _ => words.join(", "),
    }
}

/// Returns pairs along x and y as a list for people; of those above the axis, y alone.
pub(crate) fn pairs_in_words(pairs: &[[f64; 2]]) -> String {
    let one = |[x, y]: &[f64; 2]| match *x == 0.0 {
        true => list_of(&[*y]),
        false => format!("{}/{}", list_of(&[*x]), list_of(&[*y])),
    };
    pairs.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Reports what the file of a lens states that is done otherwise or not at all.
pub(crate) fn tell(notes: &[String], common: &Common) {
    notes.iter().for_each(|note| remark(common.quiet, note));
}

/// Tells in a line what was taken from the file of a lens, where it was.
pub(crate) fn tell_taken(taken: &[String], common: &Common) {
    if !taken.is_empty() {
        remark(common.quiet, &format!("taken from the lens's file: {}", taken.join("; ")));
    }
}

fn convert(
    (input, output): (&str, &Path),
    is_strict: bool,
    reading: &LensReadOptions,
    common: &Common,
) -> anyhow::Result<()> {
    if reading.coating.is_some() {
        anyhow::bail!("--coating is no part of a lens's file, which states coatings surface by surface: leave it out");
    }
    let converted = convert_lens(input, output, reading)?;
    if is_strict && !converted.unread.is_empty() {
        let losses = converted.unread.join("; ");
        anyhow::bail!("{input}: not all that the file says is read, which --strict asks for: {losses}");
    }
    if is_strict && !converted.losses.is_empty() {
        let (output, losses) = (output.display(), converted.losses.join("; "));
        anyhow::bail!("{output}: the format does not hold all of {input}, which --strict asks for: {losses}");
    }
    if let Some(glasses) = &converted.glasses {
        let beside = output.with_extension("agf");
        // A catalogue that is not this lens's own is left alone.
        if fs::read_to_string(&beside).is_ok_and(|there| there != *glasses) || beside.is_dir() {
            let beside = beside.display();
            anyhow::bail!(
                "{beside}: the lens needs a glass catalogue of this name, which is there already; choose another name"
            );
        }
        write(&beside, glasses.as_bytes())?;
        remark(common.quiet, &format!("wrote the lens's own glasses to {}", beside.display()));
    }
    write(output, converted.text.as_bytes())?;
    tell(&converted.notes, common);
    remark(common.quiet, &format!("wrote {}", output.display()));
    if let Some(table) = loss_table(&converted) {
        remark(common.quiet, &table);
    }
    Ok(())
}

/// Lists what of a lens is not in the file written, and where it was lost; `None` where nothing was.
fn loss_table(converted: &ConvertedLens) -> Option<String> {
    let of =
        |step: &str, lost: &[String]| -> Vec<String> { lost.iter().map(|what| format!("  {step}  {what}")).collect() };
    let lines: Vec<String> = [of("reading", &converted.unread), of("writing", &converted.losses)].concat();
    (!lines.is_empty()).then(|| format!("not carried over as the file read has it:\n{}", lines.join("\n")))
}

fn list(common: &Common) -> anyhow::Result<()> {
    let lenses = built_in_lenses()?;
    if common.json {
        return print_json(&lenses);
    }
    let mut text = format!("{:<20} {:>8} {:>7} {:>9}  source\n", "name", "EFL mm", "f/", "surfaces");
    for lens in lenses {
        writeln!(
            text,
            "{:<20} {:>8.3} {:>7.2} {:>9}  {}",
            lens.name, lens.efl_mm, lens.f_number, lens.surfaces, lens.source
        )?;
    }
    print(&text)
}

fn info(arguments: &LensInfoArgs, common: &Common) -> anyhow::Result<()> {
    let used = arguments.lens.open(common)?;
    let asked_nm = arguments.bands.nm()?;
    let is_asked = asked_nm.is_some();
    let wavelengths_nm = match asked_nm {
        Some(list) => list,
        None if used.reference_nm.is_some() || !used.wavelengths_nm.is_empty() => {
            let wavelength_nm = used.wavelength_or_usual();
            tell_taken(&[format!("{wavelength_nm} nm")], common);
            vec![wavelength_nm]
        }
        None if used.is_known_at(REFERENCE_WAVELENGTH_NM) => vec![REFERENCE_WAVELENGTH_NM],
        None => {
            let wavelengths_nm = used.wavelengths_or(&[REFERENCE_WAVELENGTH_NM]);
            let list = list_of(&wavelengths_nm);
            remark(common.quiet, &format!("the lens is not known at {REFERENCE_WAVELENGTH_NM} nm: shown at {list} nm"));
            wavelengths_nm
        }
    };
    let used = arguments.lens.state.apply(used, &wavelengths_nm, common)?;
    tell(&used.lens.notes_on_ranges(&wavelengths_nm), common);
    let lens = &used.lens;
    tell(&Vec::from_iter(LensData::note_on_third_order(lens)), common);
    // Color counts between the wavelengths that were asked for, or those of the file.
    let colors_nm = ends_of(if is_asked { &wavelengths_nm } else { &used.wavelengths_nm });
    let data: Vec<LensData> = wavelengths_nm
        .iter()
        .map(|&wavelength_nm| {
            let LensInfoArgs { distance_mm, field_deg, blur_um, .. } = *arguments;
            let distance_mm = distance_mm.or(Some(used.distance_mm).filter(|mm| mm.is_finite()));
            let request = LensInfoRequest { wavelength_nm, distance_mm, field_deg, colors_nm, blur_um };
            let configurations = used.configurations(wavelength_nm)?;
            Ok::<_, PipelineError>(LensData {
                configurations,
                film_distance_mm: used.film_distance_mm,
                ..LensData::new(lens, &request)?
            })
        })
        .collect::<Result<_, _>>()?;
    let mut notes = Vec::from_iter(data.iter().find_map(LensData::note_on_light));
    if arguments.blur_um.is_some() && data.iter().all(|data| data.sharp.is_none()) {
        notes.push(
            "--blur-um is left aside: depth of field is that of a lens of one focal length, and of one telecentric in object space at a \
             distance (--distance-mm)"
                .to_owned(),
        );
    }
    tell(&notes, common);
    if common.json {
        return print_json(&data);
    }
    let mut text = format!("{}\n{}\n\n", lens.name(), lens.source());
    let object_medium = lens.object_medium().describe();
    if object_medium != "air" {
        writeln!(text, "object in {object_medium}\n")?;
    }
    text += &surface_table(&surface_rows(lens))?;
    for line in placement_lines(lens) {
        writeln!(text, "{line}")?;
    }
    if let Some(of_one_wavelength) = data.first() {
        text += &configuration_table(&of_one_wavelength.configurations)?;
    }
    text += "\n";
    text += &data_table(&data)?;
    print(&text)
}

/// Lists the configurations of a file that has several.
fn configuration_table(rows: &[ConfigurationData]) -> Result<String, std::fmt::Error> {
    if rows.is_empty() {
        return Ok(String::new());
    }
    let mut text =
        format!("\n{:>13} {:>12} {:>8} {:>12} {:>12}  name\n", "configuration", "EFL mm", "f/", "object mm", "film mm");
    for row in rows {
        let ConfigurationData { number, name, efl_mm, f_number, object_distance_mm, film_distance_mm, .. } = row;
        let film = film_distance_mm.map_or("–".to_owned(), |mm| format!("{mm:.4}"));
        let in_use = if row.in_use { "  (in use)" } else { "" };
        let object = format!("{object_distance_mm:.4}");
        writeln!(text, "{number:>13} {efl_mm:>12.4} {f_number:>8.3} {object:>12} {film:>12}  {name}{in_use}")?;
    }
    Ok(text)
}

fn surface_table(rows: &[SurfaceRow]) -> Result<String, std::fmt::Error> {
    let mut text =
        format!("{:>7} {:>12} {:>12} {:>12}  medium behind\n", "surface", "radius mm", "distance mm", "diameter mm");
    for row in rows {
        let stop = if row.is_stop { "  (stop)" } else { "" };
        let SurfaceRow { surface, radius_mm, thickness_mm, diameter_mm, medium_after, .. } = row;
        writeln!(
            text,
            "{surface:>7} {radius_mm:>12.4} {thickness_mm:>12.4} {diameter_mm:>12.4}  {medium_after}{stop}"
        )?;
        for remark in &row.remarks {
            writeln!(text, "{:>8}{remark}", "")?;
        }
    }
    Ok(text)
}

/// One line a quantity, one column a wavelength.
fn data_table(data: &[LensData]) -> anyhow::Result<String> {
    let mut text = String::new();
    let records: Vec<serde_json::Map<String, serde_json::Value>> = data
        .iter()
        .map(|d| serde_json::to_value(d)?.as_object().cloned().context("the data of a lens is a record"))
        .collect::<anyhow::Result<_>>()?;
    let Some(first) = records.first() else { return Ok(text) };
    for key in first.keys().filter(|key| !matches!(key.as_str(), "lens" | "configurations" | "seidel_surfaces")) {
        if let Some(sums) = first[key].as_object() {
            for name in sums.keys() {
                write!(text, "{:<28}", format!("{key} {name}"))?;
                for record in &records {
                    write!(text, " {:>14}", number(name, &record[key][name]))?;
                }
                text += "\n";
            }
            continue;
        }
        // Beside an object at a finite distance, the f-number is that of another.
        let is_near = data.iter().any(|d| d.image.is_some_and(|image| image.distance_mm.is_finite()));
        let label = if is_near && key == "f_number" { "f_number of a far object" } else { key };
        write!(text, "{label:<28}")?;
        for record in &records {
            write!(text, " {:>14}", number(key, &record[key]))?;
        }
        text += "\n";
    }
    Ok(text)
}

/// Returns a cell: what JSON has no number for is infinite, or nothing where only its absence makes sense.
fn number(key: &str, value: &serde_json::Value) -> String {
    if let Some([first, last]) = value.as_array().map(Vec::as_slice) {
        return format!("{first}–{last}");
    }
    if let Some(is_so) = value.as_bool() {
        return if is_so { "yes" } else { "no" }.to_owned();
    }
    match value.as_f64() {
        None if key.ends_with("_deg")
            || key.ends_with("colors_nm")
            || key.starts_with('C')
            || key.ends_with("_number")
            || key == "transmission"
            || key.ends_with("_na") =>
        {
            "–".to_owned()
        }
        Some(v) if v == 0.0 || (1e-3..1e6).contains(&v.abs()) => format!("{v:.6}"),
        Some(v) => format!("{v:.5e}"),
        None => "inf".to_owned(),
    }
}

/// Returns the field angles of a list, numbers or directions (0/10, 10@90), all of which lie in the y–z plane.
fn in_plane_of_drawing(list: &str) -> anyhow::Result<Vec<f64>> {
    let mut fields_deg = Vec::new();
    for item in list.split(',') {
        if !item.contains(['/', '@']) {
            fields_deg.extend(parse_numbers("--fields-deg", item)?);
            continue;
        }
        for [x_deg, y_deg] in parse_directions("--fields-deg", item)? {
            anyhow::ensure!(
                x_deg.abs() <= 1e-9 * y_deg.abs(),
                "--fields-deg: '{item}' lies beside the plane of the drawing, expected angles above the axis, as 10 or 10@90"
            );
            fields_deg.push(y_deg);
        }
    }
    Ok(fields_deg)
}

fn draw(arguments: &LensDrawArgs, common: &Common) -> anyhow::Result<()> {
    check_drawing_name(&arguments.output)?;
    // The place is tried before the work.
    let staged = Staged::file(&arguments.output)?;
    let used = arguments.lens.open(common)?;
    let mut taken = Vec::new();
    let asked_nm = arguments.bands.nm()?;
    let wavelengths_nm = match asked_nm.clone() {
        Some(list) => list,
        None => {
            let wavelength_nm = used.wavelength_or_usual();
            if wavelength_nm != REFERENCE_WAVELENGTH_NM {
                taken.push(format!("{wavelength_nm} nm"));
            }
            vec![wavelength_nm]
        }
    };
    let distance_mm = arguments.distance_mm.unwrap_or(used.distance_mm);
    if arguments.distance_mm.is_none() && distance_mm.is_finite() {
        taken.push(format!("an object at {} mm", list_of(&[distance_mm])));
    }
    let of_file_deg = wavelengths_nm.first().and_then(|&nm| used.drawing_fields_deg(nm));
    let fields_deg = match (&arguments.fields_deg, of_file_deg) {
        (Some(list), _) => in_plane_of_drawing(list)?,
        (None, Some(fields_deg)) => {
            taken.push(format!("fields of {} degrees", list_of(&fields_deg)));
            fields_deg
        }
        (None, None) => vec![0.0, 10.0],
    };
    tell_taken(&taken, common);
    let used = arguments.lens.state.apply(used, &wavelengths_nm, common)?;
    tell(&used.lens.notes_on_ranges(&wavelengths_nm), common);
    let focus_nm = if asked_nm.is_none() { used.wavelengths_or(&USUAL_NM) } else { wavelengths_nm.clone() };
    let weights = used.weights_of(&focus_nm);
    let of = FilmUse { main_nm: used.reference_nm, wavelengths_nm: &focus_nm, weights: &weights, distance_mm };
    let film = arguments.film.of(&used);
    let (film_distance_mm, film_label) = match AfocalView::of(&used.lens, film, &of)? {
        Some(view) => {
            let depth_mm = used.lens.vertices_z_mm().into_iter().fold(0.0, |deepest: f64, z_mm| deepest.max(z_mm));
            let drawn_to_mm = view.drawn_to_mm(depth_mm.max(used.lens.front_semi_aperture_mm()));
            let words = "light leaves in parallel".to_owned();
            remark(common.quiet, &format!("{words}: drawn to {drawn_to_mm:.4} mm behind the last vertex"));
            (drawn_to_mm, words)
        }
        None => {
            let FilmPlace { distance_mm, origin } = film.place(&used.lens, of)?;
            remark(common.quiet, &format!("film {distance_mm:.4} mm behind the last vertex: {origin}"));
            (distance_mm, format!("film: {origin}"))
        }
    };
    let drawing = LensDrawing { fields_deg, distance_mm, wavelengths_nm, film_distance_mm, film_label };
    let path = &arguments.output;
    let bytes = drawing_file(&drawing.to_svg(&used.lens)?, path)?;
    fs::write(staged.path(), bytes).with_context(|| format!("cannot write {}", path.display()))?;
    staged.commit()?;
    remark(common.quiet, &format!("wrote {}", path.display()));
    Ok(())
}
