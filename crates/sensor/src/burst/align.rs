//! Where the parts of one frame lie in another, coarse to fine (after Hasinoff et al., "Burst photography for high dynamic
//! range and low-light imaging on mobile cameras", ACM Transactions on Graphics 35, 2016, section 5.1).

use ndarray::Array2;
use rayon::prelude::*;

/// The side of the windows that are compared, and the distance between their first pixels.
const WINDOW: usize = 32;
const STRIDE: usize = 16;
/// Levels of the pyramid, each of half the resolution of the one below, and the least side of one that is halved.
const MOST_LEVELS: usize = 4;
const LEAST_HALVED: usize = 48;
/// How far the coarsest level is searched, pixels: 32 pixels of the finest.
const COARSE_REACH: isize = 4;
/// How far windows are searched about what is known from the level above: 1 at the finest level, 2 before.
const FINE_REACH: isize = 1;
const MIDDLE_REACH: isize = 2;
/// By how much another displacement must be better than the prevailing one, in variances of noise: four standard
/// deviations of the difference of two means of 1024 squared differences.
const CLEARLY_BETTER: f32 = 0.5;

/// A displacement in whole pixels: down, to the right.
type Step = (isize, isize);

/// A picture at several resolutions, the finest first.
pub(super) struct Pyramid(Vec<Array2<f32>>);

impl Pyramid {
    pub(super) fn new(finest: Array2<f32>) -> Self {
        let mut levels = vec![finest];
        while levels.len() < MOST_LEVELS {
            let last = &levels[levels.len() - 1];
            if last.nrows().min(last.ncols()) < LEAST_HALVED {
                break;
            }
            levels.push(halved(last));
        }
        Self(levels)
    }
}

/// Returns the means of two by two pixels.
fn halved(plane: &Array2<f32>) -> Array2<f32> {
    let mut means = Array2::zeros((plane.nrows() / 2, plane.ncols() / 2));
    means.outer_iter_mut().into_par_iter().enumerate().for_each(|(r, mut line)| {
        let (upper, lower) = (plane.row(2 * r), plane.row(2 * r + 1));
        for (c, mean) in line.iter_mut().enumerate() {
            *mean = 0.25 * (upper[2 * c] + upper[2 * c + 1] + lower[2 * c] + lower[2 * c + 1]);
        }
    });
    means
}

/// Where each part of a reference lies in another frame.
pub(super) struct Alignment {
    columns: usize,
    /// Down and to the right, pixels of the finest level, for each window.
    shifts: Vec<[f32; 2]>,
}

impl Alignment {
    /// Returns the displacement of the window whose middle is nearest to a pixel.
    pub(super) fn at(&self, row: usize, column: usize) -> [f32; 2] {
        let (r, c) = window_of(row, column);
        let rows = self.shifts.len() / self.columns;
        self.shifts[r.min(rows - 1) * self.columns + c.min(self.columns - 1)]
    }
}

/// Returns the row and column of the window whose middle is nearest.
fn window_of(row: usize, column: usize) -> (usize, usize) {
    let nearest = |place: usize| (place + STRIDE / 2).saturating_sub(WINDOW / 2) / STRIDE;
    (nearest(row), nearest(column))
}

/// Finds where the parts of a reference lie in another frame; `variance` is that of the noise of both at their finest level.
pub(super) fn align(reference: &Pyramid, frame: &Pyramid, variance: f32) -> Alignment {
    let coarsest = reference.0.len() - 1;
    let mut prevailing: Step = (0, 0);
    let mut field: Option<(usize, Vec<Step>)> = None;
    for level in (0..=coarsest).rev() {
        let pair = Pair { reference: &reference.0[level], frame: &frame.0[level] };
        // What moves the whole frame comes first: noise and even walls do not mislead it.
        let (start, reach) =
            if level == coarsest { ((0, 0), COARSE_REACH) } else { ((2 * prevailing.0, 2 * prevailing.1), 1) };
        prevailing = pair.best_of_all(start, reach);
        // Each window then starts from it and from what the windows about it have found one level up.
        let variance = variance / 4_f32.powi(level as i32);
        let (rows, columns) = pair.windows();
        let steps = (0..rows * columns).into_par_iter().map(|number| {
            let (r, c) = (number / columns, number % columns);
            let mut candidates = vec![prevailing];
            if let Some((coarse_columns, coarse)) = &field {
                let coarse_rows = coarse.len() / coarse_columns;
                for (dr, dc) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let (cr, cc) = ((r / 2 + dr).min(coarse_rows - 1), (c / 2 + dc).min(coarse_columns - 1));
                    let (down, right) = coarse[cr * coarse_columns + cc];
                    candidates.push((2 * down, 2 * right));
                }
            }
            let reach = if level == 0 { FINE_REACH } else { MIDDLE_REACH };
            pair.best_of_window((r * STRIDE, c * STRIDE), &candidates, reach, CLEARLY_BETTER * variance)
        });
        field = Some((columns, steps.collect()));
    }
    let pair = Pair { reference: &reference.0[0], frame: &frame.0[0] };
    let (columns, steps) = field.expect("a pyramid has a level");
    let whole = Bowl::about(|(dr, dc)| pair.of_all((prevailing.0 + dr, prevailing.1 + dc))).lowest([0.0; 2], 0.0);
    let whole = [prevailing.0 as f32 + whole[0], prevailing.1 as f32 + whole[1]];
    let shift = |(number, &step): (usize, &Step)| {
        let corner = (number / columns * STRIDE, number % columns * STRIDE);
        let bowl = Bowl::about(|(dr, dc)| pair.of_window(corner, (step.0 + dr, step.1 + dc)));
        // What a window does not show, as the way along an edge, is that of the whole frame where it is near.
        let from_whole = [whole[0] - step.0 as f32, whole[1] - step.1 as f32];
        let is_near = from_whole.iter().all(|d| d.abs() <= 1.5);
        let fraction = bowl.lowest(if is_near { from_whole } else { [0.0; 2] }, 4.0 * variance);
        [step.0 as f32 + fraction[0], step.1 as f32 + fraction[1]]
    };
    Alignment { columns, shifts: steps.par_iter().enumerate().map(shift).collect() }
}

