//! What a bank is asked to cover.

use dioptric_diffraction::Hurb;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{PsfError, axis::Axis};

/// How diffraction is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Diffraction {
    /// Not at all: geometric optics.
    None,
    /// Heisenberg uncertainty ray bending (HURB) at the stop.
    Hurb {
        /// The factor γ, above 0: 1 as in the paper and in Freniere's, √2 in `Scene3D` since 2015.
        gamma: f64,
    },
    /// HURB with constants fitted to Airy's pattern: better in focus, not in defocus.
    HurbCalibrated,
    /// The diffraction integral while the blur is small enough for it, HURB (γ = 1) beyond, blended over an octave:
    /// see [`LensImageModel::wave_fraction`](crate::LensImageModel::wave_fraction).
    Wave,
}

impl Default for Diffraction {
    /// HURB as in the paper.
    fn default() -> Self {
        Self::Hurb { gamma: 1.0 }
    }
}

impl Diffraction {
    /// Checks that γ is a finite number above 0.
    ///
    /// # Errors
    /// When it is not.
    pub fn check(self) -> Result<(), PsfError> {
        match self {
            Self::Hurb { gamma } if !(gamma.is_finite() && gamma > 0.0) => {
                Err(PsfError::Setting { key: "gamma", found: gamma, expected: "a finite number above 0" })
            }
            _ => Ok(()),
        }
    }

    /// Returns the constants of HURB, or `None` without diffraction; with waves, those of what takes their place where the
    /// blur is large.
    pub fn hurb(self) -> Option<Hurb> {
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Interpolation {
    /// Rays are interpolated, and pictures drawn from them: quadratic in field, dioptres and dispersion.
    #[default]
    Rays,
    /// Pictures are blended, as in the paper: linear in the field's tangent, in metres of depth and in nanometres, each
    /// of sum 1. Between samples a blend shows the pictures of both, not the one between: for comparison only.
    Images,
}

/// The fields at which a lens is sampled, as tangents of angles at the entrance pupil, ascending.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldSampling {
    /// Along one radius from 0 outwards: of a lens with an axis of symmetry, whose other fields are turned into it.
    Radial(Vec<f64>),
    /// A grid of at least 2 × 2 fields, of either sign: of any lens.
    Grid {
        /// Fields to the right of the picture.
        tans_x: Vec<f64>,
        /// Fields upwards.
        tans_y: Vec<f64>,
    },
    /// A grid of single fields, of which pictures are wanted: which field is seen where on the film is not found out, so no
    /// scene can be imaged.
    Points {
        /// Fields to the right of the picture.
        tans_x: Vec<f64>,
        /// Fields upwards.
        tans_y: Vec<f64>,
    },
}

impl FieldSampling {
    /// The number of fields.
    pub fn len(&self) -> usize {
        let (tans_x, tans_y) = self.axes();
        tans_x.len() * tans_y.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the fields to the right and upwards that span the sampling: of a radius, along it and 0.
    pub fn axes(&self) -> (&[f64], &[f64]) {
        match self {
            Self::Radial(tans) => (tans, &[0.0]),
            Self::Grid { tans_x, tans_y } | Self::Points { tans_x, tans_y } => (tans_x, tans_y),
        }
    }

    /// Returns such a sampling with the axes changed each by a function.
    pub(crate) fn mapped(&self, of: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        match self {
            Self::Radial(tans) => Self::Radial(of(tans)),
            Self::Grid { tans_x, tans_y } => Self::Grid { tans_x: of(tans_x), tans_y: of(tans_y) },
            Self::Points { tans_x, tans_y } => Self::Points { tans_x: of(tans_x), tans_y: of(tans_y) },
        }
    }
}

/// How finely a lens is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleCounts {
    /// Fields along a radius.
    pub n_radial: usize,
    /// Fields along each side of a grid, at least 2.
    pub n_grid: usize,
    /// Depths.
    pub n_depths: usize,
    /// Wavelengths.
    pub n_wavelengths: usize,
    /// Rings of the mesh in the pupil, at least 2.
    pub n_rings: usize,
    /// Nodes on a ring, at least 8.
    pub n_azimuths: usize,
}

impl SampleCounts {
    /// The error of an interpolated blur is about 1 %.
    pub const STANDARD: Self =
        Self { n_radial: 9, n_grid: 11, n_depths: 9, n_wavelengths: 4, n_rings: 12, n_azimuths: 48 };
    /// For previews: a twentieth of the rays. A test holds the median error of blurs of the double Gauss at f/4 below 0.1.
    pub const PREVIEW: Self =
        Self { n_radial: 5, n_grid: 5, n_depths: 4, n_wavelengths: 2, n_rings: 8, n_azimuths: 32 };
}

/// What a model of a lens's image is sampled over, and how finely.
#[derive(Clone, Debug, PartialEq)]
pub struct BankSettings {
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// The wavelength whose paraxial entrance pupil fields and depths count from, nm.
    pub reference_wavelength_nm: f64,
    /// Fields.
    pub fields: FieldSampling,
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
    pub interpolation: Interpolation,
}

/// The tangent of the widest fields worth sampling, of 89.05°: a scene is a perspective picture, which never shows half of a space, and
/// what a fisheye lens sees beyond this is darkness to it.
pub const WIDEST_FIELD_TAN: f64 = 60.0;

impl BankSettings {
    /// Returns settings that cover these ranges at 9 fields, 9 depths and 4 wavelengths, evenly spaced in angle,
    /// in dioptres and in 1/λ², with 12 × 48 rays each: the error of an interpolated blur is about 1 %.
    ///
    /// A range of no length becomes a single sample.
    pub fn covering(
        film_distance_mm: f64,
        last_field_tan: f64,
        dioptres: (f64, f64),
        wavelengths_nm: (f64, f64),
        diffraction: Diffraction,
    ) -> Self {
        let n = SampleCounts::STANDARD;
        Self {
            film_distance_mm,
            reference_wavelength_nm: 550.0,
            fields: FieldSampling::Radial(even_angles((0.0, last_field_tan), n.n_radial)),
            dioptres: spaced(dioptres, n.n_depths),
            wavelengths_nm: evenly_dispersed(wavelengths_nm, n.n_wavelengths),
            n_rings: n.n_rings,
            n_azimuths: n.n_azimuths,
            diffraction,
            interpolation: Interpolation::Rays,
        }
    }

