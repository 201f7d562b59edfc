//! The part of a stored frame that is shown.

use super::{
    corrections::Place,
    tags::{ACTIVE_AREA, DEFAULT_CROP_ORIGIN, DEFAULT_CROP_SIZE, MASKED_AREAS},
    tiff_reader::Fields,
};

/// The pixels that are shown, and where those that see light begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Area {
    /// The first row and column of those that see light, from which mosaics and levels count.
    pub(super) active_top: usize,
    pub(super) active_left: usize,
    /// How many see light.
    pub(super) active_rows: usize,
    pub(super) active_columns: usize,
    /// The first row and column that are shown, and how many.
    pub(super) top: usize,
    pub(super) left: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// Reads the areas that no light reaches: top, left, bottom and right of each.
pub(super) fn masked_areas(frame: &Fields<'_>, (rows, columns): (usize, usize)) -> Result<Vec<[usize; 4]>, String> {
    let corners = frame.whole(MASKED_AREAS)?;
    let (areas, rest) = corners.as_chunks::<4>();
    let is_within =
        |&[top, left, bottom, right]: &[usize; 4]| top <= bottom && left <= right && bottom <= rows && right <= columns;
    if !rest.is_empty() || areas.len() > MOST_MASKED || !areas.iter().all(is_within) {
        let shown = &corners[..corners.len().min(8)];
        let n = areas.len();
        return Err(format!(
            "has {n} masked areas from {shown:?} on, expected up to {MOST_MASKED} within {columns} × {rows} pixels"
        ));
    }
    let n_pixels: usize = areas.iter().map(|&[top, left, bottom, right]| (bottom - top) * (right - left)).sum();
    if n_pixels > rows * columns {
        return Err(format!("has masked areas of {n_pixels} pixels, more than the frame: they overlap"));
    }
    Ok(areas.to_vec())
}

/// The most areas without light that a file may have: cameras have one to four.
const MOST_MASKED: usize = 64;

impl Area {
    /// Reads the default crop of the active area of a frame of so many rows and columns.
    pub(super) fn read(frame: &Fields<'_>, (rows, columns): (usize, usize)) -> Result<Self, String> {
        let active = frame.whole(ACTIVE_AREA)?;
        let [top, left, bottom, right] = match active.as_slice() {
            [] => [0, 0, rows, columns],
            &[top, left, bottom, right] if top < bottom && left < right && bottom <= rows && right <= columns => {
                [top, left, bottom, right]
            }
            other => {
                return Err(format!("has an active area of {other:?}, expected one within {columns} × {rows} pixels"));
            }
        };
        let (height, width) = (bottom - top, right - left);
        let origin = frame.finite(DEFAULT_CROP_ORIGIN, 2)?.unwrap_or(vec![0.0; 2]);
        let size = frame.finite(DEFAULT_CROP_SIZE, 2)?;
        let size = size.unwrap_or(vec![width as f64 - origin[0], height as f64 - origin[1]]);
        let is_within = |from: f64, n: f64, all: usize| {
            (0.0..=all as f64).contains(&from) && n.round() >= 1.0 && from.round() + n.round() <= all as f64
        };
        if !is_within(origin[0], size[0], width) || !is_within(origin[1], size[1], height) {
            return Err(format!(
                "is to be cropped to {} × {} pixels from {}, {} on, expected some within {width} × {height}",
                size[0], size[1], origin[0], origin[1]
            ));
        }
        let whole = |value: f64| value.round() as usize;
        Ok(Self {
            active_top: top,
            active_left: left,
            active_rows: height,
            active_columns: width,
            top: top + whole(origin[1]),
            left: left + whole(origin[0]),
            rows: whole(size[1]),
            columns: whole(size[0]),
        })
    }

    /// Returns the same frame with all pixels that see light shown.
    pub(super) fn whole(self) -> Self {
        Self {
            top: self.active_top,
            left: self.active_left,
            rows: self.active_rows,
            columns: self.active_columns,
            ..self
        }
    }

    /// Rows and columns that are shown.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Returns top, left, bottom and right of all that is shown, counted from its first pixel.
    pub(super) fn corners(&self) -> [usize; 4] {
        [0, 0, self.rows, self.columns]
    }

    /// Returns the same counted from the first pixel that sees light.
    pub(super) fn shown_corners(&self) -> [usize; 4] {
        let (down, right) = self.places_before();
        [down, right, down + self.rows, right + self.columns]
    }

    /// Returns where what is shown lies among the pixels that see light.
    pub(super) fn place(&self) -> Place {
        let (top, left) = self.places_before();
        Place { rows: self.active_rows, columns: self.active_columns, top, left }
    }

    /// Returns how many rows and columns of light lie before those that are shown.
    pub(super) fn places_before(&self) -> (usize, usize) {
        (self.top - self.active_top, self.left - self.active_left)
    }
}
