//! Distortion (ISO 17850) and lateral color (ISO 19084) from a picture of a grid of dots.
//!
//! The dots of an even grid are put in order from the middle of the picture outwards, each from its neighbors. Where an undistorted camera would show
//! them follows from their numbers by a plane map (scale, turn, shear), whose scale is that of the very middle: map and radial terms k₁ r² + k₂ r⁴ are
//! fitted together. Distortion is how much farther from the middle a dot is than that, as a share; lateral color how far its red and its blue are from
//! its green.

use std::{collections::HashMap, path::Path};

use dioptric_pipeline::PipelineError;
use dioptric_sensor::{PointWindow, find_points};
use ndarray::Array2;
use serde::Serialize;

use super::{CodeCurve, MeasuredPicture, Measurement};
use crate::{Corner, LineChart, Scale, Series, palette};

/// A dot is the neighbor that is looked for within this share of the distance between dots.
const NEAR: f64 = 0.3;
/// A window of less than this share of the median one is of a dot at the border of the picture, which may be cut off.
const CUT_OFF: f64 = 0.6;
/// The fewest dots in order.
const FEWEST: usize = 25;
/// Rounds of the fit.
const ROUNDS: usize = 20;

/// How a grid is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridRequest {
    /// How samples stand for light.
    pub curve: CodeCurve,
}

/// The distortion and the lateral color of a picture of dots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridMeasurement {
    /// The file.
    pub picture: String,
    /// How many dots were put in order, and how many lie beside the order.
    pub n_dots: usize,
    /// Those that were left out.
    pub n_left_out: usize,
    /// The distance between dots in the middle, pixels.
    pub pitch_px: f64,
    /// How far the grid is turned counter-clockwise, degrees.
    pub turn_deg: f64,
    /// The distortion of the dot where its magnitude is largest, percent: barrel below 0.
    pub largest_distortion_percent: f64,
    /// That of the fit at the corner of the picture, percent.
    pub corner_distortion_percent: f64,
    /// k₁ and k₂ of the fit, for radii in shares of half the picture's diagonal.
    pub radial_terms: [f64; 2],
    /// What is left of the dots beyond the fit, rms pixels.
    pub left_px: f64,
    /// Lateral color, where there are red, green and blue.
    pub lateral_color: Vec<LateralColor>,
    /// A row a dot.
    pub dots: Vec<GridDot>,
}

/// The lateral color of a channel against green.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LateralColor {
    /// The channel.
    pub channel: String,
    /// The largest displacement, pixels.
    pub largest_px: f64,
    /// The same as a percentage of half the picture's diagonal.
    pub largest_percent: f64,
    /// The mean displacement outwards at the farthest tenth of the dots, pixels.
    pub outward_px: f64,
}

/// A dot of the grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridDot {
    /// Its number to the right of the middle dot.
    pub across: i32,
    /// Its number below it.
    pub down: i32,
    /// Its column and row.
    pub place_px: [f64; 2],
    /// The column and row where an undistorted camera shows it.
    pub undistorted_px: [f64; 2],
    /// Its undistorted distance from the picture's middle, in shares of half the diagonal.
    pub field: f64,
    /// The distortion, percent.
    pub distortion_percent: f64,
    /// How far red and blue are from green, column and row: right and down.
    pub color_px: Vec<[f64; 2]>,
}

/// A dot's place, column and row, and those of the channels.
struct Dot {
    place: [f64; 2],
    channels: Vec<[f64; 2]>,
}

impl GridRequest {
    /// Measures the grid of a picture file: dots that are brighter or darker than what lies between them.
    ///
    /// # Errors
    /// When the file cannot be read, or fewer than 25 dots are in order.
    pub fn measure(&self, path: &Path) -> Result<GridMeasurement, PipelineError> {
        let picture = MeasuredPicture::open(path, self.curve)?;
        picture.require_whole()?;
        let in_file = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        let dots = dots_of(&picture).map_err(in_file)?;
        let ordered = in_order(&dots, picture.size());
        if ordered.len() < FEWEST {
            return Err(in_file(format!(
                "holds {} dots in the order of a grid, expected {FEWEST} or more, apart by about the same in rows and columns",
                ordered.len()
            )));
        }
        let n_left_out = dots.len() - ordered.len();
        let names: Vec<String> = picture.planes.iter().map(|(name, _)| name.clone()).collect();
        Ok(Fit::of(&ordered, picture.size()).measurement(&ordered, (picture.name, n_left_out), &names))
    }
}

