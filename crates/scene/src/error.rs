//! What can be wrong with a scene or its file.

use std::path::PathBuf;

use dioptric_files::memory::TooLarge;

use dioptric_spectrum::SpectrumError;

/// A scene that cannot be read, written or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file that cannot be read: absent, truncated, or of another format.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file or folder that cannot be written.
    #[error("{}: cannot be written: {reason}", file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that takes more memory than it may.
    #[error("{}: {reason}", file.display())]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// What it would take, and what it may.
        reason: TooLarge,
    },
    /// A file of a kind that this build leaves out.
    #[error("{}: this build cannot read it, expected one with the feature '{feature}'", file.display())]
    LacksFeature {
        /// The file.
        file: PathBuf,
        /// The cargo feature with which it can.
        feature: &'static str,
    },
    /// A file whose name does not determine its kind.
    #[error(
        "{}: expected a .exr, .hdr (ENVI or Radiance), .mat, .h5, .npy, .npz, .csv, .tif, .png, .jpg, .webp, .bmp, .ppm or .pfm file, or a folder with \
         one picture a band",
        file.display()
    )]
    UnknownKind {
        /// The file.
        file: PathBuf,
    },
    /// Something that is said of a file that leaves nothing open there.
    #[error("{}: {what} cannot be said of it, since it is {kind}: expected it left out", file.display())]
    DoesNotApply {
        /// The file.
        file: PathBuf,
        /// What was said.
        what: &'static str,
        /// What the file is.
        kind: String,
    },
    /// A picture without a single spectral band.
    #[error("{}: no spectral band found: expected {expected}", file.display())]
    NoBands {
        /// The file or folder.
        file: PathBuf,
        /// What a band would look like.
        expected: &'static str,
    },
    /// Bands or units that do not belong in one picture.
    #[error("{}: {reason}", file.display())]
    Units {
        /// The file.
        file: PathBuf,
        /// What clashes with what.
        reason: String,
    },
    /// A line of a text header that cannot be used.
    #[error("{}: {}'{key}': {reason}", file.display(), of_line(*line))]
    Header {
        /// The file.
        file: PathBuf,
        /// 1-based line, 0 where the key is absent.
        line: usize,
        /// The key.
        key: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// Samples, depths or wavelengths of a file that cannot be.
    #[error("{}: {reason}", file.display())]
    Values {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: SpectrumError,
    },
    /// Spectral data made in memory that cannot be.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// A scene without the depth that the next stage needs.
    #[error(
        "{name}: the scene has no depth: give one, in metres, or add a channel 'Z' to its file, or a NAME.depth.png"
    )]
    MissingDepth {
        /// The scene.
        name: String,
    },
    /// Depth that was not measured at some places, of which nobody says what it is.
    #[error(
        "{}: the depth at row {row}, column {column} was not measured (no number above 0, or one that stands for none), as at \
         {n_unmeasured} of {n_samples} samples: expected numbers above 0, or a choice of what is there (--fill-depth far, beside or METRES)",
        file.display()
    )]
    Unmeasured {
        /// The file.
        file: PathBuf,
        /// Row of the first such sample.
        row: usize,
        /// Column of the first such sample.
        column: usize,
        /// How many there are.
        n_unmeasured: usize,
        /// Samples in all.
        n_samples: usize,
    },
    /// A layer that should lie behind the first surface and lies before it.
    #[error(
        "{name}: the hidden layer lies at {hidden_m} m at row {row}, column {column}, before the first surface at {first_m} m: \
         expected it behind, or as far where nothing is known"
    )]
    HiddenInFront {
        /// The scene.
        name: String,
        /// Row of the first such sample.
        row: usize,
        /// Column of the first such sample.
        column: usize,
        /// Depth of the hidden layer there, m.
        hidden_m: f32,
        /// Depth of the first surface there, m.
        first_m: f32,
    },
    /// A scene under a light that is not known, which another cannot take the place of.
    #[error("{name}: the {what} on the scene is not known, so that it cannot be put under another: {instead}")]
    UnknownLight {
        /// The scene.
        name: String,
        /// What of the light is not known.
        what: String,
        /// What would do.
        instead: String,
    },
    /// A scene without camera data that the next stage needs.
    #[error("{name}: the scene has no camera data: give its horizontal field of view in degrees")]
    MissingView {
        /// The scene.
        name: String,
    },
    /// A scene that has neither depth nor camera data.
    #[error(
        "{name}: the scene has neither depth nor camera data: give a depth, in metres, and its horizontal field of view in degrees"
    )]
    MissingDepthAndView {
        /// The scene.
        name: String,
    },
    /// Two parts of a scene of different size.
    #[error("{name}: {what} is {found_rows} × {found_columns} samples, the radiance {rows} × {columns}")]
    Size {
        /// The scene.
        name: String,
        /// Which part.
        what: &'static str,
        /// Rows of the radiance.
        rows: usize,
        /// Columns of the radiance.
        columns: usize,
        /// Rows of the part.
        found_rows: usize,
        /// Columns of the part.
        found_columns: usize,
    },
    /// A setting outside its range.
    #[error("{what} is {value}: expected {expected}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// What was given.
        value: String,
        /// What would do.
        expected: String,
    },
}

/// The words before what is wrong in a line, where there is one.
fn of_line(line: usize) -> String {
    if line == 0 { String::new() } else { format!("line {line}: ") }
}
