//! Several exposures of one scene, merged into one frame of more range or less noise.

use ndarray::Array2;

use crate::{
    Adc, Exposure, MergedFrame, Raw, RawPlane, Sensor, SensorError,
    denoise::{NoiseTable, SampleNoise},
    raw::Levels,
};

/// Samples above this share of saturation are not used: noise has begun to be clipped there.
pub(crate) const USABLE_BELOW: f32 = 0.95;

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
        self.check_merge(frames)?;
        let sheet = self.as_read(&frames[0].exposure)?;
        let sources = frames.iter().enumerate().map(|(shot, frame)| sheet.source_of(frame, shot)).collect();
        Ok(sheet.merge_as(frames, sources))
    }

    /// Merges frames that were checked, of which it is known what they are in the merge.
    pub(crate) fn merge_as(&self, frames: &[Raw], sources: Vec<MergedFrame>) -> Raw {
        let first = &frames[0];
        let linear: Vec<Vec<Array2<f32>>> = frames.iter().map(Raw::linear).collect();
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
        let saturation_e = sources[shortest].saturation_e * (exposure.time_s / sources[shortest].time_s);
        let levels = self.unit_levels(saturation_e, &exposure);
        Raw { planes, levels, exposure, merged: sources, masked: None, ..first.clone() }
    }

    /// Checks that frames can be merged.
    pub(crate) fn check_merge(&self, frames: &[Raw]) -> Result<(), SensorError> {
        let shape = |what, expected: String, found: String| Err(SensorError::Shape { what, expected, found });
        let Some(first) = frames.first() else {
            return shape("frames to merge", "1 or more".to_owned(), "0".to_owned());
        };
        for frame in frames {
            frame.check()?;
            if frame.size() != first.size()
                || frame.tile != first.tile
                || frame.filter_names != first.filter_names
                || frame.exposure.binning != first.exposure.binning
            {
                let text =
                    |frame: &Raw| format!("{} × {} of {}", frame.size().0, frame.size().1, frame.filter_names.join(""));
                return shape("rows × columns and filters of a frame to merge", text(first), text(frame));
            }
            if !frame.merged.is_empty() {
                let reason = "of merged frames cannot be merged again; give all frames at once".to_owned();
                return Err(SensorError::Unsuitable { what: "a frame", reason });
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
        Ok(())
    }

    /// Merges reads of the same electrons with both gains, a list of pairs: the high gain first, then the low one.
    ///
    /// As [`merge`](Self::merge), but that reads of one exposure have one shot noise: between them the weights are the inverse of the variance
    /// that does not depend on the signal.
    ///
    /// # Errors
    /// When the frames do not fit each other.
    pub fn merge_gains(&self, pairs: &[[Raw; 2]]) -> Result<Raw, SensorError> {
        let frames: Vec<Raw> = pairs.iter().flatten().cloned().collect();
        self.check_merge(&frames)?;
        let sheet = self.as_read(&frames[0].exposure)?;
        let sources = frames.iter().enumerate().map(|(number, frame)| sheet.source_of(frame, number / 2)).collect();
        Ok(sheet.merge_as(&frames, sources))
    }

    /// Returns what a frame is in a merge.
    pub(crate) fn source_of(&self, frame: &Raw, shot: usize) -> MergedFrame {
        MergedFrame {
            time_s: frame.exposure.time_s,
            saturation_e: frame.levels.saturation_e(),
            floor_e: self.noise_floor_e(frame),
            shot,
        }
    }

    /// Returns the levels of samples that are shares of so many electrons.
    pub(crate) fn unit_levels(&self, saturation_e: f64, exposure: &Exposure) -> Levels {
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

/// What the reads of one exposure tell together.
#[derive(Clone, Copy)]
struct Shot {
    time_s: f64,
    /// Electrons, the mean of the reads.
    electrons: f64,
    /// The square of its noise that does not depend on the signal.
    floor_e2: f64,
}

/// The exposures of reads, of which those of one exposure follow each other.
struct Shots<I: Iterator> {
    reads: std::iter::Peekable<I>,
}

impl<'a, I: Iterator<Item = (&'a MergedFrame, f64)>> Iterator for Shots<I> {
    type Item = Shot;

    fn next(&mut self) -> Option<Shot> {
        let (first, electrons) = self.reads.next()?;
        let weight = |read: &MergedFrame| (read.floor_e.powi(2) + 1.0).recip();
        let (mut sum, mut weights) = (weight(first) * electrons, weight(first));
        while let Some((read, electrons)) = self.reads.next_if(|(read, _)| read.shot == first.shot) {
            sum += weight(read) * electrons;
            weights += weight(read);
        }
        // One electron keeps a noiseless dark pixel's weight finite.
        Some(Shot { time_s: first.time_s, electrons: sum / weights, floor_e2: weights.recip() })
    }
}

impl Shot {
    /// The inverse of the variance of the rate that it shows, where light is of a rate.
    fn weight(&self, e_per_s: f64) -> f64 {
        self.time_s.powi(2) / (e_per_s * self.time_s + self.floor_e2)
    }
}

/// Returns the merged rate of one pixel, electrons a second, or `None` where every frame is saturated.
fn merged_rate<'a, I: Iterator<Item = (&'a MergedFrame, f32)>>(samples: impl Fn() -> I) -> Option<f64> {
    let shots = || {
        let usable = samples().filter(|(_, sample)| *sample < USABLE_BELOW);
        Shots { reads: usable.map(|(source, sample)| (source, f64::from(sample) * source.saturation_e)).peekable() }
    };
    let (electrons, time_s) =
        shots().fold((0.0, 0.0), |(electrons, time_s), shot| (electrons + shot.electrons, time_s + shot.time_s));
    if time_s == 0.0 {
        return None;
    }
    let rough_e_per_s = (electrons / time_s).max(0.0);
    let (sum, weights) = shots().fold((0.0, 0.0), |(sum, weights), shot| {
        let weight = shot.weight(rough_e_per_s);
        (sum + weight * shot.electrons / shot.time_s, weights + weight)
    });
    Some(sum / weights)
}

/// Returns the noise of a merged frame's samples, which are shares of the saturation that comes last.
///
/// At each level it is that of the mean over the frames that are not saturated there.
pub(crate) fn merged_noise(frames: &[MergedFrame]) -> SampleNoise {
    let scale = frames.iter().map(MergedFrame::saturation_e_per_s).fold(0.0, f64::max);
    let deviation = |sample: f64| {
        let e_per_s = sample.max(0.0) * scale;
        let is_usable = |frame: &&MergedFrame| e_per_s < f64::from(USABLE_BELOW) * frame.saturation_e_per_s();
        let weight_of = |reads: &mut dyn Iterator<Item = &MergedFrame>| -> f64 {
            let shots = Shots { reads: reads.map(|frame| (frame, 0.0)).peekable() };
            shots.map(|shot| shot.weight(e_per_s)).sum()
        };
        let weights = weight_of(&mut frames.iter().filter(is_usable));
        let last = frames.iter().max_by(|a, b| a.saturation_e_per_s().total_cmp(&b.saturation_e_per_s()));
        let weights = if weights > 0.0 { weights } else { weight_of(&mut last.into_iter()) };
        weights.sqrt().recip() / scale
    };
    SampleNoise::Table(NoiseTable::new(&deviation))
}
