//! Openings and obscurations of surfaces that are no circles about the axis.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// An opening of a surface beside its round rim, or something that stands before it.
///
/// It is stated in the surface's own frame, by where rays meet the surface: by x and y alone. A ray passes a surface
/// inside its rim where every aperture of the surface lets it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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

/// The shape of an aperture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Outline {
    /// A circle.
    Circle {
        /// Its radius, mm.
        radius_mm: f64,
    },
    /// An ellipse with its axes along x and y.
    Ellipse {
        /// Half its width along x, mm.
        half_x_mm: f64,
        /// Half its width along y, mm.
        half_y_mm: f64,
    },
    /// A rectangle with its sides along x and y.
    Rectangle {
        /// Half its width along x, mm.
        half_x_mm: f64,
        /// Half its width along y, mm.
        half_y_mm: f64,
    },
}

impl Outline {
    /// Half the widths along x and y, mm.
    pub fn half_widths_mm(&self) -> DVec2 {
        match *self {
            Self::Circle { radius_mm } => DVec2::splat(radius_mm),
            Self::Ellipse { half_x_mm, half_y_mm } | Self::Rectangle { half_x_mm, half_y_mm } => {
                DVec2::new(half_x_mm, half_y_mm)
            }
        }
    }

    /// The radius of a circle, also of one that is stated as an ellipse, mm.
    fn radius_mm(&self) -> Option<f64> {
        match *self {
            Self::Circle { radius_mm } => Some(radius_mm),
            Self::Ellipse { half_x_mm, half_y_mm } if half_x_mm == half_y_mm => Some(half_x_mm),
            Self::Ellipse { .. } | Self::Rectangle { .. } => None,
        }
    }

    /// Returns the point of the edge in this direction from the middle, mm, at an angle from x.
    fn edge_mm(&self, angle_rad: f64) -> DVec2 {
        let (half, direction) = (self.half_widths_mm(), DVec2::from_angle(angle_rad));
        match self {
            Self::Rectangle { .. } => direction * (half / direction.abs()).min_element(),
            _ => half * direction,
        }
    }
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

    /// Whether a ray passes that meets the surface here.
    pub fn is_clear_at(&self, x_mm: f64, y_mm: f64) -> bool {
        let from_center = DVec2::new(x_mm, y_mm) - DVec2::from_array(self.center_mm);
        let share = from_center / self.outline.half_widths_mm();
        let is_inside = match self.outline {
            Outline::Rectangle { .. } => share.abs().max_element() <= 1.0,
            _ => share.length_squared() <= 1.0,
        };
        is_inside != self.is_obscuration
    }

    /// How far inside the opening a place is, mm: 0 at the edge, negative outside. Of an ellipse it is only of the right
    /// sign, and of the right size along its axes; an obscuration is as though it were not there.
    pub(crate) fn clearance_mm(&self, x_mm: f64, y_mm: f64) -> f64 {
        self.clearance_of_side_mm(x_mm, y_mm).0
    }

    /// The same, and which of a rectangle's four sides it counts from; 0 of others.
    pub(crate) fn clearance_of_side_mm(&self, x_mm: f64, y_mm: f64) -> (f64, usize) {
        if self.is_obscuration {
            return (f64::INFINITY, 0);
        }
        let from_center = DVec2::new(x_mm, y_mm) - DVec2::from_array(self.center_mm);
        let half = self.outline.half_widths_mm();
        match self.outline {
            Outline::Rectangle { .. } => {
                let inside = half - from_center.abs();
                let (least, side) = if inside.x < inside.y { (inside.x, 0) } else { (inside.y, 1) };
                (least, 2 * side + usize::from(from_center[side] < 0.0))
            }
            _ => ((1.0 - (from_center / half).length()) * half.min_element(), 0),
        }
    }

    /// The radius of the circle about the axis that holds the opening, mm.
    pub(crate) fn extent_mm(&self) -> f64 {
        let (half, center) = (self.outline.half_widths_mm(), DVec2::from_array(self.center_mm));
        match self.outline {
            Outline::Rectangle { .. } => (center.abs() + half).length(),
            _ => center.length() + half.max_element(),
        }
    }

    /// Places on the edge, mm, from the axis.
    pub(crate) fn edge_mm(&self) -> impl Iterator<Item = DVec2> {
        let center = DVec2::from_array(self.center_mm);
        (0..N_ON_EDGE)
            .map(move |i| center + self.outline.edge_mm(std::f64::consts::TAU * f64::from(i) / f64::from(N_ON_EDGE)))
    }

    pub(crate) fn check(&self, n_surfaces: usize) -> Result<(), OpticsError> {
        let surface = self.surface;
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if surface >= n_surfaces {
            return wrong("surface of an aperture", surface as f64, "a surface that the lens has, counted from 0");
        }
        let half = self.outline.half_widths_mm();
        if let Some(found) = half.to_array().into_iter().find(|v| !(*v > 0.0 && v.is_finite())) {
            return wrong("half the width of an aperture", found, "a finite number above 0");
        }
        match self.center_mm.into_iter().find(|v| v.is_nan() || v.abs() > 1e9) {
            Some(found) => wrong("middle of an aperture", found, "numbers below 1e9"),
            None => Ok(()),
        }
    }
}

/// Places of an edge at which a surface is looked at: a multiple of 8, so that the corners of a square are among them.
const N_ON_EDGE: u32 = 64;

#[cfg(test)]
mod tests {
    use super::*;

    fn of(outline: Outline) -> Aperture {
        Aperture { surface: 0, outline, center_mm: [1.0, -2.0], is_obscuration: false }
    }

    #[test]
    fn clearance_has_the_sign_of_clear() {
        let (half_x_mm, half_y_mm) = (3.0, 1.5);
        for outline in [
            Outline::Circle { radius_mm: 2.0 },
            Outline::Ellipse { half_x_mm, half_y_mm },
            Outline::Rectangle { half_x_mm, half_y_mm },
        ] {
            let aperture = of(outline);
            let mut n_clear = 0;
            for i in -50..=50 {
                for j in -50..=50 {
                    let (x, y) = (0.0987 * f64::from(i), 0.0987 * f64::from(j));
                    let is_clear = aperture.is_clear_at(x, y);
                    assert_eq!(is_clear, aperture.clearance_mm(x, y) >= 0.0, "{outline:?} {x} {y}");
                    assert_ne!(is_clear, Aperture { is_obscuration: true, ..aperture }.is_clear_at(x, y));
                    assert!(!is_clear || x.hypot(y) <= aperture.extent_mm());
                    n_clear += usize::from(is_clear);
                }
            }
            let area_mm2 = match outline {
                Outline::Circle { radius_mm } => std::f64::consts::PI * radius_mm * radius_mm,
                Outline::Ellipse { .. } => std::f64::consts::PI * half_x_mm * half_y_mm,
                Outline::Rectangle { .. } => 4.0 * half_x_mm * half_y_mm,
            };
            // A grid counts an area to about the cells along its edge over its cells.
            assert!((n_clear as f64 * 0.0987 * 0.0987 / area_mm2 - 1.0).abs() < 0.02, "{outline:?}");
            for place in aperture.edge_mm() {
                assert!(aperture.clearance_mm(place.x, place.y).abs() < 1e-12);
            }
        }
    }
}
