//! What a bank is asked to cover.

use dioptric_diffraction::Hurb;
use serde::{Deserialize, Serialize};

use crate::{PsfError, axis::Axis};

/// How diffraction is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Diffraction {
    /// Not at all: geometric optics.
    None,
    /// Uncertainty bending at the stop with a factor γ: 1 as in the paper, √2 as in later versions of its code.
    Hurb {
        /// The factor.
        gamma: f64,
    },
    /// Uncertainty bending with constants calibrated to Airy's pattern: better in focus, not in defocus.
    HurbCalibrated,
    /// Wave optics while the blur is small enough for it, uncertainty bending (γ = 1) beyond, blended over an octave:
    /// see [`PsfBank::wave_share`](crate::PsfBank::wave_share).
    Wave,
}

impl Diffraction {
    pub(crate) fn model(self) -> Option<Hurb> {
        match self {
            Self::None => None,
            Self::Hurb { gamma } => Some(Hurb::with_gamma(gamma)),
            Self::Wave => Some(Hurb::PAPER),
            Self::HurbCalibrated => Some(Hurb::CALIBRATED),
        }
    }
}

/// How a bank finds what lies between its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Interpolation {
    /// Rays are interpolated, and pictures drawn from them: quadratic in field, dioptres and dispersion.
    #[default]
    Rays,
    /// Pictures are blended, as in the paper: linear in the field's tangent, in metres of depth and in nanometres, each
    /// of sum 1. Between samples a blend shows the pictures of both, not the one between: for comparison only.
    Images,
}

/// What a bank covers, and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BankSettings {
    /// Distance of the film behind the last vertex, mm.
    pub film_mm: f64,
    /// The wavelength whose paraxial entrance pupil fields and depths count from, nm.
    pub reference_wavelength_nm: f64,
    /// Tangents of field angles, ascending from 0.
    pub field_tans: Vec<f64>,
    /// Depths in dioptres (1/Z, Z in metres from the entrance pupil, 0 is infinitely far), ascending.
    pub dioptres: Vec<f64>,
    /// Wavelengths, nm, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Rings of the mesh in the pupil: 12 give the outlines of blurs to about 1 %.
    pub n_rings: usize,
    /// Nodes on a ring, at least 8: 48 go with 12 rings.
    pub n_azimuths: usize,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
    /// How what lies between samples is found.
    #[serde(default)]
    pub interpolation: Interpolation,
}

impl BankSettings {
    /// Returns settings that cover these ranges at 9 fields, 9 depths and 4 wavelengths, evenly spaced in the tangent,
    /// in dioptres and in 1/λ², with 12 × 48 rays each: the error of an interpolated blur is about 1 %.
    ///
    /// A range of no length becomes a single sample.
    pub fn covering(
        film_mm: f64,
        last_field_tan: f64,
        dioptres: (f64, f64),
        wavelengths_nm: (f64, f64),
        diffraction: Diffraction,
    ) -> Self {
        let by_frequency = spaced((inverse_square(wavelengths_nm.1), inverse_square(wavelengths_nm.0)), 4);
        let mut wavelengths: Vec<f64> = by_frequency.into_iter().rev().map(|q| 1.0 / q.sqrt()).collect();
        // The ends are the ones asked for, to the bit.
        let last = wavelengths.len() - 1;
        wavelengths[0] = wavelengths_nm.0;
        wavelengths[last] = wavelengths_nm.1;
        Self {
            film_mm,
            reference_wavelength_nm: 550.0,
            field_tans: spaced((0.0, last_field_tan), 9),
            dioptres: spaced(dioptres, 9),
            wavelengths_nm: wavelengths,
            n_rings: 12,
            n_azimuths: 48,
            diffraction,
            interpolation: Interpolation::Rays,
        }
    }

    /// Returns the settings with at most 4 fields, 3 depths and 3 wavelengths from end to end of the same ranges: what
    /// a bank may begin with whose samples are chosen by its error.
    pub fn coarse(&self) -> Self {
        let few = |list: &[f64], n: usize| match list.len() {
            own if own <= n => list.to_vec(),
            own => (0..n).map(|i| list[(2 * i * (own - 1) + n - 1) / (2 * (n - 1))]).collect(),
        };
        Self {
            field_tans: few(&self.field_tans, 4),
            dioptres: few(&self.dioptres, 3),
            wavelengths_nm: few(&self.wavelengths_nm, 3),
            ..self.clone()
        }
    }

    /// The number of samples: fields × depths × wavelengths.
    pub fn n_samples(&self) -> usize {
        self.field_tans.len() * self.dioptres.len() * self.wavelengths_nm.len()
    }

    pub(crate) fn check(&self) -> Result<(), PsfError> {
        let axis = |axis, found: &[f64], expected, is_good: &dyn Fn(f64) -> bool| match Axis::new(found.to_vec())
            .is_some()
            && found.iter().all(|&v| is_good(v))
        {
            true => Ok(()),
            false => Err(PsfError::Axis { axis, expected, found: found.to_vec() }),
        };
        axis("field_tans", &self.field_tans, "tangents of which the first is 0", &|v| v >= 0.0)?;
        if self.field_tans[0] != 0.0 {
            let expected = "tangents of which the first is 0";
            return Err(PsfError::Axis { axis: "field_tans", expected, found: self.field_tans.clone() });
        }
        axis("dioptres", &self.dioptres, "numbers of 0 or more", &|v| v >= 0.0)?;
        axis("wavelengths_nm", &self.wavelengths_nm, "numbers above 0", &|v| v > 0.0)?;
        let setting = |key, found: f64, expected, is_good: bool| match is_good {
            true => Ok(()),
            false => Err(PsfError::Setting { key, found, expected }),
        };
        setting("film_mm", self.film_mm, "a finite number", self.film_mm.is_finite())?;
        setting("n_rings", self.n_rings as f64, "2 or more", self.n_rings >= 2)?;
        setting("n_azimuths", self.n_azimuths as f64, "8 or more", self.n_azimuths >= 8)?;
        if let Diffraction::Hurb { gamma } = self.diffraction {
            setting("gamma", gamma, "a finite number above 0", gamma.is_finite() && gamma > 0.0)?;
        }
        Ok(())
    }
}

/// Returns `n` evenly spaced numbers from one end of a range to the other, or its one number.
fn spaced((first, last): (f64, f64), n: usize) -> Vec<f64> {
    if last <= first {
        return vec![first];
    }
    (0..n).map(|i| first + (last - first) * i as f64 / (n - 1) as f64).collect()
}

fn inverse_square(wavelength_nm: f64) -> f64 {
    1.0 / (wavelength_nm * wavelength_nm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_settings_keep_the_ends() {
        let fine = BankSettings::covering(52.0, 0.3, (0.0, 1.0), (400.0, 700.0), Diffraction::None);
        let coarse = fine.coarse();
        assert_eq!(coarse.n_samples(), 36);
        let ends = |list: &[f64]| (list[0], list[list.len() - 1]);
        assert_eq!(ends(&coarse.field_tans), ends(&fine.field_tans));
        assert_eq!(ends(&coarse.dioptres), ends(&fine.dioptres));
        assert_eq!(ends(&coarse.wavelengths_nm), ends(&fine.wavelengths_nm));
        assert!(coarse.check().is_ok());
        assert_eq!(coarse.coarse(), coarse);
    }
}
