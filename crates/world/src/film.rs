//! Light that a clear film, about as thin as a wavelength, mirrors from a surface.

use std::f32::consts::{PI, TAU};

use crate::fresnel;

/// A film over the base of a material.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Film {
    /// Its index of refraction.
    pub index: f32,
    /// Its thickness, nm.
    pub thickness_nm: crate::TextureId,
}

/// Returns the reflectance of a film over a base, 0–1, by the formulas of `KHR_materials_iridescence` (Belcour & Barla 2017).
///
/// `base` is the reflectance of the bare base at right angles, and `waves` the way once there and back through the film in
/// wavelengths, 2 n d/λ. The extension's integral over three bands of color, which ends after the second echo, is the sum of
/// all at one wavelength here.
pub(crate) fn reflectance(cos: f32, index: f32, base: f32, waves: f32) -> f32 {
    let straight = |from: f32, to: f32| ((to - from) / (to + from)).powi(2);
    let sin2_within = (1.0 - cos * cos) / (index * index);
    if sin2_within >= 1.0 {
        return 1.0;
    }
    let cos_within = (1.0 - sin2_within).sqrt();
    // The film's two sides.
    let root = base.clamp(0.0, 0.9998).sqrt();
    let base_index = (1.0 + root) / (1.0 - root);
    let outer = fresnel::between(straight(1.0, index), 1.0, fresnel::schlick_tail(cos));
    let inner = fresnel::between(straight(index, base_index), 1.0, fresnel::schlick_tail(cos_within));
    // An echo: mirrored at the base and at the film's own outer side; each of the two turns the phase or does not.
    let flips = (index >= 1.0) != (base_index < index);
    let phase = TAU * waves * cos_within + if flips { PI } else { 0.0 };
    let both = (outer * inner).min(0.9999);
    let (r, cos_phase) = (both.sqrt(), phase.cos());
    let left = (1.0 - outer).powi(2) * inner / (1.0 - both);
    let echoes = (r * cos_phase - both) / (1.0 - 2.0 * r * cos_phase + both);
    (outer + left + 2.0 * (left - (1.0 - outer)) * echoes).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a wave over glass mirrors `((n_s − n²)/(n_s + n²))²`, the coating of lenses; half a wave what the glass does.
    #[test]
    fn quarter_waves_coat_and_half_waves_vanish() {
        let glass: f32 = 1.52;
        let bare = ((glass - 1.0) / (glass + 1.0)).powi(2);
        for index in [1.2, 1.38, 1.9, 2.4] {
            let coated = ((glass - index * index) / (glass + index * index)).powi(2);
            assert!((reflectance(1.0, index, bare, 0.5) - coated).abs() < 1e-5, "{index}");
            assert!((reflectance(1.0, index, bare, 1.0) - bare).abs() < 1e-5, "{index}");
        }
        assert!((reflectance(1.0, 1.0, 0.3, 0.37) - 0.3).abs() < 1e-4);
    }

    /// At a slant as Airy's sum over the two sides' amplitudes, here by complex numbers; never more than comes in.
    #[test]
    fn films_are_airys_sums() {
        for (cos, index, base, waves) in
            [(0.9_f32, 1.3, 0.04_f32, 0.7), (0.5, 1.3, 0.6, 1.9), (0.2, 1.8, 0.04, 3.3), (0.7, 2.0, 0.9, 0.21)]
        {
            let inside = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
            let base_index = (1.0 + base.sqrt()) / (1.0 - base.sqrt());
            let amplitude = |from: f32, to: f32, cos: f32| {
                let straight = ((from - to) / (from + to)).powi(2);
                (from - to).signum() * (straight + (1.0 - straight) * (1.0 - cos).powi(5)).sqrt()
            };
            let (outer, inner) = (amplitude(1.0, index, cos), amplitude(index, base_index, inside));
            let (sin, cos_phase) = (TAU * waves * inside).sin_cos();
            let square = |a: f32, b: f32| a * a + b * b;
            let expected = square(outer + inner * cos_phase, inner * sin)
                / square(1.0 + outer * inner * cos_phase, outer * inner * sin);
            let found = reflectance(cos, index, base, waves);
            assert!((found - expected).abs() < 2e-4, "{cos} {index} {base}: {found} {expected}");
            assert!(found <= 1.0);
        }
    }
}
