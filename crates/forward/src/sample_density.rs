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

/// The samples that a pixel of film takes of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PixelSamples {
    pub(crate) down: usize,
    pub(crate) across: usize,
    /// Whether the pixel sees nothing but what lies beyond the edges of the scene, in any color.
    pub(crate) is_beyond_scene: bool,
}

/// Samples a pixel over blocks of a film's pixels: enough for the scene's own samples where the lens draws them closest together. At the rim
/// of a fisheye's image the film sees many times as many along a radius as at the axis.
pub(crate) struct SampleDensity {
    block_px: usize,
    blocks: (usize, usize),
    /// Of each block, row by row.
    of_blocks: Vec<PixelSamples>,
}

impl SampleDensity {
    /// Finds the samples that each block takes of a scene of some rows and columns, at most `most` each way.
    pub(crate) fn of((view, size): (&View, (usize, usize)), film: &Film, map: &FilmMap, most: usize) -> Self {
        let block_px = film.rows.max(film.columns).div_ceil(MOST_BLOCKS).max(LEAST_BLOCK_PX);
        let blocks = (film.rows.div_ceil(block_px), film.columns.div_ceil(block_px));
        let frame = FilmFrame::new(film, 1);
        let samples_of = |block: usize| {
            let corner = ((block / blocks.1 * block_px) as f64 - 0.5, (block % blocks.1 * block_px) as f64 - 0.5);
            let places = [0.0, 0.5, 1.0].into_iter().flat_map(|down| [0.0, 0.5, 1.0].map(|across| (down, across)));
            let seen: Vec<Option<SeenFromPixel>> = places
                .map(|(down, across)| {
                    let (row, column) = (corner.0 + down * block_px as f64, corner.1 + across * block_px as f64);
                    SeenFromPixel::at(view, map, &frame, row, column)
                })
                .collect();
            let densest = |of: fn(&SeenFromPixel) -> f64| {
                let densest = seen.iter().flatten().map(of).fold(0.0, f64::max);
                // A quarter finer than the film does no harm.
                (densest - 0.25).ceil().clamp(1.0, most as f64) as usize
            };
            PixelSamples {
                down: densest(|seen| seen.samples_down),
                across: densest(|seen| seen.samples_across),
                is_beyond_scene: is_beyond(&seen, size),
            }
        };
        Self { block_px, blocks, of_blocks: (0..blocks.0 * blocks.1).map(samples_of).collect() }
    }

    /// Returns the samples that a pixel takes; beyond the film, as many as at its edge, and there nothing is known to lie beyond the scene.
    fn at(&self, row: i64, column: i64) -> PixelSamples {
        let block = |at: i64, blocks: usize| {
            let block = at.div_euclid(self.block_px as i64);
            (block.clamp(0, blocks as i64 - 1) as usize, (0..blocks as i64).contains(&block))
        };
        let ((down, is_row), (across, is_column)) = (block(row, self.blocks.0), block(column, self.blocks.1));
        let samples = self.of_blocks[down * self.blocks.1 + across];
        PixelSamples { is_beyond_scene: samples.is_beyond_scene && is_row && is_column, ..samples }
    }

    /// Returns the pixels of a row that take the same samples as the first of a range, which are counted from a column, and these.
    pub(crate) fn first_run(&self, row: i64, first_column: i64, range: Range<usize>) -> (Range<usize>, PixelSamples) {
        let samples = self.at(row, first_column + range.start as i64);
        let mut end = range.start;
        while end < range.end && self.at(row, first_column + end as i64) == samples {
            // All pixels of a block are alike.
            let within = (first_column + end as i64).rem_euclid(self.block_px as i64) as usize;
            end += self.block_px - within;
        }
        (range.start..end.min(range.end), samples)
    }
}

/// What of the scene lies around a place of the film.
struct SeenFromPixel {
    /// Row and column of the scene.
    at: DVec2,
    /// How many samples lie along a side of a pixel.
    samples_down: f64,
    samples_across: f64,
}

impl SeenFromPixel {
    /// Returns what is seen at a row and column of the film; `None` where nothing is.
    fn at(view: &View, map: &FilmMap, frame: &FilmFrame, row: f64, column: f64) -> Option<Self> {
        const HALF: f64 = 0.5;
        let tan_at = |row: f64, column: f64| Some(map.at(frame.place_mm(row, column))?.0);
        let (middle, beside, below) = (tan_at(row, column)?, (row, column + HALF), (row + HALF, column));
        // Where nothing is seen on one side, look to the other.
        let step = |to: (f64, f64)| {
            let back = (2.0 * row - to.0, 2.0 * column - to.1);
            tan_at(to.0, to.1).or_else(|| tan_at(back.0, back.1)).map(|tan| (tan - middle).length() / HALF)
        };
        let (across, down) = (step(beside)?, step(below)?);
        let (row, column) = view.position_of(middle.x, middle.y);
        let at = DVec2::new(row, column);
        Some(Self { at, samples_down: view.focal_px * down, samples_across: view.focal_px * across })
    }
}

