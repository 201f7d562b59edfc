//! `dioptric lens ghosts`: the light that pairs of surfaces reflect to the film.

use std::fmt::Write;

use dioptric_analysis::{FilmPlace, FilmUse, GhostTable, GhostTableRequest};
use dioptric_pipeline::{parse_numbers, write_seen_png};

use crate::{
    args::Common,
    lens::{USUAL_NM, list_of, tell, tell_taken},
    lens_args::LensGhostsArgs,
    terminal::{print, print_json, remark},
};

/// Rows of a field that are printed; JSON has all.
const MOST_ROWS: usize = 12;
/// Wavelengths of a picture where none are asked for, nm, and its columns.
const PICTURE_NM: [f64; 14] =
    [420.0, 440.0, 460.0, 480.0, 500.0, 520.0, 540.0, 560.0, 580.0, 600.0, 620.0, 640.0, 660.0, 680.0];
const PICTURE_COLUMNS: usize = 900;
/// Fields where neither the command nor the lens's file names some, degrees.
const USUAL_FIELDS_DEG: [f64; 3] = [0.0, 5.0, 10.0];

pub(crate) fn run(arguments: &LensGhostsArgs, common: &Common) -> anyhow::Result<()> {
    let used = arguments.lens.open(common)?;
    let mut taken = Vec::new();
    let wavelengths_nm = match arguments.bands.nm()? {
        Some(list) => list,
        None => vec![used.wavelength_or_usual()],
    };
    let reference_nm = wavelengths_nm.first().copied().unwrap_or_else(|| used.wavelength_or_usual());
    let distance_mm = arguments.distance_mm.unwrap_or(used.distance_mm);
    if arguments.distance_mm.is_none() && distance_mm.is_finite() {
        taken.push(format!("a source at {} mm", list_of(&[distance_mm])));
    }
    let fields_deg = match (&arguments.fields_deg, used.drawing_fields_deg(reference_nm)) {
        (Some(list), _) => parse_numbers("--fields-deg", list)?,
        (None, Some(fields_deg)) => {
            taken.push(format!("fields of {} degrees", list_of(&fields_deg)));
            fields_deg
        }
        (None, None) => USUAL_FIELDS_DEG.to_vec(),
    };
    tell_taken(&taken, common);
    let used = arguments.lens.state.apply(used, &wavelengths_nm, common)?;
    tell(&used.lens.notes_on_ranges(&wavelengths_nm), common);
    let focus_nm = used.wavelengths_or(&USUAL_NM);
    let weights = used.weights_of(&focus_nm);
    let of = FilmUse { main_nm: used.reference_nm, wavelengths_nm: &focus_nm, weights: &weights, distance_mm };
    let FilmPlace { distance_mm: film_distance_mm, origin } = arguments.film.of(&used).place(&used.lens, of)?;
    remark(common.quiet, &format!("film {film_distance_mm:.4} mm behind the last vertex: {origin}"));
    let film_mm = film_size(&arguments.film_size_mm)?;
    if let Some(out) = &arguments.out {
        let is_png = out.as_os_str() == "-" || out.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("png"));
        anyhow::ensure!(is_png, "{}: ghosts are pictured as .png", out.display());
        let n = fields_deg.len();
        anyhow::ensure!(
            n == 1,
            "--out pictures the ghosts of one source, found {n} fields: expected one, as --fields-deg 10"
        );
    }
    let request = GhostTableRequest {
        fields_deg,
        wavelengths_nm,
        distance_mm,
        film_distance_mm,
        film_mm,
        n_rays: arguments.n_rays,
        bounces: arguments.bounces,
        film_reflectance: arguments.film_reflectance,
    };
    let table = request.compute(&used.lens)?;
    if let Some(out) = &arguments.out {
        let wavelengths_nm = match arguments.bands.nm()? {
            Some(list) => list,
            None => PICTURE_NM.to_vec(),
        };
        let picture = GhostTableRequest { wavelengths_nm, ..request }.picture(&used.lens, PICTURE_COLUMNS)?;
        write_seen_png(&picture, 1, out)?;
        remark(common.quiet, &format!("{}: brightest per cent white", out.display()));
    }
    if common.json { print_json(&table) } else { print(&in_words(&table)?) }
}

