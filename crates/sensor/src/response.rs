//! From the amplified voltage to digital numbers.

use serde::{Deserialize, Serialize};

/// The curve from the amplified voltage to the converter's input; it maps 0 … swing onto 0 … swing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Response {
    /// A straight line.
    #[default]
    Linear,
    /// swing × ln(1 + v / knee) / ln(1 + swing / knee).
    Logarithmic {
        /// The voltage about which the response turns from linear to logarithmic, V.
        knee_v: f64,
    },
    /// Straight lines from (0, 0) through these points of input and output, both V and ascending, to (swing, swing).
    Companding {
        /// The corners.
        knees_v: Vec<(f64, f64)>,
    },
}

impl Response {
    /// Returns the output for an input of 0 … swing, V.
    pub fn apply(&self, input_v: f64, swing_v: f64) -> f64 {
        match self {
            Self::Linear => input_v,
            Self::Logarithmic { knee_v } => swing_v * (input_v / knee_v).ln_1p() / (swing_v / knee_v).ln_1p(),
            Self::Companding { knees_v } => on_lines(knees_v.iter().copied(), swing_v, input_v),
        }
    }

    /// Returns the input that gives an output of 0 … swing, V.
    pub fn inverse(&self, output_v: f64, swing_v: f64) -> f64 {
        match self {
            Self::Linear => output_v,
            Self::Logarithmic { knee_v } => knee_v * (output_v / swing_v * (swing_v / knee_v).ln_1p()).exp_m1(),
            Self::Companding { knees_v } => {
                on_lines(knees_v.iter().map(|&(input, output)| (output, input)), swing_v, output_v)
            }
        }
    }
}

/// Returns y at x on the lines from (0, 0) through the knees to (end, end).
fn on_lines(knees: impl Iterator<Item = (f64, f64)>, end: f64, x: f64) -> f64 {
    let mut from = (0.0, 0.0);
    for to in knees.chain([(end, end)]) {
        if x <= to.0 {
            return from.1 + (to.1 - from.1) * (x - from.0) / (to.0 - from.0);
        }
        from = to;
    }
    x
}

/// The analog-to-digital converter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Adc {
    /// None: frames stay in volts.
    Analog,
    /// Codes 0 … 2^bits − 1.
    Bits {
        /// 1 to 16.
        bits: u32,
        /// The code of 0 V.
        #[serde(default)]
        black_level_dn: u16,
        /// The step, V; left out, the swing fills the codes from the black level on: swing / (2^bits − black level).
        #[serde(default)]
        step_v: Option<f64>,
    },
}

impl Adc {
    /// Returns the highest code, or `None` without a converter.
    pub fn top_dn(self) -> Option<u16> {
        match self {
            Self::Analog => None,
            Self::Bits { bits, .. } => Some(((1_u32 << bits) - 1) as u16),
        }
    }

    /// Returns the step, V, or `None` without a converter.
    pub fn step_v(self, swing_v: f64) -> Option<f64> {
        match self {
            Self::Analog => None,
            Self::Bits { bits, black_level_dn, step_v } => {
                Some(step_v.unwrap_or(swing_v / (f64::from(1_u32 << bits) - f64::from(black_level_dn))))
            }
        }
    }

    /// Returns the voltage of the highest code, or the swing where that is lower.
    pub fn top_v(self, swing_v: f64) -> f64 {
        match (self, self.top_dn(), self.step_v(swing_v)) {
            (Self::Bits { black_level_dn, .. }, Some(top), Some(step_v)) => {
                (step_v * (f64::from(top) - f64::from(black_level_dn))).min(swing_v)
            }
            _ => swing_v,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn every_response_maps_the_swing_onto_itself_and_back() {
        let companding = Response::Companding { knees_v: vec![(0.1, 0.5), (0.4, 0.8)] };
        for response in [Response::Linear, Response::Logarithmic { knee_v: 0.01 }, companding] {
            assert_relative_eq!(response.apply(1.2, 1.2), 1.2, max_relative = 1e-12);
            for v in [0.0, 0.05, 0.1, 0.3, 0.9, 1.2] {
                assert_relative_eq!(response.inverse(response.apply(v, 1.2), 1.2), v, max_relative = 1e-12);
            }
        }
    }

    #[test]
    fn the_swing_fills_the_codes_above_black() {
        let adc = Adc::Bits { bits: 10, black_level_dn: 64, step_v: None };
        assert_eq!((adc.top_dn(), adc.step_v(0.96)), (Some(1023), Some(0.001)));
        assert_relative_eq!(adc.top_v(0.96), 0.959, max_relative = 1e-12);
        assert_eq!(Adc::Bits { bits: 16, black_level_dn: 0, step_v: None }.top_dn(), Some(65535));
        assert_eq!(Adc::Analog.top_v(1.15), 1.15);
    }
}
