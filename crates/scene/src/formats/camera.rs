//! Camera data, and pictures made straight and square by it.

use std::path::{Path, PathBuf};

use super::{
    distortion::Distortion,
    stated::{name_of, shown},
    unusable::unreadable,
};
use crate::{SceneError, View};

/// Displacements of samples below this are none.
const LEAST_SHIFT_PX: f64 = 0.05;

/// Focal lengths that two statements of a file give and that differ by less than this part of them are one.
pub(super) const SAME_FOCAL: f64 = 1e-3;
/// The least focal length of a picture, in its widths: one of 178°.
const LEAST_FOCAL_WIDTHS: f64 = 0.01;
/// The largest, likewise: telescopes have a thousandth of that.
const MOST_FOCAL_WIDTHS: f64 = 1e6;

/// How far from its middle, in its sides, the axis of a picture of which no size is stated may be.
const MOST_OFF_CENTER: f64 = 0.25;

/// How many times as far apart as columns the rows of a picture may be.
const LIKELY_STRETCHES: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// What a camera file states.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraFile {
    pub(super) file: PathBuf,
    /// Columns and rows of the picture that it speaks of, where it tells.
    pub(super) size: Option<(usize, usize)>,
    /// Across and down, samples.
    pub(super) focal_px: [Option<f64>; 2],
    /// The angles from edge to edge, across and down.
    pub(super) angles_rad: [Option<f64>; 2],
    /// The column and the row of the axis; centers of samples are at whole numbers.
    pub(super) center_px: [Option<f64>; 2],
    pub(super) distortion: Distortion,
    /// What one code of the depth beside the picture stands for, m.
    pub(super) depth_unit_m: Option<f64>,
    /// The depth of the picture, where the file names it (`depth_file_path` of nerfstudio).
    pub(super) depth_file: Option<PathBuf>,
    pub(super) notes: Vec<String>,
}

impl CameraFile {
    /// Checks that its numbers can be those of a camera.
    pub(super) fn checked(self) -> Result<Self, String> {
        let focal = self.focal_px.into_iter().flatten();
        let angles = self.angles_rad.into_iter().flatten();
        if self.focal_px[0].is_none() && self.angles_rad[0].is_none() {
            return Err("missing fx_px: expected width, height, fx_px, fy_px, cx_px and cy_px".to_owned());
        }
        if let Some(wrong) = focal.clone().find(|f| !(f.is_finite() && *f > 0.0)) {
            return Err(format!("a focal length of {} px: expected a finite number above 0", shown(wrong)));
        }
        if let Some(wrong) = angles.clone().find(|angle| !(*angle > 0.0 && *angle < std::f64::consts::PI)) {
            return Err(format!("an angle of view of {} rad: expected one above 0 and below π", shown(wrong)));
        }
        let is_finite = self.center_px.into_iter().flatten().all(f64::is_finite) && self.distortion.is_finite();
        if !is_finite {
            return Err("a center or a distortion that is no finite number".to_owned());
        }
        match self.depth_unit_m {
            Some(unit_m) if !(unit_m.is_finite() && unit_m > 0.0) => {
                Err(format!("1 of its depth would be {} m (depth_unit_m), expected a length above 0", shown(unit_m)))
            }
            _ => Ok(self),
        }
    }

