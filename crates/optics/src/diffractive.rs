//! Ruled gratings and diffractive surfaces: phases that surfaces add to light, used in one order.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{OpticsError, WavefrontError, trace::Phase};

/// What a surface adds to the light that it refracts or reflects: the phase of one diffraction order.
///
/// In the order m, with cycles ψ(x, y) of the profile, a ray of wavelength λ leaves with `n₂ d₂ = n₁ d₁ + m λ ∇ψ + Γ N`: the
/// components along the surface obey the grating equation, and Γ along the normal N is what makes d₂ a unit vector. Its path is
/// m λ ψ longer. Where no d₂ exists the order does not propagate, and the ray ends as a totally reflected one does. The order has
/// all of the light where no [`Blaze`] is stated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiffractiveSurface {
    /// The surface, counted from 0.
    pub surface: usize,
    /// The order: 1 deflects light towards where the phase grows.
    pub order: i32,
    /// The phase of the first order.
    pub profile: PhaseProfile,
    /// The relief by which the order has less than all of the light; left out, it has all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blaze: Option<Blaze>,
}

/// A blazed relief: in each groove or ring the path rises evenly, at the design wavelength by a whole number of it.
///
/// By scalar theory the order m has the share sinc²(α − m) of the light, α = d (λ₀/λ) Δn(λ)/Δn(λ₀) with the design order d and the step of the index
/// at the surface, 2n at a mirror; where the media on both sides are the same, only λ₀/λ is left. A staircase of N levels a groove gives
/// |sinc(m/N) sin(π(α − m)) / (N sin(π(α − m)/N))|² (Swanson, Lincoln Laboratory report 854, 1989). The shares of all orders add up to 1. It holds for grooves that are many wavelengths
/// wide, near normal incidence, and knows no shadowing, reflection or absorption.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blaze {
    /// The (vacuum) wavelength at which the design order has all of the light of a smooth relief, nm.
    pub design_nm: f64,
    /// The design order; left out, the order of the surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<i32>,
    /// Levels of a staircase; left out, the relief is smooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<u32>,
}

/// Returns sin(πx)/(πx).
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

impl Blaze {
    /// Returns the share of light of an order where the relief makes a path of this many wavelengths in a groove.
    pub fn share_of(&self, order: i32, waves: f64) -> f64 {
        let off = waves - f64::from(order);
        let amplitude = match self.levels {
            None => sinc(off),
            Some(levels) => {
                let n = f64::from(levels);
                // The mean over the levels repeats with their number, but for its sign.
                let turns = off / n - (off / n).round();
                let mean = if turns == 0.0 { 1.0 } else { (PI * n * turns).sin() / (n * (PI * turns).sin()) };
                sinc(f64::from(order) / n) * mean
            }
        };
        amplitude * amplitude
    }

    fn check(&self, surface: usize) -> Result<(), OpticsError> {
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if !(self.design_nm > 0.0 && self.design_nm.is_finite()) {
            return wrong("design_nm of a blaze", self.design_nm, "a finite number above 0");
        }
        match self.levels {
            Some(levels) if !(2..=1_000_000).contains(&levels) => {
                wrong("levels of a blaze", f64::from(levels), "2 to 1000000")
            }
            _ => Ok(()),
        }
    }
}

/// A phase as a function of x and y on the vertex plane of a surface, in its own frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PhaseProfile {
    /// Straight grooves that are equidistant on the vertex plane.
    Grating {
        /// Grooves per mm along x and along y.
        lines_per_mm: [f64; 2],
    },
    /// Rings: the phase is the sum of `coefficients_rad[i] ρ^(2i + 2)`, ρ the distance from the axis over a radius.
    Rings {
        /// The radius at which ρ is 1, mm.
        radius_mm: f64,
        /// Coefficients of ρ², ρ⁴ and on, radians.
        coefficients_rad: Vec<f64>,
    },
    /// A wavefront error: a path, not a phase of an order, which is 1.
    Wavefront(WavefrontError),
}

impl PhaseProfile {
    /// Whether the phase stays when x (axis 0) or y (axis 1) changes its sign.
    pub(crate) fn is_mirrored_along(&self, axis: usize) -> bool {
        match self {
            Self::Grating { lines_per_mm } => lines_per_mm[axis] == 0.0,
            Self::Rings { .. } => true,
            Self::Wavefront(error) => error.is_mirrored_along(axis),
        }
    }

    /// Returns what it adds to light of a wavelength in an order.
    pub(crate) fn at(&self, order: i32, wavelength_nm: f64) -> Phase {
        let path_per_cycle_mm = f64::from(order) * 1e-6 * wavelength_nm;
        match self {
            Self::Grating { lines_per_mm } => {
                Phase::Grating { slope: DVec2::from_array(*lines_per_mm) * path_per_cycle_mm }
            }
            Self::Rings { radius_mm, coefficients_rad } => Phase::Rings {
                per_mm2: 1.0 / (radius_mm * radius_mm),
                coefficients_mm: coefficients_rad.iter().map(|a| a / TAU * path_per_cycle_mm).collect(),
            },
            Self::Wavefront(error) => Phase::Wavefront(error.at(wavelength_nm)),
        }
    }

    /// Whether the phase depends on the distance from the axis alone.
    pub(crate) fn is_rotational(&self) -> bool {
        match self {
            Self::Grating { lines_per_mm } => *lines_per_mm == [0.0; 2],
            Self::Rings { .. } => true,
            Self::Wavefront(error) => error.is_rotational(),
        }
    }
}

impl DiffractiveSurface {
    /// Checks the numbers, for a lens of this many surfaces.
    pub(crate) fn check(&self, n_surfaces: usize) -> Result<(), OpticsError> {
        let surface = self.surface;
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if surface >= n_surfaces {
            return wrong("diffractive surface", surface as f64, "a surface that the lens has, counted from 0");
        }
        let numbers: &[f64] = match &self.profile {
            PhaseProfile::Grating { lines_per_mm } => lines_per_mm,
            PhaseProfile::Rings { radius_mm, .. } if !(*radius_mm > 0.0 && radius_mm.is_finite()) => {
                return wrong("radius_mm of a phase", *radius_mm, "a finite number above 0");
            }
            PhaseProfile::Rings { coefficients_rad, .. } => coefficients_rad,
            PhaseProfile::Wavefront(error) => {
                if self.order != 1 || self.blaze.is_some() {
                    return wrong("order of a wavefront error", f64::from(self.order), "1, and no blaze");
                }
                return error.check(surface);
            }
        };
        match numbers.iter().find(|number| !number.is_finite()) {
            Some(found) => wrong("number of a phase", *found, "a finite number"),
            None => self.blaze.map_or(Ok(()), |blaze| blaze.check(surface)),
        }
    }
}
