//! The edge of a lit region, looked for from a place inside.

use glam::DVec2;

use super::PupilBoundary;

/// Most steps of a climb.
const CLIMB_ROUNDS: u32 = 100;
/// Directions of a step uphill, and by how much they turn from one to the next, rad.
const CLIMB_DIRECTIONS: usize = 12;
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// The least step uphill, over the clearance.
const LEAST_STEP: f64 = 0.02;
/// Places between center and edge that are looked at for darkness, and how often.
const GAP_PLACES: usize = 11;
const GAP_ROUNDS: usize = 4;
/// Rounds after which an edge is as good as it gets; a well-behaved one takes ten.
const EDGE_ROUNDS: usize = 100;

/// A plane of places, each with the clearance of the ray through it: above 0 where light passes.
pub(crate) trait EdgeSearch {
    /// Returns the clearance at each place; −∞ where no ray gets through, whatever the rims.
    fn clearances(&self, places: &[DVec2]) -> Vec<f64>;

    /// Returns a place further inside the pupil than this one: uphill in clearance, to a summit or a ridge.
    ///
    /// From the tip of a crescent the way up is narrow: directions turn from one look to the next, and the last one that led up is
    /// tried again.
    fn climbed(&self, (mut here, mut clearance): (DVec2, f64)) -> DVec2 {
        let (mut step_mm, mut heading) = (clearance, DVec2::X);
        for round in 0..CLIMB_ROUNDS {
            let turned = DVec2::from_angle(GOLDEN_ANGLE * f64::from(round));
            let about = [-0.2, -0.05, 0.0, 0.05, 0.2].map(|angle| DVec2::from_angle(angle).rotate(heading));
            let all = PupilBoundary::azimuths(CLIMB_DIRECTIONS).map(|direction| direction.rotate(turned)).chain(about);
            let directions: Vec<DVec2> = all.collect();
            let places: Vec<DVec2> = directions.iter().map(|direction| here + step_mm * *direction).collect();
            let found = self.clearances(&places);
            let best = (0..found.len()).max_by(|&a, &b| found[a].total_cmp(&found[b])).unwrap_or(0);
            if found[best] > clearance {
                (here, clearance, heading) = (places[best], found[best], directions[best]);
                step_mm *= 2.0;
            } else if step_mm < LEAST_STEP * clearance {
                break;
            } else {
                step_mm *= 0.5;
            }
        }
        here
    }

    /// Returns how far the edge is from a place inside in each direction, mm, found to `edge_mm` of clearance.
    fn edge_mm(&self, center_mm: DVec2, directions: &[DVec2], edge_mm: f64) -> Option<Vec<f64>> {
        let at_center = self.clearances(&[center_mm])[0];
        let edge_mm = edge_mm.min(0.01 * at_center);
        let edge = |direction: &DVec2| Edge::new(center_mm, *direction, at_center);
        let mut edges: Vec<Edge> = directions.iter().map(edge).collect();
        self.narrow(&mut edges, edge_mm);
        for _ in 0..GAP_ROUNDS {
            if !self.open_gaps(&mut edges) {
                break;
            }
            self.narrow(&mut edges, edge_mm);
        }
        let is_whole = edges.iter().all(|edge| edge.outer.is_some() && edge.inner.0 > 0.0);
        is_whole.then(|| edges.iter().map(|edge| edge.inner.0).collect())
    }

    /// Brings the two ends of each edge together.
    fn narrow(&self, edges: &mut [Edge], edge_mm: f64) {
        for _ in 0..EDGE_ROUNDS {
            let mut open: Vec<&mut Edge> = edges.iter_mut().filter(|edge| !edge.is_found(edge_mm)).collect();
            if open.is_empty() {
                break;
            }
            let radii: Vec<f64> = open.iter().map(|edge| edge.next_rho_mm()).collect();
            let target = |(edge, rho): (&&mut Edge, &f64)| edge.place_mm(*rho);
            let targets: Vec<DVec2> = open.iter().zip(&radii).map(target).collect();
            let clearances = self.clearances(&targets);
            for ((edge, rho), clearance) in open.iter_mut().zip(radii).zip(clearances) {
                edge.note(rho, clearance);
            }
        }
    }