    /// Returns settings that cover fields from one pair of tangents to another over a grid even in angle, and all else as
    /// [`covering`](Self::covering) does: for lenses without an axis of symmetry.
    ///
    /// Cubics through the centroids of 11 × 11 fields leave errors of some tenths of a micrometre.
    pub fn covering_grid(
        film_distance_mm: f64,
        (first_tan, last_tan): (DVec2, DVec2),
        dioptres: (f64, f64),
        wavelengths_nm: (f64, f64),
        diffraction: Diffraction,
    ) -> Self {
        let n = SampleCounts::STANDARD.n_grid;
        Self {
            fields: FieldSampling::Grid {
                tans_x: grid_angles((first_tan.x, last_tan.x), n),
                tans_y: grid_angles((first_tan.y, last_tan.y), n),
            },
            ..Self::covering(film_distance_mm, 0.0, dioptres, wavelengths_nm, diffraction)
        }
    }

    /// Returns the settings over the same ranges with other numbers of samples, spaced as [`covering`](Self::covering) and
    /// [`covering_grid`](Self::covering_grid) do; single points stay as they are.
    #[must_use]
    pub fn with_counts(&self, n: SampleCounts) -> Self {
        let fields = match &self.fields {
            FieldSampling::Radial(tans) => FieldSampling::Radial(even_angles(ends(tans), n.n_radial)),
            FieldSampling::Grid { tans_x, tans_y } => FieldSampling::Grid {
                tans_x: grid_angles(ends(tans_x), n.n_grid),
                tans_y: grid_angles(ends(tans_y), n.n_grid),
            },
            points @ FieldSampling::Points { .. } => points.clone(),
        };
        Self {
            fields,
            dioptres: spaced(ends(&self.dioptres), n.n_depths),
            wavelengths_nm: evenly_dispersed(ends(&self.wavelengths_nm), n.n_wavelengths),
            n_rings: n.n_rings,
            n_azimuths: n.n_azimuths,
            ..self.clone()
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
            fields: self.fields.mapped(|tans| few(tans, 4)),
            dioptres: few(&self.dioptres, 3),
            wavelengths_nm: few(&self.wavelengths_nm, 3),
            ..self.clone()
        }
    }

