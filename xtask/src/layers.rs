//! Which crate may use which: the architecture as data, compared with what cargo sees.

use anyhow::{Context, bail};
use cargo_metadata::{DependencyKind, MetadataCommand};

/// Each crate's folder and the workspace crates that it may use, lowest layer first.
///
/// A crate may use those named, and they must stand above it in the table.
const LAYERS: &[(&str, &[&str])] = &[
    ("golden-macros", &[]),
    ("golden", &["golden-macros"]),
    ("files", &[]),
    ("fft", &[]),
    ("pictures", &["files"]),
    ("spectrum", &[]),
    ("optics", &["files", "spectrum"]),
    ("diffraction", &["fft", "spectrum", "optics"]),
    ("psf", &["spectrum", "optics", "diffraction"]),
    ("scene", &["files", "pictures", "spectrum"]),
    ("world", &["files", "pictures", "spectrum", "optics"]),
    ("backward", &["files", "spectrum", "optics", "diffraction", "world"]),
    ("forward", &["fft", "pictures", "spectrum", "optics", "psf", "scene"]),
    ("sensor", &["files", "fft", "pictures", "spectrum"]),
    (
        "pipeline",
        &[
            "files",
            "pictures",
            "spectrum",
            "optics",
            "diffraction",
            "psf",
            "scene",
            "world",
            "backward",
            "forward",
            "sensor",
        ],
    ),
    ("analysis", &["files", "spectrum", "optics", "diffraction", "psf", "scene", "forward", "sensor", "pipeline"]),
    (
        "report",
        &[
            "files",
            "pictures",
            "spectrum",
            "optics",
            "diffraction",
            "psf",
            "scene",
            "forward",
            "sensor",
            "pipeline",
            "analysis",
        ],
    ),
    ("sweep", &["files", "pictures", "spectrum", "psf", "backward", "pipeline", "analysis"]),
    ("cli", &["files", "pictures", "spectrum", "pipeline", "analysis", "report", "sweep"]),
    ("python", &["files", "spectrum", "optics", "psf", "scene", "sensor", "pipeline", "analysis", "sweep"]),
    (
        "studio",
        &["files", "pictures", "spectrum", "optics", "psf", "scene", "sensor", "pipeline", "analysis", "report"],
    ),
    ("xtask", &["pipeline", "report", "sweep"]),
];

/// Compares the table with `cargo metadata` and names the first thing that differs.
pub(crate) fn run() -> anyhow::Result<()> {
    let metadata = MetadataCommand::new().no_deps().exec().context("cargo metadata")?;
    let folder_of = |package: &str| match package {
        "dioptric" => "cli".to_owned(),
        other => other.strip_prefix("dioptric-").unwrap_or(other).to_owned(),
    };
    let members: Vec<String> = metadata.packages.iter().map(|p| folder_of(&p.name)).collect();
    for package in &metadata.packages {
        let folder = folder_of(&package.name);
        let Some((_, allowed)) = LAYERS.iter().find(|(name, _)| *name == folder) else {
            bail!("crate '{folder}' is not in the table of layers in xtask/src/layers.rs");
        };
        for dependency in &package.dependencies {
            let used = folder_of(&dependency.name);
            if !members.contains(&used) {
                continue;
            }
            let golden_in_tests = used == "golden" && dependency.kind == DependencyKind::Development;
            if !golden_in_tests && !allowed.contains(&used.as_str()) {
                bail!("crate '{folder}' uses '{used}', which its layer does not allow");
            }
        }
    }
    for (index, (name, allowed)) in LAYERS.iter().enumerate() {
        if !members.iter().any(|member| member == name) {
            bail!("the table of layers names '{name}', which is not in the workspace");
        }
        if let Some(above) = allowed.iter().find(|used| !LAYERS[..index].iter().any(|(lower, _)| lower == *used)) {
            bail!("'{name}' may use '{above}', which is not a lower layer");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn crates_keep_to_their_layers() {
        super::run().unwrap();
    }
}
