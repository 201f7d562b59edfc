//! Spatial frequency response from a slanted edge, after the method of ISO 12233 (e-SFR).
//!
//! Every pixel's distance from the edge gives one sample of the edge's profile, much finer than the pixels. Unlike the
//! standard, which bins to quarters of a pixel and differentiates by differences, the profile is a smooth curve through
//! bins of an eighth, whose slope is exact.

use ndarray::{Array2, ArrayView2};

use crate::SensorError;

/// Bins a pixel.
const OVERSAMPLING: f64 = 8.0;
/// The steepest and the least slant that give every phase of the pixel, degrees from a row or column.
const SLANTS_DEG: std::ops::RangeInclusive<f64> = 1.0..=44.5;

/// The response of an edge.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeResponse {
    /// Frequencies, cycles a pixel, 0 to 1.
    pub frequencies: Vec<f64>,
    /// The response at each frequency, 1 at 0.
    pub response: Vec<f64>,
    /// The slant of the edge, degrees from the nearest of rows and columns, 0–45.
    pub slant_deg: f64,
}

impl EdgeResponse {
    /// Returns the response of the edge in a region of linear light.
    ///
    /// # Errors
    /// When the region is under 16 × 16 pixels, has no edge, or the edge is not slanted by 1° to 44.5°.
    pub fn measure(region: &ArrayView2<'_, f32>) -> Result<Self, SensorError> {
        let (rows, columns) = region.dim();
        let unsuitable = |reason: String| SensorError::Unsuitable { what: "the slanted edge", reason };
        if rows < 16 || columns < 16 {
            return Err(unsuitable(format!("needs at least 16 × 16 pixels, but the region has {rows} × {columns}")));
        }
        let tensor = Tensor::of(region);
        let rough_rad = tensor.direction_rad().ok_or_else(|| unsuitable("is not in the region".to_owned()))?;
        // Rows and columns change places where the edge is nearer to a row.
        let is_upright = rough_rad.cos().abs() >= rough_rad.sin().abs();
        let region = if is_upright { region.view() } else { region.t() };
        let rough_slope = if is_upright { -rough_rad.tan() } else { -1.0 / rough_rad.tan() };
        let slope = refined_slope(&region, rough_slope, tensor.middle(is_upright))
            .ok_or_else(|| unsuitable("is not straight through the region".to_owned()))?;
        let slant_deg = slope.atan().to_degrees();
        if !SLANTS_DEG.contains(&slant_deg.abs()) {
            return Err(unsuitable(format!("is slanted by {:.2}°, expected 1° to 44.5°", slant_deg.abs())));
        }
        let normal_rad = -slope.atan();
        let profile = Profile::new(&region, normal_rad);
        let (frequencies, response) =
            profile.response().ok_or_else(|| unsuitable("has too little contrast to be measured".to_owned()))?;
        Ok(Self { frequencies, response, slant_deg: slant_deg.abs() })
    }

    /// Finds the most edge-like square of a picture and measures it.
    ///
    /// # Errors
    /// When the picture is smaller than the square, or no square holds a single slanted edge.
    pub fn find_and_measure(picture: &Array2<f32>, side: usize) -> Result<Self, SensorError> {
        let (row, column) = find_edge(picture, side)?;
        Self::measure(&picture.slice(ndarray::s![row..row + side, column..column + side]))
    }

    /// Returns the response at a frequency, cycles a pixel, with straight lines between the tabled ones.
    pub fn at(&self, frequency: f64) -> f64 {
        interpolated(&self.frequencies, &self.response, frequency)
    }

    /// Returns the first frequency at which the response falls to a level, cycles a pixel.
    pub fn frequency_at(&self, level: f64) -> Option<f64> {
        let i = self.response.iter().position(|&r| r < level).filter(|&i| i > 0)?;
        let (f, r) = (&self.frequencies, &self.response);
        Some(f[i - 1] + (f[i] - f[i - 1]) * (r[i - 1] - level) / (r[i - 1] - r[i]))
    }

