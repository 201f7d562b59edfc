//! Camera data in YAML: of `OpenCV` and ROS, or of Kalibr; and in the XML of `OpenCV`.

use std::path::Path;

use super::{
    camera::CameraFile,
    camera_models::{HARMLESS, check_matrix, is_fisheye, unknown_model},
    distortion::Distortion,
    stated::{Stated, short},
    unusable::TRUNCATED,
};

/// Reads YAML of a calibration of `OpenCV` or ROS (`camera_matrix`, `distortion_coefficients`, `image_width`, `image_height`), or of one camera of
/// Kalibr (`intrinsics`, `distortion_coeffs`, `resolution`); or the first in XML.
pub(super) fn of_yaml(path: &Path, text: &str) -> Result<CameraFile, String> {
    let entries = if text.starts_with('<') { xml_entries(text)? } else { yaml_entries(text)? };
    let mut keys = Stated::new("key", entries);
    one_of_chain(&mut keys)?;
    let list = |text: String| -> Result<Vec<f64>, String> {
        let words = text.trim_matches(['[', ']']).split(',').map(str::trim).filter(|word| !word.is_empty());
        words.map(|word| word.parse().map_err(|_| format!("'{}' is no number", short(word)))).collect()
    };
    let matrix = keys.take_any(&["camera_matrix", "Camera_Matrix", "K", "k", "cameraMatrix"]).map(list).transpose()?;
    let (f, c) = match (matrix, keys.take("intrinsics").map(list).transpose()?) {
        (Some(m), None) => {
            let &[fx, skew, cx, below, fy, cy, left, right, last] = &m[..] else {
                return Err("its camera_matrix has not 9 numbers".to_owned());
            };
            check_matrix("camera_matrix", &[skew, below, left, right, last - 1.0])?;
            ((fx, fy), (cx, cy))
        }
        (None, Some(numbers)) => {
            let &[fx, fy, cx, cy] = &numbers[..] else {
                return Err("its intrinsics are not 4 numbers, expected those of a pinhole".to_owned());
            };
            ((fx, fy), (cx, cy))
        }
        (Some(_), Some(_)) => return Err("it has a camera_matrix and intrinsics: expected one".to_owned()),
        (None, None) => return Err("it has no camera_matrix".to_owned()),
    };
    let mut is_bent_as_fisheye = false;
    for name in ["camera_model", "distortion_model"] {
        let Some(model) = keys.take(name) else { continue };
        is_bent_as_fisheye |= is_fisheye(&model).ok_or_else(|| unknown_model(&model))?;
    }
    let names = ["distortion_coefficients", "Distortion_Coefficients", "distortion_coeffs", "distCoeffs", "D", "d"];
    let k = keys.take_any(&names).map(list).transpose()?.unwrap_or_default();
    let mut side = |names: &[&str]| -> Result<Option<usize>, String> {
        let Some(text) = keys.take_any(names) else { return Ok(None) };
        let wrong = || format!("{} is '{}', expected a number of samples", names[0], short(&text));
        text.parse::<usize>().ok().filter(|n| *n > 0).map(Some).ok_or_else(wrong)
    };
    let size =
        match (side(&["image_width", "image_Width", "width"])?, side(&["image_height", "image_Height", "height"])?) {
            (Some(width), Some(height)) => Some((width, height)),
            (None, None) => None,
            _ => return Err("it has one of image_width and image_height, expected both".to_owned()),
        };
    let size = match (size, keys.take("resolution").map(list).transpose()?.as_deref()) {
        (None, Some(&[width, height])) if width >= 1.0 && height >= 1.0 => Some((width as usize, height as usize)),
        (None, Some(_)) => return Err("its resolution is no width and height".to_owned()),
        (size, _) => size,
    };
    // A rectification that turns nothing is none.
    const NO_TURN: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    if keys.get("rectification_matrix").is_some_and(|text| list(text.clone()).is_ok_and(|own| own == NO_TURN)) {
        keys.take("rectification_matrix");
    }
    Ok(CameraFile {
        file: path.to_owned(),
        size,
        focal_px: [Some(f.0), Some(f.1)],
        angles_rad: [None; 2],
        center_px: [Some(c.0), Some(c.1)],
        distortion: Distortion::of_list(&k, is_bent_as_fisheye)?,
        depth_unit_m: None,
        depth_file: None,
        notes: keys
            .note(path, |name| {
                const OURS: [&str; 9] = [
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
                HARMLESS.contains(&name) || OURS.contains(&name) || name.contains("error")
            })
            .into_iter()
            .collect(),
    })
}

/// Takes the heading of the only camera of a chain of Kalibr (`cam0:`), whose keys stand below it.
fn one_of_chain(keys: &mut Stated<String>) -> Result<(), String> {
    let is_heading = |name: &str| name.strip_prefix("cam").is_some_and(|n| n.parse::<u32>().is_ok());
    let cameras = keys.take_all(|name| is_heading(name));
    match &cameras[..] {
        [] | [_] => Ok(()),
        all => {
            let names = all.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            Err(format!("it has several cameras, {names}: expected a file of one"))
        }
    }
}

/// Returns the elements of a file of `OpenCV` in XML with their texts, a matrix as the list of its data.
fn xml_entries(text: &str) -> Result<Vec<(String, String)>, String> {
    let (_, inner) = text.split_once("<opencv_storage>").ok_or("it is XML, but none of OpenCV (opencv_storage)")?;
    let (mut rest, _) = inner.split_once("</opencv_storage>").ok_or(TRUNCATED)?;
    let mut entries: Vec<(String, String)> = vec![];
    while let Some((_, after)) = rest.split_once('<') {
        if let Some(comment) = after.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, next)| next);
            continue;
        }
        let (head, after) = after.split_once('>').ok_or(TRUNCATED)?;
        let name = head.split([' ', '/', '\n']).next().unwrap_or_default();
        let (body, next) = match after.split_once(&format!("</{name}>")) {
            _ if head.ends_with('/') => ("", after),
            Some(parts) => parts,
            None => return Err(format!("the element '{}' is never closed", short(name))),
        };
        let data = body.split_once("<data>").map(|(_, data)| data.split("</data>").next().unwrap_or_default());
        let value = match data {
            Some(data) => format!("[{}]", data.split_whitespace().collect::<Vec<_>>().join(", ")),
            None => body.trim().trim_matches('"').to_owned(),
        };
        if entries.iter().any(|(own, _)| own == name) {
            return Err(format!("the element '{}' stands twice: expected it once", short(name)));
        }
        entries.push((name.to_owned(), value));
        rest = next;
    }
    Ok(entries)
}

