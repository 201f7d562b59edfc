//! Lenses made larger or smaller.

use super::{ImageSurface, Lens};
use crate::{Aperture, CoordinateBreak, Interface, OpticsError, Outline, PhaseProfile, Shape, Surface};

impl Lens {
    /// Returns the lens with all its lengths so many times as long, and so many times the paths that diffractive surfaces and wavefront
    /// errors add: every ray of it is a ray of the lens, so many times as large. Angles, indices, f-numbers and the grooves of gratings stay,
    /// and media absorb as much on a millimetre.
    ///
    /// # Errors
    /// When the factor is not a number from 1e-6 to 1e6, or the lens has the chromatic aberration of an eye, which is of one size.
    pub fn scaled(&self, factor: f64) -> Result<Self, OpticsError> {
        if !(1e-6..=1e6).contains(&factor) {
            return Err(OpticsError::Scale { reason: format!("the factor is {factor}, expected 0.000001 to 1000000") });
        }
        if factor == 1.0 {
            return Ok(self.clone());
        }
        let mut lens = self.clone();
        for Interface { surface, thickness_after_mm, .. } in &mut lens.interfaces {
            *surface = scaled_surface(surface, factor);
            *thickness_after_mm *= factor;
        }
        lens.full_stop_semi_aperture_mm *= factor;
        for CoordinateBreak { pivot_mm, decenter_mm, .. } in &mut lens.moves {
            *pivot_mm *= factor;
            decenter_mm.iter_mut().for_each(|length_mm| *length_mm *= factor);
        }
        for Aperture { outline, center_mm, .. } in &mut lens.apertures {
            match outline {
                Outline::Circle { radius_mm } => *radius_mm *= factor,
                Outline::Ellipse { half_x_mm, half_y_mm } | Outline::Rectangle { half_x_mm, half_y_mm } => {
                    *half_x_mm *= factor;
                    *half_y_mm *= factor;
                }
            }
            center_mm.iter_mut().for_each(|length_mm| *length_mm *= factor);
        }
        for diffractive in &mut lens.diffractive {
            match &mut diffractive.profile {
                PhaseProfile::Grating { .. } => {}
                PhaseProfile::Rings { radius_mm, coefficients_rad } => {
                    *radius_mm *= factor;
                    coefficients_rad.iter_mut().for_each(|phase_rad| *phase_rad *= factor);
                }
                PhaseProfile::Wavefront(error) if error.chromatic_eye_nm.is_some() => {
                    let reason = format!("surface {} has the chromatic aberration of an eye", diffractive.surface);
                    return Err(OpticsError::Scale { reason });
                }
                PhaseProfile::Wavefront(error) => {
                    error.radius_mm *= factor;
                    let paths_um = error.bands.iter_mut().flat_map(|band| &mut band.coefficients_um);
                    paths_um.for_each(|path_um| *path_um *= factor);
                }
            }
        }
        let ImageSurface { curvature_per_mm, .. } = &mut lens.image_surface;
        *curvature_per_mm /= factor;
        lens.name = format!("{}, {factor} times as large", self.name);
        // Rims fit as they did, but for rounding.
        lens.interfaces
            .iter()
            .enumerate()
            .try_for_each(|(i, interface)| interface.surface.check(i, &lens.apertures))?;
        Ok(lens)
    }
}

fn scaled_surface(surface: &Surface, factor: f64) -> Surface {
    // A coefficient of rⁿ is a length over so many lengths.
    let scaled = |coefficients: &[f64], first: i32, step: i32| -> Vec<f64> {
        let power = |i: usize| 1 - (first + step * i as i32);
        coefficients.iter().enumerate().map(|(i, a)| a * factor.powi(power(i))).collect()
    };
    let shape = match &surface.shape {
        Shape::EvenAsphere { conic, coefficients } => {
            Shape::EvenAsphere { conic: *conic, coefficients: scaled(coefficients, 4, 2) }
        }
        Shape::OddAsphere { conic, coefficients } => {
            Shape::OddAsphere { conic: *conic, coefficients: scaled(coefficients, 1, 1) }
        }
        Shape::ThinLens { power_per_mm } => Shape::ThinLens { power_per_mm: power_per_mm / factor },
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            Shape::Biconic { conic: *conic, curvature_x_per_mm: curvature_x_per_mm / factor, conic_x: *conic_x }
        }
        Shape::Toroid { curvature_x_per_mm, conic, coefficients } => Shape::Toroid {
            curvature_x_per_mm: curvature_x_per_mm / factor,
            conic: *conic,
            coefficients: scaled(coefficients, 2, 2),
        },
        Shape::Sphere => Shape::Sphere,
        Shape::Conic { conic } => Shape::Conic { conic: *conic },
    };
    Surface {
        curvature_per_mm: surface.curvature_per_mm / factor,
        shape,
        semi_aperture_mm: surface.semi_aperture_mm * factor,
    }
}
