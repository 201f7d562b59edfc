//! Openings and obscurations of surfaces that are no circles about the axis.

mod iris;
mod outline;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::OpticsError;

pub use self::{
    iris::{Iris, IrisOpening},
    outline::Outline,
};

/// An opening of a surface beside its round rim, or something that stands before it.
///
/// It is stated in the surface's own frame, by where rays meet the surface: by x and y alone. A ray passes a surface
/// inside its rim where every aperture of the surface lets it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aperture {
    /// The surface, counted from 0.
    pub surface: usize,
    /// Its shape.
    pub outline: Outline,
    /// The place of its middle, mm.
    #[serde(default)]
    pub center_mm: [f64; 2],
    /// Whether it stops the light inside, not that outside.
    #[serde(default)]
    pub is_obscuration: bool,
}

impl Aperture {
    /// Whether it is a circle about the surface's axis.
    pub fn is_rotational(&self) -> bool {
        self.center_mm == [0.0; 2] && self.outline.radius_mm().is_some()
    }

    /// The radius of an opening that is a circle about the surface's axis, mm: what bounds light as a rim does.
    pub(crate) fn rim_mm(&self) -> Option<f64> {
        self.outline.radius_mm().filter(|_| !self.is_obscuration && self.center_mm == [0.0; 2])
    }

    /// The opening of an iris, in a stop on this surface.
    pub(crate) fn of_iris(surface: usize, opening: IrisOpening) -> Self {
        Self { surface, outline: Outline::Iris(opening), center_mm: [0.0; 2], is_obscuration: false }
    }

    /// Whether it is the opening of an iris.
    pub(crate) fn is_iris(&self) -> bool {
        matches!(self.outline, Outline::Iris(_))
    }

    pub(crate) fn off_center_mm(&self, x_mm: f64, y_mm: f64) -> DVec2 {
        DVec2::new(x_mm, y_mm) - DVec2::from_array(self.center_mm)
    }

    /// Whether a ray passes that meets the surface here.
    pub fn is_clear_at(&self, x_mm: f64, y_mm: f64) -> bool {
        self.outline.is_inside(self.off_center_mm(x_mm, y_mm)) != self.is_obscuration
    }

    /// How far inside the opening a place is, mm: 0 at the edge, negative outside. Of an ellipse it is only of the right
    /// sign, and of the right size along its axes; an obscuration is as though it were not there.
    pub(crate) fn clearance_mm(&self, x_mm: f64, y_mm: f64) -> f64 {
        self.clearance_of_side_mm(x_mm, y_mm).0
    }

    /// The same, and which part of the edge it counts from: of a rectangle, a polygon or an iris one of their sides; 0 of others.
    pub(crate) fn clearance_of_side_mm(&self, x_mm: f64, y_mm: f64) -> (f64, usize) {
        if self.is_obscuration {
            return (f64::INFINITY, 0);
        }
        let nearest = self.outline.nearest_edge(self.off_center_mm(x_mm, y_mm));
        (nearest.clearance_mm, nearest.part)
    }

    /// The radius of the circle about the axis that holds the opening, mm.
    pub(crate) fn extent_mm(&self) -> f64 {
        let center = DVec2::from_array(self.center_mm);
        match self.outline {
            Outline::Rectangle { .. } => (center.abs() + self.outline.bounds_mm()[1]).length(),
            _ => center.length() + self.outline.reach_mm(),
        }
    }

    /// The box that holds it, mm from the axis: its lower left and upper right corner.
    pub fn bounds_mm(&self) -> [DVec2; 2] {
        self.outline.bounds_mm().map(|corner| corner + DVec2::from_array(self.center_mm))
    }

    /// Returns places on the edge in turn, mm from the axis.
    pub fn edge_mm(&self) -> impl Iterator<Item = DVec2> {
        let center = DVec2::from_array(self.center_mm);
        self.outline.edge_mm().into_iter().map(move |place| center + place)
    }

    /// Whether it is its own mirror image when x changes its sign (axis 0), or y.
    pub(crate) fn is_mirrored_along(&self, axis: usize) -> bool {
        self.center_mm[axis] == 0.0 && self.outline.is_mirrored_along(axis)
    }

