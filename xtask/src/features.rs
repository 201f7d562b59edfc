//! Features: programs and tests of the workspace, with and without PNG drawings, are built with the same features of all other
//! crates, so that none compiles again what another has compiled.

use std::{collections::BTreeSet, process::Command};

use anyhow::{Context, ensure};

/// Names the crates of which tests or PNG drawings turn on more features; the crates of drawings must have been fetched.
pub(crate) fn run() -> anyhow::Result<()> {
    check(&["--edges", "normal,build,dev"], "tests turn")?;
    check(&["--edges", "normal,build,dev", "--features", "png"], "the feature png turns")
}

fn check(more: &[&str], words: &str) -> anyhow::Result<()> {
    let (built, with_more) = (crates_with_features(&["--edges", "normal,build"])?, crates_with_features(more)?);
    let differing: Vec<&str> = built.difference(&with_more).map(String::as_str).collect();
    ensure!(
        differing.is_empty(),
        "{words} on more features of {}: name those in xtask/Cargo.toml, or everything is compiled twice",
        differing.join(", ")
    );
    Ok(())
}

/// Returns the crates that the workspace does not hold and uses by these kinds of dependencies, each with its features.
fn crates_with_features(arguments: &[&str]) -> anyhow::Result<BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--workspace", "--offline", "--prefix", "none", "--format", "{p} {f}"])
        .args(arguments)
        .output()
        .context("cargo tree")?;
    ensure!(output.status.success(), "cargo tree: {}", String::from_utf8_lossy(&output.stderr).trim());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let crates = text.lines().map(|line| line.trim_end_matches("(*)").trim().to_owned());
    Ok(crates.filter(|name| !name.starts_with("dioptric")).collect())
}

#[cfg(test)]
mod tests {
    #[test]
    fn tests_turn_on_no_features() {
        super::check(&["--edges", "normal,build,dev"], "tests turn").unwrap();
    }
}
