//! The outline of a pupil, found from that of a neighboring point.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::mesh::{Mesh, polar};

/// How near to a rim a pupil's edge must pass, over the scale of clearances: areas are then good to 1e-8.
const TOLERANCE: f64 = 1e-8;
/// How far the center may be from the centroid of the edge about it, as a share of the radius: it is that of the pupil alone, wherever the
/// search began.
const OFF_CENTER: f64 = 2e-3;

/// How far inside the rims rays through these places of a plane stay; below 0 outside.
pub(crate) type Clearances<'a> = &'a dyn Fn(&[DVec2]) -> Vec<f64>;

/// The edge of a region of a plane, at azimuths about a center: equally spaced ones, or nearly so and with the corners of the edge among
/// every other of them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outline {
    pub(crate) center: DVec2,
    pub(crate) rho: Vec<f64>,
    /// Where they are not equally spaced; ascending, the first may be below 0.
    azimuths: Option<Vec<f64>>,
    /// Whether it is known to mirror itself about the x axis, on which its center lies: half of it is looked for then.
    pub(crate) is_mirrored: bool,
}

impl Outline {
    /// Returns the edge at equally spaced azimuths.
    pub(crate) fn even(center: DVec2, rho: Vec<f64>) -> Self {
        Self { center, rho, azimuths: None, is_mirrored: false }
    }

    /// Returns it as one that mirrors itself, its upper half mirrored, or of which that is not known.
    pub(crate) fn mirrored(&self, is_mirrored: bool) -> Self {
        if self.is_mirrored || !is_mirrored {
            return Self { is_mirrored, ..self.clone() };
        }
        let here = self.seen_from(DVec2::new(0.0, -self.center.y));
        Self { center: DVec2::new(here.center.x, 0.0), is_mirrored, ..here }.unfolded()
    }

    /// Returns it with the lower half as the upper one is, where it mirrors itself.
    fn unfolded(mut self) -> Self {
        let n = self.rho.len();
        (n / 2 + 1..n).filter(|_| self.is_mirrored).for_each(|i| self.rho[i] = self.rho[n - i]);
        self
    }

    /// The azimuths of which the edge is looked for.
    fn looked_for(&self) -> std::ops::Range<usize> {
        let n = self.rho.len();
        if self.is_mirrored { 0..n / 2 + 1 } else { 0..n }
    }

    /// Returns the places of a mesh's nodes over the region.
    pub(crate) fn nodes(&self, mesh: Mesh) -> Vec<DVec2> {
        let edge = |j: usize| {
            let azimuth = self.azimuths.as_ref().map_or(mesh.azimuth(j as f64), |azimuths| azimuths[2 * j]);
            (DVec2::from_angle(azimuth), self.rho[2 * j])
        };
        let edge: Vec<(DVec2, f64)> = (0..mesh.n_azimuths).map(edge).collect();
        let ring = |ring: usize| {
            let share = mesh.share(ring as f64);
            edge.iter().map(move |(direction, rho)| self.center + *direction * (share * rho))
        };
        std::iter::once(self.center).chain((1..=mesh.n_rings).flat_map(ring)).collect()
    }

    /// The azimuth of every other place of the edge and that of the one after it, of which the last is the first once around.
    pub(crate) fn wedge(&self, mesh: Mesh, j: usize) -> [f64; 2] {
        match &self.azimuths {
            None => [mesh.azimuth(j as f64), mesh.azimuth((j + 1) as f64)],
            Some(azimuths) => {
                let next = 2 * (j + 1);
                [azimuths[2 * j], azimuths.get(next).copied().unwrap_or(azimuths[0] + TAU)]
            }
        }
    }

    /// Whether the azimuths are equally spaced.
    pub(crate) fn is_even(&self) -> bool {
        self.azimuths.is_none()
    }