/// Returns the `key: value` lines, in which the `data: [...]` of a matrix belongs to the key above; lists may run over lines.
fn yaml_entries(text: &str) -> Result<Vec<(String, String)>, String> {
    let mut entries: Vec<(String, String)> = vec![];
    // A key without a value, of which no matrix has been found yet.
    let mut matrix: Option<String> = None;
    let without_comment = |line: &str| line.split(" #").next().unwrap_or_default().trim().to_owned();
    let mut rest = text.lines().map(without_comment);
    while let Some(line) = rest.next() {
        if line.is_empty() || line.starts_with(['%', '#']) || line == "---" || line == "..." {
            continue;
        }
        // A list with an item a line belongs to the key above.
        if let Some(item) = line.strip_prefix('-').filter(|item| item.starts_with(' ')) {
            match (matrix.take(), entries.last_mut()) {
                (Some(name), _) => entries.push((name, format!("[{}]", item.trim()))),
                (None, Some((_, list))) if list.ends_with(']') => {
                    list.truncate(list.len() - 1);
                    list.push_str(&format!(", {}]", item.trim()));
                }
                _ => return Err(format!("'{}' stands under no key", short(&line))),
            }
            continue;
        }
        let Some((key, value)) = line.split_once(':') else {
            return Err(format!("'{}' is no key: value", short(&line)));
        };
        let mut value = value.trim().to_owned();
        while value.starts_with('[') && !value.ends_with(']') {
            let Some(more) = rest.next() else {
                return Err(format!("the list of '{}' is never closed by ']'", short(key)));
            };
            value.push_str(&more);
        }
        let entry = match (key.trim(), &matrix) {
            ("rows" | "cols" | "dt", Some(_)) => continue,
            // Behind its data, as PyYAML sorts keys.
            ("rows" | "cols" | "dt", None) if entries.last().is_some_and(|(_, own)| own.ends_with(']')) => continue,
            // A list with an item a line follows.
            ("data", Some(_)) if value.is_empty() => continue,
            ("data", Some(name)) => {
                let name = name.clone();
                matrix = None;
                (name, value)
            }
            (key, _) if value.is_empty() || value.contains("opencv-matrix") => {
                entries.extend(matrix.replace(key.to_owned()).map(|name| (name, String::new())));
                continue;
            }
            (key, _) => {
                entries.extend(matrix.take().map(|name| (name, String::new())));
                (key.to_owned(), value)
            }
        };
        // Those of a second camera are told as such.
        let has_chain = entries.iter().any(|(own, _)| own == "cam0");
        if !has_chain && entries.iter().any(|(own, value)| *own == entry.0 && *value != entry.1) {
            return Err(format!("the key '{}' stands twice: expected it once", short(&entry.0)));
        }
        entries.push(entry);
    }
    entries.extend(matrix.map(|name| (name, String::new())));
    Ok(entries)
}
