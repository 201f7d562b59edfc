//! The response of a Siemens star: the amplitude of its cycles over the radius (ISO 12233, star method).
//!
//! At a radius r a star of N cycles has N / (2πr) cycles a pixel. In narrow rings and in each of eight segments, a level and a wave of N cycles are
//! fitted to all pixels by least squares, so that neither the places of the pixels nor the other harmonics of a binary star enter; what noise adds to
//! the amplitude is taken off.

use std::{f64::consts::TAU, path::Path};

use dioptric_pipeline::PipelineError;
use ndarray::Array2;
use serde::Serialize;

use super::{CodeCurve, MeasuredPicture, Measurement, PixelRegion, edge::response_series};
use crate::{Corner, LineChart, Scale};

/// Segments of the circle (ISO 12233).
const SEGMENTS: usize = 8;
/// The highest frequency that is looked for, cycles a pixel, and the least radius, pixels.
const HIGHEST: f64 = 0.75;
const LEAST_RADIUS_PX: f64 = 3.0;
/// Rings, evenly spaced in frequency.
const RINGS: usize = 48;
/// Half the width of a ring, pixels and share of the radius: frequencies in it differ by 3 %.
const HALF_RING_PX: f64 = 1.0;
const HALF_RING_SHARE: f64 = 0.015;
/// Cycles of a star that are looked for.
const CYCLES: std::ops::RangeInclusive<usize> = 8..=360;
/// The fundamental of a square wave over its amplitude.
const OF_SQUARE: f64 = 4.0 / std::f64::consts::PI;

/// How a star is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StarRequest {
    /// The square about the star; the whole picture where it is not given.
    pub region: Option<PixelRegion>,
    /// The number of its cycles; looked for where it is not given.
    pub n_cycles: Option<usize>,
    /// Whether its cycles are black and white, not sinusoidal.
    pub is_binary: bool,
    /// The modulation of the star itself, (most − least) / (most + least); that of its coarsest ring is taken for the response 1 where it is not given.
    pub modulation: Option<f64>,
    /// How samples stand for light.
    pub curve: CodeCurve,
}

/// The response of a star.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StarMeasurement {
    /// The file.
    pub picture: String,
    /// The star's center: column and row.
    pub center_px: [f64; 2],
    /// The radius of the outermost ring, pixels.
    pub radius_px: f64,
    /// The number of its cycles.
    pub n_cycles: usize,
    /// Whether the response is 1 at the coarsest ring, not by the star's own modulation.
    pub is_relative: bool,
    /// A response a channel.
    pub channels: Vec<StarChannel>,
}

/// The response of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StarChannel {
    /// The channel.
    pub channel: String,
    /// The frequency at which half the response is left, cycles a pixel; none beyond those of the star.
    pub mtf50_cycles_per_pixel: Option<f64>,
    /// That at which a tenth is left: the limiting resolution.
    pub mtf10_cycles_per_pixel: Option<f64>,
    /// The half of each of eight segments, counter-clockwise from the right: the first holds the directions from 0 to 45°.
    pub mtf50_of_segments: Vec<Option<f64>>,
    /// Frequencies, cycles a pixel.
    pub frequencies_cycles_per_pixel: Vec<f64>,
    /// The mean response of all segments.
    pub response: Vec<f64>,
    /// One standard error of it, by the noise of the pixels.
    pub response_error: Vec<f64>,
}