    /// Returns the edge with the corners that it has moved to every other azimuth, those that a mesh has nodes at; as it is where that
    /// does not succeed.
    ///
    /// The azimuths are equally spaced now. A corner is where the curves through three azimuths on either side meet, to the fourth
    /// power of their distance.
    pub(crate) fn with_corners(self, clearances: Clearances<'_>) -> Self {
        let corners = self.corners();
        if corners.is_empty() || !self.is_even() {
            return self;
        }
        let n = self.rho.len();
        let mut azimuths: Vec<f64> = (0..n).map(|i| self.azimuth(i)).collect();
        let mut rho = self.rho.clone();
        let mut is_taken = vec![false; n];
        for (azimuth, rho_there) in corners {
            let step = 2.0 * TAU / n as f64;
            let turn = (azimuth / step).round();
            let place = 2 * (turn as usize) % n;
            if !std::mem::replace(&mut is_taken[place], true) {
                // Beside 0 it may lie below.
                azimuths[place] = if turn as usize * 2 == n { azimuth - TAU } else { azimuth };
                rho[place] = rho_there;
            }
        }
        for i in (1..n).step_by(2) {
            let next = azimuths.get(i + 1).copied().unwrap_or(azimuths[0] + TAU);
            azimuths[i] = 0.5 * (azimuths[i - 1] + next);
        }
        let moved = Self { center: self.center, rho, azimuths: Some(azimuths), is_mirrored: false };
        moved.refined(clearances, TOLERANCE).unwrap_or(self)
    }

    /// Returns the azimuths and radii of corners that stand out, at which the edge bends outwards.
    fn corners(&self) -> Vec<(f64, f64)> {
        let n = self.rho.len();
        let at = |i: usize, k: isize| (i as isize + k).rem_euclid(n as isize) as usize;
        // One over the radius: of a straight edge a sine, and greater beyond a corner than it would go on.
        let flat: Vec<f64> = self.rho.iter().map(|rho| rho.recip()).collect();
        let bend = |i: usize| flat[at(i, -1)] - 2.0 * flat[i] + flat[at(i, 1)];
        let bends: Vec<f64> = (0..n).map(|i| bend(i) + bend(at(i, 1))).collect();
        let step = TAU / n as f64;
        let corner = |i: usize| {
            let is_least =
                (-3..=3).all(|k| k == 0 || bends[at(i, k)] < bends[i] || (k > 0 && bends[at(i, k)] == bends[i]));
            if !is_least || bends[i] < STANDS_OUT * flat[i] * step {
                return None;
            }
            // Parabolas through three places each, in steps from azimuth i.
            let left = Parabola::through([flat[at(i, -2)], flat[at(i, -1)], flat[i]], -2.0);
            let right = Parabola::through([flat[at(i, 1)], flat[at(i, 2)], flat[at(i, 3)]], 1.0);
            let (mut low, mut high) = (-0.5, 1.5);
            let off = |x: f64| right.at(x) - left.at(x);
            let is_crossing = off(low) > 0.0 && off(high) < 0.0 || off(low) < 0.0 && off(high) > 0.0;
            if !is_crossing {
                return None;
            }
            let sign = off(low).signum();
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                *(if off(middle) * sign > 0.0 { &mut low } else { &mut high }) = middle;
            }
            Some(((self.azimuth(i) + low * step).rem_euclid(TAU), left.at(low).recip()))
        };
        (0..n).filter_map(corner).collect()
    }

    /// Returns the region about its own centroid, its edge moved to where clearances are 0; `None` if that does not converge, as where the center is outside.
    pub(crate) fn settled(&self, clearances: Clearances<'_>) -> Option<Self> {
        const MOST_STEPS: usize = 8;
        // Any three digits of the edge tell where the center is.
        let coarse = 1e-3 * TOLERANCE.sqrt();
        let even = if self.is_even() { self.clone() } else { self.seen_from(DVec2::ZERO) };
        let mut here = even.refined(clearances, coarse)?;
        for _ in 0..MOST_STEPS {
            let (center, radius) = (here.center, here.mean_radius());
            let next = here.recentered();
            if next.center.distance(center) <= OFF_CENTER * radius {
                return next.refined(clearances, TOLERANCE);
            }
            here = next.refined(clearances, coarse)?;
        }
        here.refined(clearances, TOLERANCE)
    }

    pub(crate) fn mean_radius(&self) -> f64 {
        self.rho.iter().sum::<f64>() / self.rho.len() as f64
    }

    fn azimuth(&self, i: usize) -> f64 {
        self.azimuths.as_ref().map_or(TAU * i as f64 / self.rho.len() as f64, |azimuths| azimuths[i])
    }

    /// Returns the same region seen from its centroid, the sum over azimuths of ρ³/3 over that of ρ²/2; its edge by straight lines between what was known.
    fn recentered(self) -> Self {
        let n = self.rho.len();
        let edge: Vec<DVec2> = (0..n).map(|i| polar(DVec2::ZERO, self.rho[i], self.azimuth(i))).collect();
        let area: f64 = self.rho.iter().map(|r| r * r).sum::<f64>() / 2.0;
        let shift = edge.iter().map(|p| *p * (p.length_squared() / 3.0)).sum::<DVec2>() / area;
        self.seen_from(if self.is_mirrored { DVec2::new(shift.x, 0.0) } else { shift })
    }

    /// Returns the same region seen from a place beside the center, at equally spaced azimuths; its edge by straight lines between what
    /// was known.
    fn seen_from(&self, aside: DVec2) -> Self {
        let n = self.rho.len();
        let edge: Vec<DVec2> = (0..n).map(|i| polar(DVec2::ZERO, self.rho[i], self.azimuth(i))).collect();
        let direction = |i: usize| DVec2::from_angle(TAU * i as f64 / n as f64);
        let mut rho = vec![0.0; n];
        self.looked_for().for_each(|i| rho[i] = ray_to_polygon(aside, direction(i), &edge));
        Self { is_mirrored: self.is_mirrored, ..Self::even(self.center + aside, rho) }.unfolded()
    }

    /// Returns the region with its edge moved to where clearances are 0, or `None` if that does not converge.
    fn refined(mut self, clearances: Clearances<'_>, tolerance: f64) -> Option<Self> {
        let n = self.rho.len();
        let center = self.center;
        let directions: Vec<DVec2> = (0..n).map(|i| DVec2::from_angle(self.azimuth(i))).collect();
        let at_center = clearances(&[center])[0];
        if at_center <= 0.0 {
            return None;
        }
        let mut inside = vec![(0.0, at_center); n];
        let mut outside = vec![(f64::INFINITY, f64::NAN); n];
        let mut previous = inside.clone();
        let mut here = self.rho.clone();
        let mut open: Vec<usize> = self.looked_for().collect();
        for _ in 0..60 {
            let places: Vec<DVec2> = open.iter().map(|&i| center + directions[i] * here[i]).collect();
            let mut values = clearances(&places).into_iter();
            open.retain(|&i| {
                let (r, f) = (here[i], values.next().unwrap_or(f64::NAN));
                if f.abs() <= tolerance || outside[i].0 - inside[i].0 <= tolerance {
                    self.rho[i] = if f >= -tolerance { r } else { inside[i].0 };
                    return false;
                }
                if f > 0.0 {
                    inside[i] = (r, f);
                } else {
                    outside[i] = (r, f);
                }
                here[i] = next_guess(previous[i], (r, f), inside[i].0, outside[i].0);
                previous[i] = (r, f);
                true
            });
            if open.is_empty() {
                let found = self.unfolded();
                return found.rho.iter().all(|r| *r > 0.0).then_some(found);
            }
        }
        None
    }
}

