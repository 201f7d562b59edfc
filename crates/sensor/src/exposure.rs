//! How long the shutter is open, and how that is chosen.

use serde::{Deserialize, Serialize};

use crate::{Binning, Sensor, SensorError};

/// What belongs to a shot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// How long the shutter is open, s; 0 is a bias frame, of read noise and offsets alone.
    pub time_s: f64,
    /// The factor on the voltage after the pixel; 2 doubles the signal.
    #[serde(default = "one")]
    pub analog_gain: f64,
    /// Which readout of a dual-gain pixel is used.
    #[serde(default)]
    pub gain_mode: GainMode,
    /// The temperature of the chip, °C.
    #[serde(default = "room_c")]
    pub temperature_c: f64,
    /// Pixels that are read as one; each by itself if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = null)))]
    pub binning: Option<Binning>,
}

/// A readout of a dual-gain pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum GainMode {
    /// The one every sensor has.
    #[default]
    Low,
    /// The more sensitive one; the same as `Low` where a sensor has no other.
    High,
}

/// How the exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ExposureControl {
    /// By hand; a time of 0 is a bias frame.
    Manual(Exposure),
    /// By metering the light on the sensor.
    Auto(AutoExposure),
}

/// An exposure time chosen by metering.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AutoExposure {
    /// What is metered.
    pub metering: Metering,
    /// Where the metered signal is put, as a share of saturation.
    pub target_fraction: f64,
    /// The longest exposure allowed, infinity for no limit; its gain, readout and temperature are those of the shot.
    #[serde(default = "endless")]
    pub limit: Exposure,
}

/// What an automatic exposure looks at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Metering {
    /// The mean of all pixels.
    Mean,
    /// The mean of all pixels, weighted towards the center with a Gaussian of a quarter of the width and height.
    CenterWeighted,
    /// The brightest pixel.
    Peak,
    /// The pixel that this share (0–100 %) of all pixels does not exceed.
    Percentile(f64),
    /// The same of each filter's pixels by themselves; the filter that gets the most counts, so that none clips.
    EachFilter(f64),
}

fn one() -> f64 {
    1.0
}

const fn room_c() -> f64 {
    25.0
}

fn endless() -> Exposure {
    Exposure::seconds(f64::INFINITY)
}

impl Exposure {
    /// Returns an exposure of this time, of gain 1 and at 25 °C.
    pub const fn seconds(time_s: f64) -> Self {
        Self { time_s, analog_gain: 1.0, gain_mode: GainMode::Low, temperature_c: room_c(), binning: None }
    }

    /// Returns the same exposure with the gain of an ISO speed.
    ///
    /// # Errors
    /// When the sensor does not say which speed its gain of 1 has, or the speed is not above 0.
    pub fn at_iso(self, sensor: &Sensor, iso: f64) -> Result<Self, SensorError> {
        let unity = sensor.iso_at_unity_gain.ok_or_else(|| SensorError::Unsuitable {
            what: "an ISO speed",
            reason: format!("needs iso_at_unity_gain, which {} does not state", sensor.name),
        })?;
        if !(iso > 0.0 && iso.is_finite()) {
            return Err(SensorError::value("the exposure", "iso", iso, "a number above 0"));
        }
        Ok(Self { analog_gain: iso / unity, ..self })
    }

    pub(crate) fn check(&self) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the exposure", key, value, expected));
        if !(self.time_s >= 0.0 && self.time_s.is_finite()) {
            return wrong("time_s", self.time_s, "a number of 0 or more");
        }
        if !(self.analog_gain > 0.0 && self.analog_gain.is_finite()) {
            return wrong("analog_gain", self.analog_gain, "a number above 0");
        }
        if !self.temperature_c.is_finite() {
            return wrong("temperature_c", self.temperature_c, "a finite number");
        }
        self.binning.map_or(Ok(()), Binning::check)
    }

    /// Refuses binning where something is read that cannot be summed.
    pub(crate) fn check_single(&self, what: &'static str) -> Result<(), SensorError> {
        match self.binning {
            None => Ok(()),
            Some(_) => {
                let reason = "cannot be read with binning, expected every pixel by itself".to_owned();
                Err(SensorError::Unsuitable { what, reason })
            }
        }
    }
}

