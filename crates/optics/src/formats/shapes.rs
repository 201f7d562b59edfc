//! Shapes of surfaces as lens files state them.

use crate::Shape;

/// Returns the conic with added even powers of r, the coefficients from r² on, mm.
///
/// # Errors
/// In words, when the shape cannot be traced.
pub(super) fn even_asphere(conic: f64, coefficients_from_r2: &[f64]) -> Result<Shape, String> {
    let [r2, rest @ ..] = coefficients_from_r2 else { return Ok(conic_of(conic)) };
    if *r2 != 0.0 {
        return Err(format!("an aspheric r² term ({r2}) is not supported: only r⁴ and higher are"));
    }
    let n_used = rest.iter().rposition(|&a| a != 0.0).map_or(0, |last| last + 1);
    match &rest[..n_used] {
        [] => Ok(conic_of(conic)),
        used => Ok(Shape::EvenAsphere { conic, coefficients: used.to_vec() }),
    }
}

/// Returns the conic of revolution, which is a sphere where the constant is 0.
pub(super) fn conic_of(conic: f64) -> Shape {
    if conic == 0.0 { Shape::Sphere } else { Shape::Conic { conic } }
}
