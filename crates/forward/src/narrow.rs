//! Surfaces narrower than the pupil of the lens: what lies behind them is seen on both of their sides at once.

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;

/// A run of samples along a row or column that began with a step to something nearer.
#[derive(Clone, Copy)]
struct Run {
    first: usize,
    /// Distance of the sample before it.
    before: f32,
    /// The farthest of its samples so far.
    farthest: f32,
}

/// What makes a surface narrow.
#[derive(Clone, Copy)]
pub(crate) struct NarrowRule {
    /// Neighbors that lie farther apart than this are on two surfaces, pixels of blur radius.
    pub(crate) jump: f32,
    /// Samples of the scene a pixel of film.
    pub(crate) scene_per_film: f32,
}

impl NarrowRule {
    /// Takes the next sample of a line; returns the run that it ends, if that is narrow.
    ///
    /// Across the pupil the edge of a surface moves by the sum of the blur radii at its two sides before what lies behind it: a
    /// surface is narrow that is no wider.
    fn step(&self, run: &mut Option<Run>, at: usize, before: f32, here: f32) -> Option<(usize, usize)> {
        if here < before - self.jump {
            *run = Some(Run { first: at, before, farthest: here });
        } else if here > before + self.jump {
            let Run { first, before, farthest } = run.take()?;
            let parallax_px = 2.0 * (before.min(here) - farthest);
            return ((at - first) as f32 <= parallax_px * self.scene_per_film).then_some((first, at));
        } else if let Some(run) = run {
            run.farthest = run.farthest.max(here);
        }
        None
    }

    /// Returns the share of samples on surfaces narrower than the pupil, along rows or columns, before something that lies farther on both
    /// sides; `front` are distances, pixels of blur radius behind the nearest.
    pub(crate) fn fraction(&self, front: &Array2<f32>, cancel: &Cancel) -> Result<f64, Cancelled> {
        let (rows, columns) = front.dim();
        let mut is_narrow = Array2::from_elem((rows, columns), false);
        let mut down: Vec<Option<Run>> = vec![None; columns];
        for row in 0..rows {
            cancel.check()?;
            let mut across = None;
            for column in 0..columns {
                let here = front[(row, column)];
                if column > 0
                    && let Some((first, end)) = self.step(&mut across, column, front[(row, column - 1)], here)
                {
                    (first..end).for_each(|column| is_narrow[(row, column)] = true);
                }
                if row > 0
                    && let Some((first, end)) = self.step(&mut down[column], row, front[(row - 1, column)], here)
                {
                    (first..end).for_each(|row| is_narrow[(row, column)] = true);
                }
            }
        }
        Ok(is_narrow.iter().filter(|is_narrow| **is_narrow).count() as f64 / is_narrow.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall 10 pixels of blur radius behind slats 4 samples wide every 20 and a board 60 wide.
    fn fence(turned: bool) -> Array2<f32> {
        let fence = Array2::from_shape_fn((40, 200), |(row, column)| {
            let is_slat = column < 100 && column % 20 < 4 && column > 4;
            let is_board = (120..180).contains(&column) && row > 4;
            if is_slat || is_board { 1.0 } else { 11.0 }
        });
        if turned { fence.reversed_axes() } else { fence }
    }

    #[test]
    fn slats_are_narrow_and_boards_are_not() {
        let cancel = Cancel::new();
        for turned in [false, true] {
            let fraction = |scene_per_film| {
                NarrowRule { jump: 3.0, scene_per_film }.fraction(&fence(turned), &cancel).expect("not cancelled")
            };
            // The parallax of 20 pixels is 20 samples, or a tenth of that.
            assert_eq!(fraction(1.0), 16.0 / 200.0, "{turned}");
            assert_eq!(fraction(0.1), 0.0);
            // The board reaches one end of the scene: along that way it has one edge.
            assert_eq!(fraction(3.0), 16.0 / 200.0 + 60.0 * 35.0 / 8000.0);
        }
        let rule = NarrowRule { jump: 12.0, scene_per_film: 1.0 };
        assert_eq!(rule.fraction(&fence(false), &cancel), Ok(0.0));
    }
}
