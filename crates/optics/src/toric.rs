//! Surfaces that are curved differently along x and y: biconics and toroids.

/// A surface with two curvatures, with its vertex at the origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Toric {
    /// `z = (c_x x² + c_y y²) / (1 + √(1 − (1 + k_x) c_x² x² − (1 + k_y) c_y² y²))`.
    Biconic {
        /// Curvatures along x and y.
        c: [f64; 2],
        /// Conic constants along x and y.
        k: [f64; 2],
    },
    /// The curve `z = f(y)`, a conic with added even powers of y, turned about the axis parallel to y through the
    /// center of curvature along x.
    Toroid {
        /// Curvatures along x and y.
        c: [f64; 2],
        /// The conic constant of the curve.
        conic: f64,
        /// From y² on.
        coefficients: Vec<f64>,
    },
}

/// The sag at a place, and its slopes along x and y; not finite beyond the surface's domain.
#[derive(Clone, Copy)]
pub(crate) struct Sag {
    pub(crate) z: f64,
    pub(crate) slope_x: f64,
    pub(crate) slope_y: f64,
}

impl Toric {
    /// Returns the sag and its slopes at a place.
    pub(crate) fn at(&self, x: f64, y: f64) -> Sag {
        match self {
            Self::Biconic { c: [cx, cy], k: [kx, ky] } => {
                let (ex, ey) = ((1.0 + kx) * cx * cx * x, (1.0 + ky) * cy * cy * y);
                let root = (1.0 - ex * x - ey * y).sqrt();
                let inverse = 1.0 / (1.0 + root);
                let z = (cx * x * x + cy * y * y) * inverse;
                let slope = |linear: f64, e: f64| (2.0 * linear + z * e / root) * inverse;
                Sag { z, slope_x: slope(cx * x, ex), slope_y: slope(cy * y, ey) }
            }
            Self::Toroid { c: [cx, cy], conic, coefficients } => {
                let (f, slope) = curve(*cy, *conic, coefficients, y);
                // Distance from the axis of rotation over the radius of rotation.
                let h = 1.0 - cx * f;
                let s = (h * h - cx * cx * x * x).sqrt();
                let z = f + cx * x * x / (h + s);
                // Beyond the axis of rotation lies the other side of the ring.
                let is_near = h > 0.0;
                Sag { z: if is_near { z } else { f64::NAN }, slope_x: cx * x / s, slope_y: h * slope / s }
            }
        }
    }

    /// Curvature at the vertex along x, and along y with the square term of the curve, 1/mm.
    pub(crate) fn vertex_curvatures(&self) -> [f64; 2] {
        match self {
            Self::Biconic { c, .. } => *c,
            Self::Toroid { c: [cx, cy], coefficients, .. } => {
                [*cx, cy + 2.0 * coefficients.first().copied().unwrap_or(0.0)]
            }
        }
    }
}

/// Returns the height of a conic with added even powers of y, and its slope.
fn curve(c: f64, conic: f64, coefficients: &[f64], y: f64) -> (f64, f64) {
    let y2 = y * y;
    let root = (1.0 - (1.0 + conic) * c * c * y2).sqrt();
    let (mut bump, mut slope) = (0.0, 0.0);
    for (i, a) in coefficients.iter().enumerate().rev() {
        bump = bump * y2 + a;
        slope = slope * y2 + (2 * i + 2) as f64 * a;
    }
    (c * y2 / (1.0 + root) + bump * y2, (c / root + slope) * y)
}
