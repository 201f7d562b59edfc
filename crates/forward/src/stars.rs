//! Stars about bright points: what diffraction takes beyond the windows of their kernels, where the pupil is not round.
//!
//! Each piece of an edge bends light across itself, as much as it is long, and as far as a round edge does (`docs/forward.md`, 2). Straight edges
//! make spikes, as wide as light from a slit of their length; round ones fans. What a scene is made of otherwise has round halos: so many
//! stars beside each other are round too.

use std::{
    collections::{BTreeMap, BTreeSet},
    f64::consts::PI,
};

use dioptric_psf::PupilEdges;
use ndarray::{Array2, s};
use rayon::prelude::*;

use crate::{
    Film,
    halo::{Beyond, POINTS},
    points::Point,
};

/// The fewest pixels about whose points stars are drawn, the brightest, and pixels of all stars together up to which there are more of them.
const LEAST_STARS: usize = 64;
const STAR_PIXELS: usize = 1 << 27;
/// Directions in a half turn in which light is counted.
const DIRECTIONS: usize = 4096;
/// The half-width of a slit's picture, sinc², where a slit of length s lets through light of wavelength λ to a distance f: so many λ f / s.
const SLIT_WIDTH: f64 = 0.886;

/// Where the edges of a pupil bend light to.
#[derive(Clone, Debug)]
pub(crate) struct Directions {
    /// The share of the light for each radian of a full turn, over a half turn from the right upwards; the other half is the same.
    per_rad: Vec<f64>,
    /// Width of a spike, in λN.
    width_lambda_n: f64,
}

impl Directions {
    pub(crate) fn of(edges: &PupilEdges) -> Self {
        let mut lengths = vec![0.0; DIRECTIONS];
        let per_rad = DIRECTIONS as f64 / PI;
        for piece in &edges.pieces {
            // All of a fan, or the two directions that a spike lies between.
            let [from, to] = piece.across_rad.map(|rad| rad * per_rad);
            let (middle, wide) = (0.5 * (from + to), (to - from).abs().max(1.0));
            let first = middle - 0.5 * wide;
            for bin in first.floor() as i64..=(first + wide).floor() as i64 {
                let part = (first + wide).min(bin as f64 + 1.0) - first.max(bin as f64);
                lengths[bin.rem_euclid(DIRECTIONS as i64) as usize] += piece.length_mm * part.max(0.0) / wide;
            }
        }
        let all: f64 = lengths.iter().sum();
        let longest_mm = edges.pieces.iter().map(|piece| piece.length_mm).fold(0.0, f64::max);
        let width_lambda_n = SLIT_WIDTH * edges.diameter_mm / longest_mm;
        Self { per_rad: lengths.iter().map(|length| 0.5 * per_rad * length / all).collect(), width_lambda_n }
    }

    /// Returns them as wide as spikes are at a distance: a mean over a triangle of that width at half its height.
    fn widened(&self, width_rad: f64) -> Vec<f32> {
        let half = (0.5 * width_rad * DIRECTIONS as f64 / PI).min(0.5 * DIRECTIONS as f64 - 1.0);
        let once = |values: &[f64]| -> Vec<f64> {
            // The integral from the first direction on, over one and a half turns more than there are.
            let mut sums = vec![0.0; 3 * DIRECTIONS + 1];
            for i in 0..3 * DIRECTIONS {
                sums[i + 1] = sums[i] + values[i % DIRECTIONS];
            }
            let up_to = |at: f64| {
                let (below, part) = (at.floor() as usize, at.fract());
                sums[below] + part * (sums[below + 1] - sums[below])
            };
            let middle = |i: usize| (DIRECTIONS + i) as f64 + 0.5;
            (0..DIRECTIONS).map(|i| (up_to(middle(i) + half) - up_to(middle(i) - half)) / (2.0 * half)).collect()
        };
        if half < 0.5 {
            return self.per_rad.iter().map(|value| *value as f32).collect();
        }
        once(&once(&self.per_rad)).into_iter().map(|value| value as f32).collect()
    }
}

