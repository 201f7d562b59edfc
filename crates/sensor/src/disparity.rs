//! How far the views of two photodiodes lie apart: phase detection by block matching.

use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;

use crate::{Raw, SensorError, Tile};

/// What smooths both views along the way that they are moved. Between samples of white noise there is less noise than at them, which draws
/// disparities to fractions of one half; with this it is the same everywhere to 1 %.
const SMOOTHING: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// The variance of white noise over what the smoothing leaves of it, 256/70: it leaves all of the slow part that blocks are matched by.
const SMOOTHED_VARIANCE: f64 = 256.0 / 70.0;
/// How far the best likeness may be from 1, over how far the best one elsewhere is.
const DISTINCT: f64 = 0.7;
/// Steps of the refinement between cells.
const MOST_STEPS: usize = 20;
/// A step this small is the last, cells.
const LEAST_STEP: f64 = 1e-5;
/// Residuals beyond so many standard deviations count by their magnitude alone (Huber).
const HUBER: f64 = 1.345;
/// How far the refinement may leave the best whole number of cells.
const FARTHEST: f64 = 1.5;

/// Along which axis two views lie apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisparityAxis {
    /// Left and right.
    Columns,
    /// Top and bottom.
    Rows,
}

/// How disparities are searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisparitySearch {
    /// The side of the square blocks that are matched, pixels; half of that lies between blocks.
    pub window_px: usize,
    /// The largest disparity that is searched for, pixels.
    pub most_px: usize,
}

impl Default for DisparitySearch {
    /// Blocks of 32 pixels, up to 64 pixels apart.
    fn default() -> Self {
        Self { window_px: 32, most_px: 64 }
    }
}

/// Disparities of two views, block by block.
#[derive(Clone, Debug, PartialEq)]
pub struct DisparityMap {
    /// The middle of the first block, pixels from the middle of the first pixel: row, column.
    pub first_px: [f64; 2],
    /// From block to block, pixels: rows, columns.
    pub step_px: [f64; 2],
    /// Place in the first view less that in the second, pixels: above 0 where the left view has a thing farther to the right than the right
    /// view, or the top one farther down than the bottom one. NaN where nothing is known.
    pub disparity_px: Array2<f32>,
    /// The standard error of each, from what is left of the difference of the views, pixels. NaN where nothing is known.
    pub standard_error_px: Array2<f32>,
}

impl DisparityMap {
    /// Returns the disparities whose standard error is at most so large, pixels, ascending.
    pub fn known_px(&self, most_error_px: f64) -> Vec<f64> {
        let of = self.disparity_px.iter().zip(&self.standard_error_px);
        let mut known: Vec<f64> =
            of.filter(|&(_, &error)| f64::from(error) <= most_error_px).map(|(&d, _)| f64::from(d)).collect();
        known.sort_by(f64::total_cmp);
        known
    }

