//! What lies behind the edges of near surfaces, guessed from what lies beside them.
//!
//! A picture with one depth a sample does not show what a blurred edge lets through. Near every depth edge the near
//! side gets a second sample, behind the first, filled from the far side alone: coarser and coarser means of the
//! picture are tried until the hole is filled (push–pull), and a mean counts only if it lies behind.

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

/// Where second samples are and how they follow from the first ones, for all bands alike.
pub(crate) struct Fill {
    /// Distance of the second sample, NaN where there is none.
    pub(crate) distances: Array2<f32>,
    pyramid: Pyramid,
    holes: Vec<Hole>,
    terms: Vec<Term>,
}

/// A sample to fill: its index and its first term.
struct Hole {
    sample: u32,
    terms: (u32, u32),
}

/// A part of a fill: a cell of the pyramid and its weight.
#[derive(Clone, Copy)]
struct Term {
    cell: u32,
    weight: f32,
}

/// What counts as an edge. Distances are behind the nearest thing, in pixels of blur radius.
pub(crate) struct EdgeRule<'a> {
    /// Difference of distances between neighbors that is a depth edge.
    pub(crate) jump: f32,
    /// How far, in samples of the scene, beyond an edge between a near and a far distance the bundles of the film go.
    pub(crate) reach: &'a (dyn Fn(f32, f32) -> f32 + Sync),
}

impl Fill {
    /// Finds the near sides of the depth edges of a map of distances, and what lies behind them.
    pub(crate) fn find(distances: &Array2<f32>, rule: &EdgeRule<'_>, cancel: &Cancel) -> Result<Self, Cancelled> {
        let reach = reach_of_edges(distances, rule, cancel)?;
        let pyramid = Pyramid::over(distances, rule.jump, cancel)?;
        let columns = distances.ncols();
        let filled: Vec<(usize, f32, Vec<Term>)> = (0..distances.len())
            .into_par_iter()
            .filter(|&sample| reach[sample] > 0.0)
            .filter_map(|sample| {
                if let Err(cancelled) = cancel.check() {
                    return Some(Err(cancelled));
                }
                let (row, column) = (sample / columns, sample % columns);
                let (distance, terms) = pyramid.behind(row, column, distances[(row, column)] + 0.5 * rule.jump)?;
                Some(Ok((sample, distance, terms)))
            })
            .collect::<Result<_, Cancelled>>()?;
        let mut fill =
            Self { distances: Array2::from_elem(distances.dim(), f32::NAN), pyramid, holes: vec![], terms: vec![] };
        for (sample, distance, terms) in filled {
            fill.distances[(sample / columns, sample % columns)] = distance;
            let first = fill.terms.len() as u32;
            fill.terms.extend(terms);
            fill.holes.push(Hole { sample: sample as u32, terms: (first, fill.terms.len() as u32) });
        }
        Ok(fill)
    }

    /// The bytes of memory of the fill.
    pub(crate) fn size_bytes(&self) -> usize {
        self.distances.len() * size_of::<f32>()
            + size_of_val(self.holes.as_slice())
            + size_of_val(self.terms.as_slice())
            + self.pyramid.size_bytes()
    }

    /// Whether there is no second sample at all.
    pub(crate) fn is_empty(&self) -> bool {
        self.holes.is_empty()
    }

    /// Returns the second samples of a band, 0 where there is none.
    pub(crate) fn samples(&self, plane: &Array2<f32>, cancel: &Cancel) -> Result<Array2<f32>, Cancelled> {
        let means = self.pyramid.means_of(plane, cancel)?;
        let mut filled = Array2::zeros(plane.dim());
        let columns = plane.ncols();
        for (index, hole) in self.holes.iter().enumerate() {
            check_every(1 << 12, index, cancel)?;
            let terms = &self.terms[hole.terms.0 as usize..hole.terms.1 as usize];
            let value = terms.iter().map(|term| term.weight * means[term.cell as usize]).sum();
            filled[(hole.sample as usize / columns, hole.sample as usize % columns)] = value;
        }
        Ok(filled)
    }
}