/// Finds dots, and their places in the luminance and in each channel.
fn dots_of(picture: &MeasuredPicture) -> Result<Vec<Dot>, String> {
    let luminance = picture.luminance();
    let (least, most) = luminance.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let mut sorted: Vec<f32> = luminance.iter().copied().collect();
    let middle = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    // Dots take less than half of the picture.
    let sign = if median > 0.5 * (least + most) { -1.0 } else { 1.0 };
    let windows = find_points(&luminance.mapv(|v| sign * v), None).map_err(|error| error.to_string())?;
    let mut sides: Vec<usize> = windows.iter().map(|window| window.side).collect();
    sides.sort_unstable();
    let least_side = CUT_OFF * sides.get(sides.len() / 2).copied().unwrap_or(0) as f64;
    let dot = |window: &PointWindow| {
        let place = centroid(&luminance, window, sign)?;
        let channels = picture.planes.iter().map(|(_, plane)| centroid(plane, window, sign)).collect::<Option<_>>()?;
        Some(Dot { place, channels })
    };
    Ok(windows.iter().filter(|window| window.side as f64 >= least_side).filter_map(dot).collect())
}

/// Returns the column and row of the light of a window beyond that of its border; `None` where there is none.
fn centroid(plane: &Array2<f32>, window: &PointWindow, sign: f32) -> Option<[f64; 2]> {
    let last = window.side - 1;
    let is_border = |r: usize, c: usize| r == 0 || c == 0 || r == last || c == last;
    let at = |r: usize, c: usize| f64::from(sign * plane[(window.row + r, window.column + c)]);
    let all = || (0..window.side).flat_map(|r| (0..window.side).map(move |c| (r, c)));
    let border: Vec<f64> = all().filter(|&(r, c)| is_border(r, c)).map(|(r, c)| at(r, c)).collect();
    let level = border.iter().sum::<f64>() / border.len() as f64;
    let most = all().map(|(r, c)| at(r, c) - level).fold(0.0, f64::max);
    // Noise between the dots is no light of theirs.
    let light = |r: usize, c: usize| Some(at(r, c) - level).filter(|v| *v > 0.05 * most).unwrap_or(0.0);
    let (sum, x, y) = all().fold((0.0, 0.0, 0.0), |(sum, x, y), (r, c)| {
        let v = light(r, c);
        (sum + v, x + v * c as f64, y + v * r as f64)
    });
    (sum > 0.0).then(|| [window.column as f64 + x / sum, window.row as f64 + y / sum])
}

/// A dot with its numbers in the grid.
struct Numbered<'a> {
    across: i32,
    down: i32,
    dot: &'a Dot,
}

/// Gives dots their numbers, from the one next to the middle outwards.
fn in_order(dots: &[Dot], (rows, columns): (usize, usize)) -> Vec<Numbered<'_>> {
    let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
    let away = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let nearest = |at: [f64; 2]| {
        let distances = dots.iter().enumerate().map(|(i, dot)| (away(dot.place, at), i));
        distances.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let Some((_, first)) = nearest(middle) else { return Vec::new() };
    // The steps to the right and down, from the neighbors that lie most that way.
    let step = |axis: usize| {
        let own = dots[first].place;
        dots.iter()
            .filter_map(|dot| {
                let off = [dot.place[0] - own[0], dot.place[1] - own[1]];
                (off[axis] > 0.0 && off[1 - axis].abs() < 0.6 * off[axis]).then(|| (off[0].hypot(off[1]), off))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, off)| off)
    };
    let (Some(right), Some(down)) = (step(0), step(1)) else { return Vec::new() };
    let mut numbers: HashMap<usize, ([i32; 2], [[f64; 2]; 2])> = HashMap::from([(first, ([0, 0], [right, down]))]);
    let mut taken: HashMap<[i32; 2], usize> = HashMap::from([([0, 0], first)]);
    let mut queue = std::collections::VecDeque::from([first]);
    while let Some(from) = queue.pop_front() {
        let (own, steps) = numbers[&from];
        for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let mut number = own;
            number[axis] += sign;
            if taken.contains_key(&number) {
                continue;
            }
            let place = dots[from].place;
            let expected = [0, 1].map(|k| place[k] + f64::from(sign) * steps[axis][k]);
            let Some((distance, found)) = nearest(expected) else { continue };
            let length = steps[axis][0].hypot(steps[axis][1]);
            if distance > NEAR * length || numbers.contains_key(&found) {
                continue;
            }
            let mut next = steps;
            next[axis] = [0, 1].map(|k| f64::from(sign) * (dots[found].place[k] - place[k]));
            numbers.insert(found, (number, next));
            taken.insert(number, found);
            queue.push_back(found);
        }
    }
    let mut ordered: Vec<Numbered<'_>> =
        numbers.into_iter().map(|(i, ([across, down], _))| Numbered { across, down, dot: &dots[i] }).collect();
    ordered.sort_by_key(|numbered| (numbered.down, numbered.across));
    ordered
}

