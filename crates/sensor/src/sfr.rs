//! Spatial frequency response from a slanted edge, after the method of ISO 12233 (e-SFR).
//!
//! The steps are those of the standard: where the edge lies, its profile much finer than the pixels, the slope of that in a window, and its
//! Fourier transform. Three of them are done otherwise, so that neither noise nor a slope of few phases breaks them: the line is fitted
//! together with the profile (the standard takes centroids row by row), the profile is a spline through all pixels instead of means over
//! quarters of a pixel, and the window is as wide as the noise at each frequency allows instead of as wide as the region. So the noise of the
//! pixels, seen beside the edge, gives each response its standard error.

mod beside;
mod edge_line;
mod edge_profile;
mod find;

use ndarray::{Array2, ArrayView2};

pub use self::find::{find_edge, find_edges};
use self::{
    beside::Side,
    edge_line::{EdgeLine, direction_rad},
    edge_profile::{Banded, EdgeProfile},
};
use crate::SensorError;

/// The steepest and the least slant that are measured, degrees from a row or column.
const SLANTS_DEG: std::ops::RangeInclusive<f64> = 1.0..=44.5;
/// Responses are given every hundredth of a cycle a pixel, up to one.
const FREQUENCY_STEP: f64 = 0.01;
const N_FREQUENCIES: usize = 101;
/// Distance of the places at which slopes are summed, pixels.
const SLOPE_STEP_PX: f64 = 0.125;
/// The part of the region's pixels a pixel of distance, of the most, that a place must have to count.
const LEAST_DENSITY: f64 = 0.2;
/// Half the stretch over which the steepest place is looked for, pixels.
const STEP_PX: f64 = 4.0;
/// The widest gap between pixels' distances near the edge, pixels: half a pixel still tells responses up to one cycle a pixel.
const WIDEST_GAP_PX: f64 = 0.55;
/// The least that an edge moves to the side along the region, pixels.
const LEAST_CROSSED_PX: f64 = 1.0;
/// The least contrast, in standard deviations of a pixel.
const LEAST_CONTRAST_TO_NOISE: f64 = 2.0;
/// What may be left of the pixels near the edge beyond noise, of the contrast.
const MOST_LEFT: f64 = 0.06;
/// Pixels further from the profile than this many standard deviations, and this share of the contrast, are defects.
const DEFECT_DEVIATIONS: f64 = 7.0;
const DEFECT_SHARE: f64 = 0.1;
/// The standard error of a response up to which the window is as wide as the region.
const UNHARMED_ERROR: f64 = 0.003;
/// Windows are no narrower than this many standard deviations of the blur on each side, and this many pixels.
const WINDOW_DEVIATIONS: f64 = 6.0;
const WINDOW_PX: f64 = 3.0;
/// The profile's tails begin this many standard deviations of the blur and this many pixels from the edge. They count where they stand out
/// of the noise by so many standard errors, up to this share of the contrast.
const TAIL_DEVIATIONS: f64 = 6.0;
const TAIL_PX: f64 = 6.0;
const TAIL_ERRORS: f64 = 4.0;
const MOST_TAIL: f64 = 0.05;
/// The largest standard error of MTF50, of its value, that is still a measurement.
const MOST_ERROR: f64 = 0.3;

/// The response of an edge.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeResponse {
    /// Frequencies, cycles a pixel, 0 to 1.
    pub frequencies: Vec<f64>,
    /// The response at each frequency, 1 at 0.
    pub response: Vec<f64>,
    /// One standard error of each response, by the noise of the pixels.
    pub standard_error: Vec<f64>,
    /// The slant of the edge, degrees from the nearest of rows and columns, 0–45.
    pub slant_deg: f64,
    /// The light of the brighter side less that of the darker one.
    pub contrast: f64,
    /// The contrast in standard deviations of a pixel beside the edge; infinite where there is no noise.
    pub contrast_to_noise: f64,
    /// By how much light changes from the edge to the border of the region, of the contrast, on the side where it does so more: shading, which is
    /// taken off; 0 where it is not told from noise.
    pub shading: f64,
    /// The direction across the edge, to the right and down, of length 1.
    pub normal: [f64; 2],
    /// How far the edge lies from the middle of the region along that direction, pixels: the centroid of the slopes about it.
    pub position_px: f64,
    /// One standard error of the position, by the noise of the pixels.
    pub position_error_px: f64,
}

fn unsuitable(reason: String) -> SensorError {
    SensorError::Unsuitable { what: "the slanted edge", reason }
}

