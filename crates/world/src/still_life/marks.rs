//! Printed patterns, blurred to the size of a pixel.

use super::noise::{hash, unit};

/// Returns the share of a footprint that lies inside an edge, from the signed distance to it (inside above 0).
pub(super) fn cover(distance: f64, footprint: f64) -> f64 {
    (0.5 + distance / footprint.max(1e-9)).clamp(0.0, 1.0)
}

/// Returns the share of a footprint that a line of this width covers, from the distance to its middle.
pub(super) fn line(distance: f64, width: f64, footprint: f64) -> f64 {
    let reach = footprint.max(1e-9);
    let overlap = (0.5 * width).min(distance + 0.5 * reach) - (-0.5 * width).max(distance - 0.5 * reach);
    (overlap / reach).clamp(0.0, 1.0)
}

/// Returns even stripes of this period, half ink; 0.5 where they are too fine to be seen.
pub(super) fn stripes(at: f64, period: f64, footprint: f64) -> f64 {
    let fade = (1.5 - 2.0 * footprint / period).clamp(0.0, 1.0);
    let phase = (at / period).fract().abs();
    let edge = 0.25 - (phase - 0.5).abs();
    0.5 + fade * (cover(edge * period, footprint) - 0.5)
}

/// Returns a star of ink and paper within a circle.
pub(super) fn star(x: f64, y: f64, radius: f64, n_cycles: f64, footprint: f64) -> f64 {
    let r = x.hypot(y);
    let period = std::f64::consts::TAU * r / n_cycles;
    let turn = y.atan2(x) / std::f64::consts::TAU + 1.0;
    stripes(turn * n_cycles * period.max(1e-9), period.max(1e-9), footprint) * cover(radius - r, footprint)
}

/// Returns lines of made-up print: letters of random strokes in cells of [width, height], words of random length.
///
/// `x` runs from the left margin, `down` from the top of the first line; a line has at most `n_letters`.
pub(super) fn print(x: f64, down: f64, [width, height]: [f64; 2], n_letters: i64, footprint: f64) -> f64 {
    if x < 0.0 || down < 0.0 {
        return 0.0;
    }
    let (letter, row) = ((x / width).floor() as i64, (down / height).floor() as i64);
    let line_length = n_letters - (hash(row, 5, 1) % 9) as i64;
    if letter >= line_length || is_space(letter, row) {
        return 0.0;
    }
    // A letter has a 3 × 5 bitmap in the upper part of its cell.
    let (u, v) = (4.0 * (x / width - letter as f64) - 0.4, 7.0 * (down / height - row as f64) - 0.6);
    let share = |at: f64, cell: f64, size: f64| {
        let soft = footprint / size;
        cover(at - cell, soft) * cover(cell + 1.0 - at, soft)
    };
    let bits = hash(letter, row, 17) | (1 << (hash(letter, row, 3) % 15));
    let mut ink: f64 = 0.0;
    for bit in 0..15_i64 {
        // Left strokes are always there: letters look written, not sown.
        if bits >> bit & 1 == 1 || bit % 3 == 0 {
            ink += share(u, (bit % 3) as f64, width / 4.0) * share(v, (bit / 3) as f64, height / 7.0);
        }
    }
    ink.min(1.0)
}

fn is_space(letter: i64, row: i64) -> bool {
    // A word ends at least every eighth letter.
    unit(letter, row, 8) < 0.14 || (letter + row) % 9 == 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn patterns_keep_their_mean_when_blurred() {
        for footprint in [1e-4, 1e-2] {
            let mean_of = |f: &dyn Fn(f64) -> f64| (0..2000).map(|i| f(1e-4 * f64::from(i))).sum::<f64>() / 2000.0;
            assert_abs_diff_eq!(mean_of(&|x| stripes(x, 0.004, footprint)), 0.5, epsilon = 0.02);
            assert_abs_diff_eq!(mean_of(&|x| line(x - 0.1, 0.002, footprint)), 0.01, epsilon = 1e-3);
        }
        assert_eq!((cover(1.0, 0.5), cover(-1.0, 0.5), cover(0.0, 0.5)), (1.0, 0.0, 0.5));
    }

    #[test]
    fn print_is_ink_on_paper() {
        let points = (0..4000).map(|i| (f64::from(i % 100) * 4e-4, f64::from(i / 100) * 5e-4));
        let ink: Vec<f64> = points.map(|(x, y)| print(x, y, [0.003, 0.006], 12, 1e-4)).collect();
        let mean = ink.iter().sum::<f64>() / ink.len() as f64;
        assert!(ink.iter().all(|v| (0.0..=1.0).contains(v)) && (0.1..0.5).contains(&mean), "{mean}");
        assert_eq!(print(-1.0, 0.0, [0.003, 0.006], 12, 1e-4), 0.0);
        assert!((0..100).all(|i| (0.0..=1.0).contains(&star(1e-3 * f64::from(i), 0.01, 0.05, 18.0, 1e-3))));
    }
}
