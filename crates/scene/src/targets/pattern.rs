//! Where a target is light and where it is dark.

use std::f64::consts::PI;

use ndarray::Array2;

use super::{Pattern, Target};

/// The patches seen in one sample, with the share of each; what is missing to 1 is the black frame.
pub(super) type PatchShares = Vec<(u8, f64)>;

/// Share of a cell of the chart that its frame takes, on each side.
const FRAME: f64 = 0.07;

/// Returns the share of each sample that is light.
pub(super) fn light_share(target: &Target) -> Array2<f64> {
    match target.pattern {
        Pattern::RadialLines { n_lines } => radial_lines(target.rows, target.columns, n_lines),
        Pattern::PointArray { spacing_px } => Array2::from_shape_fn((target.rows, target.columns), |(row, column)| {
            let on = |at: usize, size: usize| at % spacing_px == (size / 2) % spacing_px;
            f64::from(on(row, target.rows) && on(column, target.columns))
        }),
        _ => Array2::from_shape_fn((target.rows, target.columns), |(row, column)| {
            let points = sample_points(target.supersampling, row, column);
            let n_light = points.filter(|&(y, x)| is_light(target, y, x)).count();
            n_light as f64 / (target.supersampling * target.supersampling) as f64
        }),
    }
}

/// Returns the points of a sample, (row, column), evenly spread over its square.
pub(super) fn sample_points(n: usize, row: usize, column: usize) -> impl Iterator<Item = (f64, f64)> {
    let at = move |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
    (0..n * n).map(move |i| (row as f64 + at(i / n), column as f64 + at(i % n)))
}

/// Tells whether a point of the picture is light; the centers of samples are at whole numbers.
fn is_light(target: &Target, row: f64, column: f64) -> bool {
    let (y, x) = (row - 0.5 * (target.rows as f64 - 1.0), column - 0.5 * (target.columns as f64 - 1.0));
    match target.pattern {
        Pattern::Checkerboard { check_px } => {
            let square = |at: f64| ((at + 0.5) / check_px as f64).floor() as i64;
            (square(row) + square(column)) % 2 != 0
        }
        Pattern::SlantedBar { slope } => y > slope * x,
        Pattern::SiemensStar { n_cycles } => {
            let turns = y.atan2(x) / (2.0 * PI) * n_cycles as f64;
            turns.rem_euclid(1.0) < 0.5
        }
        _ => true,
    }
}

/// Draws lines a sample wide from the center, each to the edge of the largest circle.
fn radial_lines(rows: usize, columns: usize, n_lines: usize) -> Array2<f64> {
    let mut light = Array2::zeros((rows, columns));
    let (center_y, center_x) = ((rows / 2) as f64, (columns / 2) as f64);
    let length = 0.5 * rows.min(columns) as f64;
    for ray in 0..2 * n_lines {
        let angle = PI * ray as f64 / n_lines as f64;
        let (sin, cos) = angle.sin_cos();
        // One sample a step along the longer of the two axes, so that the line has neither gaps nor corners.
        let step = 1.0 / sin.abs().max(cos.abs());
        for i in 0..=(length / step) as usize {
            let along = i as f64 * step;
            let (row, column) = ((center_y - along * sin).round(), (center_x + along * cos).round());
            if row >= 0.0
                && column >= 0.0
                && let Some(sample) = light.get_mut((row as usize, column as usize))
            {
                *sample = 1.0;
            }
        }
    }
    light
}

/// Returns which patches of the chart each sample shows.
pub(super) fn patch_shares(target: &Target) -> Array2<PatchShares> {
    let weight = 1.0 / (target.supersampling * target.supersampling) as f64;
    Array2::from_shape_fn((target.rows, target.columns), |(row, column)| {
        let mut shares = PatchShares::new();
        for (y, x) in sample_points(target.supersampling, row, column) {
            let v = 4.0 * (y + 0.5) / target.rows as f64;
            let u = 6.0 * (x + 0.5) / target.columns as f64;
            if let Some(patch) = patch_at(u, v) {
                match shares.iter_mut().find(|(known, _)| *known == patch) {
                    Some((_, share)) => *share += weight,
                    None => shares.push((patch, weight)),
                }
            }
        }
        shares
    })
}

/// Returns the patch at a place of the chart, 0–6 across and 0–4 down, or `None` on the frame.
fn patch_at(u: f64, v: f64) -> Option<u8> {
    let is_inside = |at: f64| (FRAME..=1.0 - FRAME).contains(&at.fract());
    let on_chart = (0.0..6.0).contains(&u) && (0.0..4.0).contains(&v);
    (on_chart && is_inside(u) && is_inside(v)).then(|| 6 * v as u8 + u as u8)
}