/// The star of a point of light 1 in a band, of sum 1 but for what lies beyond it.
pub(crate) struct Star {
    /// The lower half, rows from the middle down and columns from the left, as many on both sides of the middle one. The upper one is this one turned.
    half: Array2<f32>,
}

impl Star {
    /// Returns the star that reaches so many rows and columns from its middle.
    pub(crate) fn new(directions: &Directions, beyond: &Beyond, (rows, columns): (usize, usize)) -> Self {
        // No spike is narrower than a pixel.
        let width_px = (directions.width_lambda_n * beyond.lambda_n_px).max(1.0);
        let n_levels = (rows.max(columns) as f64).hypot(1.0).log2().ceil() as usize + 2;
        let levels: Vec<Vec<f32>> =
            (0..n_levels).into_par_iter().map(|level| directions.widened(width_px / (level as f64).exp2())).collect();
        let density = beyond.density();
        let at = |down: f64, right: f64| {
            let r = down.hypot(right);
            let round = density(r);
            if round == 0.0 {
                return 0.0;
            }
            let level = r.max(1.0).log2();
            let (finer, part) = ((level as usize).min(n_levels - 2), level.fract());
            let direction = (-down).atan2(right).rem_euclid(PI) * DIRECTIONS as f64 / PI;
            let direction = (direction as usize).min(DIRECTIONS - 1);
            let [near, far] = [finer, finer + 1].map(|level| f64::from(levels[level][direction]));
            2.0 * PI * round * (near + part * (far - near))
        };
        let pixel = |down: f64, right: f64| {
            if down.hypot(right) > POINTS as f64 {
                return at(down, right);
            }
            let point = |i: usize| (i as f64 + 0.5) / POINTS as f64 - 0.5;
            let points = (0..POINTS * POINTS).map(|i| at(down + point(i / POINTS), right + point(i % POINTS)));
            points.sum::<f64>() / (POINTS * POINTS) as f64
        };
        let mut half = Array2::zeros((rows + 1, 2 * columns + 1));
        let lines: Vec<_> = half.rows_mut().into_iter().enumerate().collect();
        lines.into_par_iter().for_each(|(down, mut line)| {
            for (column, value) in line.iter_mut().enumerate() {
                *value = pixel(down as f64, column as f64 - columns as f64) as f32;
            }
        });
        Self { half }
    }

    /// Returns a row of so many pixels of a star, the first of them so far to the right of the middle: turned in the upper half.
    fn row(&self, down: i64, first: i64, n: usize) -> Option<(ndarray::ArrayView1<'_, f32>, usize)> {
        let columns = (self.half.ncols() / 2) as i64;
        let at = down.unsigned_abs() as usize;
        let line = (at < self.half.nrows()).then(|| self.half.row(at))?;
        // Pixels beyond its ends get nothing.
        let skipped = (-columns - first).clamp(0, n as i64);
        let end = (columns + 1 - first).clamp(skipped, n as i64);
        let [from, to] = [skipped, end].map(|at| (first + at + columns) as usize);
        let n = self.half.ncols();
        let part = match down < 0 {
            false => line.slice_move(s![from..to]),
            true => line.slice_move(s![n - to..n - from; -1]),
        };
        Some((part, skipped as usize))
    }

