//! A film that beams of light are drawn on: small ones on its pixels, wide ones on pixels twice, four times … as wide.

use dioptric_optics::GhostBeam;
use glam::{DMat2, DVec2};
use ndarray::Array2;

use crate::Film;

/// Films of more pixels than this are drawn on pixels twice as wide, or four times, …
const MOST_PIXELS: usize = 1 << 22;
/// The sides of a beam on pixels of the level that it is drawn on: as wide as what is laid over its edges there.
const SIDE: f64 = 2.0;
/// The most pixels that the longer side of a beam passes.
const LONGEST: f64 = 32.0;
/// Samples of a beam are so many pixels apart at most. Each is spread over the four pixels around it.
const APART: f64 = 0.75;

/// Sums of light on a film.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    film: Film,
    /// Pixels of the film, and 2, 4, 8 … times as wide ones.
    levels: Vec<Level>,
    /// The finest level that is drawn on.
    finest: usize,
}

/// A raster of pixels with one more at each side.
#[derive(Clone, Debug)]
struct Level {
    rows: usize,
    columns: usize,
    /// Empty until something is drawn.
    sums: Vec<f32>,
}

impl Level {
    fn row(&self) -> usize {
        self.columns + 2
    }

    fn sums(&mut self) -> &mut [f32] {
        if self.sums.is_empty() {
            self.sums = vec![0.0; (self.rows + 2) * (self.columns + 2)];
        }
        &mut self.sums
    }

    /// Spreads light over the four pixels around a place, columns and rows from the upper left corner.
    fn put(&mut self, place: DVec2, light: f64) {
        let from_margin = place + 0.5;
        let (column, row) = (from_margin.x.floor(), from_margin.y.floor());
        // Of what falls beside the margin nothing is seen.
        let is_near =
            column >= -1.0 && row >= -1.0 && column <= self.columns as f64 + 1.0 && row <= self.rows as f64 + 1.0;
        if !is_near {
            return;
        }
        let [right, below] = [from_margin.x - column, from_margin.y - row];
        let (width, rows, columns) = (self.row(), self.rows as i64 + 2, self.columns as i64 + 2);
        let sums = self.sums();
        for (row, part) in [(row as i64, 1.0 - below), (row as i64 + 1, below)] {
            for (column, part) in [(column as i64, part * (1.0 - right)), (column as i64 + 1, part * right)] {
                if (0..rows).contains(&row) && (0..columns).contains(&column) {
                    sums[row as usize * width + column as usize] += (light * part) as f32;
                }
            }
        }
    }
}

impl Canvas {
    pub(super) fn new(film: &Film) -> Self {
        let mut levels = vec![Level { rows: film.rows, columns: film.columns, sums: Vec::new() }];
        let mut finest = 0;
        while let Some(Level { rows, columns, .. }) = levels.last().filter(|level| level.rows.max(level.columns) > 2) {
            if rows * columns > MOST_PIXELS {
                finest = levels.len();
            }
            levels.push(Level { rows: rows.div_ceil(2), columns: columns.div_ceil(2), sums: Vec::new() });
        }
        Self { film: *film, levels, finest }
    }

