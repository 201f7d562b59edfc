//! Layers laid one behind the other until every pixel is covered.

use std::ops::Range;

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::{Array2, ArrayView1, Zip};

/// The light or the alpha of a blurred layer, and the part of each row that it touches.
pub(crate) struct BlurredPlane {
    values: Array2<f32>,
    /// First column and the one after the last.
    touched: Vec<(usize, usize)>,
}

impl BlurredPlane {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        Self { values: Array2::zeros((rows, columns)), touched: vec![(columns, 0); rows] }
    }

    /// Adds to a part of a row.
    pub(crate) fn add_row(&mut self, row: usize, first_column: usize, values: &[f32]) {
        let mut line = self.values.row_mut(row);
        let line = line.as_slice_mut().expect("planes are in standard order");
        for (sum, value) in line[first_column..][..values.len()].iter_mut().zip(values) {
            *sum += value;
        }
        let (start, end) = &mut self.touched[row];
        *start = (*start).min(first_column);
        *end = (*end).max(first_column + values.len());
    }

    /// Adds a layer on pixels `factor` times as wide, about the same middle, interpolated between their centers.
    pub(crate) fn add_magnified(&mut self, coarse: &Self, factor: usize, cancel: &Cancel) -> Result<(), Cancelled> {
        let (rows, columns) = self.values.dim();
        let (coarse_rows, coarse_columns) = coarse.values.dim();
        // A pixel's place among those of the coarse layer: the first of two, and the share of the second.
        let place = |index: usize, n: usize, n_coarse: usize| {
            let at = (index as f64 - 0.5 * (n as f64 - 1.0)) / factor as f64 + 0.5 * (n_coarse as f64 - 1.0);
            let first = (at as usize).min(n_coarse - 2);
            (first, (at - first as f64) as f32)
        };
        let across: Vec<(usize, f32)> = (0..columns).map(|column| place(column, columns, coarse_columns)).collect();
        let plane = &coarse.values;
        for row in 0..rows {
            cancel.check()?;
            let (top, down) = place(row, rows, coarse_rows);
            let between = |&(left, right): &(usize, f32)| {
                let at = |row: usize| plane[(row, left)] + right * (plane[(row, left + 1)] - plane[(row, left)]);
                at(top) + down * (at(top + 1) - at(top))
            };
            let line: Vec<f32> = across.iter().map(between).collect();
            self.add_row(row, 0, &line);
        }
        Ok(())
    }

    /// Returns the plane as the picture of a scene of one layer.
    pub(crate) fn into_picture(self) -> Array2<f32> {
        self.values.mapv_into(|light| light.max(0.0))
    }

    /// Wipes the plane for the next layer.
    fn clear(&mut self) {
        let columns = self.values.ncols();
        for (row, (start, end)) in self.touched.iter_mut().enumerate() {
            if let Some(line) = self.values.row_mut(row).as_slice_mut() {
                line[*start..(*end).max(*start)].fill(0.0);
            }
            (*start, *end) = (columns, 0);
        }
    }

    /// Returns the plane as alpha, without the zeros at the ends of its rows and in gaps.
    pub(crate) fn into_alpha(self) -> LayerAlpha {
        let rows = || self.touched.iter().zip(self.values.rows());
        let lit = |(&(start, end), row): (&(usize, usize), ArrayView1<'_, f32>)| runs_of(row, start..end);
        let lines: Vec<Vec<Range<usize>>> = rows().map(lit).collect();
        let mut alpha = Vec::with_capacity(lines.iter().flatten().map(Range::len).sum());
        let (mut runs, mut first_runs) = (Vec::with_capacity(lines.iter().map(Vec::len).sum()), vec![0]);
        for (line, row) in lines.into_iter().zip(self.values.rows()) {
            for columns in line {
                let start = alpha.len();
                alpha.extend(row.iter().skip(columns.start).take(columns.len()));
                runs.push(Run { columns, start });
            }
            first_runs.push(runs.len());
        }
        LayerAlpha { first_runs, runs, alpha }
    }
}

/// Columns without alpha that part a run of alpha from the next: fewer cost less than another run.
const LEAST_GAP: usize = 32;