    /// Adds the stars of points to a picture: each so far below and to the right of its first pixel, of so much light.
    pub(crate) fn add(&self, picture: &mut Array2<f32>, points: impl IntoIterator<Item = ([f64; 2], f64)>) {
        // Between pixels light is linear; points share pixels.
        let mut of_pixels: BTreeMap<[i64; 2], f64> = BTreeMap::new();
        for ([below, right], light) in points {
            let [row, column] = [below, right].map(|place| (place.floor() as i64, place.rem_euclid(1.0)));
            for (down, of_row) in [(0, 1.0 - row.1), (1, row.1)] {
                for (across, of_column) in [(0, 1.0 - column.1), (1, column.1)] {
                    *of_pixels.entry([row.0 + down, column.0 + across]).or_default() += light * of_row * of_column;
                }
            }
        }
        let columns = picture.ncols();
        let lines: Vec<_> = picture.rows_mut().into_iter().enumerate().collect();
        lines.into_par_iter().for_each(|(row, mut line)| {
            for (&[below, right], &light) in of_pixels.iter().filter(|(_, light)| **light > 0.0) {
                let Some((part, skipped)) = self.row(row as i64 - below, -right, columns) else { continue };
                let sums = line.iter_mut().skip(skipped);
                sums.zip(part).for_each(|(sum, value)| *sum += light as f32 * value);
            }
        });
    }
}

/// Parts the brightest points, which get stars, from the others; both in their order, by which they share kernels.
pub(crate) fn brightest(points: &[Point], film: &Film) -> [Vec<Point>; 2] {
    let mut by_light: Vec<usize> = (0..points.len()).collect();
    by_light.sort_by(|&a, &b| points[b].light().total_cmp(&points[a].light()));
    let most = (STAR_PIXELS / (film.rows * film.columns)).max(LEAST_STARS);
    let mut pixels = BTreeSet::new();
    let is_one = |number: &&usize| {
        pixels.insert(points[**number].place_px(1e-3 * film.pitch_um).map(|px| px.round() as i64));
        pixels.len() <= most
    };
    let bright: BTreeSet<usize> = by_light.iter().take_while(is_one).copied().collect();
    let of = |is_bright: bool| {
        let numbers = (0..points.len()).filter(|number| bright.contains(number) == is_bright);
        numbers.map(|number| points[number]).collect()
    };
    [of(true), of(false)]
}

#[cfg(test)]
mod tests {
    use dioptric_optics::EdgePiece;
    use glam::DVec2;

    use super::*;

