//! The depths of EXR files: which channels they are, and where they lie.

use std::path::Path;

use ndarray::Array2;

use super::{
    reading::{DepthKind, Frame},
    spectral_exr::read_placed_planes,
    stated::{Stated, note_of},
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

/// What the name of a channel says that it counts: `….T` of Mitsuba is a way along a ray.
pub(super) fn kind_of(name: &str) -> DepthKind {
    let last = name.rsplit('.').next().unwrap_or(name);
    if ["distance", "T"].contains(&last) { DepthKind::Radial } else { DepthKind::Axial }
}

/// Returns what is said of a channel whose distances begin elsewhere.
pub(super) fn note_of_kind(path: &Path, name: &str) -> Option<String> {
    let name_of = super::stated::name_of(path);
    name.ends_with(".T").then(|| {
        format!(
            "{name_of}: its channel '{name}' is taken for ways along rays of Mitsuba, which begin at its near_clip (0.01 m unless it says \
             otherwise): --depth-kind says what else"
        )
    })
}

/// Returns the channel of depth that belongs to the colors of a layer, and what it counts.
pub(super) fn depth_name<'a>(names: impl Iterator<Item = &'a str>, prefix: &str) -> Option<(String, DepthKind)> {
    let names: Vec<&str> = names.collect();
    let mut wanted = vec![];
    if let Some(layer) = prefix.strip_suffix("Combined") {
        wanted.extend(["Z", "V"].map(|letter| format!("{layer}Depth.{letter}")));
    } else if !prefix.is_empty() {
        wanted.push(format!("{prefix}.Z"));
    }
    wanted.extend(["Z", "depth.Z", "Depth.Z", "depth.V", "Depth.V", "depth.Y", "Depth.Y"].map(str::to_owned));
    if let Some(name) = wanted.into_iter().find(|name| names.contains(&name.as_str())) {
        return Some((name, DepthKind::Axial));
    }
    if prefix.is_empty() {
        let is_depth = |name: &&&str| name.ends_with(".Depth.Z") || name.ends_with(".Depth.V");
        let found: Vec<&&str> = names.iter().filter(is_depth).collect();
        if let [one] = found[..] {
            return Some(((*one).to_owned(), DepthKind::Axial));
        }
    }
    if names.contains(&"distance") {
        return Some(("distance".to_owned(), DepthKind::Radial));
    }
    // The way along the ray, as Mitsuba writes its depth.
    let ways: Vec<&&str> = names.iter().filter(|name| name.ends_with(".T") && name.len() > 2).collect();
    match ways[..] {
        [one] => Some(((*one).to_owned(), DepthKind::Radial)),
        _ => None,
    }
}

/// Returns the name of the channel of depth of a file of depth alone, and the names of the others.
fn depth_channel(planes: Vec<(String, &Array2<f32>)>) -> Option<(String, Vec<String>)> {
    let mut channels = Stated::new("channel", planes);
    let only = || {
        let names: Vec<&str> = channels.names().collect();
        match names[..] {
            [one] => Some(one.to_owned()),
            // A gray picture that was saved as a colored one.
            _ if ["R", "G", "B"].iter().all(|name| names.contains(name)) => Some("R".to_owned()),
            _ => None,
        }
    };
    let name = depth_name(channels.names(), "").map(|(name, _)| name).or_else(only)?;
    let plane = channels.take(&name)?;
    if name == "R" {
        let is_same = |own: Option<&&Array2<f32>>| own == Some(&plane);
        if !(is_same(channels.get("G")) && is_same(channels.get("B"))) {
            return None;
        }
        channels.take_all(|name| name == "G" || name == "B");
    }
    let others = channels.names().filter(|name| *name != "A").map(str::to_owned).collect();
    Some((name, others))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_that_of_the_colors() {
        let check = |names: &[&str], prefix: &str, expected: Option<&str>| {
            let found = depth_name(names.iter().copied(), prefix).map(|(name, _)| name);
            assert_eq!(found.as_deref(), expected, "{names:?}");
        };
        check(&["A.Depth.Z", "B.Depth.Z"], "B.Combined", Some("B.Depth.Z"));
        check(&["A.Depth.Z", "B.Denoising Depth.Z"], "B.Combined", None);
        check(&["V.Denoising Depth.Z", "V.Depth.V"], "V.Combined", Some("V.Depth.V"));
        check(&["A.Depth.Z", "B.Depth.Z"], "", None);
        check(&["A.Depth.Z", "A.Noisy.R"], "", Some("A.Depth.Z"));
        check(&["distance", "Z"], "", Some("Z"));
        // Mitsuba calls the way along the ray T, and reflectances of bands have names that begin so.
        check(&["dd.y.T", "albedo.R"], "", Some("dd.y.T"));
        check(&["a.T", "b.T"], "", None);
        check(&["T.550,000000nm"], "", None);
    }
}