/// Whether what is seen at places all over a block lies beyond one edge of a scene of some rows and columns, by half of what the block sees and eight samples:
/// more than colors and distortion move it.
fn is_beyond(seen: &[Option<SeenFromPixel>], (rows, columns): (usize, usize)) -> bool {
    const MARGIN: f64 = 8.0;
    if seen.iter().any(Option::is_none) {
        return false;
    }
    let places = || seen.iter().flatten().map(|seen| seen.at);
    let low = places().fold(DVec2::INFINITY, DVec2::min);
    let high = places().fold(DVec2::NEG_INFINITY, DVec2::max);
    let margin = 0.5 * (high - low) + MARGIN;
    (low - margin).cmpgt(DVec2::new(rows as f64, columns as f64)).any() || (high + margin).cmplt(DVec2::ZERO).any()
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
        rectangle::Rectangle,
        sampler::{LayerCoordinates, Sampler},
    };

    /// A scene wider than the film sees.
    const VIEW: View = View { focal_px: 1000.0, center_x_px: 49_999.5, center_y_px: 49_999.5 };
    const SIZE: (usize, usize) = (100_000, 100_000);

    fn square(n: usize, is_beyond_scene: bool) -> PixelSamples {
        PixelSamples { down: n, across: n, is_beyond_scene }
    }

    /// tan θ = r/f · (1 + d r²): its slope along a radius is (1 + 3 d r²)/f.
    fn density_of(distortion_per_mm2: f64, film: &Film) -> SampleDensity {
        let lens = DiscLens { focal_mm: 10.0, distortion_per_mm2, ..DiscLens::default() };
        let map = lens.film_map(0.5, 550.0, 2.0 * film.half_diagonal_mm());
        SampleDensity::of((&VIEW, SIZE), film, &map, 16)
    }

    #[test]
    fn a_lens_without_distortion_takes_as_many_samples_everywhere() {
        let film = Film::centered(100, 150, 24.0);
        // 1000 · 0.024/10 = 2.4 samples a pixel.
        let density = density_of(0.0, &film);
        assert_eq!(density.first_run(60, 30, 0..180), (0..180, square(3, false)));
        assert_eq!([density.at(-40, 3), density.at(99, 149), density.at(400, 400)], [square(3, false); 3]);
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
            let PixelSamples { down, across, .. } = density.at(50, column);
            let n = across as f64;
            assert!(n + 0.25 >= samples.min(16.25) && n <= most.min(16.0), "{column}: {n}, {samples}, {most}");
            // Across the radius it is tan θ / r alone: fewer.
            let fewest = 2.4 * (1.0 + 0.05 * radius_mm * radius_mm);
            assert!(down as f64 + 0.25 >= fewest && (down < across || column < 270), "{column}: {down} {across}");
        }
        assert_eq!(density_of(5.0, &film).at(50, 0).across, 16);
    }

    /// A scene of 400 × 300 samples in the middle of a film of 48 × 36 blocks, each of 16 pixels of 2.4 samples.
    #[test]
    fn blocks_beyond_the_scene_are_known() {
        let film = Film::centered(576, 768, 24.0);
        let (lens, size) = (DiscLens { focal_mm: 10.0, ..DiscLens::default() }, (300, 400));
        let view = View { focal_px: 1000.0, center_x_px: 199.5, center_y_px: 149.5 };
        let map = lens.film_map(0.5, 550.0, 2.0 * film.half_diagonal_mm());
        let density = SampleDensity::of((&view, size), &film, &map, 16);
        for row in (-20..600).step_by(7) {
            for column in (-20..800).step_by(9) {
                let at = (2.4 * (row as f64 - 287.5) + 149.5, 2.4 * (column as f64 - 383.5) + 199.5);
                let is_seen = (-2.0..302.0).contains(&at.0) && (-2.0..402.0).contains(&at.1);
                let is_far = at.0 < -110.0 || at.0 > 410.0 || at.1 < -110.0 || at.1 > 510.0;
                let on_film = (0..576).contains(&row) && (0..768).contains(&column);
                let found = density.at(row, column).is_beyond_scene;
                assert!(!(found && is_seen) && (found || !(is_far && on_film)), "{row} {column}: {found} {at:?}");
                assert!(on_film || !found);
            }
        }
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

    /// A scene of a twelfth of the film's width, nearer above than below: all of the film beyond it is dark, and still covered by one layer or the other.
    #[test]
    fn beyond_the_scene_is_darkness_that_hides() {
        let film = Film::centered(96, 144, 24.0);
        let (lens, size) = (DiscLens { focal_mm: 10.0, ..DiscLens::default() }, (30, 30));
        let view = View { focal_px: 1000.0, center_x_px: 14.5, center_y_px: 14.5 };
        let map = lens.film_map(0.5, 550.0, 2.0 * film.half_diagonal_mm());
        let (cancel, everything) = (Cancel::new(), BlockLayers::of_everything());
        let nearer_above = Array2::from_shape_fn(size, |(row, _)| if row < 15 { 0.0 } else { 1.0 });
        let depths = LayerCoordinates::new(nearer_above, &cancel).unwrap();
        let sampler = Sampler::new((view, size), (&film, 1), &map, 16);
        let rectangle = Rectangle { first_row: 0, first_column: 0, rows: 96, columns: 144 };
        let of = |layer: usize, radiance: Option<&[f32]>| {
            sampler.sample(rectangle, &map, layer, &[depths.surface(radiance)], &everything, &cancel).unwrap()
        };
        let radiance = vec![1.0; size.0 * size.1];
        let at = |picture: &Option<Vec<f32>>, row: usize, column: usize| picture.as_ref().unwrap()[row * 144 + column];
        let (light, covered) = ([0, 1].map(|k| of(k, Some(&radiance))), [0, 1].map(|k| of(k, None)));
        for (row, column) in [(0, 0), (0, 72), (40, 8), (60, 140), (95, 72), (95, 143)] {
            assert_eq!([0, 1].map(|k| at(&light[k], row, column)), [0.0; 2], "{row} {column}");
            let expected = if row < 48 { [1.0, 0.0] } else { [0.0, 1.0] };
            assert_eq!([0, 1].map(|k| at(&covered[k], row, column)), expected, "{row} {column}");
        }
        assert!(at(&light[0], 45, 72) > 0.0 && at(&light[1], 51, 72) > 0.0);
    }
}
