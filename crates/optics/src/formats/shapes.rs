//! Shapes of surfaces as lens files state them.

use crate::Shape;

/// Returns the conic with added even powers of r, the coefficients from r² on, mm.
pub(super) fn even_asphere(conic: f64, coefficients_from_r2: &[f64]) -> Shape {
    let [r2, rest @ ..] = coefficients_from_r2 else { return conic_of(conic) };
    if *r2 != 0.0 {
        let coefficients = coefficients_from_r2.iter().flat_map(|&a| [0.0, a]).collect();
        return Shape::OddAsphere { conic, coefficients };
    }
    let n_used = rest.iter().rposition(|&a| a != 0.0).map_or(0, |last| last + 1);
    match &rest[..n_used] {
        [] => conic_of(conic),
        used => Shape::EvenAsphere { conic, coefficients: used.to_vec() },
    }
}

/// Returns the conic of revolution, which is a sphere where the constant is 0.
pub(super) fn conic_of(conic: f64) -> Shape {
    if conic == 0.0 { Shape::Sphere } else { Shape::Conic { conic } }
}

/// Returns coefficients without the zeros at their end.
pub(super) fn up_to_last(mut coefficients: Vec<f64>) -> Vec<f64> {
    let n_used = coefficients.iter().rposition(|&a| a != 0.0).map_or(0, |last| last + 1);
    coefficients.truncate(n_used);
    coefficients
}
