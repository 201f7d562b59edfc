//! The files of a run: irradiance, frames, picture, `report.html`, `report.json` and `timings.json`.

mod html;
mod page;

use std::path::Path;

use dioptric_analysis::{Run, RunCharts, RunPlaces, RunReport, RunTimes, SensorStatistics};
use dioptric_pipeline::{
    Outputs, PipelineError, Sensed, irradiance_files, write_file, write_frames, write_frames_and_depth,
    write_irradiance, write_json,
};

/// Writes everything of a run into a folder, and returns the report.
///
/// `times` returns where the time has gone so far, and is asked last of all, so that `timings.json` counts the writing of the
/// other files too; the library reads no clock.
///
/// # Errors
/// When a file cannot be written.
pub fn write_run(
    run: &Run<'_>,
    folder: &Path,
    times: &(dyn Fn() -> RunTimes + Sync),
) -> Result<RunReport, PipelineError> {
    // The largest file is compressed by all threads while the page is drawn by one.
    let (irradiance, report) =
        rayon::join(|| write_irradiance(run.capture, folder), || write_the_rest(run, folder, times));
    irradiance?;
    report
}

/// Writes all but the irradiance.
fn write_the_rest(run: &Run<'_>, folder: &Path, times: &dyn Fn() -> RunTimes) -> Result<RunReport, PipelineError> {
    let (files, png) = write_frames_and_depth(run.capture, run.depth, folder)?;
    let report = RunReport::new(run, irradiance_files(run.capture).into_iter().chain(files).collect())?;
    let places = RunPlaces::of(run);
    let charts = RunCharts::of(run, &places, &report.sensor);
    let page =
        html::Page { run, report: &report, times: &times(), places: &places, charts: &charts, picture_png: &png };
    write_file(&folder.join("report.html"), page::render(&page)?.as_bytes())?;
    write_json(&folder.join("report.json"), &report)?;
    write_json(&folder.join("timings.json"), &times())?;
    Ok(report)
}

/// Writes the frames, the picture and `report.json` of a sensor exposed to an irradiance image; returns the numbers.
///
/// # Errors
/// When a file cannot be written.
pub fn write_sensed(sensed: &Sensed, outputs: &Outputs, folder: &Path) -> Result<SensorStatistics, PipelineError> {
    let frames = sensed.frame_parts();
    let statistics = SensorStatistics::new(&frames)?;
    write_frames(&frames, &sensed.developed.picture, outputs, folder)?;
    write_json(&folder.join("report.json"), &statistics)?;
    Ok(statistics)
}
