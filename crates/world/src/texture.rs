//! Values that vary over a surface.

use crate::SpectralCurve;

/// A value over a surface: a spectrum where a color is asked for, a number where a number is.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// The same spectrum everywhere.
    Curve(SpectralCurve),
}
