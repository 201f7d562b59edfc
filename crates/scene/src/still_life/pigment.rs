//! The reflectances of the still life: the 24 patches of the chart, and smooth formulas.

use dioptric_spectrum::{WavelengthGrid, color_checker_reflectances};

/// A reflectance of the still life, an index of [`Palette`].
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

/// An index of [`Palette`].
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

/// Three hills that sum to 1 everywhere: the colors that light bounced once is kept in.
pub(super) const N_TONES: usize = 3;

/// Every reflectance on the bands of a scene.
#[derive(Clone, Debug)]
pub(super) struct Palette {
    n_bands: usize,
    reflectances: Vec<f32>,
    /// The tones on the bands.
    pub(super) tones: [Vec<f32>; N_TONES],
    /// The mean of each reflectance over each tone.
    pub(super) in_tones: Vec<[f32; N_TONES]>,
}

impl Palette {
    pub(super) fn on(grid: &WavelengthGrid) -> Self {
        let patches = color_checker_reflectances();
        let reflectance = |pigment: usize, nm: f64| match pigment.checked_sub(N_FORMULAS) {
            None => Pigment::FORMULAS[pigment](nm),
            Some(patch) => patches[patch].1.at_held(nm),
        };
        let n = N_FORMULAS + patches.len();
        let on_grid = |pigment: usize| grid.centers_nm().iter().map(move |&nm| (pigment, nm));
        let reflectances = (0..n).flat_map(on_grid).map(|(p, nm)| reflectance(p, nm) as f32).collect();
        let tones = std::array::from_fn(|i| grid.centers_nm().iter().map(|&nm| tone(i, nm) as f32).collect());
        let in_tones = (0..n)
            .map(|pigment| {
                std::array::from_fn(|i| {
                    let (mut sum, mut weight) = (0.0, 0.0);
                    for nm in (400..=700).step_by(10).map(f64::from) {
                        sum += tone(i, nm) * reflectance(pigment, nm);
                        weight += tone(i, nm);
                    }
                    (sum / weight) as f32
                })
            })
            .collect();
        Self { n_bands: grid.len(), reflectances, tones, in_tones }
    }

    /// The mean reflectance of a mixture over each tone.
    pub(super) fn mean_in_tones(&self, mixture: &[(PigmentIndex, f32)]) -> [f32; N_TONES] {
        let mut sum = [0.0; N_TONES];
        for &(pigment, part) in mixture {
            let tones = &self.in_tones[usize::from(pigment)];
            sum.iter_mut().zip(tones).for_each(|(sum, tone)| *sum += part * tone);
        }
        sum
    }

    /// The reflectance of a pigment, a value a band.
    pub(super) fn of(&self, pigment: PigmentIndex) -> &[f32] {
        &self.reflectances[usize::from(pigment) * self.n_bands..][..self.n_bands]
    }
}

fn tone(index: usize, nm: f64) -> f64 {
    let to_middle = ((nm - 470.0) / 40.0).clamp(0.0, 1.0);
    let to_long = ((nm - 570.0) / 40.0).clamp(0.0, 1.0);
    match index {
        0 => 1.0 - to_middle,
        1 => to_middle - to_long,
        _ => to_long,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reflectance_is_between_0_and_1_and_tones_sum_to_1() {
        let grid = WavelengthGrid::uniform(360.0, 830.0, 5.0).unwrap();
        let palette = Palette::on(&grid);
        assert!(palette.reflectances.iter().all(|r| (0.0..=1.0).contains(r)));
        assert_eq!(palette.in_tones.len(), N_FORMULAS + 24);
        for band in 0..grid.len() {
            let sum: f32 = palette.tones.iter().map(|tone| tone[band]).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
        // The white patch under any tone is white.
        assert!(palette.in_tones[usize::from(Pigment::patch(18))].iter().all(|&v| v > 0.6));
        assert!(palette.of(Pigment::Ink.index()).iter().all(|&v| v < 0.05));
    }
}
