//! `dioptric studio`: starts the program that has the window, so that this one needs none of what draws it.

use std::{
    env, io,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, bail};

use crate::args::StudioArgs;

/// The program of the window.
const PROGRAM: &str = "dioptric-studio";

pub(crate) fn run(arguments: &StudioArgs) -> anyhow::Result<()> {
    if let Some(camera) = &arguments.camera {
        std::fs::metadata(camera).with_context(|| format!("cannot read {}", camera.display()))?;
    }
    let beside = env::current_exe().ok().and_then(|own| beside(&own));
    // A name without a folder is looked for in PATH.
    let program = beside.unwrap_or_else(|| PathBuf::from(PROGRAM));
    let status = match Command::new(&program).args(&arguments.camera).status() {
        Ok(status) => status,
        Err(error) if error.kind() == io::ErrorKind::NotFound => bail!(
            "the window is a program of its own, {PROGRAM}, which is neither beside this one nor in PATH; \
             `cargo run --release -p {PROGRAM}` in the source of dioptric builds and starts it"
        ),
        Err(error) => return Err(error).with_context(|| format!("cannot start {}", program.display())),
    };
    if !status.success() {
        bail!("{PROGRAM} ended with an error");
    }
    Ok(())
}

/// Returns the window's program in the folder of this one, if it is there.
fn beside(own: &Path) -> Option<PathBuf> {
    let path = own.with_file_name(format!("{PROGRAM}{}", env::consts::EXE_SUFFIX));
    path.is_file().then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_beside_this_one_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("dioptric");
        assert_eq!(beside(&own), None);
        let program = folder.path().join(format!("{PROGRAM}{}", env::consts::EXE_SUFFIX));
        std::fs::write(&program, "").unwrap();
        assert_eq!(beside(&own), Some(program));
    }
}
