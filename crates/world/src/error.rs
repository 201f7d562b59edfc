//! What can be wrong with a world or its files.

use std::path::PathBuf;

use dioptric_spectrum::Cancelled;

/// A world that cannot be read or built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// A file that cannot be read: absent, truncated, or of another format.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {reason}", file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A line of a text file that cannot be used.
    #[error("{}: line {line}: {reason}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// 1-based line.
        line: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A file whose name does not determine its kind.
    #[error("{}: expected a .pbrt, .gltf, .glb, .obj, .ply or .stl file", file.display())]
    UnknownKind {
        /// The file.
        file: PathBuf,
    },
    /// A file of a kind that this build leaves out.
    #[error("{}: this build cannot read it, expected one with the feature '{feature}'", file.display())]
    LacksFeature {
        /// The file.
        file: PathBuf,
        /// The cargo feature with which it can.
        feature: &'static str,
    },
    /// A mesh with vertices or triangles that cannot be.
    #[error("mesh: {reason}")]
    Mesh {
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A number outside its range.
    #[error("{what} is {value}: expected {expected}")]
    Setting {
        /// Which number.
        what: &'static str,
        /// What was given.
        value: String,
        /// What would do.
        expected: &'static str,
    },
    /// Part of a world that names another part that is not there.
    #[error("{what} names {target} {index}, of which there are {n}")]
    Dangling {
        /// What names it.
        what: &'static str,
        /// What is named.
        target: &'static str,
        /// Its number.
        index: usize,
        /// How many there are.
        n: usize,
    },
    /// An object that isn't there.
    #[error("no object is called '{name}'{near}")]
    NoObject {
        /// What was asked for.
        name: String,
        /// Which names are like it, or what there is.
        near: String,
    },
    /// A material that isn't there.
    #[error("no material is called '{name}'{near}")]
    NoMaterial {
        /// What was asked for.
        name: String,
        /// Which names are like it, or what there is.
        near: String,
    },
    /// More parts than are looked after.
    #[error("{what}: {n}: expected {limit} at most")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        n: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// Work that was stopped on request before it was done.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl WorldError {
    pub(crate) fn mesh(reason: String) -> Self {
        Self::Mesh { reason }
    }

    /// Returns the name of a picture that could not be read, and why.
    pub(crate) fn of_picture(&self, name: &str) -> String {
        match self {
            Self::Unreadable { reason, .. } => format!("{name} ({reason})"),
            other => format!("{name} ({other})"),
        }
    }
}
