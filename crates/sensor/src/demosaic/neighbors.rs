//! Any mosaic: colors by the ratios of neighboring pixels behind different filters.
//!
//! On a logarithmic scale a pixel is x = y + r, y the light that all colors share and r that of its filter's color, which changes less from
//! place to place. Two neighbors behind other filters differ by the light and by the color: about a place the mean of such differences is that
//! of the colors, since the light rises as often as it falls. Each pair of filters has the mean of nine windows about
//! the pixel, those in which differences agree before others (Kuwahara et al., 1976), and the colors are what fits all pairs best.
//! Further rounds weigh each two neighbors by how alike their light x − r was found. So every pixel tells the light,
//! and each color is y + r of its filter: exactly, wherever the color does not change within the windows.
//!
//! Where windows disagree, the color does change, and the plane of a tent with each pixel's own detail takes over.

use ndarray::Array2;
use rayon::prelude::*;

use super::{
    padded::{Block, mirrored_places},
    ratio::{scaled, unscaled},
    tent,
};
use crate::Tile;

/// Rows and columns of a block, small enough for the cache.
const BLOCK: (usize, usize) = (64, 128);
/// Rounds of means.
const ROUNDS: usize = 3;
/// The least radius of a window, pixels: that of a tent, which lies at the pixel or as far beside it.
const LEAST_RADIUS: usize = 2;
/// Neighbors whose light differs by this much, in logarithms, count half.
const LIGHT_STEP: f32 = 0.2;
/// Differences of neighbors that vary by less than this, in logarithms, are as good as equal.
const LEAST_DEVIATION: f32 = 0.01;
/// Windows that disagree by this much, in logarithms, count half of the pixel's color.
const COLOR_STEP: f32 = 0.5;
/// A pixel's neighbors to the right and below, each with its weight: all pairs of neighbors once.
const NEIGHBORS: [(isize, isize, f32); 4] = [(0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.5), (1, -1, 0.5)];

/// Returns one plane a channel.
pub(super) fn demosaic(values: &Array2<f32>, tile: &Tile, n_channels: usize) -> Vec<Array2<f32>> {
    let mut planes = tent::with_detail(values, tile, n_channels);
    let radius = radius(tile);
    let margin = ROUNDS * (1 + 2 * radius);
    let (n_rows, n_columns) = values.dim();
    let x = ndarray::Zip::from(values).par_map_collect(|&v| scaled(v));
    let mut strips: Vec<Vec<&mut [f32]>> = (0..n_rows.div_ceil(BLOCK.0)).map(|_| Vec::new()).collect();
    for plane in &mut planes {
        let all = plane.as_slice_mut().expect("a new array is contiguous");
        all.chunks_mut(BLOCK.0 * n_columns).zip(&mut strips).for_each(|(chunk, strip)| strip.push(chunk));
    }
    strips.into_par_iter().enumerate().for_each(|(number, mut out)| {
        let first_row = number * BLOCK.0;
        let n_strip_rows = out[0].len() / n_columns;
        for first_column in (0..n_columns).step_by(BLOCK.1) {
            let size = (n_strip_rows, BLOCK.1.min(n_columns - first_column));
            let block = Block::cut(&x, (first_row, first_column), size, margin);
            let rows = mirrored_places(first_row, size.0, margin, n_rows);
            let columns = mirrored_places(first_column, size.1, margin, n_columns);
            let filters = rows.iter().flat_map(|&row| columns.iter().map(move |&column| tile.filter_at(row, column)));
            let mosaic =
                Mosaic { x: &block.values, filters: filters.collect(), width: block.width, n_channels, radius };
            let Colors { r, doubt } = mosaic.colors();
            for (row, column) in (0..size.0).flat_map(|row| (0..size.1).map(move |column| (row, column))) {
                let (i, to) = ((row + margin) * block.width + column + margin, row * n_columns + first_column + column);
                let light = block.values[i] - r[mosaic.filters[i]][i];
                for (plane, r) in out.iter_mut().zip(&r) {
                    let by_tent = scaled(plane[to]);
                    plane[to] = unscaled(by_tent + (1.0 - doubt[i]) * (light + r[i] - by_tent));
                }
                // What was measured stays.
                out[mosaic.filters[i]][to] = values[(first_row + row, first_column + column)];
            }
        }
    });
    planes
}