    pub(crate) fn check(&self, n_surfaces: usize) -> Result<(), OpticsError> {
        let surface = self.surface;
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if surface >= n_surfaces {
            return wrong("surface of an aperture", surface as f64, "a surface that the lens has, counted from 0");
        }
        if let Some((key, found, expected)) = self.outline.wrong() {
            return wrong(key, found, expected);
        }
        match self.center_mm.into_iter().find(|v| v.is_nan() || v.abs() > 1e9) {
            Some(found) => wrong("middle of an aperture", found, "numbers below 1e9"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(outline: Outline) -> Aperture {
        Aperture { surface: 0, outline, center_mm: [1.0, -2.0], is_obscuration: false }
    }

    /// An arrowhead: not convex, and its area.
    fn arrow() -> (Outline, f64) {
        let corners_mm = vec![[2.0, 0.0], [-1.0, 1.5], [-0.25, 0.0], [-1.0, -1.5]];
        (Outline::Polygon { corners_mm }, 3.375)
    }

    #[test]
    fn clearance_has_the_sign_of_clear() {
        let (half_x_mm, half_y_mm) = (3.0, 1.5);
        let (ellipse, rectangle) =
            (Outline::Ellipse { half_x_mm, half_y_mm }, Outline::Rectangle { half_x_mm, half_y_mm });
        let turned = |outline: &Outline| Outline::Turned { by_deg: 27.0, outline: Box::new(outline.clone()) };
        let pi = std::f64::consts::PI;
        let hexagon = Iris { blades: 6, rotation_deg: 10.0, curvature: 0.5 }.opening(2.0, 4.0).unwrap();
        for (outline, area_mm2) in [
            (Outline::Circle { radius_mm: 2.0 }, 4.0 * pi),
            (turned(&ellipse), pi * half_x_mm * half_y_mm),
            (ellipse, pi * half_x_mm * half_y_mm),
            (turned(&rectangle), 4.0 * half_x_mm * half_y_mm),
            (rectangle, 4.0 * half_x_mm * half_y_mm),
            (turned(&arrow().0), arrow().1),
            (Outline::Iris(hexagon), 4.0 * pi),
        ] {
            let aperture = of(outline.clone());
            let inverted = Aperture { is_obscuration: true, ..aperture.clone() };
            let [low, high] = aperture.bounds_mm();
            let mut n_clear = 0;
            for i in -50..=50 {
                for j in -50..=50 {
                    let (x, y) = (0.0987 * f64::from(i), 0.0987 * f64::from(j));
                    let is_clear = aperture.is_clear_at(x, y);
                    let (clearance_mm, _) = aperture.clearance_of_side_mm(x, y);
                    assert_eq!(is_clear, clearance_mm >= 0.0, "{outline:?} {x} {y}");
                    assert_ne!(is_clear, inverted.is_clear_at(x, y));
                    let at = DVec2::new(x, y);
                    let is_held = at.cmpge(low - 0.02).all() && at.cmple(high + 0.02).all();
                    assert!(!is_clear || (x.hypot(y) <= aperture.extent_mm() && is_held), "{outline:?} {x} {y}");
                    n_clear += usize::from(is_clear);
                    if aperture.is_iris() && !is_clear {
                        continue;
                    }
                    // Along a line the edge is where it ends to be clear, or begins; of an iris from within.
                    let own = at - DVec2::from_array(aperture.center_mm);
                    let direction = DVec2::from_angle(f64::from(7 * i + j));
                    let way_mm = aperture.outline.edge_along_mm(own, direction);
                    if way_mm.is_finite() {
                        // Of a line that grazes the edge rounding decides.
                        let edge = aperture.outline.nearest_edge(own + direction * way_mm);
                        if edge.direction.dot(direction).abs() < 1e-3 {
                            continue;
                        }
                        let beyond = own + direction * (way_mm + 1e-9);
                        assert!(aperture.outline.nearest_edge(beyond).clearance_mm.abs() < 1e-8);
                        assert_eq!(aperture.outline.is_inside(own + direction * (way_mm - 1e-9)), is_clear);
                    } else {
                        assert!(!is_clear);
                    }
                }
            }
            // A grid counts an area to about the cells along its edge over its cells.
            let counted_mm2 = n_clear as f64 * 0.0987 * 0.0987;
            assert!((counted_mm2 / area_mm2 - 1.0).abs() < 0.02, "{outline:?} {counted_mm2}");
            for place in aperture.edge_mm() {
                assert!(aperture.clearance_mm(place.x, place.y).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn polygons_that_make_no_sense_are_refused() {
        let message = |corners_mm: &[[f64; 2]]| {
            of(Outline::Polygon { corners_mm: corners_mm.to_vec() }).check(1).unwrap_err().to_string()
        };
        assert!(message(&[[0.0, 0.0], [1.0, 0.0]]).contains("the number of corners of an aperture is 2, expected 3"));
        let crossed = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(message(&crossed).contains("crosses another, counted from 0, is 0, expected none"));
        assert!(message(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("the area of an aperture is 0"));
        assert!(of(arrow().0).check(1).is_ok());
    }
}