    /// The number of samples: fields × depths × wavelengths.
    pub fn n_samples(&self) -> usize {
        self.fields.len() * self.dioptres.len() * self.wavelengths_nm.len()
    }

    pub(crate) fn check(&self) -> Result<(), PsfError> {
        let axis = |axis, found: &[f64], expected, is_good: &dyn Fn(f64) -> bool| match Axis::new(found.to_vec())
            .is_some()
            && found.iter().all(|&v| is_good(v))
        {
            true => Ok(()),
            false => Err(PsfError::Axis { axis, expected, found: found.to_vec() }),
        };
        match &self.fields {
            FieldSampling::Radial(tans) => {
                let expected = "tangents of which the first is 0";
                axis("field_tans", tans, expected, &|v| v >= 0.0)?;
                if tans[0] != 0.0 {
                    return Err(PsfError::Axis { axis: "field_tans", expected, found: tans.clone() });
                }
            }
            FieldSampling::Grid { tans_x, tans_y } | FieldSampling::Points { tans_x, tans_y } => {
                for (name, tans) in [("tans_x", tans_x), ("tans_y", tans_y)] {
                    axis(name, tans, "finite tangents", &|v| v.is_finite())?;
                    if matches!(self.fields, FieldSampling::Grid { .. }) && tans.len() < 2 {
                        let (found, expected) = (tans.len() as f64, "2 fields or more, to tell which is seen where");
                        return Err(PsfError::Setting { key: name, found, expected });
                    }
                }
                if self.interpolation == Interpolation::Images {
                    let (key, expected) = ("interpolation", "rays: pictures are blended along a radius only");
                    return Err(PsfError::Setting { key, found: 0.0, expected });
                }
            }
        }
        axis("dioptres", &self.dioptres, "numbers of 0 or more", &|v| v >= 0.0)?;
        axis("wavelengths_nm", &self.wavelengths_nm, "numbers above 0", &|v| v > 0.0)?;
        let setting = |key, found: f64, expected, is_good: bool| match is_good {
            true => Ok(()),
            false => Err(PsfError::Setting { key, found, expected }),
        };
        setting("film_distance_mm", self.film_distance_mm, "a finite number", self.film_distance_mm.is_finite())?;
        setting("n_rings", self.n_rings as f64, "2 or more", self.n_rings >= 2)?;
        setting("n_azimuths", self.n_azimuths as f64, "8 or more", self.n_azimuths >= 8)?;
        self.diffraction.check()
    }
}

/// Returns `n` evenly spaced numbers from one end of a range to the other, or its one number.
fn spaced((first, last): (f64, f64), n: usize) -> Vec<f64> {
    if last <= first || n < 2 {
        return vec![first];
    }
    (0..n).map(|i| first + (last - first) * i as f64 / (n - 1) as f64).collect()
}

/// Returns tangents of even angles from end to end of a side of a grid: `n`, and up to three times as many beyond 45° off the axis, where cubics in tangents
/// follow a lens less and less.
fn grid_angles(ends_tan: (f64, f64), n: usize) -> Vec<f64> {
    const MOST: f64 = 3.0;
    let widest_tan = ends_tan.0.abs().max(ends_tan.1.abs());
    let more = widest_tan.sqrt().clamp(1.0, MOST);
    // An odd number keeps an odd one: of fields about the axis one is on it.
    let n = if more > 1.0 { n + 2 * (0.5 * (more - 1.0) * n as f64).ceil() as usize } else { n };
    even_angles(ends_tan, n)
}

/// Returns `n` tangents of evenly spaced angles from one end of a range to the other, or its one number.
fn even_angles((first, last): (f64, f64), n: usize) -> Vec<f64> {
    if last <= first || n < 2 {
        return vec![first];
    }
    let (low, high) = (first.atan(), last.atan());
    // Of a range about 0 the two halves are mirror images to the bit.
    let angle = |i: usize| ((n - 1 - i) as f64 * low + i as f64 * high) / (n - 1) as f64;
    let mut tans: Vec<f64> = (0..n).map(|i| angle(i).tan()).collect();
    // The ends to the bit.
    (tans[0], tans[n - 1]) = (first, last);
    tans
}

/// Returns `n` wavelengths from one end of a range to the other, evenly spaced in 1/λ².
fn evenly_dispersed(range_nm: (f64, f64), n: usize) -> Vec<f64> {
    let by_frequency = spaced((inverse_square(range_nm.1), inverse_square(range_nm.0)), n);
    let mut wavelengths: Vec<f64> = by_frequency.into_iter().rev().map(|q| 1.0 / q.sqrt()).collect();
    // The ends are the ones asked for, to the bit.
    let last = wavelengths.len() - 1;
    wavelengths[0] = range_nm.0;
    wavelengths[last] = range_nm.1;
    wavelengths
}

fn ends(list: &[f64]) -> (f64, f64) {
    (list[0], list[list.len() - 1])
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
        assert_eq!(ends(coarse.fields.axes().0), ends(fine.fields.axes().0));
        assert_eq!(ends(&coarse.dioptres), ends(&fine.dioptres));
        assert_eq!(ends(&coarse.wavelengths_nm), ends(&fine.wavelengths_nm));
        assert!(coarse.check().is_ok());
        assert_eq!(coarse.coarse(), coarse);
    }

