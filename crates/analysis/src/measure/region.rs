//! A rectangle of pixels.

use ndarray::{ArrayView2, ArrayView3, s};
use serde::Serialize;

use dioptric_pipeline::{PipelineError, parse_numbers};

/// A rectangle of pixels; row 0 and column 0 are the top left pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PixelRegion {
    /// The first column.
    pub column: usize,
    /// The first row.
    pub row: usize,
    /// The number of columns.
    pub columns: usize,
    /// The number of rows.
    pub rows: usize,
}

impl PixelRegion {
    /// Reads `x,y,w,h`: the first column and row, and the numbers of them.
    ///
    /// # Errors
    /// When the text is not four whole numbers, or there is nothing in the rectangle.
    pub fn parse(text: &str) -> Result<Self, PipelineError> {
        let numbers = parse_numbers("--region", text)?;
        let whole = |v: f64| (v >= 0.0 && v.fract() == 0.0 && v < 1e9).then_some(v as usize);
        match numbers.iter().map(|&v| whole(v)).collect::<Option<Vec<_>>>().as_deref() {
            Some(&[column, row, columns, rows]) if columns > 0 && rows > 0 => Ok(Self { column, row, columns, rows }),
            _ => Err(PipelineError::Value {
                origin: "the command line".to_owned(),
                key: "--region",
                found: format!("'{text}'"),
                expected: "x,y,w,h in whole pixels, as 100,80,64,64".to_owned(),
            }),
        }
    }

    /// Checks that the rectangle lies within a picture.
    pub(crate) fn check_within(self, (rows, columns): (usize, usize)) -> Result<Self, PipelineError> {
        if self.row + self.rows <= rows && self.column + self.columns <= columns {
            return Ok(self);
        }
        Err(PipelineError::Unsuitable {
            what: "the region",
            reason: format!(
                "{} × {} pixels from column {}, row {} do not lie within a picture of {columns} × {rows}",
                self.columns, self.rows, self.column, self.row
            ),
        })
    }

    /// Returns its part of a plane.
    pub(crate) fn of<'a, T>(self, plane: &'a ndarray::Array2<T>) -> ArrayView2<'a, T> {
        plane.slice(s![self.row..self.row + self.rows, self.column..self.column + self.columns])
    }

    /// Returns its part of a picture.
    pub(crate) fn of_picture<'a, T>(self, picture: &'a ndarray::Array3<T>) -> ArrayView3<'a, T> {
        picture.slice(s![self.row..self.row + self.rows, self.column..self.column + self.columns, ..])
    }
}
