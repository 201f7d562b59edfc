//! What can go wrong between a camera file and its picture.

use std::path::{Path, PathBuf};

use dioptric_backward::BackwardError;
use dioptric_files::{WriteError, ron::RonError};
use dioptric_forward::ForwardError;
use dioptric_optics::OpticsError;
use dioptric_psf::PsfError;
use dioptric_scene::SceneError;
use dioptric_sensor::SensorError;
use dioptric_spectrum::{Cancelled, SpectrumError};
use dioptric_world::WorldError;

/// A camera that cannot be built, run or written down.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// A list of numbers that cannot be read.
    #[error("{what}: '{item}' is neither a number nor a range first:last:step whose step leads from first to last")]
    List {
        /// What the list was for.
        what: &'static str,
        /// The item that cannot be read.
        item: String,
    },
    /// A place that cannot be written to.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A picture that cannot be encoded.
    #[error("cannot encode a picture as PNG: {reason}")]
    Png {
        /// Why.
        reason: String,
    },
    /// A camera file that is not RON, or whose words are not ours.
    #[error("{}:{line}:{column}: {reason}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A value that cannot be.
    #[error("{origin}: {key}{}", of_value(found, expected))]
    Value {
        /// The file and line, or the camera's name.
        origin: String,
        /// The key.
        key: &'static str,
        /// What was found; nothing where what would do says it all.
        found: String,
        /// What would do.
        expected: String,
    },
    /// A setting of the sensor, of its exposure or of its processing that cannot be.
    #[error("{origin}: {reason}")]
    Setting {
        /// The file and line, or the camera's name.
        origin: String,
        /// What is wrong and what was expected.
        reason: dioptric_sensor::SensorError,
    },
    /// A row of a table that cannot be used.
    #[error("{}:{line}: {reason}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: u64,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// The lens.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The point-spread functions.
    #[error(transparent)]
    Psf(PsfError),
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The blur.
    #[error(transparent)]
    Forward(ForwardError),
    /// The world.
    #[error(transparent)]
    World(WorldError),
    /// The rendering of a world.
    #[error(transparent)]
    Backward(BackwardError),
    /// Spectral data.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// Work that was stopped on request.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Less memory than the imaging of a scene takes.
    #[error(
        "the imaging may take {}, but it and its film take at least {}: give it more memory, or take fewer pixels or bands",
        shown_bytes(*budget_bytes),
        shown_bytes(*least_bytes)
    )]
    Memory {
        /// What it may take, bytes.
        budget_bytes: u64,
        /// The least that would do, bytes.
        least_bytes: u64,
    },
    /// An amount of memory that is none.
    #[error("an amount of memory is '{found}', expected a number with a unit, as 1GiB or 500MB")]
    Bytes {
        /// What was given.
        found: String,
    },
    /// A temporary file that cannot be written.
    #[error("cannot keep the irradiance in a temporary file: {reason}")]
    Spill {
        /// Why.
        reason: String,
    },
    /// A part of the camera that does not go with another.
    #[error("{what}: {reason}")]
    Unsuitable {
        /// The part.
        what: &'static str,
        /// Why.
        reason: String,
    },
}

impl From<WriteError> for PipelineError {
    fn from(WriteError { path, reason, .. }: WriteError) -> Self {
        Self::Write { path, reason }
    }
}

/// Returns the words behind a key whose value cannot be.
fn of_value(found: &str, expected: &str) -> String {
    if found.is_empty() { format!(": {expected}") } else { format!(" is {found}, expected {expected}") }
}

impl PipelineError {
    /// Returns the error of a file whose text is not what was expected.
    pub(crate) fn syntax(path: &Path, RonError { line, column, reason, .. }: RonError) -> Self {
        Self::Syntax { path: path.to_owned(), line, column, reason }
    }

    /// Whether a lens forms no image behind it to put the film at: then the film must be placed by its distance from the lens.
    pub fn is_without_image(&self) -> bool {
        matches!(self, Self::Optics(OpticsError::NoFocus { side: "behind it", .. }))
    }

    /// Whether it is about this machine or this moment: work that was cancelled, a file that cannot be read or written.
    /// All other errors are about the camera, and come back whenever it is tried.
    pub fn is_passing(&self) -> bool {
        self.is_unreadable()
            || matches!(
                self,
                Self::Cancelled(_)
                    | Self::Write { .. }
                    | Self::Png { .. }
                    | Self::Spill { .. }
                    | Self::Memory { .. }
                    | Self::Sensor(SensorError::Write { .. })
                    | Self::Scene(SceneError::Unwritable { .. })
                    | Self::Backward(BackwardError::Write { .. })
                    | Self::Forward(ForwardError::Sink { .. })
            )
    }

    /// Returns the file or folder that cannot be read or written, where that is what is wrong.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Read { path, .. }
            | Self::Write { path, .. }
            | Self::Optics(OpticsError::Io { path, .. })
            | Self::Sensor(SensorError::Read { path, .. } | SensorError::Write { path, .. })
            | Self::Scene(SceneError::Unreadable { file: path, .. } | SceneError::Unwritable { file: path, .. })
            | Self::World(WorldError::Unreadable { file: path, .. })
            | Self::Backward(BackwardError::Write { file: path, .. }) => Some(path),
            _ => None,
        }
    }

    /// Whether a file that the camera is made from cannot be read: absent, cut off, or of another format. Another try may find it
    /// mended; what is wrong in a file that can be read is not among these.
    pub fn is_unreadable(&self) -> bool {
        matches!(
            self,
            Self::Read { .. }
                | Self::Optics(OpticsError::Io { .. })
                | Self::Sensor(SensorError::Read { .. })
                | Self::Scene(SceneError::Unreadable { .. })
                | Self::World(WorldError::Unreadable { .. })
        )
    }
}

/// What a scene lacks that may be given beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneLack {
    /// Its depth.
    Depth,
    /// Its camera data.
    View,
    /// Both.
    DepthAndView,
}

impl PipelineError {
    /// Returns what the scene lacks that may be given beside it, where that is what is wrong.
    pub fn scene_lack(&self) -> Option<SceneLack> {
        match self {
            Self::Scene(SceneError::MissingDepth { .. }) => Some(SceneLack::Depth),
            Self::Scene(SceneError::MissingView { .. }) => Some(SceneLack::View),
            Self::Scene(SceneError::MissingDepthAndView { .. }) => Some(SceneLack::DepthAndView),
            _ => None,
        }
    }
}

impl From<PsfError> for PipelineError {
    fn from(error: PsfError) -> Self {
        match error {
            PsfError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Psf(other),
        }
    }
}

impl From<WorldError> for PipelineError {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::World(other),
        }
    }
}

impl From<BackwardError> for PipelineError {
    fn from(error: BackwardError) -> Self {
        match error {
            BackwardError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Backward(other),
        }
    }
}

impl From<ForwardError> for PipelineError {
    fn from(error: ForwardError) -> Self {
        match error {
            ForwardError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Forward(other),
        }
    }
}

/// Returns an amount of memory in MiB, rounded up.
fn shown_bytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}