    /// The words of camera files.
    #[test]
    fn diffraction_has_its_words() {
        for (text, diffraction) in [
            ("None", Diffraction::None),
            ("Hurb(gamma:1.5)", Diffraction::Hurb { gamma: 1.5 }),
            ("HurbCalibrated", Diffraction::HurbCalibrated),
            ("Wave", Diffraction::Wave),
        ] {
            assert_eq!(ron::from_str::<Diffraction>(text).unwrap(), diffraction);
            let written = ron::to_string(&diffraction).unwrap();
            assert_eq!(ron::from_str::<Diffraction>(&written).unwrap(), diffraction);
            assert!(diffraction.check().is_ok());
        }
        for gamma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let message = Diffraction::Hurb { gamma }.check().unwrap_err().to_string();
            assert!(message.starts_with("gamma is ") && message.ends_with("a finite number above 0"), "{message}");
        }
    }

    #[test]
    fn counts_keep_the_ranges() {
        let fine = BankSettings::covering(52.0, 0.3, (0.0, 1.0), (400.0, 700.0), Diffraction::None);
        assert_eq!(fine.with_counts(SampleCounts::STANDARD), fine);
        let corners = (DVec2::new(-0.3, -0.2), DVec2::new(0.25, 0.2));
        let grid = BankSettings::covering_grid(52.0, corners, (0.0, 1.0), (400.0, 700.0), Diffraction::None);
        assert_eq!(grid.with_counts(SampleCounts::STANDARD), grid);
        let preview = grid.with_counts(SampleCounts::PREVIEW);
        assert_eq!(preview.n_samples(), 5 * 5 * 4 * 2);
        assert_eq!(preview.fields.axes().0[0], -0.3);
        assert!(preview.check().is_ok());
    }
}
