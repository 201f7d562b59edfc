//! `dioptric psf`: point-spread functions and what is measured of them.

use std::fmt::Write;

use dioptric_analysis::{AnalysisFilm, LensDefaults, PsfRequest, PsfRow, PsfSampling, PsfSet, psf_csv};
use dioptric_pipeline::{PsfFile, REFERENCE_WAVELENGTH_NM, RetiredBank, Staged, parse_directions, parse_numbers};
use dioptric_report::{PsfFormat, chart_svg, psf_page, write_drawing, write_psfs};

use crate::{
    args::{Common, PsfArgs, PsfMode},
    lens::{USUAL_NM, list_of, pairs_in_words, tell, tell_taken},
    run::{diffraction, with_gamma},
    terminal::{Bar, fixed, print, print_json, remark, remark_on_png},
};

/// Pixels of a plot as PNG for each of the drawing's own.
const PNG_SCALE: f64 = 2.0;

/// The seed where the user gives none.
const SEED: u64 = 1;

pub(crate) fn run(arguments: &PsfArgs, common: &Common) -> anyhow::Result<()> {
    let used = arguments.lens.open(common)?;
    let Points { fields_deg, distances_mm, wavelengths_nm, film, focus_nm, spectral_weights } =
        points(arguments, &used, common)?;
    let stored = arguments.psfs.as_deref().map(PsfFile::read).transpose()?;
    let request = PsfRequest {
        fields_deg,
        distances_mm,
        wavelengths_nm,
        film,
        focus_nm,
        main_nm: used.reference_nm,
        diffraction: with_gamma(diffraction(arguments.diffraction), arguments.gamma)?,
        pixel_um: arguments.pixel_um,
        size: arguments.size,
        sampling: match (&stored, arguments.mode) {
            (Some(file), _) => PsfSampling::Stored(file.array.clone()),
            (None, PsfMode::Pupil) => PsfSampling::Pupil,
            (None, PsfMode::Paper) => PsfSampling::Paper { n_across: arguments.rays, jitter: !arguments.exact_grid },
        },
        mtf_per_mm: match &arguments.mtf_per_mm {
            Some(list) => parse_numbers("--mtf-per-mm", list)?,
            None => Vec::new(),
        },
        seed: common.seed.unwrap_or(SEED),
        spectral_weights,
    };
    let lens = arguments.lens.state.apply(used, &request.wavelengths_nm, common)?.lens;
    let mut notes = lens.notes_on_ranges(&request.wavelengths_nm);
    notes.extend(stored.iter().filter_map(|file| file.note_on_ends(&request.fields_deg, &request.distances_mm)));
    notes.extend(stored.into_iter().flat_map(|file| file.notes));
    let is_old = arguments.bank.is_some() || arguments.bank_error.is_some();
    notes.extend(is_old.then(|| RetiredBank::STATED.note()).flatten());
    tell(&notes, common);
    // The place is tried before the work.
    let format = arguments.output.as_deref().map(PsfFormat::of).transpose()?;
    let staged = arguments.output.as_ref().map(|path| Staged::file(path)).transpose()?;
    let csv = arguments.csv.as_ref().map(|path| Staged::file(path)).transpose()?;
    let plots = arguments.plots.as_ref().map(|folder| Staged::folder(folder)).transpose()?;
    let bar = Bar::new(common.quiet);
    bar.show("tracing the lens", 0.0);
    let set = request.compute(&lens)?;
    drop(bar);
    let mut dark_deg: Vec<[f64; 2]> =
        set.rows.iter().filter(|row| row.is_dark()).map(|row| [row.field_deg, row.field_y_deg]).collect();
    dark_deg.dedup();
    if !dark_deg.is_empty() {
        let fields = pairs_in_words(&dark_deg);
        tell(
            &[format!(
                "no light of fields of {fields} degrees reaches the film: what is measured of them is no number"
            )],
            common,
        );
    }
    let rows = match arguments.polychromatic {
        true => with_polychromatic(&set, &request.mtf_per_mm),
        false => set.rows.clone(),
    };
    let is_printed = [&staged, &csv].into_iter().flatten().any(Staged::is_standard_output);
    if let (Some(staged), Some(path)) = (csv, &arguments.csv) {
        std::fs::write(staged.path(), psf_csv(&rows))?;
        staged.commit()?;
        remark(common.quiet, &format!("wrote {}", path.display()));
    }
    if let (Some(staged), Some(path), Some(format)) = (staged, &arguments.output, format) {
        write_psfs(&set, staged.path(), format)?;
        staged.commit()?;
        remark(common.quiet, &format!("wrote {}", path.display()));
    }
    if let (Some(staged), Some(folder)) = (plots, &arguments.plots) {
        let (names, charts): (Vec<_>, Vec<_>) = set.charts(&request.through_focus(&lens, &set)?).into_iter().unzip();
        for (name, chart) in names.iter().zip(&charts) {
            let svg = chart_svg(chart, 640.0, 420.0);
            write_drawing(&svg, staged.path(), name, PNG_SCALE)?;
            std::fs::write(staged.path().join(format!("{name}.csv")), chart.to_csv())?;
        }
        let page = psf_page(&set, lens.name(), &charts, &(table(&set, &rows)? + &lines(&notes)))?;
        std::fs::write(staged.path().join("report.html"), page)?;
        staged.commit()?;
        remark(common.quiet, &format!("wrote plots into {}", folder.display()));
        remark_on_png(common.quiet);
    }
    match (is_printed, common.json) {
        (true, _) => Ok(()),
        (false, true) => print_json(&rows),
        (false, false) => print(&table(&set, &rows)?),
    }
}