    /// Measures how far two views of one exposure lie apart.
    ///
    /// Samples of a mosaic are averaged over its tile first, so that all filters count. For each block the whole number of cells is that of the
    /// largest correlation of the views smoothed that way, one brightened to the other's mean and their contrasts compared too; then disparity, gain and offset between
    /// the views are fitted by least squares between cells with both views moved half the way, outliers weighing less.
    ///
    /// # Errors
    /// When the frames differ in size or mosaic, or are smaller than a block.
    pub fn of([first, second]: [&Raw; 2], axis: DisparityAxis, search: &DisparitySearch) -> Result<Self, SensorError> {
        for frame in [first, second] {
            frame.check()?;
        }
        if first.size() != second.size() || first.tile != second.tile {
            let text = |raw: &Raw| format!("{} × {}", raw.size().0, raw.size().1);
            let (expected, found) = (text(first), text(second));
            return Err(SensorError::Shape { what: "rows × columns of the second of two views", expected, found });
        }
        let tile = first.tile.as_ref().map_or((1, 1), |tile| (tile.rows(), tile.columns()));
        let turned = |cells: Array2<f32>| if axis == DisparityAxis::Rows { cells.reversed_axes() } else { cells };
        let [a, b] = [first, second].map(|raw| smoothed(&turned(cells(raw))));
        let (across_px, along_px) = if axis == DisparityAxis::Rows { (tile.1, tile.0) } else { tile };
        // Matching runs along rows of cells; each cell is so many pixels across and along that way.
        let side = |cell_px: usize| (search.window_px / cell_px).max(4);
        let window = (side(across_px), side(along_px));
        if a.nrows() < window.0 || a.ncols() < window.1 {
            let (expected, found) = (search.window_px.to_string(), first.size().0.min(first.size().1).to_string());
            return Err(SensorError::Shape { what: "pixels across two views, at least a block", expected, found });
        }
        let step = ((window.0 / 2).max(1), (window.1 / 2).max(1));
        let n = ((a.nrows() - window.0) / step.0 + 1, (a.ncols() - window.1) / step.1 + 1);
        let most = (search.most_px / along_px).max(1) as isize;
        let found: Vec<Option<Match>> = (0..n.0 * n.1)
            .into_par_iter()
            .map(|block| {
                let corner = (block / n.1 * step.0, block % n.1 * step.1);
                Block { views: [a.view(), b.view()], corner, window }.matched(most)
            })
            .collect();
        let scale = along_px as f64;
        let plane = |of: fn(&Match) -> f64| {
            let value = |found: &Option<Match>| found.as_ref().map_or(f32::NAN, |found| (scale * of(found)) as f32);
            let plane = Array2::from_shape_vec(n, found.iter().map(value).collect()).expect("a value a block");
            if axis == DisparityAxis::Rows { plane.reversed_axes().as_standard_layout().into_owned() } else { plane }
        };
        let pixels = |(across, along): (f64, f64)| {
            let [across, along] = [across * across_px as f64, along * along_px as f64];
            if axis == DisparityAxis::Rows { [along, across] } else { [across, along] }
        };
        let middle = |window: usize, cell_px: usize| 0.5 * window as f64 - 0.5 / cell_px as f64;
        Ok(Self {
            first_px: pixels((middle(window.0, across_px), middle(window.1, along_px))),
            step_px: pixels((step.0 as f64, step.1 as f64)),
            disparity_px: plane(|found| found.disparity),
            standard_error_px: plane(|found| found.standard_error),
        })
    }
}

/// Returns the light of a frame averaged over each whole tile of its mosaic, or over its planes.
fn cells(raw: &Raw) -> Array2<f32> {
    let planes = raw.linear();
    let Some(tile) = &raw.tile else {
        let n_planes = planes.len() as f32;
        return planes.into_iter().reduce(|sum, plane| sum + plane).expect("a checked frame has a plane") / n_planes;
    };
    let (n_rows, n_columns) = (Tile::rows(tile), Tile::columns(tile));
    let frame = &planes[0];
    let size = (frame.nrows() / n_rows, frame.ncols() / n_columns);
    let mean = |(row, column): (usize, usize)| {
        let (row, column) = (row * n_rows, column * n_columns);
        frame.slice(s![row..row + n_rows, column..column + n_columns]).sum() / (n_rows * n_columns) as f32
    };
    Array2::from_shape_fn(size, mean)
}

/// Returns a view smoothed along its rows; beyond the ends the last sample stands.
fn smoothed(view: &Array2<f32>) -> Array2<f32> {
    let last = view.ncols() as isize - 1;
    Array2::from_shape_fn(view.dim(), |(row, column)| {
        let at = |k: isize| view[(row, (column as isize + k - 2).clamp(0, last) as usize)];
        SMOOTHING.iter().zip(0..).map(|(weight, k)| weight * at(k)).sum()
    })
}

/// What is known of a block, cells.
struct Match {
    disparity: f64,
    standard_error: f64,
}

/// A block of two views.
struct Block<'a> {
    views: [ArrayView2<'a, f32>; 2],
    corner: (usize, usize),
    window: (usize, usize),
}

