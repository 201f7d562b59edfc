//! The numbers that samples are made of: Owen-scrambled Sobol points, drawn by their indices alone.
//!
//! A number depends on the seed, the pixel, the pass, the sample and the dimension, and on nothing that was drawn before; so
//! pictures do not depend on threads. Within a pass the samples of a pixel are one scrambled net: the four camera
//! dimensions are the first four of Sobol's sequence (direction numbers of Joe & Kuo 2008), every later pair is its
//! first two, shuffled and scrambled anew. Scrambling hashes as Burley, "Practical hash-based Owen scrambling"
//! (JCGT 9, 2020), with the constants of Vegdahl's improved Laine–Karras hash (2021).

use dioptric_optics::glam::DVec2;

/// Draws the numbers of one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    key: u32,
    index: u32,
}

/// 2⁻³²: numbers are 32 bits deep.
const UNIT: f64 = 1.0 / 4_294_967_296.0;
/// 2⁻²⁴, for numbers in single precision that stay below 1.
const UNIT_F32: f32 = 1.0 / 16_777_216.0;

impl Sampler {
    /// Returns the numbers of a sample of a pixel in a pass; passes are independent of each other.
    pub fn new(seed: u64, pixel: u32, pass: u32, sample: u32) -> Self {
        let key = mix(seed as u32 ^ mix((seed >> 32) as u32 ^ 0x9e37_79b9));
        Self { key: mix(mix(key ^ mix(pixel)).wrapping_add(mix(pass ^ 0x85eb_ca6b))), index: sample }
    }

    /// Returns the four numbers of the camera, in [0, 1): a place in the pixel, and one in the pupil.
    pub fn camera(&self) -> [f64; 4] {
        let index = scrambled(self.index, self.key);
        std::array::from_fn(|dimension| {
            f64::from(scrambled(sobol(index, dimension), mix(self.key ^ (dimension as u32 + 1)))) * UNIT
        })
    }

    /// Returns a pair of numbers in [0, 1); pairs of other numbers are independent of it.
    pub fn pair(&self, pair: u32) -> [f32; 2] {
        let key = mix(self.key ^ mix(pair.wrapping_add(0x5bd1_e995)));
        let index = scrambled(self.index, key);
        let number = |dimension: usize| {
            let bits = scrambled(sobol(index, dimension), mix(key ^ (dimension as u32 + 1)));
            (bits >> 8) as f32 * UNIT_F32
        };
        [number(0), number(1)]
    }

    /// Returns as many numbers as are asked for, of which the first two are [`pair`](Self::pair) and the others as good as random.
    pub(crate) fn stream(&self, pair: u32) -> Stream {
        Stream { first: self.pair(pair), key: mix(self.key ^ mix(pair)) ^ mix(self.index ^ 0x68e3_1da4), n_drawn: 0 }
    }
}

/// Numbers one after another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    first: [f32; 2],
    key: u32,
    n_drawn: u32,
}

impl Stream {
    /// Returns the next number in [0, 1).
    pub(crate) fn next(&mut self) -> f32 {
        let number = match self.first.get(self.n_drawn as usize) {
            Some(first) => *first,
            None => (mix(self.key ^ mix(self.n_drawn.wrapping_mul(0x9e37_79b9))) >> 8) as f32 * UNIT_F32,
        };
        self.n_drawn = self.n_drawn.wrapping_add(1);
        number
    }
}

/// Returns a point of the unit disc, evenly spread, neighbors staying neighbors (Shirley & Chiu 1997).
pub(crate) fn on_disc(u: f64, v: f64) -> DVec2 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if x == 0.0 && y == 0.0 {
        return DVec2::ZERO;
    }
    let (r, angle) = if x.abs() > y.abs() { (x, FRAC_PI_4 * y / x) } else { (y, FRAC_PI_2 - FRAC_PI_4 * x / y) };
    r * DVec2::from_angle(angle)
}

/// Returns a number as good as random for each number (the finalizer of `MurmurHash3`).
pub(crate) fn mix(mut v: u32) -> u32 {
    v ^= v >> 16;
    v = v.wrapping_mul(0x85eb_ca6b);
    v ^= v >> 13;
    v = v.wrapping_mul(0xc2b2_ae35);
    v ^ (v >> 16)
}

