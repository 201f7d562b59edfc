//! EXR files of depth.

use std::path::Path;

use ndarray::Array2;

use super::{
    exr_depth::{depth_channel, kind_of, note_of_kind},
    reading::{DepthKind, Frame},
    spectral_exr::read_placed_planes,
    stated::note_of,
    unusable::unreadable,
};
use crate::SceneError;

/// A channel of depth of a file.
pub(super) struct DepthChannel {
    pub(super) name: String,
    pub(super) plane: Array2<f32>,
    pub(super) kind: DepthKind,
    /// The picture of which it has a part.
    pub(super) frame: Frame,
    /// What of the file is not used.
    pub(super) notes: Vec<String>,
}

/// Reads the channel of depth of an EXR file: that of the name told, or else the one that is called a depth, or the only one.
///
/// # Errors
/// When the file cannot be read, or has no such channel.
pub(super) fn read_depth_exr(path: &Path, told: Option<&str>) -> Result<DepthChannel, SceneError> {
    let placed = read_placed_planes(path)?;
    let wrong = |reason: String| unreadable(path, reason);
    let names = placed.iter().map(|(name, ..)| name.clone()).collect::<Vec<_>>();
    let (name, others) = match told {
        Some(told) if names.iter().any(|name| name == told) => {
            (told.to_owned(), names.iter().filter(|name| *name != told && *name != "A").cloned().collect())
        }
        Some(told) => {
            return Err(wrong(format!("it has no channel '{told}', expected one of {}", names.join(", "))));
        }
        None => {
            let planes = placed.iter().map(|(name, plane, _)| (name.clone(), plane)).collect();
            let expected = "it has no channel that is known for a depth, expected 'Z', 'Depth.Z', 'distance', a single channel, or a name \
                            (--depth-variable)";
            depth_channel(planes).ok_or_else(|| wrong(expected.to_owned()))?
        }
    };
    let found = placed.into_iter().find(|(own, ..)| *own == name);
    let (name, plane, frame) = found.ok_or_else(|| wrong("its depth is not there".to_owned()))?;
    let mut notes: Vec<String> = note_of(path, "channel", &others).into_iter().collect();
    notes.extend(note_of_kind(path, &name));
    Ok(DepthChannel { kind: kind_of(&name), name, plane, frame, notes })
}