    /// Returns the frequency at which half the response is left, cycles a pixel.
    pub fn mtf50(&self) -> Option<f64> {
        self.frequency_at(0.5)
    }

    /// Returns the frequency beyond the peak at which half of the peak is left, cycles a pixel.
    ///
    /// The same as [`mtf50`](Self::mtf50) where nothing was sharpened; less flattered by sharpening, which lifts the peak.
    pub fn mtf50p(&self) -> Option<f64> {
        let peak = (0..self.response.len()).max_by(|&a, &b| self.response[a].total_cmp(&self.response[b]))?;
        let half = 0.5 * self.response[peak];
        let i = (peak + 1..self.response.len()).find(|&i| self.response[i] < half)?;
        let (f, r) = (&self.frequencies, &self.response);
        Some(f[i - 1] + (f[i] - f[i - 1]) * (r[i - 1] - half) / (r[i - 1] - r[i]))
    }
}

/// Returns a value of a table at evenly spaced frequencies from 0 on, with straight lines between.
pub(crate) fn interpolated(frequencies: &[f64], values: &[f64], frequency: f64) -> f64 {
    let place = (frequency / frequencies[1]).clamp(0.0, (values.len() - 1) as f64);
    let below = (place as usize).min(values.len() - 2);
    values[below] + (values[below + 1] - values[below]) * (place - below as f64)
}

/// Returns the corner of the square that most looks like a single slanted edge.
///
/// # Errors
/// When the picture is smaller than the square, or no square holds a single slanted edge.
pub fn find_edge(picture: &Array2<f32>, side: usize) -> Result<(usize, usize), SensorError> {
    let (rows, columns) = picture.dim();
    if side < 16 || rows < side || columns < side {
        let (expected, found) = (format!("{side} × {side}, and 16 × 16"), format!("{rows} × {columns}"));
        return Err(SensorError::Shape {
            what: "rows × columns of a picture with an edge (at least)",
            expected,
            found,
        });
    }
    let step = (side / 4).max(1);
    let corners = (0..=rows - side).step_by(step).flat_map(|r| (0..=columns - side).step_by(step).map(move |c| (r, c)));
    let score =
        |&(r, c): &(usize, usize)| Tensor::of(&picture.slice(ndarray::s![r..r + side, c..c + side])).edge_score();
    let best = corners.map(|corner| (score(&corner), corner)).max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((score, corner)) if score > 0.0 => Ok(corner),
        _ => {
            let reason = "is nowhere in the picture".to_owned();
            Err(SensorError::Unsuitable { what: "the slanted edge", reason })
        }
    }
}

/// The structure tensor of a region: the mean products of its slopes, and where the slopes are.
struct Tensor {
    xx: f64,
    xy: f64,
    yy: f64,
    /// The middle of the slopes: row and column.
    middle: (f64, f64),
    /// How far that is from the region's middle, as a share of its height and width.
    off_center: f64,
}