/// Where a camera with the distortion of the fit shows the dots.
struct Fit {
    /// The picture's middle, and half its diagonal, pixels.
    middle: [f64; 2],
    half_diagonal: f64,
    /// Column and row of a dot: the first, and for one more across and one more down.
    map: [[f64; 3]; 2],
    /// k₁ and k₂, of shares of half the diagonal.
    radial: [f64; 2],
}

impl Fit {
    fn of(dots: &[Numbered<'_>], (rows, columns): (usize, usize)) -> Self {
        let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
        let half_diagonal = 0.5 * (columns as f64).hypot(rows as f64);
        let mut fit = Self { middle, half_diagonal, map: [[0.0; 3]; 2], radial: [0.0; 2] };
        for round in 0..ROUNDS {
            // Eight unknowns: three of each axis and both radial terms, whose places are those of the round before.
            let mut normal = [[0.0; 9]; 8];
            for numbered in dots {
                let undistorted = fit.undistorted(numbered);
                let off = [0, 1].map(|k| if round == 0 { 0.0 } else { (undistorted[k] - middle[k]) / half_diagonal });
                let squared = off[0] * off[0] + off[1] * off[1];
                for axis in 0..2 {
                    let mut terms = [0.0; 8];
                    terms[3 * axis..3 * axis + 3].copy_from_slice(&[
                        1.0,
                        f64::from(numbered.across),
                        f64::from(numbered.down),
                    ]);
                    terms[6] = half_diagonal * off[axis] * squared;
                    terms[7] = terms[6] * squared;
                    for (i, row) in normal.iter_mut().enumerate() {
                        (0..8).for_each(|j| row[j] += terms[i] * terms[j]);
                        row[8] += terms[i] * numbered.dot.place[axis];
                    }
                }
            }
            let found = solved(normal);
            fit.map = [[found[0], found[1], found[2]], [found[3], found[4], found[5]]];
            fit.radial = [found[6], found[7]];
        }
        fit
    }

    fn undistorted(&self, dot: &Numbered<'_>) -> [f64; 2] {
        self.map.map(|[first, across, down]| first + across * f64::from(dot.across) + down * f64::from(dot.down))
    }

    fn distortion(&self, field: f64) -> f64 {
        let squared = field * field;
        self.radial[0] * squared + self.radial[1] * squared * squared
    }

    fn measurement(
        &self,
        dots: &[Numbered<'_>],
        (picture, n_left_out): (String, usize),
        names: &[String],
    ) -> GridMeasurement {
        let green = names.iter().position(|name| name == "G").filter(|_| names.len() > 1);
        let others: Vec<usize> =
            (0..names.len()).filter(|i| green.is_some() && ["R", "B"].contains(&names[*i].as_str())).collect();
        let from_middle = |place: [f64; 2]| [place[0] - self.middle[0], place[1] - self.middle[1]];
        let rows: Vec<GridDot> = dots
            .iter()
            .map(|numbered| {
                let undistorted = self.undistorted(numbered);
                let (own, wanted) = (from_middle(numbered.dot.place), from_middle(undistorted));
                let length = wanted[0].hypot(wanted[1]);
                // The part along the radius: a dot next to the middle has none.
                let along = (own[0] * wanted[0] + own[1] * wanted[1]) / length.max(f64::MIN_POSITIVE);
                let distortion = if length > 0.02 * self.half_diagonal { 100.0 * (along / length - 1.0) } else { 0.0 };
                let color = |&channel: &usize| {
                    let green = numbered.dot.channels[green.unwrap_or(channel)];
                    [0, 1].map(|k| numbered.dot.channels[channel][k] - green[k])
                };
                GridDot {
                    across: numbered.across,
                    down: numbered.down,
                    place_px: numbered.dot.place,
                    undistorted_px: undistorted,
                    field: length / self.half_diagonal,
                    distortion_percent: distortion,
                    color_px: others.iter().map(color).collect(),
                }
            })
            .collect();
        let left = dots.iter().zip(&rows).map(|(numbered, row)| {
            let factor = 1.0 + self.distortion(row.field);
            let wanted = from_middle(row.undistorted_px);
            let own = from_middle(numbered.dot.place);
            (own[0] - factor * wanted[0]).powi(2) + (own[1] - factor * wanted[1]).powi(2)
        });
        let left_px = (left.sum::<f64>() / rows.len() as f64).sqrt();
        let largest = rows.iter().map(|row| row.distortion_percent).max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let [[_, right_x, down_x], [_, right_y, down_y]] = self.map;
        GridMeasurement {
            picture,
            n_dots: rows.len(),
            n_left_out,
            pitch_px: (right_x * down_y - right_y * down_x).abs().sqrt(),
            turn_deg: (-right_y).atan2(right_x).to_degrees(),
            largest_distortion_percent: largest.unwrap_or(0.0),
            corner_distortion_percent: 100.0 * self.distortion(1.0),
            radial_terms: self.radial,
            left_px,
            lateral_color: others
                .iter()
                .enumerate()
                .map(|(i, &channel)| self.lateral(&rows, i, &names[channel]))
                .collect(),
            dots: rows,
        }
    }

    fn lateral(&self, rows: &[GridDot], number: usize, name: &str) -> LateralColor {
        let largest_px =
            rows.iter().map(|row| row.color_px[number][0].hypot(row.color_px[number][1])).fold(0.0, f64::max);
        let mut by_field: Vec<&GridDot> = rows.iter().collect();
        by_field.sort_by(|a, b| b.field.total_cmp(&a.field));
        let farthest = &by_field[..rows.len().div_ceil(10)];
        let outward = |row: &&GridDot| {
            let off = [0, 1].map(|k| row.undistorted_px[k] - self.middle[k]);
            let length = off[0].hypot(off[1]).max(f64::MIN_POSITIVE);
            (off[0] * row.color_px[number][0] + off[1] * row.color_px[number][1]) / length
        };
        LateralColor {
            channel: name.to_owned(),
            largest_px,
            largest_percent: 100.0 * largest_px / self.half_diagonal,
            outward_px: farthest.iter().map(outward).sum::<f64>() / farthest.len() as f64,
        }
    }
}

/// Solves eight equations, right-hand sides last, by elimination; unknowns that nothing fixes are 0.
fn solved(mut rows: [[f64; 9]; 8]) -> [f64; 8] {
    for i in 0..8 {
        let pivot = (i..8).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs())).unwrap_or(i);
        rows.swap(i, pivot);
        if rows[i][i].abs() < 1e-9 {
            rows[i] = [0.0; 9];
            rows[i][i] = 1.0;
        }
        let own = rows[i];
        for (_, row) in rows.iter_mut().enumerate().filter(|(k, _)| *k != i) {
            let factor = row[i] / own[i];
            row.iter_mut().zip(own).for_each(|(v, own)| *v -= factor * own);
        }
    }
    std::array::from_fn(|i| rows[i][8] / rows[i][i])
}

