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

/// Where the light of a field lands.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MiddleRay {
    /// The tangent of the field.
    pub(crate) field_tan: f64,
    /// How far outwards from the centroid of the light the middle ray lands, mm.
    pub(crate) outwards_mm: f64,
    /// How far from the axis the centroid lands, mm.
    pub(crate) radius_mm: f64,
    /// Rms distance of the light from its centroid, mm.
    pub(crate) rms_mm: f64,
}

impl MiddleRay {
    /// Returns how much a field counts: fully where its light is not spread wider than that on the axis by more than a hundredth of the largest image height, and
    /// beyond that by the square of what it is spread wider. What a reference point is off by is seen where an image is sharp, and not where it is blurred.
    fn weight(&self, axis: &Self, last: &Self) -> f64 {
        const PART: f64 = 0.01;
        let unseen_mm2 = (PART * last.radius_mm).powi(2);
        let added_mm2 = self.rms_mm.powi(2) - axis.rms_mm.powi(2);
        if added_mm2 > unseen_mm2 { unseen_mm2 / added_mm2 } else { 1.0 }
    }
}

impl MiddleRays {
    /// Takes fields, their tangents ascending from 0.
    pub(crate) fn new(fields: &[MiddleRay]) -> Self {
        let (first, last) = (fields[0], fields[fields.len() - 1]);
        // Least squares of both coefficients, or of the first alone where there is but one field off the axis.
        let (mut aa, mut ab, mut bb, mut ac, mut bc) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for field in fields {
            let (a, b) = (field.field_tan, field.field_tan * field.field_tan.atan().powi(2));
            let weight = field.weight(&first, &last);
            (aa, ab, bb) = (aa + weight * a * a, ab + weight * a * b, bb + weight * b * b);
            (ac, bc) = (ac + weight * a * field.outwards_mm, bc + weight * b * field.outwards_mm);
        }
        let determinant = aa * bb - ab * ab;
        let over_tan_mm = match fields.len() {
            1 => [0.0; 2],
            2 => [ac / aa, 0.0],
            _ => [(bb * ac - ab * bc) / determinant, (aa * bc - ab * ac) / determinant],
        };
        Self { over_tan_mm, last_tan: last.field_tan }
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

    /// Rays of fields of a lens of 50 mm whose light is spread by so much.
    fn spread(tans: &[f64], mm: impl Fn(f64) -> f64, rms_mm: impl Fn(f64) -> f64) -> MiddleRays {
        let ray = |&field_tan: &f64| {
            let (outwards_mm, rms_mm) = (mm(field_tan), rms_mm(field_tan));
            MiddleRay { field_tan, outwards_mm, radius_mm: 50.0 * field_tan, rms_mm }
        };
        MiddleRays::new(&tans.iter().map(ray).collect::<Vec<_>>())
    }

    fn of(tans: &[f64], mm: impl Fn(f64) -> f64) -> MiddleRays {
        spread(tans, mm, |_| 0.02)
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

    /// Where the outer fields are spread over much of the film, the middle rays of the inner ones are met as if there were no others.
    #[test]
    fn spread_fields_count_little() {
        let tans: Vec<f64> = (0..25).map(|i| (0.04 * f64::from(i)).tan()).collect();
        let mm = |tan: f64| -0.02 * tan - tan.powi(9);
        let inner: Vec<f64> = tans.iter().copied().filter(|tan| *tan < 0.4).collect();
        let alone = of(&inner, mm).over_tan_mm(0.05);
        let [even, blurred] = [of(&tans, mm), spread(&tans, mm, |tan| 0.02 + 20.0 * tan.powi(6))];
        let [even, blurred] = [even, blurred].map(|rays| (rays.over_tan_mm(0.05) - alone).abs());
        assert!(blurred < 0.1 * even && even > 0.1, "off by {blurred} and {even} mm");
    }
}
