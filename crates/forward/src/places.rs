//! Where in the scene the points along a row of the film look.

use dioptric_psf::{FieldsAlong, FilmMap};
use dioptric_scene::View;
use multiversion::multiversion;

use crate::{Border, raster::BLOCK};

/// Stands for the square of a point that looks at nothing.
pub(crate) const UNSEEN: u32 = u32::MAX;

/// The samples of a scene, the directions that they are seen in, and what lies beyond its edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneRaster {
    pub(crate) view: View,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) border: Border,
}

impl SceneRaster {
    /// From a sample to the one beside it and the one below it; to itself where there is none.
    pub(crate) fn steps(&self) -> (usize, usize) {
        (usize::from(self.columns > 1), if self.rows > 1 { self.columns } else { 0 })
    }

    /// Returns the row and column of a direction.
    #[inline(always)]
    pub(crate) fn position_of(&self, tan_x: f64, tan_y: f64) -> [f64; 2] {
        let View { focal_px, center_x_px, center_y_px } = self.view;
        [center_y_px - focal_px * tan_y, center_x_px + focal_px * tan_x]
    }

    /// Returns how much of a pixel that is so many samples wide and has its middle at a row and column lies on samples.
    pub(crate) fn part_within(&self, [row, column]: [f64; 2], width: f64) -> f32 {
        let part = |position: f64, n: usize| {
            let inside = (position + 0.5).min(n as f64 - 0.5 - position);
            (0.5 + inside / width.max(1e-9)).clamp(0.0, 1.0)
        };
        if row.is_finite() && column.is_finite() {
            (part(row, self.rows) * part(column, self.columns)) as f32
        } else {
            0.0
        }
    }

    /// Whether a row and column lie on a sample.
    pub(crate) fn is_within(&self, [row, column]: [f64; 2]) -> bool {
        is_within(row, self.rows) && is_within(column, self.columns)
    }
}

#[inline(always)]
fn is_within(position: f64, n: usize) -> bool {
    position >= -0.5 && position <= n as f64 - 0.5
}

/// Returns a position among `n` samples that stands for one, which may lie beyond them.
#[inline(always)]
pub(crate) fn folded(position: f64, n: usize, border: Border) -> f64 {
    let last = (n - 1) as f64;
    if border == Border::Mirror && !is_within(position, n) {
        let period = 2.0 * n as f64;
        let from_edge = (position + 0.5).rem_euclid(period);
        return (from_edge.min(period - from_edge) - 0.5).clamp(0.0, last);
    }
    position.clamp(0.0, last)
}

/// The squares between four samples of the scene in which points lie.
#[derive(Default)]
pub(crate) struct Places {
    /// The number of the sample at the upper left of each, or [`UNSEEN`].
    pub(crate) first: Vec<u32>,
    /// How far below and to the right of it the point lies, 0 to 1.
    pub(crate) down: Vec<f32>,
    pub(crate) across: Vec<f32>,
    /// 1, or 0 where darkness lies beyond the edge.
    pub(crate) light: Vec<f32>,
    x_mm: Vec<f64>,
    seen: FieldsAlong,
    positions: [Vec<f64>; 2],
}

impl Places {
    /// Finds what is seen by `n` evenly spaced points of a row of the film, from `first_mm` on.
    pub(crate) fn find(
        &mut self,
        scene: &SceneRaster,
        map: &FilmMap,
        n: usize,
        (first_mm, step_mm, y_mm): (f64, f64, f64),
    ) {
        // One look-up before the first point and two behind the last.
        let apart = BLOCK as usize;
        let n_looked_up = n.div_ceil(apart) + 3;
        self.x_mm.clear();
        self.x_mm.extend((0..n_looked_up).map(|i| first_mm + step_mm * apart as f64 * (i as f64 - 1.0)));
        map.along(&self.x_mm, y_mm, &mut self.seen);
        let FieldsAlong { tan_x, tan_y, .. } = &self.seen;
        self.positions.iter_mut().for_each(Vec::clear);
        for (tan_x, tan_y) in tan_x.iter().zip(tan_y) {
            let [row, column] = scene.position_of(*tan_x, *tan_y);
            self.positions[0].push(row);
            self.positions[1].push(column);
        }
        self.first.resize(n, 0);
        for values in [&mut self.down, &mut self.across, &mut self.light] {
            values.resize(n, 0.0);
        }
        locate(scene, self);
    }
}

