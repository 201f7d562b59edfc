//! Surfaces and the media between them.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{Aperture, Glass, OpticsError, toric::Toric};

/// The shape of a surface, beyond its curvature at the vertex.
///
/// A family that grows: code outside this crate should have a catch-all arm.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub enum Shape {
    /// A sphere, or a plane where the curvature is 0.
    #[default]
    Sphere,
    /// A conic of revolution.
    Conic {
        /// The conic constant: 0 for a sphere, −1 for a paraboloid.
        conic: f64,
    },
    /// A conic with added even powers of the distance r from the axis.
    EvenAsphere {
        /// The conic constant.
        conic: f64,
        /// Coefficients of r⁴, r⁶, r⁸, …: `coefficients[i]` in mm^(−3 − 2i).
        coefficients: Vec<f64>,
    },
    /// A conic with added powers of r from the first on: what even aspheres with an r² term are, and odd ones.
    ///
    /// The r² term adds to the power of the surface; an r term makes a cone, which first-order optics leaves out.
    OddAsphere {
        /// The conic constant.
        conic: f64,
        /// Coefficients of r, r², r³, …: `coefficients[i]` in mm^(−i).
        coefficients: Vec<f64>,
    },
    /// An ideal thin lens in a plane: it changes the tangents of a ray's slopes by height × power, so that every
    /// plane is imaged as a plane, perfectly and without distortion.
    ThinLens {
        /// One over the focal length in air, 1/mm.
        power_per_mm: f64,
    },
    /// A surface with a conic section each along y, whose curvature is the surface's own, and along x:
    /// `z = (c_x x² + c_y y²) / (1 + √(1 − (1 + k_x) c_x² x² − (1 + k_y) c_y² y²))`.
    Biconic {
        /// The conic constant along y.
        conic: f64,
        /// The curvature along x, 1/mm.
        curvature_x_per_mm: f64,
        /// The conic constant along x.
        conic_x: f64,
    },
    /// A toroid: a curve in the y–z plane, of the surface's own curvature, turned about an axis parallel to y.
    ///
    /// With no curvature along x it is a cylinder.
    Toroid {
        /// One over the radius of rotation, which is the curvature along x, 1/mm.
        curvature_x_per_mm: f64,
        /// The conic constant of the curve.
        conic: f64,
        /// What the curve adds to its conic: coefficients of y², y⁴, …, `coefficients[i]` in mm^(−1 − 2i).
        coefficients: Vec<f64>,
    },
}

impl Shape {
    /// Whether the shape is one of revolution.
    pub fn is_rotational(&self) -> bool {
        !matches!(self, Self::Biconic { .. } | Self::Toroid { .. })
    }
}

/// A surface in the frame of its own vertex, with a circular rim about its axis.
///
/// The curvature is signed: positive when the center lies downstream, at +z. A plane is a surface of zero
/// curvature, not a special case. Where the surface is not one of revolution the curvature is that along y.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// One over the radius at the vertex (along y), 1/mm.
    pub curvature_per_mm: f64,
    /// The rest of the shape.
    pub shape: Shape,
    /// Half the clear diameter, mm.
    pub semi_aperture_mm: f64,
}

impl Surface {
    /// Returns a sphere; an infinite radius makes a plane.
    pub fn sphere(radius_mm: f64, semi_aperture_mm: f64) -> Self {
        Self { curvature_per_mm: 1.0 / radius_mm, shape: Shape::Sphere, semi_aperture_mm }
    }

    /// Returns a plane.
    pub fn plane(semi_aperture_mm: f64) -> Self {
        Self { curvature_per_mm: 0.0, shape: Shape::Sphere, semi_aperture_mm }
    }

