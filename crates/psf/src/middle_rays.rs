//! Where the rays through the middles of pupils land beside the centroids of the light.

/// About how far the ray through the middle of a point's pupil lands from the centroid of its light, over the field of a lens with an axis, for one
/// depth and wavelength.
///
/// The core of a comet stays at its middle ray while its tail grows with the field; about its centroid the core would move. So spreads about their middle
/// rays change less from field to field than about their centroids. It is coma of third and fifth order, θ (q₀ + q₁ θ²) over tan θ / θ, that comes nearest to the
/// traced rays: where rims begin to cut the pupil its middle moves at once, and what kernels are about has to be smooth. Any smooth function of the field
/// would do: what a kernel is about, and where it is put, both follow from this one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MiddleRays {
    /// Coefficients over the tangent of the field, mm, of 1 and of the square of its angle.
    over_tan_mm: [f64; 2],
    last_tan: f64,
}

impl MiddleRays {
    /// Takes the tangents of fields, ascending from 0, and how far outwards from the centroid their middle rays land, mm.
    pub(crate) fn new(field_tans: &[f64], outwards_mm: &[f64]) -> Self {
        // Least squares of both coefficients, or of the first alone where there is but one field off the axis.
        let (mut aa, mut ab, mut bb, mut ac, mut bc) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (tan, mm) in field_tans.iter().zip(outwards_mm) {
            let (a, b) = (*tan, tan * tan.atan().powi(2));
            (aa, ab, bb) = (aa + a * a, ab + a * b, bb + b * b);
            (ac, bc) = (ac + a * mm, bc + b * mm);
        }
        let determinant = aa * bb - ab * ab;
        let over_tan_mm = match field_tans.len() {
            1 => [0.0; 2],
            2 => [ac / aa, 0.0],
            _ => [(bb * ac - ab * bc) / determinant, (aa * bc - ab * ac) / determinant],
        };
        Self { over_tan_mm, last_tan: field_tans[field_tans.len() - 1] }
    }

    /// Returns how far outwards the middle ray of a field lands, over the tangent of the field, mm.
    pub(crate) fn over_tan_mm(&self, field_tan: f64) -> f64 {
        let angle = field_tan.min(self.last_tan).atan();
        self.over_tan_mm[0] + self.over_tan_mm[1] * angle * angle
    }

    /// Returns how far outwards the middle ray of a field lands, mm; beyond the last field, as there.
    pub(crate) fn outwards_mm(&self, field_tan: f64) -> f64 {
        let field_tan = field_tan.min(self.last_tan);
        field_tan * self.over_tan_mm(field_tan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(tans: &[f64], mm: impl Fn(f64) -> f64) -> MiddleRays {
        MiddleRays::new(tans, &tans.iter().map(|tan| mm(*tan)).collect::<Vec<_>>())
    }

    /// Coma of third order grows with the field, that of fifth with its cube.
    #[test]
    fn coma_is_met_at_every_field() {
        let coma_mm = |tan: f64| tan * (0.08 - 0.4 * tan.atan().powi(2));
        let tans: Vec<f64> = (0..9).map(|i| (0.05 * f64::from(i)).tan()).collect();
        let rays = of(&tans, coma_mm);
        for tan in [0.0, 1e-9, 0.01, 0.07, 0.2, 0.33, 0.42] {
            assert!((rays.outwards_mm(tan) - coma_mm(tan)).abs() < 1e-12, "{tan}: {}", rays.outwards_mm(tan));
        }
        assert_eq!(rays.outwards_mm(1.0), rays.outwards_mm(tans[8]));
        assert_eq!(of(&[0.0], |_| 0.0).outwards_mm(0.0), 0.0);
        assert!((of(&[0.0, 0.2], |tan| 0.1 * tan).outwards_mm(0.1) - 0.01).abs() < 1e-15);
    }

    /// Middle rays that jump where a rim begins to cut the pupil leave it smooth: a cubic in the field, without bends of its own.
    #[test]
    fn jumps_at_rims_are_smoothed() {
        let tans: Vec<f64> = (0..15).map(|i| 0.03 * f64::from(i)).collect();
        let rays = of(&tans, |tan| if tan > 0.3 { -0.012 } else { 0.0 });
        let values: Vec<f64> = (0..400).map(|i| rays.outwards_mm(0.001 * f64::from(i))).collect();
        let bends: Vec<f64> = values.windows(3).map(|v| v[2] - 2.0 * v[1] + v[0]).collect();
        assert!(bends.windows(2).all(|pair| pair[0] >= pair[1] - 1e-12), "the third derivative has one sign");
    }
}
