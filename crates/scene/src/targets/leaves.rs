//! Dead leaves: discs of many sizes that hide one another, the texture target of IEEE Std 1858 and ISO/TS 19567-2.
//!
//! Discs fall from the front to the back: each shows where none before it lies, until nothing is open. The number of discs
//! falls as the cube of their radius, which makes the texture alike at all scales between the smallest and the largest
//! (Lee, Mumford & Huang, "Occlusion models for natural images", International Journal of Computer Vision 41, 2001; Cao,
//! Guichard & Hornung, "Measuring texture sharpness of a digital camera", Proc. SPIE 7250, 2009).

use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    /// The row of its center; centers of samples are at whole numbers.
    pub(super) row: f64,
    /// The column of its center.
    pub(super) column: f64,
    /// Its radius, samples.
    pub(super) radius_px: f64,
    /// What it reflects, as a share of white.
    pub(super) reflectance: f64,
}

/// Discs without end, the front one first: all those of an endless plane whose squares touch the target.
pub(super) struct Leaves {
    random: ChaCha8Rng,
    /// Rows and columns of the target.
    size: [f64; 2],
    radii_px: [f64; 2],
    reflectances: [f64; 2],
}

impl Leaves {
    pub(super) fn new(size: (usize, usize), radii_px: [f64; 2], reflectances: [f64; 2], seed: u64) -> Self {
        let random = ChaCha8Rng::seed_from_u64(seed);
        Self { random, size: [size.0 as f64, size.1 as f64], radii_px, reflectances }
    }

    /// Draws a radius: as r⁻³ in the plane, and as often as the square of the disc touches the target.
    ///
    /// The product r⁻³ (rows + 2 r) (columns + 2 r) is a sum of three powers, each of which has an inverse in closed form.
    fn radius_px(&mut self) -> f64 {
        let ([rows, columns], [a, b]) = (self.size, self.radii_px);
        let cubes = rows * columns * 0.5 * (a.powi(-2) - b.powi(-2));
        let squares = 2.0 * (rows + columns) * (1.0 / a - 1.0 / b);
        let firsts = 4.0 * (b / a).ln();
        let which = self.random.random::<f64>() * (cubes + squares + firsts);
        let u = self.random.random::<f64>();
        let radius = if which < cubes {
            (a.powi(-2) - u * (a.powi(-2) - b.powi(-2))).sqrt().recip()
        } else if which < cubes + squares {
            (1.0 / a - u * (1.0 / a - 1.0 / b)).recip()
        } else {
            a * (b / a).powf(u)
        };
        radius.clamp(a, b)
    }

    /// Returns the next disc behind those before.
    pub(super) fn next_leaf(&mut self) -> Leaf {
        let radius_px = self.radius_px();
        let [rows, columns] = self.size;
        let mut place = |size: f64| self.random.random::<f64>() * (size + 2.0 * radius_px) - radius_px - 0.5;
        let (row, column) = (place(rows), place(columns));
        let [least, most] = self.reflectances;
        Leaf { row, column, radius_px, reflectance: least + (most - least) * self.random.random::<f64>() }
    }
}

