//! The modulation of a point whose light lies partly outside of its picture.

use std::f64::consts::TAU;

use dioptric_psf::Picture;
use ndarray::ArrayView2;

/// A picture of a point, and how much of the point's light it holds.
pub(super) struct Windowed {
    picture: Picture,
    /// The share of the point's light that lies on the picture.
    share: f64,
    half_width_mm: f64,
}

impl Windowed {
    /// `energy` is that of each pixel; the light of the whole point is 1.
    pub(super) fn new(energy: ArrayView2<'_, f32>, pixel_um: f64) -> Self {
        let share = energy.iter().map(|e| f64::from(*e)).sum::<f64>().min(1.0);
        let half_width_mm = 0.5e-3 * pixel_um * energy.nrows().min(energy.ncols()) as f64;
        Self { picture: Picture::new(energy, pixel_um), share, half_width_mm }
    }

    /// Returns the real and imaginary part of the optical transfer function for a wave along a direction, that of the pixels
    /// included.
    ///
    /// The light outside of the picture counts as if it fell off with the third power of the distance, as that of a round pupil
    /// does: beyond a radius a it leaves a ∫ₐ^∞ J₀(2πfr) r⁻² dr ≈ exp(−2πfa) of a wave of frequency f.
    pub(super) fn transfer(&self, direction_rad: f64, cycles_per_mm: f64) -> (f64, f64) {
        let (real, imaginary) = self.picture.optical_transfer(direction_rad, cycles_per_mm);
        let outside = (1.0 - self.share) * (-TAU * cycles_per_mm * self.half_width_mm).exp();
        (self.share * real + outside, self.share * imaginary)
    }

    /// Returns the modulation that is left of a wave along a direction.
    pub(super) fn modulation(&self, direction_rad: f64, cycles_per_mm: f64) -> f64 {
        let (real, imaginary) = self.transfer(direction_rad, cycles_per_mm);
        real.hypot(imaginary)
    }
}
