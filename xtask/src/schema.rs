//! JSON schemas of camera, sensor and plan files, made from the types that the files are read into.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
/// Writes the schemas into the sources of the crates that have the types.
pub(crate) fn run() -> anyhow::Result<()> {
    for (path, text) in schemas() {
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Returns all schemas with the places of their files.
fn schemas() -> Vec<(PathBuf, String)> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
    let place = |of: &str, (name, text): (&str, String)| (crates.join(of).join("data").join(name), text);
    let cameras = dioptric_pipeline::generated_schemas().map(|schema| place("pipeline", schema));
    cameras.into_iter().chain([place("sweep", dioptric_sweep::generated_schema())]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemas_are_those_of_the_types() {
        for (path, text) in schemas() {
            let kept = fs::read_to_string(&path).unwrap();
            assert!(kept == text, "{} is not that of the types: run `cargo xtask schema`", path.display());
        }
    }
}