/// How sharply an edge must bend to have a corner: the change of its direction, over one radian, at which a mesh would cut a corner by about
/// a hundredth of the radius.
const STANDS_OUT: f64 = 0.15;

/// A parabola.
struct Parabola([f64; 3]);

impl Parabola {
    /// Returns the one through three values a step apart, the first at `x`.
    fn through([a, b, c]: [f64; 3], x: f64) -> Self {
        let (half, bend) = (0.5 * (c - a), 0.5 * (a - 2.0 * b + c));
        let middle = x + 1.0;
        Self([b - half * middle + bend * middle * middle, half - 2.0 * bend * middle, bend])
    }

    fn at(&self, x: f64) -> f64 {
        self.0[0] + x * (self.0[1] + x * self.0[2])
    }
}

/// Returns the next place to look for a root: the secant's, if it stays in the bracket.
fn next_guess((r0, f0): (f64, f64), (r1, f1): (f64, f64), inside: f64, outside: f64) -> f64 {
    let secant = r1 - f1 * (r1 - r0) / (f1 - f0);
    let furthest = if outside.is_finite() { outside } else { 1.5 * r1.max(inside) };
    if secant.is_finite() && secant > inside && secant < furthest {
        secant
    } else if outside.is_finite() {
        0.5 * (inside + outside)
    } else {
        furthest
    }
}