/// Returns the columns of a row in which there is anything, gaps left out.
fn runs_of(row: ArrayView1<'_, f32>, columns: Range<usize>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for column in columns.filter(|&column| row[column] != 0.0) {
        match runs.last_mut() {
            Some(run) if column < run.end + LEAST_GAP => run.end = column + 1,
            _ => runs.push(column..column + 1),
        }
    }
    runs
}

/// The alpha of a blurred layer: the share of each pixel that it covers, of each row the parts where it covers any.
#[derive(Debug)]
pub(crate) struct LayerAlpha {
    /// Which run is the first of each row, and how many there are.
    first_runs: Vec<usize>,
    runs: Vec<Run>,
    alpha: Vec<f32>,
}

/// Neighboring pixels of a row.
#[derive(Debug)]
struct Run {
    columns: Range<usize>,
    /// Where their alpha begins.
    start: usize,
}

impl LayerAlpha {
    /// The bytes of memory that it takes.
    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.first_runs.as_slice()) + size_of_val(self.runs.as_slice()) + size_of_val(self.alpha.as_slice())
    }

    /// The runs of a row.
    fn line(&self, row: usize) -> &[Run] {
        &self.runs[self.first_runs[row]..self.first_runs[row + 1]]
    }

    /// Adds its alpha in a row, times a factor, to that from column `first` on.
    fn add_to(&self, row: usize, factor: f32, alpha: &mut [f32], first: usize) {
        for Run { columns, start } in self.line(row) {
            let own = &self.alpha[*start..][..columns.len()];
            alpha[columns.start - first..].iter_mut().zip(own).for_each(|(sum, own)| *sum += factor * own);
        }
    }
}

/// The alpha of a layer between two bands.
#[derive(Clone, Copy)]
pub(crate) struct AlphaBetween<'a> {
    pub(crate) lower: &'a LayerAlpha,
    pub(crate) upper: &'a LayerAlpha,
    /// 0 at the lower band, 1 at the upper one.
    pub(crate) fraction: f32,
}

impl AlphaBetween<'_> {
    /// Puts the alpha of a row into `alpha`, and returns the column of its first value.
    fn line(&self, row: usize, alpha: &mut Vec<f32>) -> usize {
        alpha.clear();
        let parts = [(self.lower, 1.0 - self.fraction), (self.upper, self.fraction)];
        let parts = parts.into_iter().filter(|(_, factor)| *factor != 0.0);
        let runs = parts.clone().flat_map(|(part, _)| part.line(row));
        let ends = |(start, end): (usize, usize), run: &Run| (start.min(run.columns.start), end.max(run.columns.end));
        let (start, end) = runs.fold((usize::MAX, 0), ends);
        alpha.resize(end.saturating_sub(start), 0.0);
        parts.for_each(|(part, factor)| part.add_to(row, factor, alpha, start));
        start.min(end)
    }
}

/// The picture so far, and the share of each pixel that no layer has covered yet.
///
/// "Saturating coverage": a layer may add alpha until a pixel is full, and adds light in proportion. A continuous
/// surface that spans many layers covers each pixel just once, so that no seams show.
pub(crate) struct Composite {
    light: Array2<f32>,
    uncovered: Array2<f32>,
}

/// A pixel with less alpha than this, which is rounding error of the transforms, has none.
const LEAST_ALPHA: f32 = 1e-5;