/// Checks for cancelling once in `n` items.
fn check_every(n: usize, index: usize, cancel: &Cancel) -> Result<(), Cancelled> {
    if index.is_multiple_of(n) { cancel.check() } else { Ok(()) }
}

/// Returns, for each sample, how far an edge's blur still reaches beyond it into the near surface; 0 where none does.
pub(crate) fn reach_of_edges(
    distances: &Array2<f32>,
    rule: &EdgeRule<'_>,
    cancel: &Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let (rows, columns) = distances.dim();
    let mut reach = vec![0.0_f32; rows * columns];
    // Soft edges drop over a few samples, so neighbors up to three samples away are compared.
    const OFFSETS: [(isize, isize); 12] =
        [(0, 1), (0, -1), (1, 0), (-1, 0), (0, 2), (0, -2), (2, 0), (-2, 0), (0, 3), (0, -3), (3, 0), (-3, 0)];
    let inside =
        |row: isize, column: isize| (0..rows as isize).contains(&row) && (0..columns as isize).contains(&column);
    reach.par_chunks_mut(columns.max(1)).enumerate().try_for_each(|(row, line)| {
        cancel.check()?;
        for (column, reach) in line.iter_mut().enumerate() {
            let distance = distances[(row, column)];
            for (down, right) in OFFSETS {
                let (r, c) = (row as isize + down, column as isize + right);
                if inside(r, c) {
                    let other = distances[(r as usize, c as usize)];
                    if other - distance > rule.jump {
                        *reach = reach.max((rule.reach)(distance, other) + 2.0);
                    }
                }
            }
        }
        Ok(())
    })?;
    let samples = distances.as_standard_layout();
    let Some(samples) = samples.as_slice() else { return Ok(reach) };
    spread_over(samples, &mut reach, columns, rule.jump, cancel)?;
    // Turned by half a turn the second sweep is the first.
    reach.reverse();
    let turned: Vec<f32> = samples.iter().rev().copied().collect();
    spread_over(&turned, &mut reach, columns, rule.jump, cancel)?;
    reach.reverse();
    Ok(reach)
}

/// Spreads a reach over the near surface, down to 0, a sample a step, from above and the left; farther surfaces stop it.
fn spread_over(
    distances: &[f32],
    reach: &mut [f32],
    columns: usize,
    jump: f32,
    cancel: &Cancel,
) -> Result<(), Cancelled> {
    let diagonal = std::f32::consts::SQRT_2;
    let mut above: Option<(&[f32], &mut [f32])> = None;
    for (line, reach) in distances.chunks_exact(columns).zip(reach.chunks_exact_mut(columns)) {
        cancel.check()?;
        if let Some((line_above, reach_above)) = &above {
            for column in 0..columns {
                let mut take = |from: usize, cost: f32| {
                    if line[column] - line_above[from] <= jump {
                        reach[column] = reach[column].max(reach_above[from] - cost);
                    }
                };
                take(column, 1.0);
                if column > 0 {
                    take(column - 1, diagonal);
                }
                if column + 1 < columns {
                    take(column + 1, diagonal);
                }
            }
        }
        for column in 1..columns {
            if line[column] - line[column - 1] <= jump {
                reach[column] = reach[column].max(reach[column - 1] - 1.0);
            }
        }
        above = Some((line, reach));
    }
    Ok(())
}

/// Means over cells of 1, 2, 4 … samples, each over the farthest surface in the cell only.
struct Pyramid {
    levels: Vec<Level>,
    // Of each cell of the levels above the first: which of its four children take part.
    children: Vec<[bool; 4]>,
}

struct Level {
    first_cell: usize,
    rows: usize,
    columns: usize,
    distances: Vec<f32>,
    // Share of the cell's area that the mean stands for.
    shares: Vec<f32>,
}

