//! One frame, a burst or a bracket of exposures.

use dioptric_sensor::{ElectronRate, Electrons, Exposure, Noise, Raw, Sensor, Volts};
use serde::{Deserialize, Serialize};

use crate::PipelineError;

/// The most frames of one picture.
const MOST: usize = 64;

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
    /// Exposures that differ from the chosen one by powers of two, merged into one of more range; −2 is a quarter of the
    /// time.
    BracketStops(Vec<f64>),
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
    /// All frames merged; none for a single one.
    pub merged: Option<Raw>,
}

impl Exposed {
    /// The frame that becomes the picture.
    pub fn developed_from(&self) -> &Raw {
        self.merged.as_ref().unwrap_or(&self.raw)
    }
}

impl FramesSpec {
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

    /// Takes the frames; each has temporal noise of its own and the same fixed pattern.
    pub(crate) fn expose(
        &self,
        sensor: &Sensor,
        rate: &ElectronRate,
        exposure: &Exposure,
        noise: &Noise,
    ) -> Result<Exposed, PipelineError> {
        self.check()?;
        let exposures = match self {
            Self::Single => vec![*exposure],
            Self::Burst(n) => vec![*exposure; *n],
            Self::BracketStops(stops) => exposure.bracket(stops),
        };
        let (mut first, mut frames) = (None, Vec::new());
        for (exposure, number) in exposures.iter().zip(0..) {
            let noise = noise.frame(number);
            let electrons = sensor.electrons(rate, exposure, &noise)?;
            let volts = sensor.volts(&electrons, exposure, &noise)?;
            frames.push(sensor.digitize(&volts, exposure)?);
            first.get_or_insert((electrons, volts));
        }
        let (electrons, volts) = first.expect("a checked choice has a frame");
        let merged = if *self == Self::Single { None } else { Some(sensor.merge(&frames)?) };
        Ok(Exposed { electrons, volts, raw: frames.swap_remove(0), merged })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn a_burst_has_less_noise_and_its_first_frame_is_the_single_one() {
        let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() };
        let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((64, 64), 2e5)] };
        let shoot =
            |choice: FramesSpec| choice.expose(&sensor, &rate, &Exposure::seconds(0.01), &Noise::all(1)).unwrap();
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
        FramesSpec::BracketStops(vec![-4.0, 0.0]).check().unwrap();
    }
}
