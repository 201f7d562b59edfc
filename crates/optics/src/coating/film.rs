//! Thin films: what a surface with layers on it reflects and transmits, by the characteristic matrix.
//!
//! Fields vary as exp(−iωt), so that an absorbing index is n + ik. The amplitudes are those of the fields along the surface (Macleod,
//! *Thin-Film Optical Filters*, ch. 2; Born & Wolf, § 1.6).

use num_complex::Complex64;

/// The layers between two media, at one wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    // Invariant: `n_before` is positive.
    n_before: f64,
    /// Index and phase thickness at normal incidence over the index, 2π d / λ, in the order that light meets them.
    layers: Vec<(Complex64, f64)>,
    n_after: Complex64,
}

/// Amplitudes of the fields along a surface, over that of the wave that comes: reflected and transmitted, of both polarizations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amplitudes {
    /// Reflected, electric field across the plane of incidence.
    pub r_s: Complex64,
    /// Reflected, electric field in the plane of incidence.
    pub r_p: Complex64,
    /// Transmitted, across the plane.
    pub t_s: Complex64,
    /// Transmitted, in the plane.
    pub t_p: Complex64,
}

/// Shares of the light that comes to a surface, of both polarizations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Reflected, electric field across the plane of incidence.
    pub r_s: f64,
    /// Reflected, electric field in the plane of incidence.
    pub r_p: f64,
    /// Transmitted, across the plane.
    pub t_s: f64,
    /// Transmitted, in the plane.
    pub t_p: f64,
}

impl Film {
    /// Returns the film of layers, each an index and a thickness in nm, in the order that light of this (vacuum) wavelength meets them.
    pub fn new(n_before: f64, layers: &[(Complex64, f64)], n_after: Complex64, wavelength_nm: f64) -> Self {
        let phase = |nm: f64| std::f64::consts::TAU * nm / wavelength_nm;
        let layers = layers.iter().map(|&(index, thickness_nm)| (index, phase(thickness_nm))).collect();
        Self { n_before, layers, n_after }
    }

