//! From linear light to the codes of a picture.

use std::sync::{Arc, LazyLock};

use dioptric_spectrum::{srgb_decode, srgb_encode};
use serde::{Deserialize, Serialize};

use crate::SensorError;

/// How bright the picture is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Brightness {
    /// As exposed: saturation of the least sensitive channel is white.
    #[default]
    AsExposed,
    /// Multiplied by a factor.
    Factor(f64),
    /// The luminance that this share (0–100 %) of all pixels does not exceed is put at `to`, 1 being white.
    Percentile {
        /// 0–100 %.
        percent: f64,
        /// Where it is put.
        to: f64,
    },
}

impl Brightness {
    /// Reads `as-exposed`, a factor, or `P%:TO` for the luminance of a percentile put at a share of white.
    ///
    /// # Errors
    /// When the text is none of these.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let percentile = |(percent, to): (&str, &str)| {
            Some(Self::Percentile { percent: percent.trim().parse().ok()?, to: to.trim().parse().ok()? })
        };
        let known = match text.split_once("%:") {
            Some(parts) => percentile(parts),
            None if text.eq_ignore_ascii_case("as-exposed") => Some(Self::AsExposed),
            None => text.trim().parse().ok().map(Self::Factor),
        };
        known.ok_or_else(|| SensorError::Word {
            what: "the brightness",
            found: text.to_owned(),
            expected: "as-exposed, a factor as 1.5, or a percentile and where it is put as 99%:0.9".to_owned(),
        })
    }
}

/// The curve from linear light to codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum ToneCurve {
    /// None: codes are linear light.
    Linear,
    /// The curve of sRGB and Display P3 (IEC 61966-2-1).
    #[default]
    Srgb,
    /// A power law: code = light^exponent.
    Gamma(f64),
    /// The curve of sRGB after an S about middle gray; 0 is none, 1 strong.
    Filmic {
        /// 0 to 1.
        contrast: f64,
    },
}

