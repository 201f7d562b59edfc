//! Shapes of openings and obscurations, about their own middles.

use std::f64::consts::TAU;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::iris::IrisOpening;

/// The shape of an aperture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// A polygon, convex or not, whose sides do not cross.
    Polygon {
        /// Its corners in turn, either way around, mm from the middle along x and y.
        corners_mm: Vec<[f64; 2]>,
    },
    /// Another shape, turned about its middle.
    Turned {
        /// By how much, degrees, from x towards y.
        by_deg: f64,
        /// The shape.
        outline: Box<Self>,
    },
    /// The opening of a stop that is closed by blades: [`Lens::with_iris`](crate::Lens::with_iris) makes it.
    #[serde(skip)]
    Iris(IrisOpening),
}

/// The place of an edge that is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NearestEdge {
    /// How far within the outline the point is, mm; negative outside.
    pub(crate) clearance_mm: f64,
    /// The unit direction from the point to the edge.
    pub(crate) direction: DVec2,
    /// Which part of the edge it is, where the edge has corners between its parts.
    pub(crate) part: usize,
}

/// Places of an edge at which a surface is looked at: a multiple of 8, so that the corners of a square are among them.
const N_ON_EDGE: u32 = 64;
/// The most corners of a polygon.
const MOST_CORNERS: usize = 1000;

impl Outline {
    /// The box that holds it, mm from its middle: its lower left and upper right corner.
    pub fn bounds_mm(&self) -> [DVec2; 2] {
        match self {
            Self::Polygon { .. } | Self::Turned { .. } | Self::Iris(_) => {
                let all = self.edge_mm();
                all.into_iter()
                    .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
            }
            _ => {
                let half_mm = self.half_widths_mm();
                [-half_mm, half_mm]
            }
        }
    }

    /// Half the widths of a circle, an ellipse or a rectangle along x and y, mm.
    fn half_widths_mm(&self) -> DVec2 {
        match *self {
            Self::Circle { radius_mm } => DVec2::splat(radius_mm),
            Self::Ellipse { half_x_mm, half_y_mm } | Self::Rectangle { half_x_mm, half_y_mm } => {
                DVec2::new(half_x_mm, half_y_mm)
            }
            Self::Polygon { .. } | Self::Turned { .. } | Self::Iris(_) => DVec2::NAN,
        }
    }

    /// The radius of a circle, also of one that is stated as an ellipse, mm.
    pub(super) fn radius_mm(&self) -> Option<f64> {
        match self {
            Self::Circle { radius_mm } => Some(*radius_mm),
            Self::Ellipse { half_x_mm, half_y_mm } if half_x_mm == half_y_mm => Some(*half_x_mm),
            Self::Turned { outline, .. } => outline.radius_mm(),
            _ => None,
        }
    }

