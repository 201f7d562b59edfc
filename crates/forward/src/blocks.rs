//! What blocks of the film's pixels look at: the layers of depth there, and how fine the scene is.

use std::ops::Range;

use dioptric_psf::FilmMap;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    Border, Film,
    places::SceneRaster,
    raster::{BLOCK, Level, Raster},
    surface::LayerCoordinates,
};

/// Samples of the scene beside what a block looks at that are looked at too: lateral color between the bands that are looked up.
const SLACK: f64 = 2.0;

/// The most points of a sample at which the scene is looked up, each way.
const MOST_POINTS: usize = 16;

/// What a block of pixels looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    /// First and last layer; the first is above the last where there is none.
    layers: (u16, u16),
    /// Samples of the scene along a side of a pixel, down and across.
    density: [u8; 2],
}

/// The blocks over a film and what lies around it.
pub(crate) struct Blocks {
    /// The number of the first block, down and across; that of number 0 begins at the film's middle.
    first: (i64, i64),
    blocks: Array2<Block>,
}

impl Blocks {
    /// Looks through a film and so many pixels around it, by the maps of some bands, at the layers that surfaces lie in.
    pub(crate) fn find(
        (film, margin_px): (&Film, usize),
        scene: &SceneRaster,
        maps: &[&FilmMap],
        surfaces: &[&LayerCoordinates],
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let n_blocks = |n: usize| ((n / 2 + 1 + margin_px) as i64).div_euclid(BLOCK) + 1;
        let (down, across) = (n_blocks(film.rows), n_blocks(film.columns));
        let pixels = Raster::new(film, Level::PIXEL);
        let size = (2 * down as usize, 2 * across as usize);
        let row = |row: usize| -> Result<Vec<Block>, Cancelled> {
            cancel.check()?;
            let top = (row as i64 - down) * BLOCK;
            Ok((0..size.1)
                .map(|column| block((top, (column as i64 - across) * BLOCK), &pixels, scene, (maps, surfaces)))
                .collect())
        };
        let blocks: Vec<Vec<Block>> = (0..size.0).into_par_iter().map(row).collect::<Result<_, Cancelled>>()?;
        let blocks = Array2::from_shape_vec(size, blocks.concat()).expect("as many as there are");
        Ok(Self { first: (-down, -across), blocks })
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.blocks.len() * size_of::<Block>()
    }

    /// Whether a layer has anything in a rectangle of the film, given by its sides in pixels from the middle; beyond the blocks nothing is known.
    pub(crate) fn has(&self, layer: usize, down_px: Range<f64>, across_px: Range<f64>) -> bool {
        let blocks =
            |px: Range<f64>| (px.start.floor() as i64).div_euclid(BLOCK)..=(px.end.ceil() as i64).div_euclid(BLOCK);
        blocks(down_px).any(|row| blocks(across_px.clone()).any(|column| self.may_have(layer, (row, column), 0)))
    }

    /// The most samples of the scene along a side of a pixel in such a rectangle.
    pub(crate) fn most_density(&self, down_px: Range<f64>, across_px: Range<f64>) -> usize {
        let blocks =
            |px: Range<f64>| (px.start.floor() as i64).div_euclid(BLOCK)..=(px.end.ceil() as i64).div_euclid(BLOCK);
        let density = |at: (i64, i64)| self.at(at).density.into_iter().max().unwrap_or(1);
        let all = blocks(down_px).flat_map(|row| blocks(across_px.clone()).map(move |column| (row, column)));
        usize::from(all.map(density).max().unwrap_or(1))
    }

    /// Returns the samples of a row of a raster, from one on and up to before an end, that have the same number of points each and may have a part of a layer: the
    /// first such run, empty at the end where there is none, with the number of points down and across.
    pub(crate) fn next_run(
        &self,
        raster: &Raster,
        row: i64,
        columns: Range<i64>,
        layer: usize,
    ) -> (Range<i64>, [usize; 2]) {
        let pixels = raster.level.pixels() as i64;
        // Samples of several pixels lie in several blocks.
        let margin = if pixels > 1 { (pixels + BLOCK - 1) / BLOCK } else { 0 };
        let (block_row, _) = raster.block(0, row);
        let (mut start, mut end, mut points) = (columns.end, columns.end, [1; 2]);
        let mut column = columns.start;
        while column < columns.end {
            let (block, next) = raster.block(1, column);
            let may_have = self.may_have(layer, (block_row, block), margin);
            if !may_have || start == columns.end {
                if start < columns.end {
                    end = column;
                    break;
                }
                if may_have {
                    (start, points) = (column, self.points((block_row, block), raster.level));
                }
            } else if self.points((block_row, block), raster.level) != points {
                end = column;
                break;
            }
            column = next.min(columns.end);
        }
        (start..end, points)
    }