impl EdgeResponse {
    /// Returns the response of the edge in a region of linear light.
    ///
    /// # Errors
    /// When the region is under 16 × 16 pixels, has no edge, one that is not slanted by 1° to 44.5°, not straight, too near to the border, or
    /// too short for all phases of a pixel; when there is another edge, or light that changes by more than 30 % of the contrast, beside it; or when it is lost in noise: a contrast below two standard deviations of a pixel, or an MTF50 whose
    /// standard error is beyond 30 %.
    pub fn measure(region: &ArrayView2<'_, f32>) -> Result<Self, SensorError> {
        let (rows, columns) = region.dim();
        if rows < 16 || columns < 16 {
            return Err(unsuitable(format!("needs at least 16 × 16 pixels, but the region has {rows} × {columns}")));
        }
        let rough_rad = direction_rad(region).ok_or_else(|| unsuitable("is not in the region".to_owned()))?;
        // Rows and columns change places where the edge is nearer to a row.
        let is_upright = rough_rad.cos().abs() >= rough_rad.sin().abs();
        let region = if is_upright { region.view() } else { region.t() };
        let rough_slope = if is_upright { -rough_rad.tan() } else { -1.0 / rough_rad.tan() };
        let mut slanted = Slanted::new(&region, rough_slope)?;
        let slant_deg = slanted.line.slope.atan().to_degrees().abs();
        if !SLANTS_DEG.contains(&slant_deg) {
            return Err(unsuitable(format!("is slanted by {slant_deg:.2}°, expected 1° to 44.5°")));
        }
        slanted.check(&region)?;
        slanted.rises_per_px = slanted.rises_beside()?;
        let mut response = slanted.response(slant_deg)?;
        if !is_upright {
            response.normal.reverse();
        }
        match (response.mtf50(), response.mtf50_error()) {
            (Some(mtf50), Some(error)) if error > MOST_ERROR * mtf50 => Err(unsuitable(format!(
                "is lost in noise: MTF50 would be {mtf50:.3} ± {error:.3} cycles a pixel, expected an error of at most {} %; \
                 a longer edge or the mean of several frames is more certain",
                100.0 * MOST_ERROR
            ))),
            _ => Ok(response),
        }
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

    /// Returns one standard error of [`mtf50`](Self::mtf50), cycles a pixel: that of the response there over its slope.
    pub fn mtf50_error(&self) -> Option<f64> {
        const HALF: f64 = 0.03;
        let mtf50 = self.mtf50()?;
        let (below, above) = ((mtf50 - HALF).max(0.0), (mtf50 + HALF).min(1.0));
        let fall = (self.at(below) - self.at(above)) / (above - below);
        Some(interpolated(&self.frequencies, &self.standard_error, mtf50) / fall.max(f64::MIN_POSITIVE))
    }
}

/// An edge with its line and profile, before it is transformed.
struct Slanted {
    line: EdgeLine,
    distances: Array2<f64>,
    used: Array2<bool>,
    profile: EdgeProfile,
    /// Where the profile is known well, pixels from the line through the middle.
    known: [f64; 2],
    /// The middle of the edge.
    center: f64,
    /// The standard deviation of the blur, about.
    blur_px: f64,
    /// The light of both sides, and the variance of a pixel there.
    sides: [(f64, f64); 2],
    /// By how much the light of both sides changes for each pixel to the right.
    rises_per_px: [f64; 2],
}

impl Slanted {
    fn new(region: &ArrayView2<'_, f32>, rough_slope: f64) -> Result<Self, SensorError> {
        let crooked = || unsuitable("is not straight through the region".to_owned());
        let all = Array2::from_elem(region.dim(), true);
        let slanted = Self::along(region, all, rough_slope).ok_or_else(crooked)?;
        let used = slanted.sound(region);
        if used.iter().all(|is_used| *is_used) {
            return Ok(slanted);
        }
        Self::along(region, used, slanted.line.slope).ok_or_else(crooked)
    }

    fn along(region: &ArrayView2<'_, f32>, used: Array2<bool>, slope: f64) -> Option<Self> {
        let line = EdgeLine::refined(region, &used, slope)?;
        let distances = line.distances(region.dim());
        let profile = EdgeProfile::fit(region, &distances, &used)?;
        let known = well_known(&distances)?;
        let mut slanted = Self {
            line,
            distances,
            used,
            profile,
            known,
            center: 0.0,
            blur_px: 0.0,
            sides: [(0.0, 0.0); 2],
            rises_per_px: [0.0; 2],
        };
        slanted.center = slanted.steepest()?;
        // The second round looks as far as the blur of the first one reaches, so that noise further away does not count.
        let reach = (slanted.center - known[0]).min(known[1] - slanted.center);
        slanted.blur_px = slanted.blur(reach);
        slanted.blur_px = slanted.blur((8.0 * slanted.blur_px + 4.0).min(reach));
        slanted.sides = slanted.sides(region)?;
        Some(slanted)
    }

    /// Returns the mean of the profile over a stretch.
    fn mean(&self, from: f64, to: f64) -> f64 {
        let n = ((to - from) / SLOPE_STEP_PX).ceil().max(1.0) as usize;
        let step = (to - from) / n as f64;
        (0..n).map(|i| self.profile.at(from + (i as f64 + 0.5) * step)[0]).sum::<f64>() / n as f64
    }

