//! How many samples each pixel of a film takes of a scene that is finer than the film, in some places or everywhere.

use std::ops::Range;

use dioptric_psf::FilmMap;
use dioptric_scene::View;
use glam::DVec2;

use crate::{Film, geometry::FilmFrame};

/// Blocks along a film's longer side, at most.
const MOST_BLOCKS: usize = 64;

/// The least pixels along a side of a block.
const LEAST_BLOCK_PX: usize = 16;

/// Samples a pixel, each way, over blocks of a film's pixels: enough for the scene's own samples where the lens draws them closest
/// together. At the rim of a fisheye's image the film sees many times as many as at the axis.
pub(crate) struct SampleDensity {
    block_px: usize,
    blocks: (usize, usize),
    /// Of each block, row by row.
    per_pixel: Vec<usize>,
}

impl SampleDensity {
    /// Finds the samples that each block takes, at most `most`.
    pub(crate) fn of(view: &View, film: &Film, map: &FilmMap, most: usize) -> Self {
        let block_px = film.rows.max(film.columns).div_ceil(MOST_BLOCKS).max(LEAST_BLOCK_PX);
        let blocks = (film.rows.div_ceil(block_px), film.columns.div_ceil(block_px));
        let frame = FilmFrame::new(film, 1);
        let samples_of = |block: usize| {
            let corner = ((block / blocks.1 * block_px) as f64 - 0.5, (block % blocks.1 * block_px) as f64 - 0.5);
            let densest = [0.0, 0.5, 1.0].into_iter().flat_map(|down| [0.0, 0.5, 1.0].map(|across| (down, across)));
            let densest = densest
                .filter_map(|(down, across)| {
                    let (row, column) = (corner.0 + down * block_px as f64, corner.1 + across * block_px as f64);
                    samples_per_px(view, map, &frame, row, column)
                })
                .fold(0.0, f64::max);
            // A quarter finer than the film does no harm.
            (densest - 0.25).ceil().clamp(1.0, most as f64) as usize
        };
        Self { block_px, blocks, per_pixel: (0..blocks.0 * blocks.1).map(samples_of).collect() }
    }

    /// Returns the samples a pixel takes each way; beyond the film, as at its edge.
    fn at(&self, row: i64, column: i64) -> usize {
        let block = |at: i64, blocks: usize| (at.max(0) as usize / self.block_px).min(blocks - 1);
        self.per_pixel[block(row, self.blocks.0) * self.blocks.1 + block(column, self.blocks.1)]
    }

    /// Returns the pixels of a row that take as many samples as the first of a range, which are counted from a column, and that
    /// number.
    pub(crate) fn first_run(&self, row: i64, first_column: i64, range: Range<usize>) -> (Range<usize>, usize) {
        let per_pixel = self.at(row, first_column + range.start as i64);
        let mut end = range.start;
        while end < range.end && self.at(row, first_column + end as i64) == per_pixel {
            // All pixels of a block are alike.
            let within = (first_column + end as i64).rem_euclid(self.block_px as i64) as usize;
            end += self.block_px - within;
        }
        (range.start..end.min(range.end), per_pixel)
    }
}

/// Returns how many samples of the scene a pixel of film sees each way, in the direction where these are most; `None` where nothing is
/// seen.
fn samples_per_px(view: &View, map: &FilmMap, frame: &FilmFrame, row: f64, column: f64) -> Option<f64> {
    const HALF: f64 = 0.5;
    let tan_at = |row: f64, column: f64| Some(map.at(frame.place_mm(row, column))?.0);
    let (middle, beside, below) = (tan_at(row, column)?, (row, column + HALF), (row + HALF, column));
    // Where nothing is seen on one side, look to the other.
    let step = |to: (f64, f64)| {
        let back = (2.0 * row - to.0, 2.0 * column - to.1);
        tan_at(to.0, to.1).or_else(|| tan_at(back.0, back.1)).map(|tan| (tan - middle) / HALF)
    };
    let (across, down) = (step(beside)?, step(below)?);
    let gradient = |pick: fn(DVec2) -> f64| pick(across).hypot(pick(down));
    Some(view.focal_px * gradient(|tan| tan.x).max(gradient(|tan| tan.y)))
}

#[cfg(test)]
mod tests {
    use dioptric_psf::LensImage;
    use dioptric_spectrum::Cancel;
    use ndarray::Array2;

    use super::*;
    use crate::{
        DiscLens,
        block_layers::BlockLayers,
        sampler::{LayerCoordinates, Rectangle, Sampler},
    };

