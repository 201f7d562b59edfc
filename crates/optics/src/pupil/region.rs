//! The whole of a pupil as a region of its plane.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::{EDGE_MM, PupilBoundary, PupilPlane, Search, edge::EdgeSearch, front::Front, strips::Strips};
use crate::{MonoLens, ObjectPoint, quadrature::gauss_legendre_on};

/// The share of an outline's area that may be wrong at jumps of its edge.
const UNCERTAIN: f64 = 5e-4;
/// By how much of an outline's area half of its azimuths may differ from all of them, which are good to a third of that, and to as much
/// where the edge is hardly seen, as along a crescent and at its ends.
const AREA_CHANGE: f64 = 5e-4;
/// The share of that area from which on a jump of an outline that grazes is looked behind.
const HIDING: f64 = 0.1;
/// How often the number of azimuths is doubled for that.
const MOST_DOUBLINGS: usize = 2;
/// How far beyond an edge rays are looked at for what ends light there, over the distance from the center.
const JUST_BEYOND: f64 = 1e-7;
/// How far beyond an outline light counts as not seen, over the outline's radius.
const BESIDE: f64 = 0.02;
/// How far beyond an outline light is looked for, over its radius; at how many places of how many azimuths, at most.
const BEYOND: f64 = 1.3;
const BEYOND_PLACES: usize = 10;
const MOST_LOOKS: usize = 48;

/// All of the true, vignetted pupil that one object point sees at one wavelength: one outline where a place of it sees the whole
/// edge, or else lines across it.
///
/// Lines serve a pupil whose light comes through in separate islands, one that is curved as a crescent, and one that is long and
/// narrow. The region lies in the plane [`PupilPlane::of_region`].
#[derive(Clone, Debug, PartialEq)]
pub struct PupilRegion {
    shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
enum Shape {
    Outline(PupilBoundary),
    Strips(PupilPlane, Strips),
}

impl PupilRegion {
    /// Finds the pupil, or `None` if no light of the point gets through.
    ///
    /// Light is looked for over the whole front of the lens. `n_azimuths` (at least 8) is about the number of lines, and the number of
    /// azimuths of an outline, of which one with corners may have up to four times as many.
    pub fn find(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize) -> Option<Self> {
        let n_azimuths = n_azimuths.max(8);
        let plane = PupilPlane::of_region(lens, point);
        let search = Search { lens, point, plane, front: None };
        let mut lit = search.lit_over_front();
        let in_middle = search.lit_middle().and_then(|seed| search.part_about(seed, n_azimuths));
        let part = in_middle.or_else(|| search.part_of(&lit, n_azimuths))?;
        let does_graze = search.grazes(&part);
        let part = search.refined(part);
        let is_smooth = part.area_change() <= AREA_CHANGE;
        let most_mm2 = UNCERTAIN * part.area_mm2();
        let hidden_mm2 = || if does_graze { search.hidden_mm2(&part, HIDING * most_mm2) } else { 0.0 };
        if is_smooth && search.uncertain_mm2(&part) + hidden_mm2() <= most_mm2 {
            let is_beside = |(place, _): &(DVec2, f64)| part.beyond_mm(*place) > BESIDE * part.rho_max();
            lit.extend(search.lit_beyond(&part));
            if !lit.iter().any(is_beside) && !search.lit_around(&part).iter().any(is_beside) {
                return Some(Self { shape: Shape::Outline(part) });
            }
        }
        lit.extend(part.edge_mm().into_iter().map(|place| (place, 0.0)));
        let strips = search.strips(&lit, n_azimuths);
        // Lines that lost light would be worse than what one place sees, all of which is lit.
        let is_less =
            |strips: &Strips| is_smooth && !does_graze && strips.area_mm2() < (1.0 - AREA_CHANGE) * part.area_mm2();
        let shape = match strips.filter(|strips| !is_less(strips)) {
            Some(strips) => Shape::Strips(plane, strips),
            None => Shape::Outline(part),
        };
        Some(Self { shape })
    }

    /// The outline of the region, where it is seen whole from its center.
    pub fn outline(&self) -> Option<&PupilBoundary> {
        match &self.shape {
            Shape::Outline(boundary) => Some(boundary),
            Shape::Strips(..) => None,
        }
    }

    /// The plane that the region lies in.
    pub fn plane(&self) -> &PupilPlane {
        match &self.shape {
            Shape::Outline(boundary) => boundary.plane(),
            Shape::Strips(plane, _) => plane,
        }
    }

    /// The area of the region, mm².
    pub fn area_mm2(&self) -> f64 {
        match &self.shape {
            Shape::Outline(boundary) => boundary.area_mm2(),
            Shape::Strips(_, strips) => strips.area_mm2(),
        }
    }

