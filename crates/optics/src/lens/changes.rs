//! Other curvatures and distances in place of those of a prescription.

use serde::{Deserialize, Serialize};

use super::Lens;
use crate::{OpticsError, Shape};

/// Another curvature of a surface, or another distance behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SurfaceChange {
    /// The surface, counted from 0 along the light.
    pub surface: usize,
    /// One over its radius, 1/mm: 0 for a plane, positive where the center lies downstream; left out, it stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curvature_per_mm: Option<f64>,
    /// The distance to the next vertex, mm; left out, it stays. That behind the last surface is no part of the lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness_mm: Option<f64>,
}

impl Lens {
    /// Returns the lens with these numbers in place of its own, and "changed" behind its name; rims stay as they are.
    ///
    /// # Errors
    /// When a surface is not there or is an ideal lens, which has no curvature, a number is not finite, or a rim no longer fits.
    pub fn with_surface_changes(&self, changes: &[SurfaceChange]) -> Result<Self, OpticsError> {
        let mut lens = self.clone();
        let n_surfaces = lens.interfaces.len();
        for &SurfaceChange { surface, curvature_per_mm, thickness_mm } in changes {
            let interface =
                lens.interfaces.get_mut(surface).ok_or(OpticsError::ChangeOfSurface { surface, n_surfaces })?;
            if let Some(found) = curvature_per_mm {
                if matches!(interface.surface.shape, Shape::ThinLens { .. }) {
                    let expected = "none, for an ideal lens has no curvature";
                    return Err(OpticsError::Surface { surface, key: "curvature_per_mm", found, expected });
                }
                interface.surface.curvature_per_mm = found;
            }
            if let Some(found) = thickness_mm {
                if !found.is_finite() {
                    let expected = "a finite number";
                    return Err(OpticsError::Surface { surface, key: "thickness_mm", found, expected });
                }
                interface.thickness_after_mm = found;
            }
            lens.interfaces[surface].surface.check(surface, &lens.apertures)?;
        }
        if !changes.is_empty() {
            lens.name.push_str(", changed");
        }
        Ok(lens)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Glass, Interface, Surface};

    /// A lens of n = 1.5 between two spheres of 1/50 and −1/50 mm⁻¹.
    fn biconvex() -> Lens {
        let glass = Glass::Constant { index: 1.5 };
        let interfaces = vec![
            Interface { surface: Surface::sphere(50.0, 5.0), medium_after: glass, thickness_after_mm: 2.0 },
            Interface { surface: Surface::sphere(-50.0, 5.0), medium_after: Glass::Air, thickness_after_mm: 0.0 },
        ];
        Lens::new("biconvex", "made up", interfaces, 0).unwrap()
    }

    fn power_per_mm(lens: &Lens) -> f64 {
        1.0 / lens.at(550.0).unwrap().first_order().efl_mm
    }

    #[test]
    fn power_follows_the_lens_maker() {
        let air = |nm: f64| Glass::Air.index_at(nm).unwrap_or(1.0);
        let n = 1.5 / air(550.0);
        for (c1, c2, t_mm) in [(0.02, -0.02, 2.0), (0.03, -0.02, 2.0), (0.03, 0.0, 4.0), (0.05, 0.01, 0.5)] {
            let changes = [
                SurfaceChange { surface: 0, curvature_per_mm: Some(c1), thickness_mm: Some(t_mm) },
                SurfaceChange { surface: 1, curvature_per_mm: Some(c2), thickness_mm: None },
            ];
            let lens = biconvex().with_surface_changes(&changes).unwrap();
            // The lens maker's equation of a thick lens.
            let expected = (n - 1.0) * (c1 - c2 + (n - 1.0) * t_mm * c1 * c2 / n);
            assert!((power_per_mm(&lens) / expected - 1.0).abs() < 1e-9, "{c1} {c2} {t_mm}");
            assert_eq!(lens.name(), "biconvex, changed");
        }
        assert_eq!(biconvex().with_surface_changes(&[]).unwrap(), biconvex());
    }

    #[test]
    fn what_cannot_be_changed_is_refused() {
        let message = |lens: &Lens, change| lens.with_surface_changes(&[change]).unwrap_err().to_string();
        let of = |surface| SurfaceChange { surface, ..SurfaceChange::default() };
        assert!(message(&biconvex(), of(2)).contains("surface 2, expected 0 to 1"));
        // A rim of 5 mm is no part of a sphere of 4 mm.
        let steep = SurfaceChange { curvature_per_mm: Some(0.25), ..of(1) };
        assert!(message(&biconvex(), steep).contains("surface 1: a rim of 5 mm"));
        let endless = SurfaceChange { thickness_mm: Some(f64::INFINITY), ..of(0) };
        assert!(message(&biconvex(), endless).contains("thickness_mm is inf"));
        let bent = SurfaceChange { curvature_per_mm: Some(0.1), ..of(0) };
        assert!(message(&Lens::thin(50.0, 10.0).unwrap(), bent).contains("an ideal lens has no curvature"));
    }
}
