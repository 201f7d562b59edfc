//! Features: programs and tests of the workspace are built with the same features of all crates, so that neither compiles again
//! what the other has compiled.

use std::{collections::BTreeSet, process::Command};

use anyhow::{Context, ensure};

/// Compares the features with and without those that development dependencies turn on, and names the crates that differ.
pub(crate) fn run() -> anyhow::Result<()> {
    let (built, tested) = (crates_with_features("normal,build")?, crates_with_features("normal,build,dev")?);
    let differing: Vec<&str> = built.difference(&tested).map(String::as_str).collect();
    ensure!(
        differing.is_empty(),
        "tests turn on more features of {}: name those in xtask/Cargo.toml, or everything is compiled twice",
        differing.join(", ")
    );
    Ok(())
}

/// Returns the crates that the workspace uses by these kinds of dependencies, each with its features.
fn crates_with_features(kinds: &str) -> anyhow::Result<BTreeSet<String>> {
    let arguments = ["tree", "--workspace", "--offline", "--prefix", "none", "--format", "{p} {f}", "--edges", kinds];
    let output = Command::new(env!("CARGO")).args(arguments).output().context("cargo tree")?;
    ensure!(output.status.success(), "cargo tree: {}", String::from_utf8_lossy(&output.stderr).trim());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    Ok(text.lines().map(|line| line.trim_end_matches("(*)").trim().to_owned()).collect())
}

#[cfg(test)]
mod tests {
    #[test]
    fn tests_turn_on_no_features() {
        super::run().unwrap();
    }
}