    /// Whether a place is within, mm from the middle.
    pub(super) fn is_inside(&self, at_mm: DVec2) -> bool {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } => (at_mm / self.half_widths_mm()).length_squared() <= 1.0,
            Self::Rectangle { .. } => (at_mm / self.half_widths_mm()).abs().max_element() <= 1.0,
            Self::Polygon { corners_mm } => is_inside_polygon(corners_mm, at_mm),
            Self::Turned { by_deg, outline } => outline.is_inside(turned_back(*by_deg, at_mm)),
            Self::Iris(opening) => opening.is_inside(at_mm),
        }
    }

    /// Returns how far within a place is, and where the edge is nearest.
    ///
    /// Of an ellipse the distance is only of the right sign, and of the right size along its axes; of a rectangle and an iris it is that
    /// for places within.
    pub(crate) fn nearest_edge(&self, at_mm: DVec2) -> NearestEdge {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } => {
                let half_mm = self.half_widths_mm();
                let share = at_mm / half_mm;
                let clearance_mm = (1.0 - share.length()) * half_mm.min_element();
                // Along the slope of the share.
                let outwards = (share / half_mm).normalize_or(if half_mm.x <= half_mm.y { DVec2::X } else { DVec2::Y });
                let direction = if clearance_mm < 0.0 { -outwards } else { outwards };
                NearestEdge { clearance_mm, direction, part: 0 }
            }
            Self::Rectangle { .. } => {
                let inside_mm = self.half_widths_mm() - at_mm.abs();
                let (clearance_mm, axis) = if inside_mm.x < inside_mm.y { (inside_mm.x, 0) } else { (inside_mm.y, 1) };
                let is_negative = at_mm[axis] < 0.0;
                let towards_side = if axis == 0 { DVec2::X } else { DVec2::Y };
                let is_flipped = is_negative != (clearance_mm < 0.0);
                let direction = if is_flipped { -towards_side } else { towards_side };
                NearestEdge { clearance_mm, direction, part: 2 * axis + usize::from(is_negative) }
            }
            Self::Polygon { corners_mm } => nearest_of_polygon(corners_mm, at_mm),
            Self::Turned { by_deg, outline } => {
                let own = outline.nearest_edge(turned_back(*by_deg, at_mm));
                NearestEdge { direction: turn(*by_deg).rotate(own.direction), ..own }
            }
            Self::Iris(opening) => {
                let (clearance_mm, part) = opening.clearance_of_side_mm(at_mm);
                let outwards = opening.sides()[part].direction(at_mm);
                NearestEdge { clearance_mm, direction: if clearance_mm < 0.0 { -outwards } else { outwards }, part }
            }
        }
    }

    /// Returns how far from a place the edge is along a unit direction, mm; infinite where it never comes. Of an iris only from within.
    pub(crate) fn edge_along_mm(&self, at_mm: DVec2, direction: DVec2) -> f64 {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } => {
                let half_mm = self.half_widths_mm();
                let (p, d) = (at_mm / half_mm, direction / half_mm);
                let (square, slope, room) = (d.length_squared(), p.dot(d), 1.0 - p.length_squared());
                let under_root = slope * slope + square * room;
                if under_root < 0.0 {
                    return f64::INFINITY;
                }
                let root = under_root.sqrt();
                let roots = [(-slope - root) / square, (-slope + root) / square];
                roots.into_iter().find(|mm| *mm >= 0.0).unwrap_or(f64::INFINITY)
            }
            Self::Rectangle { .. } => {
                let half_mm = self.half_widths_mm();
                let corners = [
                    [half_mm.x, half_mm.y],
                    [-half_mm.x, half_mm.y],
                    [-half_mm.x, -half_mm.y],
                    [half_mm.x, -half_mm.y],
                ];
                along_polygon_mm(&corners, at_mm, direction)
            }
            Self::Polygon { corners_mm } => along_polygon_mm(corners_mm, at_mm, direction),
            Self::Turned { by_deg, outline } => {
                outline.edge_along_mm(turned_back(*by_deg, at_mm), turned_back(*by_deg, direction))
            }
            Self::Iris(opening) => {
                opening.sides().iter().map(|side| side.exit_mm(at_mm, direction)).fold(f64::INFINITY, f64::min)
            }
        }
    }

    /// The radius of the circle about the middle that holds it, mm.
    pub(super) fn reach_mm(&self) -> f64 {
        match self {
            Self::Rectangle { .. } => self.half_widths_mm().length(),
            Self::Polygon { corners_mm } => {
                corners_mm.iter().map(|corner| DVec2::from_array(*corner).length()).fold(0.0, f64::max)
            }
            Self::Turned { outline, .. } => outline.reach_mm(),
            Self::Iris(opening) => opening.extent_mm(),
            _ => self.half_widths_mm().max_element(),
        }
    }

    /// Returns places of its edge in turn, mm from the middle; corners are among them.
    pub fn edge_mm(&self) -> Vec<DVec2> {
        let angles = || (0..N_ON_EDGE).map(|i| TAU * f64::from(i) / f64::from(N_ON_EDGE));
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } => {
                angles().map(|angle| self.half_widths_mm() * DVec2::from_angle(angle)).collect()
            }
            Self::Rectangle { .. } => {
                let half_mm = self.half_widths_mm();
                let place = |direction: DVec2| direction * (half_mm / direction.abs()).min_element();
                let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(x, y)| DVec2::new(x, y));
                let first = (half_mm.y / half_mm.x).atan();
                let [a, b] = [first, std::f64::consts::PI - first];
                let mut all: Vec<(f64, DVec2)> =
                    angles().map(|angle| (angle, place(DVec2::from_angle(angle)))).collect();
                all.extend([a, b, TAU - b, TAU - a].into_iter().zip(corners.map(|corner| corner * half_mm)));
                all.sort_by(|one, other| one.0.total_cmp(&other.0));
                all.into_iter().map(|(_, place)| place).collect()
            }
            Self::Polygon { corners_mm } => {
                let n_between = (N_ON_EDGE as usize).div_ceil(corners_mm.len());
                let place = |[a, b]: [DVec2; 2]| (0..n_between).map(move |i| a.lerp(b, i as f64 / n_between as f64));
                sides(corners_mm).flat_map(place).collect()
            }
            Self::Turned { by_deg, outline } => {
                outline.edge_mm().into_iter().map(|place| turn(*by_deg).rotate(place)).collect()
            }
            Self::Iris(opening) => opening.outline_mm(8),
        }
    }

    /// Whether it is its own mirror image when x changes its sign (axis 0), or y; of polygons and what is turned it may be without this
    /// saying so.
    pub(super) fn is_mirrored_along(&self, axis: usize) -> bool {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } | Self::Rectangle { .. } => true,
            Self::Polygon { corners_mm } => corners_mm.iter().all(|corner| {
                let mut mirrored = *corner;
                mirrored[axis] = -mirrored[axis];
                corners_mm.contains(&mirrored)
            }),
            Self::Turned { by_deg, outline } => {
                outline.radius_mm().is_some() || (by_deg.rem_euclid(180.0) == 0.0 && outline.is_mirrored_along(axis))
            }
            Self::Iris(opening) => opening.is_mirrored_along(axis),
        }
    }

    /// Returns the shape so many times as large.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Circle { radius_mm } => Self::Circle { radius_mm: radius_mm * factor },
            Self::Ellipse { half_x_mm, half_y_mm } => {
                Self::Ellipse { half_x_mm: half_x_mm * factor, half_y_mm: half_y_mm * factor }
            }
            Self::Rectangle { half_x_mm, half_y_mm } => {
                Self::Rectangle { half_x_mm: half_x_mm * factor, half_y_mm: half_y_mm * factor }
            }
            Self::Polygon { corners_mm } => {
                Self::Polygon { corners_mm: corners_mm.iter().map(|corner| corner.map(|mm| mm * factor)).collect() }
            }
            Self::Turned { by_deg, outline } => {
                Self::Turned { by_deg: *by_deg, outline: Box::new(outline.scaled(factor)) }
            }
            Self::Iris(opening) => Self::Iris(opening.clone()),
        }
    }

    /// What is wrong with it: the number, its name and what is expected in its place.
    pub(super) fn wrong(&self) -> Option<(&'static str, f64, &'static str)> {
        match self {
            Self::Polygon { corners_mm } => wrong_with_polygon(corners_mm),
            Self::Turned { by_deg, .. } if !(-360.0..=360.0).contains(by_deg) => {
                Some(("by_deg of an aperture", *by_deg, "-360 to 360 degrees"))
            }
            Self::Turned { outline, .. } => outline.wrong(),
            Self::Iris(_) => None,
            _ => {
                let half = self.half_widths_mm().to_array();
                let wrong = half.into_iter().find(|v| !(*v > 0.0 && v.is_finite()))?;
                Some(("half the width of an aperture", wrong, "a finite number above 0"))
            }
        }
    }
}

