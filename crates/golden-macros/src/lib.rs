//! The attribute of tests that read the shared reference data beside the workspace.
//!
//! `dioptric-golden` exports it; it is a crate of its own because the compiler asks that of attributes.

use std::path::Path;

use proc_macro::TokenStream;

/// Counts a test as ignored where the shared reference data is not beside the workspace. It stands before `#[test]`, which takes no
/// notice of what comes after it.
///
/// ```text
/// #[dioptric_golden::needs_shared]
/// #[test]
/// fn rays_agree_with_the_reference() {}
/// ```
///
/// Where the data is, whether it still is there is asked again whenever the crate is compiled; where it was not, `cargo`
/// does not notice that it came: touch the file, or clean.
#[proc_macro_attribute]
pub fn needs_shared(_arguments: TokenStream, test: TokenStream) -> TokenStream {
    let mark = if is_there(Path::new(env!("CARGO_MANIFEST_DIR"))) {
        ""
    } else {
        "#[ignore = \"needs the shared reference data\"]"
    };
    let mut marked: TokenStream = mark.parse().unwrap_or_default();
    marked.extend(test);
    marked
}

/// Reports whether the data is beside the workspace that this folder of a crate is in.
fn is_there(crate_folder: &Path) -> bool {
    crate_folder.ancestors().nth(3).is_some_and(|beside| beside.join("shared/DESIGN.md").exists())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_beside_the_workspace_is_found() {
        let folder = std::env::temp_dir().join(format!("dioptric-golden-{}", std::process::id()));
        let krate = folder.join("workspace/crates/golden-macros");
        std::fs::create_dir_all(folder.join("shared")).unwrap();
        assert!(!is_there(&krate));
        std::fs::write(folder.join("shared/DESIGN.md"), "").unwrap();
        assert!(is_there(&krate));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
