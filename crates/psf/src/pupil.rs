//! The outline of a pupil, found from that of a neighboring point.

use glam::DVec2;

use crate::mesh::polar;

/// How near to a rim a pupil's edge must pass, over the scale of clearances: areas are then good to 1e-8.
const TOLERANCE: f64 = 1e-8;
/// How far the center may be from the centroid of the edge about it, as a share of the radius: it is that of the pupil alone, wherever the
/// search began.
const OFF_CENTER: f64 = 2e-3;

/// How far inside the rims rays through these places of a plane stay; below 0 outside.
pub(crate) type Clearances<'a> = &'a dyn Fn(&[DVec2]) -> Vec<f64>;

/// The edge of a region of a plane, at equally spaced azimuths about a center.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outline {
    pub(crate) center: DVec2,
    pub(crate) rho: Vec<f64>,
}

impl Outline {
    /// Returns the region about its own centroid, its edge moved to where clearances are 0; `None` if that does not converge, as where the center is outside.
    pub(crate) fn settled(&self, clearances: Clearances<'_>) -> Option<Self> {
        const MOST_STEPS: usize = 8;
        // Any three digits of the edge tell where the center is.
        let coarse = 1e-3 * TOLERANCE.sqrt();
        let mut here = self.clone().refined(clearances, coarse)?;
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
        std::f64::consts::TAU * i as f64 / self.rho.len() as f64
    }

    /// Returns the same region seen from its centroid, the sum over azimuths of ρ³/3 over that of ρ²/2; its edge by straight lines between what was known.
    fn recentered(self) -> Self {
        let n = self.rho.len();
        let edge: Vec<DVec2> = (0..n).map(|i| polar(DVec2::ZERO, self.rho[i], self.azimuth(i))).collect();
        let area: f64 = self.rho.iter().map(|r| r * r).sum::<f64>() / 2.0;
        let shift = edge.iter().map(|p| *p * (p.length_squared() / 3.0)).sum::<DVec2>() / area;
        let rho = (0..n).map(|i| ray_to_polygon(shift, DVec2::from_angle(self.azimuth(i)), &edge)).collect();
        Self { center: self.center + shift, rho }
    }

    /// Returns the region with its edge moved to where clearances are 0, or `None` if that does not converge.
    fn refined(mut self, clearances: Clearances<'_>, tolerance: f64) -> Option<Self> {
        let n = self.rho.len();
        let center = self.center;
        let azimuths: Vec<f64> = (0..n).map(|i| self.azimuth(i)).collect();
        let at_radii = |rho: &[f64]| -> Vec<f64> {
            let places: Vec<DVec2> = (0..n).map(|i| polar(center, rho[i], azimuths[i])).collect();
            clearances(&places)
        };
        let at_center = clearances(&[center])[0];
        if at_center <= 0.0 {
            return None;
        }
        let mut inside = vec![(0.0, at_center); n];
        let mut outside = vec![(f64::INFINITY, f64::NAN); n];
        let mut previous = inside.clone();
        let mut here = self.rho.clone();
        for _ in 0..60 {
            let values = at_radii(&here);
            let mut is_done = true;
            for i in 0..n {
                let (r, f) = (here[i], values[i]);
                if f.abs() <= tolerance || outside[i].0 - inside[i].0 <= tolerance {
                    self.rho[i] = if f >= -tolerance { r } else { inside[i].0 };
                    continue;
                }
                is_done = false;
                if f > 0.0 {
                    inside[i] = (r, f);
                } else {
                    outside[i] = (r, f);
                }
                here[i] = next_guess(previous[i], (r, f), inside[i].0, outside[i].0);
                previous[i] = (r, f);
            }
            if is_done {
                return self.rho.iter().all(|r| *r > 0.0).then_some(self);
            }
        }
        None
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
            let guess = Outline { center: DVec2::splat(7.0), rho: vec![0.5 * radius; 48] };
            let found = guess.settled(&clearances).unwrap();
            assert!((found.center - middle).length() < 2e-3 * radius, "{found:?}");
            let area: f64 = found.rho.iter().map(|rho| rho * rho).sum::<f64>() / 48.0;
            assert!((area / (radius * radius) - 1.0).abs() < 1e-6 + 1e-7 / radius, "{area}");
            let dark = Outline { center: DVec2::splat(100.0), ..found };
            assert_eq!(dark.settled(&clearances), None);
        }
    }
}
