//! Where the rays through the middles of pupils land beside the centroids of the light.

use crate::geometry::EvenSpline;

/// How far the ray through the middle of a point's pupil lands from the centroid of its light, over the field of a lens with an axis, for one
/// depth and wavelength.
///
/// The core of a comet stays at its middle ray while its tail grows with the field; about its centroid the core would move. So spreads about their middle
/// rays change less from field to field than about their centroids. Any smooth function of the field would do: what a kernel is about, and where it is put, both
/// follow from this one.
#[derive(Clone, Debug)]
pub(crate) struct MiddleRays {
    /// Over the tangent of the field: even in its angle.
    over_tan_mm: EvenSpline,
    last_tan: f64,
}

impl MiddleRays {
    /// Takes the tangents of fields, ascending from 0, and how far outwards from the centroid their middle rays land, mm.
    pub(crate) fn new(field_tans: &[f64], outwards_mm: &[f64]) -> Self {
        let angles: Vec<f64> = field_tans.iter().map(|tan| tan.atan()).collect();
        let mut over_tan_mm: Vec<f64> = field_tans.iter().zip(outwards_mm).map(|(tan, mm)| mm / tan).collect();
        // At the axis the ratio is 0/0: its limit is that of the parabola through the next two.
        over_tan_mm[0] = match over_tan_mm[..] {
            [_] => 0.0,
            [_, only] => only,
            [_, first, second, ..] => {
                let (a, b) = (angles[1] * angles[1], angles[2] * angles[2]);
                first - (second - first) * a / (b - a)
            }
            [] => unreachable!("a bank has at least one field"),
        };
        let last_tan = field_tans[field_tans.len() - 1];
        Self { over_tan_mm: EvenSpline::new(angles, over_tan_mm), last_tan }
    }

    /// Returns how far outwards the middle ray of a field lands, over the tangent of the field, mm.
    pub(crate) fn over_tan_mm(&self, field_tan: f64) -> f64 {
        self.over_tan_mm.value_and_slope(field_tan.min(self.last_tan).atan()).0
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

    /// Coma of third order grows with the field, that of fifth with its cube.
    #[test]
    fn coma_is_met_between_the_fields() {
        let coma_mm = |tan: f64| 0.08 * tan - 0.4 * tan.powi(3);
        let tans: Vec<f64> = (0..9).map(|i| (0.05 * f64::from(i)).tan()).collect();
        let rays = MiddleRays::new(&tans, &tans.iter().map(|tan| coma_mm(*tan)).collect::<Vec<_>>());
        for tan in [1e-9, 0.01, 0.07, 0.2, 0.33, 0.42] {
            // A thousandth of a pixel of 1 µm.
            assert!((rays.outwards_mm(tan) - coma_mm(tan)).abs() < 1e-6, "{tan}: {}", rays.outwards_mm(tan));
        }
        assert_eq!(rays.outwards_mm(1.0), rays.outwards_mm(tans[8]));
        assert_eq!(MiddleRays::new(&[0.0], &[0.0]).outwards_mm(0.0), 0.0);
    }
}