impl Pyramid {
    fn over(distances: &Array2<f32>, jump: f32, cancel: &Cancel) -> Result<Self, Cancelled> {
        let (rows, columns) = distances.dim();
        let mut levels = vec![Level {
            first_cell: 0,
            rows,
            columns,
            distances: distances.iter().copied().collect(),
            shares: vec![1.0; rows * columns],
        }];
        let mut children = vec![];
        while levels[levels.len() - 1].rows.max(levels[levels.len() - 1].columns) > 1 {
            let (level, members) = levels[levels.len() - 1].halved(jump, cancel)?;
            levels.push(level);
            children.extend(members);
        }
        Ok(Self { levels, children })
    }

    fn size_bytes(&self) -> usize {
        let cells: usize = self.levels.iter().map(|level| level.distances.len()).sum();
        2 * cells * size_of::<f32>() + size_of_val(self.children.as_slice())
    }

    /// Returns the distance and the terms of what lies behind `limit` around a sample, or `None` if nothing does.
    fn behind(&self, row: usize, column: usize, limit: f32) -> Option<(f32, Vec<Term>)> {
        let mut terms = vec![];
        let (mut distance, mut left) = (0.0, 1.0);
        for (index, level) in self.levels.iter().enumerate().skip(1) {
            let scale = 1.0 / (1_u32 << index) as f32;
            let (y, x) = ((row as f32 + 0.5) * scale - 0.5, (column as f32 + 0.5) * scale - 0.5);
            let (top, start) = (y.floor(), x.floor());
            let mut weights = [(0_usize, 0.0_f32); 4];
            for (corner, weight) in weights.iter_mut().enumerate() {
                let (down, right) = ((corner / 2) as f32, (corner % 2) as f32);
                let bilinear = (1.0 - (y - top - down).abs()) * (1.0 - (x - start - right).abs());
                let clamp = |v: f32, n: usize| v.clamp(0.0, (n - 1) as f32) as usize;
                let cell = clamp(top + down, level.rows) * level.columns + clamp(start + right, level.columns);
                let lies_behind = level.distances[cell] > limit;
                *weight = (cell, if lies_behind { bilinear * level.shares[cell] } else { 0.0 });
            }
            let sum: f32 = weights.iter().map(|w| w.1).sum();
            // A quarter of the surroundings is enough to go by: farther ones are worse guesses.
            let take = left * (4.0 * sum).min(1.0);
            if take > 0.0 {
                for (cell, weight) in weights.into_iter().filter(|w| w.1 > 0.0) {
                    let weight = take * weight / sum;
                    distance += weight * level.distances[cell];
                    terms.push(Term { cell: (level.first_cell + cell) as u32, weight });
                }
            }
            left -= take;
            if left < 1e-3 {
                break;
            }
        }
        if left > 0.999 {
            return None;
        }
        let scale = 1.0 / (1.0 - left);
        terms.iter_mut().for_each(|term| term.weight *= scale);
        Some((distance * scale, terms))
    }

    /// Returns the means of a band over every cell of every level.
    fn means_of(&self, plane: &Array2<f32>, cancel: &Cancel) -> Result<Vec<f32>, Cancelled> {
        let mut means: Vec<f32> = plane.iter().copied().collect();
        let n_first = means.len();
        for pair in self.levels.windows(2) {
            let (fine, coarse) = (&pair[0], &pair[1]);
            for cell in 0..coarse.rows * coarse.columns {
                check_every(1 << 12, cell, cancel)?;
                let members = self.children[coarse.first_cell - n_first + cell];
                let (mut sum, mut weight) = (0.0, 0.0);
                for (child, _) in fine.children_of(cell, coarse.columns, members) {
                    sum += fine.shares[child] * means[fine.first_cell + child];
                    weight += fine.shares[child];
                }
                means.push(sum / weight);
            }
        }
        Ok(means)
    }
}