    const HEXAGON: [f64; 6] = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];

    /// Edges of a regular hexagon whose corners lie so far from the middle, mm, one of them on x.
    fn edges(corner_mm: f64) -> PupilEdges {
        let piece = |deg: f64| EdgePiece { length_mm: corner_mm, across_rad: [(deg + 30.0).to_radians(); 2] };
        // The circle of as much area.
        let diameter_mm = 2.0 * corner_mm * (1.5 * 3_f64.sqrt() / PI).sqrt();
        PupilEdges { pieces: HEXAGON.map(piece).to_vec(), diameter_mm }
    }

    /// The light of a point for an area of the film, of all of it, by the Fourier transform of the hexagon: distances in λN.
    fn diffracted(place: DVec2) -> f64 {
        // Of corners at 1: k is 2 π over the diameter of the circle of as much area.
        let k = place * 2.0 * PI / edges(1.0).diameter_mm;
        let corner = |i: usize| DVec2::from_angle(HEXAGON[i % 6].to_radians());
        let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
        let [mut real, mut imaginary] = [0.0; 2];
        for i in 0..6 {
            let (edge, middle) = (corner(i + 1) - corner(i), 0.5 * (corner(i + 1) + corner(i)));
            let amplitude = k.perp_dot(edge) / k.length_squared() * sinc(0.5 * k.dot(edge));
            let (sin, cos) = k.dot(middle).sin_cos();
            real += amplitude * cos;
            imaginary += amplitude * sin;
        }
        let area = 1.5 * 3_f64.sqrt();
        // Over the plane of k it holds (2 π)² of the area.
        (real * real + imaginary * imaginary) / area / edges(1.0).diameter_mm.powi(2)
    }

    /// Light between two distances, λN, in each of 180 parts of a half turn, both halves together.
    fn ring(of: &dyn Fn(DVec2) -> f64, between: [f64; 2], step: f64) -> Vec<f64> {
        let mut parts = vec![0.0; 180];
        let n = (between[1] / step) as i64;
        for row in -n..=n {
            for column in -n..=n {
                let place = DVec2::new(column as f64, row as f64) * step;
                if (between[0]..between[1]).contains(&place.length()) {
                    let deg = place.y.atan2(place.x).rem_euclid(PI).to_degrees();
                    parts[(deg as usize).min(179)] += of(place) * step * step;
                }
            }
        }
        parts
    }

    /// Beside the Fourier transform of the hexagon: as much light at each distance, and as much of it next to spikes.
    #[test]
    fn stars_have_the_light_and_spikes_of_the_diffraction_integral() {
        let (pixel, start) = (0.5, 12.0);
        let exact = |between| ring(&diffracted, between, 0.125);
        // Beyond the start lies perimeter over area, of a circle 4 / D, by 2 π² times the distance.
        let share = 6.0 / (1.5 * 3_f64.sqrt()) * edges(1.0).diameter_mm / (2.0 * PI * PI * start);
        let beyond = Beyond::from_step(share, start / pixel, 1.0 / pixel);
        let reach = 130;
        let star = Star::new(&Directions::of(&edges(5.0)), &beyond, (reach, reach));
        let drawn = |place: DVec2| {
            let (down, right) = ((-place.y / pixel).round() as i64, (place.x / pixel).round() as i64);
            let (line, skipped) = star.row(down, right, 1).unwrap();
            assert_eq!(skipped, 0);
            share * f64::from(line[0]) / (pixel * pixel)
        };
        for between in [[14.0, 30.0], [30.0, 60.0]] {
            let (exact, drawn) = (exact(between), ring(&drawn, between, pixel));
            let sum = |parts: &[f64]| parts.iter().sum::<f64>();
            assert!((sum(&drawn) / sum(&exact) - 1.0).abs() < 0.03, "{between:?}: {} {}", sum(&drawn), sum(&exact));
            // A corner lies on x: spikes at 30, 90 and 150 degrees.
            let on_spikes = |parts: &[f64]| {
                let near = |deg: usize| (deg - 8..deg + 8).map(|part| parts[part]).sum::<f64>();
                [30, 90, 150].map(|deg| near(deg) / sum(parts))
            };
            for (exact, drawn) in on_spikes(&exact).into_iter().zip(on_spikes(&drawn)) {
                assert!(exact > 0.29 && (drawn - exact).abs() < 0.03, "{between:?}: {drawn} {exact}");
            }
        }
    }

    /// Of a round edge a star is a round halo, wherever it lies among the pixels.
    #[test]
    fn stars_of_round_edges_are_round() {
        let piece = |i: i32| {
            let across_rad = [f64::from(i), f64::from(i + 1)].map(|deg| deg.to_radians());
            EdgePiece { length_mm: 1.0, across_rad }
        };
        let edges = PupilEdges { pieces: (0..360).map(piece).collect(), diameter_mm: 360.0 / PI };
        let beyond = Beyond::from_step(0.01, 5.0, 0.5);
        let star = Star::new(&Directions::of(&edges), &beyond, (60, 60));
        let (density, at) = (beyond.density(), DVec2::new(31.3, 28.6));
        let mut picture = Array2::zeros((60, 60));
        star.add(&mut picture, [([at.y, at.x], 2.0)]);
        for ((row, column), light) in picture.indexed_iter() {
            let r = DVec2::new(column as f64, row as f64).distance(at);
            if r > 8.0 {
                let ratio = f64::from(*light) / (2.0 * density(r));
                // Lines between pixels lie above r⁻³: by 12 / 8 r² in the middle, along each axis.
                assert!((ratio - 1.0).abs() < 3.0 / (r * r) + 2e-3, "{row} {column}: {ratio}");
            }
        }
    }
}
