//! The reflectances of the still life: the 24 patches of the chart, and smooth formulas.

use std::sync::OnceLock;

use dioptric_spectrum::{Spectrum, color_checker_reflectances};

use crate::{Beyond, SpectralCurve};

/// A reflectance of the still life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Pigment {
    Plaster,
    WallGreen,
    OakLight,
    OakDark,
    WalnutLight,
    WalnutDark,
    Linen,
    LinenShade,
    Indigo,
    AppleRed,
    AppleYellow,
    PearGreen,
    PearBrown,
    Lemon,
    Orange,
    Porcelain,
    Cobalt,
    Teal,
    Paper,
    Ink,
    Brass,
    Silver,
    Wax,
    BottleGreen,
    Berry,
    Twig,
    Leaf,
    Crimson,
    Ochre,
    Charcoal,
    /// The first of the 24 patches of the chart; see [`Pigment::patch`].
    Patch0,
}

/// The number of pigments made by formula.
const N_FORMULAS: usize = Pigment::Patch0 as usize;

/// The number of a pigment, in the order of the enum and then of the patches.
pub(super) type PigmentIndex = u8;

impl Pigment {
    pub(super) fn index(self) -> PigmentIndex {
        self as PigmentIndex
    }

    /// The index of a patch of the chart, 0 (dark skin) to 23 (black).
    pub(super) fn patch(patch: u8) -> PigmentIndex {
        Self::Patch0.index() + patch
    }

    /// The formulas, in the order of the enum.
    const FORMULAS: [fn(f64) -> f64; N_FORMULAS] = [
        |nm| 0.86 * rise(nm, 395.0, 12.0),
        |nm| 0.30 + 0.12 * hump(nm, 535.0, 70.0) + 0.05 * rise(nm, 640.0, 30.0),
        |nm| 0.16 + 0.42 * rise(nm, 555.0, 55.0),
        |nm| 0.08 + 0.28 * rise(nm, 580.0, 55.0),
        |nm| 0.07 + 0.20 * rise(nm, 595.0, 50.0),
        |nm| 0.035 + 0.09 * rise(nm, 610.0, 50.0),
        |nm| 0.40 + 0.36 * rise(nm, 480.0, 60.0),
        |nm| 0.28 + 0.30 * rise(nm, 490.0, 60.0),
        |nm| 0.05 + 0.24 * hump(nm, 445.0, 38.0) + 0.05 * rise(nm, 690.0, 15.0),
        |nm| 0.035 + 0.58 * rise(nm, 612.0, 13.0),
        |nm| 0.06 + 0.60 * rise(nm, 535.0, 20.0) - 0.08 * hump(nm, 675.0, 14.0),
        |nm| 0.06 + 0.38 * hump(nm, 565.0, 48.0) + 0.26 * rise(nm, 640.0, 40.0) - 0.14 * hump(nm, 676.0, 14.0),
        |nm| 0.07 + 0.30 * rise(nm, 590.0, 45.0),
        |nm| 0.05 + 0.76 * rise(nm, 508.0, 13.0),
        |nm| 0.04 + 0.74 * rise(nm, 567.0, 14.0),
        |nm| 0.80 * rise(nm, 400.0, 14.0) + 0.02 * rise(nm, 560.0, 60.0),
        |nm| 0.03 + 0.30 * hump(nm, 448.0, 34.0) + 0.22 * rise(nm, 702.0, 12.0),
        |nm| 0.05 + 0.30 * hump(nm, 497.0, 42.0),
        |nm| 0.84 * rise(nm, 405.0, 16.0),
        |_| 0.035,
        |nm| 0.42 + 0.48 * rise(nm, 515.0, 28.0),
        |nm| 0.90 + 0.05 * rise(nm, 480.0, 60.0),
        |nm| 0.52 + 0.32 * rise(nm, 470.0, 45.0),
        |nm| 0.012 + 0.05 * hump(nm, 530.0, 32.0) + 0.03 * rise(nm, 700.0, 12.0),
        |nm| 0.03 + 0.52 * rise(nm, 622.0, 14.0),
        |nm| 0.06 + 0.16 * rise(nm, 600.0, 60.0),
        |nm| 0.04 + 0.13 * hump(nm, 552.0, 28.0) + 0.30 * rise(nm, 705.0, 10.0),
        |nm| 0.04 + 0.40 * rise(nm, 605.0, 18.0),
        |nm| 0.07 + 0.46 * rise(nm, 548.0, 26.0),
        |_| 0.06,
    ];
}

/// A smooth step from 0 to 1.
fn rise(nm: f64, center_nm: f64, width_nm: f64) -> f64 {
    1.0 / (1.0 + (-(nm - center_nm) / width_nm).exp())
}

/// A smooth hill of height 1.
fn hump(nm: f64, center_nm: f64, width_nm: f64) -> f64 {
    (-0.5 * ((nm - center_nm) / width_nm).powi(2)).exp()
}

/// Returns the reflectance of a pigment, known every nanometer from 300 to 1100 nm.
pub(super) fn reflectance(pigment: PigmentIndex) -> SpectralCurve {
    curve(|nm| reflectance_at(pigment, nm))
}

/// Returns what lies below a clear coat of an index so that the whole scatters as the pigment would by itself: a coat sends part of the light back down,
/// and what is below it absorbs that again.
pub(super) fn below_coat(pigment: PigmentIndex, index: f64) -> SpectralCurve {
    let inside = f64::from(crate::fresnel::diffuse_reflectance((1.0 / index) as f32));
    curve(|nm| {
        let whole = reflectance_at(pigment, nm);
        whole / (1.0 - inside + whole * inside)
    })
}

fn curve(at: impl Fn(f64) -> f64) -> SpectralCurve {
    let wavelengths_nm: Vec<f64> = (300..=1100).map(f64::from).collect();
    let values = wavelengths_nm.iter().map(|&nm| at(nm)).collect();
    let spectrum = Spectrum::new(wavelengths_nm, values).expect("wavelengths ascend");
    SpectralCurve::new(&spectrum, Beyond::Held)
}

fn reflectance_at(pigment: PigmentIndex, nm: f64) -> f64 {
    static PATCHES: OnceLock<Vec<(String, Spectrum)>> = OnceLock::new();
    match usize::from(pigment).checked_sub(N_FORMULAS) {
        None => Pigment::FORMULAS[usize::from(pigment)](nm),
        Some(patch) => PATCHES.get_or_init(color_checker_reflectances)[patch].1.at_held(nm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reflectance_is_between_0_and_1() {
        for pigment in 0..(N_FORMULAS + 24) as PigmentIndex {
            for nm in (300..=1100).map(|nm| nm as f32) {
                let [plain, below] = [reflectance(pigment), below_coat(pigment, 1.5)].map(|curve| curve.at(&[nm])[0]);
                assert!((0.0..=1.0).contains(&plain) && (plain..=1.0).contains(&below), "{pigment} {nm}");
            }
        }
        assert!(reflectance(Pigment::Ink.index()).at(&[550.0])[0] < 0.05);
    }
}