impl ExposureControl {
    /// The shot: its time is that of the hand, or the longest.
    pub const fn shot(&self) -> &Exposure {
        match self {
            Self::Manual(exposure) => exposure,
            Self::Auto(auto) => &auto.limit,
        }
    }

    /// Returns a control of another shot; its time stays that of the hand or the longest.
    #[must_use]
    pub fn with_shot(self, change: impl FnOnce(Exposure) -> Exposure) -> Self {
        match self {
            Self::Manual(exposure) => Self::Manual(change(exposure)),
            Self::Auto(auto) => Self::Auto(AutoExposure { limit: change(auto.limit), ..auto }),
        }
    }

    /// Checks every number, so that a wrong one is found before there is any light.
    ///
    /// # Errors
    /// Names the first number that makes no sense and what was expected: a time of 0 s or more by hand; by metering a
    /// target above 0, a percentile of 0 to 100 and a longest time above 0; a gain above 0 and a finite temperature.
    pub fn check(&self) -> Result<(), SensorError> {
        match self {
            Self::Manual(exposure) => exposure.check(),
            Self::Auto(auto) => auto.check(),
        }
    }
}

impl GainMode {
    /// Returns the mode of a name: `low` or `high`.
    ///
    /// # Errors
    /// When the name is another.
    pub fn parse(name: &str) -> Result<Self, SensorError> {
        match name.to_ascii_lowercase().as_str() {
            "low" => Ok(Self::Low),
            "high" => Ok(Self::High),
            _ => Err(SensorError::Word {
                what: "a readout of a dual-gain pixel",
                found: name.to_owned(),
                expected: "low, high".to_owned(),
            }),
        }
    }
}

impl Metering {
    /// Returns the metering of a word: `mean`, `center`, `peak`, `percentile:P` or `filters:P`, P being 99 where it is left out.
    ///
    /// # Errors
    /// When the word is another, or P is no number from 0 to 100.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let lower = text.to_ascii_lowercase();
        let (word, percent) = match lower.split_once(':') {
            Some((word, number)) => (word, number.trim().parse::<f64>().ok()),
            None => (lower.as_str(), Some(99.0)),
        };
        let metering = match (word, percent) {
            ("mean", _) => Self::Mean,
            ("center" | "centre", _) => Self::CenterWeighted,
            ("peak", _) => Self::Peak,
            ("percentile", Some(percent)) => Self::Percentile(percent),
            ("filters", Some(percent)) => Self::EachFilter(percent),
            _ => {
                return Err(SensorError::Word {
                    what: "a metering",
                    found: text.to_owned(),
                    expected: "mean, center, peak, percentile:99, filters:99".to_owned(),
                });
            }
        };
        metering.check().map(|()| metering)
    }

    pub(crate) fn check(self) -> Result<(), SensorError> {
        match self {
            Self::Percentile(percent) if !(0.0..=100.0).contains(&percent) => {
                Err(SensorError::value("the automatic exposure", "Percentile", percent, "a number from 0 to 100"))
            }
            Self::EachFilter(percent) if !(0.0..=100.0).contains(&percent) => {
                Err(SensorError::value("the automatic exposure", "EachFilter", percent, "a number from 0 to 100"))
            }
            _ => Ok(()),
        }
    }
}

impl AutoExposure {
    fn check(&self) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the automatic exposure", key, value, expected));
        if !(self.target_fraction > 0.0 && self.target_fraction.is_finite()) {
            return wrong("target_fraction", self.target_fraction, "a number above 0");
        }
        if self.limit.time_s.is_nan() || self.limit.time_s <= 0.0 {
            return wrong("limit.time_s", self.limit.time_s, "a number above 0");
        }
        self.metering.check()?;
        // The longest time may be without end, which no exposure is.
        Exposure { time_s: 0.0, ..self.limit }.check()
    }

    /// Returns the metering that puts a share of saturation there, at gain 1 and 25 °C, however long it takes.
    pub const fn new(metering: Metering, target_fraction: f64) -> Self {
        Self { metering, target_fraction, limit: Exposure::seconds(f64::INFINITY) }
    }
}