    /// Points of a sample at which the scene is looked up.
    fn points(&self, at: (i64, i64), level: Level) -> [usize; 2] {
        self.at(at).density.map(|density| points_of(usize::from(density), level))
    }

    fn at(&self, (row, column): (i64, i64)) -> Block {
        let clamped = |at: i64, first: i64, n: usize| (at - first).clamp(0, n as i64 - 1) as usize;
        self.blocks
            [(clamped(row, self.first.0, self.blocks.nrows()), clamped(column, self.first.1, self.blocks.ncols()))]
    }

    fn may_have(&self, layer: usize, (row, column): (i64, i64), margin: i64) -> bool {
        let is_in = |row: i64, column: i64| {
            let index = (usize::try_from(row - self.first.0), usize::try_from(column - self.first.1));
            let (Ok(row), Ok(column)) = index else { return true };
            let block = self.blocks.get((row, column));
            block.is_none_or(|Block { layers: (first, last), .. }| {
                (usize::from(*first)..=usize::from(*last)).contains(&layer)
            })
        };
        (row - margin..=row + margin).any(|row| (column - margin..=column + margin).any(|column| is_in(row, column)))
    }
}

/// Returns how many points each way a sample is the mean of, where so many samples of the scene lie along a pixel.
fn points_of(density: usize, level: Level) -> usize {
    (density * level.pixels()).div_ceil(level.per_pixel()).clamp(1, MOST_POINTS)
}

fn block(
    (top, left): (i64, i64),
    pixels: &Raster,
    scene: &SceneRaster,
    (maps, surfaces): (&[&FilmMap], &[&LayerCoordinates]),
) -> Block {
    let nothing = Block { layers: (u16::MAX, 0), density: [1; 2] };
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut density = [0.0_f64; 2];
    for map in maps {
        let looks = |down: f64, across: f64| {
            // Sides of pixels, counted from the middle of the film.
            let place = glam::DVec2::new(
                1e-3 * pixels.pitch_um() * (left as f64 + across * BLOCK as f64),
                -1e-3 * pixels.pitch_um() * (top as f64 + down * BLOCK as f64),
            );
            map.field_tan(place).map(|tan| scene.position_of(tan.x, tan.y))
        };
        // Its corners, the middles of its sides and its own.
        let grid: Vec<Option<[f64; 2]>> =
            (0..9).map(|i| looks(0.5 * f64::from(i / 3), 0.5 * f64::from(i % 3))).collect();
        for [row, column] in grid.iter().flatten().copied() {
            (low, high) = ([low[0].min(row), low[1].min(column)], [high[0].max(row), high[1].max(column)]);
        }
        // The densest half of a side: near the rim of a fisheye's image it changes within a block.
        for (i, (apart, axis)) in (0..9).flat_map(|i| [(i, (3, 0)), (i, (1, 1))]) {
            let is_side = if axis == 0 { i + apart < 9 } else { i % 3 < 2 };
            if let (true, Some(a), Some(b)) = (is_side, grid[i], grid.get(i + apart).copied().flatten()) {
                let length = (b[0] - a[0]).hypot(b[1] - a[1]) / (0.5 * BLOCK as f64);
                density[axis] = density[axis].max(length);
            }
        }
    }
    if !(low[0] <= high[0] && low[1] <= high[1]) {
        return nothing;
    }
    // A quarter finer than the film does no harm.
    let density = density.map(|density| (density - 0.25).ceil().clamp(1.0, 255.0) as u8);
    let range = |low: f64, high: f64, n: usize| {
        let (mut low, mut high) = (low - SLACK, high + SLACK);
        if scene.border == Border::Mirror {
            // What is mirrored at an edge lies as far within.
            let last = (n - 1) as f64;
            (low, high) = match (low < 0.0, high > last) {
                (true, true) => (0.0, last),
                (true, false) => (0.0, high.max(-low)),
                (false, true) => (low.min(2.0 * last - high), last),
                (false, false) => (low, high),
            };
        }
        let clamped = |at: f64| at.clamp(0.0, (n - 1) as f64) as usize;
        clamped(low.floor())..=clamped(high.ceil())
    };
    let (rows, columns) = (range(low[0], high[0], scene.rows), range(low[1], high[1], scene.columns));
    let mut layers = nothing.layers;
    for surface in surfaces {
        for row in rows.clone() {
            let line = &surface.ranges()[row * scene.columns..][columns.clone()];
            layers = line.iter().fold(layers, |(first, last), range| (first.min(range.0), last.max(range.1)));
        }
    }
    Block { layers, density }
}
