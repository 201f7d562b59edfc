//! Highlights that are beyond what pixels hold.
//!
//! A light of more than a pixel holds saturates its channels one after the other, and clipping each by itself turns its hue: an
//! orange lamp becomes yellow, then white. Here the missing channels are found from the channels that are left and
//! the color of the bright surroundings, and where nothing is left the color alone is kept. The color is carried into what is
//! saturated, as far as its rim tells it (`rim`), by a pyramid of means that is filled from its coarse levels (Gortler et al., "The lumigraph", SIGGRAPH 1996,
//! "pull-push"); that color changes less than brightness where light is blown is what Zhang & Brainard ("Estimation of saturated
//! pixel values in digital color imaging", J. Opt. Soc. Am. A 21, 2004) rest on.

mod rim;

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::rim::{Blocks, part};
use crate::{SensorError, Tile, plane_rows::plane_rows};

/// What becomes of light beyond saturation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Highlights {
    /// Each channel is cut at the saturation of the least sensitive: hues turn, and all that is blown is white at most.
    Clip,
    /// Saturated channels are rebuilt from the others and the color about them; what is then brighter than white keeps its
    /// hue in the picture.
    #[default]
    Reconstruct,
}

impl Highlights {
    /// Returns the kind of a name: `clip` or `reconstruct`.
    ///
    /// # Errors
    /// When the name is another.
    pub fn parse(name: &str) -> Result<Self, SensorError> {
        match name.to_ascii_lowercase().as_str() {
            "clip" => Ok(Self::Clip),
            "reconstruct" => Ok(Self::Reconstruct),
            _ => Err(SensorError::Word {
                what: "a treatment of highlights",
                found: name.to_owned(),
                expected: "clip, reconstruct".to_owned(),
            }),
        }
    }
}

/// How far demosaicing carries a saturated sample, pixels.
const SPILL_PX: usize = 2;
/// A rebuilt channel is at most so many times its saturation.
const MOST: f32 = 16.0;
/// A channel next to a saturated sample is saturated itself from this share on; below, it is interpolated from others as well.
const SURE: f32 = 0.9;
/// Surroundings tell the color of what is blown where they are part of its glow: not at all up to the first of these shares of
/// saturation, by their largest channel, and fully from the second on. What is blown before a dim wall is white.
const GLOW: [f32; 2] = [0.3, 0.5];
/// Where two channels or more are left, the color about a pixel is its own up to the first of these distances (of the logarithms of its channels
/// from that color), and another's from the second on: white is assumed then.
const OTHER_HUE: [f32; 2] = [0.08, 0.3];
/// A glint is as small as pixels are apart: its filters see different parts of it, whatever is demosaiced. Its color is the mean over so many
/// pixels each way, all channels held to one level. What is blown within a wider window tells how small it is: all of a glint up to the first
/// of these numbers of pixels, none from the second on.
const GLINT_PX: usize = 2;
const AROUND_PX: usize = 4;
const GLINT_PIXELS: [f32; 2] = [12.0, 28.0];

/// Which channels are saturated in or next to each pixel, a bit a channel.
pub(crate) struct Saturated {
    bits: Array2<u32>,
    is_mosaic: bool,
}

impl Saturated {
    /// Returns the saturated channels of a raw frame in units of saturation, or `None` where there are none.
    pub(crate) fn find(planes: &[Array2<f32>], tile: Option<&Tile>, n_channels: usize, level: f32) -> Option<Self> {
        if n_channels > 32 || !planes.iter().any(|plane| plane.par_iter().any(|&v| v >= level)) {
            return None;
        }
        let (rows, columns) = planes[0].dim();
        let bit =
            |number: usize, row: usize, column: usize| 1_u32 << tile.map_or(number, |tile| tile.filter_at(row, column));
        let mut bits = Array2::<u32>::zeros((rows, columns));
        for (number, plane) in planes.iter().enumerate() {
            ndarray::Zip::indexed(&mut bits).and(plane).par_for_each(|(row, column), bits, &v| {
                if v >= level {
                    *bits |= bit(number, row, column);
                }
            });
        }
        // Stacked filters are not interpolated.
        let bits = if tile.is_some() { spread(&spread(&bits).reversed_axes()).reversed_axes() } else { bits };
        Some(Self { bits: bits.as_standard_layout().into_owned(), is_mosaic: tile.is_some() })
    }
}