    /// Returns the film as light meets it that comes from the other side, which must not absorb.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let layers = self.layers.iter().rev().copied().collect();
        Self { n_before: self.n_after.re, layers, n_after: self.n_before.into() }
    }

    /// The index before the film, and the real part of that behind.
    pub(crate) fn indices(&self) -> [f64; 2] {
        [self.n_before, self.n_after.re]
    }

    /// Returns the amplitudes for light that comes at this cosine of incidence, 0 to 1.
    pub fn amplitudes(&self, cos: f64) -> Amplitudes {
        // What refraction keeps: the square of n sin θ.
        let kept = self.n_before * self.n_before * (1.0 - cos * cos).max(0.0);
        let along = |n: Complex64| {
            // n cos θ, of the root that dies away.
            let root = (n * n - kept).sqrt();
            if root.im < 0.0 || (root.im == 0.0 && root.re < 0.0) { -root } else { root }
        };
        let before = Complex64::from(self.n_before * cos);
        let solve = |admittance: &dyn Fn(Complex64, Complex64) -> Complex64| {
            let last = admittance(self.n_after, along(self.n_after));
            let (mut e, mut h) = (Complex64::ONE, last);
            for &(n, phase) in self.layers.iter().rev() {
                let q = along(n);
                let (eta, delta) = (admittance(n, q), q * phase);
                let (sin, cos) = (-Complex64::I * delta.sin(), delta.cos());
                (e, h) = (e * cos + h * sin / eta, e * sin * eta + h * cos);
            }
            let first = admittance(self.n_before.into(), before);
            let sum = first * e + h;
            ((first * e - h) / sum, 2.0 * first / sum)
        };
        let (r_s, t_s) = solve(&|_, q| q);
        let (r_p, t_p) = solve(&|n, q| n * n / q);
        Amplitudes { r_s, r_p, t_s, t_p }
    }

    /// Returns by what the squares of transmitted amplitudes are to be multiplied to be shares of the power, for s and for p.
    pub(crate) fn power_of_squares(&self, cos: f64) -> [f64; 2] {
        let kept = self.n_before * self.n_before * (1.0 - cos * cos).max(0.0);
        let root = (self.n_after * self.n_after - kept).sqrt();
        let q = if root.im < 0.0 { -root } else { root };
        let before = self.n_before * cos;
        [q.re / before, (self.n_after * self.n_after / q).re / (self.n_before * self.n_before / before)]
    }

    /// Returns the shares of the power reflected and transmitted for light that comes at this cosine of incidence, above 0.
    pub fn shares(&self, cos: f64) -> Shares {
        let Amplitudes { r_s, r_p, t_s, t_p } = self.amplitudes(cos);
        let [of_s, of_p] = self.power_of_squares(cos);
        Shares { r_s: r_s.norm_sqr(), r_p: r_p.norm_sqr(), t_s: of_s * t_s.norm_sqr(), t_p: of_p * t_p.norm_sqr() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bare(before: f64, after: f64) -> Film {
        Film::new(before, &[], after.into(), 550.0)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
    }

    #[test]
    fn bare_glass_is_fresnels() {
        let shares = bare(1.0, 1.5).shares(1.0);
        near(shares.r_s, 0.04);
        near(shares.r_p, 0.04);
        near(shares.t_s, 0.96);
        for (n1, n2, degrees) in [(1.0, 1.5, 30.0f64), (1.5, 1.0, 20.0), (1.7, 1.5, 50.0), (1.0, 1.9, 85.0)] {
            let (c1, s1) = (degrees.to_radians().cos(), degrees.to_radians().sin());
            let c2 = (1.0 - (n1 * s1 / n2).powi(2)).sqrt();
            let shares = bare(n1, n2).shares(c1);
            near(shares.r_s, ((n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2)).powi(2));
            near(shares.r_p, ((n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)).powi(2));
            near(shares.r_s + shares.t_s, 1.0);
            near(shares.r_p + shares.t_p, 1.0);
        }
    }

    #[test]
    fn nothing_is_reflected_at_brewsters_angle_and_all_beyond_the_critical_one() {
        near(bare(1.0, 1.5).shares(1.5f64.atan().cos()).r_p, 0.0);
        let beyond = bare(1.5, 1.0).shares(60f64.to_radians().cos());
        near(beyond.r_s, 1.0);
        near(beyond.r_p, 1.0);
        near(beyond.t_s, 0.0);
    }

    #[test]
    fn quarter_wave_has_its_closed_form_and_a_half_wave_is_absent() {
        let (n0, n1, ns, nm) = (1.0, 1.38, 1.52, 550.0);
        let film = |thickness_nm: f64, at_nm: f64| Film::new(n0, &[(n1.into(), thickness_nm)], ns.into(), at_nm);
        let quarter = film(nm / 4.0 / n1, nm).shares(1.0);
        near(quarter.r_s, ((n0 * ns - n1 * n1) / (n0 * ns + n1 * n1)).powi(2));
        near(film(nm / 2.0 / n1, nm).shares(1.0).r_s, ((ns - n0) / (ns + n0)).powi(2));
        // A quarter of the wave in the layer, along its own slanted way.
        let slanted = film(nm / 4.0 / n1, 640.0);
        for cos in [0.3, 0.7, 1.0] {
            let there = slanted.shares(cos);
            near(there.r_s + there.t_s, 1.0);
            near(there.r_p + there.t_p, 1.0);
            // From behind, at the angle that refraction gives, as much gets through.
            let cos_after = (1.0 - (1.0 - cos * cos) / (ns * ns)).sqrt();
            let back = slanted.reversed().shares(cos_after);
            near(back.t_s, there.t_s);
            near(back.t_p, there.t_p);
        }
    }

    #[test]
    fn mirror_stack_has_its_closed_form() {
        // (HL)^N H of quarter waves: R = ((n0 ns − (nH/nL)^2N nH²) / (n0 ns + …))².
        let (high, low, ns, n_pairs) = (2.3f64, 1.38f64, 1.52, 5);
        let quarter = |n: f64| (Complex64::from(n), 633.0 / 4.0 / n);
        let mut layers: Vec<_> = (0..n_pairs).flat_map(|_| [quarter(high), quarter(low)]).collect();
        layers.push(quarter(high));
        let y = (high / low).powi(2 * n_pairs) * high * high / ns;
        near(Film::new(1.0, &layers, ns.into(), 633.0).shares(1.0).r_s, ((1.0 - y) / (1.0 + y)).powi(2));
    }

    #[test]
    fn metals_reflect_by_their_complex_index() {
        let silver = Complex64::new(0.06, 3.6);
        let shares = Film::new(1.0, &[], silver, 550.0).shares(1.0);
        near(
            shares.r_s,
            ((silver.re - 1.0).powi(2) + silver.im.powi(2)) / ((silver.re + 1.0).powi(2) + silver.im.powi(2)),
        );
        near(shares.r_s + shares.t_s, 1.0);
        // A layer that absorbs takes what neither goes on nor back.
        let thin = Film::new(1.0, &[(silver, 20.0)], 1.5.into(), 550.0).shares(0.8);
        assert!(thin.r_s + thin.t_s < 0.99 && thin.r_p + thin.t_p < 0.99);
    }
}