impl Composite {
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        Self { light: Array2::zeros((rows, columns)), uncovered: Array2::ones((rows, columns)) }
    }

    /// Lays a layer behind those before it, and wipes it.
    pub(crate) fn composite_under(
        &mut self,
        light: &mut BlurredPlane,
        alpha: AlphaBetween<'_>,
        cancel: &Cancel,
    ) -> Result<(), Cancelled> {
        let mut alphas = vec![];
        for row in 0..light.values.nrows() {
            cancel.check()?;
            let first = alpha.line(row, &mut alphas);
            for (column, &alpha) in (first..).zip(&alphas) {
                let uncovered = &mut self.uncovered[(row, column)];
                if alpha <= 0.0 || *uncovered <= 0.0 {
                    continue;
                }
                let taken = alpha.min(*uncovered);
                self.light[(row, column)] += light.values[(row, column)] * (taken / alpha);
                *uncovered -= taken;
            }
        }
        light.clear();
        Ok(())
    }

    /// Adds a layer's light as if it hid nothing, and wipes it.
    pub(crate) fn add(&mut self, light: &mut BlurredPlane) {
        self.light += &light.values;
        light.clear();
    }

    /// Returns the picture, each pixel scaled to full alpha.
    pub(crate) fn finish(self) -> Array2<f32> {
        let mut light = self.light;
        Zip::from(&mut light).and(&self.uncovered).for_each(|light, &uncovered| {
            let covered = 1.0 - uncovered;
            *light = if covered > LEAST_ALPHA { (*light / covered).max(0.0) } else { 0.0 };
        });
        light
    }

    /// Returns the sum of the light that was added.
    pub(crate) fn finish_sum(self) -> Array2<f32> {
        self.light.mapv_into(|light| light.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(value: f32) -> BlurredPlane {
        let mut plane = BlurredPlane::new(1, 1);
        plane.add_row(0, 0, &[value]);
        plane
    }

    fn composite(layers: &[(f32, f32)]) -> f32 {
        let mut picture = Composite::new(1, 1);
        for &(light, alpha) in layers {
            let alpha = plane(alpha).into_alpha();
            let alpha = AlphaBetween { lower: &alpha, upper: &alpha, fraction: 0.25 };
            picture.composite_under(&mut plane(light), alpha, &Cancel::new()).unwrap();
        }
        picture.finish()[(0, 0)]
    }

    #[test]
    fn full_cover_hides_what_is_behind() {
        assert_eq!(composite(&[(3.0, 1.0), (7.0, 1.0)]), 3.0);
    }

    #[test]
    fn half_cover_lets_half_of_what_is_behind_through() {
        assert_eq!(composite(&[(0.5 * 3.0, 0.5), (7.0, 1.0)]), 5.0);
    }

    #[test]
    fn a_surface_in_two_layers_covers_once() {
        assert_eq!(composite(&[(0.4 * 3.0, 0.4), (0.6 * 3.0, 0.6), (9.0, 0.5)]), 3.0);
    }

    #[test]
    fn alpha_between_bands_is_their_mean() {
        let alpha = |first: usize, values: &[f32]| {
            let mut plane = BlurredPlane::new(2, 9);
            plane.add_row(1, first, values);
            plane.into_alpha()
        };
        let (lower, upper) = (alpha(1, &[0.0, 0.5, 1.0, 1.0, 0.0]), alpha(4, &[1.0, 0.5]));
        assert_eq!((lower.alpha.len(), upper.alpha.len()), (3, 2));
        assert!(alpha(3, &[0.0, 0.0]).alpha.is_empty());
        let line = |row: usize, fraction: f32| {
            let mut alpha = vec![7.0];
            let first = AlphaBetween { lower: &lower, upper: &upper, fraction }.line(row, &mut alpha);
            (first, alpha)
        };
        assert_eq!(line(1, 0.25), (2, vec![0.375, 0.75, 1.0, 0.125]));
        assert_eq!(line(1, 0.0), (2, vec![0.5, 1.0, 1.0]));
        assert_eq!(line(1, 1.0), (4, vec![1.0, 0.5]));
        assert_eq!(line(0, 0.25), (0, vec![]));
    }

    #[test]
    fn gaps_of_a_row_take_no_memory() {
        let mut plane = BlurredPlane::new(1, 200);
        plane.add_row(0, 2, &[0.5, 0.0, 0.25]);
        plane.add_row(0, 100, &[1.0]);
        let values: Vec<f32> = plane.values.row(0).to_vec();
        let layer = plane.into_alpha();
        assert_eq!((layer.alpha.as_slice(), layer.runs.len()), (&[0.5, 0.0, 0.25, 1.0][..], 2));
        let mut alpha = Vec::new();
        let first = AlphaBetween { lower: &layer, upper: &layer, fraction: 1.0 }.line(0, &mut alpha);
        assert_eq!((first, alpha.as_slice()), (2, &values[2..101]));
    }

    #[test]
    fn a_thin_cover_is_scaled_to_a_full_one() {
        assert!((composite(&[(0.9 * 3.0, 0.9)]) - 3.0).abs() < 1e-6);
        assert_eq!(composite(&[]), 0.0);
    }
}