/// Permutes the 2³² fractions as Owen: which half of each half is swapped hangs on all bits above it.
fn scrambled(v: u32, key: u32) -> u32 {
    let mut x = v.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The number of dimensions of [`scrambled_sobol`].
pub const SOBOL_DIMENSIONS: usize = 21;

/// Returns the coordinate, in [0, 1), of the point of this index of Sobol's sequence in a dimension, scrambled as Owen does: the
/// first 2ⁿ points have one in each of 2ⁿ equal parts of every axis, for every seed.
///
/// # Panics
/// When there is no such dimension.
pub fn scrambled_sobol(index: u32, dimension: usize, seed: u64) -> f64 {
    let key = mix(seed as u32 ^ mix((seed >> 32) as u32 ^ 0x9e37_79b9));
    f64::from(scrambled(sobol(index, dimension), mix(key ^ (dimension as u32 + 1)))) * UNIT
}

/// Returns the point of this index of Sobol's sequence in a dimension from 0 to 20.
fn sobol(index: u32, dimension: usize) -> u32 {
    if dimension == 0 {
        return index.reverse_bits();
    }
    if let Some(bytes) = OF_BYTES.get(dimension - 1) {
        let [a, b, c, d] = index.to_le_bytes().map(usize::from);
        return bytes[0][a] ^ bytes[1][b] ^ bytes[2][c] ^ bytes[3][d];
    }
    let (mut bits, mut point) = (index, 0);
    while bits != 0 {
        point ^= DIRECTIONS[dimension][bits.trailing_zeros() as usize];
        bits &= bits - 1;
    }
    point
}

/// Dimensions 1 to 3, which every sample takes, by the bytes of the index: a point is the sum of those of its bytes.
static OF_BYTES: [[[u32; 256]; 4]; 3] = {
    let mut tables = [[[0; 256]; 4]; 3];
    let mut dimension = 0;
    while dimension < 3 {
        let mut at = 0_usize;
        while at < 4 * 256 {
            let (byte, value) = (at / 256, at % 256);
            // Its lowest bit, and the sum without it, which has been found before.
            if value > 0 {
                let bit = value.trailing_zeros() as usize;
                let rest = tables[dimension][byte][value & (value - 1)];
                tables[dimension][byte][value] = rest ^ DIRECTIONS[dimension + 1][8 * byte + bit];
            }
            at += 1;
        }
        dimension += 1;
    }
    tables
};

/// Direction numbers of the first 21 dimensions (Joe & Kuo 2008, the table new-joe-kuo-6.21201).
const DIRECTIONS: [[u32; 32]; SOBOL_DIMENSIONS] = {
    // Degree, coefficients and first numbers of each polynomial; the first dimension needs none.
    let polynomials: [(usize, u32, [u32; 7]); SOBOL_DIMENSIONS] = [
        (0, 0, [1; 7]),
        (1, 0, [1; 7]),
        (2, 1, [1, 3, 0, 0, 0, 0, 0]),
        (3, 1, [1, 3, 1, 0, 0, 0, 0]),
        (3, 2, [1, 1, 1, 0, 0, 0, 0]),
        (4, 1, [1, 1, 3, 3, 0, 0, 0]),
        (4, 4, [1, 3, 5, 13, 0, 0, 0]),
        (5, 2, [1, 1, 5, 5, 17, 0, 0]),
        (5, 4, [1, 1, 5, 5, 5, 0, 0]),
        (5, 7, [1, 1, 7, 11, 19, 0, 0]),
        (5, 11, [1, 1, 5, 1, 1, 0, 0]),
        (5, 13, [1, 1, 1, 3, 11, 0, 0]),
        (5, 14, [1, 3, 5, 5, 31, 0, 0]),
        (6, 1, [1, 3, 3, 9, 7, 49, 0]),
        (6, 13, [1, 1, 1, 15, 21, 21, 0]),
        (6, 16, [1, 3, 1, 13, 27, 49, 0]),
        (6, 19, [1, 1, 1, 15, 7, 5, 0]),
        (6, 22, [1, 3, 1, 15, 13, 25, 0]),
        (6, 25, [1, 1, 5, 5, 19, 61, 0]),
        (7, 1, [1, 3, 7, 11, 23, 15, 103]),
        (7, 4, [1, 3, 7, 13, 13, 15, 69]),
    ];
    let mut all = [[0; 32]; SOBOL_DIMENSIONS];
    let mut dimension = 0;
    while dimension < SOBOL_DIMENSIONS {
        let (degree, coefficients, first) = polynomials[dimension];
        let mut i = 0;
        while i < 32 {
            all[dimension][i] = if degree == 0 {
                1 << (31 - i)
            } else if i < degree {
                first[i] << (31 - i)
            } else {
                let mut v = all[dimension][i - degree] ^ (all[dimension][i - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        v ^= all[dimension][i - k];
                    }
                    k += 1;
                }
                v
            };
            i += 1;
        }
        dimension += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Every box of sides 2^-i and 2^-(6-i) holds one of 64 points: what makes a (0, 6, 2)-net.
    fn assert_net(points: &[[f64; 2]]) {
        for i in 0..=6 {
            let (columns, rows) = (1 << i, 1 << (6 - i));
            let mut counts = vec![0; 64];
            for p in points {
                counts[(p[0] * f64::from(columns)) as usize * rows as usize + (p[1] * f64::from(rows)) as usize] += 1;
            }
            assert!(counts.iter().all(|&n| n == 1), "{columns} x {rows}: {counts:?}");
        }
    }

    #[test]
    fn pairs_are_nets() {
        for pixel in 0..5 {
            for pair in [0, 1, 77] {
                let points: Vec<[f64; 2]> =
                    (0..64).map(|i| Sampler::new(1, pixel, 2, i).pair(pair).map(f64::from)).collect();
                assert_net(&points);
            }
            let camera: Vec<[f64; 4]> = (0..64).map(|i| Sampler::new(1, pixel, 2, i).camera()).collect();
            assert_net(&camera.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>());
        }
    }

    /// The first points of dimensions 1 to 7, as published with the direction numbers.
    #[test]
    fn first_sobol_points_are_published_ones() {
        let point = |index: u32| (0..7).map(|d| f64::from(sobol(index ^ (index >> 1), d)) * UNIT).collect::<Vec<_>>();
        assert_eq!(point(1), [0.5; 7]);
        assert_eq!(point(2), [0.75, 0.25, 0.25, 0.25, 0.75, 0.75, 0.25]);
        assert_eq!(point(3), [0.25, 0.75, 0.75, 0.75, 0.25, 0.25, 0.75]);
        assert_eq!(point(4), [0.375, 0.375, 0.625, 0.875, 0.375, 0.125, 0.375]);
    }

    /// The quick way is the sum of direction numbers, bit by bit.
    #[test]
    fn bytes_have_the_points_of_their_bits() {
        for (dimension, directions) in DIRECTIONS.iter().enumerate().take(4).skip(1) {
            for index in (0..2000).map(|i: u32| i.wrapping_mul(0x9e37_79b1)) {
                let of_bit = |bit: usize| if index >> bit & 1 == 1 { directions[bit] } else { 0 };
                assert_eq!(sobol(index, dimension), (0..32).fold(0, |sum, bit| sum ^ of_bit(bit)));
            }
        }
    }

    #[test]
    fn every_dimension_is_stratified() {
        for dimension in 0..SOBOL_DIMENSIONS {
            let mut places: Vec<usize> =
                (0..1024).map(|i| (scrambled_sobol(i, dimension, 7) * 1024.0) as usize).collect();
            places.sort_unstable();
            assert_eq!(places, (0..1024).collect::<Vec<_>>(), "dimension {dimension}");
        }
        // No two dimensions are alike.
        let point = |dimension| (0..64).map(|i| sobol(i, dimension)).collect::<Vec<_>>();
        let distinct: std::collections::BTreeSet<_> = (0..SOBOL_DIMENSIONS).map(point).collect();
        assert_eq!(distinct.len(), SOBOL_DIMENSIONS);
    }

    #[test]
    fn each_camera_dimension_is_stratified() {
        for dimension in 0..4 {
            let mut places: Vec<usize> =
                (0..256).map(|i| (Sampler::new(3, 9, 0, i).camera()[dimension] * 256.0) as usize).collect();
            places.sort_unstable();
            assert_eq!(places, (0..256).collect::<Vec<_>>());
        }
    }

    /// The root mean square error of the mean of a smooth function of the pupil falls far below that of random points.
    #[test]
    fn pupil_integrals_converge_fast() {
        let value = |p: [f64; 4]| (3.0 * p[2]).cos() * (2.0 * p[3] + p[0]).exp();
        let cosine = 3.0_f64.sin() / 3.0;
        let exponential = 0.5 * (2.0_f64.exp() - 1.0) * (1.0_f64.exp() - 1.0);
        let error = |pixel| {
            let sum: f64 = (0..1024).map(|i| value(Sampler::new(0, pixel, 0, i).camera())).sum();
            sum / 1024.0 - cosine * exponential
        };
        let rms = ((0..64).map(|pixel| error(pixel).powi(2)).sum::<f64>() / 64.0).sqrt();
        let mean = (0..64).map(error).sum::<f64>() / 64.0;
        // Random points: the standard deviation of the function, 2.5, over the root of 1024, 0.08.
        assert!(rms < 2e-3, "{rms}");
        assert!(mean.abs() < 4.0 * rms / 8.0, "{mean} {rms}");
    }

    #[test]
    fn pairs_and_pixels_are_independent() {
        let correlation = |a: &dyn Fn(u32) -> f32, b: &dyn Fn(u32) -> f32| {
            (0..4096).map(|i| f64::from((a(i) - 0.5) * (b(i) - 0.5))).sum::<f64>() / 4096.0 * 12.0
        };
        let a = |i| Sampler::new(1, i, 0, 0).pair(0)[0];
        // One over the root of 4096 is 0.016.
        assert!(correlation(&a, &|i| Sampler::new(1, i, 0, 0).pair(1)[0]).abs() < 0.06);
        assert!(correlation(&a, &|i| Sampler::new(1, i, 1, 0).pair(0)[0]).abs() < 0.06);
        assert!(correlation(&a, &|i| Sampler::new(2, i, 0, 0).pair(0)[0]).abs() < 0.06);
        assert!(correlation(&a, &|i| Sampler::new(1, i + 1, 0, 0).pair(0)[0]).abs() < 0.06);
        assert!(correlation(&a, &|i| Sampler::new(1, i, 0, 0).camera()[0] as f32).abs() < 0.06);
    }
}