/// Returns flags that are also set so many rows above and below.
fn spread(bits: &Array2<u32>) -> Array2<u32> {
    let (rows, columns) = bits.dim();
    let mut spread = Array2::<u32>::zeros((rows, columns));
    spread.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut out)| {
        for from in row.saturating_sub(SPILL_PX)..(row + SPILL_PX + 1).min(rows) {
            out.zip_mut_with(&bits.row(from), |out, &bits| *out |= bits);
        }
    });
    spread
}

/// Rebuilds the saturated channels of balanced light; `levels` is the balanced saturation of each channel.
///
/// First come pixels of which two channels or more are left, by the color of the unsaturated light about them; then those of which one or none
/// is, by the color of what was rebuilt next to them.
pub(crate) fn reconstruct(channels: &mut [Array2<f32>], saturated: &Saturated, levels: &[f64]) {
    let levels: Vec<f32> = levels.iter().map(|&level| level as f32).collect();
    let over = over(channels, &levels);
    let n = levels.len() as u32;
    let n_left = |over: u32| n - over.count_ones();
    let colors = surrounding_colors(channels, &levels, &over.mapv(|over| over == 0));
    rebuild(
        channels,
        (saturated, &over),
        &levels,
        |over| n_left(over) >= 2,
        |row, column| (colors.at(row, column), 1.0),
    );
    if over.iter().any(|&over| n_left(over) < 2) {
        let told = Blocks::new(channels, &levels, SURE).told(GLOW[1]);
        let colors = surrounding_colors(channels, &levels, &over.mapv(|over| n_left(over) >= 2));
        let known = |row: usize, column: usize| (colors.at(row, column), told[(row / 2) * colors.columns + column / 2]);
        rebuild(channels, (saturated, &over), &levels, |over| n_left(over) < 2, known);
    }
    if saturated.is_mosaic {
        even_glints(channels, saturated, &levels);
    }
}

/// Returns which channels of each pixel are surely saturated where they are next to a saturated sample, a bit a channel.
fn over(channels: &[Array2<f32>], levels: &[f32]) -> Array2<u32> {
    let mut over = Array2::zeros(channels[0].dim());
    for (k, (plane, level)) in channels.iter().zip(levels).enumerate() {
        ndarray::Zip::from(&mut over).and(plane).par_for_each(|over, &v| *over |= u32::from(v >= SURE * level) << k);
    }
    over
}

/// Rebuilds the pixels that are wanted by their channels that are over, with a color for each and how far it is known, 0 to 1.
fn rebuild<'a>(
    channels: &mut [Array2<f32>],
    (saturated, over): (&Saturated, &Array2<u32>),
    levels: &[f32],
    is_wanted: impl Fn(u32) -> bool + Sync,
    color_at: impl Fn(usize, usize) -> (&'a [f32], f32) + Sync,
) {
    let columns = over.ncols();
    plane_rows(channels).into_par_iter().enumerate().for_each(|(row, mut line)| {
        let mut mixed = vec![0.0; levels.len()];
        for column in 0..columns {
            let blown = saturated.bits[(row, column)] & over[(row, column)];
            if blown == 0 || !is_wanted(over[(row, column)]) {
                continue;
            }
            let is_saturated = |k: usize| blown >> k & 1 == 1;
            let (color, known) = color_at(row, column);
            let own_scale = scale(&line, column, color, levels, &is_saturated);
            let left = || (0..levels.len()).filter(|k| !is_saturated(*k));
            let off = left()
                .filter(|k| color[*k] > 0.0)
                .map(|k| (line[k][column].max(1e-6) / (own_scale * color[k])).ln().abs())
                .fold(0.0, f32::max);
            // The color about it, as far as it is this pixel's, and white.
            let is_own = known * (1.0 - part(off, OTHER_HUE));
            let white = (1.0 - is_own) / color.len() as f32;
            mixed.iter_mut().zip(color).for_each(|(mixed, own)| *mixed = is_own * own + white);
            let scale = scale(&line, column, &mixed, levels, &is_saturated);
            // Of two channels that are left the lesser: light that saturates the most sensitive filter, green, and has less of it than of both others is
            // next to never seen, and what is wrong with a color shows as such purple.
            let least =
                if left().count() >= 2 { left().map(|k| line[k][column]).fold(f32::INFINITY, f32::min) } else { 0.0 };
            for (k, line) in line.iter_mut().enumerate().filter(|(k, _)| is_saturated(*k)) {
                line[column] = (scale * mixed[k]).max(least).min(MOST * levels[k]).max(line[column]);
            }
        }
    });
}

