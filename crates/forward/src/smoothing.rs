//! Functions over patches, smoothed over the borders between them.

use std::collections::BTreeMap;

use multiversion::multiversion;

use crate::{
    geometry::FilmFrame,
    patch::{Patch, Products, polynomials},
    rectangle::Rectangle,
};

/// Takes a function over a rectangle patch by patch, 0 where there is none, and makes up its means over squares.
///
/// The mean is that of a function which is straight between pixels, over `2 * half` pixels each way, so it leaves constants and planes as they are. Over each patch
/// the function is a sum of products of polynomials, whose means are the products of theirs along rows and columns.
#[derive(Default)]
pub(crate) struct Smoother {
    half: usize,
    at: Option<Rectangle>,
    means: Vec<f32>,
    /// Those of the polynomials 0, 1 and 2 of cells along an axis, which are 0 beyond the cell: from `half` pixels before it to as many behind it.
    polynomials: BTreeMap<Pixels, [Vec<f32>; 3]>,
}

/// The pixels of a cell along an axis.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Pixels {
    n: usize,
    half: usize,
    /// The side of the cell, and how far the center of its first pixel is from its start: 4096ths of a pixel.
    size: i64,
    first: i64,
}

impl Pixels {
    /// Returns those from pixel `first` on of a cell so many sides from the axis, which is at `center`.
    fn new((first, n): (i64, usize), half: usize, size_px: f64, (cell, center): (i32, f64)) -> Self {
        let parts = |px: f64| (4096.0 * px).round() as i64;
        Self { n, half, size: parts(size_px), first: parts(first as f64 - f64::from(cell) * size_px - center) }
    }

    fn means(&self) -> [Vec<f32>; 3] {
        let size_px = self.size as f64 / 4096.0;
        let place = |pixel: usize| ((self.first as f64 / 4096.0 + pixel as f64) / size_px - 0.5) as f32;
        let values: Vec<[f32; 3]> = (0..self.n).map(|pixel| polynomials(place(pixel))).collect();
        std::array::from_fn(|i| means_of(&values.iter().map(|value| value[i]).collect::<Vec<f32>>(), self.half))
    }
}

impl Smoother {
    /// Begins a function over a rectangle.
    pub(crate) fn begin(&mut self, at: &Rectangle, half: usize) {
        self.half = half;
        self.at = Some(*at);
        self.means.clear();
        self.means.resize(at.len(), 0.0);
    }

    /// Adds what the function is over a patch: products of its polynomials.
    pub(crate) fn add(&mut self, patch: &Patch, frame: &FilmFrame, products: &Products) {
        let (Some(at), half) = (self.at, self.half) else { return };
        let pixels = patch.cell.pixels(frame);
        let reach = pixels.grown(half);
        let Some(inside) = reach.intersection(&at).filter(|_| pixels.len() > 0) else { return };
        let (center, size_px) = (frame.center(), patch.cell.size_in(frame));
        let down = Pixels::new((pixels.first_row, pixels.rows), half, size_px, (patch.cell.down, center.0));
        let across = Pixels::new((pixels.first_column, pixels.columns), half, size_px, (patch.cell.across, center.1));
        for along in [down, across] {
            self.polynomials.entry(along).or_insert_with(|| along.means());
        }
        let (down, across) = (&self.polynomials[&down], &self.polynomials[&across]);
        let row = (inside.first_row - reach.first_row) as usize;
        let column = (inside.first_column - reach.first_column) as usize;
        let across = across.each_ref().map(|means| &means[column..][..inside.columns]);
        let lines = self.means[inside.offset_in(&at)..].chunks_mut(at.columns).take(inside.rows);
        for (row, line) in (row..).zip(lines) {
            let along = std::array::from_fn(|j| (0..3).map(|i| products[3 * i + j] * down[i][row]).sum());
            add_line(&mut line[..inside.columns], along, across);
        }
    }

    /// Returns the means, row by row.
    pub(crate) fn finish(&mut self) -> &[f32] {
        if self.at.take().is_some() { &self.means } else { &[] }
    }
}