fn turn(by_deg: f64) -> DVec2 {
    DVec2::from_angle(by_deg.to_radians())
}

fn turned_back(by_deg: f64, at: DVec2) -> DVec2 {
    turn(-by_deg).rotate(at)
}

/// The sides of a polygon, from each corner to the next.
fn sides(corners_mm: &[[f64; 2]]) -> impl Iterator<Item = [DVec2; 2]> {
    let next = corners_mm.iter().skip(1).chain(corners_mm.first());
    corners_mm.iter().zip(next).map(|(a, b)| [DVec2::from_array(*a), DVec2::from_array(*b)])
}

/// Whether a ray from a place along x crosses a polygon an odd number of times.
fn is_inside_polygon(corners_mm: &[[f64; 2]], at: DVec2) -> bool {
    let crosses =
        |[a, b]: [DVec2; 2]| (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x);
    sides(corners_mm).filter(|side| crosses(*side)).count() % 2 == 1
}

fn nearest_of_polygon(corners_mm: &[[f64; 2]], at: DVec2) -> NearestEdge {
    let (mut least_mm2, mut found, mut part) = (f64::INFINITY, DVec2::ZERO, 0);
    for (number, [a, b]) in sides(corners_mm).enumerate() {
        let along = b - a;
        let share = ((at - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        let way = a + along * share - at;
        if way.length_squared() < least_mm2 {
            (least_mm2, found, part) = (way.length_squared(), way, number);
        }
    }
    let distance_mm = least_mm2.sqrt();
    let clearance_mm = if is_inside_polygon(corners_mm, at) { distance_mm } else { -distance_mm };
    NearestEdge { clearance_mm, direction: found.normalize_or(DVec2::X), part }
}

fn along_polygon_mm(corners_mm: &[[f64; 2]], at: DVec2, direction: DVec2) -> f64 {
    let along = |[a, b]: [DVec2; 2]| {
        let (from_a, side) = (at - a, b - a);
        let across = direction.perp_dot(side);
        // Where the line and the side cross: so far along each.
        let (way_mm, share) = (side.perp_dot(from_a) / across, direction.perp_dot(from_a) / across);
        (across != 0.0 && way_mm >= 0.0 && (0.0..=1.0).contains(&share)).then_some(way_mm)
    };
    sides(corners_mm).filter_map(along).fold(f64::INFINITY, f64::min)
}

fn wrong_with_polygon(corners_mm: &[[f64; 2]]) -> Option<(&'static str, f64, &'static str)> {
    let n = corners_mm.len();
    if !(3..=MOST_CORNERS).contains(&n) {
        return Some(("the number of corners of an aperture", n as f64, "3 to 1000"));
    }
    if let Some(wrong) = corners_mm.as_flattened().iter().find(|mm| !(-1e9..=1e9).contains(*mm)) {
        return Some(("a corner of an aperture", *wrong, "numbers below 1e9"));
    }
    let all: Vec<[DVec2; 2]> = sides(corners_mm).collect();
    let is_left = |[a, b]: [DVec2; 2], p: DVec2| (b - a).perp_dot(p - a);
    let crosses = |one: [DVec2; 2], other: [DVec2; 2]| {
        is_left(one, other[0]) * is_left(one, other[1]) < 0.0 && is_left(other, one[0]) * is_left(other, one[1]) < 0.0
    };
    let crossing = (0..n).find(|&i| all[i][0] == all[i][1] || (i + 1..n).any(|j| crosses(all[i], all[j])));
    if let Some(side) = crossing {
        return Some((
            "a side of an aperture that has no length or crosses another, counted from 0,",
            side as f64,
            "none",
        ));
    }
    let area_mm2: f64 = 0.5 * all.iter().map(|[a, b]| a.perp_dot(*b)).sum::<f64>().abs();
    (area_mm2 <= 0.0).then_some(("the area of an aperture", area_mm2, "a number above 0"))
}
