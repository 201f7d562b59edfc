//! `dioptric glass`: the catalogue.

use std::fmt::Write;

use dioptric_analysis::{GlassRow, glass_data, glass_rows};
use dioptric_pipeline::{GlassRange, number};

use crate::{
    args::Common,
    lens_args::{BandArgs, GlassCommand},
    terminal::{print, print_json},
};

pub(crate) fn run(command: &GlassCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        GlassCommand::List { filter } => list(filter.as_deref(), common),
        GlassCommand::Show { name, catalog, bands, glass_range } => {
            show((name, catalog), bands, glass_range.map(GlassRange::from).unwrap_or_default(), common)
        }
    }
}

fn list(filter: Option<&str>, common: &Common) -> anyhow::Result<()> {
    let rows = glass_rows(filter.unwrap_or_default());
    if common.json {
        return print_json(&rows);
    }
    let mut text =
        format!("{:<20} {:<12} {:>9} {:>8} {:>10} {:>10}\n", "name", "maker", "n_d", "V_d", "from nm", "to nm");
    for row in rows {
        let GlassRow { name, maker, nd, vd, first_nm, last_nm } = row;
        let cell = |value: Option<f64>, digits: usize| value.map_or("–".to_owned(), |v| format!("{v:.digits$}"));
        let (nd, vd) = (cell(nd, 5), cell(vd, 2));
        let (first, last) = (cell(first_nm, 1), cell(last_nm, 1));
        writeln!(text, "{name:<20} {maker:<12} {nd:>9} {vd:>8} {first:>10} {last:>10}")?;
    }
    print(&text)
}

fn show(
    (name, makers): (&str, &[String]),
    bands: &BandArgs,
    glass_range: GlassRange,
    common: &Common,
) -> anyhow::Result<()> {
    let data = glass_data(name, makers, bands.nm()?, glass_range)?;
    if common.json {
        return print_json(&data);
    }
    let mut text = format!("{}  {}\n", data.glass.name, data.glass.maker);
    if let (Some(nd), Some(vd)) = (data.glass.nd, data.glass.vd) {
        writeln!(text, "n_d {nd:.6}   V_d {vd:.3}")?;
    }
    let is_extended = data.possible_errors.iter().any(|error| *error > 0.0);
    let last = if is_extended { "  may be off by" } else { "" };
    writeln!(text, "\n{:>14} {:>12} {:>14}{last}", "wavelength nm", "index", "through 10 mm")?;
    for (i, (wavelength_nm, index)) in data.wavelengths_nm.iter().zip(&data.indices).enumerate() {
        let through = data.transmittances_10_mm[i].map_or("–".to_owned(), |share| format!("{share:.4}"));
        let off = match data.possible_errors[i] {
            error if error > 0.0 => format!(" {error:>14.1e}"),
            _ => String::new(),
        };
        writeln!(text, "{:>14} {index:>12.7} {through:>14}{off}", number(*wavelength_nm))?;
    }
    print(&text)
}
