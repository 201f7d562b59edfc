//! One frame, a burst or a bracket of exposures.

use std::borrow::Cow;

use dioptric_sensor::{
    DisparityMap, DisparitySearch, ElectronRate, Electrons, Exposure, GainMode, Interleaved, Noise, Raw, Sensor,
    SensorError, Volts,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::Photodiodes;
use crate::PipelineError;

/// The most frames of one picture.
const MOST: usize = 64;
/// The farthest that frames are aligned over, pixels of a Bayer mosaic.
const MOST_PX: f64 = 48.0;

/// How many frames a picture is made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum FramesSpec {
    /// One.
    #[default]
    Single,
    /// So many of equal exposure, merged into one of less noise.
    Burst(usize),
    /// So many of equal exposure by a camera that moves between them, aligned tile by tile and merged where they agree.
    MovingBurst {
        /// How many.
        frames: usize,
        /// How far from the first frame the image has moved at the last one, pixels, 0 to 48; between them it goes round on a
        /// spiral.
        motion_px: f64,
    },
    /// Exposures that differ from the chosen one by powers of two, merged into one of more range; −2 is a quarter of the
    /// time.
    BracketStops(Vec<f64>),
    /// One that is read with both gains of a dual-gain pixel, also one whose capacitor takes what overflows the photodiode (LOFIC), merged into one
    /// of more range. The sensor states its `high_gain`.
    BothGains,
    /// One whose rows are exposed for the chosen time and for a part of it in turn, or read with the chosen analog gain and a part of it, merged
    /// into one of more range.
    Interleaved {
        /// The chosen time over that of the short rows: above 1, or 1 where the gains differ.
        ratio: f64,
        /// How many neighboring rows share time and gain; a multiple of the rows after which the mosaic repeats.
        period_rows: usize,
        /// The chosen analog gain over that of the short rows, 1 or more.
        #[serde(default = "same_gain")]
        gain_ratio: f64,
    },
}

fn same_gain() -> f64 {
    1.0
}

/// What a sensor gives for one picture: every stage of the first frame, and all frames merged.
#[derive(Clone, Debug)]
pub struct Exposed {
    /// The electrons at the end of the exposure.
    pub electrons: Electrons,
    /// The voltages at the pixels' outputs, before the analog gain.
    pub volts: Volts,
    /// The frame as the converter gives it.
    pub raw: Raw,
    /// What `raw` is of the picture where it is not all of it, in ASCII.
    pub raw_note: Option<String>,
    /// All frames merged, those of both photodiodes of split pixels among them; none for a single one.
    pub merged: Option<Raw>,
    /// What the small photodiodes of split pixels gave in the first exposure.
    pub small: Option<Raw>,
    /// What each photodiode gave, where they are read one by one: electrons, volts and `raw` are the sums.
    pub photodiodes: Option<PhotodiodeReads>,
}

/// What the photodiodes that share the light of each pixel give in the first exposure.
#[derive(Clone, Debug)]
pub struct PhotodiodeReads {
    /// Which they are.
    pub photodiodes: Photodiodes,
    /// The frame of each, in the order of their names.
    pub frames: Vec<Raw>,
    /// How far the two halves of the pupil see things apart; `None` of frames that are smaller than what is matched.
    pub disparity: Option<DisparityMap>,
}

impl PhotodiodeReads {
    fn of(photodiodes: Photodiodes, frames: Vec<Raw>, sheet: &Sensor) -> Result<Self, SensorError> {
        let search = DisparitySearch::default();
        let (rows, columns) = frames[0].size();
        let disparity = if rows.min(columns) < search.window_px {
            None
        } else {
            let half = |numbers: &[usize]| match *numbers {
                [number] => Ok(frames[number].clone()),
                _ => sheet.sum_reads(&numbers.iter().map(|&number| frames[number].clone()).collect::<Vec<_>>()),
            };
            let [first, second] = photodiodes.halves();
            Some(DisparityMap::of([&half(first)?, &half(second)?], photodiodes.disparity_axis(), &search)?)
        };
        Ok(Self { photodiodes, frames, disparity })
    }
}

