//! Where surfaces stand that are not centered: rigid motions of surfaces, of groups and of the film.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// A tilt and decenter of neighboring surfaces, which move as one rigid body.
///
/// The frame of the moved surfaces is shifted by the decenter and then turned about x, the new y and the new z, each
/// by the right-hand rule; with `tilt_first` it is turned about z, the new y and the new x, and then shifted along its
/// own axes, which undoes the former where all signs are changed. Both are the coordinate breaks of Zemax.
///
/// Of several moves each is stated in the frame that the moves before it in the list have made, as far as they move the
/// same surfaces; so a group may be tilted, and within it a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoordinateBreak {
    /// The first and the last surface that are moved, counted from 0. The film counts as the one after the last: a move
    /// that ends there bends the axis for good.
    pub surfaces: (usize, usize),
    /// z of the point about which they turn, from the vertex of the first of them (of the last surface where only the
    /// film is moved), in mm.
    #[serde(default)]
    pub pivot_mm: f64,
    /// The shift along x, y and z, mm.
    #[serde(default)]
    pub decenter_mm: [f64; 3],
    /// The turns about x, y and z, degrees.
    #[serde(default)]
    pub tilt_deg: [f64; 3],
    /// Whether the turns come before the shift, and in the order z, y, x.
    #[serde(default)]
    pub tilt_first: bool,
}

impl CoordinateBreak {
    /// Checks the move of a lens of this many surfaces; `number` is its place in the list, for the message.
    pub(crate) fn check(&self, number: usize, n_surfaces: usize) -> Result<(), OpticsError> {
        let (first, last) = self.surfaces;
        if first > last || last > n_surfaces {
            return Err(OpticsError::MoveOfSurfaces { number, first, last, n_surfaces });
        }
        let numbers = self.decenter_mm.iter().chain(&self.tilt_deg).chain([&self.pivot_mm]);
        match numbers.copied().find(|v| !v.is_finite() || v.abs() > 1e9) {
            Some(found) => Err(OpticsError::MoveNumber { number, found }),
            None => Ok(()),
        }
    }

    /// Returns the motion of points about a pivot on the axis.
    fn motion(&self, pivot_z_mm: f64) -> Placement {
        let [x, y, z] = self.tilt_deg.map(f64::to_radians);
        let (pivot, shift) = (DVec3::Z * pivot_z_mm, DVec3::from_array(self.decenter_mm));
        let about = (DMat3::from_rotation_x(x), DMat3::from_rotation_y(y), DMat3::from_rotation_z(z));
        let (rotation, shift) = match self.tilt_first {
            false => (about.0 * about.1 * about.2, shift),
            true => {
                let rotation = about.2 * about.1 * about.0;
                (rotation, rotation * shift)
            }
        };
        Placement { vertex_mm: pivot + shift - rotation * pivot, rotation }
    }
}

/// Where a surface stands: the place of its vertex and the directions of its axes, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The vertex, mm.
    pub vertex_mm: DVec3,
    /// Turns directions of the surface's own frame to those of the lens frame. Of a surface that light meets behind an odd
    /// number of mirrors it also reverses z, so that the surface's own z is along the light.
    pub rotation: DMat3,
}

/// How far a motion and its return may miss each other by rounding: in mm, and in the elements of a rotation.
const ROUNDING: (f64, f64) = (1e-12, 1e-14);

impl Placement {
    const IDENTITY: Self = Self { vertex_mm: DVec3::ZERO, rotation: DMat3::IDENTITY };

    /// Returns the placement of a centered surface.
    pub fn centered(vertex_z_mm: f64) -> Self {
        Self { vertex_mm: DVec3::Z * vertex_z_mm, ..Self::IDENTITY }
    }

    /// Returns the point of the lens frame for one of the surface's own frame, mm.
    pub fn lens_from_surface(&self, point_mm: DVec3) -> DVec3 {
        self.rotation * point_mm + self.vertex_mm
    }