/// Which points are looked at, and where the film is.
struct Points {
    fields_deg: Vec<[f64; 2]>,
    distances_mm: Vec<f64>,
    wavelengths_nm: Vec<f64>,
    film: AnalysisFilm,
    /// Wavelengths that are in focus together, nm.
    focus_nm: Vec<f64>,
    spectral_weights: Vec<f64>,
}

/// Returns what is asked for; where it is not said, what the lens's file says.
fn points(arguments: &PsfArgs, used: &LensDefaults, common: &Common) -> anyhow::Result<Points> {
    let mut taken = Vec::new();
    let film = arguments.film.of(used);
    if let AnalysisFilm::OfFile(film_mm) = film {
        taken.push(format!("the film at {} mm", list_of(&[film_mm])));
    }
    let asked_nm = arguments.bands.nm()?;
    let wavelengths_nm = asked_nm.clone().unwrap_or_else(|| used.wavelengths_or(&[REFERENCE_WAVELENGTH_NM]));
    if asked_nm.is_none() && wavelengths_nm != [REFERENCE_WAVELENGTH_NM] {
        taken.push(format!("wavelengths of {} nm", list_of(&wavelengths_nm)));
    }
    let fields_of_file = || used.psf_fields_deg(used.wavelength_or_usual());
    let fields_deg = match (&arguments.fields_deg, arguments.fields_deg.is_none().then(fields_of_file).flatten()) {
        (Some(list), _) => fields_of(list, arguments.field_y_deg)?,
        (None, Some(fields_deg)) => {
            taken.push(format!("fields of {} degrees", pairs_in_words(&fields_deg)));
            fields_deg
        }
        (None, None) => vec![[0.0, arguments.field_y_deg]],
    };
    let distances_mm = match &arguments.distances_mm {
        Some(list) => parse_numbers("--distances-mm", list)?,
        // The film that a file states is that of its own object.
        None if used.distance_mm.is_finite() || matches!(film, AnalysisFilm::OfFile(_)) => {
            taken.push(match used.distance_mm.is_finite() {
                true => format!("an object at {} mm", list_of(&[used.distance_mm])),
                false => "a far object".to_owned(),
            });
            vec![used.distance_mm]
        }
        // What is in focus, or else far.
        None => match film {
            AnalysisFilm::FocusMm(distance_mm) => vec![distance_mm],
            _ => vec![used.distance_mm],
        },
    };
    let focus_nm = if asked_nm.is_none() { used.wavelengths_or(&USUAL_NM) } else { Vec::new() };
    let spectral_weights = match (&arguments.spectral_weights, asked_nm) {
        (Some(list), _) => parse_numbers("--spectral-weights", list)?,
        (None, None) => used.weights_of(&wavelengths_nm),
        (None, Some(_)) => Vec::new(),
    };
    tell_taken(&taken, common);
    Ok(Points { fields_deg, distances_mm, wavelengths_nm, film, focus_nm, spectral_weights })
}

