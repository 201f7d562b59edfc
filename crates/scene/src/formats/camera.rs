//! Camera data, and pictures made straight and square by it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    camera_files::{of_colmap, of_json, of_yaml},
    distortion::Distortion,
    stated::name_of,
    unusable::{check_memory, unreadable},
};
use crate::{SceneError, View};

/// Endings of a picture's stem that its camera file does not repeat.
const PARTS: [&str; 4] = [".radiance_depth", ".radiance", ".reflectance", ".depth"];
/// Displacements of samples below this are none.
const LEAST_SHIFT_PX: f64 = 0.05;

/// What a camera file states of the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraData {
    pub(super) file: PathBuf,
    /// Columns and rows of the picture that it speaks of, where it tells.
    pub(super) size: Option<(usize, usize)>,
    pub(super) fx_px: f64,
    pub(super) fy_px: f64,
    /// Centers of samples are at whole numbers.
    pub(super) cx_px: f64,
    pub(super) cy_px: f64,
    pub(super) distortion: Distortion,
    /// What one code of the depth beside the picture stands for, m.
    pub(super) depth_unit_m: Option<f64>,
    pub(super) note: Option<String>,
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
    /// nerfstudio (`fl_x`, …), COLMAP's `cameras.txt`, or YAML of `OpenCV` and ROS (`camera_matrix`) or of Kalibr (`intrinsics`).
    ///
    /// # Errors
    /// When it is none of these, lacks what is needed, says a thing twice, or has a model of a lens that is not known.
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let length = fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
        check_memory(path, length.saturating_mul(4), length)?;
        let text = fs::read_to_string(path).map_err(|error| unreadable(path, error))?;
        let data = match text.trim_start_matches('\u{feff}').trim_start() {
            text if text.starts_with('{') => of_json(path, text),
            text if text.contains("camera_matrix") || text.contains("intrinsics:") || text.starts_with("%YAML") => {
                of_yaml(path, text)
            }
            text => of_colmap(path, text),
        };
        let data = data.map_err(|reason| unreadable(path, reason))?;
        let numbers = [data.fx_px, data.fy_px, data.cx_px, data.cy_px];
        if !(numbers.iter().all(|n| n.is_finite())
            && data.distortion.is_finite()
            && data.fx_px > 0.0
            && data.fy_px > 0.0)
        {
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
        let text = GOOD.replace("\"source\"", "\"shutter\": 3, \"Fx_px\": 5, \"units\": \"mm\", \"source\"");
        let note = read(&text, 500, 741).unwrap().note.unwrap();
        assert_eq!(note, "motor_camera.json: its keys 'shutter', 'Fx_px', 'units' are not used");
        let in_samples = GOOD.replace("\"source\"", "\"units\": \"pixels\", \"source\"");
        assert_eq!(read(&in_samples, 500, 741).unwrap().note, None);
    }

    #[test]
    fn other_programs_are_read() {
        let same = |text: &str, unit: Option<f64>| {
            let data = read(text, 480, 640).unwrap();
            assert_eq!(data.note, None, "{text}");
            let numbers = [data.fx_px, data.fy_px, data.cx_px, data.cy_px];
            assert_eq!((numbers, data.depth_unit_m), ([525.0, 526.0, 319.5, 239.5], unit), "{text}");
            data.distortion
        };
        let bent = |k: [f64; 8]| Distortion::Polynomial { k, r8: 0.0 };
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
        assert_eq!(k, bent([0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]));
        same("# cameras\n1 PINHOLE 640 480 525 526 320 240\n", None);
        let k = same(
            "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   \
             dt: d\n   data: [ 525., 0., 319.5, 0.,\n       526., 239.5, 0., 0., 1. ]\ndistortion_coefficients: \
             !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ 0.1, -0.2, 0., 0., 0.3 ]\n",
            None,
        );
        assert_eq!(k, bent([0.1, -0.2, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0]));
        // The fourth coefficient of nerfstudio goes with r^8, that of OpenCV with r^2 below the line.
        let nerf = r#"{"w":640,"h":480,"fl_x":525,"fl_y":526,"cx":320,"cy":240,"k1":0.1,"k4":0.2}"#;
        assert_eq!(same(nerf, None), Distortion::Polynomial { k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], r8: 0.2 });
        let ros = "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [525, 0, 319.5, 0, \
                   526, 239.5, 0, 0, 1]\ndistortion_model: equidistant\ndistortion_coefficients:\n  rows: 1\n  cols: 4\n  \
                   data: [0.1, 0, 0.2, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
        let fisheye = Distortion::Fisheye([0.1, 0.0, 0.2, 0.0]);
        assert_eq!(same(ros, None), fisheye);
        assert_eq!(same("1 OPENCV_FISHEYE 640 480 525 526 320 240 0.1 0 0.2 0", None), fisheye);
        let kalibr = "resolution: [640, 480]\nintrinsics: [525, 526, 319.5, 239.5] # fu, fv, cu, cv\ndistortion_model: \
                      radial-tangential\ndistortion_coefficients: [0.1, -0.2, 0.001, 0.002]\n";
        assert_eq!(same(kalibr, None), bent([0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]));
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
            (&GOOD.replace("\"source\"", "\"camera_model\": \"FOV\", \"source\""), 500, 741, "'FOV'"),
            (&GOOD.replace("\"source\"", "\"fx_px\": 80, \"source\""), 500, 741, "'fx_px' stands twice"),
            (
                &GOOD.replace("\"source\"", "\"depth_unit_m\": 1, \"depth_scale\": 1000, \"source\""),
                500,
                741,
                "depth_scale",
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