/// Returns the width and the height of words as 36x24, mm.
fn film_size(text: &str) -> anyhow::Result<[f64; 2]> {
    let sides = text.split_once(['x', 'X', '×']);
    sides
        .and_then(|(width, height)| Some([width.trim().parse().ok()?, height.trim().parse().ok()?]))
        .ok_or_else(|| anyhow::anyhow!("--film-size-mm is '{text}', expected WxH in mm, as 36x24"))
}

/// Returns the surfaces that reflect light in turn.
fn way_in_words(first: usize, second: usize, then: &[usize]) -> String {
    let way: Vec<String> = [first, second].iter().chain(then).map(usize::to_string).collect();
    way.join(", ")
}

fn in_words(table: &GhostTable) -> anyhow::Result<String> {
    let mut text = format!(
        "{}: light that {} reflect, on a film of {} x {} mm\n",
        table.lens,
        if table.bounces == 2 { "two surfaces".to_owned() } else { format!("2 to {} surfaces", table.bounces) },
        table.film_mm[0],
        table.film_mm[1]
    );
    for field in &table.fields {
        let veil = field
            .veil
            .map_or_else(|| "the image is beside the film".to_owned(), |veil| format!("veil {veil:.3e} of the image"));
        let glare = field.veiling_glare.map_or_else(String::new, |share| {
            format!("veiling glare there of even light from all sides: {:.3} %\n", 100.0 * share)
        });
        let glare = glare.as_str();
        writeln!(
            text,
            "\nfield {} degrees, {} nm: {:.2} % of the light on the front rim arrives, at y {:.3} mm; {veil}",
            field.field_deg,
            field.wavelength_nm,
            100.0 * field.image.power,
            field.image.y_mm
        )?;
        let percent = |share: f64| format!("{:.3} %", 100.0 * share);
        let [film, beside_film, reflected, glass, coatings, clipped, beyond] = field.account.shares();
        writeln!(
            text,
            "{glare}on the film {} of it, beside it {}; out in front {}; in glass {}, coatings {}; ended by rims {}; reflected more often \
             {beyond:.1e}",
            percent(film),
            percent(beside_film),
            percent(reflected),
            percent(glass),
            // Series of coatings that take nothing end a little above or below.
            percent(coatings.max(0.0)),
            percent(clipped)
        )?;
        writeln!(
            text,
            "{:>13} {:>12} {:>14} {:>10} {:>10} {:>10} {:>9}",
            "surfaces", "over image", "1/mm2 of it", "x mm", "y mm", "rms mm", "times"
        )?;
        for row in field.ghosts.iter().take(MOST_ROWS) {
            writeln!(
                text,
                "{:>13} {:>12.3e} {:>14.3e} {:>10.3} {:>10.3} {:>10.3} {:>9.3}",
                way_in_words(row.first, row.second, &row.then),
                row.relative_power,
                row.relative_irradiance_per_mm2,
                row.landing.x_mm,
                row.landing.y_mm,
                row.landing.rms_radius_mm,
                row.magnification
            )?;
        }
        let more = field.ghosts.len().saturating_sub(MOST_ROWS);
        if more > 0 {
            writeln!(text, "{:>13} more (--json has all)", more)?;
        }
    }
    if let Some(worst) = table.pairs.first() {
        writeln!(
            text,
            "\n{} {}; the brightest, surfaces {}, has {:.3e} of the image at {} degrees and {} nm",
            table.pairs.len(),
            if table.bounces == 2 { "pairs" } else { "ways" },
            way_in_words(worst.first, worst.second, &worst.then),
            worst.relative_power,
            worst.worst_field_deg,
            worst.worst_wavelength_nm
        )?;
    } else {
        text += "\nno surface reflects\n";
    }
    Ok(text)
}
