//! `cargo xtask figures`: the paper's figures, drawn anew.

use std::{fs, path::Path};

use anyhow::Context;
use dioptric_report::{Drawing, draw_all, draw_figure4};

/// Where the worlds of the figures are.
const WORLDS: &str = "fixtures/worlds";

/// Draws every figure and writes it into a folder.
pub(crate) fn run(folder: &Path) -> anyhow::Result<()> {
    write(&draw_all(Path::new(WORLDS), &|name| println!("{name}"))?, folder)
}

/// Draws Figure 4 alone.
pub(crate) fn run_figure4(folder: &Path) -> anyhow::Result<()> {
    write(&draw_figure4(Path::new(WORLDS), &|name| println!("{name}"))?, folder)
}

fn write(drawings: &[Drawing], folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for drawing in drawings {
        let path = folder.join(&drawing.name);
        fs::write(&path, &drawing.bytes).with_context(|| format!("cannot write {}", path.display()))?;
        println!("wrote {}", path.display());
    }
    Ok(())
}
