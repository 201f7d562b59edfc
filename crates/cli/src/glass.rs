//! `dioptric glass`: the catalogue.

use std::fmt::Write;

use dioptric_analysis::{GlassRow, glass_data, glass_rows};
use dioptric_pipeline::parse_numbers;

use crate::{
    args::Common,
    lens_args::GlassCommand,
    terminal::{print, print_json},
};

pub(crate) fn run(command: &GlassCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        GlassCommand::List { filter } => list(filter.as_deref(), common),
        GlassCommand::Show { name, wavelengths_nm } => show(name, wavelengths_nm, common),
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

fn show(name: &str, wavelengths_nm: &str, common: &Common) -> anyhow::Result<()> {
    let data = glass_data(name, &parse_numbers("--wavelengths-nm", wavelengths_nm)?)?;
    if common.json {
        return print_json(&data);
    }
    let mut text = format!("{}  {}\n", data.glass.name, data.glass.maker);
    if let (Some(nd), Some(vd)) = (data.glass.nd, data.glass.vd) {
        writeln!(text, "n_d {nd:.6}   V_d {vd:.3}")?;
    }
    writeln!(text, "\n{:>14} {:>12} {:>14}", "wavelength nm", "index", "through 10 mm")?;
    for (i, (wavelength_nm, index)) in data.wavelengths_nm.iter().zip(&data.indices).enumerate() {
        let through = data.transmittances_10_mm[i].map_or("–".to_owned(), |share| format!("{share:.4}"));
        writeln!(text, "{wavelength_nm:>14} {index:>12.7} {through:>14}")?;
    }
    print(&text)
}
