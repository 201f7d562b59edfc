//! The files of a run: irradiance, frames, picture, `report.json` and a self-contained `report.html`.

mod html;
mod page;

use std::path::Path;

use dioptric_analysis::{RunCharts, RunPlaces, RunReport, SensorStatistics};
use dioptric_pipeline::{
    Capture, IRRADIANCE_FILE, Outputs, PipelineError, Sensed, Shot, write_file, write_frames, write_json,
};
use dioptric_scene::write_planes_exr;

/// Writes everything of a run but the irradiance, which was streamed, into a folder, and returns the report.
///
/// `timings_s` is what the caller measured of each stage; the library reads no clock.
///
/// # Errors
/// When a file cannot be written.
pub fn write_run(
    shot: &Shot,
    capture: &Capture,
    folder: &Path,
    timings_s: &[(String, f64)],
) -> Result<RunReport, PipelineError> {
    let outputs = &shot.camera.outputs;
    let mut files = Vec::new();
    if outputs.irradiance {
        files.push(IRRADIANCE_FILE.to_owned());
    }
    if outputs.depth {
        let depth = shot.scene.require_depth()?;
        write_planes_exr(&folder.join("depth.exr"), &[("Z", depth.z_m())], true)?;
        files.push("depth.exr".to_owned());
    }
    let (frame_files, png) = write_frames(&capture.frames(shot), &capture.developed.picture, outputs, folder)?;
    files.extend(frame_files);
    let report = RunReport::new(shot, capture, timings_s, files)?;
    write_json(&folder.join("report.json"), &report)?;
    let places = RunPlaces::of(shot, capture);
    let charts = RunCharts::of(shot, capture, &places, &report.sensor);
    let page = html::Page { shot, capture, report: &report, places: &places, charts: &charts, picture_png: &png };
    write_file(&folder.join("report.html"), page::render(&page)?.as_bytes())?;
    Ok(report)
}

/// Writes the frames, the picture and `report.json` of a sensor exposed to an irradiance image; returns the numbers.
///
/// # Errors
/// When a file cannot be written.
pub fn write_sensed(sensed: &Sensed, outputs: &Outputs, folder: &Path) -> Result<SensorStatistics, PipelineError> {
    let frames = sensed.frames();
    let statistics = SensorStatistics::new(&frames)?;
    write_frames(&frames, &sensed.developed.picture, outputs, folder)?;
    write_json(&folder.join("report.json"), &statistics)?;
    Ok(statistics)
}