/// Returns the means of values over `2 * half` pixels, from `half` pixels before them to as many behind; there are zeros beyond them.
fn means_of(values: &[f32], half: usize) -> Vec<f32> {
    if half == 0 {
        return values.to_vec();
    }
    let length = 2 * half;
    // The first and the last are counted half.
    let weight = |place: usize| if place == 0 || place == length { 0.5 } else { 1.0 } / length as f32;
    let mean = |end: usize| {
        let places = end.saturating_sub(values.len() - 1)..=end.min(length);
        places.map(|place| weight(place) * values[end - place]).sum()
    };
    (0..values.len() + length).map(mean).collect()
}

/// Adds a sum of the polynomials 0, 1 and 2 at each place of a line to it.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_line(line: &mut [f32], along: [f32; 3], [zeroth, first, second]: [&[f32]; 3]) {
    for (((value, zeroth), first), second) in line.iter_mut().zip(zeroth).zip(first).zip(second) {
        *value += along[0] * zeroth + along[1] * first + along[2] * second;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Film, patch::Cell};

    fn patch(down: i32, across: i32) -> Patch {
        let cell = Cell { down, across, size: 16 };
        Patch { cell, is_by_knots: true, around: None, shares: vec![], elsewhere: vec![] }
    }

    /// A plane over two patches stays what it is; a step between them becomes a ramp.
    #[test]
    fn planes_stay_and_steps_become_ramps() {
        let frame = FilmFrame::new(&Film::centered(64, 64, 1.0), 1);
        let (left, right) = (patch(0, 0), patch(0, 1));
        let first = left.cell.pixels(&frame);
        let at =
            Rectangle { first_row: first.first_row + 4, first_column: first.first_column + 4, rows: 8, columns: 24 };
        let mut smoother = Smoother::default();
        // 2 + 3u over the first cell, and what goes on from it over the next.
        smoother.begin(&at, 4);
        smoother.add(&left, &frame, &[2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        smoother.add(&right, &frame, &[5.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for line in smoother.finish().chunks(24) {
            for (column, value) in line.iter().enumerate() {
                let u = (column as f32 + 4.5) / 16.0 - 0.5;
                assert!((value - (2.0 + 3.0 * u)).abs() < 1e-5, "{value} in column {column}");
            }
        }
        smoother.begin(&at, 4);
        smoother.add(&right, &frame, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        // Pixels 4 to 27 of the first cell on: the step is between 15 and 16.
        let eighths: Vec<f32> = smoother.finish()[..24].iter().map(|value| 8.0 * value).collect();
        let expected: Vec<f32> = (4..28).map(|pixel| (pixel as f32 - 15.5).clamp(-4.0, 4.0) + 4.0).collect();
        for (value, expected) in eighths.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-5, "{eighths:?}");
        }
    }

    /// One after the other on films of odd and even sides, and on wide pixels.
    #[test]
    fn places_of_pixels_are_those_of_their_film() {
        let cell = patch(-1, 2);
        let mut smoother = Smoother::default();
        for (rows, columns, factor) in [(64, 64, 1), (65, 64, 1), (64, 65, 1), (33, 32, 2), (64, 64, 1)] {
            let frame = FilmFrame::new(&Film::centered(rows, columns, 1.0), factor);
            let at = cell.cell.pixels(&frame);
            smoother.begin(&at, 0);
            smoother.add(&cell, &frame, &[0.5, 1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
            for (i, value) in smoother.finish().iter().enumerate() {
                let (row, column) = (at.first_row + (i / at.columns) as i64, at.first_column + (i % at.columns) as i64);
                let (v, u) = cell.cell.place_of(&frame, row, column);
                let expected = 0.5 + u + 2.0 * v + 3.0 * (u * u - 1.0 / 12.0) * (v * v - 1.0 / 12.0);
                assert!((f64::from(*value) - expected).abs() < 1e-5, "{value} {expected} at {row}, {column}");
            }
        }
    }
}
