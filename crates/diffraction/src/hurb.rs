//! Heisenberg uncertainty ray bending (HURB): how far a ray is spread by the edge that it passes.
//!
//! Freniere et al., SPIE 3780 (1999): a ray that passes an edge at the distance d is known to within d, so that its
//! transverse momentum is not: `tan σ = γ / (2 k d)`, a Gaussian. It gives the width of Airy's pattern, its
//! scaling with wavelength and f-number, and a good edge in defocus; it does not give rings. `docs/hurb.md` derives what is
//! computed from it; comments name its equations.

use std::f64::consts::PI;

use dioptric_optics::{StopPoint, quadrature::gauss_legendre_on};
use serde::{Deserialize, Serialize};

use crate::Covariance;

/// A round edge at which rays are deviated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircularStop {
    /// Radius of the opening, mm.
    pub radius_mm: f64,
    /// 2πn/λ in the medium where the rays are bent, 1/mm.
    pub wave_number_per_mm: f64,
}

impl CircularStop {
    /// Returns an edge in a medium of this index, for light of this vacuum wavelength.
    pub fn new(radius_mm: f64, wavelength_nm: f64, index: f64) -> Self {
        Self { radius_mm, wave_number_per_mm: 2.0 * PI * index / (wavelength_nm * 1e-6) }
    }
}

/// The two constants of uncertainty bending: `tan σ = √((edge/d)² + (floor/R)²) / (2k)` for an edge at the distance d
/// in a round stop of radius R.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hurb {
    /// Factor γ of the distance to the edge.
    pub edge: f64,
    /// Factor of the radius of the stop; 0 in the published model.
    pub floor: f64,
}

/// The spread of one ray: standard deviations of its direction cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngularSpread {
    /// Along the radius of the stop.
    pub radial: f64,
    /// Across it.
    pub across: f64,
}

impl Hurb {
    /// The paper's model, and Freniere's: γ = 1.
    pub const PAPER: Self = Self { edge: 1.0, floor: 0.0 };
    /// The model of later `Scene3D` and PBRT forks: γ = √2.
    pub const SCENE3D: Self = Self { edge: std::f64::consts::SQRT_2, floor: 0.0 };
    /// Our own: the far tail and the slope of the modulation at 0 of Airy's pattern (edge √(2/π)), and its core
    /// (floor 1.65). Better than γ = 1 in focus, not in defocus.
    pub const CALIBRATED: Self = Self { edge: 0.797_884_560_802_865_4, floor: 1.65 };

    /// Returns the published model with another γ.
    pub fn with_gamma(gamma: f64) -> Self {
        Self { edge: gamma, floor: 0.0 }
    }

    /// Returns the standard deviation of a direction cosine for an edge at `distance_mm`, of a round stop.
    ///
    /// The arc tangent of the model's tangent is taken for the spread of the cosine: they differ where a ray passes
    /// within a wavelength of the edge.
    pub fn sigma(self, distance_mm: f64, edge: CircularStop) -> f64 {
        self.variance(1.0 / (distance_mm * distance_mm), edge).sqrt()
    }

    /// Returns the spread of a ray that crosses a round stop `r_mm` from its center.
    ///
    /// The distances to the edge are R − r along the radius and the half-chord √(R² − r²) across it.
    pub fn spread(self, r_mm: f64, edge: CircularStop) -> AngularSpread {
        let (radial, across) = self.variances(r_mm, edge);
        AngularSpread { radial: radial.sqrt(), across: across.sqrt() }
    }

    /// Returns the covariance of the direction cosines, along the stop's own axes, of a ray that crosses a round stop at a
    /// place.
    #[inline]
    pub fn covariance(self, at: StopPoint, edge: CircularStop) -> Covariance {
        let square = at.mm.length_squared();
        // C = σ_t² 1 + (σ_r² − σ_t²) r̂ r̂ᵀ (eq. 3).
        let (radial, across) = self.variances(square.sqrt(), edge);
        // In the middle the two are equal.
        let more = (radial - across) / square.max(f64::MIN_POSITIVE);
        let Covariance { xx, xy, yy } = Covariance::along(at.mm);
        Covariance { xx: across + more * xx, xy: more * xy, yy: across + more * yy }
    }

    /// Returns the variances along the radius and across it.
    #[inline]
    fn variances(self, r_mm: f64, edge: CircularStop) -> (f64, f64) {
        // The distances R − r and √(R² − r²) (eqs. 2a and 2b), as squares and without cancellation.
        let clearance = (edge.radius_mm - r_mm).max(1e-12 * edge.radius_mm);
        let across_middle = edge.radius_mm + r_mm;
        let each = 1.0 / (clearance * clearance * across_middle);
        (self.variance(across_middle * each, edge), self.variance(clearance * each, edge))
    }