impl StarRequest {
    /// Measures the star of a picture file.
    ///
    /// # Errors
    /// When the file cannot be read, holds no star with its center within the region, or a setting makes no sense.
    pub fn measure(&self, path: &Path) -> Result<StarMeasurement, PipelineError> {
        let wrong = |key: &'static str, found: String, expected: &str| {
            let origin = "the command line".to_owned();
            Err(PipelineError::Value { origin, key, found, expected: expected.to_owned() })
        };
        if let Some(n) = self.n_cycles.filter(|n| !CYCLES.contains(n)) {
            return wrong("--cycles", n.to_string(), "8 to 360");
        }
        if let Some(m) = self.modulation.filter(|m| !(*m > 0.0 && *m <= 1.0)) {
            return wrong("--modulation", m.to_string(), "a number above 0, 1 at most");
        }
        let picture = MeasuredPicture::open(path, self.curve)?;
        picture.require_whole()?;
        let (rows, columns) = picture.size();
        let whole = PixelRegion { column: 0, row: 0, columns, rows };
        let region = self.region.unwrap_or(whole).check_within((rows, columns))?;
        let in_file = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        let luminance = region.of(&picture.luminance()).to_owned();
        let star = Star::find(&luminance, self.n_cycles).map_err(in_file)?;
        let mut planes: Vec<(String, Array2<f32>)> =
            picture.planes.iter().map(|(name, plane)| (name.clone(), region.of(plane).to_owned())).collect();
        if planes.len() > 1 && picture.rgb().is_ok() {
            planes.push(("luminance".to_owned(), luminance));
        }
        let unit = self.modulation.map(|m| if self.is_binary { OF_SQUARE * m } else { m });
        Ok(StarMeasurement {
            picture: picture.name,
            center_px: [star.column + region.column as f64, star.row + region.row as f64],
            radius_px: star.radius,
            n_cycles: star.n_cycles,
            is_relative: unit.is_none(),
            channels: planes.iter().map(|(name, plane)| star.channel(name, plane, unit)).collect(),
        })
    }
}

/// Where a star lies.
#[derive(Clone, Copy, Debug)]
struct Star {
    column: f64,
    row: f64,
    radius: f64,
    n_cycles: usize,
}

/// The level and the wave in a part of a ring.
#[derive(Clone, Copy, Debug, Default)]
struct Wave {
    level: f64,
    cosine: f64,
    sine: f64,
    /// The variance of a pixel about them.
    variance: f64,
    n: f64,
}

impl Wave {
    /// Returns modulation squared, without what noise adds, and its variance.
    fn modulation(self) -> (f64, f64) {
        // Each of both amplitudes has a variance of twice that of a pixel over their number.
        let of_amplitude = 2.0 * self.variance / self.n;
        let squared = self.cosine * self.cosine + self.sine * self.sine - 2.0 * of_amplitude;
        (squared.max(0.0).sqrt() / self.level, of_amplitude / (self.level * self.level))
    }
}

impl Star {
    fn find(plane: &Array2<f32>, n_cycles: Option<usize>) -> Result<Self, String> {
        let (rows, columns) = plane.dim();
        if rows < 40 || columns < 40 {
            return Err(format!("has {columns} × {rows} pixels for a star, expected 40 × 40 or more"));
        }
        let (mut column, mut row) = center_of(plane).ok_or("holds no star: its edges meet nowhere")?;
        let room = |column: f64, row: f64| {
            column.min(row).min((columns - 1) as f64 - column).min((rows - 1) as f64 - row) - HALF_RING_PX
        };
        let radius = 0.97 * room(column, row);
        if radius < 16.0 {
            return Err(format!(
                "holds a star about column {column:.1}, row {row:.1}, too near to the border of the region"
            ));
        }
        let mut star = Self { column, row, radius, n_cycles: n_cycles.unwrap_or(0) };
        if n_cycles.is_none() {
            star.n_cycles = star.count_cycles(plane)?;
        }
        // The center by the phases of a ring's segments, which a shift changes by N of its share of the radius.
        for _ in 0..3 {
            let ring = 0.6 * radius;
            let waves = star.waves(plane, ring);
            let (mut cc, mut cs, mut ss, mut rc, mut rs) = (0.0, 0.0, 0.0, 0.0, 0.0);
            let (x, y) = waves.iter().fold((0.0, 0.0), |(x, y), wave| (x + wave.cosine, y + wave.sine));
            let mean = y.atan2(x);
            for (segment, wave) in waves.iter().enumerate() {
                let angle = (segment as f64 + 0.5) * TAU / SEGMENTS as f64;
                let off = (wave.sine.atan2(wave.cosine) - mean + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                // The wave's phase at an angle moves by N / r × the shift across the radius.
                let by = [-(star.n_cycles as f64) / ring * angle.sin(), star.n_cycles as f64 / ring * angle.cos()];
                (cc, cs, ss) = (cc + by[0] * by[0], cs + by[0] * by[1], ss + by[1] * by[1]);
                (rc, rs) = (rc + by[0] * off, rs + by[1] * off);
            }
            let determinant = cc * ss - cs * cs;
            let (right, up) = ((rc * ss - rs * cs) / determinant, (rs * cc - rc * cs) / determinant);
            if !(right.abs() < 2.0 && up.abs() < 2.0) {
                break;
            }
            (column, row) = (column + right, row - up);
            (star.column, star.row) = (column, row);
        }
        star.radius = 0.97 * room(column, row);
        Ok(star)
    }

    /// Returns the number of cycles of the strongest wave about the center.
    fn count_cycles(&self, plane: &Array2<f32>) -> Result<usize, String> {
        let ring = 0.85 * self.radius;
        let most = (*CYCLES.end()).min((0.5 * TAU * ring) as usize);
        let n = (2.0 * TAU * ring).ceil() as usize;
        let samples: Vec<f64> = (0..n)
            .map(|i| {
                let angle = i as f64 * TAU / n as f64;
                between(plane, self.row - ring * angle.sin(), self.column + ring * angle.cos())
            })
            .collect();
        let mean = samples.iter().sum::<f64>() / n as f64;
        let power = |k: usize| {
            let (x, y) = samples.iter().enumerate().fold((0.0, 0.0), |(x, y), (i, v)| {
                let (sin, cos) = (TAU * (i * k % n) as f64 / n as f64).sin_cos();
                (x + (v - mean) * cos, y + (v - mean) * sin)
            });
            x * x + y * y
        };
        let all = samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() * n as f64 / 2.0;
        let best = (*CYCLES.start()..=most).map(|k| (power(k), k)).max_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((power, k)) if power > 0.3 * all => Ok(k),
            _ => Err(
                "holds no star: no number of cycles stands out about its center, --cycles and --region may tell more"
                    .to_owned(),
            ),
        }
    }