    /// Returns the point of the surface's own frame for one of the lens frame, mm.
    pub fn surface_from_lens(&self, point_mm: DVec3) -> DVec3 {
        self.rotation.transpose() * (point_mm - self.vertex_mm)
    }

    /// Returns the direction in the lens frame for one of the surface's own frame.
    pub fn direction_to_lens(&self, direction: DVec3) -> DVec3 {
        self.rotation * direction
    }

    /// Returns the direction in the surface's own frame for one of the lens frame.
    pub fn direction_to_own(&self, direction: DVec3) -> DVec3 {
        self.rotation.transpose() * direction
    }

    /// Returns the motion that first does the other and then this one.
    pub fn after(&self, other: &Self) -> Self {
        Self { vertex_mm: self.lens_from_surface(other.vertex_mm), rotation: self.rotation * other.rotation }
    }

    /// Returns the motion that undoes this one.
    pub fn inverse(&self) -> Self {
        Self { vertex_mm: self.surface_from_lens(DVec3::ZERO), rotation: self.rotation.transpose() }
    }

    /// Whether the frame is its own mirror image when x (axis 0) or y (axis 1) changes its sign.
    pub(crate) fn is_mirrored_along(&self, axis: usize) -> bool {
        let (mm, own) = (self.vertex_mm, self.rotation.col(axis));
        let across = DVec3::AXES[axis] * own[axis];
        mm[axis].abs() <= ROUNDING.0 && (own - across).abs().max_element() <= ROUNDING.1
    }

    /// Returns the frame with its z the other way, x and y as they are: of the other handedness.
    pub(crate) fn flipped(&self) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = self.rotation;
        Self { rotation: DMat3::from_cols(x_axis, y_axis, -z_axis), ..*self }
    }

    /// Whether another surface stands on the same axis and is not turned about it, to rounding.
    pub(crate) fn is_coaxial(&self, other: &Self) -> bool {
        let between = self.inverse().after(other);
        Self { vertex_mm: between.vertex_mm * DVec3::new(1.0, 1.0, 0.0), ..between }.is_rest()
    }

    /// Whether nothing moves, to rounding.
    pub(crate) fn is_rest(&self) -> bool {
        let turned = (self.rotation - DMat3::IDENTITY).to_cols_array();
        self.vertex_mm.abs().max_element() <= ROUNDING.0 && turned.iter().all(|v| v.abs() <= ROUNDING.1)
    }

    /// Returns the turns about x, the new y and the new z that make the rotation, degrees.
    pub fn tilt_deg(&self) -> [f64; 3] {
        let r = &self.rotation;
        let y = r.z_axis.x.clamp(-1.0, 1.0).asin();
        // Looking along the axis of x, a turn about it and one about z are the same.
        let (x, z) = match r.z_axis.x.abs() < 1.0 - 1e-15 {
            true => ((-r.z_axis.y).atan2(r.z_axis.z), (-r.y_axis.x).atan2(r.x_axis.x)),
            false => (r.x_axis.y.atan2(r.y_axis.y), 0.0),
        };
        [x, y, z].map(f64::to_degrees)
    }
}