    /// Returns the variance for an edge at a distance of which 1 over the square is given, 1/mm².
    #[inline]
    fn variance(self, per_distance_squared: f64, edge: CircularStop) -> f64 {
        let (floor, k) = (self.floor / edge.radius_mm, 2.0 * edge.wave_number_per_mm);
        arc_squared((self.edge * self.edge * per_distance_squared + floor * floor) / (k * k))
    }

    /// Returns the modulation of an ideal lens in focus at the frequency `s`, in units of 1/(λN).
    pub fn mtf(self, s: f64) -> f64 {
        self.average(|radial, across| {
            mean_over_azimuth(|cos2| (-2.0 * (PI * s).powi(2) * (cos2 * radial + (1.0 - cos2) * across)).exp())
        })
    }

    /// Returns the line spread of an ideal lens in focus `u` from the line, in units of λN.
    pub fn lsf(self, u: f64) -> f64 {
        self.average(|radial, across| {
            mean_over_azimuth(|cos2| {
                let variance = cos2 * radial + (1.0 - cos2) * across;
                (-0.5 * u * u / variance).exp() / (2.0 * PI * variance).sqrt()
            })
        })
    }

    /// Returns the share of the energy of an ideal lens in focus within `r` of the center, in units of λN.
    pub fn encircled_energy(self, r: f64) -> f64 {
        self.average(|radial, across| {
            mean_over_azimuth(|cos2| {
                let q = cos2 / radial + (1.0 - cos2) / across;
                -(-0.5 * r * r * q).exp_m1() / (q * (radial * across).sqrt())
            })
        })
    }

    /// Returns the mean over the pupil of a function of the two film variances, (λN)².
    fn average(self, value: impl Fn(f64, f64) -> f64) -> f64 {
        // With ρ = 1 − t² the nodes crowd where the spread diverges.
        gauss_legendre_on(96, 0.0, 1.0)
            .iter()
            .map(|&(t, w)| {
                let clearance = t * t;
                let rho = 1.0 - clearance;
                let variance = |d2: f64| (self.edge * self.edge / d2 + self.floor * self.floor) / (4.0 * PI * PI);
                let measure = 2.0 * rho * 2.0 * t * w;
                measure * value(variance(clearance * clearance), variance(clearance * (1.0 + rho)))
            })
            .sum()
    }
}

/// Returns the square of the angle whose tangent's square is given, without branches: to rounding up to a tangent of 0.1,
/// to 1e-10 up to 1, and to 1e-6 beyond, a right angle included.
#[inline]
fn arc_squared(tangent_squared: f64) -> f64 {
    // The tangent of half the angle, twice: at most that of π/8.
    let half = |square: f64| {
        let more = 1.0 + (1.0 + square).sqrt();
        square / (more * more)
    };
    // The largest squares leave no room for their sums.
    let square = half(half(tangent_squared.clamp(0.0, 1e300)));
    let series = ARC_SQUARED.iter().rev().fold(0.0, |sum, term| term - square * sum);
    16.0 * square * series
}

/// The series of arctan²√x over x: (1 + 1/3 + … + 1/(2n − 1))/n, with alternating signs.
const ARC_SQUARED: [f64; 8] = {
    let mut terms = [0.0; 8];
    let (mut n, mut sum) = (0, 0.0);
    while n < 8 {
        sum += 1.0 / (2 * n + 1) as f64;
        terms[n] = sum / (n + 1) as f64;
        n += 1;
    }
    terms
};

