//! Lamps: samples of a scene that are far brighter than what lies around them.

use std::{borrow::Cow, collections::BTreeMap};

use ndarray::{Array2, s};
use rayon::prelude::*;

/// A sample that shines: what it has above its surroundings is imaged as a point of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lamp {
    pub(crate) row: usize,
    pub(crate) column: usize,
    /// Radiance above that of the surroundings.
    pub(crate) radiance: f32,
}

/// The row and the column of a sample, and how much of its light is a lamp, 0–1.
type LampSample = ((usize, usize), f64);

/// How many times as bright as the mean of its surroundings a lamp is: those that fill less than an eighth of them. Up to twice that it is one in part, so that nothing jumps.
const TIMES_AS_BRIGHT: f64 = 8.0;
/// Side of the squares by which surroundings are judged, samples: they are a square and those beside it.
const SQUARE: usize = 8;
/// The most lamps of a band; of more, the brightest.
const MOST_LAMPS: usize = 4096;

/// The samples of a square.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    sum: f64,
    most: f32,
}

impl Sums {
    fn with(self, other: &Self) -> Self {
        Self { n: self.n + other.n, sum: self.sum + other.sum, most: self.most.max(other.most) }
    }

    fn mean(&self) -> f64 {
        self.sum / self.n.max(1.0)
    }
}

