//! Wings: what diffraction takes beyond the window of the kernel of a point.
//!
//! Each piece of an edge of the pupil bends light across itself, as much as it is long (`docs/forward.md`, 2). Straight edges make spikes, as wide as light
//! from a slit of their length; round ones fans, a circle a round wing.

use std::f64::consts::PI;

use dioptric_psf::PupilEdges;
use rayon::prelude::*;

use crate::beyond::{Beyond, POINTS};

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
    /// Of a round pupil: all alike.
    pub(crate) fn round() -> Self {
        Self { per_rad: vec![0.5 / PI; DIRECTIONS], width_lambda_n: 0.0 }
    }

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

/// The wing of a point of light 1 in a band, of sum 1.
pub(crate) struct Wing<'a> {
    directions: &'a Directions,
    beyond: &'a Beyond,
}

impl<'a> Wing<'a> {
    pub(crate) fn new(directions: &'a Directions, beyond: &'a Beyond) -> Self {
        Self { directions, beyond }
    }

    /// Returns the wing about the first value of a rectangle of so many rows and columns that goes on around its edges, on pixels so many times as wide
    /// as the film's.
    pub(crate) fn rectangle(&self, reach: (usize, usize), size: (usize, usize), wide: f64) -> Vec<f32> {
        let mut values = vec![0.0; size.0 * size.1];
        let pixel = self.pixel(reach.0.max(reach.1), wide);
        let (lower, upper) = values.split_at_mut(reach.0 * size.1);
        lower.par_chunks_mut(size.1).enumerate().for_each(|(down, line)| {
            line[0] = pixel(down as f64, 0.0) as f32;
            for right in 1..reach.1 {
                line[right] = pixel(down as f64, right as f64) as f32;
                line[size.1 - right] = pixel(down as f64, -(right as f64)) as f32;
            }
        });
        // The upper half is the lower one turned.
        let n = upper.len() / size.1;
        upper.par_chunks_mut(size.1).enumerate().for_each(|(row, line)| {
            let down = n - row;
            if let Some(turned) = lower.chunks_exact(size.1).nth(down).filter(|_| down < reach.0) {
                line[0] = turned[0];
                line[1..].iter_mut().zip(turned[1..].iter().rev()).for_each(|(value, turned)| *value = *turned);
            }
        });
        values
    }

    /// Returns what gives the part of a wing on a pixel, so many below and to the right of its middle, up to a distance; pixels are so many times as wide
    /// as the film's.
    fn pixel(&self, reach: usize, wide: f64) -> impl Fn(f64, f64) -> f64 + Sync + use<'a> {
        // No spike is narrower than a pixel.
        let width_px = (self.directions.width_lambda_n * self.beyond.lambda_n_px / wide).max(1.0);
        let n_levels = (reach as f64 * 2_f64.sqrt()).log2().ceil().max(0.0) as usize + 2;
        let levels: Vec<Vec<f32>> = (0..n_levels)
            .into_par_iter()
            .map(|level| self.directions.widened(width_px / (level as f64).exp2()))
            .collect();
        let density = self.beyond.density();
        let at = move |down: f64, right: f64| {
            let r = down.hypot(right);
            let round = wide * wide * density(wide * r);
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
        move |down: f64, right: f64| {
            if down.hypot(right) > POINTS as f64 {
                return at(down, right);
            }
            let point = |i: usize| (i as f64 + 0.5) / POINTS as f64 - 0.5;
            let points = (0..POINTS * POINTS).map(|i| at(down + point(i / POINTS), right + point(i % POINTS)));
            points.sum::<f64>() / (POINTS * POINTS) as f64
        }
    }
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
        let directions = Directions::of(&edges(5.0));
        let wing = Wing::new(&directions, &beyond);
        let of_pixel = wing.pixel(reach, 1.0);
        let drawn = |place: DVec2| share * of_pixel(-place.y / pixel, place.x / pixel) / (pixel * pixel);
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

    /// Of a round edge a star is a round wing.
    #[test]
    fn stars_of_round_edges_are_round() {
        let piece = |i: i32| {
            let across_rad = [f64::from(i), f64::from(i + 1)].map(|deg| deg.to_radians());
            EdgePiece { length_mm: 1.0, across_rad }
        };
        let edges = PupilEdges { pieces: (0..360).map(piece).collect(), diameter_mm: 360.0 / PI };
        let beyond = Beyond::from_step(0.01, 5.0, 0.5);
        let (pieces, round) = (Directions::of(&edges), Directions::round());
        let [of_pieces, of_round] = [&pieces, &round].map(|directions| Wing::new(directions, &beyond).pixel(80, 1.0));
        for place in (0..900).map(|i| DVec2::from_angle(0.1 * f64::from(i)) * (6.0 + 0.08 * f64::from(i))) {
            let ratio = of_pieces(place.y, place.x) / of_round(place.y, place.x);
            assert!((ratio - 1.0).abs() < 1e-3, "{place}: {ratio}");
        }
    }
}