/// Gives glints the mean color about them, as bright as each pixel is.
fn even_glints(channels: &mut [Array2<f32>], saturated: &Saturated, levels: &[f32]) {
    let (rows, columns) = saturated.bits.dim();
    let level = levels.iter().copied().fold(f32::INFINITY, f32::min);
    let n = channels.len();
    let around = |i: usize, reach: usize, all: usize| i.saturating_sub(reach)..(i + reach + 1).min(all);
    let seen: &[Array2<f32>] = channels;
    let is_blown =
        |row: usize, column: usize| seen.iter().zip(levels).any(|(plane, level)| plane[(row, column)] >= SURE * level);
    let of_row = |row: usize| {
        let mut evened = Vec::new();
        for column in (0..columns).filter(|column| saturated.bits[(row, *column)] != 0) {
            let (down, across) = (around(row, AROUND_PX, rows), around(column, AROUND_PX, columns));
            let blown = down.flat_map(|r| across.clone().map(move |c| (r, c))).filter(|&(r, c)| is_blown(r, c)).count();
            let [few, many] = GLINT_PIXELS;
            let part = ((many - blown as f32) / (many - few)).clamp(0.0, 1.0);
            if part == 0.0 {
                continue;
            }
            let mut color = vec![0.0_f32; n];
            for r in around(row, GLINT_PX, rows) {
                for c in around(column, GLINT_PX, columns) {
                    color.iter_mut().zip(seen).for_each(|(sum, plane)| *sum += plane[(r, c)].clamp(0.0, level));
                }
            }
            let total: f32 = color.iter().sum();
            let brightness: f32 = seen.iter().map(|plane| plane[(row, column)].max(0.0)).sum();
            if total > 0.0 {
                let own = |k: usize| seen[k][(row, column)];
                let values = (0..n).map(|k| own(k) + part * (brightness * color[k] / total - own(k)));
                evened.push((column, values.collect::<Vec<f32>>()));
            }
        }
        evened
    };
    let evened: Vec<Vec<(usize, Vec<f32>)>> = (0..rows).into_par_iter().map(of_row).collect();
    for (row, places) in evened.into_iter().enumerate() {
        for (column, values) in places {
            channels.iter_mut().zip(values).for_each(|(plane, value)| plane[(row, column)] = value);
        }
    }
}

/// Returns what the surrounding color is multiplied by at one pixel.
fn scale(
    line: &[&mut [f32]],
    column: usize,
    color: &[f32],
    levels: &[f32],
    is_saturated: &dyn Fn(usize) -> bool,
) -> f32 {
    let (mut left, mut of_color) = (0.0, 0.0);
    for (k, line) in line.iter().enumerate().filter(|(k, _)| !is_saturated(*k)) {
        left += line[column].max(0.0);
        of_color += color[k];
    }
    if of_color > 0.0 {
        return left / of_color;
    }
    // Nothing is left: the least light of this color that saturates every channel.
    let needed = color.iter().zip(levels).map(|(&color, &level)| if color > 0.0 { level / color } else { 0.0 });
    needed.fold(0.0, f32::max)
}

/// Colors of unsaturated light, carried into what is saturated, on a raster of half the resolution.
struct Colors {
    columns: usize,
    n_channels: usize,
    /// For each place the channels, which sum to 1.
    values: Vec<f32>,
}

impl Colors {
    fn at(&self, row: usize, column: usize) -> &[f32] {
        let first = ((row / 2) * self.columns + column / 2) * self.n_channels;
        &self.values[first..first + self.n_channels]
    }
}

