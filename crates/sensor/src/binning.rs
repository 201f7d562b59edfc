//! Pixels of one filter that are read as one: binning.

use serde::{Deserialize, Serialize};

use crate::SensorError;

/// The most pixels each way that are read as one.
const MOST: usize = 16;

/// How many pixels of one filter are read as one, and where they meet.
///
/// Pixels of one filter go together: neighbors in a monochrome sensor and where every filter lies on as many pixels (quad Bayer), otherwise the
/// nearest of the same place of the mosaic's tile, so that a Bayer frame stays one. With `pixels` n each way, N = n², S electrons of light and D of dark
/// current in each, a read noise of r electrons and a step of the converter of q, the signal-to-noise ratio is
///
/// ```text
/// charge     N S / √(N (S + D) +   r² +    q²/12)
/// voltage    N S / √(N (S + D) + N r² + N² q²/12)
/// digital    N S / √(N (S + D) + N r² + N  q²/12)
/// ```
///
/// since variances add: electrons are summed and read once, or read one by one, and the mean of N voltages has N times as many electrons in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Binning {
    /// Where pixels meet.
    pub kind: BinningKind,
    /// How many, each way: 2 to 16.
    pub pixels: usize,
}

/// Where pixels that are read as one meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum BinningKind {
    /// Before the source follower: electrons are summed, and the sum is read once.
    Charge,
    /// After the source followers and before the converter: the mean of their voltages, each with its noise; columns and rows are read once.
    Voltage,
    /// After the converter: its numbers are summed.
    Digital,
}

impl Binning {
    /// The kinds with their names on the command line.
    pub const KINDS: [(&'static str, BinningKind); 3] =
        [("charge", BinningKind::Charge), ("voltage", BinningKind::Voltage), ("digital", BinningKind::Digital)];

    /// Returns the binning of a word, or `None` for `none`: `charge:2`, `voltage:2`, `digital:2`, with as many pixels each way; 2 where they are left
    /// out.
    ///
    /// # Errors
    /// When the word is another, or the number is not from 2 to 16.
    pub fn parse(text: &str) -> Result<Option<Self>, SensorError> {
        let lower = text.trim().to_ascii_lowercase();
        if lower == "none" {
            return Ok(None);
        }
        let (word, number) = lower.split_once(':').unwrap_or((&lower, "2"));
        let kind = Self::KINDS.iter().find(|(name, _)| *name == word).map(|(_, kind)| *kind);
        match (kind, number.trim().parse()) {
            (Some(kind), Ok(pixels)) => {
                let binning = Self { kind, pixels };
                binning.check().map(|()| Some(binning))
            }
            _ => Err(SensorError::Word {
                what: "a binning",
                found: text.to_owned(),
                expected: "none, charge:2, voltage:2, digital:2".to_owned(),
            }),
        }
    }

    pub(crate) fn check(self) -> Result<(), SensorError> {
        match self.pixels {
            2..=MOST => Ok(()),
            n => Err(SensorError::value("the binning", "pixels", n as f64, "2 to 16 pixels each way")),
        }
    }

    /// The number of pixels that are read as one.
    pub fn n(self) -> usize {
        self.pixels * self.pixels
    }
}

impl std::fmt::Display for Binning {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = Self::KINDS.iter().find(|(_, kind)| *kind == self.kind).map_or("", |(name, _)| name);
        write!(formatter, "{name}:{}", self.pixels)
    }
}

/// Which lines (rows or columns) of pixels are read as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLines {
    // Invariants: both are 1 or more.
    pub(crate) period: usize,
    pub(crate) pixels: usize,
}

impl ReadLines {
    /// Every line by itself.
    pub const SINGLE: Self = Self { period: 1, pixels: 1 };

    /// How many are read of so many; what is left over is not read.
    pub fn count(self, n_lines: usize) -> usize {
        n_lines / (self.period * self.pixels) * self.period
    }

    /// Returns the one that a line is read in.
    pub fn read_in(self, line: usize) -> usize {
        line / (self.period * self.pixels) * self.period + line % self.period
    }

    /// Returns the lines that one is read from.
    pub(crate) fn of(self, line: usize) -> impl Iterator<Item = usize> {
        let first = line / self.period * self.period * self.pixels + line % self.period;
        (0..self.pixels).map(move |i| first + i * self.period)
    }
}
