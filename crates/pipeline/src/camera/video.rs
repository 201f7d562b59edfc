//! A film of a camera that turns.

use std::f64::consts::TAU;

use dioptric_sensor::ImagePlace;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Camera, FramesSpec, SceneSource, check::Checker};
use crate::PipelineError;

/// The most frames of a video.
const MOST_FRAMES: usize = 100_000;
/// The waves of which a shake is the sum.
const WAVES: u32 = 8;

/// Frames taken one after the other by a camera that turns about its entrance pupil, row by row where its shutter rolls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct VideoSpec {
    /// How many frames are taken.
    pub frames: usize,
    /// Frames a second.
    pub frames_per_s: f64,
    /// The time from one row's readout to the next, µs, 0 for a global shutter; that of the sensor's data sheet if left out.
    pub row_time_us: Option<f64>,
    /// How the camera turns.
    pub motion: CameraTurn,
}

impl Default for VideoSpec {
    /// A second at 24 frames a second of a camera at rest.
    fn default() -> Self {
        Self { frames: 24, frames_per_s: 24.0, row_time_us: None, motion: CameraTurn::default() }
    }
}

/// How a camera turns about its entrance pupil, from where it is at the start of the first frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct CameraTurn {
    /// To the right, degrees a second: what is seen moves to the left.
    pub pan_deg_per_s: f64,
    /// Upwards, degrees a second: what is seen moves down.
    pub tilt_deg_per_s: f64,
    /// Clockwise as the photographer stands behind it, degrees a second: what is seen turns the other way.
    pub roll_deg_per_s: f64,
    /// Standard deviation of the shake of a hand about each of the three axes, degrees.
    pub shake_deg: f64,
    /// The middle of its frequencies, which lie within a factor of 2, Hz.
    pub shake_hz: f64,
}

impl Default for CameraTurn {
    /// At rest.
    fn default() -> Self {
        Self { pan_deg_per_s: 0.0, tilt_deg_per_s: 0.0, roll_deg_per_s: 0.0, shake_deg: 0.0, shake_hz: 5.0 }
    }
}

impl VideoSpec {
    /// When the exposure of the first row of a frame begins, s.
    pub fn start_s(&self, frame: usize) -> f64 {
        frame as f64 / self.frames_per_s
    }

    /// Checks the numbers, and that the rest of the camera allows a video.
    pub(super) fn check(&self, camera: &Camera, checker: &Checker<'_>) -> Result<(), PipelineError> {
        checker.count("frames", self.frames, 1..=MOST_FRAMES)?;
        checker.number("frames_per_s", self.frames_per_s)?;
        if let Some(row_time_us) = self.row_time_us {
            checker.number("row_time_us", row_time_us)?;
        }
        let CameraTurn { pan_deg_per_s, tilt_deg_per_s, roll_deg_per_s, shake_deg, shake_hz } = self.motion;
        for (key, value) in
            [("pan_deg_per_s", pan_deg_per_s), ("tilt_deg_per_s", tilt_deg_per_s), ("roll_deg_per_s", roll_deg_per_s)]
        {
            checker.number(key, value)?;
        }
        checker.number("shake_deg", shake_deg)?;
        checker.number("shake_hz", shake_hz)?;
        let with = |what: &str| format!("{what}, with video");
        if camera.frames != FramesSpec::Single {
            checker.wrong("frames", "bursts, brackets or interleaved rows", &with("Single"))?;
        }
        if camera.dual_pixel.is_some() {
            checker.wrong("dual_pixel", "photodiodes read one by one", &with("whole pixels"))?;
        }
        if camera.crop.is_some() {
            checker.wrong("crop", "a part of the film", &with("the whole film"))?;
        }
        if camera.light_field.is_some() {
            checker.wrong("light_field", "a light-field camera", &with("none"))?;
        }
        match &camera.scene.source {
            SceneSource::World(world) if world.backward().is_some() => {
                checker.wrong("method", "Backward", &with("Forward: frames are taken from one irradiance"))
            }
            _ => Ok(()),
        }
    }
}

/// The turns of a camera over time, those of a hand drawn from a seed.
#[derive(Clone, Debug)]
pub struct TurnPath {
    motion: CameraTurn,
    /// Frequency, Hz, and phase of the waves of each axis: pan, tilt, roll.
    waves: [Vec<(f64, f64)>; 3],
}

impl TurnPath {
    /// Returns the path of a motion.
    pub fn new(motion: CameraTurn, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut axis = || -> Vec<(f64, f64)> {
            // Even in the logarithm of the frequency over two octaves, each moved within its part so that they have no common period.
            let octave = |wave: u32, within: f64| 2.0 * (f64::from(wave) + within) / f64::from(WAVES) - 1.0;
            (0..WAVES)
                .map(|wave| (motion.shake_hz * octave(wave, random.random()).exp2(), TAU * random.random::<f64>()))
                .collect()
        };
        Self { motion, waves: [axis(), axis(), axis()] }
    }

