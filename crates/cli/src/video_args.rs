//! The words of `dioptric video`.

use clap::Args;
use dioptric_pipeline::{CameraTurn, VideoSpec};

/// What the options of the motion are grouped under.
const MOTION: &str = "Video";

/// The frames of a video, and how the camera turns.
#[derive(Debug, Args)]
pub(crate) struct TurnArgs {
    /// How many frames are taken [default: those of the camera file, else 24]
    #[arg(long, value_name = "N", help_heading = MOTION)]
    video_frames: Option<usize>,
    /// Frames a second [default: those of the camera file, else 24]
    #[arg(long, value_name = "F", help_heading = MOTION)]
    frames_per_s: Option<f64>,
    /// From one row's readout to the next, µs, 0 for a global shutter [default: that of the sensor's data sheet]
    #[arg(long, value_name = "T", help_heading = MOTION)]
    row_time_us: Option<f64>,
    /// Turns the camera to the right, degrees a second
    #[arg(long, value_name = "W", help_heading = MOTION)]
    pan_deg_per_s: Option<f64>,
    /// Turns the camera upwards, degrees a second
    #[arg(long, value_name = "W", help_heading = MOTION)]
    tilt_deg_per_s: Option<f64>,
    /// Turns the camera clockwise about its axis, degrees a second
    #[arg(long, value_name = "W", help_heading = MOTION)]
    roll_deg_per_s: Option<f64>,
    /// Standard deviation of the shake of a hand about each axis, degrees, drawn from --seed
    #[arg(long, value_name = "A", help_heading = MOTION)]
    shake_deg: Option<f64>,
    /// The middle of the frequencies of the shake, Hz [default: 5]
    #[arg(long, value_name = "F", help_heading = MOTION)]
    shake_hz: Option<f64>,
}

impl TurnArgs {
    /// Returns a video with what is asked for changed.
    pub(crate) fn change(&self, spec: VideoSpec) -> VideoSpec {
        let motion = spec.motion;
        VideoSpec {
            frames: self.video_frames.unwrap_or(spec.frames),
            frames_per_s: self.frames_per_s.unwrap_or(spec.frames_per_s),
            row_time_us: self.row_time_us.or(spec.row_time_us),
            motion: CameraTurn {
                pan_deg_per_s: self.pan_deg_per_s.unwrap_or(motion.pan_deg_per_s),
                tilt_deg_per_s: self.tilt_deg_per_s.unwrap_or(motion.tilt_deg_per_s),
                roll_deg_per_s: self.roll_deg_per_s.unwrap_or(motion.roll_deg_per_s),
                shake_deg: self.shake_deg.unwrap_or(motion.shake_deg),
                shake_hz: self.shake_hz.unwrap_or(motion.shake_hz),
            },
        }
    }
}