/// Returns the mean over the azimuth of a function of its cosine squared.
fn mean_over_azimuth(value: impl Fn(f64) -> f64) -> f64 {
    let n = 128;
    (0..n).map(|i| value((0.5 * PI * (f64::from(i) + 0.5) / f64::from(n)).cos().powi(2))).sum::<f64>() / f64::from(n)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use glam::DVec2;

    use super::*;
    use crate::{airy, width::full_width_at_half_maximum};

    fn width(model: Hurb) -> f64 {
        full_width_at_half_maximum(|u| model.lsf(u), 2.0)
    }

    #[test]
    fn widths_are_those_of_the_universal_curve() {
        // Values to four digits from an independent quadrature.
        assert_abs_diff_eq!(width(Hurb::PAPER), 0.6174, epsilon = 2e-4);
        assert_abs_diff_eq!(width(Hurb::SCENE3D), 0.8732, epsilon = 2e-4);
        assert_abs_diff_eq!(width(Hurb::with_gamma(2.0)), 1.2349, epsilon = 3e-4);
        assert_abs_diff_eq!(width(Hurb::CALIBRATED), 0.885, epsilon = 5e-3);
    }

    #[test]
    fn modulation_is_that_of_the_closed_form() {
        for (s, paper, scene3d) in
            [(0.05, 0.9239, 0.8942), (0.2, 0.7274, 0.6351), (0.5, 0.4380, 0.2999), (1.0, 0.1677, 0.0667)]
        {
            assert_abs_diff_eq!(Hurb::PAPER.mtf(s), paper, epsilon = 1e-4);
            assert_abs_diff_eq!(Hurb::SCENE3D.mtf(s), scene3d, epsilon = 1e-4);
        }
    }

    #[test]
    fn the_calibrated_model_follows_theory_in_focus() {
        for s in [0.1, 0.2, 0.3, 0.5, 0.7] {
            assert_abs_diff_eq!(Hurb::CALIBRATED.mtf(s), airy::mtf(s), epsilon = 0.025);
        }
        let error = |r: f64| Hurb::CALIBRATED.encircled_energy(r) - airy::encircled_energy(r);
        // The bars, at the radii at which models were tabulated when they were set.
        for r in [0.5, 1.0, 1.22, 2.0] {
            assert_abs_diff_eq!(error(r), 0.0, epsilon = 0.05);
        }
        for r in [5.0, 10.0] {
            assert_abs_diff_eq!(error(r), 0.0, epsilon = 0.002);
        }
    }

    #[test]
    fn between_those_radii_theory_has_steps_that_gaussians_cannot_follow() {
        let largest = |model: Hurb, from: f64, to: f64| {
            let n = ((to - from) / 0.04) as usize;
            let radii = (0..=n).map(|i| from + 0.04 * i as f64);
            radii.map(|r| (model.encircled_energy(r) - airy::encircled_energy(r)).abs()).fold(0.0, f64::max)
        };
        // 0.0548 at 0.88 λN and 0.0034 at 3 λN, by an independent quadrature.
        assert_abs_diff_eq!(largest(Hurb::CALIBRATED, 0.5, 3.0), 0.0548, epsilon = 3e-4);
        assert_abs_diff_eq!(largest(Hurb::CALIBRATED, 3.0, 8.0), 0.0034, epsilon = 1e-4);
        // Past 3 λN the floor makes no difference: what is left are Airy's rings.
        for floor in [1.5, 1.752, 1.9] {
            let model = Hurb { floor, ..Hurb::CALIBRATED };
            assert_abs_diff_eq!(largest(model, 3.0, 4.0), 0.0034, epsilon = 3e-4);
        }
    }

    #[test]
    fn spread_is_inversely_related_to_the_distance_of_the_edge() {
        let edge = CircularStop::new(1.0, 550.0, 1.0);
        let (far, near) = (Hurb::PAPER.spread(0.0, edge), Hurb::PAPER.spread(0.9, edge));
        assert_abs_diff_eq!(near.radial / far.radial, 10.0, epsilon = 1e-4);
        assert_abs_diff_eq!(near.across / far.across, 1.0 / 0.19f64.sqrt(), epsilon = 1e-4);
        assert_eq!(far.radial, far.across);
    }

    #[test]
    fn the_spread_of_a_cosine_is_the_arc_of_the_models_tangent() {
        for model in [Hurb::PAPER, Hurb::CALIBRATED] {
            for (distance_mm, limit) in
                [(1.0, 1e-14), (0.01, 1e-14), (1e-3, 1e-14), (1e-4, 1e-12), (3e-5, 1e-10), (1e-9, 1e-6), (0.0, 1e-6)]
            {
                let edge = CircularStop::new(1.0, 550.0, 1.5);
                let tangent = (model.edge / distance_mm).hypot(model.floor) / (2.0 * edge.wave_number_per_mm);
                let off = model.sigma(distance_mm, edge) / tangent.atan() - 1.0;
                assert!(off.abs() < limit, "{distance_mm}: {off}");
            }
        }
    }

    #[test]
    fn the_covariance_has_the_spread_along_the_radius_and_across_it() {
        let edge = CircularStop::new(2.0, 450.0, 1.0);
        for (r_mm, angle) in [(0.0, 0.0), (1e-9, 2.0), (0.7, 0.4), (1.99, -2.2)] {
            let axis = DVec2::from_angle(angle);
            let AngularSpread { radial, across } = Hurb::CALIBRATED.spread(r_mm, edge);
            let (narrow, wide) = Hurb::CALIBRATED.covariance(StopPoint { mm: axis * r_mm }, edge).axes();
            assert!((narrow.sqrt() / across - 1.0).abs() < 1e-9 && (wide.sqrt() / radial - 1.0).abs() < 1e-9);
            let wanted = Covariance::along(axis * radial).plus(Covariance::along(axis.perp() * across));
            let found = Hurb::CALIBRATED.covariance(StopPoint { mm: axis * r_mm }, edge);
            assert!((found.xy - wanted.xy).abs() < 1e-12 * wide && (found.xx - wanted.xx).abs() < 1e-12 * wide);
        }
    }
}