    /// Returns where the means of a few pixels on both sides differ most.
    fn steepest(&self) -> Option<f64> {
        let [first, last] = self.known;
        let half = STEP_PX.min(0.25 * (last - first));
        let n = ((last - first - 2.0 * half) / 0.25).floor() as usize;
        let places = (0..=n).map(|i| first + half + 0.25 * i as f64);
        let difference = |at: f64| (self.mean(at, at + half) - self.mean(at - half, at)).abs();
        places.map(|at| (difference(at), at)).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, at)| at)
    }

    /// Returns the standard deviation of a Gaussian of the same ∫ (e − dark)(bright − e) as the profile e within a reach: of σ that is
    /// σ/√π of the squared contrast. Noise counts by its square alone.
    fn blur(&self, reach: f64) -> f64 {
        let [from, to] = [self.center - reach, self.center + reach];
        let (left, right) = (self.mean(from, from + 0.4 * reach), self.mean(to - 0.4 * reach, to));
        let n = (2.0 * reach / SLOPE_STEP_PX).ceil() as usize;
        let step = 2.0 * reach / n as f64;
        let between = |i: usize| {
            let value = self.profile.at(from + (i as f64 + 0.5) * step)[0];
            (value - left) * (right - value)
        };
        let integral = step * (0..n).map(between).sum::<f64>() / (right - left).powi(2);
        (integral * std::f64::consts::PI.sqrt()).clamp(0.5, 0.25 * reach.max(2.0))
    }

    /// Returns the light of the left side and the right one with the variance of a pixel; that of all pixels where a side has few.
    fn sides(&self, region: &ArrayView2<'_, f32>) -> Option<[(f64, f64); 2]> {
        let beyond = 3.0 * self.blur_px + 1.0;
        let mut sums = [[0.0_f64; 3]; 2];
        for ((&value, &distance), _) in region.iter().zip(&self.distances).zip(&self.used).filter(|(_, used)| **used) {
            let off = distance - self.center;
            if off.abs() > beyond {
                let left = f64::from(value) - self.profile.at(distance)[0];
                let side = &mut sums[usize::from(off > 0.0)];
                side.iter_mut().zip([1.0, f64::from(value), left * left]).for_each(|(sum, v)| *sum += v);
            }
        }
        let few = 32.0;
        let [left, right] = sums;
        if left[0] < 1.0 || right[0] < 1.0 {
            return None;
        }
        // A knot of the profile takes up what one pixel of its quarter varies.
        let n_pixels = region.len() as f64;
        let freedom = n_pixels / (n_pixels - 4.0 * (self.known[1] - self.known[0])).max(0.25 * n_pixels);
        let both = (left[2] + right[2]) / (left[0] + right[0]);
        let of = |[n, sum, squares]: [f64; 3]| (sum / n, freedom * if n < few { both } else { squares / n });
        Some([of(left), of(right)])
    }

    /// Returns the standard deviation of a Gaussian as steep as the edge over a pixel, which nothing beside the edge makes wider.
    fn steep_px(&self) -> f64 {
        let places = (-8..=8).map(|i| self.center + 0.25 * f64::from(i));
        let steepest = places.map(|at| (self.mean(at, at + 1.0) - self.mean(at - 1.0, at)).abs()).fold(0.0, f64::max);
        self.contrast() / (steepest.max(f64::MIN_POSITIVE) * std::f64::consts::TAU.sqrt())
    }

    /// Returns by how much the light of both sides changes for each pixel to the right.
    fn rises_beside(&self) -> Result<[f64; 2], SensorError> {
        let blur_px = self.blur_px.min(self.steep_px());
        let n_per_px = self.distances.len() as f64 / (self.known[1] - self.known[0]);
        let side = |sign: f64, end: f64| {
            let mean = |from: f64, to: f64| {
                let (a, b) = (self.center + sign * from, self.center + sign * to);
                self.mean(a.min(b), a.max(b))
            };
            let side = Side {
                mean: &mean,
                reach_px: (end - self.center).abs(),
                blur_px,
                contrast: self.contrast(),
                error: self.noise() / n_per_px.sqrt(),
            };
            side.rise_per_px().map(|rise| sign * rise)
        };
        Ok([side(-1.0, self.known[0])?, side(1.0, self.known[1])?])
    }

    /// Returns the slope of shading at a distance from the edge.
    fn rise_at(&self, off: f64) -> f64 {
        self.rises_per_px[usize::from(off > 0.0)]
    }

    fn contrast(&self) -> f64 {
        (self.sides[1].0 - self.sides[0].0).abs()
    }

    /// Returns the standard deviation of a pixel beside the edge.
    fn noise(&self) -> f64 {
        (0.5 * (self.sides[0].1 + self.sides[1].1)).sqrt()
    }

    /// Returns the variance of a pixel of a light: a straight line between both sides, as shot noise has it.
    fn variance(&self, light: f64) -> f64 {
        let [(left, left_variance), (right, right_variance)] = self.sides;
        let share = ((light - left) / (right - left)).clamp(0.0, 1.0);
        left_variance + share * (right_variance - left_variance)
    }

    /// Returns which pixels are no defects.
    fn sound(&self, region: &ArrayView2<'_, f32>) -> Array2<bool> {
        let most = (DEFECT_DEVIATIONS * self.typical_left(region)).max(DEFECT_SHARE * self.contrast());
        let mut used = self.used.clone();
        for ((used, &value), &distance) in used.iter_mut().zip(region).zip(&self.distances) {
            *used = (f64::from(value) - self.profile.at(distance)[0]).abs() <= most;
        }
        // What many pixels do is no defect.
        let n_out = used.iter().filter(|is_used| !**is_used).count();
        if n_out > region.len() / 50 { self.used.clone() } else { used }
    }

    /// Returns the standard deviation of Gaussian noise of the same median magnitude as what is left of the pixels.
    fn typical_left(&self, region: &ArrayView2<'_, f32>) -> f64 {
        let left = region.iter().zip(&self.distances).map(|(&v, &d)| (f64::from(v) - self.profile.at(d)[0]).abs());
        let mut left: Vec<f64> = left.collect();
        let middle = left.len() / 2;
        let (_, median, _) = left.select_nth_unstable_by(middle, f64::total_cmp);
        1.4826 * *median
    }

    /// Refuses what gives no response.
    fn check(&self, region: &ArrayView2<'_, f32>) -> Result<(), SensorError> {
        let (contrast, noise) = (self.contrast(), self.noise());
        let largest = region.iter().fold(0.0_f64, |most, v| most.max(f64::from(v.abs())));
        if contrast <= 1e-5 * largest {
            return Err(unsuitable("has too little contrast to be measured".to_owned()));
        }
        if contrast < LEAST_CONTRAST_TO_NOISE * noise {
            return Err(unsuitable(format!(
                "is lost in noise: its contrast is {:.2} standard deviations of a pixel, expected at least {LEAST_CONTRAST_TO_NOISE}",
                contrast / noise
            )));
        }
        let reach = self.reach();
        let needed = (4.0 * self.blur_px).max(WINDOW_PX);
        if reach < needed {
            return Err(unsuitable(format!(
                "is {reach:.1} pixels from the border of the region, expected at least {needed:.1} for its blur"
            )));
        }
        // Distances that are seen in one row alone tell no slope: a wrong one gives another profile that fits as well.
        let crossed = self.line.slope.abs() * (region.nrows() - 1) as f64;
        if crossed < LEAST_CROSSED_PX {
            return Err(unsuitable(format!(
                "crosses {crossed:.2} pixels of the region, too few phases of the pixel, expected at least \
                 {LEAST_CROSSED_PX}: a longer region or another slant"
            )));
        }
        let gap = self.widest_gap();
        if gap > WIDEST_GAP_PX {
            return Err(unsuitable(format!(
                "shows too few phases of the pixel ({gap:.2} pixels between some), expected a longer region or another slant"
            )));
        }
        let near = self.blur_px + 1.0;
        let (mut squares, mut expected, mut n) = (0.0, 0.0, 0.0);
        for ((&value, &distance), _) in region.iter().zip(&self.distances).zip(&self.used).filter(|(_, used)| **used) {
            if (distance - self.center).abs() <= near {
                let fitted = self.profile.at(distance)[0];
                squares += (f64::from(value) - fitted).powi(2);
                expected += self.variance(fitted);
                n += 1.0;
            }
        }
        let beyond = ((squares - 2.0 * expected) / f64::max(n, 1.0)).max(0.0).sqrt();
        if beyond > MOST_LEFT * contrast {
            return Err(unsuitable(format!(
                "is not straight through the region: pixels beside it differ by {:.0} % of its contrast, expected at most {:.0} %",
                100.0 * beyond / contrast,
                100.0 * MOST_LEFT
            )));
        }
        Ok(())
    }

    /// Returns how far the profile is known on both sides of the edge.
    fn reach(&self) -> f64 {
        (self.center - self.known[0]).min(self.known[1] - self.center)
    }

    /// Returns the widest gap between distances near the edge.
    fn widest_gap(&self) -> f64 {
        let near = self.blur_px + 1.5;
        let mut places: Vec<f64> = self.distances.iter().copied().filter(|d| (d - self.center).abs() <= near).collect();
        places.sort_unstable_by(f64::total_cmp);
        places.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
    }

    /// Returns the step from one side to the other beyond all windows, where the profile has tails that fall as one over the distance, those of
    /// diffraction; `None` where none stands out of the noise.
    ///
    /// A window cuts such tails off: at 32 pixels they hold 1 % of the light of a lens whose cutoff is half a cycle a pixel.
    fn step_beyond(&self, widest: f64) -> Option<f64> {
        let start = (TAIL_DEVIATIONS * self.blur_px).max(TAIL_PX);
        let n = ((widest - start) / SLOPE_STEP_PX) as usize;
        if widest < 2.0 * start {
            return None;
        }
        let inverse = |i: usize| 1.0 / (start + (i as f64 + 0.5) * SLOPE_STEP_PX);
        let mean_inverse = (0..n).map(inverse).sum::<f64>() / n as f64;
        let spread = (0..n).map(|i| (inverse(i) - mean_inverse).powi(2)).sum::<f64>();
        // A line over 1 / distance on each side, of one slope.
        let side = |sign: f64| {
            let value = |i: usize| {
                let off = sign / inverse(i);
                self.profile.at(self.center + off)[0] - off * self.rise_at(off)
            };
            let mean = (0..n).map(value).sum::<f64>() / n as f64;
            let slope = (0..n).map(|i| (inverse(i) - mean_inverse) * (value(i) - mean)).sum::<f64>() / spread;
            (mean, slope)
        };
        let ((left, left_slope), (right, right_slope)) = (side(-1.0), side(1.0));
        let step = right - left;
        let tail = -0.5 * (right_slope - left_slope) / step;
        // Pixels of a stretch: as many as distances of the region have.
        let per_sample = self.distances.len() as f64 / (self.known[1] - self.known[0]) * SLOPE_STEP_PX;
        let error = self.noise() / step.abs() / (2.0 * per_sample * spread).sqrt();
        let more = 2.0 * tail * mean_inverse;
        (tail > TAIL_ERRORS * error && more < MOST_TAIL).then(|| step.abs() * (1.0 + more))
    }

    fn response(&self, slant_deg: f64) -> Result<EdgeResponse, SensorError> {
        let variances = self.distances.iter().zip(&self.used).filter(|(_, used)| **used);
        let noise = self.profile.noise_matrix(variances.map(|(&d, _)| (d, self.variance(self.profile.at(d)[0]))));
        // The transform in a Tukey window, flat over its inner half, and the variance of it.
        let transform = |frequency: f64, half: f64| {
            let n = (2.0 * half / SLOPE_STEP_PX).ceil() as usize;
            let step = 2.0 * half / n as f64;
            let sum = |wave: fn(f64) -> f64| {
                let weighted = |i: usize| {
                    let off = (i as f64 + 0.5) * step - half;
                    (off, step * tukey(off / half) * wave(std::f64::consts::TAU * frequency * off))
                };
                let shading: f64 = (0..n).map(weighted).map(|(off, weight)| weight * self.rise_at(off)).sum();
                let places = (0..n).map(weighted).map(|(off, weight)| (self.center + off, weight));
                let (sum, variance) = self.profile.sum_of_slopes(places, &noise);
                (sum - shading, variance)
            };
            let ((re, re_variance), (im, im_variance)) = (sum(f64::cos), sum(f64::sin));
            (re.hypot(im), re_variance + im_variance)
        };
        let widest = self.reach();
        let narrowest = (WINDOW_DEVIATIONS * self.blur_px + WINDOW_PX).min(widest);
        let step = self.step_beyond(widest).unwrap_or_else(|| transform(0.0, widest).0);
        if step <= 0.0 {
            return Err(unsuitable("has too little contrast to be measured".to_owned()));
        }
        let (mut response, mut standard_error) = (vec![1.0], vec![0.0]);
        let mut half = widest;
        for i in 1..N_FREQUENCIES {
            let frequency = FREQUENCY_STEP * i as f64;
            let (magnitude, variance) = transform(frequency, half);
            // Noise adds its own power.
            response.push((magnitude * magnitude - variance).max(0.0).sqrt() / step);
            standard_error.push((0.5 * variance).sqrt() / step);
            // The variance grows as the window does, and as the square of the frequency.
            let next = variance * ((i + 1) as f64 / i as f64).powi(2);
            let allowed = half * (UNHARMED_ERROR * step).powi(2) / next.max(f64::MIN_POSITIVE);
            half = allowed.clamp(narrowest, widest);
        }
        let frequencies = (0..N_FREQUENCIES).map(|i| FREQUENCY_STEP * i as f64).collect();
        let (off_px, position_error_px) = self.centroid(narrowest, &noise);
        let cos = 1.0 / self.line.slope.hypot(1.0);
        let contrast_to_noise = self.contrast() / self.noise();
        Ok(EdgeResponse {
            frequencies,
            response,
            standard_error,
            slant_deg,
            contrast: self.contrast(),
            contrast_to_noise,
            shading: self.rises_per_px.iter().fold(0.0, |most: f64, rise| most.max(rise.abs())) * widest
                / self.contrast(),
            normal: [cos, -self.line.slope * cos],
            position_px: self.center + off_px,
            position_error_px,
        })
    }

    /// Returns how far the centroid of the slopes in a window lies beyond the middle of the edge, and its standard error, pixels.
    fn centroid(&self, half: f64, noise: &Banded) -> (f64, f64) {
        let n = (2.0 * half / SLOPE_STEP_PX).ceil() as usize;
        let step = 2.0 * half / n as f64;
        let sum = |power: i32| {
            let weighted = |i: usize| {
                let off = (i as f64 + 0.5) * step - half;
                (off, step * tukey(off / half) * off.powi(power))
            };
            let shading: f64 = (0..n).map(weighted).map(|(off, weight)| weight * self.rise_at(off)).sum();
            let (sum, variance) = self
                .profile
                .sum_of_slopes((0..n).map(weighted).map(|(off, weight)| (self.center + off, weight)), noise);
            (sum - shading, variance)
        };
        let ((all, _), (moment, variance)) = (sum(0), sum(1));
        (moment / all, variance.sqrt() / all.abs())
    }
}

