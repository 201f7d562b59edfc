//! `dioptric filter`: what may be put before a lens.

use std::fmt::Write;

use clap::Subcommand;
use dioptric_analysis::built_in_filters;
use dioptric_pipeline::FilterSpec;

use crate::{
    common::Common,
    terminal::{print, print_json},
};

/// Something to do with filters.
#[derive(Debug, Subcommand)]
pub(crate) enum FilterCommand {
    /// Lists the built-in filters, and how others are named by numbers
    List,
    /// Prints a filter as a filter file: its name, source and transmittance
    Show {
        /// Filter: a built-in one, a file, or one named by numbers as nd:0.9 or glass:N-BK7:3mm
        filter: FilterSpec,
    },
}

pub(crate) fn run(command: &FilterCommand, common: &Common) -> anyhow::Result<()> {
    match command {
        FilterCommand::List => list(common),
        FilterCommand::Show { filter } => {
            let filter = filter.open()?;
            if common.json { print_json(&filter) } else { print(&(filter.to_ron() + "\n")) }
        }
    }
}

fn list(common: &Common) -> anyhow::Result<()> {
    let rows = built_in_filters()?;
    if common.json {
        return print_json(&rows);
    }
    let mut text =
        format!("{:<14} {:>8} {:>8} {:>9} {:>9}  {}\n", "name", "from nm", "to nm", "in D65 %", "in A %", "what it is");
    for row in rows {
        writeln!(
            text,
            "{:<14} {:>8} {:>8} {:>9.2} {:>9.2}  {}",
            row.name,
            row.first_nm,
            row.last_nm,
            100.0 * row.luminous_d65,
            100.0 * row.luminous_a,
            row.title
        )?;
    }
    writeln!(text, "\nalso {}", FilterSpec::PATTERNS)?;
    print(&text)
}