impl Exposed {
    /// The frame that becomes the picture.
    pub fn developed_from(&self) -> &Raw {
        self.merged.as_ref().unwrap_or(&self.raw)
    }
}

/// The rate of photo-electrons where the image has moved by so many pixels, down and to the right.
pub(crate) type MovedRate<'a> = dyn Fn([f64; 2]) -> Result<Cow<'a, ElectronRate>, PipelineError> + 'a;

/// Returns where the image lies at each frame of a moving burst, pixels.
fn path_px(frame: usize, n_frames: usize, motion_px: f64) -> [f64; 2] {
    // Steps of the golden angle, so that no direction and no fraction of a pixel comes twice.
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let radius = motion_px * frame as f64 / (n_frames.max(2) - 1) as f64;
    let (sine, cosine) = (GOLDEN_ANGLE * frame as f64).sin_cos();
    [radius * sine, radius * cosine]
}

impl FramesSpec {
    /// The number of frames that are taken.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Single | Self::BothGains | Self::Interleaved { .. } => 1,
            Self::Burst(frames) | Self::MovingBurst { frames, .. } => *frames,
            Self::BracketStops(stops) => stops.len(),
        }
    }

    /// Checks that the number of frames makes sense.
    ///
    /// # Errors
    /// When there are no frames or too many, or a stop is not finite or beyond 32.
    pub fn check(&self) -> Result<(), PipelineError> {
        let wrong = |key, found: String, expected: String| {
            Err(PipelineError::Value { origin: "the frames".to_owned(), key, found, expected })
        };
        match self {
            Self::Burst(n) if *n == 0 || *n > MOST => wrong("Burst", n.to_string(), format!("1 to {MOST} frames")),
            Self::MovingBurst { frames, .. } if *frames == 0 || *frames > MOST => {
                wrong("MovingBurst.frames", frames.to_string(), format!("1 to {MOST} frames"))
            }
            Self::MovingBurst { motion_px, .. } if !(0.0..=MOST_PX).contains(motion_px) => {
                wrong("MovingBurst.motion_px", motion_px.to_string(), format!("0 to {MOST_PX} pixels"))
            }
            Self::Interleaved { gain_ratio, .. } if !(*gain_ratio >= 1.0 && gain_ratio.is_finite()) => {
                wrong("Interleaved.gain_ratio", gain_ratio.to_string(), "1 or more".to_owned())
            }
            Self::Interleaved { ratio, gain_ratio, .. }
                if !(*ratio >= 1.0 && ratio.is_finite()) || ratio * gain_ratio <= 1.0 =>
            {
                let expected = "a number above 1, or 1 where gain_ratio is above it".to_owned();
                wrong("Interleaved.ratio", ratio.to_string(), expected)
            }
            Self::Interleaved { period_rows: 0, .. } => {
                wrong("Interleaved.period_rows", "0".to_owned(), "1 row or more".to_owned())
            }
            Self::BracketStops(stops) if stops.is_empty() || stops.len() > MOST => {
                wrong("BracketStops", format!("{} stops", stops.len()), format!("1 to {MOST}"))
            }
            Self::BracketStops(stops) => match stops.iter().find(|stop| stop.is_nan() || stop.abs() > 32.0) {
                Some(stop) => wrong("BracketStops", stop.to_string(), "stops from -32 to 32".to_owned()),
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }

    /// Checks that frames are such as a sensor takes.
    ///
    /// # Errors
    /// When its pixels are split and frames of another kind are merged, or both gains are asked of a sensor with one, or of one set to the high one.
    pub(crate) fn check_sensor(&self, sensor: &Sensor, gain_mode: GainMode) -> Result<(), PipelineError> {
        let of_whole_pixels = match self {
            Self::MovingBurst { .. } => Some("a burst of a moving camera"),
            Self::Interleaved { .. } => Some("interleaved rows"),
            Self::BothGains => Some("reads with both gains"),
            Self::Single | Self::Burst(_) | Self::BracketStops(_) => None,
        };
        if let Some(what) = of_whole_pixels.filter(|_| sensor.split_pixel.is_some()) {
            let reason =
                "cannot be merged where pixels are split; expected frames: Single, Burst or BracketStops".to_owned();
            return Err(PipelineError::Unsuitable { what, reason });
        }
        let refused = |reason: String| Err(PipelineError::Unsuitable { what: "frames: BothGains", reason });
        match (self, &sensor.high_gain, gain_mode) {
            (Self::BothGains, Some(high), _) if high.conversion_gain_v_per_e <= sensor.conversion_gain_v_per_e => {
                refused(format!(
                    "need a high_gain above the other gain, {} states {} of {} V an electron",
                    sensor.name, high.conversion_gain_v_per_e, sensor.conversion_gain_v_per_e
                ))
            }
            (Self::BothGains, None, _) => refused(format!("need high_gain, which {} does not state", sensor.name)),
            (Self::BothGains, Some(_), GainMode::High) => {
                refused("are read with both, expected gain_mode: Low, for whose saturation they are exposed".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Returns what the first frame is of the picture where it is not all of it, in ASCII.
    fn raw_note(&self, sensor: &Sensor) -> Option<String> {
        let of_several = match self {
            Self::Single => None,
            Self::BothGains => {
                Some("the read of pixels with their high gain, without that with the low one".to_owned())
            }
            Self::Burst(n) | Self::MovingBurst { frames: n, .. } => {
                (*n > 1).then(|| format!("the first of {n} frames of a burst"))
            }
            Self::BracketStops(stops) => {
                (stops.len() > 1).then(|| format!("the first of {} frames of a bracket", stops.len()))
            }
            Self::Interleaved { ratio, period_rows: n, gain_ratio: 1.0 } => Some(format!(
                "rows of two exposure times in turn, not merged: {n} of the stated time, then {n} of 1/{ratio} of it"
            )),
            Self::Interleaved { ratio, period_rows: n, gain_ratio } => Some(format!(
                "rows of two exposures in turn, not merged: {n} of the stated time and gain, then {n} of 1/{ratio} of the time and \
                 1/{gain_ratio} of the gain"
            )),
        };
        let of_pixels =
            sensor.split_pixel.map(|_| "the large photodiodes of split pixels, without the small ones".to_owned());
        let parts: Vec<String> = of_several.into_iter().chain(of_pixels).collect();
        (!parts.is_empty()).then(|| format!("this raw frame holds {}", parts.join("; ")))
    }

    /// Takes the frames; each has temporal noise of its own and the same fixed pattern.
    pub(crate) fn expose(
        &self,
        sensor: &Sensor,
        rate: &MovedRate<'_>,
        exposure: &Exposure,
        noise: &Noise,
    ) -> Result<Exposed, PipelineError> {
        self.check()?;
        let exposures = match self {
            Self::Single => vec![*exposure],
            Self::Burst(n) | Self::MovingBurst { frames: n, .. } => vec![*exposure; *n],
            Self::BracketStops(stops) => exposure.bracket(stops),
            Self::BothGains => {
                let exposed = expose_both_gains(sensor, rate, exposure, noise)?;
                return Ok(Exposed { raw_note: self.raw_note(sensor), ..exposed });
            }
            &Self::Interleaved { ratio, period_rows, gain_ratio } => {
                let rows = Interleaved { ratio, period_rows, gain_ratio };
                let exposed = expose_interleaved(sensor, rate, exposure, &rows, noise)?;
                return Ok(Exposed { raw_note: self.raw_note(sensor), ..exposed });
            }
        };
        let small_sensor = sensor.small_photodiode();
        let mut small_frames = Vec::new();
        let (mut first, mut frames) = (None, Vec::new());
        for (number, exposure) in exposures.iter().enumerate() {
            let moved_px = match self {
                Self::MovingBurst { motion_px, .. } => path_px(number, exposures.len(), *motion_px),
                _ => [0.0; 2],
            };
            let noise = noise.frame(number as u64);
            let rate = rate(moved_px)?;
            let electrons = sensor.electrons(&rate, exposure, &noise)?;
            let volts = sensor.volts(&electrons, exposure, &noise)?;
            frames.push(sensor.digitize(&volts, exposure)?);
            if let (Some(small), Some(rate)) = (&small_sensor, sensor.small_rate(&rate)) {
                small_frames.push(digitized(small, &rate, exposure, &noise.of_small_photodiode())?);
            }
            if first.is_none() {
                first = Some((sensor.lit_electrons(electrons), sensor.lit_volts(volts, exposure)?));
            }
        }
        let (electrons, volts) = first.expect("a checked choice has a frame");
        let merged = match self {
            _ if small_sensor.is_some() => Some(sensor.merge_split(&frames, &small_frames)?),
            Self::MovingBurst { .. } => Some(sensor.merge_moving(&frames)?),
            Self::Burst(_) | Self::BracketStops(_) => Some(sensor.merge(&frames)?),
            Self::Single | Self::BothGains | Self::Interleaved { .. } => None,
        };
        let raw_note = self.raw_note(sensor);
        let small = small_frames.into_iter().next();
        Ok(Exposed { electrons, volts, raw: frames.swap_remove(0), raw_note, merged, small, photodiodes: None })
    }

    /// Takes the frames of a sensor whose photodiodes are read one by one, each with noise of its own.
    pub(crate) fn expose_photodiodes(
        &self,
        sensor: &Sensor,
        kind: Photodiodes,
        rates: &[ElectronRate],
        exposure: &Exposure,
        noise: &Noise,
    ) -> Result<Exposed, PipelineError> {
        self.check()?;
        let exposures = match self {
            Self::Single => vec![*exposure],
            Self::Burst(n) => vec![*exposure; *n],
            Self::BracketStops(stops) => exposure.bracket(stops),
            Self::MovingBurst { .. } | Self::BothGains | Self::Interleaved { .. } => {
                let reason = "are not read photodiode by photodiode, expected Single, Burst or BracketStops".to_owned();
                return Err(PipelineError::Unsuitable {
                    what: "moving bursts, both gains and interleaved rows",
                    reason,
                });
            }
        };
        let (one, sum) = (sensor.photodiode(rates.len())?, sensor.of_summed_reads(rates.len()));
        let mut first = None;
        let mut frames = Vec::new();
        for (number, exposure) in exposures.iter().enumerate() {
            let noise = noise.frame(number as u64);
            let electrons = sensor.photodiode_electrons(rates, exposure, &noise)?;
            let read = |(photodiode, electrons): (usize, Electrons)| -> Result<_, SensorError> {
                let noise = noise.of_photodiode(photodiode);
                let volts = one.volts(&electrons, exposure, &noise)?;
                let raw = one.digitize(&volts, exposure)?;
                Ok((electrons, volts, raw))
            };
            let mut reads = electrons.into_iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
            let raws: Vec<Raw> = reads.iter().map(|(_, _, raw)| raw.clone()).collect();
            frames.push(sum.sum_reads(&raws)?);
            if first.is_none() {
                let (mut electrons, mut volts, _) = reads.remove(0);
                for (other_electrons, other_volts, _) in reads {
                    add(&mut electrons.planes_e, &other_electrons.planes_e);
                    add(&mut volts.planes_v, &other_volts.planes_v);
                }
                first = Some((electrons, volts, PhotodiodeReads::of(kind, raws, &sum)?));
            }
        }
        let (electrons, volts, photodiodes) = first.expect("a checked choice has a frame");
        let merged = if *self == Self::Single { None } else { Some(sum.merge(&frames)?) };
        let raw_note = self.raw_note(sensor);
        let (raw, photodiodes) = (frames.swap_remove(0), Some(photodiodes));
        Ok(Exposed { electrons, volts, raw, raw_note, merged, small: None, photodiodes })
    }
}

fn add(sums: &mut [Array2<f32>], planes: &[Array2<f32>]) {
    sums.iter_mut().zip(planes).for_each(|(sum, plane)| *sum += plane);
}

/// Takes one frame whose rows have two times in turn, and merges them.
fn expose_interleaved(
    sensor: &Sensor,
    rate: &MovedRate<'_>,
    exposure: &Exposure,
    rows: &Interleaved,
    noise: &Noise,
) -> Result<Exposed, PipelineError> {
    let electrons = sensor.electrons_interleaved(&*rate([0.0; 2])?, exposure, rows, noise)?;
    // Volts depend neither on the time nor on the gain.
    let volts = sensor.volts(&electrons, exposure, noise)?;
    let raw = sensor.digitize_interleaved(&volts, exposure, rows)?;
    let merged = Some(sensor.merge_interleaved(&raw, rows)?);
    Ok(Exposed { electrons, volts, raw, raw_note: None, merged, small: None, photodiodes: None })
}

/// Takes one frame that is read with both gains, and merges the reads.
fn expose_both_gains(
    sensor: &Sensor,
    rate: &MovedRate<'_>,
    exposure: &Exposure,
    noise: &Noise,
) -> Result<Exposed, PipelineError> {
    let electrons = sensor.electrons(&*rate([0.0; 2])?, exposure, noise)?;
    let [high, low] = sensor.read_both_gains(&electrons, exposure, noise)?;
    let merged = Some(sensor.merge_gains(&[[high.raw.clone(), low.raw]])?);
    let of_high = Exposure { gain_mode: GainMode::High, ..*exposure };
    let (electrons, volts) = (sensor.lit_electrons(electrons), sensor.lit_volts(high.volts, &of_high)?);
    Ok(Exposed { electrons, volts, raw: high.raw, raw_note: None, merged, small: None, photodiodes: None })
}

fn digitized(sensor: &Sensor, rate: &ElectronRate, exposure: &Exposure, noise: &Noise) -> Result<Raw, SensorError> {
    let electrons = sensor.electrons(rate, exposure, noise)?;
    sensor.digitize(&sensor.volts(&electrons, exposure, noise)?, exposure)
}

/// Returns the rate of an image that does not move; a moving burst is refused.
pub(crate) fn at_rest<'a>(rate: &'a ElectronRate) -> impl Fn([f64; 2]) -> Result<Cow<'a, ElectronRate>, PipelineError> {
    move |moved_px| {
        if moved_px == [0.0; 2] {
            return Ok(Cow::Borrowed(rate));
        }
        let reason = "needs the irradiance, of which the electrons alone are left here".to_owned();
        Err(PipelineError::Unsuitable { what: "a moving burst", reason })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_has_less_noise_and_its_first_frame_is_the_single_one() {
        let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() };
        let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((64, 64), 2e5)] };
        let shoot = |choice: FramesSpec| {
            choice.expose(&sensor, &at_rest(&rate), &Exposure::seconds(0.01), &Noise::all(1)).unwrap()
        };
        let (single, burst) = (shoot(FramesSpec::Single), shoot(FramesSpec::Burst(16)));
        assert!(single.merged.is_none() && single.raw == burst.raw && single.volts == burst.volts);
        let deviation = |raw: &Raw| f64::from(raw.linear()[0].std(0.0));
        // 4096 pixels: a standard error of 1.1 % of each deviation.
        let ratio = deviation(&single.raw) / deviation(burst.developed_from());
        assert!((ratio / 4.0 - 1.0).abs() < 0.06, "{ratio}");
    }

    #[test]
    fn impossible_numbers_of_frames_are_named() {
        let error = |choice: FramesSpec| choice.check().unwrap_err().to_string();
        assert!(error(FramesSpec::Burst(0)).contains("Burst"));
        assert!(error(FramesSpec::BracketStops(vec![])).contains("0 stops"));
        assert!(error(FramesSpec::BracketStops(vec![f64::NAN])).contains("NaN"));
        assert!(error(FramesSpec::MovingBurst { frames: 4, motion_px: f64::NAN }).contains("motion_px"));
        FramesSpec::BracketStops(vec![-4.0, 0.0]).check().unwrap();
    }

    #[test]
    fn a_moving_camera_ends_where_it_should() {
        let end = path_px(15, 16, 8.0);
        assert!(path_px(0, 16, 8.0) == [0.0; 2] && (end[0].hypot(end[1]) - 8.0).abs() < 1e-12);
        let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((64, 64), 2e5)] };
        let sensor = Sensor::built_in("machine-vision-mono").unwrap();
        let choice = FramesSpec::MovingBurst { frames: 2, motion_px: 1.0 };
        let error = choice.expose(&sensor, &at_rest(&rate), &Exposure::seconds(0.01), &Noise::all(1)).unwrap_err();
        assert!(error.to_string().contains("irradiance"), "{error}");
    }
}
