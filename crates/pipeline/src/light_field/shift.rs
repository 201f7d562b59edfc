//! Pictures moved by fractions of a pixel.

use ndarray::{Array2, Axis};

/// Returns a picture moved to the right and down by so many pixels, between samples by the cubic of Catmull and Rom; beyond
/// its border lies what is at the border.
pub(super) fn shifted(plane: &Array2<f32>, right_px: f64, down_px: f64) -> Array2<f32> {
    let moved = along_rows(plane.view(), right_px);
    if down_px == 0.0 { moved } else { along_rows(moved.t(), down_px).reversed_axes() }
}

fn along_rows(plane: ndarray::ArrayView2<'_, f32>, by_px: f64) -> Array2<f32> {
    let mut moved = Array2::zeros(plane.dim());
    let n = plane.len_of(Axis(1)) as i64;
    let whole = (-by_px).floor();
    let weights = catmull_rom((-by_px - whole) as f32);
    for (row, mut out) in plane.outer_iter().zip(moved.outer_iter_mut()) {
        for (column, value) in out.iter_mut().enumerate() {
            let first = column as i64 + whole as i64 - 1;
            let at = |k: usize| row[(first + k as i64).clamp(0, n - 1) as usize];
            *value = (0..4).map(|k| weights[k] * at(k)).sum();
        }
    }
    moved
}

/// Returns the weights of the samples before, at, after and two after, for a place this share of the way to the next.
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_moved_exactly() {
        let plane = Array2::from_shape_fn((9, 12), |(y, x)| 3.0 * x as f32 - 2.0 * y as f32);
        for (right, down) in [(0.0, 0.0), (1.0, -2.0), (0.3, 0.75), (-1.6, 0.5)] {
            let moved = shifted(&plane, right, down);
            for (y, x) in (4..5).flat_map(|y| (4..8).map(move |x| (y, x))) {
                let expected = 3.0 * (x as f64 - right) - 2.0 * (y as f64 - down);
                assert!((f64::from(moved[(y, x)]) - expected).abs() < 1e-4, "{right} {down} {y} {x}");
            }
        }
    }
}
