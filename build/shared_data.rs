//! Build script of the crates whose tests read the shared reference data beside the workspace.
//!
//! Sets `cfg(has_shared)` when the data is there, so that such tests count as ignored when it is not.

#![expect(clippy::print_stdout, reason = "this is how a build script speaks to cargo")]

use std::path::Path;

fn main() {
    let manifest = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    let shared = Path::new(&manifest)
        .ancestors()
        .find(|folder| folder.join("Cargo.lock").exists() && *folder != Path::new(&manifest))
        .and_then(Path::parent)
        .map(|beside| beside.join("shared/DESIGN.md"));
    if let Some(path) = shared {
        println!("cargo::rerun-if-changed={}", path.display());
        if path.exists() {
            println!("cargo::rustc-cfg=has_shared");
        }
    }
}