impl Tensor {
    fn of(region: &ArrayView2<'_, f32>) -> Self {
        let (rows, columns) = region.dim();
        let (mut xx, mut xy, mut yy, mut x_mean, mut y_mean) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for row in 1..rows - 1 {
            for column in 1..columns - 1 {
                let at = |r: usize, c: usize| f64::from(region[(r, c)]);
                // Sobel's slopes are the same in all directions to a few degrees.
                let smooth = |a: f64, b: f64, c: f64| 0.25 * (a + 2.0 * b + c);
                let (r, c) = (row, column);
                let dx = smooth(at(r - 1, c + 1), at(r, c + 1), at(r + 1, c + 1))
                    - smooth(at(r - 1, c - 1), at(r, c - 1), at(r + 1, c - 1));
                let dy = smooth(at(r + 1, c - 1), at(r + 1, c), at(r + 1, c + 1))
                    - smooth(at(r - 1, c - 1), at(r - 1, c), at(r - 1, c + 1));
                let square = dx * dx + dy * dy;
                (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
                x_mean += square * (c as f64 / (columns - 1) as f64 - 0.5);
                y_mean += square * (r as f64 / (rows - 1) as f64 - 0.5);
            }
        }
        let energy = (xx + yy).max(f64::MIN_POSITIVE);
        let (down, right) = (y_mean / energy, x_mean / energy);
        let middle = ((down + 0.5) * (rows - 1) as f64, (right + 0.5) * (columns - 1) as f64);
        Self { xx, xy, yy, middle, off_center: down.hypot(right) }
    }

    /// Returns the middle of the slopes, row and column, which change places where asked.
    fn middle(&self, is_upright: bool) -> (f64, f64) {
        if is_upright { self.middle } else { (self.middle.1, self.middle.0) }
    }

    /// Returns the direction in which the light changes, radians from the rows.
    fn direction_rad(&self) -> Option<f64> {
        (self.xx + self.yy > 0.0).then(|| 0.5 * (2.0 * self.xy).atan2(self.xx - self.yy))
    }

    /// Returns how much a region looks like one slanted edge through its middle; 0 where the slant does not do.
    fn edge_score(&self) -> f64 {
        let Some(direction_rad) = self.direction_rad() else { return 0.0 };
        let slant_deg = ((direction_rad.to_degrees().rem_euclid(90.0) + 45.0).rem_euclid(90.0) - 45.0).abs();
        if !SLANTS_DEG.contains(&slant_deg) {
            return 0.0;
        }
        let energy = self.xx + self.yy;
        // 1 where all slopes point the same way; a corner or a texture has much less.
        let coherence = (self.xx - self.yy).hypot(2.0 * self.xy) / energy;
        energy.sqrt() * coherence.powi(8) * (-(self.off_center / 0.1).powi(2)).exp()
    }
}

/// Half the width of the stretch of a row in which the edge is looked for, pixels.
const HALF_STRETCH: f64 = 10.0;

/// Returns by how many columns the edge moves a row, from the middles of the light's change in each row.
///
/// Each round looks about the line of the one before, so that the stretch lies evenly about the edge.
fn refined_slope(region: &ArrayView2<'_, f32>, rough_slope: f64, middle: (f64, f64)) -> Option<f64> {
    let (rows, columns) = region.dim();
    let (mut slope, mut at_zero) = (rough_slope, middle.1 - rough_slope * middle.0);
    for _ in 0..6 {
        let mut points = Vec::with_capacity(rows);
        for row in 0..rows {
            let expected = at_zero + slope * row as f64;
            let (first, last) = ((expected - HALF_STRETCH).round(), (expected + HALF_STRETCH).round());
            if first < 0.0 || last >= (columns - 1) as f64 {
                continue;
            }
            let (mut mass, mut moment) = (0.0, 0.0);
            for column in first as usize..=last as usize {
                let change = f64::from(region[(row, column + 1)]) - f64::from(region[(row, column)]);
                // Hamming's window keeps noise at the ends small.
                let place = column as f64 + 0.5;
                let share = (place - expected) / (HALF_STRETCH + 1.0);
                let weight = 0.54 + 0.46 * (std::f64::consts::PI * share).cos();
                (mass, moment) = (mass + weight * change, moment + weight * change * place);
            }
            points.push((row as f64, moment / mass));
        }
        // A line through a few rows determines nothing, and one that left the region is none.
        if points.len() < 8 || points.iter().any(|p| !p.1.is_finite()) {
            return None;
        }
        let n = points.len() as f64;
        let mean = points.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        let (xy, xx) = points
            .iter()
            .fold((0.0, 0.0), |s, p| (s.0 + (p.0 - mean.0) * (p.1 - mean.1), s.1 + (p.0 - mean.0).powi(2)));
        slope = xy / xx;
        at_zero = mean.1 - slope * mean.0;
    }
    Some(slope)
}

/// The profile of an edge across its normal.
struct Profile {
    /// For each bin with samples their mean distance, pixels, and mean value.
    points: Vec<(f64, f64)>,
    /// The mean variance of the distances within a bin, pixels².
    spread: f64,
}

impl Profile {
    fn new(region: &ArrayView2<'_, f32>, normal_rad: f64) -> Self {
        let (rows, columns) = region.dim();
        let (sin, cos) = normal_rad.sin_cos();
        let (y0, x0) = (0.5 * (rows - 1) as f64, 0.5 * (columns - 1) as f64);
        let reach = (y0 * sin.abs() + x0 * cos.abs()).ceil();
        let mut bins = vec![[0.0_f64; 4]; (2.0 * reach * OVERSAMPLING) as usize + 2];
        for ((row, column), &value) in region.indexed_iter() {
            let (distance, value) = ((column as f64 - x0) * cos + (row as f64 - y0) * sin, f64::from(value));
            let bin = &mut bins[((distance + reach) * OVERSAMPLING) as usize];
            let sums = [1.0, distance, distance * distance, value];
            bin.iter_mut().zip(sums).for_each(|(sum, v)| *sum += v);
        }
        let (mut points, mut spread, mut n) = (Vec::with_capacity(bins.len()), 0.0, 0.0);
        for [count, d, dd, v] in bins.into_iter().filter(|bin| bin[0] > 0.0) {
            points.push((d / count, v / count));
            spread += dd - d * d / count;
            n += count;
        }
        Self { points, spread: spread / n }
    }

