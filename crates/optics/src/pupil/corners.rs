//! Where the edge of a pupil passes from one rim to another.

use std::f64::consts::TAU;

use glam::DVec2;

use super::{EDGE_MM, PupilBoundary, Search, edge::EdgeSearch};
use crate::{MonoLens, ObjectPoint, Vignetting};

/// What bounds a pupil in some direction: a surface, one of its openings, 0 for the round rim, and the part of that.
type Limit = (usize, usize, usize);

/// How near two rims must be to a ray to be held for one, mm.
const SAME_MM: f64 = 1e-8;
/// Halvings of the angle between two azimuths: a corner is found to 1e-4 of that, the area beside it to 1e-8.
const HALVINGS: usize = 14;
/// With more corners than this an edge is taken as smooth: it is one of rims that lie upon one another.
const MOST_CORNERS: usize = 72;

impl PupilBoundary {
    /// Returns the azimuths in [0, 2π) at which the edge has corners, ascending: where it passes from one rim to another
    /// or around the corner of a rectangle.
    ///
    /// Looked for between the azimuths of the boundary at which different rims limit the pupil; where a rim limits it
    /// only between two of them, it is passed over.
    pub fn corners_rad(&self, lens: &MonoLens, point: &ObjectPoint) -> Vec<f64> {
        let n = self.rho_mm.len();
        let azimuth = |i: usize| TAU * i as f64 / n as f64;
        let edge: Vec<DVec2> =
            (0..n).map(|i| self.center_mm + self.rho_mm[i] * DVec2::from_angle(azimuth(i))).collect();
        let search = Search::new(lens, point);
        let limits = search.limits(&edge);
        let next = |i: usize| limits[(i + 1) % n];
        let mut open: Vec<Bracket> = (0..n)
            .filter(|&i| limits[i] != next(i))
            .map(|i| Bracket { left: (azimuth(i), limits[i]), right: (azimuth(i + 1), next(i)) })
            .collect();
        let mut corners: Vec<f64> = vec![];
        // Between two azimuths there may be a third rim, hence another corner.
        for _ in 0..3 {
            let Some(found) = self.narrowed(&search, open) else { return vec![] };
            corners.extend(found.iter().map(|(corner, _)| corner.rem_euclid(TAU)));
            open = found.into_iter().filter_map(|(_, rest)| rest).collect();
            if open.is_empty() {
                break;
            }
        }
        corners.sort_by(f64::total_cmp);
        if corners.len() > MOST_CORNERS { vec![] } else { corners }
    }

    /// Returns the edge's distance from the center at these azimuths, mm, found to rounding.
    pub fn edge_at_mm(&self, lens: &MonoLens, point: &ObjectPoint, azimuths_rad: &[f64]) -> Option<Vec<f64>> {
        let directions: Vec<DVec2> = azimuths_rad.iter().map(|azimuth| DVec2::from_angle(*azimuth)).collect();
        Search::new(lens, point).edge_mm(self.center_mm, &directions, EDGE_MM)
    }

    /// Halves brackets until they are narrow, and returns the corner in each, with what remains to its right if the rim
    /// there is not that of the bracket's right end.
    fn narrowed(&self, search: &Search<'_>, mut brackets: Vec<Bracket>) -> Option<Vec<(f64, Option<Bracket>)>> {
        let mut rights: Vec<(f64, Limit)> = brackets.iter().map(|bracket| bracket.right).collect();
        for _ in 0..HALVINGS {
            let middles: Vec<f64> = brackets.iter().zip(&rights).map(|(b, right)| 0.5 * (b.left.0 + right.0)).collect();
            let directions: Vec<DVec2> = middles.iter().map(|azimuth| DVec2::from_angle(*azimuth)).collect();
            let rho_mm = search.edge_mm(self.center_mm, &directions, EDGE_MM)?;
            let places: Vec<DVec2> =
                directions.iter().zip(&rho_mm).map(|(u, rho)| self.center_mm + *rho * *u).collect();
            let limits = search.limits(&places);
            for (i, bracket) in brackets.iter_mut().enumerate() {
                let here = (middles[i], limits[i]);
                *(if limits[i] == bracket.left.1 { &mut bracket.left } else { &mut rights[i] }) = here;
            }
        }
        let corner = |(bracket, right): (&Bracket, &(f64, Limit))| {
            let is_other = right.1 != bracket.right.1;
            (0.5 * (bracket.left.0 + right.0), is_other.then_some(Bracket { left: *right, right: bracket.right }))
        };
        Some(brackets.iter().zip(&rights).map(corner).collect())
    }
}