    /// Returns the z of the surface at a distance from the axis, mm; NaN beyond its equator.
    ///
    /// Of a surface that is not one of revolution it is the z in the y–z plane.
    pub fn sag_mm(&self, r_mm: f64) -> f64 {
        let r2 = r_mm * r_mm;
        let base = |conic: f64| {
            let c = self.curvature_per_mm;
            c * r2 / (1.0 + (1.0 - (1.0 + conic) * c * c * r2).sqrt())
        };
        match &self.shape {
            Shape::Sphere => base(0.0),
            Shape::Conic { conic } => base(*conic),
            Shape::EvenAsphere { conic, coefficients } => {
                base(*conic) + r2 * r2 * coefficients.iter().rev().fold(0.0, |sum, a| sum * r2 + a)
            }
            Shape::OddAsphere { conic, coefficients } => {
                base(*conic) + r_mm * coefficients.iter().rev().fold(0.0, |sum, a| sum * r_mm + a)
            }
            Shape::ThinLens { .. } => 0.0,
            Shape::Biconic { .. } | Shape::Toroid { .. } => self.sag_at_mm(0.0, r_mm),
        }
    }

    /// Returns the z of the surface at a place, mm; NaN beyond its equator.
    pub fn sag_at_mm(&self, x_mm: f64, y_mm: f64) -> f64 {
        self.toric().map_or_else(|| self.sag_mm(x_mm.hypot(y_mm)), |toric| toric.at(x_mm, y_mm).z)
    }

    /// Returns the kernel's form of a surface that is not one of revolution.
    pub(crate) fn toric(&self) -> Option<Toric> {
        let cy = self.curvature_per_mm;
        match &self.shape {
            Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
                Some(Toric::Biconic { c: [*curvature_x_per_mm, cy], k: [*conic_x, *conic] })
            }
            Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
                let coefficients = coefficients.clone();
                Some(Toric::Toroid { c: [*curvature_x_per_mm, cy], conic: *conic, coefficients })
            }
            _ => None,
        }
    }

    /// Returns the surface mirrored at its vertex plane: as light meets it that runs towards −z.
    pub(crate) fn flipped(&self) -> Self {
        let negated = |list: &[f64]| list.iter().map(|a| -a).collect();
        let shape = match &self.shape {
            Shape::Sphere => Shape::Sphere,
            Shape::Conic { conic } => Shape::Conic { conic: *conic },
            Shape::EvenAsphere { conic, coefficients } => {
                Shape::EvenAsphere { conic: *conic, coefficients: negated(coefficients) }
            }
            Shape::OddAsphere { conic, coefficients } => {
                Shape::OddAsphere { conic: *conic, coefficients: negated(coefficients) }
            }
            Shape::ThinLens { power_per_mm } => Shape::ThinLens { power_per_mm: *power_per_mm },
            Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
                Shape::Biconic { conic: *conic, curvature_x_per_mm: -curvature_x_per_mm, conic_x: *conic_x }
            }
            Shape::Toroid { curvature_x_per_mm, conic, coefficients } => Shape::Toroid {
                curvature_x_per_mm: -curvature_x_per_mm,
                conic: *conic,
                coefficients: negated(coefficients),
            },
        };
        Self { curvature_per_mm: -self.curvature_per_mm, shape, semi_aperture_mm: self.semi_aperture_mm }
    }

    /// Whether the surface is one of revolution about its own axis.
    pub fn is_rotational(&self) -> bool {
        self.shape.is_rotational()
    }

    /// Checks that the numbers make sense, and that the surface reaches as far as its rim or, where it is among
    /// `apertures`, its opening; `surface` is its place.
    pub(crate) fn check(&self, surface: usize, apertures: &[Aperture]) -> Result<(), OpticsError> {
        let finite = |key, found: f64| match found.is_finite() {
            true => Ok(()),
            false => Err(OpticsError::Surface { surface, key, found, expected: "a finite number" }),
        };
        finite("curvature", self.curvature_per_mm)?;
        match &self.shape {
            Shape::Sphere => {}
            Shape::Conic { conic } => finite("conic", *conic)?,
            Shape::EvenAsphere { conic, coefficients } | Shape::OddAsphere { conic, coefficients } => {
                finite("conic", *conic)?;
                coefficients.iter().try_for_each(|&a| finite("coefficient", a))?;
            }
            Shape::ThinLens { power_per_mm } => finite("power_per_mm", *power_per_mm)?,
            Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
                finite("conic", *conic)?;
                finite("curvature_x_per_mm", *curvature_x_per_mm)?;
                finite("conic_x", *conic_x)?;
            }
            Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
                finite("conic", *conic)?;
                finite("curvature_x_per_mm", *curvature_x_per_mm)?;
                coefficients.iter().try_for_each(|&a| finite("coefficient", a))?;
            }
        }
        let found = self.semi_aperture_mm;
        if !(found > 0.0 && found.is_finite()) {
            let key = "semi_aperture_mm";
            return Err(OpticsError::Surface { surface, key, found, expected: "a finite number above 0" });
        }
        let mut openings =
            apertures.iter().filter(|aperture| aperture.surface == surface && !aperture.is_obscuration).peekable();
        let within = found * (1.0 - 1e-9);
        let section = match openings.peek() {
            None => self.section_that_ends_within(within),
            // A surface ends somewhere in an opening where it does at the edge of the opening and of the rim.
            Some(_) => openings
                .flat_map(|opening| opening.edge_mm().collect::<Vec<_>>())
                .map(|place| (place * (1.0 - 1e-9)).clamp_length_max(within))
                .find(|place| !self.sag_at_mm(place.x, place.y).is_finite()),
        };
        if let Some(section) = section {
            let radius_mm = match &self.shape {
                Shape::Biconic { curvature_x_per_mm, .. } | Shape::Toroid { curvature_x_per_mm, .. }
                    if section.x != 0.0 && *curvature_x_per_mm != 0.0 =>
                {
                    1.0 / curvature_x_per_mm
                }
                _ => 1.0 / self.curvature_per_mm,
            };
            return Err(OpticsError::RimBeyondSurface { surface, semi_aperture_mm: found, radius_mm });
        }
        Ok(())
    }

    /// Returns the direction in which the surface does not reach this far from its axis, if there is one.
    fn section_that_ends_within(&self, r_mm: f64) -> Option<DVec2> {
        let n_directions = if self.is_rotational() { 1 } else { RIM_DIRECTIONS };
        let direction = |i: usize| match i {
            0 => DVec2::Y,
            1 => DVec2::X,
            _ => DVec2::from_angle(FRAC_PI_2 * (i - 1) as f64 / (n_directions - 1) as f64),
        };
        (0..n_directions).map(direction).find(|u| !self.sag_at_mm(r_mm * u.x, r_mm * u.y).is_finite())
    }
}

