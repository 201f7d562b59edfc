//! The edges about a place in the stop: what diffraction by uncertainty bending asks for.

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
