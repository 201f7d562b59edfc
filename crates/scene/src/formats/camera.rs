//! Camera data in a file of its own: ours, or one of `Open3D`, nerfstudio, COLMAP or `OpenCV`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::Value;

use super::{
    stated::{Stated, name_of, short},
    unusable::{check_memory, unreadable},
};
use crate::{SceneError, View};

/// Keys that change nothing of what a scene is.
const HARMLESS: [&str; 12] = [
    "source",
    "name",
    "comment",
    "comments",
    "description",
    "note",
    "notes",
    "license",
    "units",
    "camera_model",
    "camera_angle_x",
    "camera_angle_y",
];
/// Endings of a picture's stem that its camera file does not repeat.
const PARTS: [&str; 4] = [".radiance_depth", ".radiance", ".reflectance", ".depth"];
/// Displacements of samples below this are none.
const LEAST_SHIFT_PX: f64 = 0.05;

/// What a camera file states of the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraData {
    pub(super) file: PathBuf,
    /// Columns and rows of the picture that it speaks of, where it tells.
    size: Option<(usize, usize)>,
    fx_px: f64,
    fy_px: f64,
    /// Centers of samples are at whole numbers.
    cx_px: f64,
    cy_px: f64,
    distortion: Distortion,
    /// What one code of the depth beside the picture stands for, m.
    pub(super) depth_unit_m: Option<f64>,
    pub(super) note: Option<String>,
}

/// The distortion of a lens as `OpenCV` has it: k1, k2, p1, p2, k3, k4, k5, k6.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Distortion([f64; 8]);

impl Distortion {
    /// Returns the tangents at which a direction is pictured.
    fn apply(self, (x, y): (f64, f64)) -> (f64, f64) {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.0;
        let r2 = x * x + y * y;
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }
}

/// How a picture with a distortion, or with samples that are not square, becomes one without.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Straightened {
    /// The view of the new samples.
    pub(super) view: View,
    pub(super) rows: usize,
    pub(super) columns: usize,
    focal_px: (f64, f64),
    center_px: (f64, f64),
    distortion: Distortion,
}

impl Straightened {
    /// Returns the row and column of the old picture of a new sample.
    pub(super) fn source_of(&self, row: usize, column: usize) -> (f64, f64) {
        let (right, up) = self.view.tan_at(row as f64, column as f64);
        let (x, y) = self.distortion.apply((right, -up));
        (self.center_px.1 + self.focal_px.1 * y, self.center_px.0 + self.focal_px.0 * x)
    }
}

impl CameraData {
    /// Reads the camera file beside a picture, or returns `None` where there is none.
    ///
    /// For `a_1.radiance_depth.exr` the names looked for are `a_1.camera.json`, `a_1_camera.json` and `a_camera.json`.
    pub(super) fn beside(picture: &Path) -> Result<Option<Self>, SceneError> {
        let candidates = beside(picture, &[".camera.json", "_camera.json"]);
        let Some(path) = candidates.into_iter().find(|path| path.is_file()) else { return Ok(None) };
        Self::read(&path).map(Some)
    }

