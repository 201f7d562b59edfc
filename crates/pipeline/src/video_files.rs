//! The frames of a video as files.

use std::{fs, path::Path};

use serde::Serialize;

use crate::{Outputs, PipelineError, Video, VideoFrame, VideoFrameFacts, frame_files::write_raw_as, picture_png};

/// What is written of a video beside its frames, `video.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VideoFacts {
    /// The sensor.
    pub sensor: String,
    /// Columns of a frame.
    pub columns: usize,
    /// Rows of a frame.
    pub rows: usize,
    /// Frames a second.
    pub frames_per_s: f64,
    /// The exposure of each row, s.
    pub exposure_time_s: f64,
    /// From the start of one row to that of the next, µs; 0 for a global shutter.
    pub row_time_us: f64,
    /// Samples of a frame in a unit of the tangent of the field.
    pub samples_per_tan: f64,
    /// What a user should know, a sentence each.
    pub notes: Vec<String>,
    /// When each frame was taken, and where the camera pointed.
    pub frames: Vec<VideoFrameFacts>,
}

impl VideoFacts {
    /// Returns what is to be said of a video whose frames were taken.
    pub fn of(video: &Video, frames: Vec<VideoFrameFacts>) -> Self {
        let (rows, columns) = video.size();
        Self {
            sensor: video.sensor.name.clone(),
            columns,
            rows,
            frames_per_s: video.spec.frames_per_s,
            exposure_time_s: video.exposure.time_s,
            row_time_us: video.row_time_us,
            samples_per_tan: video.samples_per_tan,
            notes: video.notes.clone(),
            frames,
        }
    }
}

/// Writes a frame, counted from 0, into a folder: `frame-0001.png`, and where the outputs ask for the raw frame `raw-0001.png`.
///
/// # Errors
/// When a file cannot be written.
pub fn write_video_frame(
    frame: &VideoFrame,
    number: usize,
    outputs: &Outputs,
    folder: &Path,
) -> Result<(), PipelineError> {
    let path = folder.join(format!("frame-{:04}.png", number + 1));
    fs::write(&path, picture_png(&frame.developed.picture)?)
        .map_err(|e| PipelineError::Write { path, reason: e.to_string() })?;
    if outputs.raw && frame.raw.planes.iter().all(|plane| plane.dn().is_some()) {
        write_raw_as(&format!("raw-{:04}", number + 1), &frame.raw, "png", folder)?;
    }
    Ok(())
}