impl Measurement for GridMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let points = self.dots.iter().map(|dot| (dot.field, dot.distortion_percent));
        let mut by_field: Vec<(f64, f64)> = points.collect();
        by_field.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (least, most) = by_field.iter().fold((0.0_f64, 0.0_f64), |(a, b), (_, v)| (a.min(*v), b.max(*v)));
        let margin = 0.05 * (most - least) + 0.01;
        let chart = LineChart {
            title: "Distortion".to_owned(),
            x_label: "field, share of half the diagonal".to_owned(),
            y_label: "distortion, %".to_owned(),
            x_range: (0.0, 1.0),
            y_range: (least - margin, most + margin),
            series: vec![Series { label: None, color: palette::line(0), points: by_field, is_dashed: false }],
            legend: Corner::TopLeft,
            scale: Scale::Linear,
        };
        vec![("distortion".to_owned(), chart)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Soft dots of a grid turned by 2°, moved by k₁ r² + k₂ r⁴ and by another scale in red and blue, over uneven light.
    fn picture(k: [f64; 2], sign: f64) -> MeasuredPicture {
        let (rows, columns) = (300_usize, 400_usize);
        let (x0, y0, half) = (199.5, 149.5, 250.0);
        let (sin, cos) = 2.0_f64.to_radians().sin_cos();
        let plane = |scale: f64| {
            let mut plane = Array2::from_shape_fn((rows, columns), |(r, c)| 0.5 + 2e-4 * (r as f64 + c as f64));
            for (i, j) in (-12..=12).flat_map(|i| (-12..=12).map(move |j| (f64::from(i), f64::from(j)))) {
                let (u, v) = (24.0 * (i * cos + j * sin) + 3.0, 24.0 * (j * cos - i * sin) - 2.0);
                let squared = (u * u + v * v) / (half * half);
                let factor = scale * (1.0 + k[0] * squared + k[1] * squared * squared);
                let (x, y) = (x0 + factor * u, y0 + factor * v);
                for r in (y - 9.0).max(0.0) as usize..((y + 10.0).max(0.0) as usize).min(rows) {
                    for c in (x - 9.0).max(0.0) as usize..((x + 10.0).max(0.0) as usize).min(columns) {
                        let squared = (r as f64 - y).powi(2) + (c as f64 - x).powi(2);
                        plane[(r, c)] += sign * 0.35 * (-squared / (2.0 * 4.0)).exp();
                    }
                }
            }
            plane.mapv(|v| v as f32)
        };
        MeasuredPicture::of_light("dots", vec![("R", plane(1.002)), ("G", plane(1.0)), ("B", plane(0.999))])
    }

    #[track_caller]
    fn check(k: [f64; 2], sign: f64) {
        let picture = picture(k, sign);
        let dots = dots_of(&picture).unwrap();
        let ordered = in_order(&dots, picture.size());
        assert!(ordered.len() > 120, "{}", ordered.len());
        let names = ["R", "G", "B"].map(str::to_owned);
        let found = Fit::of(&ordered, picture.size()).measurement(&ordered, (String::new(), 0), &names);
        assert!((found.pitch_px / 24.0 - 1.0).abs() < 2e-3, "{}", found.pitch_px);
        assert!((found.turn_deg - 2.0).abs() < 0.05, "{}", found.turn_deg);
        // Dots reach to nine tenths of the diagonal; the corner is the fit's.
        let wanted = 100.0 * (k[0] + k[1]);
        assert!(
            (found.corner_distortion_percent - wanted).abs() < 0.15,
            "{} {wanted}",
            found.corner_distortion_percent
        );
        for dot in found.dots.iter().filter(|dot| dot.field > 0.1) {
            let wanted = 100.0 * (k[0] * dot.field.powi(2) + k[1] * dot.field.powi(4));
            assert!((dot.distortion_percent - wanted).abs() < 0.15, "{dot:?} {wanted}");
        }
        assert!(found.left_px < 0.03, "{}", found.left_px);
        // Red is larger by 0.2 % and blue smaller by 0.1 %.
        let [red, blue] = [0, 1].map(|i| &found.lateral_color[i]);
        let farthest = found.dots.iter().map(|dot| dot.field).fold(0.0, f64::max) * 250.0;
        assert!((red.largest_px / (0.002 * farthest) - 1.0).abs() < 0.1, "{red:?}");
        assert!(red.outward_px > 0.0 && blue.outward_px < 0.0, "{red:?} {blue:?}");
    }

    #[test]
    fn distortion_that_is_put_in_comes_back() {
        check([-0.08, 0.01], 1.0);
        check([0.05, 0.0], -1.0);
        check([0.0, 0.0], 1.0);
    }
}
