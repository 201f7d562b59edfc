//! Stacks of tests.

use super::{
    Interfaces, Microlens, MicrolensOutline, MicrolensPower, MicrolensShift, PixelStack, QuantumEfficiencyOf,
    StackLayer,
};

/// The side of the opening, and of the pixel.
pub(super) const PITCH_UM: f64 = 4.0;

pub(super) fn layer(thickness_um: f64, index: f64) -> StackLayer {
    StackLayer { thickness_um, index }
}

/// A photodiode below layers without a lens.
pub(super) fn bare(photodiode_um: f64, layers: &[StackLayer]) -> PixelStack {
    PixelStack {
        photodiode_um,
        layers: layers.to_vec(),
        microlens: None,
        interfaces: Interfaces::Coated,
        quantum_efficiency: QuantumEfficiencyOf::Pixel,
    }
}

/// The same below a lens that fills the pixel.
pub(super) fn with_lens(photodiode_um: f64, layers: &[StackLayer], power: MicrolensPower) -> PixelStack {
    let microlens =
        Microlens { power, outline: MicrolensOutline::Gapless, shift: MicrolensShift::None, center_mm: [0.0; 2] };
    PixelStack { microlens: Some(microlens), ..bare(photodiode_um, layers) }
}

/// The same below a lens whose focus is on the photodiode.
pub(super) fn focused(photodiode_um: f64, layers: &[StackLayer]) -> PixelStack {
    with_lens(photodiode_um, layers, MicrolensPower::FocusOnPhotodiode)
}
