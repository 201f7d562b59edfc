//! What the program keeps from run to run.

use std::{env, path::PathBuf};

use dioptric_pipeline::{PaintingFolder, program_build};

/// Returns the user's folder of paintings, `None` where there is none or none is wanted.
pub(crate) fn painting_folder() -> Option<PaintingFolder> {
    PaintingFolder::of_user(&program()?)
}

/// Returns what tells this program from another build of it.
pub(crate) fn build() -> Option<String> {
    program_build(&program()?)
}

fn program() -> Option<PathBuf> {
    env::current_exe().ok()
}
