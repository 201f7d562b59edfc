//! Wavefront errors over a pupil, as sums of Zernike's polynomials: what measured optics, such as eyes, are known by.

use std::f64::consts::SQRT_2;

use glam::{DVec2, Vec2Swizzles};
use serde::{Deserialize, Serialize};

use crate::{OpticsError, zernike};

/// A wavefront error over a disc, by its coefficients at one wavelength or several.
///
/// It is the path by which the wavefront is ahead of that of the optics without it, µm, at each place of the disc: a positive defocus
/// converges (a myopic eye), the sign of ANSI Z80.28 and of `OpticStudio`. Between wavelengths coefficients are interpolated in step
/// with the wavelength, beyond the first and the last they are those. Places are in the frame of the surface: x to the right for the
/// photographer, so to the left for who looks into an eye, and y up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WavefrontError {
    /// Radius of the disc, mm; the polynomials go on beyond it.
    pub radius_mm: f64,
    /// The order and the norm of the polynomials.
    pub terms: ZernikeTerms,
    /// The coefficients, by ascending wavelength.
    pub bands: Vec<WavefrontBand>,
    /// The wavelength, nm, at which an eye has these coefficients whose longitudinal chromatic aberration is added to them; left out, there
    /// is none.
    ///
    /// It is that of the chromatic eye, 1.68524 − 633.46 / (λ − 214.102) dioptres, λ in nm (Thibos, Ye, Zhang and Bradley 1992, Applied
    /// Optics 31, 3594), known here from 380 to 780 nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chromatic_eye_nm: Option<f64>,
}

/// The coefficients at a wavelength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WavefrontBand {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// Coefficients from the first polynomial (piston) on, µm.
    pub coefficients_um: Vec<f64>,
}

/// An order and a norm of Zernike's polynomials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ZernikeTerms {
    /// Those of OSA and ANSI Z80.28, from number 0, each of mean square 1.
    Osa,
    /// Noll's, from number 1, each of mean square 1: `OpticStudio`'s standard ones.
    Noll,
    /// The Fringe set, from number 1, at most 37, each at most 1 at the edge.
    Fringe,
}

/// The most coefficients: those up to degree 20.
const MOST_TERMS: usize = 231;
/// Wavelengths at which the chromatic eye is known, nm.
const EYE_NM: [f64; 2] = [380.0, 780.0];

impl ZernikeTerms {
    /// Returns the degree, the order (below 0 with the sine) and the norm of the `i`-th polynomial, from 0.
    fn nth(self, i: usize) -> (u32, i32, f64) {
        let (n, m) = match self {
            Self::Osa => zernike::osa_degrees(i),
            Self::Noll => zernike::noll_degrees(i + 1),
            Self::Fringe => zernike::fringe_degrees(i + 1),
        };
        let of_mean_square_1 = f64::from(n + 1).sqrt() * if m == 0 { 1.0 } else { SQRT_2 };
        (n, m, if self == Self::Fringe { 1.0 } else { of_mean_square_1 })
    }

    fn n_most(self) -> usize {
        if self == Self::Fringe { zernike::FRINGE_TERMS } else { MOST_TERMS }
    }
}

impl WavefrontError {
    /// Checks that it is known at a wavelength.
    pub(crate) fn check_at(&self, wavelength_nm: f64) -> Result<(), OpticsError> {
        let [first_nm, last_nm] = EYE_NM;
        match self.chromatic_eye_nm.is_none() || (first_nm..=last_nm).contains(&wavelength_nm) {
            true => Ok(()),
            false => Err(OpticsError::WavelengthOutsideGlass {
                glass: "the chromatic aberration of the eye".to_owned(),
                wavelength_nm,
                first_nm,
                last_nm,
                remedy: "",
            }),
        }
    }

    /// Returns the error at a wavelength.
    pub(crate) fn at(&self, wavelength_nm: f64) -> WavefrontMap {
        let mut map = WavefrontMap { per_mm: 1.0 / self.radius_mm, orders: Vec::new() };
        for (i, coefficient_um) in self.coefficients_um(wavelength_nm).into_iter().enumerate() {
            let (n, m, norm) = self.terms.nth(i);
            map.add(n, m, 1e-3 * norm * coefficient_um);
        }
        if let Some(eye_nm) = self.chromatic_eye_nm {
            // Too little power makes the edge lag: D ρ² r² / 2, of which the piston is left out.
            let dioptres = chromatic_eye_dioptres(wavelength_nm) - chromatic_eye_dioptres(eye_nm);
            map.add(2, 0, -0.25e-3 * dioptres * self.radius_mm * self.radius_mm);
        }
        map
    }

