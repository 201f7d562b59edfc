//! Measurements as files: numbers, their charts as drawings, and both on a page.

use std::path::Path;

use dioptric_analysis::{LineChart, measure::Measurement};
use dioptric_pipeline::{PipelineError, write_file, write_json};

use crate::{chart_svg, page, write_drawing};

/// The size of a plot, px.
const PLOT_PX: (f64, f64) = (640.0, 420.0);
/// Pixels of a PNG for each of the plot's own.
const PNG_SCALE: f64 = 2.0;

/// What the page of a measurement says besides its charts.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementWords<'a> {
    /// The name of its file of numbers.
    pub name: &'a str,
    /// What was measured.
    pub title: &'a str,
    /// On what.
    pub subject: &'a str,
    /// The numbers as lines of text.
    pub table: &'a str,
}

/// Writes `NAME.json`, `NAME.csv` of a table, every chart as [a drawing](write_drawing), and `report.html` with all of them into a folder.
///
/// # Errors
/// When a file cannot be written.
pub fn write_measurement(
    measured: &impl Measurement,
    words: &MeasurementWords<'_>,
    folder: &Path,
) -> Result<(), PipelineError> {
    write_json(&folder.join(format!("{}.json", words.name)), measured)?;
    if let Some(csv) = measured.csv() {
        write_file(&folder.join(format!("{}.csv", words.name)), csv.as_bytes())?;
    }
    let charts: Vec<(String, LineChart)> = measured.charts();
    for (name, chart) in &charts {
        write_drawing(&chart_svg(chart, PLOT_PX.0, PLOT_PX.1), folder, name, PNG_SCALE)?;
    }
    let mut body = String::new();
    if !charts.is_empty() {
        body += &page::section("Charts", &page::charts(charts.iter().map(|(_, chart)| chart)));
    }
    body += &page::section("Numbers", &page::lines(words.table));
    write_file(&folder.join("report.html"), page::page(words.title, words.subject, &body).as_bytes())
}
