//! Packages: each crate that is published holds its licence and README, and nothing that it needs lies outside of it.

use std::{fs, path::Path, process::Command};

use anyhow::{Context, bail, ensure};
use cargo_metadata::{DependencyKind, MetadataCommand, Package};

/// Checks all crates that are published and names the first thing that is missing.
pub(crate) fn run() -> anyhow::Result<()> {
    let metadata = MetadataCommand::new().no_deps().exec().context("cargo metadata")?;
    let is_published = |package: &&Package| package.publish.as_ref().is_none_or(|registries| !registries.is_empty());
    for package in metadata.packages.iter().filter(is_published) {
        check_manifest(package)?;
        let folder = package.manifest_path.parent().context("a manifest lies in a folder")?;
        check_includes(folder.as_std_path(), &folder.join("src").into_std_path_buf())?;
        let output = Command::new(env!("CARGO"))
            .args(["package", "--list", "--allow-dirty", "--package", &package.name])
            .output()
            .context("cargo package")?;
        ensure!(output.status.success(), "{}: {}", package.name, String::from_utf8_lossy(&output.stderr).trim());
        let files = String::from_utf8_lossy(&output.stdout).into_owned();
        for needed in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            ensure!(files.lines().any(|file| file == needed), "the package of {} lacks {needed}", package.name);
        }
    }
    Ok(())
}

/// Checks what a registry shows of a crate, and that its dependencies have versions.
fn check_manifest(package: &Package) -> anyhow::Result<()> {
    let name = &package.name;
    ensure!(package.description.is_some() && package.license.is_some(), "{name} lacks a description or a licence");
    ensure!(package.readme.is_some(), "{name} names no readme");
    ensure!(
        (1..=5).contains(&package.keywords.len()),
        "{name} has {} keywords, expected 1 to 5",
        package.keywords.len()
    );
    ensure!(!package.categories.is_empty(), "{name} has no categories");
    for dependency in &package.dependencies {
        let is_open = dependency.path.is_some() && dependency.req.to_string() == "*";
        if is_open && dependency.kind != DependencyKind::Development {
            bail!("{name} depends on {} without a version, which a package must give", dependency.name);
        }
    }
    Ok(())
}

/// Checks that the files which sources include lie in the crate's own folder.
fn check_includes(krate: &Path, folder: &Path) -> anyhow::Result<()> {
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.is_dir() {
            check_includes(krate, &path)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            let depth = path.strip_prefix(krate).map_or(0, |inside| inside.components().count() - 1);
            if let Some(outside) = included(&text).find(|file| file.matches("../").count() > depth) {
                bail!("{} includes {outside}, which lies outside of the package", path.display());
            }
        }
    }
    Ok(())
}

/// Returns the paths of `include_str!` and `include_bytes!`.
fn included(text: &str) -> impl Iterator<Item = &str> {
    ["include_str!(\"", "include_bytes!(\""]
        .into_iter()
        .flat_map(move |head| text.match_indices(head).map(move |(at, _)| &text[at + head.len()..]))
        .filter_map(|rest| rest.split('"').next())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_hold_what_they_need() {
        run().unwrap();
    }

    #[test]
    fn files_outside_are_found() {
        let folder = std::env::temp_dir().join(format!("dioptric-packages-{}", std::process::id()));
        let source = folder.join("src/deep");
        fs::create_dir_all(&source).unwrap();
        let check = |text: &str| {
            fs::write(source.join("a.rs"), text).unwrap();
            check_includes(&folder, &folder.join("src"))
        };
        check("const A: &str = include_str!(\"../../data/a.csv\");").unwrap();
        let message = check("const A: &str = include_str!(\"../../../data/a.csv\");").unwrap_err().to_string();
        assert!(message.contains("outside of the package"), "{message}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
