//! The pinhole geometry of a scene's picture.

use serde::{Deserialize, Serialize};

use crate::SceneError;

/// Where the samples of a scene lie, as seen from the projection center.
///
/// Centers of samples are at whole numbers of rows and columns: a sample at (row, column) shows what lies at the
/// tangents (column − `center_x_px`) / `focal_px` to the right and (`center_y_px` − row) / `focal_px` upwards.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Distance from the projection center to the picture, in samples.
    pub focal_px: f64,
    /// Column of the optical axis.
    pub center_x_px: f64,
    /// Row of the optical axis.
    pub center_y_px: f64,
}

impl View {
    /// Returns the view of a picture whose axis is at its center and that spans this angle from edge to edge.
    ///
    /// # Errors
    /// When the angle is not between 0° and 180°.
    pub fn from_horizontal_fov_deg(fov_deg: f64, columns: usize, rows: usize) -> Result<Self, SceneError> {
        if !(fov_deg > 0.0 && fov_deg < 180.0) {
            return Err(SceneError::Setting {
                what: "the horizontal field of view",
                value: format!("{fov_deg}°"),
                expected: "an angle between 0° and 180°".to_owned(),
            });
        }
        Ok(Self {
            focal_px: 0.5 * columns as f64 / (0.5 * fov_deg).to_radians().tan(),
            center_x_px: 0.5 * (columns as f64 - 1.0),
            center_y_px: 0.5 * (rows as f64 - 1.0),
        })
    }

    /// Returns the tangents of the angles to the right and upwards; row and column may lie between samples.
    pub fn tan_at(&self, row: f64, column: f64) -> (f64, f64) {
        ((column - self.center_x_px) / self.focal_px, (self.center_y_px - row) / self.focal_px)
    }

    /// Returns the row and column of a direction: the inverse of [`tan_at`](Self::tan_at).
    pub fn position_of(&self, tan_x: f64, tan_y: f64) -> (f64, f64) {
        (self.center_y_px - self.focal_px * tan_y, self.center_x_px + self.focal_px * tan_x)
    }

    /// Returns the angle from the left edge of the first column to the right edge of the last.
    pub fn horizontal_fov_deg(&self, columns: usize) -> f64 {
        let left = (self.center_x_px + 0.5) / self.focal_px;
        let right = (columns as f64 - 0.5 - self.center_x_px) / self.focal_px;
        (left.atan() + right.atan()).to_degrees()
    }

    /// Returns how many times longer the way to a point is than its depth along the axis.
    pub fn distance_per_depth(&self, row: f64, column: f64) -> f64 {
        let (x, y) = self.tan_at(row, column);
        (1.0 + x * x + y * y).sqrt()
    }

    /// Returns the view of a part of the picture that starts at this row and column.
    #[must_use]
    pub fn cropped(self, first_row: usize, first_column: usize) -> Self {
        Self {
            center_x_px: self.center_x_px - first_column as f64,
            center_y_px: self.center_y_px - first_row as f64,
            ..self
        }
    }

    /// Returns the view after `factor` × `factor` samples have been merged into one.
    #[must_use]
    pub fn binned(self, factor: usize) -> Self {
        let k = factor as f64;
        Self {
            focal_px: self.focal_px / k,
            center_x_px: (self.center_x_px + 0.5) / k - 0.5,
            center_y_px: (self.center_y_px + 0.5) / k - 0.5,
        }
    }

    /// Checks that the numbers can be a camera's.
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let finite = self.focal_px.is_finite() && self.center_x_px.is_finite() && self.center_y_px.is_finite();
        if finite && self.focal_px > 0.0 {
            return Ok(());
        }
        Err(SceneError::Setting {
            what: "the camera data of the scene",
            value: format!("focal {} px, center ({}, {}) px", self.focal_px, self.center_x_px, self.center_y_px),
            expected: "finite numbers and a focal length above 0".to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn forty_degrees_over_200_columns_have_a_focal_length_of_274_75_samples() {
        let view = View::from_horizontal_fov_deg(40.0, 200, 100).unwrap();
        assert_abs_diff_eq!(view.focal_px, 274.747_741_945_462_2, epsilon = 1e-9);
        assert_abs_diff_eq!(view.horizontal_fov_deg(200), 40.0, epsilon = 1e-12);
        assert_eq!((view.center_x_px, view.center_y_px), (99.5, 49.5));
        for wrong in [0.0, 180.0, -1.0, f64::NAN] {
            assert!(View::from_horizontal_fov_deg(wrong, 10, 10).is_err());
        }
    }

    #[test]
    fn right_is_positive_x_and_up_is_positive_y() {
        let view = View::from_horizontal_fov_deg(40.0, 201, 101).unwrap();
        assert_eq!(view.tan_at(50.0, 100.0), (0.0, 0.0));
        let (x, y) = view.tan_at(0.0, 200.0);
        assert!(x > 0.0 && y > 0.0);
        let (row, column) = view.position_of(x, y);
        assert_abs_diff_eq!(row, 0.0, epsilon = 1e-12);
        assert_abs_diff_eq!(column, 200.0, epsilon = 1e-12);
    }

    #[test]
    fn cropping_and_binning_keep_directions() {
        let view = View { focal_px: 500.0, center_x_px: 310.0, center_y_px: 200.0 };
        assert_eq!(view.cropped(10, 20).tan_at(5.0, 7.0), view.tan_at(15.0, 27.0));
        let (x, y) = view.binned(2).tan_at(3.0, 4.0);
        let (x2, y2) = view.tan_at(6.5, 8.5);
        assert_abs_diff_eq!(x, x2, epsilon = 1e-15);
        assert_abs_diff_eq!(y, y2, epsilon = 1e-15);
    }
}