    /// Returns pan, tilt and roll at a time from that at the time 0, degrees.
    pub fn turned_deg(&self, time_s: f64) -> [f64; 3] {
        let CameraTurn { pan_deg_per_s, tilt_deg_per_s, roll_deg_per_s, shake_deg, .. } = self.motion;
        let rates = [pan_deg_per_s, tilt_deg_per_s, roll_deg_per_s];
        // Each wave has an equal part of the variance.
        let amplitude_deg = shake_deg * (2.0 / f64::from(WAVES)).sqrt();
        let shaken = |axis: usize, time_s: f64| -> f64 {
            self.waves[axis].iter().map(|(hz, phase)| (TAU * hz * time_s + phase).sin()).sum()
        };
        [0, 1, 2].map(|axis| rates[axis] * time_s + amplitude_deg * (shaken(axis, time_s) - shaken(axis, 0.0)))
    }

    /// Returns where the camera sees what at a time, samples of an image that has so many of them in a unit of the tangent.
    ///
    /// The picture is taken to be without distortion: a place x, y off axis is seen in the direction (x, y, f).
    pub fn place_at(&self, time_s: f64, samples_per_tan: f64) -> ImagePlace {
        let [pan, tilt, roll] = self.turned_deg(time_s).map(|deg| deg.to_radians().sin_cos());
        // Right, down, ahead: roll first, then tilt, then pan.
        let rolled = [[roll.1, -roll.0, 0.0], [roll.0, roll.1, 0.0], [0.0, 0.0, 1.0]];
        let tilted = [[1.0, 0.0, 0.0], [0.0, tilt.1, -tilt.0], [0.0, tilt.0, tilt.1]];
        let panned = [[pan.1, 0.0, pan.0], [0.0, 1.0, 0.0], [-pan.0, 0.0, pan.1]];
        let turned = times(&panned, &times(&tilted, &rolled));
        let f = samples_per_tan;
        // Places are in samples: directions are (x / f, y / f, 1).
        let scale = |row: usize, column: usize| if row < 2 { f } else { 1.0 } / if column < 2 { f } else { 1.0 };
        [0, 1, 2].map(|row| [0, 1, 2].map(|column| scale(row, column) * turned[row][column]))
    }
}

fn times(a: &ImagePlace, b: &ImagePlace) -> ImagePlace {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| (0..3).map(|k| a[row][k] * b[k][column]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(motion: CameraTurn, time_s: f64, [x, y]: [f64; 2]) -> [f64; 2] {
        let place = TurnPath::new(motion, 1).place_at(time_s, 1000.0);
        let [u, v, w] = [0, 1, 2].map(|i| place[i][0] * x + place[i][1] * y + place[i][2]);
        [u / w, v / w]
    }

    #[track_caller]
    fn check(motion: CameraTurn, from: [f64; 2], expected: [f64; 2]) {
        let found = seen(motion, 1.0, from);
        assert!((found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-9, "{found:?}");
    }

    #[test]
    fn a_turned_camera_sees_what_lies_there() {
        let tan = 1000.0 * 2f64.to_radians().tan();
        let rest = CameraTurn::default();
        check(rest, [12.0, -7.0], [12.0, -7.0]);
        // To the right the middle sees what was 2° to the right; upwards, what was above.
        check(CameraTurn { pan_deg_per_s: 2.0, ..rest }, [0.0, 0.0], [tan, 0.0]);
        check(CameraTurn { tilt_deg_per_s: 2.0, ..rest }, [0.0, 0.0], [0.0, -tan]);
        // What was 2° to the left of the axis, panned by 4°, is 2° to the right of the old one.
        check(CameraTurn { pan_deg_per_s: 4.0, ..rest }, [-tan, 0.0], [tan, 0.0]);
        // Turned clockwise by a quarter, the right of the frame sees what was below.
        check(CameraTurn { roll_deg_per_s: 90.0, ..rest }, [100.0, 0.0], [0.0, 100.0]);
    }

    #[test]
    fn a_shake_has_its_deviation_and_its_seed() {
        let motion = CameraTurn { shake_deg: 0.1, ..CameraTurn::default() };
        let path = TurnPath::new(motion, 7);
        assert_eq!(path.turned_deg(0.0), [0.0; 3]);
        for axis in 0..3 {
            let turned: Vec<f64> = (0..20_000).map(|i| path.turned_deg(0.01 * f64::from(i))[axis]).collect();
            let mean = turned.iter().sum::<f64>() / 20_000.0;
            let deviation = (turned.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 20_000.0).sqrt();
            // Eight waves over a thousand periods: what is left of their products.
            assert!((deviation / 0.1 - 1.0).abs() < 0.02, "{deviation}");
        }
        assert_eq!(path.turned_deg(0.3), TurnPath::new(motion, 7).turned_deg(0.3));
        assert_ne!(path.turned_deg(0.3), TurnPath::new(motion, 8).turned_deg(0.3));
    }
}
