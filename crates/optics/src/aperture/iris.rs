//! Irises of blades: the shape of a stop that is closed.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// The blades that close a stop.
///
/// Fully open, the stop is round: its rim. Closed further, blades come in from all sides alike, and the opening is what all of
/// them and the rim leave clear. Its area is that of the circle which the f-number or the diameter of the stop states, so that
/// exposures are those of the f-number; corners reach beyond that circle, sides stay within it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Iris {
    /// How many blades there are, 3 to 64.
    pub blades: u32,
    /// By how much the opening is turned from one with a corner at its top, degrees, from x (to the right) towards y (up).
    #[serde(default)]
    pub rotation_deg: f64,
    /// The radius of the fully open stop over that of the blades' edges, 0 to 1: 0 for straight edges, 1 for edges that lie along the
    /// rim where the stop is fully open.
    #[serde(default)]
    pub curvature: f64,
}

/// One side of an opening that is the common part of discs and half-planes: what lies within a circle, or before a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Side {
    /// The unit direction from the axis to the nearest place of the side.
    towards: DVec2,
    /// How far that place is, mm.
    distance_mm: f64,
    /// One over the radius, 1/mm: above 0 about a center on the axis's side, 0 for a straight line.
    curvature_per_mm: f64,
}

/// The opening of an iris, closed to some circle.
///
/// It is convex: the common part of the discs (or half-planes) of the blades and of the disc of the rim.
#[derive(Clone, Debug, PartialEq)]
pub struct IrisOpening {
    // Invariant: the last side is the rim.
    sides: Vec<Side>,
    inscribed_radius_mm: f64,
    extent_mm: f64,
    /// Directions of corners, ascending.
    corners_rad: Vec<f64>,
}

/// The numbers of blades that an iris may have.
const BLADES: std::ops::RangeInclusive<u32> = 3..=64;
/// By how much of the fully open radius the stop must be closed for blades to show.
const OPEN: f64 = 1e-9;
/// Halvings of the distance of the blades: to rounding.
const HALVINGS: usize = 100;

impl Iris {
    /// Checks that the numbers make sense.
    ///
    /// # Errors
    /// Names the number that does not, and what was expected.
    pub fn check(&self) -> Result<(), OpticsError> {
        let wrong = |key, found, expected| Err(OpticsError::Iris { key, found, expected });
        if !BLADES.contains(&self.blades) {
            return wrong("blades", f64::from(self.blades), "3 to 64 blades");
        }
        if !(-360.0..=360.0).contains(&self.rotation_deg) {
            return wrong("rotation_deg", self.rotation_deg, "-360 to 360 degrees");
        }
        if !(0.0..=1.0).contains(&self.curvature) {
            return wrong("curvature", self.curvature, "0 (straight) to 1 (the rim's)");
        }
        Ok(())
    }

