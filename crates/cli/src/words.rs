//! `dioptric completions` and `dioptric man`: the words of the command line, for shells and readers.

use std::{fs, path::Path};

use anyhow::Context;
use clap_complete::Shell;
use dioptric_pipeline::Staged;

use crate::{
    args::{Cli, Common},
    terminal::{print, remark},
};

/// Prints what completes the words in a shell.
pub(crate) fn completions(shell: Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::words(), "dioptric", &mut script);
    print(&String::from_utf8(script)?)
}

/// Writes a page for each command.
pub(crate) fn manual(folder: &Path, common: &Common) -> anyhow::Result<()> {
    let staged = Staged::folder(folder)?;
    clap_mangen::generate_to(Cli::words(), staged.path())
        .with_context(|| format!("cannot write to {}", folder.display()))?;
    let n_pages = fs::read_dir(staged.path()).with_context(|| folder.display().to_string())?.count();
    staged.commit()?;
    remark(common.quiet, &format!("wrote {n_pages} pages to {}", folder.display()));
    Ok(())
}