impl ToneCurve {
    /// Reads `linear`, `srgb`, `gamma:EXPONENT` or `filmic:CONTRAST`.
    ///
    /// # Errors
    /// When the text is none of these.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let word = text.to_ascii_lowercase();
        let known = match word.split_once(':') {
            Some(("gamma", exponent)) => exponent.trim().parse().ok().map(Self::Gamma),
            Some(("filmic", contrast)) => contrast.trim().parse().ok().map(|contrast| Self::Filmic { contrast }),
            None if word == "linear" => Some(Self::Linear),
            None if word == "srgb" => Some(Self::Srgb),
            _ => None,
        };
        known.ok_or_else(|| SensorError::Word {
            what: "the tone curve",
            found: text.to_owned(),
            expected: "linear, srgb, gamma:EXPONENT as gamma:0.45, filmic:CONTRAST as filmic:0.5".to_owned(),
        })
    }

    pub(crate) fn check(self) -> Result<(), SensorError> {
        let (key, value, right) = match self {
            Self::Linear | Self::Srgb => return Ok(()),
            Self::Gamma(exponent) => ("curve.gamma", exponent, exponent > 0.0 && exponent.is_finite()),
            Self::Filmic { contrast } => ("curve.contrast", contrast, (0.0..=1.0).contains(&contrast)),
        };
        let expected = "a number above 0 (gamma), from 0 to 1 (contrast)";
        if right { Ok(()) } else { Err(SensorError::value("the processing", key, value, expected)) }
    }

    /// Returns the code, 0–1, of linear light; light outside 0–1 is clipped.
    pub fn encode(self, light: f64) -> f64 {
        let light = light.clamp(0.0, 1.0);
        match self {
            Self::Linear => light,
            Self::Srgb => srgb_encode(light),
            Self::Gamma(exponent) => light.powf(exponent),
            Self::Filmic { contrast } => {
                // In codes, so that the S is about middle gray: a blend with the smooth step 3 x² − 2 x³.
                let code = srgb_encode(light);
                code + contrast * (code * code * (3.0 - 2.0 * code) - code)
            }
        }
    }

    /// Returns the linear light of a code, 0–1: [`encode`](Self::encode) undone; codes outside 0–1 are clipped.
    pub fn decode(self, code: f64) -> f64 {
        let code = code.clamp(0.0, 1.0);
        match self {
            Self::Linear => code,
            Self::Srgb => srgb_decode(code),
            Self::Gamma(exponent) => code.powf(1.0 / exponent),
            Self::Filmic { contrast } => {
                // The blend with the smooth step rises from 0 to 1, of a slope of 1 − contrast or more: halving finds its inverse.
                let blend = |x: f64| x + contrast * (x * x * (3.0 - 2.0 * x) - x);
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..f64::MANTISSA_DIGITS {
                    let middle = 0.5 * (low + high);
                    if blend(middle) < code {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                srgb_decode(0.5 * (low + high))
            }
        }
    }

    /// Returns the curve as a table that is read with straight lines between its entries.
    pub(crate) fn table(self) -> ToneTable {
        // For a small picture its powers take longer than all other processing.
        static SRGB: LazyLock<Arc<[f32]>> = LazyLock::new(|| entries(ToneCurve::Srgb));
        ToneTable(if self == Self::Srgb { SRGB.clone() } else { entries(self) })
    }
}

/// Enough steps that straight lines between them are within 1e-6 of sRGB, less than a sixteenth of a 16-bit code.
const TABLE_STEPS: usize = 1 << 16;

fn entries(curve: ToneCurve) -> Arc<[f32]> {
    (0..=TABLE_STEPS).map(|i| curve.encode(i as f64 / TABLE_STEPS as f64) as f32).collect()
}

/// A tone curve as a table.
pub(crate) struct ToneTable(Arc<[f32]>);

impl ToneTable {
    #[inline]
    #[expect(clippy::manual_clamp, reason = "clamp would keep what is no number, which max turns into 0")]
    pub(crate) fn encode(&self, light: f32) -> f32 {
        let place = light.max(0.0).min(1.0) * TABLE_STEPS as f32;
        let below = (place as usize).min(TABLE_STEPS - 1);
        let (low, high) = (self.0[below], self.0[below + 1]);
        low + (high - low) * (place - below as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn words_name_brightness_and_curves() {
        for (text, brightness) in [
            ("as-exposed", Brightness::AsExposed),
            ("1.5", Brightness::Factor(1.5)),
            ("99%:0.9", Brightness::Percentile { percent: 99.0, to: 0.9 }),
        ] {
            assert_eq!(Brightness::parse(text).unwrap(), brightness);
        }
        for (text, curve) in [
            ("linear", ToneCurve::Linear),
            ("sRGB", ToneCurve::Srgb),
            ("gamma:0.45", ToneCurve::Gamma(0.45)),
            ("filmic:0.5", ToneCurve::Filmic { contrast: 0.5 }),
        ] {
            assert_eq!(ToneCurve::parse(text).unwrap(), curve);
        }
        assert!(Brightness::parse("bright").unwrap_err().to_string().contains("99%:0.9"));
        assert!(ToneCurve::parse("gamma").unwrap_err().to_string().contains("filmic:CONTRAST"));
    }

    #[test]
    fn decoding_undoes_encoding() {
        let filmic = |contrast| ToneCurve::Filmic { contrast };
        for curve in [ToneCurve::Linear, ToneCurve::Srgb, ToneCurve::Gamma(0.45), filmic(0.5), filmic(1.0)] {
            for i in 0..=1000 {
                let light = f64::from(i) / 1000.0;
                // Where the S is flat, at its ends, a code of 64 bits tells light to half of its digits.
                assert_abs_diff_eq!(curve.decode(curve.encode(light)), light, epsilon = 1e-7);
            }
        }
    }

    #[test]
    fn the_table_is_the_curve() {
        for curve in [ToneCurve::Linear, ToneCurve::Srgb, ToneCurve::Filmic { contrast: 0.5 }] {
            let table = curve.table();
            for i in 0..5000 {
                let light = f64::from(i) / 4999.0 * 1.2 - 0.1;
                assert_abs_diff_eq!(f64::from(table.encode(light as f32)), curve.encode(light), epsilon = 1e-6);
            }
            assert_eq!((table.encode(f32::NAN), table.encode(f32::INFINITY)), (0.0, 1.0));
        }
    }

    #[test]
    fn wrong_curves_are_refused() {
        assert!(ToneCurve::Gamma(0.0).check().is_err());
        assert!(ToneCurve::Filmic { contrast: 2.0 }.check().is_err());
        assert!(ToneCurve::Gamma(0.6).check().is_ok());
    }
}
