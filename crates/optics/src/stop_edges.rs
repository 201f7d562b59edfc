//! The edges about a place in the stop: what diffraction by uncertainty bending asks for.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::{Aperture, MonoLens};

/// The edges of a stop that is not round: of its rim, of its openings and of what stands before it.
#[derive(Clone, Debug, PartialEq)]
pub struct StopEdges {
    rim_mm: f64,
    apertures: Vec<Aperture>,
}

/// The edge that is nearest to a place in the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeNearby {
    /// The unit direction to it, along the stop's own x and y.
    pub direction: DVec2,
    /// How far it is, mm.
    pub distance_mm: f64,
    /// How far the nearer of the edges on both sides across that direction is, mm: half the chord in a circle.
    pub across_mm: f64,
}

/// A piece of an edge in the stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePiece {
    /// Its length, mm.
    pub length_mm: f64,
    /// Between which angles from x the directions across it lie, radians: all in one where it is straight.
    pub across_rad: [f64; 2],
}

/// Pieces between which an edge turns by less belong to a round one.
const CORNER_RAD: f64 = 0.15;
/// By less, they are one straight edge.
const STRAIGHT_RAD: f64 = 1e-6;
/// Steps along the radius of the rim in which it is looked whether light passes beside an edge.
const STEPS: f64 = 256.0;

impl MonoLens {
    /// The edges of the stop where it is not just round; `None` of most lenses.
    pub fn stop_edges(&self) -> Option<StopEdges> {
        let step = &self.steps()[self.stop()];
        let rim_mm = step.semi_aperture;
        (!step.apertures.is_empty()).then(|| StopEdges { rim_mm, apertures: step.apertures.clone() })
    }
}

impl StopEdges {
    /// Returns the edge nearest to a place, mm along the stop's own x and y.
    pub fn nearest(&self, at_mm: DVec2) -> EdgeNearby {
        // An iris has the rim among its sides.
        let has_iris = self.apertures.iter().any(Aperture::is_iris);
        let of_rim = (self.rim_mm - at_mm.length(), at_mm.normalize_or(DVec2::X));
        let of_apertures = self.apertures.iter().map(|aperture| {
            let found = aperture.outline.nearest_edge(aperture.off_center_mm(at_mm.x, at_mm.y));
            (found.clearance_mm.abs(), found.direction)
        });
        let first = if has_iris { (f64::INFINITY, DVec2::X) } else { of_rim };
        let (distance_mm, direction) =
            of_apertures.fold(first, |least, here| if here.0 < least.0 { here } else { least });
        let across = direction.perp();
        let both_mm = self.along_mm(at_mm, across).min(self.along_mm(at_mm, -across));
        EdgeNearby { direction, distance_mm: distance_mm.max(0.0), across_mm: both_mm.max(distance_mm.max(0.0)) }
    }

    /// Returns the pieces of all edges beside which light passes; those of one straight edge are one.
    pub fn pieces(&self) -> Vec<EdgePiece> {
        // An iris has the rim among its sides.
        let has_iris = self.apertures.iter().any(Aperture::is_iris);
        let rim =
            (0..if has_iris { 0 } else { 360 }).map(|i| self.rim_mm * DVec2::from_angle(f64::from(i) / 360.0 * TAU));
        let edges = std::iter::once((None, rim.collect()))
            .chain(self.apertures.iter().enumerate().map(|(i, aperture)| (Some(i), aperture.edge_mm().collect())));
        let of_edge = |(own, mut places): (Option<usize>, Vec<DVec2>)| {
            places.dedup_by(|a, b| a.distance(*b) < 1e-9 * self.rim_mm);
            let is_clear = |at: DVec2| {
                let mut others = self.apertures.iter().enumerate().filter(|(i, _)| Some(*i) != own);
                (own.is_none() || at.length() <= self.rim_mm) && others.all(|(_, other)| other.is_clear_at(at.x, at.y))
            };
            pieces_of(&places, self.rim_mm / STEPS, &is_clear)
        };
        edges.flat_map(of_edge).collect()
    }

    /// How far the first edge along a direction is, mm.
    fn along_mm(&self, at_mm: DVec2, direction: DVec2) -> f64 {
        let slope = at_mm.dot(direction);
        let room_mm2 = self.rim_mm * self.rim_mm - at_mm.length_squared();
        let of_rim = (slope * slope + room_mm2).max(0.0).sqrt() - slope;
        let of_apertures = self
            .apertures
            .iter()
            .map(|aperture| aperture.outline.edge_along_mm(aperture.off_center_mm(at_mm.x, at_mm.y), direction));
        of_apertures.fold(of_rim, f64::min)
    }
}