/// Returns how far from `from` a ray leaves a closed polygon that it starts in.
fn ray_to_polygon(from: DVec2, direction: DVec2, polygon: &[DVec2]) -> f64 {
    // On which side of the ray's line a corner is: one sign for both sides of the polygon that meet there.
    let across = |corner: DVec2| direction.perp_dot(corner - from);
    let mut furthest: f64 = 0.0;
    let Some(mut a) = polygon.last().copied() else { return furthest };
    let mut across_a = across(a);
    for &b in polygon {
        let across_b = across(b);
        if (across_a <= 0.0) != (across_b <= 0.0) {
            let place = a + (b - a) * (across_a / (across_a - across_b));
            furthest = furthest.max(direction.dot(place - from));
        }
        (a, across_a) = (b, across_b);
    }
    furthest / direction.length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a disc seen from a place a quarter of its radius off its middle, whatever its size.
    #[test]
    fn the_center_is_the_centroid_of_the_region() {
        for radius in [0.02, 1.0, 30.0] {
            let middle = DVec2::splat(7.0) + radius * DVec2::new(0.15, -0.2);
            let clearances =
                |places: &[DVec2]| places.iter().map(|place| radius - place.distance(middle)).collect::<Vec<f64>>();
            let guess = Outline::even(DVec2::splat(7.0), vec![0.5 * radius; 48]);
            let found = guess.settled(&clearances).unwrap();
            assert!((found.center - middle).length() < 2e-3 * radius, "{found:?}");
            let area: f64 = found.rho.iter().map(|rho| rho * rho).sum::<f64>() / 48.0;
            assert!((area / (radius * radius) - 1.0).abs() < 1e-6 + 1e-7 / radius, "{area}");
            let dark = Outline { center: DVec2::splat(100.0), ..found.clone() };
            assert_eq!(dark.settled(&clearances), None);
            assert_eq!(found.clone().with_corners(&clearances), found);
            // One that mirrors itself is found by half.
            let aside =
                |places: &[DVec2]| places.iter().map(|p| radius - (*p - 0.3 * DVec2::X).length()).collect::<Vec<_>>();
            let half = Outline::even(DVec2::new(0.3, 0.1 * radius), vec![0.5 * radius; 48]).mirrored(true);
            let half = half.settled(&aside).unwrap();
            assert!((half.center - 0.3 * DVec2::X).length() < 2e-3 * radius && half.center.y == 0.0, "{half:?}");
            assert!(half.rho.iter().all(|rho| (rho / radius - 1.0).abs() < 3e-3), "{half:?}");
        }
    }

    /// A regular polygon, turned in small steps: its corners are among the mesh's azimuths, and so the mesh has its area.
    #[test]
    fn corners_are_among_the_azimuths() {
        let mesh = Mesh { n_rings: 4, n_azimuths: 48 };
        for n_sides in [3, 4, 5, 6, 9, 12] {
            for turn in 0..13 {
                let normal = |k: usize| DVec2::from_angle(TAU * k as f64 / n_sides as f64 + 0.031 * f64::from(turn));
                let clearance =
                    |place: &DVec2| (0..n_sides).map(|k| 1.0 - normal(k).dot(*place)).fold(f64::INFINITY, f64::min);
                let clearances = |places: &[DVec2]| places.iter().map(clearance).collect::<Vec<f64>>();
                let found = Outline::even(DVec2::new(0.1, 0.05), vec![0.7; 96]).settled(&clearances).unwrap();
                let found = found.with_corners(&clearances);
                assert!(!found.is_even(), "{n_sides} {turn}");
                let half = TAU / (2.0 * n_sides as f64);
                for k in 0..n_sides {
                    let corner = DVec2::from_angle(TAU * (k as f64 + 0.5) / n_sides as f64 + 0.031 * f64::from(turn));
                    let corner = corner / half.cos();
                    let edge = (0..48).map(|j| polar(found.center, found.rho[2 * j], found.wedge(mesh, j)[0]));
                    let off = edge.map(|place| place.distance(corner)).fold(f64::INFINITY, f64::min);
                    assert!(off < 2e-3, "{n_sides} {turn} {k}: {off}");
                }
                let area: f64 = crate::spots::cell_areas(mesh, &found).iter().sum();
                assert!((area / (n_sides as f64 * half.tan()) - 1.0).abs() < 2e-4, "{n_sides} {turn}: {area}");
            }
        }
    }
}