/// Two azimuths, and what bounds the pupil there.
#[derive(Clone, Copy)]
struct Bracket {
    left: (f64, Limit),
    right: (f64, Limit),
}

impl Search<'_> {
    /// Returns what each ray comes nearest to.
    fn limits(&self, targets_mm: &[DVec2]) -> Vec<Limit> {
        let mut nearest = vec![(f64::INFINITY, (0, 0, 0)); targets_mm.len()];
        let mut rays = self.plane.rays(self.lens, self.point, targets_mm);
        for (surface, step) in self.lens.steps().iter().enumerate() {
            self.lens.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
            for (i, nearest) in nearest.iter_mut().enumerate().filter(|(i, _)| rays.fate[*i].is_in_flight()) {
                let point = rays.point_mm(i);
                let at = self
                    .lens
                    .placements()
                    .map_or(point, |placements| placements[surface].surface_from_lens(point))
                    .truncate();
                let mut note = |clearance_mm: f64, number: usize, part: usize| {
                    if clearance_mm < nearest.0 - SAME_MM {
                        *nearest = (clearance_mm, (surface, number, part));
                    }
                };
                note(step.semi_aperture - at.length(), 0, 0);
                for (number, aperture) in step.apertures.iter().enumerate() {
                    let (clearance_mm, side) = aperture.clearance_of_side_mm(at.x, at.y);
                    note(clearance_mm, 1 + number, side);
                }
            }
        }
        nearest.into_iter().map(|(_, limit)| limit).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{Aperture, Glass, Interface, Lens, Outline, Surface};

    fn plates(apertures: Vec<Aperture>) -> MonoLens {
        let plate = |thickness_after_mm| Interface {
            surface: Surface::plane(2.0),
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        Lens::new_with_apertures("plates", "test", vec![plate(10.0), plate(0.0)], 1, apertures)
            .unwrap()
            .at(550.0)
            .unwrap()
    }

    #[test]
    fn two_rims_make_a_lens_with_two_corners() {
        // Seen from the side by tan 0.1, the first of two rims of 2 mm is 1 mm off the second.
        let lens = plates(vec![]);
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.0), 0.0);
        let boundary = PupilBoundary::find(&lens, &point, 32).unwrap();
        let corners = boundary.corners_rad(&lens, &point);
        assert_eq!(corners.len(), 2, "{corners:?}");
        assert!((corners[0] - 0.5 * PI).abs() < 1e-4 && (corners[1] - 1.5 * PI).abs() < 1e-4, "{corners:?}");
        // Half the chord of two circles of radius 2, 1 apart.
        let rho_mm = boundary.edge_at_mm(&lens, &point, &corners).unwrap();
        assert!(rho_mm.iter().all(|rho| (rho - 3.75f64.sqrt()).abs() < 1e-4), "{rho_mm:?}");
        assert!((boundary.center_mm().x.abs() - 0.5).abs() < 1e-3, "{}", boundary.center_mm());
    }

    #[test]
    fn one_rim_has_none_and_a_rectangle_four() {
        let lens = plates(vec![]);
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.5);
        let boundary = PupilBoundary::find(&lens, &point, 32).unwrap();
        assert!(boundary.corners_rad(&lens, &point).is_empty());
        let outline = Outline::Rectangle { half_x_mm: 1.0, half_y_mm: 0.5 };
        let lens = plates(vec![Aperture { surface: 1, outline, center_mm: [0.2, 0.1], is_obscuration: false }]);
        let boundary = PupilBoundary::find(&lens, &point, 32).unwrap();
        let corners = boundary.corners_rad(&lens, &point);
        assert_eq!(corners.len(), 4, "{corners:?}");
        let rho_mm = boundary.edge_at_mm(&lens, &point, &corners).unwrap();
        for ((corner, rho), (x, y)) in
            corners.iter().zip(rho_mm).zip([(1.0, 0.5), (-1.0, 0.5), (-1.0, -0.5), (1.0, -0.5)])
        {
            let place = boundary.center_mm() + rho * DVec2::from_angle(*corner);
            // The point is 2 m before the pupil, which is the stop: nothing is seen larger or smaller.
            assert!(place.distance(DVec2::new(0.2 + x, 0.1 + y)) < 1e-4, "{place}");
        }
    }
}