    /// Returns the opening that has the area of a circle of `radius_mm` in a stop that is `full_mm` in radius when it is fully open;
    /// `None` where it is: then it is the rim.
    pub(crate) fn opening(&self, radius_mm: f64, full_mm: f64) -> Option<IrisOpening> {
        if radius_mm >= full_mm * (1.0 - OPEN) {
            return None;
        }
        // In units of the full radius.
        let (area, n) = (PI * (radius_mm / full_mm).powi(2), f64::from(self.blades));
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if self.area(middle) < area { &mut low } else { &mut high }) = middle;
        }
        let distance = 0.5 * (low + high);
        let half = PI / n;
        let corner = FRAC_PI_2 + self.rotation_deg.to_radians();
        let side = |i: u32| Side {
            towards: DVec2::from_angle(corner + half * f64::from(2 * i + 1)),
            distance_mm: distance * full_mm,
            curvature_per_mm: self.curvature / full_mm,
        };
        let rim = Side { towards: DVec2::X, distance_mm: full_mm, curvature_per_mm: 1.0 / full_mm };
        // Where neighboring blades meet, or where each ends at the rim.
        let end = self.end(distance);
        let turns = (0..self.blades).map(|i| corner + half * f64::from(2 * i + 1));
        let mut corners_rad: Vec<f64> = match end < half {
            true => turns.flat_map(|middle| [middle - end, middle + end]).map(|a| a.rem_euclid(TAU)).collect(),
            false => turns.map(|middle| (middle + half).rem_euclid(TAU)).collect(),
        };
        corners_rad.sort_by(f64::total_cmp);
        Some(IrisOpening {
            sides: (0..self.blades).map(side).chain([rim]).collect(),
            inscribed_radius_mm: distance * full_mm,
            extent_mm: full_mm * self.edge(distance, end),
            corners_rad,
        })
    }

    /// How far from the axis a blade's edge is, at an angle from its middle; all lengths over the full radius.
    fn edge(&self, distance: f64, angle_rad: f64) -> f64 {
        let k = self.curvature;
        let off = (1.0 - k * distance) * angle_rad.cos();
        let square = 2.0 * distance - k * distance * distance;
        square / (off + (off * off + k * square).sqrt())
    }

    /// Returns the angle from the middle of a blade at which it ends: at the next one, or at the rim before.
    fn end(&self, distance: f64) -> f64 {
        let (half, k) = (PI / f64::from(self.blades), self.curvature);
        if self.edge(distance, half) <= 1.0 {
            return half;
        }
        // Where a blade's edge is as far as the rim.
        let cosine = (2.0 * distance - k * distance * distance - k) / (2.0 * (1.0 - k * distance));
        cosine.clamp(-1.0, 1.0).acos().min(half)
    }

    /// The area of the opening with the blades this far from the axis, over the square of the full radius.
    fn area(&self, distance: f64) -> f64 {
        let (n, half, end) = (f64::from(self.blades), PI / f64::from(self.blades), self.end(distance));
        // A triangle, the segment between its side and the blade's edge, and a sector of the rim.
        let corner = self.edge(distance, end);
        let sine = (self.curvature * corner * end.sin()).min(1.0);
        let segment = match sine > 1e-3 {
            true => (sine.asin() - sine * (1.0 - sine * sine).sqrt()) / (self.curvature * self.curvature),
            // The same by its series, in the curvature's first powers.
            false => (corner * end.sin()).powi(2) * sine * (2.0 / 3.0 + 0.2 * sine * sine),
        };
        n * (0.5 * corner * corner * (2.0 * end).sin() + segment + (half - end))
    }
}

impl Side {
    /// Place in the side's own frame: beyond it, and along it.
    fn own(&self, at_mm: DVec2) -> DVec2 {
        DVec2::new(self.towards.dot(at_mm) - self.distance_mm, self.towards.perp_dot(at_mm))
    }

    /// How far within the side a place is, mm; negative beyond. The distance, for a place within.
    pub(super) fn clearance_mm(&self, at_mm: DVec2) -> f64 {
        let (own, k) = (self.own(at_mm), self.curvature_per_mm);
        -(2.0 * own.x + k * own.length_squared()) / (1.0 + DVec2::new(1.0 + k * own.x, k * own.y).length())
    }

    /// The unit direction in which the side is nearest.
    pub(super) fn direction(&self, at_mm: DVec2) -> DVec2 {
        let (own, k) = (self.own(at_mm), self.curvature_per_mm);
        self.towards.rotate(DVec2::new(1.0 + k * own.x, k * own.y)).normalize_or(self.towards)
    }

    /// How far a place within is from the side along a unit direction, mm; infinite where it never comes there.
    pub(super) fn exit_mm(&self, at_mm: DVec2, direction: DVec2) -> f64 {
        let (own, k) = (self.own(at_mm), self.curvature_per_mm);
        let along = DVec2::new(self.towards.dot(direction), self.towards.perp_dot(direction));
        let slope = along.x + k * own.dot(along);
        let room = -(2.0 * own.x + k * own.length_squared());
        let root = (slope * slope + k * room).max(0.0).sqrt();
        match slope < 0.0 {
            true if k == 0.0 => f64::INFINITY,
            true => (root - slope) / k,
            false => room / (slope + root),
        }
    }
}

impl IrisOpening {
    /// The radius of the largest circle within the opening, mm.
    pub fn inscribed_radius_mm(&self) -> f64 {
        self.inscribed_radius_mm
    }

    /// How far its corners are from the axis, mm.
    pub fn extent_mm(&self) -> f64 {
        self.extent_mm
    }

