//! Divisions of the pupil: in parts that overlap smoothly, or among the photodiodes below a microlens.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use glam::DVec2;

use crate::mesh::{Mesh, polar};

/// Points of the unit disc over which the centers of parts are spread.
const N_POINTS: usize = 4000;
/// Rounds of moving each center to the middle of what is nearest to it.
const N_ROUNDS: usize = 60;
/// How far a part reaches from its center, over the farthest that any point lies from the nearest center.
const REACH: f64 = 1.3;
/// Rings, and azimuths of half a turn, of the sum over the disc that gives the centroid of a part.
const N_RINGS: usize = 400;

/// Parts of a pupil. At each place their shares sum to 1.
///
/// Places are those of the unit disc onto which the pupil of each field is mapped: x right and y up as the photographer sees the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilDivision(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// Parts about evenly spread centers; each falls to 0 smoothly.
    Even { centers: Vec<DVec2>, reach: f64 },
    /// Halves or quarters.
    Sides(PupilSides),
}

/// Which sides of the pupil the photodiodes below one microlens see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Left, right.
    LeftRight,
    /// Top, bottom.
    TopBottom,
    /// Top left, top right, bottom left, bottom right.
    Quarters,
}

/// How the photodiodes below one microlens share the pupil.
///
/// Across each boundary the share of a side runs from c to 1 − c as c + (1 − 2 c) Φ(x / t), with Φ the normal distribution and x the distance
/// from the boundary in radii of the pupil: c is what the photodiode of the other side gets of light far from the boundary, t how soft
/// the boundary is, as diffraction at the microlens and its defocus make it. All light arrives at one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PupilSides {
    /// Which sides.
    pub sides: Sides,
    /// The share of light from far on one side that the photodiode of the other side gets, 0 to .5.
    pub crosstalk: f64,
    /// Standard deviation of the boundary, radii of the pupil; 0 for a sharp one.
    pub transition: f64,
}

impl PupilSides {
    /// Returns the share of the light on the positive side of a boundary.
    fn share_beyond(&self, x: f64) -> f64 {
        let passed = match self.transition > 0.0 {
            true => 0.5 * libm::erfc(-x / self.transition * FRAC_1_SQRT_2),
            false if x == 0.0 => 0.5,
            false => f64::from(u8::from(x > 0.0)),
        };
        self.crosstalk + (1.0 - 2.0 * self.crosstalk) * passed
    }

    fn share(&self, part: usize, at: DVec2) -> f64 {
        let [left, right, top, bottom] = [-at.x, at.x, at.y, -at.y].map(|x| self.share_beyond(x));
        match (self.sides, part) {
            (Sides::LeftRight, 0) => left,
            (Sides::LeftRight, _) => right,
            (Sides::TopBottom, 0) => top,
            (Sides::TopBottom, _) => bottom,
            (Sides::Quarters, 0) => top * left,
            (Sides::Quarters, 1) => top * right,
            (Sides::Quarters, 2) => bottom * left,
            (Sides::Quarters, _) => bottom * right,
        }
    }
}

impl From<PupilSides> for PupilDivision {
    fn from(sides: PupilSides) -> Self {
        Self(Kind::Sides(sides))
    }
}

impl PupilDivision {
    /// Divides the pupil in so many parts of about the same shape, at least one, which overlap smoothly.
    pub fn new(n_parts: usize) -> Self {
        let points = spiral(N_POINTS);
        let mut centers = spiral(n_parts.max(1));
        for _ in 0..N_ROUNDS {
            let mut sums = vec![(DVec2::ZERO, 0.0); centers.len()];
            for &point in &points {
                let (sum, n) = &mut sums[nearest(&centers, point).0];
                *sum += point;
                *n += 1.0;
            }
            for (center, (sum, n)) in centers.iter_mut().zip(sums) {
                *center = sum / f64::max(n, 1.0);
            }
        }
        let farthest = points.iter().map(|&point| nearest(&centers, point).1).fold(0.0, f64::max);
        Self(Kind::Even { centers, reach: REACH * farthest.sqrt() })
    }

    /// The number of parts.
    pub fn n_parts(&self) -> usize {
        match &self.0 {
            Kind::Even { centers, .. } => centers.len(),
            Kind::Sides(PupilSides { sides: Sides::Quarters, .. }) => 4,
            Kind::Sides(_) => 2,
        }
    }

    /// Returns the share of the light at a place that goes through a part.
    pub fn share(&self, part: usize, at: DVec2) -> f64 {
        match &self.0 {
            Kind::Even { centers, reach } => {
                let bump = |center: &DVec2| {
                    let inner = 1.0 - at.distance_squared(*center) / (reach * reach);
                    if inner > 0.0 { inner * inner } else { 0.0 }
                };
                let own = bump(&centers[part]);
                if own == 0.0 { 0.0 } else { own / centers.iter().map(bump).sum::<f64>() }
            }
            Kind::Sides(sides) => sides.share(part, at),
        }
    }

    /// Returns the centroid of the light of a part where the disc is lit evenly, radii of the pupil.
    ///
    /// Of a half without crosstalk it lies 4/(3π) from the boundary.
    pub fn centroid(&self, part: usize) -> DVec2 {
        let (mut sum, mut weight) = (DVec2::ZERO, 0.0);
        for ring in 0..N_RINGS {
            let radius = (ring as f64 + 0.5) / N_RINGS as f64;
            for azimuth in 0..2 * N_RINGS {
                let at = polar(DVec2::ZERO, radius, 0.5 * TAU * (azimuth as f64 + 0.5) / N_RINGS as f64);
                let share = radius * self.share(part, at);
                sum += share * at;
                weight += share;
            }
        }
        sum / weight
    }