/// Returns the radius of windows that see each pair of filters: the side of the widest block of one filter, and half of the way to
/// the farthest.
fn radius(tile: &Tile) -> usize {
    let (rows, columns) = (tile.rows(), tile.columns());
    let at = |row: usize, column: usize| tile.filter_at(row % rows, column % columns);
    let places = || (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let is_block = |(row, column): (usize, usize), side: usize| {
        (0..side * side).all(|i| at(row + i / side, column + i % side) == at(row, column))
    };
    let widest = (1..=rows.min(columns)).take_while(|&side| places().any(|place| is_block(place, side))).last();
    let farthest = places().flat_map(|(row, column)| {
        (0..tile.n_filters()).filter_map(move |filter| {
            (0..=rows.max(columns)).find(|&reach| {
                let (tall, wide) = (reach.min(rows), reach.min(columns));
                let near = (0..=2 * tall).flat_map(|r| (0..=2 * wide).map(move |c| (r, c)));
                near.into_iter().any(|(r, c)| at(row + rows + r - tall, column + columns + c - wide) == filter)
            })
        })
    });
    LEAST_RADIUS.max(widest.unwrap_or(1)).max(farthest.max().unwrap_or(0).div_ceil(2))
}

/// A part of a mosaic on a logarithmic scale, row by row.
struct Mosaic<'a> {
    x: &'a [f32],
    filters: Vec<usize>,
    width: usize,
    n_channels: usize,
    radius: usize,
}

/// What was found about each pixel; nothing in the margin.
struct Colors {
    /// Each channel less the one with most pixels, in logarithms.
    r: Vec<Vec<f32>>,
    /// How far the windows disagree, 0 to 1.
    doubt: Vec<f32>,
}

/// Weights, differences and their squares of the neighbors behind two filters.
#[derive(Clone)]
struct Pair {
    filters: [usize; 2],
    sums: [Vec<f32>; 3],
}

impl Mosaic<'_> {
    fn colors(&self) -> Colors {
        let n = self.x.len();
        let mut colors = Colors { r: vec![vec![0.0; n]; self.n_channels], doubt: vec![0.0; n] };
        for round in 0..ROUNDS {
            let light: Vec<f32> = (0..n).map(|i| self.x[i] - colors.r[self.filters[i]][i]).collect();
            let pairs = self.pairs(|i, j| {
                let step = light[i] - light[j];
                if round == 0 { 1.0 } else { (1.0 + (step / LIGHT_STEP).powi(2)).recip() }
            });
            self.fit(&pairs, (round + 1) * (1 + 2 * self.radius), &mut colors);
        }
        colors
    }

    /// Returns the differences of neighbors behind different filters, weighted, under a tent about each pixel.
    fn pairs(&self, weight: impl Fn(usize, usize) -> f32) -> Vec<Pair> {
        let (n, w) = (self.x.len(), self.width);
        let mut pairs: Vec<Pair> = Vec::new();
        let mut number = vec![usize::MAX; self.n_channels * self.n_channels];
        for row in 1..n / w - 1 {
            for i in row * w + 1..(row + 1) * w - 1 {
                for (down, right, share) in NEIGHBORS {
                    let j = i.wrapping_add_signed(down * w as isize + right);
                    let (a, b) = (self.filters[i], self.filters[j]);
                    if a == b {
                        continue;
                    }
                    let filters = [a.min(b), a.max(b)];
                    let slot = &mut number[filters[0] * self.n_channels + filters[1]];
                    if *slot == usize::MAX {
                        *slot = pairs.len();
                        pairs.push(Pair { filters, sums: [0; 3].map(|_| vec![0.0; n]) });
                    }
                    let [weights, differences, squares] = &mut pairs[*slot].sums;
                    let d = if a < b { self.x[i] - self.x[j] } else { self.x[j] - self.x[i] };
                    let share = share * weight(i, j);
                    // It lies between the two.
                    for at in [i, j] {
                        weights[at] += share;
                        differences[at] += share * d;
                        squares[at] += share * d * d;
                    }
                }
            }
        }
        let mut scratch = vec![0.0; n];
        for sum in pairs.iter_mut().flat_map(|pair| &mut pair.sums) {
            under_tent(sum, &mut scratch, 1, self.radius);
            under_tent(sum, &mut scratch, w, self.radius);
        }
        pairs
    }

    /// Fits colors to the means of all pairs, in all pixels that are not within `margin` of the border.
    fn fit(&self, pairs: &[Pair], margin: usize, colors: &mut Colors) {
        let (w, n_channels) = (self.width, self.n_channels);
        let mut n_of = vec![0_usize; n_channels];
        self.filters.iter().for_each(|&filter| n_of[filter] += 1);
        let first = (0..n_channels).max_by_key(|&channel| n_of[channel]).unwrap_or(0);
        let steps = [-(self.radius as isize), 0, self.radius as isize];
        let mut windows = [0_isize; 9];
        for (k, window) in windows.iter_mut().enumerate() {
            *window = steps[k / 3] * w as isize + steps[k % 3];
        }
        let mut system = vec![0.0_f32; n_channels * (n_channels + 1)];
        for row in margin..self.x.len() / w - margin {
            for i in row * w + margin..(row + 1) * w - margin {
                system.fill(0.0);
                let mut spread = 0.0;
                for Pair { filters: [a, b], sums: [weights, differences, squares] } in pairs {
                    let (mut of_all, mut sum, mut square, mut total) = (0.0, 0.0, 0.0, 0.0);
                    for window in windows {
                        let j = i.wrapping_add_signed(window);
                        if weights[j] > LEAST_WEIGHT {
                            let mean = differences[j] / weights[j];
                            let variance = (squares[j] / weights[j] - mean * mean).max(0.0);
                            let agreement = variance + LEAST_DEVIATION * LEAST_DEVIATION;
                            let share = (agreement * agreement.sqrt()).recip();
                            sum += share * mean;
                            square += share * mean * mean;
                            total += share;
                            of_all += weights[j];
                        }
                    }
                    if total > 0.0 {
                        let mean = sum / total;
                        spread += (square / total - mean * mean).max(0.0);
                        // Least squares of the difference of the two colors to the mean.
                        let mut add = |row: usize, column: usize, value: f32| {
                            system[row * (n_channels + 1) + column] += value;
                        };
                        add(*a, *a, of_all);
                        add(*b, *b, of_all);
                        add(*a, *b, -of_all);
                        add(*b, *a, -of_all);
                        add(*a, n_channels, of_all * mean);
                        add(*b, n_channels, -of_all * mean);
                    }
                }
                solve(&mut system, n_channels, first);
                for (channel, r) in colors.r.iter_mut().enumerate() {
                    r[i] = system[channel * (n_channels + 1) + n_channels];
                }
                colors.doubt[i] = spread / (spread + COLOR_STEP * COLOR_STEP);
            }
        }
    }
}

