//! JSON schemas of camera and sensor files, made from the types that the files are read into.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
use dioptric_pipeline::generated_schemas;

/// Writes the schemas into the sources of `dioptric-pipeline`.
pub(crate) fn run() -> anyhow::Result<()> {
    for (name, text) in generated_schemas() {
        let path = path_of(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

fn path_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/pipeline/data").join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemas_are_those_of_the_types() {
        for (name, text) in generated_schemas() {
            let kept = fs::read_to_string(path_of(name)).unwrap();
            assert!(kept == text, "{name} is not that of the types: run `cargo xtask schema`");
        }
    }
}