    /// Returns frequencies and responses, or `None` where the profile has no step.
    fn response(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let line = spline_slopes(&self.points);
        let (first, last) = (self.points[0].0, self.points[self.points.len() - 1].0);
        let step = 1.0 / OVERSAMPLING;
        let n = ((last - first) / step).floor() as usize;
        let samples: Vec<(f64, f64)> =
            (0..=n).map(|i| first + step * i as f64).map(|d| (d, line.slope_at(d))).collect();
        // The middle of the slope, found about the steepest place so that noise far away does not pull it.
        let steepest = samples.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let near = || samples.iter().filter(|(d, _)| (d - steepest.0).abs() < 8.0);
        let mass: f64 = near().map(|(_, s)| s).sum();
        let center = near().map(|(d, s)| d * s).sum::<f64>() / mass;
        if !center.is_finite() {
            return None;
        }
        // A Tukey window: flat over the middle half, so that the response is not smeared.
        let half = (center - first).min(last - center);
        let window = |d: f64| {
            let share = ((d - center).abs() / half).min(1.0);
            if share < 0.5 { 1.0 } else { 0.5 + 0.5 * (2.0 * std::f64::consts::PI * (share - 0.5)).cos() }
        };
        let windowed: Vec<(f64, f64)> = samples.iter().map(|&(d, s)| (d - center, s * window(d))).collect();
        let transform = |frequency: f64| {
            let (re, im) = windowed.iter().fold((0.0, 0.0), |(re, im), &(d, s)| {
                let (sin, cos) = (std::f64::consts::TAU * frequency * d).sin_cos();
                (re + s * cos, im + s * sin)
            });
            re.hypot(im)
        };
        let zero = transform(0.0);
        let frequencies: Vec<f64> = (0..=100).map(|i| 0.01 * f64::from(i)).collect();
        // The mean over a bin loses what the spread of its samples smears.
        let kept = |f: f64| (-0.5 * self.spread * (std::f64::consts::TAU * f).powi(2)).exp();
        let response = frequencies.iter().map(|&f| transform(f) / zero / kept(f)).collect();
        (zero > 0.0).then_some((frequencies, response))
    }
}

/// A natural cubic spline.
struct Spline<'a> {
    points: &'a [(f64, f64)],
    second: Vec<f64>,
}

