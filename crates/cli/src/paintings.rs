//! What the program keeps from run to run, and `dioptric cache`.

use std::{env, path::PathBuf};

use anyhow::{Context, bail};
use clap::Subcommand;
use dioptric_pipeline::{PaintingFolder, program_build};
use serde::Serialize;

use crate::{
    common::Common,
    terminal::{fixed, print, print_json},
};

/// Something to do with what is kept.
#[derive(Clone, Copy, Debug, Subcommand)]
pub(crate) enum CacheCommand {
    /// Says where the views of scenes are that runs keep for the next, and how much they take
    Info,
    /// Removes them; the next run looks at its scene anew
    Clear,
}

/// What is kept, or was.
#[derive(Serialize)]
struct Kept<'a> {
    folder: &'a str,
    views: usize,
    bytes: u64,
}

pub(crate) fn run(command: CacheCommand, common: &Common) -> anyhow::Result<()> {
    let Some(kept) = painting_folder() else {
        bail!("there is no cache: DIOPTRIC_CACHE is empty, or this user has no home; nothing is kept from run to run");
    };
    let folder = kept.path().display().to_string();
    let (done, (views, bytes)) = match command {
        CacheCommand::Info => ("", kept.kept()),
        CacheCommand::Clear => {
            ("removed from ", kept.clear().with_context(|| format!("cannot remove all that is kept in {folder}"))?)
        }
    };
    if common.json {
        return print_json(&Kept { folder: &folder, views, bytes });
    }
    let noun = if views == 1 { "view" } else { "views" };
    let mib = fixed(bytes as f64 / (1 << 20) as f64, 1);
    print(&format!("{done}{folder}: {views} {noun}, {mib} MiB\n"))
}

/// Returns the user's folder of paintings, `None` where there is none or none is wanted.
pub(crate) fn painting_folder() -> Option<PaintingFolder> {
    PaintingFolder::of_user(&program()?)
}

/// Returns what tells this program from another build of it.
pub(crate) fn build() -> Option<String> {
    program_build(&program()?)
}

fn program() -> Option<PathBuf> {
    env::current_exe().ok()
}