/// Returns Tukey's window of places from −1 to 1: flat over the middle half, so that the response is not smeared, and Hann's slopes.
fn tukey(place: f64) -> f64 {
    let share = place.abs().min(1.0);
    if share < 0.5 { 1.0 } else { 0.5 + 0.5 * (2.0 * std::f64::consts::PI * (share - 0.5)).cos() }
}

/// Returns the stretch of distances that have a fair part of the pixels.
fn well_known(distances: &Array2<f64>) -> Option<[f64; 2]> {
    let (first, last) = distances.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &d| (a.min(d), b.max(d)));
    let mut counts = vec![0.0; (last - first) as usize + 1];
    distances.iter().for_each(|d| counts[(d - first) as usize] += 1.0);
    let most = counts.iter().copied().fold(0.0, f64::max);
    let is_known = |count: &f64| *count >= LEAST_DENSITY * most;
    let (from, to) = (counts.iter().position(is_known)?, counts.iter().rposition(is_known)?);
    Some([first + from as f64, (first + to as f64 + 1.0).min(last)])
}

/// Returns a value of a table at evenly spaced frequencies from 0 on, with straight lines between.
pub(crate) fn interpolated(frequencies: &[f64], values: &[f64], frequency: f64) -> f64 {
    let place = (frequency / frequencies[1]).clamp(0.0, (values.len() - 1) as f64);
    let below = (place as usize).min(values.len() - 2);
    values[below] + (values[below + 1] - values[below]) * (place - below as f64)
}