/// One level of the pyramid: for each place the sums of the channels and of their weights.
struct Level {
    rows: usize,
    columns: usize,
    sums: Vec<f32>,
}

/// Returns the colors of places that are sources, carried into all others.
fn surrounding_colors(channels: &[Array2<f32>], levels: &[f32], is_source: &Array2<bool>) -> Colors {
    let n = channels.len();
    let n_sums = n + 1;
    // The color at a place is the mean of light weighted by the square of its brightness: bright surroundings, up to the rim of what
    // is blown, are part of it.
    let (rows, columns) = is_source.dim();
    let (half_rows, half_columns) = (rows.div_ceil(2), columns.div_ceil(2));
    let mut sums = vec![0.0_f32; half_rows * half_columns * n_sums];
    sums.par_chunks_mut(half_columns * n_sums).enumerate().for_each(|(half_row, line)| {
        for (half_column, place) in line.chunks_exact_mut(n_sums).enumerate() {
            for row in 2 * half_row..(2 * half_row + 2).min(rows) {
                for column in 2 * half_column..(2 * half_column + 2).min(columns) {
                    if is_source[(row, column)] {
                        let brightness: f32 = channels.iter().map(|plane| plane[(row, column)].max(0.0)).sum();
                        for (sum, plane) in place.iter_mut().zip(channels) {
                            *sum += brightness * brightness * plane[(row, column)].max(0.0);
                        }
                        place[n] += brightness * brightness;
                    }
                }
            }
        }
    });
    let mut pyramid = vec![Level { rows: half_rows, columns: half_columns, sums }];
    while pyramid.last().is_some_and(|level| level.rows > 1 || level.columns > 1) {
        let finer = &pyramid[pyramid.len() - 1];
        pyramid.push(finer.halved(n_sums));
    }
    // From the coarsest down, places without light take the color of the place above them.
    for index in (0..pyramid.len() - 1).rev() {
        let (finer, coarser) = pyramid.split_at_mut(index + 1);
        finer[index].fill_from(&coarser[0], n_sums);
    }
    let Level { columns, sums, .. } = pyramid.swap_remove(0);
    let mut values = vec![0.0; sums.len() / n_sums * n];
    values.par_chunks_exact_mut(n).zip(sums.par_chunks_exact(n_sums)).for_each(|(color, place)| {
        let (sums, weight) = (&place[..n], place[n]);
        let sum: f32 = sums.iter().sum();
        let share = sums.iter().zip(levels).map(|(sum, level)| sum / (weight * level)).fold(0.0, f32::max);
        let known = if weight > 0.0 && sum > 0.0 { part(share, GLOW) } else { 0.0 };
        let white = (1.0 - known) / n as f32;
        color
            .iter_mut()
            .zip(sums)
            .for_each(|(v, own)| *v = if known > 0.0 { known * own / sum + white } else { white });
    });
    Colors { columns, n_channels: n, values }
}

impl Level {
    /// Returns the level of half as many rows and columns.
    fn halved(&self, n: usize) -> Self {
        let (rows, columns) = (self.rows.div_ceil(2), self.columns.div_ceil(2));
        let mut sums = vec![0.0; rows * columns * n];
        sums.par_chunks_mut(columns * n).enumerate().for_each(|(row, line)| {
            for fine_row in 2 * row..(2 * row + 2).min(self.rows) {
                for fine_column in 0..self.columns {
                    let from = (fine_row * self.columns + fine_column) * n;
                    let to = fine_column / 2 * n;
                    for k in 0..n {
                        line[to + k] += self.sums[from + k];
                    }
                }
            }
        });
        Self { rows, columns, sums }
    }

    /// Gives places without light the mean of the four places of the coarser level about them.
    fn fill_from(&mut self, coarser: &Self, n: usize) {
        let columns = self.columns;
        self.sums.par_chunks_mut(columns * n).enumerate().for_each(|(row, line)| {
            for (column, place) in line.chunks_exact_mut(n).enumerate() {
                if place.iter().all(|v| *v == 0.0) {
                    let beside = |i: usize, last: usize| {
                        let other = if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { i / 2 + 1 };
                        [(i / 2, 0.75), (other.min(last), 0.25)]
                    };
                    for (r, down) in beside(row, coarser.rows - 1) {
                        for (c, across) in beside(column, coarser.columns - 1) {
                            let from = (r * coarser.columns + c) * n;
                            for (k, v) in place.iter_mut().enumerate() {
                                *v += 0.25 * down * across * coarser.sums[from + k];
                            }
                        }
                    }
                }
            }
        });
    }
}