/// Returns a plane of radiance without its lamps, in whose place is the mean of what lies around them, and the lamps, row by row.
///
/// `is_there` tells the samples that may be one.
pub(crate) fn without_lamps<'a>(
    plane: Cow<'a, Array2<f32>>,
    is_there: &(dyn Fn(usize, usize) -> bool + Sync),
) -> (Cow<'a, Array2<f32>>, Vec<Lamp>) {
    let (rows, columns) = plane.dim();
    let (down, across) = (rows.div_ceil(SQUARE), columns.div_ceil(SQUARE));
    let lines_of = |row: usize| row * SQUARE..((row + 1) * SQUARE).min(rows);
    let places_of = |column: usize| column * SQUARE..((column + 1) * SQUARE).min(columns);
    let samples_of = |row: usize, column: usize| {
        lines_of(row).flat_map(move |row| places_of(column).map(move |column| (row, column)))
    };
    let sums_of = |square: usize| {
        let samples = plane.slice(s![lines_of(square / across), places_of(square % across)]);
        samples
            .rows()
            .into_iter()
            .flatten()
            .fold(Sums::default(), |sums, &value| sums.with(&Sums { n: 1.0, sum: f64::from(value), most: value }))
    };
    let squares: Vec<Sums> = (0..down * across).into_par_iter().map(sums_of).collect();
    let around = |row: usize, column: usize, sums: &dyn Fn(usize) -> Sums| {
        let lines = row.saturating_sub(1)..(row + 2).min(down);
        let squares = lines.flat_map(|row| {
            (column.saturating_sub(1)..(column + 2).min(across)).map(move |column| row * across + column)
        });
        squares.map(sums).fold(Sums::default(), |all, sums| all.with(&sums))
    };

    // The squares with any, what they have, and how much of that is a lamp.
    let mut found: BTreeMap<usize, Vec<LampSample>> = BTreeMap::new();
    for (square, sums) in squares.iter().enumerate() {
        let (row, column) = (square / across, square % across);
        let least = TIMES_AS_BRIGHT * around(row, column, &|square| squares[square]).mean();
        if f64::from(sums.most) > least && least > 0.0 {
            let samples = samples_of(row, column).filter(|&(row, column)| is_there(row, column));
            let parts = samples.map(|at| (at, (f64::from(plane[at]) / least - 1.0).min(1.0)));
            found.insert(square, parts.filter(|(_, part)| *part > 0.0).collect());
        }
    }
    found.retain(|_, lamps| !lamps.is_empty());
    if found.is_empty() {
        return (plane, vec![]);
    }
    let bright_of = |square: usize| {
        let lamps = found.get(&square).map_or(&[][..], Vec::as_slice);
        let add = |sums: Sums, &(at, part): &LampSample| {
            sums.with(&Sums { n: part, sum: part * f64::from(plane[at]), most: 0.0 })
        };
        lamps.iter().fold(Sums::default(), add)
    };
    let mut lamps: Vec<Lamp> = vec![];
    for (&square, of_square) in &found {
        let (row, column) = (square / across, square % across);
        let (all, bright) = (around(row, column, &|square| squares[square]), around(row, column, &bright_of));
        let level = Sums { n: all.n - bright.n, sum: all.sum - bright.sum, most: 0.0 }.mean().max(0.0) as f32;
        lamps.extend(of_square.iter().map(|&((row, column), part)| Lamp {
            row,
            column,
            radiance: part as f32 * (plane[(row, column)] - level),
        }));
    }
    if lamps.len() > MOST_LAMPS {
        lamps.sort_by(|a, b| b.radiance.total_cmp(&a.radiance).then((a.row, a.column).cmp(&(b.row, b.column))));
        lamps.truncate(MOST_LAMPS);
    }
    lamps.sort_by_key(|lamp| (lamp.row, lamp.column));
    let mut plane = plane.into_owned();
    lamps.iter().for_each(|lamp| plane[(lamp.row, lamp.column)] -= lamp.radiance);
    (Cow::Owned(plane), lamps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(plane: &Array2<f32>) -> (Array2<f32>, Vec<Lamp>) {
        let (calm, lamps) = without_lamps(Cow::Borrowed(plane), &|_, _| true);
        (calm.into_owned(), lamps)
    }

    #[test]
    fn lamps_leave_what_lies_around_them() {
        let mut plane = Array2::from_elem((50, 43), 2.0);
        let lit = [(3, 4), (3, 5), (24, 24), (49, 42)];
        lit.iter().for_each(|&at| plane[at] = 5000.0);
        let (calm, lamps) = split(&plane);
        assert!(calm.iter().all(|value| (value - 2.0).abs() < 1e-3));
        let found: Vec<(usize, usize)> = lamps.iter().map(|lamp| (lamp.row, lamp.column)).collect();
        assert_eq!(found, lit);
        assert!(lamps.iter().all(|lamp| (lamp.radiance - 4998.0).abs() < 1e-2));
    }

    /// A sample that grows becomes a lamp bit by bit.
    #[test]
    fn lamps_begin_without_a_step() {
        let radiance_of = |value: f32| {
            let mut plane = Array2::from_elem((40, 40), 2.0);
            plane[(20, 20)] = value;
            split(&plane).1.first().map_or(0.0, |lamp| lamp.radiance)
        };
        // 8 times the mean of 576 samples is 16.2.
        assert_eq!(radiance_of(16.0), 0.0);
        let mut last = 0.0;
        for value in 0..200 {
            let radiance = radiance_of(16.0 + 0.1 * value as f32);
            assert!(radiance - last <= 0.3, "{value}: {last}, {radiance}");
            last = radiance;
        }
        assert!((last - 33.9).abs() < 1e-3, "{last}");
    }

    #[test]
    fn textures_and_windows_are_no_lamps() {
        let board =
            Array2::from_shape_fn((64, 64), |(row, column)| if (row / 3 + column / 5) % 2 == 0 { 9.0 } else { 0.0 });
        assert_eq!(split(&board), (board.clone(), vec![]));
        let window = Array2::from_shape_fn((64, 64), |at| if at.0 < 20 && at.1 < 20 { 900.0 } else { 1.0 });
        assert_eq!(split(&window), (window.clone(), vec![]));
        let dark = Array2::zeros((9, 9));
        assert_eq!(split(&dark), (dark.clone(), vec![]));
    }

    #[test]
    fn a_star_leaves_darkness() {
        let mut sky = Array2::zeros((30, 30));
        sky[(17, 8)] = 3.0;
        let (calm, lamps) = split(&sky);
        assert_eq!((calm.sum(), lamps), (0.0, vec![Lamp { row: 17, column: 8, radiance: 3.0 }]));
    }
}