/// The paraboloid through the errors of a displacement and its eight neighbors.
struct Bowl {
    /// Down, to the right.
    slope: [f32; 2],
    /// Down twice, to the right twice, once each.
    bend: [f32; 3],
}

impl Bowl {
    fn about(error: impl Fn(Step) -> f32) -> Self {
        let middle = error((0, 0));
        let (up, down, left, right) = (error((-1, 0)), error((1, 0)), error((0, -1)), error((0, 1)));
        let twist = error((1, 1)) - error((1, -1)) - error((-1, 1)) + error((-1, -1));
        Self {
            slope: [0.5 * (down - up), 0.5 * (right - left)],
            bend: [up + down - 2.0 * middle, left + right - 2.0 * middle, 0.25 * twist],
        }
    }

    /// Returns the lowest point, at most one pixel away, of the paraboloid and a round bowl of a bend about an expected point.
    fn lowest(&self, expected: [f32; 2], bend: f32) -> [f32; 2] {
        let [down, right, both] = self.bend;
        // (H + b I) d = b d₀ − g.
        let (hrr, hcc) = (down + bend, right + bend);
        let (gr, gc) = (bend * expected[0] - self.slope[0], bend * expected[1] - self.slope[1]);
        let determinant = hrr * hcc - both * both;
        if !(determinant > 1e-6 * hrr * hcc && hrr > 0.0 && hcc > 0.0 && determinant.is_finite()) {
            return expected.map(|d| d.clamp(-1.0, 1.0));
        }
        [(hcc * gr - both * gc) / determinant, (hrr * gc - both * gr) / determinant].map(|d| d.clamp(-1.0, 1.0))
    }

    /// Returns by how much the lowest point within a pixel lies below the middle.
    fn depth(&self) -> f32 {
        let [r, c] = self.lowest([0.0; 2], 0.0);
        let [down, right, both] = self.bend;
        -(self.slope[0] * r + self.slope[1] * c + 0.5 * (down * r * r + right * c * c) + both * r * c).min(0.0)
    }
}

/// Two pictures of one size.
#[derive(Clone, Copy)]
struct Pair<'a> {
    reference: &'a Array2<f32>,
    frame: &'a Array2<f32>,
}

