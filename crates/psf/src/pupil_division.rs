//! A division of the pupil in parts that overlap smoothly.

use glam::DVec2;

use crate::mesh::polar;

/// Points of the unit disc over which the centers of parts are spread.
const N_POINTS: usize = 4000;
/// Rounds of moving each center to the middle of what is nearest to it.
const N_ROUNDS: usize = 60;
/// How far a part reaches from its center, over the farthest that any point lies from the nearest center.
const REACH: f64 = 1.3;

/// Parts of a pupil about evenly spread centers. At each place their shares sum to 1, and each falls to 0 smoothly.
///
/// Places are those of the unit disc onto which the pupil of each field is mapped: x right and y up as seen from the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilDivision {
    centers: Vec<DVec2>,
    reach: f64,
}

impl PupilDivision {
    /// Divides the pupil in so many parts, at least one.
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
        Self { centers, reach: REACH * farthest.sqrt() }
    }

    /// The number of parts.
    pub fn n_parts(&self) -> usize {
        self.centers.len()
    }

    /// Returns the share of the light at a place that goes through a part.
    pub fn share(&self, part: usize, at: DVec2) -> f64 {
        let bump = |center: &DVec2| {
            let inner = 1.0 - at.distance_squared(*center) / (self.reach * self.reach);
            if inner > 0.0 { inner * inner } else { 0.0 }
        };
        let own = bump(&self.centers[part]);
        if own == 0.0 { 0.0 } else { own / self.centers.iter().map(bump).sum::<f64>() }
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
}
