//! Numbers of an OSLO file that are taken from another surface, which the program stores no values of.

use super::{super::text_error::TextError, surface::LenSurface};

/// Puts the numbers in their places, from the first surface to the last: a pickup is of a surface before its own.
pub(super) fn resolve(surfaces: &mut [LenSurface]) -> Result<(), TextError> {
    for number in 0..surfaces.len() {
        for pickup in surfaces[number].pickups.clone() {
            let wrong =
                |reason: &str| TextError { line: Some(pickup.line), reason: format!("PK {}: {reason}", pickup.what) };
            if pickup.surface >= number {
                return Err(wrong("expected the number of a surface before its own"));
            }
            let source = surfaces[pickup.surface].clone();
            let surface = &mut surfaces[number];
            let sign = if pickup.what.ends_with('M') { -1.0 } else { 1.0 };
            match pickup.what.as_str() {
                // With the curvature comes the whole shape.
                "CV" | "CVM" => {
                    surface.curvature = sign * source.curvature + pickup.plus;
                    surface.conic = source.conic;
                    surface.coefficients = source.coefficients.iter().map(|a| sign * a).collect();
                    surface.curvature_x = source.curvature_x.map(|curvature| sign * curvature);
                    surface.copy_kind(&source);
                }
                "TH" | "THM" => {
                    (surface.thickness, surface.states_thickness) = (sign * source.thickness + pickup.plus, true);
                }
                "AP" => surface.aperture = source.aperture.map(|radius| radius + pickup.plus),
                "GLA" if !source.is_mirror => (surface.medium, surface.is_mirror) = (source.medium, false),
                _ => {
                    return Err(wrong("this pickup is not supported; expected CV, CVM, TH, THM, AP or GLA of a glass"));
                }
            }
        }
    }
    Ok(())
}