    /// Reads camera data: JSON of ours (`width`, `height`, `fx_px`, `fy_px`, `cx_px`, `cy_px`), of `Open3D` (`intrinsic_matrix`) or of
    /// nerfstudio (`fl_x`, …), COLMAP's `cameras.txt`, or `OpenCV`'s YAML (`camera_matrix`).
    ///
    /// # Errors
    /// When it is none of these, lacks what is needed, or has a model of a lens that is not known.
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let length = fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
        check_memory(path, length.saturating_mul(4), length)?;
        let text = fs::read_to_string(path).map_err(|error| unreadable(path, error))?;
        let data = match text.trim_start_matches('\u{feff}').trim_start() {
            text if text.starts_with('{') => of_json(path, text),
            text if text.contains("opencv-matrix") || text.starts_with("%YAML") => of_opencv(path, text),
            text => of_colmap(path, text),
        };
        let data = data.map_err(|reason| unreadable(path, reason))?;
        let numbers = [data.fx_px, data.fy_px, data.cx_px, data.cy_px];
        if !(numbers.iter().chain(&data.distortion.0).all(|n| n.is_finite()) && data.fx_px > 0.0 && data.fy_px > 0.0) {
            let reason = format!(
                "focal lengths {} and {} px, center ({}, {}) px: expected finite numbers and focal lengths above 0",
                data.fx_px, data.fy_px, data.cx_px, data.cy_px
            );
            return Err(unreadable(path, reason));
        }
        match data.depth_unit_m {
            Some(unit_m) if !(unit_m.is_finite() && unit_m > 0.0) => {
                Err(unreadable(path, format!("depth_unit_m is {unit_m}, expected a length above 0")))
            }
            _ => Ok(data),
        }
    }

    /// Returns the view of a picture of so many samples: a whole number of samples of a larger one may have been merged.
    ///
    /// # Errors
    /// When the file speaks of a picture of another size.
    pub(super) fn of_size(&self, picture: &Path, rows: usize, columns: usize) -> Result<Self, SceneError> {
        let (width, height) = self.size.unwrap_or((columns, rows));
        let factor = width / columns.max(1);
        if factor == 0 || (width / factor, height / factor) != (columns, rows) {
            let reason =
                format!("it is for {width} × {height} samples, but {} has {columns} × {rows}", picture.display());
            return Err(unreadable(&self.file, reason));
        }
        let k = factor as f64;
        let center = |c: f64| (c + 0.5) / k - 0.5;
        Ok(Self {
            size: Some((columns, rows)),
            fx_px: self.fx_px / k,
            fy_px: self.fy_px / k,
            cx_px: center(self.cx_px),
            cy_px: center(self.cy_px),
            ..self.clone()
        })
    }

    /// Returns the data with so many columns and rows cut off at the left and the top.
    #[must_use]
    pub(super) fn shifted(mut self, x0: i64, y0: i64) -> Self {
        self.cx_px -= x0 as f64;
        self.cy_px -= y0 as f64;
        self
    }

    /// Returns the view, once samples are square and straight.
    pub(super) fn view(&self) -> View {
        View { focal_px: self.fx_px, center_x_px: self.cx_px, center_y_px: self.cy_px }
    }

    /// Returns how a picture of so many samples is made square and straight, with what is to be said of it; `None` where it is.
    pub(super) fn straightened(&self, rows: usize, columns: usize) -> Option<(Straightened, String)> {
        let stretch = self.fx_px / self.fy_px;
        let new_rows = ((rows as f64 * stretch).round() as usize).max(1);
        let straightened = Straightened {
            view: View {
                focal_px: self.fx_px,
                center_x_px: self.cx_px,
                center_y_px: (self.cy_px + 0.5) * stretch - 0.5,
            },
            rows: new_rows,
            columns,
            focal_px: (self.fx_px, self.fy_px),
            center_px: (self.cx_px, self.cy_px),
            distortion: self.distortion,
        };
        let plain = Straightened { distortion: Distortion::default(), ..straightened };
        let corners = [0, new_rows - 1].into_iter().flat_map(|row| [(row, 0), (row, columns / 2), (row, columns - 1)]);
        let bend = corners
            .map(|(row, column)| {
                let (a, b) = (straightened.source_of(row, column), plain.source_of(row, column));
                (a.0 - b.0).hypot(a.1 - b.1)
            })
            .fold(0.0, f64::max);
        let stretch_px = 0.5 * rows as f64 * (stretch - 1.0).abs();
        let mut what = vec![];
        if stretch_px >= LEAST_SHIFT_PX {
            what.push(format!("its rows are {stretch:.4} times as far apart as its columns"));
        }
        if bend >= LEAST_SHIFT_PX {
            what.push(format!("its lens bends by up to {bend:.1} samples"));
        }
        let note = format!(
            "{}: {}; it is resampled to {columns} × {new_rows} straight and square samples",
            name_of(&self.file),
            what.join(", ")
        );
        (!what.is_empty()).then_some((straightened, note))
    }

    /// Returns the data with samples so many times wider than high.
    #[must_use]
    pub(super) fn with_aspect(mut self, aspect: f64) -> Self {
        self.fy_px *= aspect;
        self
    }

    /// Returns the data of a view that the picture's own file states.
    pub(super) fn of_view(file: &Path, view: View) -> Self {
        Self {
            file: file.to_owned(),
            size: None,
            fx_px: view.focal_px,
            fy_px: view.focal_px,
            cx_px: view.center_x_px,
            cy_px: view.center_y_px,
            distortion: Distortion::default(),
            depth_unit_m: None,
            note: None,
        }
    }
}