    fn coefficients_um(&self, wavelength_nm: f64) -> Vec<f64> {
        let after = self.bands.partition_point(|band| band.wavelength_nm < wavelength_nm);
        let of = |i: usize| &self.bands[i.min(self.bands.len() - 1)];
        let (below, above) = (of(after.saturating_sub(1)), of(after));
        let way_nm = above.wavelength_nm - below.wavelength_nm;
        let share = if way_nm > 0.0 { (wavelength_nm - below.wavelength_nm) / way_nm } else { 0.0 };
        let n_terms = below.coefficients_um.len().max(above.coefficients_um.len());
        let at = |band: &WavefrontBand, i: usize| band.coefficients_um.get(i).copied().unwrap_or(0.0);
        (0..n_terms).map(|i| at(below, i) * (1.0 - share) + at(above, i) * share).collect()
    }

    /// Whether it depends on the distance from the axis alone.
    pub(crate) fn is_rotational(&self) -> bool {
        self.all_orders(|_, m| m == 0)
    }

    /// Whether it stays when x (axis 0) or y (axis 1) changes its sign.
    pub(crate) fn is_mirrored_along(&self, axis: usize) -> bool {
        // cos mθ turns into (−1)^m of itself with x, and stays with y; the sine changes otherwise.
        self.all_orders(|_, m| if axis == 0 { (m % 2 == 0) == (m >= 0) } else { m >= 0 })
    }

    /// Whether this is so of all polynomials that it has any of.
    fn all_orders(&self, is_so: impl Fn(u32, i32) -> bool) -> bool {
        self.bands.iter().flat_map(|band| band.coefficients_um.iter().enumerate()).all(|(i, coefficient_um)| {
            let (n, m, _) = self.terms.nth(i);
            *coefficient_um == 0.0 || is_so(n, m)
        })
    }

    pub(crate) fn check(&self, surface: usize) -> Result<(), OpticsError> {
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if !(self.radius_mm > 0.0 && self.radius_mm.is_finite()) {
            return wrong("radius_mm of a wavefront error", self.radius_mm, "a finite number above 0");
        }
        if self.bands.is_empty() {
            return wrong("bands of a wavefront error", 0.0, "at least 1");
        }
        for (i, band) in self.bands.iter().enumerate() {
            let before_nm = if i == 0 { 0.0 } else { self.bands[i - 1].wavelength_nm };
            if !(band.wavelength_nm > before_nm && band.wavelength_nm.is_finite()) {
                let expected = "finite numbers above 0, each above the one before";
                return wrong("wavelength_nm of a wavefront error", band.wavelength_nm, expected);
            }
            if let Some(found) = band.coefficients_um.iter().find(|number| !number.is_finite()) {
                return wrong("coefficients_um of a wavefront error", *found, "finite numbers");
            }
            if band.coefficients_um.len() > self.terms.n_most() {
                let expected = "at most 231 coefficients, of the Fringe set 37";
                return wrong("coefficients_um of a wavefront error", band.coefficients_um.len() as f64, expected);
            }
        }
        match self.chromatic_eye_nm {
            Some(nm) if !(EYE_NM[0]..=EYE_NM[1]).contains(&nm) => wrong("chromatic_eye_nm", nm, "380 to 780 nm"),
            _ => Ok(()),
        }
    }
}

/// Returns the refractive error of the chromatic eye, dioptres: 0 at 589 nm, below 0 for shorter waves, of which the eye has too much power.
fn chromatic_eye_dioptres(wavelength_nm: f64) -> f64 {
    1.68524 - 633.46 / (wavelength_nm - 214.102)
}

/// A wavefront error at one wavelength, as polynomials in x and y over the radius: the sum over m of Aₘ(ρ²) Re (x + iy)ᵐ and
/// Bₘ(ρ²) Im (x + iy)ᵐ, mm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WavefrontMap {
    per_mm: f64,
    /// For each m the coefficients of A and B, of ρ⁰, ρ² and on.
    orders: Vec<[Vec<f64>; 2]>,
}