#[cfg(test)]
impl EdgeResponse {
    /// Returns a response without noise.
    pub(crate) fn of_curve(frequencies: Vec<f64>, response: Vec<f64>) -> Self {
        let standard_error = vec![0.0; response.len()];
        Self {
            frequencies,
            response,
            standard_error,
            slant_deg: 5.0,
            contrast: 1.0,
            contrast_to_noise: f64::INFINITY,
            shading: 0.0,
            normal: [1.0, 0.0],
            position_px: 0.0,
            position_error_px: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile of an edge, shading: 0.0, every hundredth of a pixel to 50 pixels on both sides.
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
                // The profile is flat at its ends.
                let place = ((d + 50.0) / 0.01).clamp(0.0, 9999.0);
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
        let response = |values: &[f64]| {
            EdgeResponse::of_curve((0..values.len()).map(|i| 0.1 * i as f64).collect(), values.to_vec())
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

    const SIGMA: f64 = 0.8;

    fn gaussian(f: f64) -> f64 {
        (-2.0 * (std::f64::consts::PI * SIGMA * f).powi(2)).exp()
    }

    /// Where half of that is left: exp(−2 (π σ f)²) = ½.
    fn gaussian_mtf50() -> f64 {
        (0.5 * 2.0_f64.ln()).sqrt() / (std::f64::consts::PI * SIGMA)
    }

    /// Adds normal noise of a standard deviation, the same for a seed.
    fn add_noise(region: &mut Array2<f32>, deviation: f64, seed: u64) {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut uniform = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..8).for_each(|_| _ = uniform());
        for value in region {
            let radius = deviation * (-2.0 * (1.0 - uniform()).ln()).sqrt();
            *value += (radius * (std::f64::consts::TAU * uniform()).cos()) as f32;
        }
    }

    #[test]
    fn slopes_of_few_phases_do_not_break_the_response() {
        let table = Table::of(&gaussian, 2.0);
        // Rows a column; at 2 pixels lie on distances √5 a pixel, the fewest within 2° to 40°.
        for (p, q) in [(2, 1), (3, 1), (3, 2), (7, 3), (5, 2), (4, 1), (5, 1), (6, 1), (9, 7), (23, 2), (28, 1)] {
            for side in [64, 97, 150] {
                let slant_deg = f64::from(q).atan2(f64::from(p)).to_degrees();
                let region = table.edge(slant_deg, (side, side));
                let mtf50 = EdgeResponse::measure(&region.view()).unwrap().mtf50().unwrap();
                assert!((mtf50 / gaussian_mtf50() - 1.0).abs() < 0.002, "{p}/{q}, {side} pixels: {mtf50}");
            }
        }
    }

    #[test]
    fn noise_scatters_mtf50_by_the_error_that_is_stated() {
        let table = Table::of(&gaussian, 2.0);
        for (slant_deg, signal_to_noise) in [(5.0, 40.0), (14.036, 20.0), (23.199, 10.0)] {
            let clean = table.edge(slant_deg, (100, 100));
            let n = 40;
            let measured: Vec<EdgeResponse> = (1..=n)
                .map(|seed| {
                    let mut region = clean.clone();
                    add_noise(&mut region, 0.8 / signal_to_noise, seed);
                    EdgeResponse::measure(&region.view()).unwrap()
                })
                .collect();
            let off: Vec<f64> = measured.iter().map(|r| r.mtf50().unwrap() / gaussian_mtf50() - 1.0).collect();
            let bias = off.iter().sum::<f64>() / n as f64;
            let scatter = (off.iter().map(|v| (v - bias).powi(2)).sum::<f64>() / (n - 1) as f64).sqrt();
            let stated = measured.iter().map(|r| r.mtf50_error().unwrap() / gaussian_mtf50()).sum::<f64>() / n as f64;
            let what = format!("SNR {signal_to_noise}: bias {bias}, scatter {scatter}, stated {stated}");
            // The mean of forty scatters by a sixth of one, their scatter by a ninth of itself.
            assert!(bias.abs() < 0.01 + 3.0 * scatter / (n as f64).sqrt(), "{what}");
            assert!((0.7..1.4).contains(&(scatter / stated)), "{what}");
            let contrast_to_noise = 0.7 / 0.8 * signal_to_noise;
            assert!((measured[0].contrast_to_noise / contrast_to_noise - 1.0).abs() < 0.1, "{what}");
        }
    }

    #[test]
    fn defects_and_a_bend_do_not_count() {
        let table = Table::of(&gaussian, 2.0);
        let mut region = table.edge(8.0, (96, 96));
        add_noise(&mut region, 0.002, 3);
        for i in 0..12_usize {
            region[((7 + 29 * i) % 96, (11 + 31 * i) % 96)] = 1.0;
        }
        let mtf50 = EdgeResponse::measure(&region.view()).unwrap().mtf50().unwrap();
        assert!((mtf50 / gaussian_mtf50() - 1.0).abs() < 0.01, "with hot pixels: {mtf50}");
        // An arc 1.2 pixels high, as distortion bends the edges of a chart.
        let bent = Array2::from_shape_fn((96, 96), |(r, c)| {
            let down = (r as f64 - 47.5) / 47.5;
            let d = (c as f64 - 47.2 - 1.2 * down * down) * 8.0_f64.to_radians().cos()
                + (r as f64 - 47.5) * 8.0_f64.to_radians().sin();
            let place = ((d + 50.0) / 0.01).clamp(0.0, 1e4);
            (0.1 + 0.7 * table.0[place as usize]) as f32
        });
        let mtf50 = EdgeResponse::measure(&bent.view()).unwrap().mtf50().unwrap();
        assert!((mtf50 / gaussian_mtf50() - 1.0).abs() < 0.01, "bent: {mtf50}");
    }

    #[test]
    fn what_noise_or_shape_hides_is_refused_with_the_reason() {
        let reason = |region: &Array2<f32>| EdgeResponse::measure(&region.view()).unwrap_err().to_string();
        for seed in 1..6 {
            let mut flat = Array2::from_elem((100, 100), 0.5);
            add_noise(&mut flat, 0.05, seed);
            let reason = reason(&flat);
            assert!(["lost in noise", "slanted by"].iter().any(|word| reason.contains(word)), "{reason}");
        }
        let mut faint = Table::of(&gaussian, 2.0).edge(5.0, (40, 40));
        add_noise(&mut faint, 0.45, 1);
        assert!(reason(&faint).contains("lost in noise"), "{}", reason(&faint));
        let corner = Array2::from_shape_fn((80, 80), |(r, c)| {
            let (r, c) = (r as f64 - 40.0, c as f64 - 40.0);
            f32::from(u8::from(c + 0.1 * r > 0.0 && r - 0.1 * c > 0.0))
        });
        assert!(reason(&corner).contains("not straight"), "{}", reason(&corner));
        // Sixteen rows at 1.5° show less than half of a pixel's phases, and none of them twice.
        let short = Table::of(&gaussian, 2.0).edge(1.5, (16, 64));
        assert!(reason(&short).contains("too few phases"), "{}", reason(&short));
    }

    #[test]
    fn shading_beside_an_edge_is_taken_off() {
        let table = Table::of(&gaussian, 2.0);
        // Light that falls by a share of itself over the region, to the right and down, with and without noise.
        for (fall, noise) in [(0.05, 0.0), (0.15, 0.0), (0.1, 0.01)] {
            let mut region = table.edge(5.0, (100, 100));
            for ((r, c), v) in region.indexed_iter_mut() {
                *v *= (1.0 + fall * (0.5 - c as f64 / 100.0) + 0.2 * fall * (0.5 - r as f64 / 100.0)) as f32;
            }
            add_noise(&mut region, noise, 3);
            let measured = EdgeResponse::measure(&region.view()).unwrap();
            let mtf50 = measured.mtf50().unwrap();
            let within = 0.01 + 2.0 * measured.mtf50_error().unwrap() / mtf50;
            assert!(
                (mtf50 / gaussian_mtf50() - 1.0).abs() < within,
                "{fall}, {noise}: {mtf50}, not {}",
                gaussian_mtf50()
            );
            assert!(measured.shading > 0.2 * fall, "{}", measured.shading);
        }
        assert_eq!(EdgeResponse::measure(&table.edge(5.0, (100, 100)).view()).unwrap().shading, 0.0);
    }

    #[test]
    fn a_second_edge_is_refused() {
        let table = Table::of(&gaussian, 2.0);
        let (sin, cos) = 5.0_f64.to_radians().sin_cos();
        for (share, noise) in [(0.3, 0.0), (-0.5, 0.0), (0.3, 0.01)] {
            let mut region = table.edge(5.0, (100, 100));
            for ((r, c), v) in region.indexed_iter_mut() {
                let d = (c as f64 - 78.0) * cos + (r as f64 - 50.0) * sin;
                *v += (0.7 * share / (1.0 + (-2.0 * d).exp())) as f32;
            }
            add_noise(&mut region, noise, 5);
            let error = EdgeResponse::measure(&region.view()).unwrap_err().to_string();
            assert!(error.contains("another edge"), "{share}: {error}");
        }
    }

    #[test]
    fn all_edges_of_a_picture_are_found() {
        let table = Table::of(&gaussian, 2.0);
        let mut picture = Array2::from_elem((300, 400), 0.8);
        let places = [(10, 20), (20, 300), (200, 30), (180, 290), (110, 160)];
        for (row, column) in places {
            picture.slice_mut(ndarray::s![row..row + 80, column..column + 80]).assign(&table.edge(7.0, (80, 80)));
        }
        let found = find_edges(&picture, 48).unwrap();
        let measured: Vec<(usize, usize)> = found
            .into_iter()
            .filter(|&(r, c)| EdgeResponse::measure(&picture.slice(ndarray::s![r..r + 48, c..c + 48])).is_ok())
            .collect();
        for (row, column) in places {
            let is_there = |&(r, c): &(usize, usize)| {
                (row..row + 80).contains(&(r + 24)) && (column..column + 80).contains(&(c + 24))
            };
            assert!(measured.iter().any(is_there), "{row} {column}: {measured:?}");
        }
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

    #[test]
    fn edges_lie_where_they_are_as_surely_as_is_stated() {
        // The same blurred edge moved along its normal; the slope is that of its columns per row, or of its rows per column.
        let mut squares = Vec::new();
        for (number, (slope, is_upright)) in [(0.12, true), (-0.3, true), (0.2, false)].into_iter().enumerate() {
            let cos = 1.0 / f64::hypot(slope, 1.0);
            for seed in 0..20 {
                let moved_px = 0.13 * f64::from(seed) - 1.3;
                let noise = |row: usize, column: usize| {
                    let mixed = ((row * 90 + column) as u64 + 7200 * (seed as u64 + 20 * number as u64))
                        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    ((mixed >> 40) as f64 / 16_777_216.0 - 0.5) * 0.02
                };
                let edge = Array2::from_shape_fn((80, 90), |(row, column)| {
                    let (x, y) = (column as f64 - 44.5, row as f64 - 39.5);
                    let (across, along) = if is_upright { (x, y) } else { (y, x) };
                    let distance = (across - slope * along) * cos - moved_px;
                    (0.2 + 0.6 / (1.0 + (-1.7 * distance / 0.9).exp()) + noise(row, column)) as f32
                });
                let response = EdgeResponse::measure(&edge.view()).unwrap();
                let [right, down] = response.normal;
                let expected = if is_upright { [cos, -slope * cos] } else { [-slope * cos, cos] };
                assert!((right - expected[0]).abs() < 2e-3 && (down - expected[1]).abs() < 2e-3, "{right} {down}");
                squares.push(((response.position_px - moved_px) / response.position_error_px).powi(2));
                assert!((1e-4..0.03).contains(&response.position_error_px), "{}", response.position_error_px);
            }
        }
        // 60 of them: a standard error of 9 %.
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((0.7..1.35).contains(&rms), "{rms}");
    }
}