    /// Draws a beam whose light is worth so much.
    pub(super) fn draw(&mut self, beam: &GhostBeam, worth: f64) {
        let Film { rows, columns, pitch_um, center_mm } = self.film;
        let pitch_mm = 1e-3 * pitch_um;
        // The picture is the film turned; rows count downwards.
        let in_picture = DVec2::new(-1.0, 1.0) / pitch_mm;
        let middle_px = (beam.middle_mm + center_mm) * in_picture + 0.5 * DVec2::new(columns as f64, rows as f64);
        let sides_px = beam.sides_mm.map(|side| side * in_picture);
        let reach_px = 0.5 * (sides_px[0].abs() + sides_px[1].abs()) + 1.0;
        let size = DVec2::new(columns as f64, rows as f64);
        if (middle_px + reach_px).min_element() < 0.0
            || (middle_px - reach_px).cmpgt(size).any()
            || !reach_px.is_finite()
        {
            return;
        }
        // Where the sides lie along each other, as in caustics, what counts is how wide the parallelogram is across them.
        let lengths = sides_px.map(DVec2::length);
        let longer = lengths[0].max(lengths[1]);
        let across =
            if longer > 0.0 { DMat2::from_cols(sides_px[0], sides_px[1]).determinant().abs() / longer } else { 0.0 };
        let level = (across / SIDE).log2().max((longer / LONGEST).log2()).ceil().max(0.0) as usize;
        let level = level.clamp(self.finest, self.levels.len() - 1);
        let scale = f64::from(1_u32 << level).recip();
        let (middle, sides) = (middle_px * scale, sides_px.map(|side| side * scale));
        let n = lengths.map(|length| (length * scale / APART).ceil().max(1.0));
        let light = worth * beam.light / (pitch_mm * pitch_mm) / (n[0] * n[1]);
        for i in 0..n[0] as usize {
            let along = middle + sides[0] * ((i as f64 + 0.5) / n[0] - 0.5);
            for j in 0..n[1] as usize {
                self.levels[level].put(along + sides[1] * ((j as f64 + 0.5) / n[1] - 0.5), light);
            }
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (own, other) in self.levels.iter_mut().zip(&other.levels).filter(|(_, other)| !other.sums.is_empty()) {
            own.sums().iter_mut().zip(&other.sums).for_each(|(own, other)| *own += other);
        }
    }

    /// Returns the sums of all levels on the pixels of the film: between wide pixels light is linear.
    pub(super) fn into_irradiance(mut self) -> Array2<f32> {
        for level in (1..self.levels.len()).rev() {
            let (finer, wide) = self.levels.split_at_mut(level);
            let wide = &wide[0];
            if wide.sums.is_empty() {
                continue;
            }
            let fine = &mut finer[level - 1];
            let (rows, columns, width, wide_width) = (fine.rows, fine.columns, fine.row(), wide.row());
            let sums = fine.sums();
            // Of pixel k of the finer level, counted from its margin: the two wide ones around it and the part of the first.
            let around = |k: usize| {
                let first = k.div_ceil(2) - usize::from(k > 0 && k % 2 == 1);
                if k % 2 == 1 { (first, 0.25, first + 1) } else { (first, 0.75, first + 1) }
            };
            for row in 0..rows + 2 {
                let (above, part, below) = around(row);
                for column in 0..columns + 2 {
                    let (left, of_left, right) = around(column);
                    let at = |row: usize, column: usize| {
                        let is_there = row < wide.rows + 2 && column < wide.columns + 2;
                        if is_there { wide.sums[row * wide_width + column] } else { 0.0 }
                    };
                    let on_row = |row: usize| of_left * at(row, left) + (1.0 - of_left) * at(row, right);
                    sums[row * width + column] += 0.25 * (part * on_row(above) + (1.0 - part) * on_row(below));
                }
            }
        }
        let Level { rows, columns, sums, .. } = self.levels.swap_remove(0);
        let width = columns + 2;
        let at = |(row, column)| if sums.is_empty() { 0.0 } else { sums[(row + 1) * width + column + 1] };
        Array2::from_shape_fn((rows, columns), at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(film: &Film, beams: &[(DVec2, [DVec2; 2])]) -> Array2<f32> {
        let mut canvas = Canvas::new(film);
        for &(middle_mm, sides_mm) in beams {
            canvas.draw(&GhostBeam { middle_mm, sides_mm, light: 1.0 }, 1e-4);
        }
        canvas.into_irradiance()
    }

    /// Of any size and shape, all of a beam's light is on the film, about its middle.
    #[test]
    fn beams_keep_their_light_and_place() {
        let film = Film::centered(301, 420, 10.0);
        for (side_mm, other_mm) in [
            (DVec2::ZERO, DVec2::ZERO),
            (DVec2::new(0.004, 0.001), DVec2::new(-0.002, 0.003)),
            (DVec2::new(0.3, 0.1), DVec2::new(-0.1, 0.21)),
            (DVec2::new(0.6, 0.2), DVec2::new(0.3, 0.1)),
            (DVec2::new(0.0, 0.8), DVec2::new(0.5, 0.0)),
        ] {
            let middle_mm = DVec2::new(0.333, -0.218);
            let picture = drawn(&film, &[(middle_mm, [side_mm, other_mm])]);
            // 1e-4 over a pixel of 1e-4 mm².
            let sum: f64 = picture.iter().map(|v| f64::from(*v)).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{side_mm} {sum}");
            let mean = picture.indexed_iter().fold(DVec2::ZERO, |mean, ((row, column), v)| {
                mean + f64::from(*v) * DVec2::new(column as f64 - 209.5, 150.0 - row as f64) * 0.01
            });
            // The picture is the film turned.
            assert!((mean + middle_mm).length() < 1e-4, "{side_mm} {mean}");
        }
    }

    /// Beams that touch each other make an even light.
    #[test]
    fn beams_side_by_side_are_even() {
        let film = Film::centered(200, 200, 10.0);
        for side_px in [0.9_f64, 3.3, 17.0] {
            let side_mm = 0.01 * side_px;
            let turn = DVec2::from_angle(0.3);
            let n = (1.0 / side_mm).ceil() as i32;
            let beams: Vec<_> = (-n..=n)
                .flat_map(|i| (-n..=n).map(move |j| turn.rotate(DVec2::new(i.into(), j.into()) * side_mm)))
                .map(|middle_mm| (middle_mm, [turn * side_mm, turn.perp() * side_mm]))
                .collect();
            let picture = drawn(&film, &beams);
            let expected = 1.0 / (side_px * side_px);
            let middle = picture.slice(ndarray::s![60..140, 60..140]);
            let worst = middle.iter().map(|v| (f64::from(*v) / expected - 1.0).abs()).fold(0.0, f64::max);
            // Samples three quarters of a pixel apart that are spread over one.
            assert!(worst < 0.06, "{side_px}: {worst}");
        }
    }
}