    /// Returns the shares that a part has of the light of the cells of a mesh, which is turned by an angle, given as its unit vector.
    pub(crate) fn cell_shares(&self, part: usize, mesh: Mesh, turn: DVec2) -> Vec<f64> {
        let n_across = match &self.0 {
            // Smooth over many cells.
            Kind::Even { .. } => 1,
            Kind::Sides(PupilSides { transition, .. }) if *transition > 0.1 => 2,
            Kind::Sides(_) => 4,
        };
        mesh.cell_means(n_across, |at| self.share(part, turn.rotate(at)))
    }
}

/// Returns points that are evenly spread over the unit disc, on Vogel's spiral.
fn spiral(n: usize) -> Vec<DVec2> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..n).map(|i| polar(DVec2::ZERO, ((i as f64 + 0.5) / n as f64).sqrt(), golden_angle * i as f64)).collect()
}

/// Returns the center nearest to a point, and the square of its distance.
fn nearest(centers: &[DVec2], point: DVec2) -> (usize, f64) {
    let squares = centers.iter().map(|center| center.distance_squared(point)).enumerate();
    squares.min_by(|a, b| a.1.total_cmp(&b.1)).expect("at least one part")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_are_alike() {
        for n_parts in [1, 2, 7, 16, 64] {
            let division = PupilDivision::new(n_parts);
            assert_eq!(division.n_parts(), n_parts);
            let points = spiral(3001);
            let mut of_parts = vec![0.0; n_parts];
            for &at in &points {
                let shares: Vec<f64> = (0..n_parts).map(|part| division.share(part, at)).collect();
                assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{n_parts} parts at {at}");
                of_parts.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share / points.len() as f64);
            }
            let even = 1.0 / n_parts as f64;
            assert!(of_parts.iter().all(|share| (0.6 * even..1.5 * even).contains(share)), "{of_parts:?}");
        }
    }

    /// Neither a share nor its slope has a step, so that pictures through parts have none where fields turn.
    #[test]
    fn shares_change_smoothly() {
        let division = PupilDivision::new(16);
        let step = 1e-3;
        for part in 0..16 {
            for line in 0..9 {
                let at = |i: i32| DVec2::new(f64::from(i) * step - 1.0, 0.2 * f64::from(line) - 0.8);
                for i in (1..1999).filter(|&i| at(i).length() < 1.0 - step) {
                    let [a, b, c] = [i - 1, i, i + 1].map(|i| division.share(part, at(i)));
                    // The slope is below 12 and its change below 200, a unit of the pupil's radius.
                    assert!((c - b).abs() < 12.0 * step && (a - 2.0 * b + c).abs() < 200.0 * step * step);
                }
            }
        }
    }

    fn sides(sides: Sides, crosstalk: f64, transition: f64) -> PupilDivision {
        PupilSides { sides, crosstalk, transition }.into()
    }

    #[test]
    fn photodiodes_share_all_light() {
        for (of, n_parts) in [(Sides::LeftRight, 2), (Sides::TopBottom, 2), (Sides::Quarters, 4)] {
            for (crosstalk, transition) in [(0.0, 0.0), (0.1, 0.0), (0.0, 0.3), (0.07, 0.2)] {
                let division = sides(of, crosstalk, transition);
                assert_eq!(division.n_parts(), n_parts);
                for at in spiral(1000) {
                    let sum: f64 = (0..n_parts).map(|part| division.share(part, at)).sum();
                    assert!((sum - 1.0).abs() < 4.0 * f64::EPSILON, "{of:?} at {at}: {sum}");
                }
            }
        }
    }

    /// A half disc has its centroid at 4/(3π). Crosstalk c takes the part 2 c of that away. A boundary as wide as the pupil, t ≫ 1, leaves
    /// a share of ½ + x/(t √(2π)), whose centroid is at ⟨x²⟩ · 2/(t √(2π)) with ⟨x²⟩ = ¼.
    #[test]
    fn centroids_are_those_of_half_discs() {
        let half = 4.0 / (3.0 * std::f64::consts::PI);
        let check = |crosstalk: f64, transition: f64, expected: f64, tolerance: f64| {
            for (of, part, way) in [
                (Sides::LeftRight, 0, -DVec2::X),
                (Sides::LeftRight, 1, DVec2::X),
                (Sides::TopBottom, 0, DVec2::Y),
                (Sides::TopBottom, 1, -DVec2::Y),
            ] {
                let found = sides(of, crosstalk, transition).centroid(part);
                assert!((found - expected * way).length() < tolerance * expected, "{found} {expected}");
            }
        };
        // Midpoints over 400 rings: 1e-5.
        check(0.0, 0.0, half, 1e-5);
        check(0.1, 0.0, 0.8 * half, 1e-5);
        // The next term of Φ is (x/t)²/6 of the first.
        check(0.0, 20.0, 0.5 / (20.0 * TAU.sqrt()), 1e-3);
        let quarter = sides(Sides::Quarters, 0.0, 0.0).centroid(1);
        assert!((quarter - DVec2::splat(half)).length() < 1e-5, "{quarter}");
    }
}
