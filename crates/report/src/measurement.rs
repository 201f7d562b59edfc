//! Measurements as files: numbers, and their charts as drawings.

use std::path::Path;

use dioptric_analysis::measure::Measurement;
use dioptric_pipeline::{PipelineError, write_json};

use crate::{chart_svg, write_drawing};

/// The size of a plot, px.
const PLOT_PX: (f64, f64) = (640.0, 420.0);
/// Pixels of a PNG for each of the plot's own.
const PNG_SCALE: f64 = 2.0;

/// Writes `NAME.json` and every chart as [a drawing](write_drawing) into a folder.
///
/// # Errors
/// When a file cannot be written.
pub fn write_measurement(measured: &impl Measurement, name: &str, folder: &Path) -> Result<(), PipelineError> {
    write_json(&folder.join(format!("{name}.json")), measured)?;
    for (name, chart) in measured.charts() {
        write_drawing(&chart_svg(&chart, PLOT_PX.0, PLOT_PX.1), folder, &name, PNG_SCALE)?;
    }
    Ok(())
}
