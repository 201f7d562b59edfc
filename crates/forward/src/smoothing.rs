//! Functions over patches, smoothed over the borders between them.

use multiversion::multiversion;

use crate::{
    geometry::FilmFrame,
    patch::{Patch, Products, polynomials},
    rectangle::Rectangle,
};

/// Takes a function over a rectangle patch by patch, 0 where there is none, and replaces it by its means over squares.
///
/// The mean is that of a function which is straight between pixels, over `2 * half` pixels each way, so it leaves constants and planes as they are.
#[derive(Default)]
pub(crate) struct Smoother {
    half: usize,
    /// The rectangle, with `half` pixels around it.
    at: Option<Rectangle>,
    values: Vec<f32>,
    along_rows: Vec<f32>,
    smooth: Vec<f32>,
    /// The polynomials along a line of a patch, 1 and 2.
    across: [Vec<f32>; 2],
}

impl Smoother {
    /// Begins a function over a rectangle.
    pub(crate) fn begin(&mut self, at: &Rectangle, half: usize) {
        let grown = at.grown(half);
        self.half = half;
        self.at = Some(grown);
        self.values.clear();
        self.values.resize(grown.rows * grown.columns, 0.0);
    }

    /// Puts in what the function is over a patch: products of its polynomials.
    pub(crate) fn add(&mut self, patch: &Patch, frame: &FilmFrame, products: &Products) {
        let Some(at) = self.at else { return };
        let Some(inside) = patch.cell.pixels(frame).intersection(&at) else { return };
        let skip = ((inside.first_row - at.first_row) as usize, (inside.first_column - at.first_column) as usize);
        let place_of = |row: usize, column: usize| {
            patch.cell.place_of(frame, inside.first_row + row as i64, inside.first_column + column as i64)
        };
        let [first, second] = &mut self.across;
        first.clear();
        second.clear();
        for column in 0..inside.columns {
            let [_, linear, square] = polynomials(place_of(0, column).1 as f32);
            first.push(linear);
            second.push(square);
        }
        let lines = self.values.chunks_exact_mut(at.columns).skip(skip.0).take(inside.rows);
        for (row, line) in lines.enumerate() {
            let down = polynomials(place_of(row, 0).0 as f32);
            let along: [f32; 3] = std::array::from_fn(|j| (0..3).map(|i| products[3 * i + j] * down[i]).sum());
            put_line(&mut line[skip.1..], along, [&*first, &*second]);
        }
    }

    /// Returns the smoothed function, row by row.
    pub(crate) fn finish(&mut self) -> &[f32] {
        let Some(at) = self.at.take() else { return &[] };
        let half = self.half;
        if half == 0 {
            return &self.values;
        }
        let (rows, columns) = (at.rows - 2 * half, at.columns - 2 * half);
        self.along_rows.clear();
        self.along_rows.resize(at.rows * columns, 0.0);
        for (line, values) in self.along_rows.chunks_exact_mut(columns).zip(self.values.chunks_exact(at.columns)) {
            put_means(line, (values, 1), 2 * half);
        }
        self.smooth.clear();
        self.smooth.resize(rows * columns, 0.0);
        for (row, line) in self.smooth.chunks_exact_mut(columns).enumerate() {
            put_means(line, (&self.along_rows[row * columns..], columns), 2 * half);
        }
        &self.smooth
    }
}

/// Puts a sum of the polynomials 0, 1 and 2 at each place of a line into it.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn put_line(line: &mut [f32], along: [f32; 3], [first, second]: [&[f32]; 2]) {
    for ((value, first), second) in line.iter_mut().zip(first).zip(second) {
        *value = along[0] + along[1] * first + along[2] * second;
    }
}

/// Puts the means of `length + 1` lines, each so many values behind the one before it, into one; the first and the last line are counted half.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn put_means(means: &mut [f32], (values, step): (&[f32], usize), length: usize) {
    const LANES: usize = 32;
    let weight = |place: usize| if place == 0 || place == length { 0.5 } else { 1.0 } / length as f32;
    let (whole, rest) = means.as_chunks_mut::<LANES>();
    let n_whole = LANES * whole.len();
    for (first, means) in (0..).step_by(LANES).zip(whole) {
        let mut sums = [0.0; LANES];
        for place in 0..=length {
            let (line, weight) = (&values[first + place * step..][..LANES], weight(place));
            sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += weight * value);
        }
        *means = sums;
    }
    for (first, mean) in (n_whole..).zip(rest) {
        *mean = (0..=length).map(|place| weight(place) * values[first + place * step]).sum();
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
}