/// Returns the fields of a list: angles to the right, which take the angle upwards of all, x/y or ANGLE@AZIMUTH.
fn fields_of(list: &str, field_y_deg: f64) -> anyhow::Result<Vec<[f64; 2]>> {
    let is_direction = |item: &&str| item.contains(['/', '@']);
    if field_y_deg != 0.0 && list.split(',').any(|item| is_direction(&item)) {
        anyhow::bail!("--field-y-deg is {field_y_deg}, expected none beside fields that have their own ({list})");
    }
    let mut fields_deg = Vec::new();
    for item in list.split(',') {
        match is_direction(&item) {
            true => fields_deg.extend(parse_directions("--fields-deg", item)?),
            false => fields_deg.extend(parse_numbers("--fields-deg", item)?.into_iter().map(|x| [x, field_y_deg])),
        }
    }
    Ok(fields_deg)
}

/// Returns the rows with one more after those of each point: the light of all its wavelengths together.
fn with_polychromatic(set: &PsfSet, mtf_per_mm: &[f64]) -> Vec<PsfRow> {
    let mut rows = set.rows.clone();
    for whole in set.polychromatic(mtf_per_mm).into_iter().rev() {
        let row = whole.row;
        let of_point = |other: &PsfRow| other.field_deg == row.field_deg && other.distance_mm == row.distance_mm;
        let after = rows.iter().rposition(of_point).map_or(rows.len(), |last| last + 1);
        rows.insert(after, row);
    }
    rows
}

/// Returns the field of a row: to the right, and upwards where it lies above the axis.
fn field_cell(row: &PsfRow) -> String {
    match row.field_y_deg == 0.0 {
        true => fixed(row.field_deg, 3),
        false => format!("{}/{}", fixed(row.field_deg, 2), fixed(row.field_y_deg, 2)),
    }
}

fn lines(notes: &[String]) -> String {
    notes.iter().map(|note| format!("\n{note}\n")).collect()
}

fn table(set: &PsfSet, rows: &[PsfRow]) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "film {:.4} mm behind the last vertex: {}; pixels of {} µm\n",
        set.film_distance_mm, set.film, set.pixel_um
    );
    text.push('\n');
    writeln!(
        text,
        "{:>9} {:>12} {:>8} {:>12} {:>12} {:>10} {:>10} {:>10} {:>10} {:>10} {:>8}",
        "field °",
        "distance mm",
        "λ nm",
        "centroid x",
        "centroid y",
        "rms µm",
        "σx µm",
        "σy µm",
        "LSF µm",
        "EE50 µm",
        "energy"
    )?;
    for row in rows {
        writeln!(
            text,
            "{:>9} {:>12.1} {:>8} {:>12} {:>12} {:>10.3} {:>10.3} {:>10.3} {:>10.3} {:>10.3} {:>8.4}",
            field_cell(row),
            row.distance_mm,
            if row.is_polychromatic { "all".to_owned() } else { format!("{:.1}", row.wavelength_nm) },
            fixed(row.centroid_x_mm, 5),
            fixed(row.centroid_y_mm, 5),
            row.rms_radius_um,
            row.sigma_x_um,
            row.sigma_y_um,
            row.lsf_fwhm_um,
            row.ee50_radius_um,
            row.energy
        )?;
        if row.is_cut() {
            let share = 100.0 * row.picture_share;
            writeln!(text, "{:>31} holds {share:.1} % of the light: LSF and EE50 are of that part", "picture")?;
        }
        if let Some(share) = row.wave_fraction.filter(|_| row.is_of_waves()) {
            write!(text, "{:>31} waves {:.0} %", "model", 100.0 * share)?;
            writeln!(text, "{}", row.strehl.map_or_else(String::new, |strehl| format!(", Strehl ratio {strehl:.4}")))?;
        }
        if row.measured_on == "coarser pixels" {
            let share = 100.0 * row.picture_share;
            writeln!(
                text,
                "{:>31} holds {share:.1} % of the light: LSF and EE50 are of all, on coarser pixels",
                "picture"
            )?;
        } else if row.measured_on != "picture" {
            writeln!(text, "{:>31} LSF, EE50 and MTF by {}, free of pixels", "measured", row.measured_on)?;
        }
        if let Some(reason) = &row.fallback {
            writeln!(text, "{:>31} HURB in place of the diffraction integral: {reason}", "model")?;
        }
        for mtf in &row.mtf {
            writeln!(
                text,
                "{:>31} {:>8.2}/mm  tangential {:.4}  sagittal {:.4}{}",
                "MTF",
                mtf.cycles_per_mm,
                mtf.tangential,
                mtf.sagittal,
                mtf.limit.map_or_else(String::new, |[limit, _]| format!("  diffraction limit {limit:.4}"))
            )?;
        }
    }
    Ok(text)
}
