//! Where paintings of the still life are kept from run to run.

use std::{env, path::PathBuf, time::UNIX_EPOCH};

use dioptric_pipeline::PaintingFolder;
use etcetera::{BaseStrategy, choose_base_strategy};

/// Names the folder; nothing is kept where it is empty.
const VARIABLE: &str = "DIOPTRIC_CACHE";

/// Returns the user's folder of paintings, `None` where there is none or none is wanted.
pub(crate) fn painting_folder() -> Option<PaintingFolder> {
    let folder = match env::var_os(VARIABLE) {
        Some(folder) => PathBuf::from(folder),
        None => choose_base_strategy().ok()?.cache_dir().join("dioptric"),
    };
    if folder.as_os_str().is_empty() { None } else { Some(PaintingFolder::new(folder, build()?)) }
}

/// Returns what tells this program from another build of it: its version, and the size and age of its file.
pub(crate) fn build() -> Option<String> {
    let file = env::current_exe().ok()?.metadata().ok()?;
    let built = file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", env!("CARGO_PKG_VERSION"), file.len(), built.as_nanos()))
}