impl Block<'_> {
    fn matched(&self, most: isize) -> Option<Match> {
        let scores: Vec<(isize, f64)> =
            (-most..=most).filter_map(|whole| Some((whole, self.likeness(whole)?))).collect();
        let (place, &(whole, best)) = scores.iter().enumerate().max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        // What matches best at the end of the search may match better beyond.
        if place == 0 || place + 1 == scores.len() || best <= 0.0 {
            return None;
        }
        // What repeats itself, or is hardly more than noise, matches almost as well elsewhere.
        let is_peak = |&place: &usize| {
            let [before, here, after] = [place - 1, place, place + 1].map(|place| scores[place].1);
            here >= before && here >= after && scores[place].0.abs_diff(whole) > 1
        };
        let others = (1..scores.len() - 1).filter(is_peak).map(|place| scores[place].1);
        if 1.0 - best > DISTINCT * (1.0 - others.fold(0.0, f64::max)) {
            return None;
        }
        self.refined(whole as f64)
    }

    /// Returns the first columns of the block in the first and the second view, moved apart by whole cells; `None` where one leaves the frame.
    fn columns(&self, whole: isize) -> Option<[usize; 2]> {
        let right = whole.div_euclid(2);
        let starts = [self.corner.1 as isize + right, self.corner.1 as isize - (whole - right)];
        let last = (self.views[0].ncols() - self.window.1) as isize;
        starts.iter().all(|start| (0..=last).contains(start)).then(|| starts.map(|start| start as usize))
    }

    /// Returns how alike the views are, moved apart by whole cells, at most 1: 2 g cov(a, b) / (var a + g² var b) with g the ratio of the means, a
    /// correlation that falls also where contrasts differ.
    fn likeness(&self, whole: isize) -> Option<f64> {
        let starts = self.columns(whole)?;
        let n = (self.window.0 * self.window.1) as f64;
        let [a, b] = [0, 1].map(|view| {
            let rows = self.corner.0..self.corner.0 + self.window.0;
            self.views[view].slice(s![rows, starts[view]..starts[view] + self.window.1]).to_owned()
        });
        let mean = |plane: &Array2<f32>| plane.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
        let means = [mean(&a), mean(&b)];
        let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
        for (&a, &b) in a.iter().zip(&b) {
            let (a, b) = (f64::from(a) - means[0], f64::from(b) - means[1]);
            aa += a * a;
            bb += b * b;
            ab += a * b;
        }
        let gain = means[0] / means[1];
        (aa > 0.0 && bb > 0.0 && gain > 0.0).then(|| 2.0 * gain * ab / (aa + gain * gain * bb))
    }

    /// Fits disparity, gain and offset between the views by Gauss and Newton's steps.
    fn refined(&self, whole: f64) -> Option<Match> {
        let (mut disparity, mut gain, mut offset) = (whole, 1.0, 0.0);
        let mut scale = f64::INFINITY;
        for step in 0..MOST_STEPS {
            let samples = self.samples(disparity)?;
            if step == 0 {
                let mean = |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / samples.len() as f64;
                (gain, offset) = (mean(|s| s.first) / mean(|s| s.second).max(f64::MIN_POSITIVE), 0.0);
            }
            let residual = |s: &Sample| s.first - gain * s.second - offset;
            let mut normal = [[0.0; 3]; 3];
            let mut right = [0.0; 3];
            for sample in &samples {
                let e = residual(sample);
                let weight = if e.abs() <= HUBER * scale { 1.0 } else { HUBER * scale / e.abs() };
                // What a step of each unknown takes from the residual.
                let slopes = [-0.5 * (sample.first_slope + gain * sample.second_slope), sample.second, 1.0];
                for i in 0..3 {
                    right[i] += weight * slopes[i] * e;
                    (0..3).for_each(|j| normal[i][j] += weight * slopes[i] * slopes[j]);
                }
            }
            let inverse = inverse(normal)?;
            let steps: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| inverse[i][j] * right[j]).sum());
            // A robust scale: 1.4826 × the median magnitude is the standard deviation of normal residuals.
            let mut magnitudes: Vec<f64> = samples.iter().map(|s| residual(s).abs()).collect();
            let middle = magnitudes.len() / 2;
            let square = magnitudes.iter().map(|e| e * e).sum::<f64>() / (magnitudes.len() as f64 - 3.0).max(1.0);
            scale = 1.4826 * *magnitudes.select_nth_unstable_by(middle, f64::total_cmp).1;
            disparity += steps[0];
            (gain, offset) = (gain + steps[1], offset + steps[2]);
            if (disparity - whole).abs() > FARTHEST || !disparity.is_finite() {
                return None;
            }
            if steps[0].abs() < LEAST_STEP {
                return Some(Match { disparity, standard_error: (SMOOTHED_VARIANCE * square * inverse[0][0]).sqrt() });
            }
        }
        None
    }

    /// Returns both views with their slopes along rows, moved half the way each.
    fn samples(&self, disparity: f64) -> Option<Vec<Sample>> {
        let n_columns = self.views[0].ncols();
        let [first, second] = [0.5, -0.5].map(|way| {
            let start = self.corner.1 as f64 + way * disparity;
            let below = start.floor();
            (below as isize, start - below)
        });
        // Cubics need a sample more on each side; beyond the frame the last one stands.
        let at = |view: usize, row: usize, column: isize| {
            f64::from(self.views[view][(row, column.clamp(0, n_columns as isize - 1) as usize)])
        };
        let value = |view: usize, row: usize, (below, fraction): (isize, f64), column: usize| {
            cubic(std::array::from_fn(|k| at(view, row, below + column as isize + k as isize - 1)), fraction)
        };
        let places = (self.corner.0..self.corner.0 + self.window.0)
            .flat_map(|row| (0..self.window.1).map(move |column| (row, column)));
        let samples = places.map(|(row, column)| {
            let ((first, first_slope), (second, second_slope)) =
                (value(0, row, first, column), value(1, row, second, column));
            Sample { first, first_slope, second, second_slope }
        });
        Some(samples.collect())
    }
}