    /// Fits waves to the pixels of a ring, one for each segment.
    fn waves(&self, plane: &Array2<f32>, ring: f64) -> [Wave; SEGMENTS] {
        let half = HALF_RING_PX.max(HALF_RING_SHARE * ring);
        let (rows, columns) = plane.dim();
        let reach = ring + half;
        let span =
            |at: f64, n: usize| (at - reach).floor().max(0.0) as usize..((at + reach).ceil() as usize + 1).min(n);
        // Sums of 1, cosine and sine with each other and with the light, and of its squares.
        let mut sums = [[0.0; 10]; SEGMENTS];
        for r in span(self.row, rows) {
            for c in span(self.column, columns) {
                let (right, up) = (c as f64 - self.column, self.row - r as f64);
                if (right.hypot(up) - ring).abs() > half {
                    continue;
                }
                let angle = up.atan2(right).rem_euclid(TAU);
                let (sin, cos) = (self.n_cycles as f64 * angle).sin_cos();
                let v = f64::from(plane[(r, c)]);
                let sum = &mut sums[((angle / TAU * SEGMENTS as f64) as usize).min(SEGMENTS - 1)];
                let terms = [1.0, cos, sin, cos * cos, cos * sin, sin * sin, v, v * cos, v * sin, v * v];
                sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        sums.map(|[n, c, s, cc, cs, ss, v, vc, vs, vv]| {
            let matrix = solved([[n, c, s], [c, cc, cs], [s, cs, ss]], [v, vc, vs]);
            let [level, cosine, sine] = matrix;
            let left = (vv - level * v - cosine * vc - sine * vs).max(0.0);
            Wave { level, cosine, sine, variance: left / (n - 3.0).max(1.0), n }
        })
    }

    fn channel(&self, name: &str, plane: &Array2<f32>, unit: Option<f64>) -> StarChannel {
        let n = self.n_cycles as f64;
        let lowest = n / (TAU * self.radius);
        let highest = HIGHEST.min(n / (TAU * LEAST_RADIUS_PX)).max(lowest);
        let frequencies: Vec<f64> =
            (0..RINGS).map(|i| lowest + (highest - lowest) * i as f64 / (RINGS - 1) as f64).collect();
        let rings: Vec<[(f64, f64); SEGMENTS]> =
            frequencies.iter().map(|f| self.waves(plane, n / (TAU * f)).map(Wave::modulation)).collect();
        let mean = |ring: &[(f64, f64); SEGMENTS]| ring.iter().map(|(m, _)| m).sum::<f64>() / SEGMENTS as f64;
        let error = |ring: &[(f64, f64); SEGMENTS]| ring.iter().map(|(_, v)| v).sum::<f64>().sqrt() / SEGMENTS as f64;
        let unit = unit.unwrap_or_else(|| mean(&rings[0])).max(f64::MIN_POSITIVE);
        let response: Vec<f64> = rings.iter().map(|ring| mean(ring) / unit).collect();
        let of_segment = |segment: usize| -> Vec<f64> { rings.iter().map(|ring| ring[segment].0 / unit).collect() };
        StarChannel {
            channel: name.to_owned(),
            mtf50_cycles_per_pixel: falls_to(&frequencies, &response, 0.5),
            mtf10_cycles_per_pixel: falls_to(&frequencies, &response, 0.1),
            mtf50_of_segments: (0..SEGMENTS).map(|s| falls_to(&frequencies, &of_segment(s), 0.5)).collect(),
            response_error: rings.iter().map(|ring| error(ring) / unit).collect(),
            frequencies_cycles_per_pixel: frequencies,
            response,
        }
    }
}

/// Returns the first frequency at which a response has fallen to a level.
fn falls_to(frequencies: &[f64], response: &[f64], level: f64) -> Option<f64> {
    let i = response.iter().position(|v| *v < level).filter(|i| *i > 0)?;
    let share = (response[i - 1] - level) / (response[i - 1] - response[i]);
    Some(frequencies[i - 1] + share * (frequencies[i] - frequencies[i - 1]))
}

/// Returns the point, column and row, to which the edges of a plane run: all of its slopes are across the lines to it.
fn center_of(plane: &Array2<f32>) -> Option<(f64, f64)> {
    let (rows, columns) = plane.dim();
    let mut about: Option<(f64, f64)> = None;
    // What lies beside the star, as its corners, counts in the first round alone.
    for _ in 0..4 {
        let reach = about.map(|(x, y)| x.min(y).min((columns - 1) as f64 - x).min((rows - 1) as f64 - y));
        let [mut xx, mut xy, mut yy, mut x, mut y] = [0.0_f64; 5];
        for r in 1..rows - 1 {
            for c in 1..columns - 1 {
                if let (Some((column, row)), Some(reach)) = (about, reach)
                    && (c as f64 - column).hypot(r as f64 - row) > reach
                {
                    continue;
                }
                let at = |r: usize, c: usize| f64::from(plane[(r, c)]);
                let (dx, dy) = (at(r, c + 1) - at(r, c - 1), at(r + 1, c) - at(r - 1, c));
                let along = dx * c as f64 + dy * r as f64;
                (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
                (x, y) = (x + dx * along, y + dy * along);
            }
        }
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-3 * xx * yy || determinant.is_nan() {
            return None;
        }
        let (column, row) = ((x * yy - y * xy) / determinant, (y * xx - x * xy) / determinant);
        let is_within = (2.0..columns as f64 - 3.0).contains(&column) && (2.0..rows as f64 - 3.0).contains(&row);
        about = is_within.then_some((column, row));
        about?;
    }
    about
}

/// Returns a sample between pixels, on straight lines.
fn between(plane: &Array2<f32>, row: f64, column: f64) -> f64 {
    let (rows, columns) = plane.dim();
    let (row, column) = (row.clamp(0.0, (rows - 1) as f64), column.clamp(0.0, (columns - 1) as f64));
    let (r, c) = ((row as usize).min(rows - 2), (column as usize).min(columns - 2));
    let (down, right) = (row - r as f64, column - c as f64);
    let at = |r: usize, c: usize| f64::from(plane[(r, c)]);
    let mix = |a: f64, b: f64, share: f64| a + share * (b - a);
    mix(mix(at(r, c), at(r, c + 1), right), mix(at(r + 1, c), at(r + 1, c + 1), right), down)
}

/// Returns the solution of three equations by Cramer's rule; zeros where there is none.
fn solved(m: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let of_all = determinant(m);
    [0, 1, 2].map(|k| {
        let mut with = m;
        (0..3).for_each(|i| with[i][k] = v[i]);
        if of_all.abs() > f64::MIN_POSITIVE { determinant(with) / of_all } else { 0.0 }
    })
}

impl Measurement for StarMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let series = self
            .channels
            .iter()
            .map(|channel| response_series(&channel.channel, &channel.frequencies_cycles_per_pixel, &channel.response));
        let chart = LineChart {
            title: format!("Response of a star of {} cycles", self.n_cycles),
            x_label: "cycles a pixel".to_owned(),
            y_label: "response".to_owned(),
            x_range: (0.0, HIGHEST),
            y_range: (0.0, 1.2),
            series: series.collect(),
            legend: Corner::TopRight,
            scale: Scale::Linear,
        };
        vec![("star".to_owned(), chart)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA_PX: f64 = 0.7;

    /// A star off the middle, blurred by a Gaussian, sampled at pixels' middles; each harmonic falls by the Gaussian's response at its radius, which is
    /// exact but for the bend of the cycles, a second order of one over the radius.
    fn star(n_cycles: usize, is_binary: bool, modulation: f64, noise: f64) -> Array2<f32> {
        let mut state = 11_u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        Array2::from_shape_fn((301, 281), |(r, c)| {
            let (right, up) = (c as f64 - 141.3, 149.6 - r as f64);
            let radius = right.hypot(up).max(1.0);
            let angle = up.atan2(right);
            let falls = |k: f64| {
                let f = k * n_cycles as f64 / (TAU * radius);
                (-2.0 * (std::f64::consts::PI * SIGMA_PX * f).powi(2)).exp()
            };
            let wave = |k: f64| falls(k) * (k * n_cycles as f64 * angle).cos();
            let sum = if is_binary { OF_SQUARE * (wave(1.0) - wave(3.0) / 3.0 + wave(5.0) / 5.0) } else { wave(1.0) };
            let grain: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            (0.4 * (1.0 + modulation * sum) + noise * grain) as f32
        })
    }

    #[track_caller]
    fn check(n_cycles: usize, is_binary: bool, noise: f64) {
        let plane = star(n_cycles, is_binary, 0.8, noise);
        let found = Star::find(&plane, None).unwrap();
        assert_eq!(found.n_cycles, n_cycles);
        assert!((found.column - 141.3).abs() < 0.05 && (found.row - 149.6).abs() < 0.05, "{found:?}");
        let channel = found.channel("Y", &plane, Some(if is_binary { OF_SQUARE * 0.8 } else { 0.8 }));
        // exp(−2 (π σ f)²) = ½.
        let half = (0.5 * 2.0_f64.ln()).sqrt() / (std::f64::consts::PI * SIGMA_PX);
        let mtf50 = channel.mtf50_cycles_per_pixel.unwrap();
        assert!((mtf50 / half - 1.0).abs() < 0.01, "{n_cycles} {is_binary} {noise}: {mtf50}, not {half}");
        for segment in channel.mtf50_of_segments {
            assert!((segment.unwrap() / half - 1.0).abs() < 0.05, "{segment:?}");
        }
        for (f, response) in
            channel.frequencies_cycles_per_pixel.iter().zip(&channel.response).filter(|(f, _)| **f < 0.4)
        {
            let wanted = (-2.0 * (std::f64::consts::PI * SIGMA_PX * f).powi(2)).exp();
            assert!((response - wanted).abs() < 0.02, "{response}, not {wanted} at {f}");
        }
    }

    #[test]
    fn stars_of_a_gaussian_have_its_response() {
        check(72, false, 0.0);
        check(144, false, 0.0);
        check(72, true, 0.0);
        check(72, false, 0.02);
    }

    #[test]
    fn an_even_plane_and_an_edge_are_no_stars() {
        assert!(Star::find(&Array2::from_elem((80, 80), 0.5), None).is_err());
        let edge = Array2::from_shape_fn((80, 80), |(r, c)| if 10 * c > 400 + r { 0.8 } else { 0.2 });
        assert!(Star::find(&edge, None).is_err());
    }
}