fn of_json(path: &Path, text: &str) -> Result<CameraData, String> {
    // Maps of serde_json keep one entry a key: a second one is an error of the reader below, not silently the last.
    let Value::Object(map) = serde_json::from_str(text).map_err(|error| error.to_string())? else {
        return Err("expected an object".to_owned());
    };
    let mut keys = Stated::new("key", map.into_iter().collect());
    // Centers of pixels are at whole numbers for OpenCV and Open3D, at halves for nerfstudio.
    let is_nerf = keys.get("fl_x").is_some();
    if let Some(frames) = keys.take("frames") {
        let same = frames.as_array().is_none_or(|frames| frames.iter().all(|frame| frame.get("fl_x").is_none()));
        if !same {
            return Err("its frames have focal lengths of their own: expected one for all".to_owned());
        }
    }
    let model = keys.get("camera_model").and_then(Value::as_str).unwrap_or("OPENCV").to_uppercase();
    if !["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"].contains(&model.as_str()) {
        return Err(format!("its camera model is '{}', expected PINHOLE or OPENCV", short(&model)));
    }
    let mut number = |names: &[&str]| -> Result<Option<f64>, String> {
        let Some(value) = keys.take_any(names) else { return Ok(None) };
        match value {
            Value::Null => Ok(None),
            value => value.as_f64().map(Some).ok_or_else(|| format!("{} is {value}, expected a number", names[0])),
        }
    };
    let [mut fx, mut fy] = [number(&["fx_px", "fl_x", "fx"])?, number(&["fy_px", "fl_y", "fy"])?];
    let [mut cx, mut cy] = [number(&["cx_px", "cx", "ppx"])?, number(&["cy_px", "cy", "ppy"])?];
    let side = |value: Option<f64>, name: &str| match value {
        None => Ok(None),
        Some(n) if n >= 1.0 && n.fract() == 0.0 && n < 1e6 => Ok(Some(n as usize)),
        Some(n) => Err(format!("{name} is {n}, expected a number of samples")),
    };
    let width = side(number(&["width", "w"])?, "width")?;
    let height = side(number(&["height", "h"])?, "height")?;
    let depth_unit_m = number(&["depth_unit_m", "depth_unit_scale_factor"])?;
    let depth_scale = number(&["depth_scale"])?;
    let mut k = [0.0; 8];
    for (place, name) in ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"].iter().enumerate() {
        k[place] = number(&[name])?.unwrap_or(0.0);
    }
    if let Some(list) = keys.take_any(&["distortion", "dist_coeffs", "distortion_coefficients"]) {
        k = coefficients(&numbers_of(&list, "distortion")?)?;
    }
    if let Some(matrix) = keys.take_any(&["intrinsic_matrix", "K"]) {
        let m = numbers_of(&matrix, "intrinsic_matrix")?;
        // Open3D's nine numbers run down the columns, rows of rows are a table.
        let is_table = matrix.as_array().is_some_and(|rows| rows.iter().any(Value::is_array));
        let [a, b] = if is_table || m.get(6) == Some(&0.0) { [2, 5] } else { [6, 7] };
        let &[first, ..] = &m[..] else { return Err("its intrinsic_matrix is empty".to_owned()) };
        if m.len() != 9 {
            return Err(format!("its intrinsic_matrix has {} numbers, expected 9", m.len()));
        }
        let rest = [m[1], m[3], m[if a == 2 { 6 } else { 2 }], m[if a == 2 { 7 } else { 5 }], m[8] - 1.0];
        check_matrix("intrinsic_matrix", &rest)?;
        (fx, fy, cx, cy) = (Some(first), Some(m[4]), Some(m[a]), Some(m[b]));
    }
    let missing = |name: &str| format!("missing {name}: expected width, height, fx_px, fy_px, cx_px and cy_px");
    let fx = fx.ok_or_else(|| missing("fx_px"))?;
    let fy = fy.unwrap_or(fx);
    let size = match (width, height) {
        (Some(width), Some(height)) => Some((width, height)),
        (None, None) => None,
        (None, _) => return Err(missing("width")),
        (_, None) => return Err(missing("height")),
    };
    let half = if is_nerf { 0.5 } else { 0.0 };
    let middle = |side: Option<usize>| side.map(|n| 0.5 * n as f64 - 0.5 + half);
    let cx = cx.or_else(|| middle(width)).ok_or_else(|| missing("cx_px"))?;
    let cy = cy.or_else(|| middle(height)).ok_or_else(|| missing("cy_px"))?;
    let depth_unit_m = match (depth_unit_m, depth_scale) {
        (Some(unit), _) => Some(unit),
        (None, None) => None,
        // So many codes a metre, as TUM and Open3D have it; small factors are metres to some and millimetres to others.
        (None, Some(scale)) if scale >= 10.0 => Some(1.0 / scale),
        (None, Some(scale)) => {
            return Err(format!(
                "depth_scale is {scale}, which is metres or millimetres a code: expected codes a metre, 10 or more, or \
                 depth_unit_m"
            ));
        }
    };
    Ok(CameraData {
        file: path.to_owned(),
        size,
        fx_px: fx,
        fy_px: fy,
        cx_px: cx - half,
        cy_px: cy - half,
        distortion: Distortion(k),
        depth_unit_m,
        note: keys.note(path, |name| HARMLESS.contains(&name)),
    })
}

