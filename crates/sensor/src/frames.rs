//! What the stages hand on.

use ndarray::Array2;

/// The photo-electrons a second that light makes in each pixel, on the mean.
#[derive(Clone, Debug, PartialEq)]
pub struct ElectronRate {
    /// Electrons a second: one plane for a mosaic, one a filter where they are stacked.
    pub planes_e_per_s: Vec<Array2<f32>>,
}

/// The electrons in each pixel at the end of the exposure; whole numbers where shot noise is on.
#[derive(Clone, Debug, PartialEq)]
pub struct Electrons {
    /// Electrons: one plane for a mosaic, one a filter where they are stacked.
    pub planes_e: Vec<Array2<f32>>,
}

/// The voltages at the pixels' outputs, before the analog gain.
#[derive(Clone, Debug, PartialEq)]
pub struct Volts {
    /// Volts: one plane for a mosaic, one a filter where they are stacked.
    pub planes_v: Vec<Array2<f32>>,
}
