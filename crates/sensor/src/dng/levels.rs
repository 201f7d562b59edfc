//! Black and saturation of the frame of a DNG file, and the table that makes its codes straight.

use std::sync::Arc;

use ndarray::Array2;
use rayon::prelude::*;
use serde::Serialize;

use super::{
    area::Area,
    samples::{Codes, Samples},
    tags::{
        BLACK_LEVEL, BLACK_LEVEL_DELTA_H, BLACK_LEVEL_DELTA_V, BLACK_LEVEL_REPEAT_DIM, LINEARIZATION_TABLE, WHITE_LEVEL,
    },
    tiff_reader::Fields,
};
use crate::{Levels, RawPlane};

/// The levels of a frame, places counted from the active area's first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FileLevels {
    table: Option<Arc<[u16]>>,
    /// The rows and columns after which black repeats.
    repeat: (usize, usize),
    /// Black of each place and plane.
    black: Vec<f64>,
    /// What is added to it in each column and row; none or too few add nothing.
    of_columns: Vec<f64>,
    of_rows: Vec<f64>,
    /// Saturation of each plane.
    white: Vec<f64>,
}

/// What the pixels of a frame hold that no light reaches (`MaskedAreas`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskedSamples {
    /// How many they are.
    pub n_pixels: usize,
    /// How far the mean of each plane lies above the black level that the file states, straightened codes.
    pub above_black: Vec<f64>,
    /// The standard deviation of each plane's.
    pub deviation: Vec<f64>,
}

/// How far above black masked pixels lie before that is told, standard errors of their mean; a step of a code is a quarter of one at least.
const TOLD_ERRORS: f64 = 4.0;

impl MaskedSamples {
    /// Says that darkness lies above the black level of the file, where it does.
    pub(super) fn note(&self) -> Option<String> {
        let error = |deviation: f64| (deviation / (self.n_pixels as f64).sqrt()).max(0.25);
        let planes = self.above_black.iter().zip(&self.deviation);
        let most = planes.filter(|(above, deviation)| above.abs() > TOLD_ERRORS * error(**deviation));
        let most = most.map(|(above, _)| *above).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let side = if most > 0.0 { "above" } else { "below" };
        Some(format!(
            "the {} masked pixels of the file lie {:.2} {side} its black level, as with dark current; --black masked takes their mean for black",
            self.n_pixels,
            most.abs()
        ))
    }
}

impl FileLevels {
    pub(super) fn read(frame: &Fields<'_>, stored: &Samples) -> Result<Self, String> {
        let n = stored.n_planes;
        let table = frame.whole(LINEARIZATION_TABLE)?;
        let table: Option<Arc<[u16]>> =
            (!table.is_empty()).then(|| table.into_iter().map(|entry| entry as u16).collect());
        let repeat = match frame.whole(BLACK_LEVEL_REPEAT_DIM)?.as_slice() {
            [] => (1, 1),
            &[rows, columns] if (1..=64).contains(&rows) && (1..=64).contains(&columns) => (rows, columns),
            other => {
                return Err(format!(
                    "has levels of black that repeat after {other:?}, expected rows and columns of 1 to 64"
                ));
            }
        };
        let n_black = repeat.0 * repeat.1 * n;
        // Some writers state one level for all planes.
        let black = match frame.numbers(BLACK_LEVEL)?.as_slice() {
            &[all] if all.is_finite() => vec![all; n_black],
            _ => frame.finite(BLACK_LEVEL, n_black)?.unwrap_or(vec![0.0; n_black]),
        };
        let is_float = matches!(stored.codes, Codes::Floats(_));
        let table = table.filter(|_| !is_float);
        let top = stored.top();
        let top = table.as_ref().map_or(top, |table| table.iter().copied().max().map_or(top, f64::from));
        let white = match frame.numbers(WHITE_LEVEL)?.as_slice() {
            [] => vec![top; n],
            &[all] => vec![all; n],
            several if several.len() == n => several.to_vec(),
            several => return Err(format!("has {} levels of saturation, expected {n}", several.len())),
        };
        let finite = |tag: u16| {
            let values = frame.numbers(tag)?;
            if values.iter().all(|value| value.is_finite()) {
                Ok(values)
            } else {
                Err(format!("has no numbers in field {tag}"))
            }
        };
        let levels = Self {
            table,
            repeat,
            black,
            of_columns: finite(BLACK_LEVEL_DELTA_H)?,
            of_rows: finite(BLACK_LEVEL_DELTA_V)?,
            white,
        };
        for plane in 0..n {
            let (black, white) = (levels.highest_black(plane), levels.white[plane]);
            if !(white > black && white.is_finite()) {
                return Err(format!("is saturated at {white}, expected more than its black of {black}"));
            }
        }
        Ok(levels)
    }

