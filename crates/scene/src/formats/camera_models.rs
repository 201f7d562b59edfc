//! What files of camera data call the models of lenses, and what else they share.

use super::stated::short;

/// Keys that change nothing of what a scene is.
pub(super) const HARMLESS: [&str; 18] = [
    "header",
    "source",
    "name",
    "comment",
    "comments",
    "description",
    "note",
    "notes",
    "license",
    "calibration_time",
    "calibration_Time",
    "nframes",
    "board_width",
    "board_height",
    "square_size",
    "flags",
    "camera_name",
    "sensor_type",
];
/// What calibrations call the polynomial of `OpenCV`, or no distortion at all.
const POLYNOMIALS: [&str; 12] = [
    "OPENCV",
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "PERSPECTIVE",
    "PLUMB_BOB",
    "RATIONAL_POLYNOMIAL",
    "RADTAN",
    "RADIAL_TANGENTIAL",
    "BROWN_CONRADY",
    "NONE",
];
/// What they call a fisheye by the angle.
const FISHEYES: [&str; 8] = [
    "OPENCV_FISHEYE",
    "FISHEYE",
    "EQUIDISTANT",
    "EQUI",
    "KANNALA_BRANDT",
    "KANNALA_BRANDT4",
    "KANNALABRANDT4",
    "KANNALABRANDT8",
];
/// What they call polynomials that are another than `OpenCV`'s, and the same where all coefficients are 0.
const POLYNOMIALS_AT_0: [&str; 2] = ["INVERSE_BROWN_CONRADY", "MODIFIED_BROWN_CONRADY"];

/// Returns whether a model is a fisheye, without distortion where all coefficients are 0; `None` of one that is not known.
pub(super) fn is_fisheye(model: &str, is_zero: bool) -> Option<bool> {
    // RealSense has `distortion.brown_conrady`.
    let model = model.rsplit('.').next().unwrap_or(model);
    let model = model.trim().trim_matches(['"', '\'']).to_uppercase().replace(['-', ' '], "_");
    let of = |known: &[&str]| known.contains(&model.as_str());
    if model.is_empty() || of(&POLYNOMIALS) || is_zero && of(&POLYNOMIALS_AT_0) {
        return Some(false);
    }
    of(&FISHEYES).then_some(true)
}

/// Whether a word is that of a model, known or not, and not who made a camera.
pub(super) fn is_model(word: &str) -> bool {
    let upper = word.to_uppercase().replace(['-', ' '], "_");
    const OF_MODELS: [&str; 6] = ["DISTORTION.", "BROWN_CONRADY", "FTHETA", "F_THETA", "KANNALA", "_FISHEYE"];
    OF_MODELS.iter().any(|part| upper.contains(part))
}

pub(super) fn unknown_model(model: &str) -> String {
    format!("its camera model is '{}', expected PINHOLE, OPENCV or OPENCV_FISHEYE with its coefficients", short(model))
}

/// Checks that of a camera matrix nothing is left out: what must be 0, for it to be that of a camera whose rows and columns are at right angles.
pub(super) fn check_matrix(name: &str, rest: &[f64]) -> Result<(), String> {
    match rest.iter().all(|number| number.abs() < 1e-9) {
        true => Ok(()),
        false => Err(format!("its {name} has a skew or a last row other than 0, 0, 1, expected none")),
    }
}
