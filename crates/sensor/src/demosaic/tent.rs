//! Methods for any mosaic: the nearest pixel of a color, or neighbors weighted by a tent.

use ndarray::Array2;
use rayon::prelude::*;

use crate::Tile;

/// For each phase of the tile and each channel, the neighbors that count: row and column steps, and weight.
type Neighborhoods = Vec<Vec<Vec<(isize, isize, f32)>>>;

/// Returns the neighborhoods that a rule makes of the pixels of one channel within a tile of each phase; the rule
/// receives whether the pixel in the middle is one of them.
fn neighborhoods(
    tile: &Tile,
    n_channels: usize,
    rule: impl Fn(Vec<(isize, isize)>, bool) -> Vec<(isize, isize, f32)>,
) -> Neighborhoods {
    let (rows, columns) = (tile.rows() as isize, tile.columns() as isize);
    let phase = |number: usize| {
        let (row, column) = ((number / tile.columns()) as isize, (number % tile.columns()) as isize);
        let filter_at = |dr: isize, dc: isize| {
            tile.filter_at((row + dr).rem_euclid(rows) as usize, (column + dc).rem_euclid(columns) as usize)
        };
        let of_channel = |channel: usize| {
            let steps = (1 - rows..rows).flat_map(|dr| (1 - columns..columns).map(move |dc| (dr, dc)));
            let same = steps.filter(|&(dr, dc)| filter_at(dr, dc) == channel).collect();
            rule(same, filter_at(0, 0) == channel)
        };
        (0..n_channels).map(of_channel).collect()
    };
    (0..tile.rows() * tile.columns()).map(phase).collect()
}

/// What is made of a pixel's neighbors.
#[derive(Clone, Copy, PartialEq)]
enum Take {
    /// Their weighted mean.
    Mean,
    /// The first of them.
    First,
}

/// Returns planes in which each pixel is taken from its neighbors inside the frame.
fn gather(values: &Array2<f32>, tile: &Tile, neighborhoods: &Neighborhoods, take: Take) -> Vec<Array2<f32>> {
    let (n_rows, n_columns) = values.dim();
    let n_channels = neighborhoods[0].len();
    let values = values.as_standard_layout();
    let samples = values.as_slice().expect("a standard layout is contiguous");
    let channel = |channel: usize| {
        let mut plane = Array2::<f32>::zeros((n_rows, n_columns));
        let rows = plane.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(n_columns);
        rows.enumerate().for_each(|(row, out)| {
            let phases = (row % tile.rows()) * tile.columns();
            for (column, out) in out.iter_mut().enumerate() {
                let (mut sum, mut weights) = (0.0, 0.0);
                for &(dr, dc, weight) in &neighborhoods[phases + column % tile.columns()][channel] {
                    let (r, c) = (row.wrapping_add_signed(dr), column.wrapping_add_signed(dc));
                    if r < n_rows && c < n_columns {
                        sum += weight * samples[r * n_columns + c];
                        weights += weight;
                        if take == Take::First {
                            break;
                        }
                    }
                }
                *out = if weights > 0.0 { sum / weights } else { 0.0 };
            }
        });
        plane
    };
    (0..n_channels).map(channel).collect()
}

/// Returns each color from its nearest pixel; of equally near ones, the first in reading order inside the frame.
pub(super) fn nearest(values: &Array2<f32>, tile: &Tile, n_channels: usize) -> Vec<Array2<f32>> {
    let rule = |mut same: Vec<(isize, isize)>, _| {
        same.sort_by_key(|&(dr, dc)| (dr * dr + dc * dc, dr, dc));
        same.into_iter().map(|(dr, dc)| (dr, dc, 1.0)).collect()
    };
    gather(values, tile, &neighborhoods(tile, n_channels, rule), Take::First)
}

/// Returns each color as the mean of its pixels under a tent; a pixel keeps its own color as it is.
pub(super) fn bilinear(values: &Array2<f32>, tile: &Tile, n_channels: usize) -> Vec<Array2<f32>> {
    let rule = |same, own| if own { vec![(0, 0, 1.0)] } else { under_tent(tile, same) };
    gather(values, tile, &neighborhoods(tile, n_channels, rule), Take::Mean)
}

/// Returns each color as its mean under a tent, times what the pixel's own color shows of finer detail.
///
/// The detail is the pixel's value over the tent's mean of its own color. Where colors go up and down together, as
/// they mostly do, this sharpens them all.
pub(super) fn with_detail(values: &Array2<f32>, tile: &Tile, n_channels: usize) -> Vec<Array2<f32>> {
    let rule = |same, _| under_tent(tile, same);
    let mut planes = gather(values, tile, &neighborhoods(tile, n_channels, rule), Take::Mean);
    let (n_rows, n_columns) = values.dim();
    for row in 0..n_rows {
        for column in 0..n_columns {
            let own = tile.filter_at(row, column);
            let (value, mean) = (values[(row, column)], planes[own][(row, column)]);
            // Noise about black must not be blown up: the ratio stays between a half and two.
            let detail = if mean > 0.0 { (value / mean).clamp(0.5, 2.0) } else { 1.0 };
            planes.iter_mut().for_each(|plane| plane[(row, column)] *= detail);
            planes[own][(row, column)] = value;
        }
    }
    planes
}

fn under_tent(tile: &Tile, same: Vec<(isize, isize)>) -> Vec<(isize, isize, f32)> {
    let side = |step: isize, period: usize| (period as isize - step.abs()) as f32;
    same.into_iter().map(|(dr, dc)| (dr, dc, side(dr, tile.rows()) * side(dc, tile.columns()))).collect()
}