    /// Returns places of the region, mm in its plane, and the area that each stands for, mm²: in each direction from the center
    /// of an outline the nodes of Gauss's rule over the square of the radius, `n_rings` of them; over each line as many of Gauss's
    /// rule over its length.
    pub fn nodes(&self, n_rings: usize) -> Vec<(DVec2, f64)> {
        match &self.shape {
            Shape::Outline(boundary) => boundary.nodes(n_rings),
            Shape::Strips(_, strips) => strips.nodes(n_rings),
        }
    }
}

impl PupilBoundary {
    fn nodes(&self, n_rings: usize) -> Vec<(DVec2, f64)> {
        let radii = gauss_legendre_on(n_rings, 0.0, 1.0);
        let n_azimuths = self.rho_mm.len();
        let mut nodes = Vec::with_capacity(n_rings * n_azimuths);
        for edge_mm in self.edge_mm() {
            let to_edge = edge_mm - self.center_mm();
            let wedge_mm2 = PI / n_azimuths as f64 * to_edge.length_squared();
            let node = |(square, weight): &(f64, f64)| (self.center_mm() + to_edge * square.sqrt(), weight * wedge_mm2);
            nodes.extend(radii.iter().map(node));
        }
        nodes
    }

    /// By what share the area of every other azimuth differs from that of all, or a quarter of what that of every fourth does: of an edge
    /// with corners one of them alone may by chance be small.
    fn area_change(&self) -> f64 {
        let n = self.rho_mm.len();
        let squares = |every: usize| self.rho_mm.iter().step_by(every).map(|rho| rho * rho).sum::<f64>() * every as f64;
        let change =
            |every: usize| if n.is_multiple_of(every) { (squares(every) / squares(1) - 1.0).abs() } else { 0.0 };
        change(2).max(0.25 * change(4))
    }
}

impl Search<'_> {
    /// Returns a part with as many azimuths as its area needs to change little from half of them.
    fn refined(&self, mut part: PupilBoundary) -> PupilBoundary {
        for _ in 0..MOST_DOUBLINGS {
            if part.area_change() <= AREA_CHANGE {
                break;
            }
            let between: Vec<DVec2> = PupilBoundary::azimuths(2 * part.rho_mm.len()).skip(1).step_by(2).collect();
            let Some(rho_mm) = self.edge_mm(part.center_mm, &between, EDGE_MM) else { break };
            part.rho_mm = part.rho_mm.iter().zip(&rho_mm).flat_map(|(known, new)| [*known, *new]).collect();
        }
        part
    }

    /// Returns the region about places of it by lines over the front of the lens.
    fn strips(&self, lit: &[(DVec2, f64)], n_lines: usize) -> Option<Strips> {
        let front = Front::of(self.lens, self.point, self.plane);
        let targets: Vec<DVec2> = lit.iter().map(|(target, _)| *target).collect();
        let places = front.places_mm(self.lens, &targets);
        let search = Search { front: Some(&front), ..*self };
        let clearances = search.clearances(&places);
        Strips::find(&search, &places.into_iter().zip(clearances).collect::<Vec<_>>(), n_lines)
    }

    /// Whether rays just beyond the edge miss a surface or are totally reflected, rather than pass a rim.
    ///
    /// No clearance determines how far from there light begins again, and an outline may end in horns along the front.
    fn grazes(&self, part: &PupilBoundary) -> bool {
        let beyond = |edge_mm: DVec2| edge_mm + JUST_BEYOND * (edge_mm - part.center_mm);
        let places: Vec<DVec2> = part.edge_mm().into_iter().map(beyond).collect();
        self.clearances(&places).contains(&f64::NEG_INFINITY)
    }

    /// Returns places of the pupil beyond the edge of a part, as the horns of a crescent beyond its hollow side.
    fn lit_beyond(&self, part: &PupilBoundary) -> Vec<(DVec2, f64)> {
        let n = part.rho_mm.len();
        let reach_mm = BEYOND * part.rho_max();
        let places: Vec<DVec2> = (0..n)
            .step_by(n.div_ceil(MOST_LOOKS))
            .flat_map(|i| {
                let (rho_mm, direction) = (part.rho_mm[i], DVec2::from_angle(TAU * i as f64 / n as f64));
                let step_mm = (reach_mm - rho_mm) / BEYOND_PLACES as f64;
                (0..BEYOND_PLACES).map(move |k| part.center_mm + (rho_mm + (k as f64 + 0.5) * step_mm) * direction)
            })
            .collect();
        self.lit_targets(places)
    }
}