/// Two views at one place.
struct Sample {
    first: f64,
    first_slope: f64,
    second: f64,
    second_slope: f64,
}

/// Returns the value and the slope of the cubic of Lagrange through four samples, between the second and the third.
fn cubic([a, b, c, d]: [f64; 4], u: f64) -> (f64, f64) {
    let c3 = (d - a) / 6.0 + 0.5 * (b - c);
    let c2 = 0.5 * (a + c) - b;
    let c1 = c - a / 3.0 - 0.5 * b - d / 6.0;
    (b + u * (c1 + u * (c2 + u * c3)), c1 + u * (2.0 * c2 + 3.0 * u * c3))
}

/// Returns the inverse of a symmetric matrix, or `None` where it is as good as singular.
fn inverse(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let cofactor = |i: usize, j: usize| {
        let [(a, b), (c, d)] = [((i + 1) % 3, (i + 2) % 3), ((j + 1) % 3, (j + 2) % 3)];
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    let scale = m[0][0] * m[1][1] * m[2][2];
    if !(determinant > 1e-12 * scale && scale > 0.0) {
        return None;
    }
    Some(std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Adc, ElectronRate, Exposure, Noise, Sensor};

    /// A frame of light given by a function of row and column.
    fn view(sensor: &Sensor, noise: &Noise, light: &dyn Fn(f64, f64) -> f64) -> Raw {
        let plane = Array2::from_shape_fn((160, 192), |(r, c)| light(r as f64, c as f64) as f32);
        let rate = ElectronRate { planes_e_per_s: vec![plane] };
        let exposure = Exposure::seconds(0.01);
        let electrons = sensor.electrons(&rate, &exposure, noise).unwrap();
        sensor.digitize(&sensor.volts(&electrons, &exposure, noise).unwrap(), &exposure).unwrap()
    }

    /// Waves of several directions, none shorter than 9 pixels, about 200,000 electrons a second.
    fn pattern(row: f64, column: f64) -> f64 {
        let waves = [(0.31, 0.42, 0.3), (-0.5, 0.37, 1.9), (0.12, -0.66, 4.0), (0.07, 0.11, 2.2)];
        let sum: f64 = waves.iter().map(|(x, y, phase)| (x * column + y * row + phase).sin()).sum();
        2e5 * (1.0 + 0.2 * sum)
    }

    fn mono() -> Sensor {
        Sensor { adc: Adc::Analog, ..Sensor::built_in("machine-vision-mono").unwrap() }
    }

    #[track_caller]
    fn check(sensor: &Sensor, (axis, moved_px, dimmed): (DisparityAxis, f64, f64), tolerance_px: f64) {
        let noise = Noise::none();
        let moved = |row: f64, column: f64, by: f64| match axis {
            DisparityAxis::Columns => pattern(row, column - by),
            DisparityAxis::Rows => pattern(row - by, column),
        };
        let first = view(sensor, &noise, &|r, c| moved(r, c, 0.5 * moved_px));
        let second = view(sensor, &noise, &|r, c| dimmed * moved(r, c, -0.5 * moved_px));
        let map = DisparityMap::of([&first, &second], axis, &DisparitySearch::default()).unwrap();
        let known = map.known_px(0.1);
        assert!(known.len() * 10 > map.disparity_px.len() * 5, "{} of {}", known.len(), map.disparity_px.len());
        let worst = known.iter().map(|px| (px - moved_px).abs()).fold(0.0, f64::max);
        assert!(worst < tolerance_px, "{axis:?} {moved_px}: {worst}");
    }

    /// Cubics between samples are good to a thousandth of waves as long as these.
    #[test]
    fn moved_views_are_found_between_pixels() {
        for moved_px in [0.0, 0.3, -2.45, 7.8, -21.0] {
            check(&mono(), (DisparityAxis::Columns, moved_px, 1.0), 5e-3);
            check(&mono(), (DisparityAxis::Rows, moved_px, 1.0), 5e-3);
        }
    }

    /// Vignetted photodiodes get less light than their neighbors.
    #[test]
    fn views_of_other_brightness_match() {
        check(&mono(), (DisparityAxis::Columns, 3.3, 0.6), 5e-3);
    }

    /// All filters of a mosaic count, in cells of 2 × 2 pixels.
    #[test]
    fn views_of_a_mosaic_match() {
        let sensor = Sensor { adc: Adc::Analog, ..Sensor::built_in("imx363").unwrap() };
        check(&Sensor { full_well_e: 1e6, swing_v: 1e6, ..sensor }, (DisparityAxis::Columns, -5.3, 1.0), 0.03);
    }

    #[test]
    fn standard_errors_are_those_of_the_noise() {
        let sensor = mono();
        let frame =
            |number, by: f64| view(&sensor, &Noise::all(1).of_photodiode(number), &move |r, c| pattern(r, c - by));
        let (first, second) = (frame(0, 1.3), frame(1, -1.3));
        let search = DisparitySearch { window_px: 16, most_px: 8 };
        let map = DisparityMap::of([&first, &second], DisparityAxis::Columns, &search).unwrap();
        let known = map.known_px(1.0);
        let rms = (known.iter().map(|px| (px - 2.6).powi(2)).sum::<f64>() / known.len() as f64).sqrt();
        let told = map.standard_error_px.iter().filter(|e| e.is_finite()).map(|&e| f64::from(e).powi(2));
        let told = (told.sum::<f64>() / known.len() as f64).sqrt();
        // Some 100 blocks that do not overlap: 7 % of a standard deviation; interpolation takes a part of the noise away.
        assert!((0.75..1.35).contains(&(rms / told)) && rms < 0.1, "{rms} {told}");
    }

    #[test]
    fn even_views_tell_nothing() {
        let flat = view(&mono(), &Noise::none(), &|_, _| 2e5);
        let map = DisparityMap::of([&flat, &flat], DisparityAxis::Columns, &DisparitySearch::default()).unwrap();
        assert!(map.disparity_px.iter().all(|px| px.is_nan()) && map.known_px(1.0).is_empty());
        let large = DisparitySearch { window_px: 1000, most_px: 8 };
        let error = DisparityMap::of([&flat, &flat], DisparityAxis::Columns, &large).unwrap_err().to_string();
        assert!(error.contains("1000"), "{error}");
    }
}
