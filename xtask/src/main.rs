//! Project chores: `cargo xtask book`, `features`, `layers`, `modules`, `packages`, `prose`, `schema`, `figures [4 | --out DIR]`.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a command-line tool talks to its user")]

mod book;
mod features;
mod figures;
mod layers;
mod modules;
mod packages;
mod prose;
mod schema;

use std::{path::Path, process::ExitCode};

const USAGE: &str =
    "usage: cargo xtask book | features | layers | modules | packages | prose | schema | figures [4 | --out DIR]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["book"] => book::run(),
        ["features"] => features::run(),
        ["layers"] => layers::run(),
        ["modules"] => modules::run(),
        ["packages"] => packages::run(),
        ["prose"] => prose::run(),
        ["schema"] => schema::run(),
        ["figures"] => figures::run(Path::new("docs/figures")),
        ["figures", "4"] => figures::run_figure4(Path::new("docs/figures")),
        ["figures", "--out", folder] => figures::run(Path::new(folder)),
        _ => Err(anyhow::anyhow!(USAGE)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
