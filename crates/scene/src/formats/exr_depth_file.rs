//! EXR files of depth.

use std::path::Path;

use ndarray::Array2;

use super::{
    exr_depth::{depth_channel, kind_of, note_of_kind},
    exr_layers::{PlacedPlane, read_placed_planes},
    reading::{DepthKind, Frame},
    stated::{Noted, note_of},
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
}

/// Reads the channel of depth of an EXR file: that of the name told, or else the one that is called a depth, or the only one.
///
/// # Errors
/// When the file cannot be read, or has no such channel.
pub(super) fn read_depth_exr(path: &Path, told: Option<&str>) -> Result<Noted<DepthChannel>, SceneError> {
    let mut notes = vec![];
    let placed = read_placed_planes(path)?.told_in(&mut notes);
    let wrong = |reason: String| unreadable(path, reason);
    let names = placed.iter().map(|own| own.name.clone()).collect::<Vec<_>>();
    let (name, others) = match told {
        Some(told) if names.iter().any(|name| name == told) => {
            (told.to_owned(), names.iter().filter(|name| *name != told && *name != "A").cloned().collect())
        }
        Some(told) => {
            return Err(wrong(format!("it has no channel '{told}', expected one of {}", names.join(", "))));
        }
        None => {
            let planes = placed.iter().map(|own| (own.name.clone(), &own.plane)).collect();
            let expected = "it has no channel that is known for a depth, expected 'Z', 'Depth.Z', 'distance', a single channel, or a name \
                            (--depth-variable)";
            depth_channel(planes).ok_or_else(|| wrong(expected.to_owned()))?
        }
    };
    let found = placed.into_iter().find(|own| own.name == name);
    let PlacedPlane { name, plane, frame } = found.ok_or_else(|| wrong("its depth is not there".to_owned()))?;
    notes.extend(note_of(path, "channel", &others));
    notes.extend(note_of_kind(path, &name));
    Ok(Noted::new(DepthChannel { kind: kind_of(&name), name, plane, frame }, notes))
}