    /// Looks for darkness between the center and the edges, opens the edges beyond which there is some, and returns
    /// whether there are any.
    fn open_gaps(&self, edges: &mut [Edge]) -> bool {
        let share = |k: usize| (k + 1) as f64 / (GAP_PLACES + 1) as f64;
        let places = |edge: &Edge| {
            let edge = *edge;
            (0..GAP_PLACES).map(move |k| edge.place_mm(share(k) * edge.inner.0))
        };
        let targets: Vec<DVec2> = edges.iter().flat_map(places).collect();
        let clearances = self.clearances(&targets);
        let mut is_any_open = false;
        for (edge, clearances) in edges.iter_mut().zip(clearances.chunks(GAP_PLACES)) {
            let Some(dark) = clearances.iter().position(|clearance| *clearance <= 0.0) else { continue };
            let rho_mm = edge.inner.0;
            let inner = match dark {
                0 => (0.0, edge.at_center),
                _ => (share(dark - 1) * rho_mm, clearances[dark - 1]),
            };
            *edge =
                Edge { inner, outer: Some((share(dark) * rho_mm, clearances[dark])), in_a_row: 0, rounds: 0, ..*edge };
            is_any_open = true;
        }
        is_any_open
    }
}

/// The edge of the pupil in one direction from a place inside, between a radius inside and one outside.
#[derive(Clone, Copy)]
pub(crate) struct Edge {
    pub(super) center_mm: DVec2,
    pub(super) direction: DVec2,
    pub(super) at_center: f64,
    /// Radius and clearance of the outermost ray known to get through.
    pub(super) inner: (f64, f64),
    /// Radius and clearance of the innermost ray known not to, once there is one.
    pub(super) outer: Option<(f64, f64)>,
    /// Which end moved last, and how often in a row.
    pub(super) in_a_row: i32,
    pub(super) rounds: usize,
}

impl Edge {
    pub(super) fn new(center_mm: DVec2, direction: DVec2, at_center: f64) -> Self {
        Self { center_mm, direction, at_center, inner: (0.0, at_center), outer: None, in_a_row: 0, rounds: 0 }
    }

    pub(super) fn place_mm(&self, rho_mm: f64) -> DVec2 {
        self.center_mm + rho_mm * self.direction
    }

    fn is_found(&self, edge_mm: f64) -> bool {
        self.outer.is_some_and(|outer| self.inner.1 <= edge_mm || outer.0 - self.inner.0 <= 1e-14 * (1.0 + outer.0))
    }

    /// Returns where to look next: outwards until a rim is passed, then by regula falsi with the Illinois rule.
    fn next_rho_mm(&self) -> f64 {
        let (a, fa) = self.inner;
        let Some((b, fb)) = self.outer else { return 1.3 * (a + fa.max(1e-6)) };
        // A ray that misses has no clearance, and a kink may fool the rule: halve.
        if !fb.is_finite() || self.rounds % 8 == 7 {
            return 0.5 * (a + b);
        }
        let weight = 0.5_f64.powi(self.in_a_row.abs() - 1).min(1.0);
        let (wa, wb) = if self.in_a_row > 0 { (fa, weight * fb) } else { (weight * fa, fb) };
        let root = (a * wb - b * wa) / (wb - wa);
        // A hair inwards, so that the ray found is one that gets through.
        (root - 1e-12 * (1.0 + root)).clamp(a, b)
    }

    fn note(&mut self, rho: f64, clearance: f64) {
        self.rounds += 1;
        if clearance > 0.0 {
            self.inner = (rho, clearance);
            self.in_a_row = self.in_a_row.max(0) + 1;
        } else {
            self.outer = Some((rho, clearance));
            self.in_a_row = self.in_a_row.min(0) - 1;
        }
    }
}