/// Puts the square of each point between what is seen at every eighth.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn locate(scene: &SceneRaster, places: &mut Places) {
    let Places { first, down, across, light, positions: [rows, columns], .. } = places;
    let apart = BLOCK as usize;
    let chunks = first.chunks_mut(apart).zip(down.chunks_mut(apart));
    let chunks = chunks.zip(across.chunks_mut(apart).zip(light.chunks_mut(apart)));
    for (i, ((first, down), (across, light))) in chunks.enumerate() {
        let (row, column) = (Cubic::through(&rows[i..]), Cubic::through(&columns[i..]));
        for k in 0..first.len() {
            let at = k as f64 / apart as f64;
            let (row, column) = (row.at(at), column.at(at));
            if !(row.abs() < 1e9 && column.abs() < 1e9) {
                (first[k], down[k], across[k], light[k]) = (UNSEEN, 0.0, 0.0, 0.0);
                continue;
            }
            let is_dark = scene.border == Border::Black && !scene.is_within([row, column]);
            light[k] = if is_dark { 0.0 } else { 1.0 };
            let (row, column) = (folded(row, scene.rows, scene.border), folded(column, scene.columns, scene.border));
            let top = (row as usize).min(scene.rows.saturating_sub(2));
            let left = (column as usize).min(scene.columns.saturating_sub(2));
            first[k] = (top * scene.columns + left) as u32;
            (down[k], across[k]) = ((row - top as f64) as f32, (column - left as f64) as f32);
        }
    }
}

/// The cubic with the slopes of Catmull and Rom between the second and the third of four numbers.
#[derive(Clone, Copy)]
struct Cubic([f64; 4]);

impl Cubic {
    #[inline(always)]
    fn through(values: &[f64]) -> Self {
        let [a, b, c, d] = [values[0], values[1], values[2], values[3]];
        Self([b, 0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c)])
    }

    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        let Self([constant, slope, bend, turn]) = self;
        constant + t * (slope + t * (bend + t * turn))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_found_among_samples() {
        let view = View { focal_px: 100.0, center_x_px: 4.5, center_y_px: 2.0 };
        let map = FilmMap::radial(1.0, |r| Some(r * (1.0 + 0.1 * r * r)), |_| 1.0);
        for border in [Border::Hold, Border::Mirror, Border::Black] {
            let scene = SceneRaster { view, rows: 5, columns: 10, border };
            let mut places = Places::default();
            places.find(&scene, &map, 40, (-0.1, 0.005, 0.01));
            for k in 0..40 {
                let x_mm = -0.1 + 0.005 * f64::from(k as u32);
                let r2 = x_mm * x_mm + 1e-4;
                let column = 4.5 + 100.0 * x_mm * (1.0 + 0.1 * r2);
                let within = folded(column, 10, border);
                let found = f64::from(places.first[k] % 10) + f64::from(places.across[k]);
                assert!((found - within).abs() < 1e-4, "{border:?}: {k}: {found} {within}");
                let is_dark = border == Border::Black && !(-0.5..=9.5).contains(&column);
                assert_eq!(places.light[k] == 0.0, is_dark);
            }
        }
        assert_eq!([-0.5, -1.5, -3.0, 10.0, 12.0].map(|p| folded(p, 10, Border::Mirror)), [0.0, 0.5, 2.0, 9.0, 7.0]);
    }
}
