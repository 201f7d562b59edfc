//! The photodiodes below one microlens.

use dioptric_sensor::DisparityAxis;
use serde::{Deserialize, Serialize};

/// The photodiodes below one microlens, named by the side of the lens that they see, as the photographer stands behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Photodiodes {
    /// Two, side by side.
    LeftRight,
    /// Two, above each other.
    TopBottom,
    /// Four.
    Quad,
}

impl Photodiodes {
    /// All with their names on the command line.
    pub(super) const NAMES: [(&'static str, Self); 3] =
        [("left-right", Self::LeftRight), ("top-bottom", Self::TopBottom), ("quad", Self::Quad)];

    /// Returns the names of the photodiodes, as files have them.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::LeftRight => &["left", "right"],
            Self::TopBottom => &["top", "bottom"],
            Self::Quad => &["top-left", "top-right", "bottom-left", "bottom-right"],
        }
    }

    /// Returns the axis along which the two halves lie apart; of four photodiodes the left and the right two.
    pub fn disparity_axis(self) -> DisparityAxis {
        if self == Self::TopBottom { DisparityAxis::Rows } else { DisparityAxis::Columns }
    }

    /// Returns the photodiodes of the first and of the second half, by number.
    pub(crate) fn halves(self) -> [&'static [usize]; 2] {
        if self == Self::Quad { [&[0, 2], &[1, 3]] } else { [&[0], &[1]] }
    }
}