/// Returns the natural cubic spline through points of rising place.
fn spline_slopes(points: &[(f64, f64)]) -> Spline<'_> {
    let n = points.len();
    let (mut second, mut ratio) = (vec![0.0; n], vec![0.0; n]);
    // The tridiagonal system of continuous slopes, solved by one sweep down and one up.
    for i in 1..n - 1 {
        let (h0, h1) = (points[i].0 - points[i - 1].0, points[i + 1].0 - points[i].0);
        let right = 6.0 * ((points[i + 1].1 - points[i].1) / h1 - (points[i].1 - points[i - 1].1) / h0);
        let pivot = 2.0 * (h0 + h1) - h0 * ratio[i - 1];
        ratio[i] = h1 / pivot;
        second[i] = (right - h0 * second[i - 1]) / pivot;
    }
    for i in (1..n - 1).rev() {
        second[i] -= ratio[i] * second[i + 1];
    }
    Spline { points, second }
}

impl Spline<'_> {
    fn slope_at(&self, x: f64) -> f64 {
        let above = self.points.partition_point(|p| p.0 < x).clamp(1, self.points.len() - 1);
        let ((x0, y0), (x1, y1)) = (self.points[above - 1], self.points[above]);
        let (h, m0, m1) = (x1 - x0, self.second[above - 1], self.second[above]);
        let (a, b) = ((x1 - x) / h, (x - x0) / h);
        (y1 - y0) / h + h / 6.0 * ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile of an edge, every hundredth of a pixel to 50 pixels on both sides.
    struct Table(Vec<f64>);

    impl Table {
        /// Returns the profile of an MTF (cycles a pixel, 0 beyond `cutoff`): ½ + ∫ m(f) sin(2π f d) / (π f) df.
        fn of(mtf: &dyn Fn(f64) -> f64, cutoff: f64) -> Self {
            let n = 800;
            let step = cutoff / f64::from(n);
            let terms: Vec<(f64, f64)> = (0..n)
                .map(|i| (f64::from(i) + 0.5) * step)
                .map(|f| (std::f64::consts::TAU * f, step * mtf(f) / (std::f64::consts::PI * f)))
                .collect();
            let at = |d: f64| 0.5 + terms.iter().map(|(w, term)| term * (w * d).sin()).sum::<f64>();
            Self((0..=10_000).map(|i| at(f64::from(i) * 0.01 - 50.0)).collect())
        }

        /// Returns a picture of the edge at a slant, sampled at points.
        fn edge(&self, slant_deg: f64, size: (usize, usize)) -> Array2<f32> {
            let (sin, cos) = slant_deg.to_radians().sin_cos();
            Array2::from_shape_fn(size, |(r, c)| {
                let d = (c as f64 - 0.5 * size.1 as f64 + 0.37) * cos + (r as f64 - 0.5 * size.0 as f64) * sin;
                let place = (d + 50.0) / 0.01;
                let (below, share) = (place as usize, place.fract());
                (0.1 + 0.7 * (self.0[below] * (1.0 - share) + self.0[below + 1] * share)) as f32
            })
        }
    }

    fn check(mtf: &dyn Fn(f64) -> f64, cutoff: f64, what: &str) {
        let table = Table::of(mtf, cutoff);
        for slant_deg in SLANTS_DEG.into_iter().flat_map(|deg| [deg, 90.0 - deg]) {
            let region = table.edge(slant_deg, (64, 64));
            let measured = EdgeResponse::measure(&region.view()).unwrap();
            assert!((measured.slant_deg - slant_deg.min(90.0 - slant_deg)).abs() < 0.05, "{what} {slant_deg}");
            for i in 0..=50 {
                let f = 0.01 * f64::from(i);
                let (got, want) = (measured.at(f), mtf(f).abs());
                assert!((got - want).abs() < 0.01, "{what}, {slant_deg}°: {got} instead of {want} at {f}");
            }
            let half = (1..).map(|i| 1e-4 * f64::from(i)).find(|&f| mtf(f) < 0.5).unwrap();
            let mtf50 = measured.mtf50().unwrap();
            assert!((mtf50 / half - 1.0).abs() < 0.01, "{what}, {slant_deg}°: MTF50 {mtf50} instead of {half}");
        }
    }

    const SLANTS_DEG: [f64; 9] = [2.0, 3.0, 5.0, 8.0, 14.036, 20.0, 26.565, 37.0, 43.0];

    #[test]
    fn gaussian_edges_are_measured_at_every_slant() {
        for sigma in [0.5, 0.8, 1.5] {
            check(&|f| (-2.0 * (std::f64::consts::PI * sigma * f).powi(2)).exp(), 2.0, "Gaussian");
        }
    }

    #[test]
    fn diffraction_edges_are_measured_at_every_slant() {
        let cutoff = 0.8;
        let mtf = |f: f64| {
            let s = (f / cutoff).min(1.0);
            2.0 / std::f64::consts::PI * (s.acos() - s * (1.0 - s * s).sqrt())
        };
        check(&mtf, cutoff, "diffraction");
    }

    /// J1 by its integral, which the trapezoidal rule gives to rounding.
    fn bessel_j1(x: f64) -> f64 {
        let n = 200;
        let term = |t: f64| (t - x * t.sin()).cos();
        let inner: f64 = (1..n).map(|i| term(std::f64::consts::PI * f64::from(i) / f64::from(n))).sum();
        (inner + 0.5 * (term(0.0) + term(std::f64::consts::PI))) / f64::from(n)
    }

    #[test]
    fn pillbox_edges_are_measured_at_every_slant() {
        let mtf = |f: f64| {
            let x = std::f64::consts::TAU * f * 1.5;
            if x < 1e-9 { 1.0 } else { 2.0 * bessel_j1(x) / x }
        };
        check(&mtf, 6.0, "pillbox");
    }

    #[test]
    fn half_of_the_peak_is_told_apart_from_half_of_zero() {
        let response = |values: &[f64]| EdgeResponse {
            frequencies: (0..values.len()).map(|i| 0.1 * i as f64).collect(),
            response: values.to_vec(),
            slant_deg: 5.0,
        };
        let sharpened = response(&[1.0, 1.4, 1.2, 0.7, 0.5, 0.3]);
        assert!((sharpened.mtf50p().unwrap() - 0.3).abs() < 1e-9);
        assert!((sharpened.mtf50().unwrap() - 0.4).abs() < 1e-9);
        let plain = response(&[1.0, 0.8, 0.6, 0.4, 0.2]);
        assert_eq!(plain.mtf50p(), plain.mtf50());
        assert_eq!(response(&[1.0, 0.9, 0.8]).mtf50p(), None);
    }

    #[test]
    fn an_edge_is_found_in_a_picture() {
        let mtf = |f: f64| (-2.0 * (std::f64::consts::PI * 0.7 * f).powi(2)).exp();
        let mut picture = Array2::from_elem((200, 260), 0.8);
        picture.slice_mut(ndarray::s![60..140, 100..180]).assign(&Table::of(&mtf, 2.0).edge(7.0, (80, 80)));
        let found = EdgeResponse::find_and_measure(&picture, 48).unwrap();
        assert!((found.slant_deg - 7.0).abs() < 0.1);
        assert!((found.at(0.25) - mtf(0.25)).abs() < 0.01);
    }

    #[test]
    fn what_is_no_slanted_edge_is_refused() {
        let measure = |region: Array2<f32>| EdgeResponse::measure(&region.view()).unwrap_err().to_string();
        assert!(measure(Array2::zeros((8, 8))).contains("16 × 16"));
        assert!(measure(Array2::zeros((32, 32))).contains("not in the region"));
        let upright = Array2::from_shape_fn((32, 32), |(_, c)| if c < 16 { 0.0 } else { 1.0 });
        assert!(measure(upright).contains("slanted by"));
        assert!(find_edge(&Array2::zeros((64, 64)), 32).unwrap_err().to_string().contains("nowhere"));
    }
}