/// Returns the pieces of a closed edge beside which light passes.
fn pieces_of(places: &[DVec2], step_mm: f64, is_clear: &dyn Fn(DVec2) -> bool) -> Vec<EdgePiece> {
    let n = places.len();
    let side = |i: usize| places[(i + 1) % n] - places[i % n];
    let turn = |i: usize| {
        let turn = side(i).angle_to(side(i + 1));
        if (STRAIGHT_RAD..CORNER_RAD).contains(&turn.abs()) { turn } else { 0.0 }
    };
    let mut pieces: Vec<EdgePiece> = Vec::new();
    for (i, &place) in places.iter().enumerate() {
        let n_steps = (side(i).length() / step_mm).ceil().max(1.0);
        let at = |k: usize| place + side(i) * ((k as f64 + 0.5) / n_steps);
        let n_clear = (0..n_steps as usize).filter(|k| is_clear(at(*k))).count();
        if n_clear == 0 {
            continue;
        }
        let (middle, before, after) = (side(i).perp().to_angle(), turn(i + n - 1), turn(i));
        let piece = EdgePiece {
            length_mm: side(i).length() * n_clear as f64 / n_steps,
            across_rad: [middle - 0.5 * before, middle + 0.5 * after],
        };
        let off =
            |last: &EdgePiece, end: usize| DVec2::from_angle(last.across_rad[end] - piece.across_rad[end]).to_angle();
        let goes_on = |last: &&mut EdgePiece| (0..2).all(|end| off(last, end).abs() < STRAIGHT_RAD);
        match pieces.last_mut().filter(goes_on) {
            Some(last) => last.length_mm += piece.length_mm,
            None => pieces.push(piece),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{Iris, Lens, Outline};

    fn pieces(lens: &Lens) -> Vec<EdgePiece> {
        lens.at(550.0).unwrap().stop_edges().unwrap().pieces()
    }

    #[test]
    fn straight_blades_are_pieces_and_round_ones_turn_all_the_way() {
        let of = |curvature: f64| {
            let iris = Iris { blades: 6, rotation_deg: 0.0, curvature };
            let lens = Lens::thin(50.0, 25.0).unwrap().with_iris(Some(iris)).unwrap();
            lens.with_stop_diameter_mm(10.0).unwrap()
        };
        let straight = of(0.0);
        // A corner is at the top: sides face right and left.
        let side_mm = 2.0 * straight.iris_opening().unwrap().inscribed_radius_mm() * (PI / 6.0).tan();
        let found = pieces(&straight);
        let lengths: f64 = found.iter().map(|piece| piece.length_mm).sum();
        assert!((lengths - 6.0 * side_mm).abs() < 1e-9 && found.len() <= 7, "{found:?}");
        for EdgePiece { across_rad: [from, to], .. } in found {
            let sixths = from / (PI / 3.0);
            assert!(from == to && (sixths - sixths.round()).abs() < 1e-6, "{from} {to}");
        }
        // Of bulging blades each covers a part of its sixth, all of it where they are as round as the rim.
        let turned = |lens: &Lens| pieces(lens).iter().map(|p| p.across_rad[1] - p.across_rad[0]).sum::<f64>();
        let half = turned(&of(0.5));
        assert!(half > 0.3 && half < 2.0, "{half}");
    }

    #[test]
    fn what_other_edges_cover_is_no_edge() {
        let vane = Outline::Rectangle { half_x_mm: 20.0, half_y_mm: 0.1 };
        let aperture = Aperture { surface: 0, outline: vane, center_mm: [0.0; 2], is_obscuration: true };
        let wide = Lens::thin(50.0, 10.0).unwrap().interfaces().to_vec();
        let found = pieces(&Lens::new_with_apertures("spider", "test", wide, 0, vec![aperture]).unwrap());
        let (straight, round): (Vec<_>, Vec<_>) =
            found.iter().partition(|piece| piece.across_rad[0] == piece.across_rad[1]);
        let sum = |pieces: &[&EdgePiece]| pieces.iter().map(|piece| piece.length_mm).sum::<f64>();
        // Two sides of 10 mm within the rim, and the rim but for where the vane meets it.
        assert!((sum(&straight) - 20.0).abs() < 0.1, "{}", sum(&straight));
        assert!((sum(&round) - (10.0 * PI - 0.4)).abs() < 0.1, "{}", sum(&round));
    }
}