/// Returns all numbers of a list, or of a table row by row.
fn numbers_of(value: &Value, name: &str) -> Result<Vec<f64>, String> {
    let wrong = || format!("{name} is no list of numbers");
    let mut numbers = vec![];
    for item in value.as_array().ok_or_else(wrong)? {
        match item {
            Value::Array(row) => {
                numbers.extend(row.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>().ok_or_else(wrong)?);
            }
            item => numbers.push(item.as_f64().ok_or_else(wrong)?),
        }
    }
    Ok(numbers)
}

/// Returns `OpenCV`'s list of coefficients, which may be shorter.
fn coefficients(list: &[f64]) -> Result<[f64; 8], String> {
    let mut k = [0.0; 8];
    if list.iter().skip(8).any(|v| *v != 0.0) {
        return Err("its distortion has more than 8 coefficients".to_owned());
    }
    k.iter_mut().zip(list).for_each(|(k, v)| *k = *v);
    Ok(k)
}

/// Reads the first camera of COLMAP's `cameras.txt`: number, model, width, height and parameters, with centers of pixels at halves.
fn of_colmap(path: &Path, text: &str) -> Result<CameraData, String> {
    let expected =
        "expected JSON, OpenCV's YAML, or a line of COLMAP's cameras.txt: number, model, width, height, parameters";
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let line = lines.next().ok_or(expected)?;
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, model, width, height, parameters @ ..] = &words[..] else { return Err(expected.to_owned()) };
    let side = |word: &str| word.parse::<usize>().ok().filter(|n| *n > 0).ok_or(expected);
    let size = (side(width)?, side(height)?);
    let p: Vec<f64> = parameters.iter().map(|word| word.parse()).collect::<Result<_, _>>().map_err(|_| expected)?;
    let (f, c, k) = match (*model, &p[..]) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ((f, f), (cx, cy), vec![]),
        ("PINHOLE", &[fx, fy, cx, cy]) => ((fx, fy), (cx, cy), vec![]),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ((f, f), (cx, cy), vec![k]),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ((f, f), (cx, cy), vec![k1, k2]),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => ((fx, fy), (cx, cy), vec![k1, k2, p1, p2]),
        _ => {
            return Err(format!(
                "its camera model is '{}' with {} parameters, expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV",
                short(model),
                p.len()
            ));
        }
    };
    let more: Vec<String> = lines.map(short).collect();
    Ok(CameraData {
        file: path.to_owned(),
        size: Some(size),
        fx_px: f.0,
        fy_px: f.1,
        cx_px: c.0 - 0.5,
        cy_px: c.1 - 0.5,
        distortion: Distortion(coefficients(&k)?),
        depth_unit_m: None,
        note: super::stated::note_of(path, "line", &more),
    })
}

/// Checks that of a camera matrix nothing is left out: what must be 0, for it to be that of a camera whose rows and columns are at right angles.
fn check_matrix(name: &str, rest: &[f64]) -> Result<(), String> {
    match rest.iter().all(|number| number.abs() < 1e-9) {
        true => Ok(()),
        false => Err(format!("its {name} has a skew or a last row other than 0, 0, 1, expected none")),
    }
}

