//! Pixels that stand out of their neighbors, replaced.

use ndarray::Array2;
use rayon::prelude::*;

use crate::Tile;

/// Replaces each pixel that lies more than `threshold` above or below all its nearest neighbors of the same filter by
/// their median, and returns how many there were.
///
/// The threshold is in units of the values, 1 being saturation. Two defects next to each other of one filter hide each
/// other and stay.
pub(crate) fn correct(planes: &mut [Array2<f32>], tile: Option<&Tile>, threshold: f32) -> usize {
    let step = tile.map_or((1, 1), |tile| (tile.rows(), tile.columns()));
    planes.iter_mut().map(|plane| correct_plane(plane, step, threshold)).sum()
}

fn correct_plane(plane: &mut Array2<f32>, step: (usize, usize), threshold: f32) -> usize {
    let (n_rows, n_columns) = plane.dim();
    let found: Vec<(usize, usize, f32)> = (0..n_rows)
        .into_par_iter()
        .flat_map_iter(|row| {
            let plane = &*plane;
            (0..n_columns).filter_map(move |column| {
                let (mut neighbors, mut n) = ([0.0_f32; 8], 0);
                for (dr, dc) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
                    let r = row.wrapping_add_signed(dr * step.0 as isize);
                    let c = column.wrapping_add_signed(dc * step.1 as isize);
                    if r < n_rows && c < n_columns {
                        neighbors[n] = plane[(r, c)];
                        n += 1;
                    }
                }
                let neighbors = &mut neighbors[..n];
                let (low, high) = neighbors.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
                let value = plane[(row, column)];
                if n < 3 || (low - threshold..=high + threshold).contains(&value) {
                    return None;
                }
                neighbors.sort_by(f32::total_cmp);
                Some((row, column, 0.5 * (neighbors[(n - 1) / 2] + neighbors[n / 2])))
            })
        })
        .collect();
    found.iter().for_each(|&(row, column, median)| plane[(row, column)] = median);
    found.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cfa;

    #[test]
    fn lone_defects_are_mended_and_edges_are_kept() {
        let tile = Cfa::two_by_two("RGGB").unwrap().resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        // A diagonal edge over a mosaic of three levels.
        let level = |r, c| [0.2, 0.4, 0.3][tile.filter_at(r, c)] * if r + 2 * c < 20 { 0.1 } else { 1.0 };
        let clean = Array2::from_shape_fn((16, 16), |(r, c)| level(r, c));
        let mut planes = vec![clean.clone()];
        assert_eq!(correct(&mut planes, Some(&tile), 0.05), 0);
        assert_eq!(planes[0], clean);
        planes[0][(12, 12)] = 1.0;
        planes[0][(13, 9)] = 0.0;
        planes[0][(0, 0)] = 1.0;
        assert_eq!(correct(&mut planes, Some(&tile), 0.05), 3);
        assert_eq!(planes[0], clean);
    }
}