/// Returns light of at most 1 in every part: what is brighter is dimmed as a whole, so that it keeps its hue.
#[inline]
pub(crate) fn dimmed([r, g, b]: [f32; 3]) -> [f32; 3] {
    let most = r.max(g).max(b);
    if most > 1.0 { [r / most, g / most, b / most] } else { [r, g, b] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cfa;

    /// A lamp of one color, brightest in the middle, on a dim ground of another.
    fn lamp(color: [f32; 3], peak: f32) -> [Array2<f32>; 3] {
        [0, 1, 2].map(|k| {
            Array2::from_shape_fn((60, 80), |(r, c)| {
                let squared = (r as f32 - 29.5).powi(2) + (c as f32 - 39.5).powi(2);
                peak * color[k] * (-squared / 200.0).exp() + [0.004, 0.006, 0.01][k]
            })
        })
    }

    #[test]
    fn a_blown_lamp_keeps_its_color() {
        let (truth, levels) = (lamp([1.0, 0.5, 0.19], 4.0), [1.5, 1.0, 1.3]);
        let mut channels = truth.clone().map(|plane| plane.to_owned());
        for (plane, level) in channels.iter_mut().zip(levels) {
            plane.mapv_inplace(|v| v.min(level as f32));
        }
        let shares: Vec<Array2<f32>> = channels.iter().zip(levels).map(|(p, level)| p / level as f32).collect();
        let saturated = Saturated::find(&shares, None, 3, 0.999).unwrap();
        reconstruct(&mut channels, &saturated, &levels);
        for (row, column) in [(30, 40), (30, 46), (25, 33), (36, 40)] {
            let [r, g, b] = [0, 1, 2].map(|k| channels[k][(row, column)]);
            let [tr, tg, tb] = [0, 1, 2].map(|k| truth[k][(row, column)]);
            // Blue never saturates: it shows how bright the lamp is. The ground mixes in by less than a tenth.
            assert!((r / tr - 1.0).abs() < 0.1 && (g / tg - 1.0).abs() < 0.1 && b == tb, "{r} {g} {b}: {tr} {tg} {tb}");
        }
    }

    #[test]
    fn all_blown_is_of_the_color_around() {
        let levels = [1.0; 3];
        let mut channels = lamp([1.0, 0.5, 0.19], 40.0).map(|plane| plane.mapv(|v| v.min(1.0)));
        let saturated = Saturated::find(&channels, None, 3, 0.999).unwrap();
        reconstruct(&mut channels, &saturated, &levels);
        let [r, g, b] = dimmed([0, 1, 2].map(|k| channels[k][(30, 40)]));
        assert!(r == 1.0 && (g - 0.5).abs() < 0.05 && (b - 0.19).abs() < 0.04, "{r} {g} {b}");
    }

    /// The teal of a wall is no evidence of the bulb before it.
    #[test]
    fn all_blown_before_a_dim_wall_is_white() {
        let wall = [0.12, 0.2, 0.21];
        let mut channels =
            [0, 1, 2].map(|k| {
                Array2::from_shape_fn((60, 80), |(r, c)| {
                    if (r as f32 - 29.5).hypot(c as f32 - 39.5) < 9.0 { 1.0 } else { wall[k] }
                })
            });
        let saturated = Saturated::find(&channels, None, 3, 0.999).unwrap();
        reconstruct(&mut channels, &saturated, &[1.0; 3]);
        assert_eq!(dimmed([0, 1, 2].map(|k| channels[k][(30, 40)])), [1.0; 3]);
        assert_eq!([0, 1, 2].map(|k| channels[k][(5, 5)]), wall);
    }

    /// A wide white wall under light that fades to one side, a red book before it: what is blown of the wall has no part of the book's color, nor has
    /// the strip in which the wall's green alone is blown.
    #[test]
    fn a_wide_blown_wall_is_white_beside_a_book() {
        // White gives red and blue less than green by these.
        let levels = [2.6_f32, 1.0, 1.5];
        let light = |r: usize, c: usize| {
            let (wall, is_book) = (6.0 - 0.05 * c as f32, (30..60).contains(&r) && (20..50).contains(&c));
            if is_book { [0.45 * wall, 0.16 * wall, 0.12 * wall] } else { [wall; 3] }
        };
        let mut channels = [0, 1, 2].map(|k| Array2::from_shape_fn((90, 120), |(r, c)| light(r, c)[k].min(levels[k])));
        let shares: Vec<Array2<f32>> = channels.iter().zip(levels).map(|(plane, level)| plane / level).collect();
        let saturated = Saturated::find(&shares, None, 3, 0.999).unwrap();
        reconstruct(&mut channels, &saturated, &levels.map(f64::from));
        for (row, column) in [(10, 10), (45, 12), (45, 60), (70, 80), (45, 99), (20, 105), (80, 118)] {
            let [r, g, b] = dimmed([0, 1, 2].map(|k| channels[k][(row, column)]));
            assert!(r.min(g).min(b) > 0.95 * r.max(g).max(b), "{row} {column}: {r} {g} {b}");
        }
    }

    /// Glints of white light on gray, smaller than the mosaic's tile, at every phase of it.
    #[test]
    fn small_glints_end_white() {
        let tile = Cfa::two_by_two("RGGB").unwrap().resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        let gains = [2.0_f32, 1.0, 1.6];
        let places: Vec<(f32, f32)> =
            (0..16).map(|i| (12.0 + 20.25 * (i / 4) as f32, 12.0 + 20.75 * (i % 4) as f32)).collect();
        // White gives each filter less by its gain; pixels hold 1.
        let light = |r: usize, c: usize| {
            let glint = |&(y, x): &(f32, f32)| {
                let squared = (r as f32 - y).powi(2) + (c as f32 - x).powi(2);
                7.0 * (-squared / (2.0 * 0.75 * 0.75)).exp()
            };
            0.08 + places.iter().map(glint).sum::<f32>()
        };
        let raw = Array2::from_shape_fn((96, 96), |(r, c)| (light(r, c) / gains[tile.filter_at(r, c)]).min(1.0));
        let saturated = Saturated::find(std::slice::from_ref(&raw), Some(&tile), 3, 0.998).unwrap();
        let balanced = Array2::from_shape_fn((96, 96), |(r, c)| raw[(r, c)] * gains[tile.filter_at(r, c)]);
        let mut channels = crate::demosaic(&balanced, &tile, 3, crate::Demosaic::DirectionalRatio).unwrap();
        // A pixel is colored where its parts differ by a third of the largest, and bright enough to be seen so.
        let colored = |channels: &[Array2<f32>]| {
            let bright = |&(r, c): &(usize, usize)| {
                let parts = dimmed([0, 1, 2].map(|k| channels[k][(r, c)]));
                let (least, most) = parts.iter().fold((1.0_f32, 0.0_f32), |(a, b), v| (a.min(*v), b.max(*v)));
                most > 0.4 && least < 0.67 * most
            };
            (0..96).flat_map(|r| (0..96).map(move |c| (r, c))).filter(bright).count()
        };
        let before = colored(&channels);
        reconstruct(&mut channels, &saturated, &gains.map(f64::from));
        let after = colored(&channels);
        assert!(before > 20 && after * 10 <= before, "{after} of {before} pixels are colored");
    }

    #[test]
    fn a_frame_below_saturation_has_none() {
        let planes = [Array2::from_elem((6, 6), 0.9)];
        let tile = Cfa::two_by_two("RGGB").unwrap().resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        assert!(Saturated::find(&planes, Some(&tile), 3, 0.99).is_none());
        let mut one = planes[0].clone();
        one[(2, 2)] = 1.0;
        let found = Saturated::find(&[one], Some(&tile), 3, 0.99).unwrap();
        // Red, and as far as interpolation carries it.
        assert_eq!((found.bits[(0, 0)], found.bits[(4, 4)], found.bits[(5, 2)], found.bits[(2, 5)]), (1, 1, 0, 0));
    }
}