/// The motions that moves make: of each surface, and of the film; `None` where nothing moves.
pub(crate) fn motions(moves: &[CoordinateBreak], vertices_z_mm: &[f64]) -> Option<Vec<Placement>> {
    let n_surfaces = vertices_z_mm.len();
    let motion = |place: usize| {
        let of = |step: &&CoordinateBreak| (step.surfaces.0..=step.surfaces.1).contains(&place);
        let pivot_z_mm = |step: &CoordinateBreak| vertices_z_mm[step.surfaces.0.min(n_surfaces - 1)] + step.pivot_mm;
        let whole = moves
            .iter()
            .filter(of)
            .fold(Placement::IDENTITY, |whole, step| whole.after(&step.motion(pivot_z_mm(step))));
        if whole.is_rest() { Placement::IDENTITY } else { whole }
    };
    let all: Vec<Placement> = (0..=n_surfaces).map(motion).collect();
    all.iter().any(|motion| *motion != Placement::IDENTITY).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted(surfaces: (usize, usize)) -> CoordinateBreak {
        let (decenter_mm, tilt_deg) = ([0.1, -0.2, 0.3], [10.0, -20.0, 30.0]);
        CoordinateBreak { surfaces, pivot_mm: 1.5, decenter_mm, tilt_deg, tilt_first: false }
    }

    #[test]
    fn rotation_is_that_of_three_turns_by_the_right_hand_rule() {
        // Zemax's rotation matrix: R13 = sin y, R12 = −cos y sin z, R23 = −sin x cos y.
        let placement = tilted((0, 0)).motion(0.0);
        let [x, y, z] = [10.0, -20.0, 30.0_f64].map(f64::to_radians);
        let r = placement.rotation;
        assert!((r.z_axis.x - y.sin()).abs() < 1e-16);
        assert!((r.y_axis.x + y.cos() * z.sin()).abs() < 1e-16);
        assert!((r.z_axis.y + x.sin() * y.cos()).abs() < 1e-16);
        for (found, expected) in placement.tilt_deg().into_iter().zip([10.0, -20.0, 30.0]) {
            assert!((found - expected).abs() < 1e-13);
        }
        let gimbal = CoordinateBreak { tilt_deg: [25.0, 90.0, 15.0], ..tilted((0, 0)) }.motion(0.0);
        let again = CoordinateBreak { tilt_deg: gimbal.tilt_deg(), ..tilted((0, 0)) }.motion(0.0);
        // An angle whose sine is 1 is known to the root of the rounding.
        let apart = (gimbal.rotation - again.rotation).to_cols_array();
        assert!(apart.iter().all(|v| v.abs() < 1e-7), "{apart:?}");
    }

    #[test]
    fn break_and_its_return_leave_the_rest_in_place() {
        let back = CoordinateBreak {
            surfaces: (2, 3),
            // The return happens at the same pivot, 1.5 mm behind the vertex of surface 0.
            pivot_mm: 1.5 - 9.0,
            decenter_mm: [-0.1, 0.2, -0.3],
            tilt_deg: [-10.0, 20.0, -30.0],
            tilt_first: true,
        };
        let motions = motions(&[tilted((0, 3)), back], &[0.0, 4.0, 9.0]).unwrap();
        assert_eq!(motions[0], motions[1]);
        assert_eq!(motions[2..], [Placement::IDENTITY; 2]);
        let there = motions[0].lens_from_surface(DVec3::new(1.0, 2.0, 3.0));
        assert!((motions[0].surface_from_lens(there) - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-14);
        assert!(motions[0].inverse().after(&motions[0]).is_rest());
    }

    #[test]
    fn moves_of_nothing_are_none() {
        let still = CoordinateBreak { decenter_mm: [0.0; 3], tilt_deg: [0.0; 3], ..tilted((0, 3)) };
        assert_eq!(motions(&[still], &[0.0, 4.0, 9.0]), None);
        assert_eq!(motions(&[], &[0.0]), None);
    }

    #[test]
    fn moves_of_surfaces_that_are_not_there_are_refused() {
        assert!(tilted((0, 3)).check(0, 3).is_ok());
        let message = |wrong: CoordinateBreak| wrong.check(1, 3).unwrap_err().to_string();
        assert_eq!(
            message(tilted((0, 4))),
            "move 1 is of surfaces 0 to 4, expected a first and a last of 0 to 3 (the film)"
        );
        assert!(message(tilted((2, 1))).starts_with("move 1 is of surfaces 2 to 1"));
        let wrong = CoordinateBreak { pivot_mm: f64::NAN, ..tilted((0, 0)) };
        assert_eq!(message(wrong), "move 1 has the number NaN, expected finite numbers below 1e9");
    }
}