/// Reads `OpenCV`'s YAML of a calibration: `camera_matrix`, `distortion_coefficients`, `image_width`, `image_height`.
fn of_opencv(path: &Path, text: &str) -> Result<CameraData, String> {
    // `key: value` lines, in which the `data: [...]` of a matrix belongs to the key above; lists may run over lines.
    let mut entries: Vec<(String, String)> = vec![];
    let mut matrix: Option<String> = None;
    let mut rest = text.lines();
    while let Some(line) = rest.next() {
        let trimmed = line.trim();
        if trimmed.is_empty() || trimmed.starts_with(['%', '#']) || trimmed == "---" {
            continue;
        }
        let Some((key, value)) = trimmed.split_once(':') else {
            return Err(format!("'{}' is no key: value", short(trimmed)));
        };
        let mut value = value.trim().to_owned();
        while value.starts_with('[') && !value.ends_with(']') {
            let Some(more) = rest.next() else {
                return Err(format!("the list of '{}' is never closed by ']'", short(key)));
            };
            value.push_str(more.trim());
        }
        match (key.trim(), &matrix) {
            ("rows" | "cols" | "dt", Some(_)) => {}
            ("data", Some(name)) => entries.push((name.clone(), value)),
            (key, _) if value.contains("opencv-matrix") => matrix = Some(key.to_owned()),
            (key, _) => {
                matrix = None;
                entries.push((key.to_owned(), value));
            }
        }
    }
    let mut keys = Stated::new("key", entries);
    let list = |text: String| -> Result<Vec<f64>, String> {
        let words = text.trim_matches(['[', ']']).split(',').map(str::trim).filter(|word| !word.is_empty());
        words.map(|word| word.parse().map_err(|_| format!("'{}' is no number", short(word)))).collect()
    };
    let names = ["camera_matrix", "Camera_Matrix", "K", "cameraMatrix"];
    let m = list(keys.take_any(&names).ok_or("it has no camera_matrix")?)?;
    let &[fx, skew, cx, below, fy, cy, left, right, last] = &m[..] else {
        return Err("its camera_matrix has not 9 numbers".to_owned());
    };
    check_matrix("camera_matrix", &[skew, below, left, right, last - 1.0])?;
    let names = ["distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D"];
    let k = keys.take_any(&names).map(list).transpose()?.unwrap_or_default();
    let side = |text: Option<String>| text.and_then(|text| text.parse::<usize>().ok());
    let size = side(keys.take_any(&["image_width", "image_Width"]))
        .zip(side(keys.take_any(&["image_height", "image_Height"])));
    Ok(CameraData {
        file: path.to_owned(),
        size,
        fx_px: fx,
        fy_px: fy,
        cx_px: cx,
        cy_px: cy,
        distortion: Distortion(coefficients(&k)?),
        depth_unit_m: None,
        note: keys.note(path, |name| {
            let ours = ["calibration_time", "nframes", "board_width", "board_height", "square_size", "flags"];
            HARMLESS.contains(&name) || ours.contains(&name) || name.contains("error") || name == "calibration_Time"
        }),
    })
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
    use approx::assert_abs_diff_eq;

    const GOOD: &str = r#"{"width": 741, "height": 500, "fx_px": 994.978, "fy_px": 994.978, "cx_px": 311.0,
        "cy_px": 254.0, "source": "a stereo pair"}"#;

    fn read(text: &str, rows: usize, columns: usize) -> Result<CameraData, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("motor_camera.json"), text).unwrap();
        let picture = folder.path().join("motor_370.radiance_depth.exr");
        CameraData::beside(&picture)?.unwrap().of_size(&picture, rows, columns)
    }

    #[test]
    fn camera_file_is_found_and_scaled() {
        let full = read(GOOD, 500, 741).unwrap();
        let view = View { focal_px: 994.978, center_x_px: 311.0, center_y_px: 254.0 };
        assert_eq!((full.view(), &full.note), (view, &None));
        assert_eq!(read(GOOD, 250, 370).unwrap().view(), view.binned(2));
        assert_eq!(CameraData::beside(Path::new("nowhere/a.exr")), Ok(None));
        assert_eq!(full.straightened(500, 741), None);
    }

    #[test]
    fn unknown_keys_are_named() {
        let text = GOOD.replace("\"source\"", "\"shutter\": 3, \"Fx_px\": 5, \"source\"");
        let note = read(&text, 500, 741).unwrap().note.unwrap();
        assert_eq!(note, "motor_camera.json: its keys 'Fx_px', 'shutter' are not used");
    }

    #[test]
    fn other_programs_are_read() {
        let same = |text: &str, unit: Option<f64>| {
            let data = read(text, 480, 640).unwrap();
            assert_eq!(data.note, None, "{text}");
            let numbers = [data.fx_px, data.fy_px, data.cx_px, data.cy_px];
            assert_eq!((numbers, data.depth_unit_m), ([525.0, 526.0, 319.5, 239.5], unit), "{text}");
            data.distortion.0
        };
        same(
            r#"{"width":640,"height":480,"intrinsic_matrix":[525.0,0,0,0,526.0,0,319.5,239.5,1],"depth_scale":1000}"#,
            Some(1e-3),
        );
        same(r#"{"K":[[525.0,0,319.5],[0,526.0,239.5],[0,0,1]]}"#, None);
        let k = same(
            r#"{"w":640,"h":480,"fl_x":525,"fl_y":526,"cx":320,"cy":240,"k1":0.1,"k2":-0.2,"p1":0.001,"p2":0.002,
                "camera_model":"OPENCV","frames":[{"file_path":"a.png"}]}"#,
            None,
        );
        assert_eq!(k, [0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]);
        same("# cameras\n1 PINHOLE 640 480 525 526 320 240\n", None);
        let k = same(
            "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   \
             dt: d\n   data: [ 525., 0., 319.5, 0.,\n       526., 239.5, 0., 0., 1. ]\ndistortion_coefficients: \
             !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ 0.1, -0.2, 0., 0., 0.3 ]\n",
            None,
        );
        assert_eq!(k, [0.1, -0.2, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn stretched_and_bent_pictures_are_straightened() {
        let text = GOOD.replace("\"fy_px\": 994.978", "\"fy_px\": 497.489, \"k1\": -0.3");
        let data = read(&text, 500, 741).unwrap();
        let (straight, note) = data.straightened(500, 741).unwrap();
        assert_eq!((straight.rows, straight.columns), (1000, 741));
        assert!(note.contains("2.0000 times") && note.contains("bends"), "{note}");
        // The axis stays where it was, and a direction is found where the lens pictured it.
        let (row, column) = straight.view.position_of(0.0, 0.0);
        assert_abs_diff_eq!(column, 311.0, epsilon = 1e-9);
        assert_abs_diff_eq!(row, (254.0 + 0.5) * 2.0 - 0.5, epsilon = 1e-9);
        let x = (700.0 - 311.0) / 994.978;
        let (_, at) = straight.source_of(row.round() as usize, 700);
        assert_abs_diff_eq!(at, 311.0 + 994.978 * x * (1.0 - 0.3 * x * x), epsilon = 1e-3);
    }

    #[test]
    fn camera_file_that_does_not_fit_is_refused_by_name() {
        for (text, rows, columns, word) in [
            (GOOD, 100, 100, "741 × 500"),
            (GOOD, 1, 800, "741 × 500"),
            (&GOOD.replace("994.978", "-1"), 500, 741, "focal"),
            (&GOOD.replace("width", "wide"), 500, 741, "width"),
            (&GOOD.replace("fx_px", "fx_pix"), 500, 741, "fx_px"),
            (&GOOD.replace("741", "\"wide\""), 500, 741, "width is"),
            (&GOOD.replace("\"source\"", "\"depth_scale\": 0.1, \"source\""), 500, 741, "depth_scale is 0.1"),
            (
                &GOOD.replace("\"source\"", "\"camera_model\": \"OPENCV_FISHEYE\", \"source\""),
                500,
                741,
                "OPENCV_FISHEYE",
            ),
            (r#"{"width":741,"height":500,"intrinsic_matrix":[525.0,0,0,5,526.0,0,319.5,239.5,1]}"#, 500, 741, "skew"),
            (r#"{"K":[[525.0,0,319.5],[0,526.0,239.5],[0,0,0]]}"#, 500, 741, "skew"),
            ("{", 500, 741, "EOF"),
            ("[3]", 500, 741, "expected JSON"),
            ("1 FISHEYE 3 4 5", 500, 741, "FISHEYE"),
        ] {
            let message = read(text, rows, columns).unwrap_err().to_string();
            assert!(message.contains("motor_camera.json") && message.contains(word), "{message}");
        }
    }
}
