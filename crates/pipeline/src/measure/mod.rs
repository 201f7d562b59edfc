//! What a laboratory measures: pictures and frames in, numbers and plots out.

mod chart;
mod compare;
mod edge;
mod frames;
mod noise;
mod noise_plots;
mod open;
mod points;
mod region;

use std::{fs, path::Path};

use serde::Serialize;

pub use chart::{ChartMeasurement, ChartRequest, PatchRow};
pub use compare::{CompareRequest, Comparison, DeltaESummary};
pub use edge::{EdgeChannel, EdgeMeasurement, EdgeRequest, UnmeasuredChannel};
pub use noise::{BenchRequest, NoiseData, NoiseDataSheet, NoisePoint, measure_bench, measure_frames};
pub use open::{CodeCurve, MeasuredPicture};
pub use points::{PointRequest, PointRow, PointSet};
pub use region::PixelRegion;

use crate::{LineChart, PipelineError, report::write_json, svg_to_png};

/// The size of a plot, px.
const PLOT_PX: (f64, f64) = (640.0, 420.0);
/// Pixels of a PNG for each of the plot's own.
const PNG_SCALE: f64 = 2.0;

/// Numbers that were measured, with plots of them.
pub trait Measurement: Serialize {
    /// Returns the plots, each with the name of its file.
    fn plots(&self) -> Vec<(String, Plot)>;

    /// Writes `NAME.json` and every plot as SVG and PNG into a folder.
    ///
    /// # Errors
    /// When a file cannot be written.
    fn write(&self, name: &str, folder: &Path) -> Result<(), PipelineError> {
        write_json(&folder.join(format!("{name}.json")), self)?;
        for (name, plot) in self.plots() {
            let svg = plot.to_svg();
            let files = [("svg", svg.clone().into_bytes()), ("png", svg_to_png(&svg, PNG_SCALE)?)];
            for (extension, bytes) in files {
                let path = folder.join(format!("{name}.{extension}"));
                fs::write(&path, bytes).map_err(|e| PipelineError::Write { path, reason: e.to_string() })?;
            }
        }
        Ok(())
    }
}

/// A plot with straight or logarithmic axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Lines, ranges and words.
    pub chart: LineChart,
    /// Whether both axes are logarithmic.
    pub is_logarithmic: bool,
}

impl Plot {
    fn linear(chart: LineChart) -> Self {
        Self { chart, is_logarithmic: false }
    }

    fn logarithmic(chart: LineChart) -> Self {
        Self { chart, is_logarithmic: true }
    }

    fn to_svg(&self) -> String {
        let (width_px, height_px) = PLOT_PX;
        if self.is_logarithmic {
            self.chart.to_logarithmic_svg(width_px, height_px)
        } else {
            self.chart.to_svg(width_px, height_px)
        }
    }
}

/// The colour of a channel's line: its own where the name is a colour's.
fn channel_color(name: &str) -> String {
    match name {
        "R" => "#c03030".to_owned(),
        "G" => "#208a35".to_owned(),
        "B" => "#2f55c8".to_owned(),
        _ => "#333340".to_owned(),
    }
}
