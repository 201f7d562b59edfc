//! The command line of dioptric.
//!
//! `args` holds the words; each subcommand has its file and calls `dioptric-pipeline`, which does the work. An error
//! ends in one sentence on standard error and a status that is not 0, and leaves no half-written file.

mod analyze;
mod args;
mod camera;
mod common;
mod compare;
mod develop;
mod examples;
mod filter;
mod glass;
mod iris_args;
mod lens;
mod lens_args;
mod lens_compare;
mod lens_ghosts;
mod light_field;
mod measure;
mod measure_args;
mod measure_charts;
mod measure_output;
mod memory;
mod movement_args;
mod paintings;
mod picture_args;
mod psf;
mod ranges;
mod refused;
mod render;
mod render_args;
mod run;
mod scene;
mod scene_args;
mod sense;
mod show;
mod studio;
mod sweep;
mod terminal;
mod trace;
mod video;
mod video_args;
mod words;
mod world;

#[cfg(test)]
mod documentation;

use std::process::ExitCode;

use anyhow::Context;
use dioptric_files::WriteError;

use crate::{
    args::{Cli, Command, Common},
    terminal::ClosedPipe,
};

fn main() -> ExitCode {
    let (cli, in_range) = Cli::read(std::env::args_os()).unwrap_or_else(|error| {
        let Some(sentence) = refused::sentence(&Cli::words(), &error) else { error.exit() };
        terminal::print_error(&anyhow::Error::msg(sentence));
        std::process::exit(terminal::WRONG_LINE)
    });
    terminal::remove_partial_files_on_interrupt();
    if !matches!(cli.command, Command::Studio(_)) {
        memory::keep_freed();
    }
    match in_range.and_then(|()| dispatch(cli)) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read the output has seen enough.
        Err(error) if error.is::<ClosedPipe>() || is_closed(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::print_error(&error);
            ExitCode::FAILURE
        }
    }
}

/// Whether a file could not be written since nobody reads it any more.
fn is_closed(error: &anyhow::Error) -> bool {
    error.downcast_ref::<WriteError>().is_some_and(|error| error.is_closed)
}

fn dispatch(Cli { command, common }: Cli) -> anyhow::Result<()> {
    dioptric_files::memory::allow(common.memory);
    use_threads(&common)?;
    match command {
        Command::Run(arguments) => run::run(&arguments, &common),
        Command::Lens(command) => lens::run(&command, &common),
        Command::Scene(command) => scene::run(&command, &common),
        Command::Camera(command) => camera::run(&command, &common),
        Command::Sensor(command) => camera::run_sensor(&command, &common),
        Command::Filter(command) => filter::run(&command, &common),
        Command::Glass(command) => glass::run(&command, &common),
        Command::Trace(arguments) => trace::run(&arguments, &common),
        Command::Video(arguments) => video::run(&arguments, &common),
        Command::Psf(arguments) => psf::run(&arguments, &common),
        Command::Render(arguments) => render::run(&arguments, &common),
        Command::World(command) => world::run(&command, &common),
        Command::Compare(arguments) => compare::run(&arguments, &common),
        Command::LightField(arguments) => light_field::run(&arguments, &common),
        Command::Sense(arguments) => sense::run(&arguments, &common),
        Command::Develop(arguments) => develop::run(&arguments, &common),
        Command::Show(arguments) => show::run(&arguments, &common),
        Command::Sweep(arguments) => sweep::run(&arguments, &common),
        Command::Measure(command) => measure::run(&command, &common),
        Command::Studio(arguments) => studio::run(&arguments),
        Command::Cache(command) => paintings::run(command, &common),
        Command::Completions { shell } => words::completions(shell),
        Command::Man { out } => words::manual(&out, &common),
    }
}

/// More threads than these only take memory.
const THREADS_PER_CORE: usize = 4;

fn use_threads(common: &Common) -> anyhow::Result<()> {
    let Some(asked) = common.threads.map(|n| n as usize) else { return Ok(()) };
    let most = THREADS_PER_CORE * std::thread::available_parallelism().map_or(1, usize::from);
    let n_threads = asked.min(most);
    if n_threads < asked {
        terminal::remark(
            common.quiet,
            &format!("{n_threads} threads in place of {asked}: {THREADS_PER_CORE} per core"),
        );
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(n_threads)
        .build_global()
        .with_context(|| format!("cannot start {n_threads} threads"))
}
