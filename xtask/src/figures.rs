//! `cargo xtask figures`: the paper's figures, drawn anew.

use std::{fs, path::Path};

use anyhow::Context;
use dioptric_report::draw_all;

/// Draws every figure and writes it into a folder.
pub(crate) fn run(folder: &Path) -> anyhow::Result<()> {
    let drawings = draw_all(&|name| println!("{name}"))?;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for drawing in drawings {
        let path = folder.join(&drawing.name);
        fs::write(&path, &drawing.bytes).with_context(|| format!("cannot write {}", path.display()))?;
        println!("wrote {}", path.display());
    }
    Ok(())
}