impl WavefrontMap {
    /// Adds so many times the polynomial Rₙᵐ cos mθ or, for m below 0, that with the sine.
    fn add(&mut self, n: u32, m: i32, factor_mm: f64) {
        let order = m.unsigned_abs();
        if factor_mm == 0.0 {
            return;
        }
        if self.orders.len() <= order as usize {
            self.orders.resize(order as usize + 1, [Vec::new(), Vec::new()]);
        }
        let sums = &mut self.orders[order as usize][usize::from(m < 0)];
        let radial = zernike::radial_coefficients(n, order);
        if sums.len() < radial.len() {
            sums.resize(radial.len(), 0.0);
        }
        sums.iter_mut().zip(radial).for_each(|(sum, coefficient)| *sum += factor_mm * coefficient);
    }

    /// Returns how far ahead the wavefront is at a place, mm, and its slopes there.
    pub(crate) fn at(&self, place_mm: DVec2) -> (f64, DVec2) {
        let p = place_mm * self.per_mm;
        let square = p.length_squared();
        let (mut value, mut slope) = (0.0, DVec2::ZERO);
        // (x + iy)ᵐ and (x + iy)ᵐ⁻¹.
        let (mut power, mut below) = (DVec2::X, DVec2::ZERO);
        for (m, parts) in self.orders.iter().enumerate() {
            let m = m as f64;
            for (is_sine, coefficients) in parts.iter().enumerate() {
                let (mut sum, mut derivative) = (0.0, 0.0);
                for coefficient in coefficients.iter().rev() {
                    derivative = derivative * square + sum;
                    sum = sum * square + coefficient;
                }
                let angular = power[is_sine];
                // The slopes of Re zᵐ and Im zᵐ are m times those parts of zᵐ⁻¹.
                let of_angular = if is_sine == 0 { DVec2::new(below.x, -below.y) } else { below.yx() };
                value += sum * angular;
                slope += 2.0 * derivative * angular * p + sum * m * of_angular;
            }
            below = power;
            power = p.rotate(power);
        }
        (value, slope * self.per_mm)
    }

    /// Whether it depends on the distance from the axis alone.
    pub(crate) fn is_rotational(&self) -> bool {
        self.orders
            .iter()
            .skip(1)
            .flatten()
            .all(|coefficients| coefficients.iter().all(|coefficient| *coefficient == 0.0))
    }