    /// Returns the levels whose black is raised to the mean of the pixels of areas (top, left, bottom and right) that no light reaches.
    pub(super) fn raised_to(mut self, masked: &MaskedSamples) -> Result<Self, String> {
        let n = self.white.len();
        for (plane, raised) in masked.above_black.iter().enumerate() {
            self.black.iter_mut().skip(plane).step_by(n).for_each(|black| *black += raised);
            let (black, white) = (self.highest_black(plane), self.white[plane]);
            if black.is_nan() || black >= white {
                return Err(format!("is saturated at {white}, expected more than the {black} of its masked pixels"));
            }
        }
        Ok(self)
    }

    /// Returns what the pixels of areas hold that no light reaches.
    pub(super) fn masked(&self, stored: &Samples, areas: &[[usize; 4]], area: &Area) -> Option<MaskedSamples> {
        let n = self.white.len();
        let (rows, columns) = self.repeat;
        let place = |i: usize, first: usize, n: usize| (i as isize - first as isize).rem_euclid(n as isize) as usize;
        let places = || {
            areas.iter().flat_map(|&[top, left, bottom, right]| {
                (top..bottom).flat_map(move |r| (left..right).map(move |c| (r, c)))
            })
        };
        let n_pixels = places().count();
        if n_pixels == 0 {
            return None;
        }
        let above = |plane: usize| {
            let of = |(row, column): (usize, usize)| {
                let (r, c) = (place(row, area.active_top, rows), place(column, area.active_left, columns));
                self.straight(stored.at(row, column, plane)) - self.black[(r * columns + c) * n + plane]
            };
            let mean = places().map(of).sum::<f64>() / n_pixels as f64;
            let variance = places().map(|at| (of(at) - mean).powi(2)).sum::<f64>() / n_pixels as f64;
            (mean, variance.sqrt())
        };
        let (above_black, deviation) = (0..n).map(above).unzip();
        Some(MaskedSamples { n_pixels, above_black, deviation })
    }

    fn highest_black(&self, plane: usize) -> f64 {
        let highest = |values: &[f64]| values.iter().copied().reduce(f64::max).unwrap_or(0.0);
        let n = self.white.len();
        let places = self.black.iter().skip(plane).step_by(n).copied().fold(f64::NEG_INFINITY, f64::max);
        places + highest(&self.of_columns) + highest(&self.of_rows)
    }

    fn black_at(&self, row: usize, column: usize, plane: usize) -> f64 {
        let (rows, columns) = self.repeat;
        let place = (row % rows * columns + column % columns) * self.white.len() + plane;
        let more = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(0.0);
        self.black[place] + more(&self.of_columns, column) + more(&self.of_rows, row)
    }

    /// Whether all places and planes have the same levels.
    fn are_even(&self) -> bool {
        let is_one = |values: &[f64]| values.iter().all(|value| *value == values[0]);
        let is_zero = |values: &[f64]| values.iter().all(|value| *value == 0.0);
        is_one(&self.black) && is_one(&self.white) && is_zero(&self.of_columns) && is_zero(&self.of_rows)
    }

    /// Returns the planes that are shown, as they are stored where their levels are the same everywhere, and these levels.
    pub(super) fn planes(&self, stored: &Samples, area: &Area, saturation_e: f64) -> (Vec<RawPlane>, Levels) {
        let top = stored.top();
        let n = stored.n_planes;
        let size = (area.rows, area.columns);
        if let Codes::Whole(codes) = &stored.codes
            && self.are_even()
        {
            let code = |row: usize, column: usize, plane: usize| {
                codes[((area.top + row) * stored.columns + area.left + column) * n + plane]
            };
            let plane = |plane: usize| RawPlane::Dn(Array2::from_shape_fn(size, |(r, c)| code(r, c, plane)));
            let levels = Levels::of_file((self.black[0], self.white[0], top), saturation_e, self.table.clone());
            return ((0..n).map(plane).collect(), levels);
        }
        let (down, right) = area.places_before();
        let range = |plane: usize| self.white[plane] - self.highest_black(plane);
        let evened = |plane: usize| {
            let scale = range(0) / range(plane);
            let mut values = Array2::zeros(size);
            let rows = values.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(area.columns);
            rows.enumerate().for_each(|(row, values): (usize, &mut [f32])| {
                for (column, value) in values.iter_mut().enumerate() {
                    let straight = self.straight(stored.at(area.top + row, area.left + column, plane));
                    *value = (scale * (straight - self.black_at(down + row, right + column, plane))) as f32;
                }
            });
            RawPlane::Evened(values)
        };
        let levels = Levels::of_file((0.0, range(0), range(0)), saturation_e, None);
        ((0..n).map(evened).collect(), levels)
    }

    fn straight(&self, code: f32) -> f64 {
        match &self.table {
            Some(table) => f64::from(table[(code as usize).min(table.len() - 1)]),
            None => f64::from(code),
        }
    }
}
