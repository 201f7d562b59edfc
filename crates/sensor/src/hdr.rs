//! Several exposures of one scene, merged into one frame of more range or less noise.

use ndarray::Array2;

use crate::{Adc, Exposure, Raw, RawPlane, Sensor, SensorError, raw::Levels};

/// Samples above this share of saturation are not used: noise has begun to be clipped there.
const USABLE_BELOW: f32 = 0.95;

impl Exposure {
    /// Returns exposures whose times differ from this one by powers of two: −2 is a quarter of the time.
    pub fn bracket(self, stops: &[f64]) -> Vec<Self> {
        stops.iter().map(|stop| Self { time_s: self.time_s * stop.exp2(), ..self }).collect()
    }
}

impl Sensor {
    /// Merges frames of one scene, of equal exposures (a burst) or different ones (a bracket).
    ///
    /// Each sample is the mean of the rates that the unsaturated frames show, weighted by the inverse of their variance
    /// from shot and read noise; the signal in that variance is the mean of all frames, so that the weights do not lean
    /// on the noise of one. Where all are saturated the shortest counts. The merged frame is in units of the shortest
    /// exposure's saturation, without a converter, and is developed like any other.
    ///
    /// # Errors
    /// When there are no frames, or they differ in size or mosaic, or one was not exposed.
    pub fn merge(&self, frames: &[Raw]) -> Result<Raw, SensorError> {
        let shape = |what, expected: String, found: String| Err(SensorError::Shape { what, expected, found });
        let Some(first) = frames.first() else {
            return shape("frames to merge", "1 or more".to_owned(), "0".to_owned());
        };
        for frame in frames {
            frame.check()?;
            if frame.size() != first.size() || frame.tile != first.tile || frame.filter_names != first.filter_names {
                let text =
                    |frame: &Raw| format!("{} × {} of {}", frame.size().0, frame.size().1, frame.filter_names.join(""));
                return shape("rows × columns and filters of a frame to merge", text(first), text(frame));
            }
            if frame.exposure.time_s <= 0.0 {
                return Err(SensorError::value(
                    "a frame to merge",
                    "time_s",
                    frame.exposure.time_s,
                    "a number above 0",
                ));
            }
        }
        let linear: Vec<Vec<Array2<f32>>> = frames.iter().map(Raw::linear).collect();
        let sources: Vec<Source> = frames.iter().map(|frame| Source::new(self, frame)).collect();
        // What saturates last sets the scale.
        let (shortest, scale) = (0..frames.len())
            .map(|i| (i, sources[i].saturation_e_per_s()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there is a first frame");
        let merge_plane = |plane: usize| {
            let mut merged = linear[shortest][plane].clone();
            ndarray::Zip::indexed(&mut merged).par_for_each(|at, value| {
                let samples = || sources.iter().zip(&linear).map(|(source, planes)| (source, planes[plane][at]));
                *value = (merged_rate(samples).unwrap_or(f64::from(*value) * scale) / scale) as f32;
            });
            RawPlane::Volts(merged)
        };
        let exposure = frames[shortest].exposure;
        let planes = (0..first.planes.len()).map(merge_plane).collect();
        Ok(Raw { planes, levels: self.unit_levels(&exposure), exposure, ..first.clone() })
    }

    /// Returns the levels of samples that are shares of saturation.
    fn unit_levels(&self, exposure: &Exposure) -> Levels {
        let saturation_e = self.saturation_e(exposure);
        let units = Self {
            adc: Adc::Analog,
            response: crate::Response::Linear,
            offset_v: 0.0,
            swing_v: 1.0,
            conversion_gain_v_per_e: 1.0 / saturation_e,
            full_well_e: saturation_e,
            high_gain: None,
            ..self.clone()
        };
        Levels::new(&units, &Exposure { analog_gain: 1.0, ..*exposure })
    }
}

/// What a frame's samples say about the light.
struct Source {
    time_s: f64,
    saturation_e: f64,
    floor_e2: f64,
}

impl Source {
    fn new(sensor: &Sensor, frame: &Raw) -> Self {
        let noise = sensor.sample_noise(frame);
        Self {
            time_s: frame.exposure.time_s,
            saturation_e: frame.levels.saturation_e(),
            floor_e2: noise.floor_e.powi(2),
        }
    }

    fn saturation_e_per_s(&self) -> f64 {
        self.saturation_e / self.time_s
    }
}

/// Returns the merged rate of one pixel, electrons a second, or `None` where every frame is saturated.
fn merged_rate<'a, I: Iterator<Item = (&'a Source, f32)>>(samples: impl Fn() -> I) -> Option<f64> {
    let usable = || samples().filter(|(_, sample)| *sample < USABLE_BELOW);
    let (electrons, time_s) = usable().fold((0.0, 0.0), |(electrons, time_s), (source, sample)| {
        (electrons + f64::from(sample) * source.saturation_e, time_s + source.time_s)
    });
    if time_s == 0.0 {
        return None;
    }
    let rough_e_per_s = (electrons / time_s).max(0.0);
    let (sum, weights) = usable().fold((0.0, 0.0), |(sum, weights), (source, sample)| {
        // One electron keeps a noiseless dark pixel's weight finite.
        let weight = source.time_s.powi(2) / (rough_e_per_s * source.time_s + source.floor_e2 + 1.0);
        (sum + weight * f64::from(sample) * source.saturation_e / source.time_s, weights + weight)
    });
    Some(sum / weights)
}