impl Pair<'_> {
    /// Rows and columns of windows, of which the last may hang over the edge.
    fn windows(&self) -> (usize, usize) {
        let count = |n: usize| n.saturating_sub(WINDOW).div_ceil(STRIDE) + 1;
        (count(self.reference.nrows()), count(self.reference.ncols()))
    }

    /// Returns the sum of squared differences of a part of one row, and how many pixels were compared.
    fn of_row(&self, row: usize, (first, last): (usize, usize), (down, right): Step) -> (f32, usize) {
        let (rows, columns) = self.frame.dim();
        let Some(other) = row.checked_add_signed(down).filter(|&r| r < rows) else { return (0.0, 0) };
        let first = first.max((-right).max(0) as usize);
        let last = last.min((columns as isize - right).clamp(0, columns as isize) as usize);
        if first >= last {
            return (0.0, 0);
        }
        let ours = &self.reference.row(row).to_slice().expect("pyramids are contiguous")[first..last];
        let from = first.wrapping_add_signed(right);
        let theirs = &self.frame.row(other).to_slice().expect("pyramids are contiguous")[from..from + ours.len()];
        (ours.iter().zip(theirs).map(|(a, b)| (a - b) * (a - b)).sum(), ours.len())
    }

    /// Returns the mean squared difference of a window; infinity where nothing can be compared.
    fn of_window(&self, (row, column): (usize, usize), step: Step) -> f32 {
        let (rows, columns) = self.reference.dim();
        let range = (column, (column + WINDOW).min(columns));
        mean((row..(row + WINDOW).min(rows)).map(|r| self.of_row(r, range, step)))
    }

    /// Returns the mean squared difference of the whole frames.
    fn of_all(&self, step: Step) -> f32 {
        let (rows, columns) = self.reference.dim();
        let sums: Vec<(f32, usize)> = (0..rows).into_par_iter().map(|r| self.of_row(r, (0, columns), step)).collect();
        mean(sums.into_iter())
    }

    fn best_of_all(&self, (down, right): Step, reach: isize) -> Step {
        let steps = (-reach..=reach).flat_map(|dr| (-reach..=reach).map(move |dc| (down + dr, right + dc)));
        best(steps.map(|step| (self.of_all(step), step))).unwrap_or((down, right))
    }

    /// Returns the best of the candidates and the steps about it, or the first of them where nothing is better than the best
    /// fraction of a pixel about that by the margin.
    fn best_of_window(&self, corner: (usize, usize), candidates: &[Step], reach: isize, margin: f32) -> Step {
        let scored = |step: Step| (self.of_window(corner, step), step);
        let first = candidates[0];
        let rough = best(candidates.iter().map(|&step| scored(step))).unwrap_or(first);
        let about = (-reach..=reach).flat_map(|dr| (-reach..=reach).map(move |dc| (rough.0 + dr, rough.1 + dc)));
        let Some((least, found)) = about.map(scored).min_by(|a, b| a.0.total_cmp(&b.0)) else { return first };
        let error = |(dr, dc): Step| self.of_window(corner, (first.0 + dr, first.1 + dc));
        if least < error((0, 0)) - margin && least < error((0, 0)) - Bowl::about(error).depth() - margin {
            return found;
        }
        first
    }
}

fn mean(sums: impl Iterator<Item = (f32, usize)>) -> f32 {
    let (sum, n) = sums.fold((0.0, 0), |(sum, n), (s, m)| (sum + s, n + m));
    if n > 0 { sum / n as f32 } else { f32::INFINITY }
}

fn best(scored: impl Iterator<Item = (f32, Step)>) -> Option<Step> {
    scored.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, step)| step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Smooth bumps in no order, moved so far down and to the right.
    fn pattern(down: f32, right: f32) -> Array2<f32> {
        // Waves of eight directions and lengths from 14 to 40 pixels.
        let waves: Vec<[f32; 3]> = (0..8_u8)
            .map(|i| {
                let (angle, length_px) = (2.4 * f32::from(i), 14.0 + 3.7 * f32::from(i));
                let frequency = std::f32::consts::TAU / length_px;
                [frequency * angle.sin(), frequency * angle.cos(), 1.7 * f32::from(i)]
            })
            .collect();
        Array2::from_shape_fn((150, 200), |(r, c)| {
            let (y, x) = (r as f32 - down, c as f32 - right);
            waves.iter().map(|[fy, fx, phase]| (fy * y + fx * x + phase).sin()).sum()
        })
    }

    #[test]
    fn displacements_are_found_between_pixels() {
        for (down, right) in [(0.0, 0.0), (3.3, -2.6), (-11.4, 17.2)] {
            let found = align(&Pyramid::new(pattern(0.0, 0.0)), &Pyramid::new(pattern(down, right)), 1e-4);
            for (row, column) in [(40, 40), (75, 100), (110, 160)] {
                let [r, c] = found.at(row, column);
                // Parabolas through squared differences err by a few hundredths of a pixel.
                assert!((r - down).abs() < 0.06 && (c - right).abs() < 0.06, "{down} {right}: {r} {c}");
            }
        }
    }

    #[test]
    fn what_moves_by_itself_is_followed() {
        let (still, moved) = (pattern(0.0, 0.0), pattern(0.0, 4.0));
        let is_inside = |r: usize, c: usize| (48..112).contains(&r) && (64..144).contains(&c);
        let frame =
            Array2::from_shape_fn((150, 200), |(r, c)| if is_inside(r, c) { moved[(r, c)] } else { still[(r, c)] });
        let found = align(&Pyramid::new(still.clone()), &Pyramid::new(frame), 1e-4);
        assert!((found.at(80, 100)[1] - 4.0).abs() < 0.1, "{:?}", found.at(80, 100));
        assert!(found.at(16, 16)[1].abs() < 0.1 && found.at(130, 180)[1].abs() < 0.1);
    }
}
