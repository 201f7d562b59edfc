//! The depths of EXR files: which channels they are, and what they count.

use std::path::Path;

use ndarray::Array2;

use super::{reading::DepthKind, stated::Stated};

/// The picture that Blender's compositor makes of its view layers.
pub(super) const COMPOSITE: &str = "Composite.Combined";

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
    if prefix.contains("Combined") {
        // An eye may stand behind it.
        let depth = prefix.replacen("Combined", "Depth", 1);
        wanted.extend(["Z", "V"].map(|letter| format!("{depth}.{letter}")));
        wanted.extend(prefix.strip_suffix(".Combined").map(|layer| format!("{layer}.Z")));
    } else if !prefix.is_empty() {
        wanted.push(format!("{prefix}.Z"));
    }
    wanted.extend(["Z", "depth.Z", "Depth.Z", "depth.V", "Depth.V", "depth.Y", "Depth.Y"].map(str::to_owned));
    // X, Y and Z side by side are colors (CIE), or places and directions.
    let is_of_three = |name: &str| {
        let beside = |letter: &str| name.strip_suffix('Z').map(|start| format!("{start}{letter}"));
        ["X", "Y"].iter().all(|letter| beside(letter).is_some_and(|name| names.contains(&name.as_str())))
    };
    if let Some(name) = wanted.into_iter().find(|name| names.contains(&name.as_str()) && !is_of_three(name)) {
        return Some((name, DepthKind::Axial));
    }
    if prefix.is_empty() || prefix == COMPOSITE {
        let is_depth = |name: &&&str| name.ends_with(".Depth.Z") || name.ends_with(".Depth.V");
        let found: Vec<&&str> = names.iter().filter(is_depth).collect();
        if let [one] = found[..] {
            return Some(((*one).to_owned(), DepthKind::Axial));
        }
    }
    let distances = [format!("{prefix}.distance"), "distance".to_owned()];
    if let Some(name) = distances.into_iter().find(|name| names.contains(&name.as_str())) {
        return Some((name, DepthKind::Radial));
    }
    // The way along the ray, as Mitsuba writes its depth.
    let ways: Vec<&&str> = names.iter().filter(|name| name.ends_with(".T") && name.len() > 2).collect();
    match ways[..] {
        [one] => Some(((*one).to_owned(), DepthKind::Radial)),
        _ => None,
    }
}

/// Returns the name of the channel of depth of a file of depth alone, and the names of the others.
pub(super) fn depth_channel(planes: Vec<(String, &Array2<f32>)>) -> Option<(String, Vec<String>)> {
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
    // The one channel of a file may be called so as well.
    if name == "R" && channels.get("G").is_some() {
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
        check(&["A.Depth.left.Z", "A.Depth.right.Z"], "A.Combined.right", Some("A.Depth.right.Z"));
        // That of the only view layer.
        check(&["A.Depth.Z", "A.Combined.R"], "Composite.Combined", Some("A.Depth.Z"));
        check(&["A.Depth.Z", "B.Depth.Z"], "Composite.Combined", None);
        check(&["A.Depth.Z", "Composite.Z"], "Composite.Combined", Some("Composite.Z"));
        check(&["A.Depth.Z", "A.Noisy.R"], "", Some("A.Depth.Z"));
        check(&["distance", "Z"], "", Some("Z"));
        check(&["X", "Y", "Z"], "", None);
        check(&["X", "Y", "Z", "distance"], "", Some("distance"));
        check(&["Y", "Z"], "", Some("Z"));
        check(&["front.distance", "distance"], "front", Some("front.distance"));
        // Mitsuba calls the way along the ray T, and reflectances of bands have names that begin so.
        check(&["dd.y.T", "albedo.R"], "", Some("dd.y.T"));
        check(&["a.T", "b.T"], "", None);
        check(&["T.550,000000nm"], "", None);
    }
}
