//! The edge of a stop of any shape, as uncertainty bending asks for it.

use dioptric_optics::{MonoLens, StopEdges, StopPoint};
use glam::DVec2;

use crate::{AngularSpread, CircularStop, Covariance, Hurb};

/// The edge of a stop: round, or that of blades, of openings and of what stands before it.
///
/// A ray is spread by the edge that is nearest to it, and across that direction by the nearer of the two edges there: in a circle these
/// are the distances along the radius and half the chord across it.
#[derive(Clone, Debug, PartialEq)]
pub struct StopEdge {
    /// The circle of as much area, and the wave number.
    circle: CircularStop,
    /// Where the stop is not just round.
    edges: Option<StopEdges>,
}

impl From<CircularStop> for StopEdge {
    fn from(circle: CircularStop) -> Self {
        Self { circle, edges: None }
    }
}

impl StopEdge {
    /// Returns the edge of a lens's stop.
    pub fn of(lens: &MonoLens) -> Self {
        let circle = CircularStop::new(lens.stop_semi_aperture_mm(), lens.wavelength_nm(), lens.stop_medium_index());
        Self { circle, edges: lens.stop_edges() }
    }

    /// The circle of as much area, and the wave number.
    pub fn circle(&self) -> CircularStop {
        self.circle
    }

    /// Whether it is a circle and nothing else.
    pub fn is_round(&self) -> bool {
        self.edges.is_none()
    }
}

impl Hurb {
    /// Returns the unit direction to the nearest edge of a stop from a place in it, and the spread along that and across it.
    pub fn spread_at(self, at: StopPoint, edge: &StopEdge) -> (DVec2, AngularSpread) {
        let Some(edges) = &edge.edges else {
            let r_mm = at.mm.length();
            let axis = if r_mm > 0.0 { at.mm / r_mm } else { DVec2::X };
            return (axis, self.spread(r_mm, edge.circle));
        };
        let nearest = edges.nearest(at.mm);
        let least_mm = 1e-12 * edge.circle.radius_mm;
        let sigma = |distance_mm: f64| self.sigma(distance_mm.max(least_mm), edge.circle);
        let spread = AngularSpread { radial: sigma(nearest.distance_mm), across: sigma(nearest.across_mm) };
        (nearest.direction, spread)
    }

    /// Returns the covariance of the direction cosines, along the stop's own axes, of a ray that crosses a stop of any shape at a place.
    pub fn covariance_at(self, at: StopPoint, edge: &StopEdge) -> Covariance {
        let (axis, AngularSpread { radial, across }) = self.spread_at(at, edge);
        Covariance::along(axis * radial).plus(Covariance::along(axis.perp() * across))
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{Aperture, Iris, Lens, Outline};

    use super::*;

    fn stop(lens: &Lens) -> StopEdge {
        StopEdge::of(&lens.at(550.0).unwrap())
    }

    #[test]
    fn a_circle_stated_as_an_opening_bends_as_the_rim_does() {
        let lens = Lens::thin(50.0, 10.0).unwrap();
        assert!(stop(&lens).is_round());
        // A polygon of many sides is no rim, and has its distances.
        let corner = |i: u32| (5.0 * DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / 900.0)).to_array();
        let outline = Outline::Polygon { corners_mm: (0..900).map(corner).collect() };
        let aperture = Aperture { surface: 0, outline, center_mm: [0.0; 2], is_obscuration: false };
        let wide = Lens::thin(50.0, 10.0).unwrap().interfaces().to_vec();
        let polygon = stop(&Lens::new_with_apertures("polygon", "test", wide, 0, vec![aperture]).unwrap());
        for at in [DVec2::new(0.3, 0.1), DVec2::new(-2.0, 3.0), DVec2::new(0.0, -4.5)] {
            let point = StopPoint { mm: at };
            let (round, found) =
                (Hurb::PAPER.covariance_at(point, &stop(&lens)), Hurb::PAPER.covariance_at(point, &polygon));
            for (a, b) in [(round.xx, found.xx), (round.yy, found.yy)] {
                // The nearest side faces up to 0.2 degrees aside. The nearer end of a chord across that is 0.7 % nearer at the last point, and the
                // variance goes as the distance squared.
                assert!((a / b - 1.0).abs() < 0.02, "{at}: {a} {b}");
            }
        }
    }

    #[test]
    fn straight_blades_spread_across_themselves() {
        let iris = Iris { blades: 6, rotation_deg: 0.0, curvature: 0.0 };
        let lens = Lens::thin(50.0, 25.0).unwrap().with_iris(Some(iris)).unwrap();
        let lens = lens.with_stop_diameter_mm(10.0).unwrap();
        let side_mm = lens.iris_opening().unwrap().inscribed_radius_mm();
        let edge = stop(&lens);
        // A corner is at the top: sides face right and left.
        let (axis, spread) = Hurb::PAPER.spread_at(StopPoint { mm: DVec2::new(side_mm - 0.01, 0.3) }, &edge);
        assert!((axis - DVec2::X).length() < 1e-9);
        let expected = Hurb::PAPER.sigma(0.01, edge.circle());
        assert!((spread.radial / expected - 1.0).abs() < 1e-9);
        // Along the side the nearer corner is half a side less 0.3 mm away.
        let across_mm = side_mm * 30f64.to_radians().tan() - 0.3;
        assert!((spread.across / Hurb::PAPER.sigma(across_mm, edge.circle()) - 1.0).abs() < 0.03);
    }
}
