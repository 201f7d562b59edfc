//! Pictures of points, and what is read off them.

use dioptric_psf::Picture;
use dioptric_sensor::{PointWindow, find_points};
use ndarray::{Array2, s};
use serde::Serialize;

use super::{MeasuredPicture, Measurement};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// Shares of the energy whose radii are listed.
const SHARES: [f64; 3] = [0.5, 0.8, 0.9];
/// Radii of the plotted encircled energy.
const N_RADII: usize = 48;

/// How pictures of points are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRequest {
    /// The side of the window about each point, pixels; half way to its neighbors where it is not given.
    pub window: Option<usize>,
    /// The distance between pixels, µm.
    pub pixel_um: f64,
    /// The light between the points, where it is not the median of the picture.
    pub background: Option<f64>,
}

/// The points of a picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointSet {
    /// The file.
    pub picture: String,
    /// The distance between pixels, µm.
    pub pixel_um: f64,
    /// A row a point and channel, the brightest point first.
    pub spots: Vec<PointRow>,
}

/// What is read off a point in one channel. x is to the right and y up from the middle of the picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointRow {
    /// The number of the point, 0 for the brightest.
    pub spot: usize,
    /// The channel.
    pub channel: String,
    /// The centroid's row, counted from the middle of the top row.
    pub row: f64,
    /// The centroid's column.
    pub column: f64,
    /// The centroid, mm.
    pub centroid_x_mm: f64,
    /// The centroid, mm.
    pub centroid_y_mm: f64,
    /// The root mean square distance from the centroid, µm.
    pub rms_radius_um: f64,
    /// The standard deviation along x, µm.
    pub sigma_x_um: f64,
    /// The standard deviation along y, µm.
    pub sigma_y_um: f64,
    /// The second moment of x and y about the centroid, µm².
    pub covariance_xy_um2: f64,
    /// The full width at half maximum of the line spread along x, µm.
    pub lsf_fwhm_um: Option<f64>,
    /// The radius that holds half of the energy, µm.
    pub ee50_radius_um: f64,
    /// The radius that holds 80 % of it, µm.
    pub ee80_radius_um: f64,
    /// The radius that holds 90 % of it, µm.
    pub ee90_radius_um: f64,
    /// The sum of the samples above the background.
    pub sum: f64,
    /// The side of the window, pixels.
    pub window_pixels: usize,
    /// Encircled energy: pairs of radius, µm, and share of the energy in the window.
    pub encircled_energy: Vec<(f64, f64)>,
}

impl PointRequest {
    /// Measures every point of a picture; points are looked for in the luminance and measured in each channel.
    ///
    /// # Errors
    /// When there is no point, or a setting makes no sense.
    pub fn measure(&self, picture: &MeasuredPicture) -> Result<PointSet, PipelineError> {
        let wrong = |key, found: String, expected: &str| {
            let origin = "the command line".to_owned();
            Err(PipelineError::Value { origin, key, found, expected: expected.to_owned() })
        };
        if !(self.pixel_um > 0.0 && self.pixel_um.is_finite()) {
            return wrong("--pixel-um", self.pixel_um.to_string(), "a number above 0");
        }
        if let Some(side) = self.window.filter(|side| *side < 3 || side % 2 == 0) {
            return wrong("--window", side.to_string(), "an odd number of pixels, 3 or more");
        }
        picture.require_whole()?;
        let windows =
            find_points(&picture.luminance(), self.window).map_err(|error| picture.unfit(error.to_string()))?;
        let mut spots = Vec::new();
        for (number, window) in windows.iter().enumerate() {
            for (channel, plane) in &picture.planes {
                spots.extend(self.row(number, window, channel, plane));
            }
        }
        Ok(PointSet { picture: picture.name.clone(), pixel_um: self.pixel_um, spots })
    }

    /// Returns what is read off one channel, or `None` where the point has no light in it.
    fn row(&self, spot: usize, window: &PointWindow, channel: &str, plane: &Array2<f32>) -> Option<PointRow> {
        let (first, end) = ((window.row, window.column), (window.row + window.side, window.column + window.side));
        let background = self.background.unwrap_or_else(|| median(plane));
        let light = plane.slice(s![first.0..end.0, first.1..end.1]).mapv(|v| f64::from(v) - background);
        let sum = light.sum();
        if sum <= 0.0 {
            return None;
        }
        let point = Picture::new(light.view(), self.pixel_um);
        let (centroid_um, moments) = (point.centroid_um(), point.second_moments_um2());
        let half = 0.5 * (window.side as f64 - 1.0);
        let row = first.0 as f64 + half - centroid_um.y / self.pixel_um;
        let column = first.1 as f64 + half + centroid_um.x / self.pixel_um;
        let (rows, columns) = plane.dim();
        let mm = |pixels: f64| 1e-3 * self.pixel_um * pixels;
        let [ee50, ee80, ee90] = SHARES.map(|share| point.energy_radius_um(share));
        let widest = half * self.pixel_um;
        let radii = (1..=N_RADII).map(|i| widest * i as f64 / N_RADII as f64);
        let fwhm = point.line_spread(0.0).full_width_at_half_maximum_um();
        Some(PointRow {
            spot,
            channel: channel.to_owned(),
            row,
            column,
            centroid_x_mm: mm(column - 0.5 * (columns as f64 - 1.0)),
            centroid_y_mm: mm(0.5 * (rows as f64 - 1.0) - row),
            // Noise below the background can make a moment of nothing a little negative.
            rms_radius_um: (moments.xx + moments.yy).max(0.0).sqrt(),
            sigma_x_um: moments.xx.max(0.0).sqrt(),
            sigma_y_um: moments.yy.max(0.0).sqrt(),
            covariance_xy_um2: moments.xy,
            lsf_fwhm_um: fwhm.is_finite().then_some(fwhm),
            ee50_radius_um: ee50,
            ee80_radius_um: ee80,
            ee90_radius_um: ee90,
            sum,
            window_pixels: window.side,
            encircled_energy: radii.map(|radius| (radius, point.encircled_energy(radius))).collect(),
        })
    }
}

fn median(plane: &Array2<f32>) -> f64 {
    let mut values: Vec<f32> = plane.iter().copied().collect();
    let middle = values.len() / 2;
    f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

impl Measurement for PointSet {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let widest = self.spots.iter().filter_map(|spot| spot.encircled_energy.last()).map(|e| e.0).fold(0.0, f64::max);
        // More than a few lines cannot be distinguished.
        let series = self.spots.iter().take(12).map(|spot| Series {
            label: Some(format!("{} {}", spot.spot, spot.channel)),
            color: palette::channel(&spot.channel),
            points: [(0.0, 0.0)].into_iter().chain(spot.encircled_energy.iter().copied()).collect(),
            is_dashed: spot.spot > 0,
        });
        let chart = LineChart {
            title: "Encircled energy".to_owned(),
            x_label: "radius, µm".to_owned(),
            y_label: "share of the energy in the window".to_owned(),
            x_range: (0.0, widest.max(f64::MIN_POSITIVE)),
            y_range: (0.0, 1.0),
            series: series.collect(),
            legend: Corner::BottomRight,
            scale: Scale::Linear,
        };
        vec![("spot".to_owned(), chart)]
    }
}
