//! Camera data in a JSON file beside a picture.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::Deserialize;

use super::unusable::unreadable;
use crate::{SceneError, View};

/// The keys that are used; others are allowed and left alone.
#[derive(Deserialize)]
struct CameraFile {
    width: usize,
    height: usize,
    fx_px: f64,
    fy_px: f64,
    cx_px: f64,
    cy_px: f64,
    /// How far one code of the depth beside the picture stands for, m.
    #[serde(default)]
    depth_unit_m: Option<f64>,
}

/// Endings of a picture's stem that its camera file does not repeat.
const PARTS: [&str; 4] = [".radiance_depth", ".radiance", ".reflectance", ".depth"];

/// Reads the view of a picture from the camera file beside it, or returns `None` where there is none.
///
/// For `a_1.radiance_depth.exr` the names looked for are `a_1.camera.json`, `a_1_camera.json` and `a_camera.json`.
/// Where the file speaks of a picture a whole number of times larger, samples are taken to have been merged.
pub(crate) fn view_beside(picture: &Path, rows: usize, columns: usize) -> Result<Option<View>, SceneError> {
    let Some((path, camera)) = read_beside(picture)? else { return Ok(None) };
    let wrong = |reason: String| Err(unreadable(&path, reason));
    if (camera.fx_px - camera.fy_px).abs() > 1e-3 * camera.fx_px.abs() {
        return wrong(format!("fx_px {} and fy_px {} differ: expected square samples", camera.fx_px, camera.fy_px));
    }
    let view = View { focal_px: camera.fx_px, center_x_px: camera.cx_px, center_y_px: camera.cy_px };
    if let Err(error) = view.check() {
        return wrong(error.to_string());
    }
    let factor = camera.width / columns;
    if factor == 0 || (camera.width / factor, camera.height / factor) != (columns, rows) {
        return wrong(format!(
            "it is for {} × {} samples, but {} has {columns} × {rows}",
            camera.width,
            camera.height,
            picture.display()
        ));
    }
    Ok(Some(view.binned(factor)))
}

/// Returns the depth that one code of the depth picture stands for, m, where the camera file states it.
pub(super) fn depth_unit_beside(picture: &Path) -> Result<Option<f64>, SceneError> {
    let Some((path, camera)) = read_beside(picture)? else { return Ok(None) };
    match camera.depth_unit_m {
        Some(unit_m) if !(unit_m.is_finite() && unit_m > 0.0) => {
            Err(unreadable(&path, format!("depth_unit_m is {unit_m}, expected a length above 0")))
        }
        unit_m => Ok(unit_m),
    }
}

fn read_beside(picture: &Path) -> Result<Option<(PathBuf, CameraFile)>, SceneError> {
    let Some(path) = candidates(picture).into_iter().find(|path| path.is_file()) else { return Ok(None) };
    let text = fs::read_to_string(&path).map_err(|error| unreadable(&path, error))?;
    let camera = serde_json::from_str(&text).map_err(|error| unreadable(&path, error))?;
    Ok(Some((path, camera)))
}

fn candidates(picture: &Path) -> Vec<PathBuf> {
    beside(picture, &[".camera.json", "_camera.json"])
}

/// Returns the names beside a picture that its stem, and the part of it before the last underscore, have with these endings.
pub(super) fn beside(picture: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let stem = picture.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = PARTS.iter().find_map(|part| stem.strip_suffix(part)).unwrap_or(&stem);
    let mut names: Vec<String> = endings.iter().map(|ending| format!("{stem}{ending}")).collect();
    if let Some((first, _)) = stem.rsplit_once('_') {
        names.extend(endings.iter().filter(|ending| ending.starts_with('_')).map(|ending| format!("{first}{ending}")));
    }
    names.into_iter().map(|name| picture.with_file_name(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"{"width": 741, "height": 500, "fx_px": 994.978, "fy_px": 994.978, "cx_px": 311.0,
        "cy_px": 254.0, "source": "a stereo pair"}"#;

    fn read(text: &str, rows: usize, columns: usize) -> Result<Option<View>, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("motor_camera.json"), text).unwrap();
        view_beside(&folder.path().join("motor_370.radiance_depth.exr"), rows, columns)
    }

    #[test]
    fn a_camera_file_is_found_and_scaled() {
        let full = read(GOOD, 500, 741).unwrap().unwrap();
        assert_eq!(full, View { focal_px: 994.978, center_x_px: 311.0, center_y_px: 254.0 });
        assert_eq!(read(GOOD, 250, 370).unwrap().unwrap(), full.binned(2));
        assert_eq!(view_beside(Path::new("nowhere/a.exr"), 1, 1), Ok(None));
    }

    #[test]
    fn a_camera_file_that_does_not_fit_is_refused_by_name() {
        for (text, rows, columns, word) in [
            (GOOD, 100, 100, "741 × 500"),
            (GOOD, 1, 800, "741 × 500"),
            (&GOOD.replace("\"fy_px\": 994.978", "\"fy_px\": 900.0"), 500, 741, "square"),
            (&GOOD.replace("994.978", "-1"), 500, 741, "focal"),
            (&GOOD.replace("width", "wide"), 500, 741, "width"),
            ("{", 500, 741, "EOF"),
        ] {
            let message = read(text, rows, columns).unwrap_err().to_string();
            assert!(message.contains("motor_camera.json") && message.contains(word), "{message}");
        }
    }
}