    const VIEW: View = View { focal_px: 1000.0, center_x_px: 0.0, center_y_px: 0.0 };

    /// tan θ = r/f · (1 + d r²): its slope along a radius is (1 + 3 d r²)/f.
    fn density_of(distortion_per_mm2: f64, film: &Film) -> SampleDensity {
        let lens = DiscLens { focal_mm: 10.0, distortion_per_mm2, ..DiscLens::default() };
        SampleDensity::of(&VIEW, film, &lens.film_map(0.5, 550.0, 2.0 * film.half_diagonal_mm()), 16)
    }

    #[test]
    fn a_lens_without_distortion_takes_as_many_samples_everywhere() {
        let film = Film::centered(100, 150, 24.0);
        // 1000 · 0.024/10 = 2.4 samples a pixel.
        let density = density_of(0.0, &film);
        assert_eq!(density.first_run(7, -30, 0..210), (0..210, 3));
        assert_eq!((density.at(-40, 3), density.at(99, 149), density.at(400, 400)), (3, 3, 3));
    }

    #[test]
    fn a_pixel_takes_more_where_the_scene_lies_closer() {
        let film = Film::centered(101, 401, 24.0);
        let density = density_of(0.05, &film);
        for column in [200, 260, 330, 400] {
            let radius_mm = 0.024 * (column - 200) as f64;
            let samples = 2.4 * (1.0 + 3.0 * 0.05 * radius_mm * radius_mm);
            // As many as the outer side of its block needs, which is up to 16 pixels farther out.
            let outer_mm = radius_mm + 0.024 * 17.0;
            let most = 2.4 * (1.0 + 3.0 * 0.05 * (outer_mm * outer_mm + 0.3)).ceil();
            let n = density.at(50, column) as f64;
            assert!(n + 0.25 >= samples.min(16.25) && n <= most.min(16.0), "{column}: {n}, {samples}, {most}");
        }
        assert_eq!(density_of(5.0, &film).at(50, 0), 16);
    }

    #[test]
    fn runs_of_a_row_join_and_take_what_their_pixels_take() {
        let film = Film::centered(101, 401, 24.0);
        let density = density_of(0.05, &film);
        let (mut start, mut n_runs) = (0, 0);
        while start < 440 {
            let (run, n) = density.first_run(30, -20, start..440);
            assert!(run.start == start && run.end > start);
            assert!(run.clone().all(|column| density.at(30, column as i64 - 20) == n), "{run:?}");
            (start, n_runs) = (run.end, n_runs + 1);
        }
        assert_eq!(start, 440);
        assert!((10..30).contains(&n_runs), "{n_runs}");
    }

    /// Bars three samples wide, which pixels at the middle of the film resolve and those at its ends, which see some ten samples each
    /// way, hold many of: their mean is there, to the share of a bar that a pixel cuts.
    #[test]
    fn what_a_pixel_cannot_resolve_is_averaged() {
        let film = Film::centered(9, 401, 6.0);
        let lens = DiscLens { focal_mm: 10.0, distortion_per_mm2: 4.0, ..DiscLens::default() };
        let map = lens.film_map(0.5, 550.0, 2.0 * film.half_diagonal_mm());
        let size = (21, 1901);
        let view = View { focal_px: 1000.0, center_x_px: 950.0, center_y_px: 10.0 };
        let bars: Vec<f32> = (0..size.0 * size.1).map(|at| if at % size.1 / 3 % 2 == 0 { 1.0 } else { 0.0 }).collect();
        let (cancel, everything) = (Cancel::new(), BlockLayers::of_everything());
        let depths = LayerCoordinates::new(Array2::zeros(size), &cancel).unwrap();
        let sampler = Sampler::new((view, size), (&film, 1), &map, 16);
        let rectangle = Rectangle { first_row: 4, first_column: 0, rows: 1, columns: 401 };
        let line =
            sampler.sample(rectangle, &map, 0, &[depths.surface(Some(&bars))], &everything, &cancel).unwrap().unwrap();
        let spread =
            |columns: std::ops::Range<usize>| line[columns].iter().map(|light| (light - 0.5).abs()).fold(0.0, f32::max);
        assert!(spread(190..210) > 0.4, "{}", spread(190..210));
        // A pixel of 8 samples holds one and a third periods.
        assert!(spread(5..30) < 0.2 && spread(371..396) < 0.2, "{} {}", spread(5..30), spread(371..396));
    }
}