impl Level {
    /// Returns the level of half as many cells each way, and which children each of its cells is the mean of.
    fn halved(&self, jump: f32, cancel: &Cancel) -> Result<(Self, Vec<[bool; 4]>), Cancelled> {
        let (rows, columns) = (self.rows.div_ceil(2), self.columns.div_ceil(2));
        let halved: Vec<(f32, f32, [bool; 4])> = (0..rows * columns)
            .into_par_iter()
            .with_min_len(1 << 12)
            .map(|cell| {
                check_every(1 << 12, cell, cancel)?;
                let all = || self.children_of(cell, columns, [true; 4]);
                let farthest = all().map(|(child, _)| self.distances[child]).fold(f32::NEG_INFINITY, f32::max);
                let mut member = [false; 4];
                let (mut distance, mut share, mut n) = (0.0, 0.0, 0.0);
                for (child, which) in all() {
                    n += 1.0;
                    if self.distances[child] > farthest - jump {
                        member[which] = true;
                        distance += self.shares[child] * self.distances[child];
                        share += self.shares[child];
                    }
                }
                Ok((distance / share, share / n, member))
            })
            .collect::<Result<_, Cancelled>>()?;
        let distances = halved.iter().map(|(distance, ..)| *distance).collect();
        let shares = halved.iter().map(|(_, share, _)| *share).collect();
        let members = halved.into_iter().map(|(.., member)| member).collect();
        let first_cell = self.first_cell + self.rows * self.columns;
        Ok((Self { first_cell, rows, columns, distances, shares }, members))
    }

    /// Returns the cells of this level that lie in a cell of the next, of those that `members` names.
    fn children_of(&self, cell: usize, columns: usize, members: [bool; 4]) -> impl Iterator<Item = (usize, usize)> {
        let (top, left) = (2 * (cell / columns), 2 * (cell % columns));
        (0..4).filter(move |&which| members[which]).filter_map(move |which| {
            let (row, column) = (top + which / 2, left + which % 2);
            (row < self.rows && column < self.columns).then_some((row * self.columns + column, which))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(jump: f32) -> EdgeRule<'static> {
        EdgeRule { jump, reach: &|_, _| 6.0 }
    }

    #[test]
    fn a_continuous_surface_hides_nothing() {
        let slope = Array2::from_shape_fn((40, 60), |(_, column)| 0.2 * column as f32);
        assert!(Fill::find(&slope, &rule(1.5), &Cancel::new()).unwrap().is_empty());
    }

    #[test]
    fn edge_is_filled_from_the_far_side_alone() {
        let is_near = |row: usize, column: usize| row.abs_diff(30) < 12 && column.abs_diff(30) < 12;
        let distances = Array2::from_shape_fn((60, 60), |(r, c)| if is_near(r, c) { 1.0 } else { 8.0 });
        let plane = distances.mapv(|distance| if distance < 2.0 { 100.0 } else { 3.0 });
        let fill = Fill::find(&distances, &rule(1.5), &Cancel::new()).unwrap();
        let samples = fill.samples(&plane, &Cancel::new()).unwrap();
        for ((row, column), &distance) in fill.distances.indexed_iter() {
            let inset = 12_usize.saturating_sub(row.abs_diff(30).max(column.abs_diff(30)));
            if is_near(row, column) && inset <= 6 {
                assert!((distance - 8.0).abs() < 1e-4, "at {row}, {column}: {distance}");
                assert!((samples[(row, column)] - 3.0).abs() < 1e-4, "at {row}, {column}");
            }
            if !is_near(row, column) || inset > 10 {
                assert!(distance.is_nan(), "at {row}, {column}");
            }
        }
    }

    #[test]
    fn middle_surface_fills_behind_the_near_one_and_the_far_one_behind_the_middle() {
        let distances = Array2::from_shape_fn((32, 96), |(_, column)| [1.0, 5.0, 9.0][column / 32]);
        let fill = Fill::find(&distances, &rule(1.5), &Cancel::new()).unwrap();
        assert!((fill.distances[(16, 30)] - 5.0).abs() < 0.1);
        assert!((fill.distances[(16, 62)] - 9.0).abs() < 0.1);
        assert!(fill.distances[(16, 33)].is_nan() && fill.distances[(16, 66)].is_nan());
    }
}