    /// Returns the camera data of a picture of so many samples: a whole number of samples of a larger one may have been merged.
    ///
    /// # Errors
    /// When the file speaks of a picture of another size, or states two focal lengths.
    pub(super) fn of_size(&self, picture: &Path, rows: usize, columns: usize) -> Result<CameraData, SceneError> {
        let (width, height) = self.size.unwrap_or((columns, rows));
        let factor = width / columns.max(1);
        if factor == 0 || (width / factor, height / factor) != (columns, rows) {
            let reason =
                format!("it is for {width} × {height} samples, but {} has {columns} × {rows}", picture.display());
            return Err(unreadable(&self.file, reason));
        }
        let fx_px = self.focal(0, width)?.unwrap_or(f64::NAN);
        let fy_px = self.focal(1, height)?;
        if fx_px > MOST_FOCAL_WIDTHS * width as f64 {
            let reason = format!(
                "its focal length of {} px would make a picture of {width} samples narrower than a ten thousandth of a degree",
                shown(fx_px)
            );
            return Err(unreadable(&self.file, reason));
        }
        // Shares of the picture's sides, as photogrammetry has them.
        let are_shares = self.center_px.iter().all(|own| own.is_some_and(|c| (0.0..1.0).contains(&c))) && fx_px < 10.0;
        if width.min(height) > 4 && are_shares {
            let reason = format!(
                "its focal length of {} px and its center within the first sample look like shares of the picture: expected them in samples",
                shown(fx_px)
            );
            return Err(unreadable(&self.file, reason));
        }
        if fx_px < LEAST_FOCAL_WIDTHS * width as f64 {
            let reason = format!(
                "its focal length of {} px would make a picture of {width} samples wider than 178°: expected it in samples",
                shown(fx_px)
            );
            return Err(unreadable(&self.file, reason));
        }
        // Numbers of a picture of another size, which nothing states.
        let is_off = |own: Option<f64>, side: usize| {
            own.is_some_and(|own| self.size.is_none() && ((own + 0.5) / side as f64 - 0.5).abs() > MOST_OFF_CENTER)
        };
        if is_off(self.center_px[0], width) || is_off(self.center_px[1], height) {
            let [x, y] = self.center_px.map(|own| own.map_or("none".to_owned(), shown));
            let reason = format!(
                "its center ({x}, {y}) is far from the middle of {width} × {height} samples, and it does not say for how many it is: \
                 expected its width and height"
            );
            return Err(unreadable(&self.file, reason));
        }
        let k = factor as f64;
        let center = |own: Option<f64>, side: usize| (own.unwrap_or(0.5 * side as f64 - 0.5) + 0.5) / k - 0.5;
        Ok(CameraData {
            file: self.file.clone(),
            fx_px: fx_px / k,
            fy_px: fy_px.unwrap_or(fx_px) / k,
            cx_px: center(self.center_px[0], width),
            cy_px: center(self.center_px[1], height),
            distortion: self.distortion,
            notes: self.notes.iter().cloned().chain(self.note_of_defaults(fy_px.is_none())).collect(),
        })
    }

    /// Returns the focal length along a side of so many samples, which may be stated twice.
    fn focal(&self, axis: usize, side: usize) -> Result<Option<f64>, SceneError> {
        let of_angle = self.angles_rad[axis].map(|angle| 0.5 * side as f64 / (0.5 * angle).tan());
        match (self.focal_px[axis], of_angle) {
            (Some(own), Some(other)) if (own / other - 1.0).abs() > SAME_FOCAL => {
                let reason = format!(
                    "it states a focal length of {} px, and an angle of view that makes it {} px: expected one of them, or both alike",
                    shown(own),
                    shown((100.0 * other).round() / 100.0)
                );
                Err(unreadable(&self.file, reason))
            }
            (own, other) => Ok(own.or(other)),
        }
    }

    /// Returns what is taken in place of numbers that the file should state beside a focal length.
    fn note_of_defaults(&self, lacks_fy: bool) -> Option<String> {
        // An angle alone is that of a picture whose axis lies in its middle.
        self.focal_px[0]?;
        let lacks = [
            (self.center_px[0].is_none(), "cx_px, which is taken for the middle"),
            (self.center_px[1].is_none(), "cy_px, which is taken for the middle"),
            (lacks_fy, "fy_px, which is taken to be fx_px"),
        ];
        let lacks: Vec<&str> = lacks.into_iter().filter(|(is_so, _)| *is_so).map(|(_, what)| what).collect();
        (!lacks.is_empty()).then(|| format!("{}: it does not state {}", name_of(&self.file), lacks.join(", nor ")))
    }
}

/// The camera data of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraData {
    pub(super) file: PathBuf,
    pub(super) fx_px: f64,
    pub(super) fy_px: f64,
    /// Centers of samples are at whole numbers.
    pub(super) cx_px: f64,
    pub(super) cy_px: f64,
    pub(super) distortion: Distortion,
    pub(super) notes: Vec<String>,
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
    ///
    /// # Errors
    /// When its samples are so far from square that it can be no picture.
    pub(super) fn straightened(
        &self,
        rows: usize,
        columns: usize,
    ) -> Result<Option<(Straightened, String)>, SceneError> {
        let stretch = self.fx_px / self.fy_px;
        if !LIKELY_STRETCHES.contains(&stretch) {
            let reason = format!("its samples would be {} times as wide as high", shown(1.0 / stretch));
            return Err(unreadable(&self.file, reason + ": expected those of a picture, 0.05 to 20 times"));
        }
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
        Ok((!what.is_empty()).then_some((straightened, note)))
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
            fx_px: view.focal_px,
            fy_px: view.focal_px,
            cx_px: view.center_x_px,
            cy_px: view.center_y_px,
            distortion: Distortion::default(),
            notes: vec![],
        }
    }
}