/// Below this there is nothing under a tent.
const LEAST_WEIGHT: f32 = 1e-4;

/// Averages a plane under a tent along one direction.
fn under_tent(plane: &mut [f32], scratch: &mut [f32], step: usize, radius: usize) {
    let reach = radius * step;
    let total = ((radius + 1) * (radius + 1)) as f32;
    for i in reach..plane.len() - reach {
        let mut sum = (radius + 1) as f32 * plane[i];
        for k in 1..=radius {
            sum += (radius + 1 - k) as f32 * (plane[i - k * step] + plane[i + k * step]);
        }
        scratch[i] = sum / total;
    }
    plane[reach..].iter_mut().zip(&scratch[reach..]).for_each(|(v, mean)| *v = *mean);
}

/// Solves the rows for the unknowns of all channels but one, which is 0; so is what nothing is known of.
fn solve(system: &mut [f32], n: usize, zero: usize) {
    let width = n + 1;
    for channel in 0..n {
        system[channel * width + zero] = 0.0;
        system[zero * width + channel] = 0.0;
    }
    system[zero * width + n] = 0.0;
    for pivot in 0..n {
        let diagonal = system[pivot * width + pivot];
        if diagonal <= LEAST_WEIGHT {
            // Nothing ties it to the others.
            (0..=n).for_each(|column| system[pivot * width + column] = 0.0);
            continue;
        }
        for row in (0..n).filter(|row| *row != pivot) {
            let factor = system[row * width + pivot] / diagonal;
            if factor != 0.0 {
                for column in pivot..=n {
                    system[row * width + column] -= factor * system[pivot * width + column];
                }
            }
        }
        for column in 0..=n {
            system[pivot * width + column] /= diagonal;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cfa;

    fn tiles() -> [(&'static str, Tile); 4] {
        let tile = |cfa: Cfa| cfa.resolve("a test", &["R", "G", "B"]).unwrap().unwrap();
        let rows = ["GGRGGB", "GGBGGR", "BRGRBG", "GGBGGR", "GGRGGB", "RBGBRG"];
        let x_trans = Cfa::Mosaic(rows.map(|row| row.chars().map(String::from).collect()).to_vec());
        let repeated = |n| Cfa::two_by_two("RGGB").unwrap().repeated(n);
        [("X-Trans", x_trans), ("quad", repeated(2)), ("nona", repeated(3)), ("sixteen", repeated(4))]
            .map(|(name, cfa)| (name, tile(cfa)))
    }

    fn mosaic(planes: &[Array2<f32>; 3], tile: &Tile) -> Array2<f32> {
        Array2::from_shape_fn(planes[0].dim(), |(r, c)| planes[tile.filter_at(r, c)][(r, c)])
    }

    /// Root of the mean square over channels, as a share of 1.
    fn rms(found: &[Array2<f32>], planes: &[Array2<f32>; 3]) -> f64 {
        let squares = found.iter().zip(planes).flat_map(|(a, b)| (a - b).into_iter().map(|v| f64::from(v * v)));
        let n = 3.0 * planes[0].len() as f64;
        (squares.sum::<f64>() / n).sqrt()
    }

    /// A star of 24 spokes through a good lens: finer to the middle, where pixels tell nothing.
    fn star() -> Array2<f32> {
        Array2::from_shape_fn((192, 192), |(r, c)| {
            let (y, x) = (r as f32 - 95.7, c as f32 - 95.2);
            let distance = x.hypot(y);
            // A spoke's width in the units of the blur's, 0.6 pixels.
            let wave = (24.0 * y.atan2(x)).sin() * distance / 24.0 / 0.6;
            0.05 + 0.75 / (1.0 + (-2.0 * wave).exp())
        })
    }

    /// One hue, however far from balanced: detail is that of every pixel.
    #[test]
    fn light_of_one_hue_keeps_its_detail() {
        for levels in [[1.0, 1.0, 1.0], [0.9, 0.6, 0.3]] {
            let planes = levels.map(|level| star() * level);
            for (name, tile) in tiles() {
                let mosaic = mosaic(&planes, &tile);
                let found = rms(&demosaic(&mosaic, &tile, 3), &planes);
                let by_tent = rms(&tent::with_detail(&mosaic, &tile, 3), &planes);
                assert!(found < 0.5 * by_tent && found < 0.04, "{name} {levels:?}: {found} {by_tent}");
                println!("{name} {levels:?}: {found} {by_tent}");
            }
        }
    }

    /// Where one channel alone is lit there is no common light; it is as good as by the tent or better, and ends in no dots.
    #[test]
    fn edges_of_one_channel_are_no_worse() {
        let disc = Array2::from_shape_fn((96, 96), |(r, c)| {
            let distance = (r as f32 - 47.3).hypot(c as f32 - 47.6) - 30.0;
            0.03 + 0.87 / (1.0 + (distance / 0.5).exp())
        });
        for lit in 0..3 {
            let mut planes = [0; 3].map(|_| Array2::from_elem((96, 96), 0.03));
            planes[lit] = disc.clone();
            for (name, tile) in tiles() {
                let mosaic = mosaic(&planes, &tile);
                let [own, by_tent] = [demosaic(&mosaic, &tile, 3), tent::with_detail(&mosaic, &tile, 3)];
                println!("{name} {lit}: {} {}", rms(&own, &planes), rms(&by_tent, &planes));
                assert!(rms(&own, &planes) < rms(&by_tent, &planes), "{name} {lit}");
            }
        }
    }

    #[test]
    fn even_light_stays_even() {
        let planes = [0.8, 0.3, 0.1].map(|level| Array2::from_elem((40, 37), level));
        for (name, tile) in tiles() {
            let found = demosaic(&mosaic(&planes, &tile), &tile, 3);
            for (plane, expected) in found.iter().zip(&planes) {
                let worst = (plane - expected).into_iter().map(f32::abs).fold(0.0, f32::max);
                // Single precision of logarithms up to 5.
                assert!(worst < 2e-5, "{name}: {worst}");
            }
        }
    }

    #[test]
    fn windows_reach_every_filter() {
        let radii = tiles().map(|(_, tile)| radius(&tile));
        assert_eq!(radii, [2, 2, 3, 4]);
    }
}