/// Directions between x and y in which a rim is looked at; the four quadrants of a surface are alike.
const RIM_DIRECTIONS: usize = 9;

/// A surface, the medium behind it and the way to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct Interface {
    /// The surface.
    pub surface: Surface,
    /// The medium between this surface and the next.
    pub medium_after: Glass,
    /// Distance from this vertex to the next, mm; negative where surfaces overlap.
    pub thickness_after_mm: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sag_of_a_sphere_and_a_paraboloid() {
        assert!((Surface::sphere(5.0, 4.0).sag_mm(4.0) - 2.0).abs() < 1e-15);
        let paraboloid = Surface { shape: Shape::Conic { conic: -1.0 }, ..Surface::sphere(-10.0, 5.0) };
        assert!((paraboloid.sag_mm(4.0) + 0.8).abs() < 1e-15);
        assert_eq!(Surface::plane(1.0).sag_mm(0.7), 0.0);
        let flat = Shape::EvenAsphere { conic: 0.0, coefficients: vec![1e-3, 1e-5] };
        assert!((Surface { shape: flat, ..Surface::plane(3.0) }.sag_mm(2.0) - 0.01664).abs() < 1e-15);
    }

    #[test]
    fn rim_must_fit_on_its_sphere() {
        assert!(Surface::sphere(5.0, 5.0).check(0, &[]).is_ok());
        let message = Surface::sphere(5.0, 5.1).check(3, &[]).unwrap_err().to_string();
        assert_eq!(message, "surface 3: a rim of 5.1 mm does not fit on a surface of radius 5 mm");
    }
}
