//! Camera data, and pictures made straight and square by it.

use std::path::{Path, PathBuf};

use super::{distortion::Distortion, stated::name_of, unusable::unreadable};
use crate::{SceneError, View};

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