    /// Returns places of its edge, mm, counterclockwise: its corners, and so many from each to the next.
    pub fn outline_mm(&self, n_between: usize) -> Vec<DVec2> {
        let next = self.corners_rad.iter().skip(1).copied().chain([self.corners_rad[0] + TAU]);
        let arcs = self.corners_rad.iter().copied().zip(next);
        let angles = arcs.flat_map(|(from, to)| {
            (0..=n_between).map(move |i| from + (to - from) * i as f64 / (n_between + 1) as f64)
        });
        angles.map(|angle_rad| self.edge_mm(angle_rad)).collect()
    }

    /// Returns the place of its edge in a direction from the axis, mm, at an angle from x.
    pub(super) fn edge_mm(&self, angle_rad: f64) -> DVec2 {
        let direction = DVec2::from_angle(angle_rad);
        direction * self.sides.iter().map(|side| side.exit_mm(DVec2::ZERO, direction)).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn sides(&self) -> &[Side] {
        &self.sides
    }

    /// Whether a place is within it.
    pub(super) fn is_inside(&self, at_mm: DVec2) -> bool {
        at_mm.length_squared() <= self.inscribed_radius_mm * self.inscribed_radius_mm
            || self.sides.iter().all(|side| side.clearance_mm(at_mm) >= 0.0)
    }

    /// How far within the opening a place is, mm, and the number of the side that it is nearest to.
    pub(super) fn clearance_of_side_mm(&self, at_mm: DVec2) -> (f64, usize) {
        let clearances = self.sides.iter().map(|side| side.clearance_mm(at_mm));
        clearances.zip(0..).fold((f64::INFINITY, 0), |least, here| if here.0 < least.0 { here } else { least })
    }

    /// Whether it is its own mirror image when x changes its sign (axis 0), or y.
    pub(super) fn is_mirrored_along(&self, axis: usize) -> bool {
        let mirrored = |angle: f64| if axis == 0 { PI - angle } else { -angle };
        let has = |angle: f64| {
            let off = |corner: &f64| {
                let apart = (corner - angle).rem_euclid(TAU);
                apart.min(TAU - apart)
            };
            self.corners_rad.iter().any(|corner| off(corner) < 1e-9)
        };
        self.corners_rad.iter().all(|&angle| has(mirrored(angle)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn iris(blades: u32, curvature: f64) -> Iris {
        Iris { blades, rotation_deg: 15.0, curvature }
    }

    /// The area within the edge, by Gauss and Green's polygon of many places.
    fn area_mm2(opening: &IrisOpening) -> f64 {
        let edge = opening.outline_mm(2000);
        let pairs = edge.iter().zip(edge.iter().cycle().skip(1));
        0.5 * pairs.map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
    }

    #[test]
    fn the_opening_has_the_area_of_the_circle_at_every_stop() {
        for (blades, curvature) in [(3, 0.0), (5, 0.5), (6, 0.0), (6, 1.0), (7, 0.3), (18, 1.0), (64, 0.0)] {
            for radius_mm in [0.01, 1.0, 4.0, 7.0, 7.9, 7.999] {
                let opening = iris(blades, curvature).opening(radius_mm, 8.0).unwrap();
                let circle_mm2 = PI * radius_mm * radius_mm;
                // Straight lines between 2000 places a side.
                let off = area_mm2(&opening) / circle_mm2 - 1.0;
                assert!(off.abs() < 1e-6, "{blades} {curvature} {radius_mm}: {off}");
                assert!(opening.inscribed_radius_mm() <= radius_mm && opening.extent_mm() >= radius_mm);
                assert!(opening.extent_mm() <= 8.0 * (1.0 + 1e-12));
            }
        }
    }

    #[test]
    fn straight_blades_make_a_regular_polygon() {
        for blades in [3, 5, 6, 9] {
            let opening = iris(blades, 0.0).opening(2.0, 8.0).unwrap();
            let half = PI / f64::from(blades);
            // Of a regular polygon of n sides about a circle of radius a: n a² tan(π/n).
            let inscribed_mm = 2.0 * (half / half.tan()).sqrt();
            assert!((opening.inscribed_radius_mm() / inscribed_mm - 1.0).abs() < 1e-12);
            assert!((opening.extent_mm() * half.cos() / inscribed_mm - 1.0).abs() < 1e-12);
            assert_eq!(opening.outline_mm(0).len(), blades as usize);
            // A corner at the top, turned.
            let top = DVec2::from_angle(105f64.to_radians()) * opening.extent_mm();
            assert!(opening.outline_mm(0).iter().any(|corner| corner.distance(top) < 1e-12));
        }
    }

    #[test]
    fn wide_open_it_is_the_rim_and_many_blades_are_a_circle() {
        for curvature in [0.0, 0.4, 1.0] {
            assert_eq!(iris(6, curvature).opening(8.0, 8.0), None);
            // Hardly closed, blades cut little off the rim.
            let opening = iris(6, curvature).opening(7.9999, 8.0).unwrap();
            // Straight ones off the rim, so that there corners lie; others all of it.
            let off = if curvature == 1.0 { 1e-3 } else { 1e-12 };
            assert!((opening.extent_mm() / 8.0 - 1.0).abs() < off && opening.inscribed_radius_mm() > 7.95);
        }
        let opening = iris(64, 0.0).opening(2.0, 8.0).unwrap();
        // A polygon's corners and sides are π²/(3n²), π²/(6n²) off the circle of its area.
        let off = (PI / 64.0).powi(2);
        assert!((opening.extent_mm() / 2.0 - 1.0 - off / 3.0).abs() < off * off);
        assert!((1.0 - opening.inscribed_radius_mm() / 2.0 - off / 6.0).abs() < off * off);
    }

    #[test]
    fn distances_are_those_to_the_sides() {
        for (curvature, radius_mm) in [(0.0, 2.0), (0.6, 3.0), (1.0, 7.5), (0.0, 7.9)] {
            let opening = iris(5, curvature).opening(radius_mm, 8.0).unwrap();
            let edge = opening.outline_mm(400);
            for i in 0..200 {
                let at =
                    DVec2::from_angle(2.4 * f64::from(i)) * (0.07 * f64::from(i)).sqrt() * 0.6 * radius_mm.min(4.0);
                let (clearance_mm, side) = opening.clearance_of_side_mm(at);
                let is_inside = clearance_mm >= 0.0;
                assert_eq!(is_inside, opening.is_inside(at), "{at}");
                if !is_inside {
                    continue;
                }
                let nearest_mm = edge.iter().map(|place| place.distance(at)).fold(f64::INFINITY, f64::min);
                assert!((nearest_mm - clearance_mm).abs() < 0.02, "{at}: {nearest_mm} {clearance_mm}");
                let beyond = at + opening.sides()[side].direction(at) * clearance_mm;
                assert!(opening.clearance_of_side_mm(beyond).0.abs() < 1e-12);
                // Along any direction the first side is the edge.
                let direction = DVec2::from_angle(0.3 + 1.7 * f64::from(i));
                let exits = opening.sides().iter().map(|side| side.exit_mm(at, direction));
                let exit_mm = exits.fold(f64::INFINITY, f64::min);
                assert!(opening.clearance_of_side_mm(at + direction * exit_mm).0.abs() < 1e-11);
            }
        }
    }

    #[test]
    fn an_upright_iris_is_its_mirror_image() {
        let of = |blades, rotation_deg| {
            let opening = Iris { blades, rotation_deg, curvature: 0.2 }.opening(2.0, 8.0).unwrap();
            [0, 1].map(|axis| opening.is_mirrored_along(axis))
        };
        assert_eq!([of(6, 0.0), of(6, 30.0), of(6, 15.0)], [[true; 2], [true; 2], [false; 2]]);
        assert_eq!([of(5, 0.0), of(5, 18.0), of(6, 10.0)], [[true, false], [false, true], [false; 2]]);
    }

    #[test]
    fn numbers_that_make_no_sense_are_refused() {
        let message = |iris: Iris| iris.check().unwrap_err().to_string();
        let six = Iris { blades: 6, rotation_deg: 0.0, curvature: 0.0 };
        assert_eq!(message(Iris { blades: 2, ..six }), "the iris: blades is 2, expected 3 to 64 blades");
        assert!(message(Iris { curvature: 1.1, ..six }).contains("curvature is 1.1, expected 0 (straight) to 1"));
        assert!(message(Iris { rotation_deg: f64::NAN, ..six }).contains("rotation_deg is NaN"));
    }
}
