//! The files that belong to one of a scene.

use std::path::{Path, PathBuf};

use super::{
    depth_names::words_of,
    stated::{bare, note_of},
};

/// Whether reading a scene may read another file in its folder: the numbers of a header, a depth, camera data, references of a
/// line scanner.
pub fn may_be_read_with(scene: &Path, other: &Path) -> bool {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = scene.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let other = name(other);
    // `a_1.exr` has its camera in `a_1.camera.json` or `a_camera.json`, `a.radiance.exr` in `a.camera.json`.
    let bare = stem.split('.').next().unwrap_or(&stem);
    let shared = bare.rsplit_once('_').map(|(first, _)| first);
    let goes_on = |start: &str| other.strip_prefix(start).is_some_and(|rest| rest.starts_with(['.', '_']));
    let is_part =
        |start: &str| other.starts_with(&format!("{start}_camera")) || other.starts_with(&format!("{start}_depth"));
    let is_reference = Reference::of_name(&other, &bare_stem(&name(scene))).is_some();
    let is_list = ["wavelengths.txt", "wavelengths.csv"].contains(&other.as_str());
    other != name(scene) && (goes_on(bare) || shared.is_some_and(is_part) || is_reference || is_list)
}

/// A cube beside one of a line scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reference {
    /// Of a perfect white.
    White,
    /// Of no light.
    Dark,
}

impl Reference {
    /// Returns what a file is by its name, and whether it is that of a cube, which has this one, [`bare_stem`]: `white_reference_1.hdr`,
    /// `WHITEREF_451.hdr` of Specim, `darkReference.hdr` of Headwall; `white.hdr` and `451_white.hdr`.
    pub(super) fn of_name(name: &str, cube: &str) -> Option<(Self, bool)> {
        let stem = bare_stem(name);
        [("white", Self::White), ("dark", Self::Dark)].into_iter().find_map(|(word, reference)| {
            let mut rests = ["reference", "ref"].iter().filter_map(|of| stem.split_once(&format!("{word}{of}")));
            if let Some((before, behind)) = rests.next() {
                return Some((reference, format!("{before}{behind}") == cube));
            }
            let rest = stem.strip_prefix(word).or_else(|| stem.strip_suffix(word))?;
            (rest.is_empty() || rest == cube).then_some((reference, rest == cube))
        })
    }
}

/// Whether a name has a word for a reference, whatever stands with it: what may be one of a cube beside it.
pub(super) fn may_be_reference(name: &str) -> bool {
    const WORDS: [&str; 15] = [
        "white",
        "dark",
        "ref",
        "reference",
        "wref",
        "dref",
        "wr",
        "dr",
        "spectralon",
        "flat",
        "flatfield",
        "panel",
        "whitepanel",
        "tile",
        "darkframe",
    ];
    let stem = bare_stem(name);
    words_of(name).iter().any(|word| WORDS.contains(&word.as_str()))
        || ["white", "dark", "reference"].iter().any(|word| stem.starts_with(word) || stem.ends_with(word))
}

/// Returns the letters and digits of a file's name without its ending, in small letters.
pub(super) fn bare_stem(name: &str) -> String {
    bare(name.rsplit_once('.').map_or(name, |(stem, _)| stem))
}

/// Returns what is said of units, scales and masks that GDAL has put beside a file, and of what editors have.
pub(super) fn notes_of_companions(path: &Path) -> impl Iterator<Item = String> {
    // Those of a header are beside its data.
    let is_header = path.extension().is_some_and(|own| own.eq_ignore_ascii_case("hdr"));
    let data = ["", "dat", "img", "bin", "raw", "bsq", "bil", "bip"].into_iter().filter(|_| is_header);
    let files = std::iter::once(path.to_owned()).chain(data.map(|own| path.with_extension(own)));
    let beside = |(file, ending): (PathBuf, &str)| {
        let mut name = file.file_name()?.to_owned();
        name.push(ending);
        path.with_file_name(&name).is_file().then(|| name.to_string_lossy().into_owned())
    };
    let both = files.flat_map(|file| [".aux.xml", ".msk"].map(|ending| (file.clone(), ending)));
    let names: Vec<String> = both.filter_map(beside).collect();
    let of_editors = [path.to_owned(), path.with_extension("")].map(|file| (file, ".xmp"));
    let side_cars: Vec<String> = of_editors.into_iter().filter_map(beside).collect();
    [note_of(path, "companion of GDAL", &names), note_of(path, "side-car", &side_cars)].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubes_that_may_be_references_are_known_by_a_word() {
        for name in
            ["white_panel.hdr", "calibration_white.hdr", "WR.hdr", "Spectralon.hdr", "451_whiteTile.hdr", "flat.hdr"]
        {
            assert!(may_be_reference(name), "{name}");
        }
        for name in ["451.hdr", "flatland.hdr", "drone.hdr"] {
            assert!(!may_be_reference(name), "{name}");
        }
    }

    #[test]
    fn references_are_known_by_their_names() {
        use Reference::{Dark, White};
        for (name, expected) in [
            ("white_reference.hdr", Some((White, false))),
            ("white_reference_1.hdr", Some((White, false))),
            ("WHITEREF_451.hdr", Some((White, true))),
            ("DARKREF_450.hdr", Some((Dark, false))),
            ("darkReference.hdr", Some((Dark, false))),
            ("451_white_reference.hdr", Some((White, true))),
            ("451_dark.hdr", Some((Dark, true))),
            ("white.hdr", Some((White, false))),
            ("451.hdr", None),
            ("450_white.hdr", None),
            ("white_room.hdr", None),
        ] {
            assert_eq!(Reference::of_name(name, "451"), expected, "{name}");
        }
    }

    #[test]
    fn files_that_belong_to_a_scene_are_known() {
        let is_read = |scene: &str, other: &str| may_be_read_with(Path::new(scene), Path::new(other));
        for other in
            ["x/room.depth.png", "x/room_depth.pfm", "x/room.camera.json", "x/room.raw", "x/white_reference_1.hdr"]
        {
            assert!(is_read("x/room.hdr", other), "{other}");
        }
        assert!(
            is_read("x/a_1.radiance_depth.exr", "x/a_camera.json")
                && is_read("x/a_1.radiance_depth.exr", "x/a_1.camera.json")
        );
        assert!(!is_read("x/room.hdr", "x/room.hdr") && !is_read("x/room.hdr", "x/room2.depth.png"));
    }
}
