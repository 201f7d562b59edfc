//! What else of `ISETCam` than scenes is saved in files, and where it belongs.

use super::container::{Content, MatArray, MatFile};

/// The names under which `ISETCam` saves an optical image.
pub(super) const OPTICAL_IMAGES: [&str; 2] = ["oi", "opticalimage"];
/// The names under which it saves a display.
pub(super) const DISPLAYS: [&str; 2] = ["d", "display"];

/// Fields of all its objects that are read, or change nothing of what they are.
const HARMLESS: [&str; 20] = [
    "name",
    "type",
    "filename",
    "consistency",
    "magnification",
    "bitDepth",
    "wAngular",
    "spectrum.wave",
    "data.photons",
    "data.luminance",
    "data.meanL",
    "data.illuminance",
    "data.meanIll",
    "data.bitDepth",
    "illuminant.name",
    "illuminant.type",
    "illuminant.comment",
    "illuminant.spectrum.wave",
    "illuminant.wave",
    "illuminant.wavelength",
];

/// Returns the fields of an object, those of structures within it too, that nobody knows; of which each of a structure of ours is known.
pub(super) fn left_of(object: &MatArray<'_>, name: &str, ours: &[&str]) -> Vec<String> {
    let is_known = |own: &str| {
        let within = own.strip_prefix(name).map_or(own, |own| own.trim_start_matches('.'));
        let head = within.split('.').next().unwrap_or_default();
        HARMLESS.contains(&within)
            || ours.contains(&within)
            || ours.contains(&head)
            || within.starts_with("illuminant.data")
    };
    let mut left = object.leaves(name);
    left.retain(|own| !is_known(own));
    left
}

/// Its other objects by their names in files, with what they are and where they belong.
const OTHERS: [(&[&str], &str); 7] = [
    (&OPTICAL_IMAGES, "an optical image of ISETCam: expected as irradiance, `dioptric sense FILE.mat --sensor …`"),
    (&DISPLAYS, "a display of ISETCam: expected as what shows a picture, `dioptric show PICTURE --display FILE.mat`"),
    (
        &["isa", "sensor", "ISA"],
        "a sensor of ISETCam: expected its volts as an array of their own, and its numbers in a sensor file (`dioptric sensor init`)",
    ),
    (
        &["vcimage", "ip", "vci"],
        "a processed picture of ISETCam: expected as a picture, its 'data.result' written as PNG or EXR",
    ),
    (&["optics"], "optics of ISETCam: expected a scene, and a lens file for the optics"),
    (&["pixel"], "a pixel of ISETCam: expected a scene, and a sensor file for the pixel"),
    (
        &["illuminant"],
        "a light of ISETCam: expected a scene; a CSV file of the light's spectrum goes with --illuminant",
    ),
];

/// Returns what a file holds in place of a scene, where that is a structure of `ISETCam`.
pub(super) fn other_than_scene(file: &MatFile) -> Option<String> {
    let holds = |names: &&[&str]| file.listed.iter().any(|own| !own.is_numeric && names.contains(&own.name.as_str()));
    OTHERS.iter().find(|(names, _)| holds(names)).map(|(_, what)| format!("it holds {what}"))
}

/// Returns a structure of any of these names.
pub(super) fn structure_of<'a>(file: &'a MatFile, names: &[&str]) -> Result<Option<MatArray<'a>>, String> {
    for name in names {
        if let Some(array) = file.array(name)?.filter(|array| matches!(array.content, Content::Fields(_))) {
            return Ok(Some(array));
        }
    }
    Ok(None)
}