/// Returns what each sample reflects: the mean over `supersampling` × `supersampling` points of it.
pub(super) fn reflectance(mut leaves: Leaves, (rows, columns): (usize, usize), supersampling: usize) -> Array2<f64> {
    let n_points = supersampling * supersampling;
    // A bit a point, set while no disc lies there.
    let n_words = n_points.div_ceil(64);
    let bits_of = |word: usize| u64::MAX >> (64 - (n_points - 64 * word).min(64));
    let mut open: Vec<u64> = (0..rows * columns * n_words).map(|i| bits_of(i % n_words)).collect();
    let mut n_open = vec![n_points as u16; rows * columns];
    let mut sums = Array2::<f64>::zeros((rows, columns));
    let offset = |i: usize| (i as f64 + 0.5) / supersampling as f64 - 0.5;
    let span = |middle: f64, half: f64, size: usize| {
        let first = (middle - half).ceil().max(0.0) as usize;
        first..((middle + half).floor() + 1.0).clamp(0.0, size as f64) as usize
    };
    let mut n_left = rows * columns;
    while n_left > 0 {
        let leaf = leaves.next_leaf();
        for row in span(leaf.row, leaf.radius_px + 0.5, rows) {
            let dy = ((row as f64 - leaf.row).abs() - 0.5).max(0.0);
            let half = (leaf.radius_px * leaf.radius_px - dy * dy).max(0.0).sqrt() + 0.5;
            for column in span(leaf.column, half, columns) {
                let at = row * columns + column;
                if n_open[at] == 0 {
                    continue;
                }
                for point in 0..n_points {
                    let (word, bit) = (at * n_words + point / 64, 1_u64 << (point % 64));
                    if open[word] & bit == 0 {
                        continue;
                    }
                    let y = row as f64 + offset(point / supersampling) - leaf.row;
                    let x = column as f64 + offset(point % supersampling) - leaf.column;
                    if x * x + y * y <= leaf.radius_px * leaf.radius_px {
                        open[word] &= !bit;
                        n_open[at] -= 1;
                        sums[(row, column)] += leaf.reflectance;
                    }
                }
                n_left -= usize::from(n_open[at] == 0);
            }
        }
    }
    sums / n_points as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const RADII_PX: [f64; 2] = [2.0, 40.0];
    const SIZE: (usize, usize) = (400, 300);

    fn leaves(seed: u64) -> Leaves {
        Leaves::new(SIZE, RADII_PX, [0.2, 0.8], seed)
    }

    #[test]
    fn radii_fall_as_their_cube() {
        let mut leaves = leaves(1);
        let (rows, columns) = (-0.5..SIZE.0 as f64 - 0.5, -0.5..SIZE.1 as f64 - 0.5);
        let all: Vec<Leaf> = (0..200_000).map(|_| leaves.next_leaf()).collect();
        // Of those whose centers are on the target every radius has its share.
        let of_target = all.iter().filter(|leaf| rows.contains(&leaf.row) && columns.contains(&leaf.column));
        let mut radii: Vec<f64> = of_target.map(|leaf| leaf.radius_px).collect();
        radii.sort_by(f64::total_cmp);
        let n = radii.len() as f64;
        let [a, b] = RADII_PX;
        let below = |r: f64| (a.powi(-2) - r.powi(-2)) / (a.powi(-2) - b.powi(-2));
        let distance = radii.iter().enumerate().map(|(i, &r)| (below(r) - (i as f64 + 0.5) / n).abs());
        // Kolmogorov and Smirnov: 1.95/√n is reached by chance once in a thousand.
        assert!(distance.fold(0.0, f64::max) < 1.95 / n.sqrt());
        assert!(radii[0] >= a && radii[radii.len() - 1] <= b);
        // Larger ones reach the target from farther away: their centers lie off it more often, but not beyond a radius.
        assert!(all.iter().all(|leaf| {
            let beyond = |at: f64, size: usize| (-0.5 - at).max(at - (size as f64 - 0.5));
            beyond(leaf.row, SIZE.0).max(beyond(leaf.column, SIZE.1)) <= leaf.radius_px
        }));
    }

    #[test]
    fn leaves_cover_the_whole_target() {
        for supersampling in [1, 3, 9] {
            // A point that no disc covered would add 0.
            let (radii, gray) = ([0.5, 20.0], [0.6, 0.6]);
            let plane = reflectance(Leaves::new((50, 70), radii, gray, 3), (50, 70), supersampling);
            assert!(plane.iter().all(|&v| (v - 0.6).abs() < 1e-12), "{supersampling}");
        }
    }

    /// The share of a disc of radius 1 that a disc of radius 1 covers so far away.
    fn overlap(distance: f64) -> f64 {
        let half = 0.5 * distance;
        if half >= 1.0 { 0.0 } else { 2.0 / std::f64::consts::PI * (half.acos() - half * (1.0 - half * half).sqrt()) }
    }

    /// The chance that two points so far apart lie on one leaf: γ(h) / (2 γ(0) − γ(h)), where γ is the mean area that a
    /// disc shares with itself shifted by h (Gousseau & Roueff, "Modeling occlusion and scaling in natural images",
    /// Multiscale Modeling & Simulation 6, 2007).
    fn same_leaf(distance_px: f64) -> f64 {
        let [a, b] = RADII_PX;
        let (mut shared, mut all) = (0.0, 0.0);
        const STEPS: usize = 4000;
        for i in 0..STEPS {
            // Equal steps of the logarithm: r² r⁻³ dr is d ln r.
            let r = a * (b / a).powf((i as f64 + 0.5) / STEPS as f64);
            shared += overlap(distance_px / r);
            all += 1.0;
        }
        shared / (2.0 * all - shared)
    }

    #[test]
    fn covariance_is_that_of_the_model() {
        let planes: Vec<Array2<f64>> = (0..6).map(|seed| reflectance(leaves(seed), SIZE, 2)).collect();
        // Gray is uniform from 0.2 to 0.8.
        let (mean, variance) = (0.5, 0.6 * 0.6 / 12.0);
        for lag in [3_usize, 5, 8, 12, 20, 40, 90] {
            let (mut sum, mut n) = (0.0, 0.0);
            for plane in &planes {
                for ((row, column), value) in plane.indexed_iter() {
                    for at in [(row + lag, column), (row, column + lag)] {
                        if let Some(other) = plane.get(at) {
                            sum += (value - mean) * (other - mean);
                            n += 1.0;
                        }
                    }
                }
            }
            // Six targets of some 60 of the largest discs each leave 0.03 of chance.
            assert_abs_diff_eq!(sum / n / variance, same_leaf(lag as f64), epsilon = 0.04);
        }
        let everywhere = planes.iter().map(|plane| plane.mean().unwrap()).sum::<f64>() / 6.0;
        assert_abs_diff_eq!(everywhere, mean, epsilon = 0.02);
    }
}
