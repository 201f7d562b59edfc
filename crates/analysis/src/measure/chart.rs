//! Colors of a 24-patch chart in a picture.

use dioptric_sensor::{ChartCorners, ChartReport, find_chart};
use dioptric_spectrum::{Illuminant, Xyz, color_checker_reflectances};
use serde::Serialize;

use super::{MeasuredPicture, Measurement};
use crate::{Corner, LineChart, Scale, Series};
use dioptric_pipeline::{PipelineError, display::code, parse_numbers};

/// How a chart is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartRequest {
    /// The chart's corners as row and column: beside dark skin, bluish green, black and white; looked for where they are
    /// not given.
    pub corners: Option<ChartCorners>,
    /// The light on the chart, under which its patches have the colors that are wanted; D65 where it is not given.
    pub light: Option<Illuminant>,
}

/// The colors of a chart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChartMeasurement {
    /// The file.
    pub picture: String,
    /// The mean ΔE₀₀.
    pub mean_delta_e: f64,
    /// The median ΔE₀₀.
    pub median_delta_e: f64,
    /// The largest ΔE₀₀.
    pub max_delta_e: f64,
    /// The rms of the patches' brightness about what the median of all makes them, stops: [`ChartReport::brightness_spread_stops`].
    pub brightness_spread_stops: f64,
    /// The chart's corners as column and row: beside dark skin, bluish green, black and white.
    pub corners: [[f64; 2]; 4],
    /// A row a patch.
    pub patches: Vec<PatchRow>,
}

/// A patch of the chart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PatchRow {
    /// Its name.
    pub name: String,
    /// ΔE₀₀.
    pub delta_e: f64,
    /// What was measured: CIELAB for a white of D65, with the white patch at its luminance.
    pub lab: [f64; 3],
    /// What was wanted.
    pub wanted_lab: [f64; 3],
    /// What was measured, in 8-bit sRGB.
    pub srgb: [u8; 3],
    /// What was wanted, in 8-bit sRGB, clipped.
    pub wanted_srgb: [u8; 3],
}

impl ChartRequest {
    /// Reads corners as `x1,y1,…,x4,y4`: column and row of each.
    ///
    /// # Errors
    /// When the text is not eight numbers.
    pub fn parse_corners(text: &str) -> Result<ChartCorners, PipelineError> {
        let numbers = parse_numbers("--corners", text)?;
        match numbers.as_slice() {
            &[x1, y1, x2, y2, x3, y3, x4, y4] => Ok([(y1, x1), (y2, x2), (y3, x3), (y4, x4)]),
            _ => Err(PipelineError::Value {
                origin: "the command line".to_owned(),
                key: "--corners",
                found: format!("'{text}'"),
                expected: "x1,y1,x2,y2,x3,y3,x4,y4, clockwise from the corner beside dark skin".to_owned(),
            }),
        }
    }

    /// Measures the chart of a picture.
    ///
    /// # Errors
    /// When there is no chart in it.
    pub fn measure(&self, picture: &MeasuredPicture) -> Result<ChartMeasurement, PipelineError> {
        let light = self.light.clone().unwrap_or(Illuminant::D65);
        let light_rgb = picture.rgb()?;
        let unfit = |e: dioptric_sensor::SensorError| picture.unfit(e.to_string());
        let corners = match self.corners {
            Some(corners) => corners,
            None => find_chart(&light_rgb, &light).map_err(unfit)?,
        };
        let report = ChartReport::measure(&light_rgb, corners, &light).map_err(unfit)?;
        let lab = |rgb: [f64; 3]| {
            let lab = Xyz::from_linear_srgb(rgb).to_lab(Xyz::D65);
            [lab.l, lab.a, lab.b]
        };
        let rows = color_checker_reflectances().into_iter().zip(0..).map(|((name, _), i): (_, usize)| {
            let (found, wanted) = (report.linear_srgb[i], report.wanted_linear_srgb[i]);
            PatchRow {
                name,
                delta_e: report.delta_e[i],
                lab: lab(found),
                wanted_lab: lab(wanted),
                srgb: found.map(code),
                wanted_srgb: wanted.map(code),
            }
        });
        Ok(ChartMeasurement {
            picture: picture.name.clone(),
            mean_delta_e: report.mean_delta_e(),
            median_delta_e: report.median_delta_e(),
            max_delta_e: report.max_delta_e(),
            brightness_spread_stops: report.brightness_spread_stops(),
            corners: corners.map(|(row, column)| [column, row]),
            patches: rows.collect(),
        })
    }
}

impl Measurement for ChartMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        vec![("color-ab".to_owned(), self.ab_plot()), ("color-delta-e".to_owned(), self.delta_e_plot())]
    }
}

impl ChartMeasurement {
    /// From each color wanted a line to the one measured.
    fn ab_plot(&self) -> LineChart {
        let ab = |lab: [f64; 3]| (lab[1], lab[2]);
        let widest = self
            .patches
            .iter()
            .flat_map(|p| [p.lab, p.wanted_lab])
            .flat_map(|lab| [lab[1].abs(), lab[2].abs()])
            .fold(10.0, f64::max);
        let limit = 10.0 * (widest / 10.0 + 0.2).ceil();
        let series = self.patches.iter().flat_map(|patch| {
            let [r, g, b] = patch.wanted_srgb;
            let color = format!("#{r:02x}{g:02x}{b:02x}");
            let (from, to) = (ab(patch.wanted_lab), ab(patch.lab));
            // A small cross stands on the color wanted.
            let arm = 0.012 * limit;
            let line = |points| Series { label: None, color: color.clone(), points, is_dashed: false };
            [
                line(vec![(from.0 - arm, from.1), (from.0 + arm, from.1)]),
                line(vec![(from.0, from.1 - arm), (from.0, from.1 + arm)]),
                line(vec![from, to]),
            ]
        });
        LineChart {
            title: format!("a*b*: wanted (+) to measured, mean ΔE00 {:.2}", self.mean_delta_e),
            x_label: "a*".to_owned(),
            y_label: "b*".to_owned(),
            x_range: (-limit, limit),
            y_range: (-limit, limit),
            series: series.collect(),
            legend: Corner::TopRight,
            scale: Scale::Linear,
        }
    }

    /// A column a patch.
    fn delta_e_plot(&self) -> LineChart {
        let series = self.patches.iter().enumerate().map(|(i, patch)| {
            let [r, g, b] = patch.wanted_srgb;
            let (left, right) = (i as f64 + 0.7, i as f64 + 1.3);
            let points = vec![(left, 0.0), (left, patch.delta_e), (right, patch.delta_e), (right, 0.0)];
            Series { label: None, color: format!("#{r:02x}{g:02x}{b:02x}"), points, is_dashed: false }
        });
        LineChart {
            title: format!("ΔE00 of the patches: mean {:.2}, largest {:.2}", self.mean_delta_e, self.max_delta_e),
            x_label: "patch, from dark skin to black".to_owned(),
            y_label: "ΔE00".to_owned(),
            x_range: (0.0, 25.0),
            y_range: (0.0, (1.1 * self.max_delta_e).max(0.1)),
            series: series.collect(),
            legend: Corner::TopRight,
            scale: Scale::Linear,
        }
    }
}
