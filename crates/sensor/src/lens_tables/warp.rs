//! Channels taken from other places of the frame.

use ndarray::Array2;
use rayon::prelude::*;

use super::{
    Displacement,
    frame_table::{Stencil, keys, stencils},
};
use crate::plane_rows::plane_rows;

/// Places so far beyond the frame, pixels, still take the samples at its border; what is farther out is black.
const BORDER_PX: f64 = 4.0;

/// Returns channels whose samples are taken from the frame at displaced places, by Keys's cubic convolution held to the range of
/// the samples that it mixes; 0 in all channels where one of them lies beyond the frame.
pub(crate) fn warp(channels: &[Array2<f32>], sources: &[Displacement]) -> Vec<Array2<f32>> {
    let (rows, columns) = channels[0].dim();
    let mut warped: Vec<Array2<f32>> = channels.iter().map(|_| Array2::zeros((rows, columns))).collect();
    let lines = plane_rows(&mut warped);
    let along = stencils(columns, sources[0][0].nodes().1);
    lines.into_par_iter().enumerate().for_each(|(row, mut out)| warp_row(row, channels, sources, &along, &mut out));
    warped
}

fn warp_row(
    row: usize,
    channels: &[Array2<f32>],
    sources: &[Displacement],
    stencils: &[Stencil],
    out: &mut [&mut [f32]],
) {
    let (rows, columns) = channels[0].dim();
    let down = (row as f64 + 0.5) / rows as f64;
    let lines: Vec<_> = sources.iter().map(|source| source.each_ref().map(|table| table.line(down))).collect();
    let mut places = vec![[0.0_f64; 2]; channels.len()];
    for (column, at) in stencils.iter().enumerate() {
        let mut is_within = true;
        for (place, [across, along]) in places.iter_mut().zip(&lines) {
            *place = [column as f64 + across.with_stencil(at), row as f64 + along.with_stencil(at)];
            is_within &= is_on(place[0], columns) && is_on(place[1], rows);
        }
        if is_within {
            for ((out, plane), &[x, y]) in out.iter_mut().zip(channels).zip(&places) {
                out[column] = sample(plane, x, y);
            }
        }
    }
}

fn is_on(place: f64, n: usize) -> bool {
    place >= -BORDER_PX && place <= (n - 1) as f64 + BORDER_PX
}

/// Returns the value at a place of a plane: columns and rows of pixels from the middle of the first.
#[inline]
pub(crate) fn sample(plane: &Array2<f32>, x: f64, y: f64) -> f32 {
    let (rows, columns) = plane.dim();
    let values = plane.as_slice().expect("demosaiced planes are contiguous");
    let (left, top) = (x.floor(), y.floor());
    let (across, along) = (keys(x - left).map(|w| w as f32), keys(y - top).map(|w| w as f32));
    let (first_column, first_row) = (left as isize - 1, top as isize - 1);
    let (mut sum, mut low, mut high) = (0.0_f32, f32::INFINITY, f32::NEG_INFINITY);
    let mut add = |[a, b, c, d]: [f32; 4], weight: f32| {
        sum += weight * (a * across[0] + b * across[1] + c * across[2] + d * across[3]);
        low = low.min(a.min(b).min(c.min(d)));
        high = high.max(a.max(b).max(c.max(d)));
    };
    let is_inside =
        first_column >= 0 && first_row >= 0 && first_column + 4 <= columns as isize && first_row + 4 <= rows as isize;
    if is_inside {
        let mut start = first_row as usize * columns + first_column as usize;
        for weight in along {
            let four = &values[start..start + 4];
            add([four[0], four[1], four[2], four[3]], weight);
            start += columns;
        }
    } else {
        let held = |i: isize, n: usize| i.clamp(0, n as isize - 1) as usize;
        for (k, weight) in (0_isize..).zip(along) {
            let line = held(first_row + k, rows) * columns;
            add([0, 1, 2, 3].map(|i| values[line + held(first_column + i, columns)]), weight);
        }
    }
    sum.clamp(low, high)
}