    /// Returns the coefficient of r² or r⁴ (`i` 1 or 2) of what depends on the distance from the axis alone, 1/mm or 1/mm³.
    pub(crate) fn of_power(&self, i: usize) -> f64 {
        let round = self.orders.first().and_then(|[cosine, _]| cosine.get(i));
        round.copied().unwrap_or(0.0) * self.per_mm.powi(2 * i as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(terms: ZernikeTerms, coefficients_um: Vec<f64>) -> WavefrontError {
        let bands = vec![WavefrontBand { wavelength_nm: 550.0, coefficients_um }];
        WavefrontError { radius_mm: 2.0, terms, bands, chromatic_eye_nm: None }
    }

    #[test]
    fn polynomials_are_those_of_the_standards() {
        // ANSI Z80.28, table: number, polynomial; at ρ = 0.7, θ = 0.4.
        let (rho, theta) = (0.7_f64, 0.4_f64);
        let place_mm = 2.0 * rho * DVec2::from_angle(theta);
        let osa: [(usize, f64); 6] = [
            (1, 2.0 * rho * theta.sin()),
            (3, 6f64.sqrt() * rho.powi(2) * (2.0 * theta).sin()),
            (4, 3f64.sqrt() * (2.0 * rho.powi(2) - 1.0)),
            (8, 8f64.sqrt() * (3.0 * rho.powi(3) - 2.0 * rho) * theta.cos()),
            (12, 5f64.sqrt() * (6.0 * rho.powi(4) - 6.0 * rho.powi(2) + 1.0)),
            (14, 10f64.sqrt() * rho.powi(4) * (4.0 * theta).cos()),
        ];
        for (number, expected) in osa {
            let mut coefficients_um = vec![0.0; number + 1];
            coefficients_um[number] = 1.0;
            let (found, _) = error(ZernikeTerms::Osa, coefficients_um).at(550.0).at(place_mm);
            assert!((1e3 * found - expected).abs() < 1e-12, "{number}: {found}");
        }
        // Noll's 4th and the 9th of the Fringe set.
        let (noll, _) = error(ZernikeTerms::Noll, vec![0.0, 0.0, 0.0, 1.0]).at(550.0).at(place_mm);
        assert!((1e3 * noll - osa[2].1).abs() < 1e-12);
        let mut ninth = vec![0.0; 9];
        ninth[8] = 1.0;
        let (fringe, _) = error(ZernikeTerms::Fringe, ninth).at(550.0).at(place_mm);
        assert!((1e3 * fringe - osa[4].1 / 5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_the_values() {
        let coefficients_um = (0..66).map(|i| f64::from(i % 7) - 3.0).collect();
        let map = error(ZernikeTerms::Osa, coefficients_um).at(550.0);
        let (place_mm, step_mm) = (DVec2::new(0.9, -1.3), 1e-5);
        let along = |u: DVec2| (map.at(place_mm + u * step_mm).0 - map.at(place_mm - u * step_mm).0) / (2.0 * step_mm);
        let found = map.at(place_mm).1;
        assert!((found - DVec2::new(along(DVec2::X), along(DVec2::Y))).length() < 1e-7 * found.length());
    }

    #[test]
    fn symmetry_is_that_of_the_terms() {
        let of = |number: usize| {
            let mut coefficients_um = vec![0.0; number + 1];
            coefficients_um[number] = 0.1;
            let error = error(ZernikeTerms::Osa, coefficients_um);
            (error.is_rotational(), error.is_mirrored_along(0), error.is_mirrored_along(1))
        };
        // Defocus, astigmatism at 45° and along the axes, coma along y and along x.
        assert_eq!(of(4), (true, true, true));
        assert_eq!(of(3), (false, false, false));
        assert_eq!(of(5), (false, true, true));
        assert_eq!(of(7), (false, true, false));
        assert_eq!(of(8), (false, false, true));
    }

    #[test]
    fn coefficients_lie_between_those_of_the_bands_and_the_eye_adds_its_color() {
        let band = |wavelength_nm: f64, um: f64| WavefrontBand { wavelength_nm, coefficients_um: vec![0.0, um] };
        let two =
            WavefrontError { bands: vec![band(500.0, 1.0), band(600.0, 3.0)], ..error(ZernikeTerms::Osa, vec![]) };
        for (nm, um) in [(400.0, 1.0), (500.0, 1.0), (525.0, 1.5), (600.0, 3.0), (700.0, 3.0)] {
            assert!((two.coefficients_um(nm)[1] - um).abs() < 1e-12, "{nm}");
        }
        let eye = WavefrontError { chromatic_eye_nm: Some(550.0), ..error(ZernikeTerms::Osa, vec![]) };
        // The chromatic eye's table: −1.00 dioptre at 450 nm, −0.20 at 550: more power for blue, whose edge is ahead.
        let ahead_mm = |nm: f64| eye.at(nm).of_power(1);
        assert!((ahead_mm(450.0) - 0.5e-3 * 0.8).abs() < 0.5e-3 * 0.02, "{}", ahead_mm(450.0));
        assert_eq!(ahead_mm(550.0), 0.0);
        assert!(ahead_mm(650.0) < 0.0);
    }

    #[test]
    fn nonsense_is_refused() {
        let good = || error(ZernikeTerms::Fringe, vec![0.0; 37]);
        assert!(good().check(0).is_ok());
        let bands =
            |nm: [f64; 2]| nm.map(|wavelength_nm| WavefrontBand { wavelength_nm, coefficients_um: vec![] }).to_vec();
        for wrong in [
            WavefrontError { radius_mm: 0.0, ..good() },
            WavefrontError { bands: vec![], ..good() },
            WavefrontError { bands: bands([600.0, 500.0]), ..good() },
            error(ZernikeTerms::Fringe, vec![0.0; 38]),
            error(ZernikeTerms::Osa, vec![f64::NAN]),
            WavefrontError { chromatic_eye_nm: Some(200.0), ..good() },
        ] {
            assert!(wrong.check(0).is_err(), "{wrong:?}");
        }
    }
}
