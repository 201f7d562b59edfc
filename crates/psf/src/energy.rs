//! Energy within circles and squares about the centroid of a picture.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec2;

use crate::Picture;

/// The outline within which energy is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outline {
    Circle,
    Square,
}

/// How the energy of a picture grows within circles or squares about its centroid: made once by
/// [`Picture::encircled`] or [`Picture::ensquared`], then read at any size.
#[derive(Clone, Debug)]
pub struct EnclosedEnergy {
    // Invariants: `pixels` are grouped by rings half a pixel wide; `starts` and `sums` have one number more than there
    // are rings, the pixels and the energy before each.
    outline: Outline,
    pitch_um: f64,
    pixels: Vec<Pixel>,
    starts: Vec<usize>,
    sums: Vec<f64>,
    /// What stands for a share that is never reached, µm.
    beyond_um: f64,
}

/// A lit pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    from_center_um: DVec2,
    energy: f64,
}

impl EnclosedEnergy {
    fn new(picture: &Picture, outline: Outline) -> Self {
        let (center, pitch_um) = (picture.centroid_um(), picture.pitch_um());
        let ring = |p: DVec2| {
            let distance_um = match outline {
                Outline::Circle => p.length(),
                Outline::Square => p.abs().max_element(),
            };
            (2.0 * distance_um / pitch_um) as usize
        };
        let lit = || {
            let pixels = picture.energy().indexed_iter().filter(|(_, e)| **e != 0.0);
            pixels.map(|((row, column), &energy)| Pixel { from_center_um: picture.at_um(row, column) - center, energy })
        };
        let mut starts = vec![0];
        let mut sums = vec![0.0];
        for pixel in lit() {
            let last = ring(pixel.from_center_um) + 1;
            if starts.len() <= last {
                starts.resize(last + 1, 0);
                sums.resize(last + 1, 0.0);
            }
            starts[last] += 1;
            sums[last] += pixel.energy;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
            sums[i] += sums[i - 1];
        }
        let mut pixels = vec![Pixel::default(); starts[starts.len() - 1]];
        let mut next = starts.clone();
        for pixel in lit() {
            let place = &mut next[ring(pixel.from_center_um)];
            pixels[*place] = pixel;
            *place += 1;
        }
        let (rows, columns) = picture.energy().dim();
        Self { outline, pitch_um, pixels, starts, sums, beyond_um: pitch_um * (rows + columns) as f64 }
    }

    /// How much nearer or farther than its middle a pixel's energy may lie, µm.
    fn slack_um(&self) -> f64 {
        match self.outline {
            Outline::Circle => self.pitch_um * FRAC_1_SQRT_2,
            Outline::Square => 0.5 * self.pitch_um,
        }
    }

    /// Returns the share of the energy within a circle of this radius, or a square of this half-side, µm.
    pub fn within(&self, reach_um: f64) -> f64 {
        let n_rings = self.starts.len() - 1;
        let rings = |reach_um: f64| (2.0 * reach_um / self.pitch_um).max(0.0);
        // Rounding must not take a pixel that is cut for a whole one, or for none.
        let whole = ((rings(reach_um - self.slack_um()) - 1e-9).max(0.0).floor() as usize).min(n_rings);
        let touched = ((rings(reach_um + self.slack_um()) + 1e-9).ceil() as usize).clamp(whole, n_rings);
        let share = |from_center: DVec2| match self.outline {
            Outline::Circle => share_in_circle(from_center, self.pitch_um, reach_um),
            Outline::Square => share_in_square(from_center, self.pitch_um, reach_um),
        };
        let cut = &self.pixels[self.starts[whole]..self.starts[touched]];
        self.sums[whole] + cut.iter().map(|pixel| pixel.energy * share(pixel.from_center_um)).sum::<f64>()
    }

    /// Returns the radius of the circle, or the half-side of the square, that holds this share of the energy, µm; the
    /// sum of both sides of the picture where nothing does.
    pub fn reach_um(&self, share: f64) -> f64 {
        // What lies within a reach is at most the pixels whose middles are the slack further out, and at least those
        // the slack further in; so it lies about where the sum of whole rings reaches the share.
        let reached = self.sums[1..].partition_point(|sum| *sum < share);
        if reached + 1 == self.starts.len() {
            return self.beyond_um;
        }
        let edge = |ring: usize| 0.5 * self.pitch_um * ring as f64;
        let (mut low, mut high) = ((edge(reached) - self.slack_um()).max(0.0), edge(reached + 1) + self.slack_um());
        // To 1e-12 of a few pixels.
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if self.within(middle) < share {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

impl Picture {
    /// Returns the energy within circles about the centroid.
    pub fn encircled(&self) -> EnclosedEnergy {
        EnclosedEnergy::new(self, Outline::Circle)
    }

    /// Returns the energy within squares about the centroid, their sides along rows and columns.
    pub fn ensquared(&self) -> EnclosedEnergy {
        EnclosedEnergy::new(self, Outline::Square)
    }

    /// Returns the share of the energy within `radius_um` of the centroid.
    pub fn encircled_energy(&self, radius_um: f64) -> f64 {
        self.encircled().within(radius_um)
    }

    /// Returns the radius about the centroid that holds `share` of the energy, µm.
    pub fn energy_radius_um(&self, share: f64) -> f64 {
        self.encircled().reach_um(share)
    }

    /// Returns the share of the energy in a square of half-side `half_side_um` about the centroid.
    pub fn ensquared_energy(&self, half_side_um: f64) -> f64 {
        self.ensquared().within(half_side_um)
    }

    /// Returns half the side of the square about the centroid that holds `share` of the energy, µm.
    pub fn energy_half_side_um(&self, share: f64) -> f64 {
        self.ensquared().reach_um(share)
    }
}

/// Returns the share of a square about `center` that lies within a circle about the origin.
fn share_in_circle(center: DVec2, side: f64, radius: f64) -> f64 {
    let (distance, half_diagonal) = (center.length(), side * FRAC_1_SQRT_2);
    if distance + half_diagonal <= radius {
        return 1.0;
    }
    if distance - half_diagonal >= radius {
        return 0.0;
    }
    let n = 16;
    let inside = |i: i32| {
        let at = |k: i32| side * ((f64::from(k) + 0.5) / f64::from(n) - 0.5);
        let x = center.x + at(i);
        // Exact along one direction, the midpoint rule along the other.
        let reach = (radius * radius - x * x).max(0.0).sqrt();
        let (low, high) = (center.y - 0.5 * side, center.y + 0.5 * side);
        (high.min(reach) - low.max(-reach)).max(0.0) / side
    };
    (0..n).map(inside).sum::<f64>() / f64::from(n)
}

/// Returns the share of a square about `center` that lies within a larger or smaller one about the origin.
fn share_in_square(center: DVec2, side: f64, half_side: f64) -> f64 {
    let overlap = |at: f64| ((at + 0.5 * side).min(half_side) - (at - 0.5 * side).max(-half_side)).max(0.0) / side;
    overlap(center.x) * overlap(center.y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use approx::assert_abs_diff_eq;
    use ndarray::Array2;

    use super::*;
    use crate::metrics::tests::gaussian;

    #[test]
    fn even_energy_fills_circles_and_squares_by_area() {
        let picture = Picture::new(Array2::from_elem((40, 40), 1.0).view(), 1.0);
        assert_abs_diff_eq!(picture.encircled_energy(10.0), PI * 100.0 / 1600.0, epsilon = 1e-4);
        assert_abs_diff_eq!(picture.ensquared_energy(7.25), 14.5 * 14.5 / 1600.0, epsilon = 1e-12);
        assert_abs_diff_eq!(picture.energy_half_side_um(0.25), 10.0, epsilon = 1e-9);
        assert_eq!(picture.energy_half_side_um(1.1), 80.0);
    }

    #[test]
    fn the_reach_of_a_share_holds_that_share() {
        for sigma in [0.3, 3.0, 12.0] {
            let picture = gaussian(sigma, DVec2::new(50.2, 49.1));
            for enclosed in [picture.encircled(), picture.ensquared()] {
                for share in [0.1, 0.5, 0.8, 0.95] {
                    // Bisection to the last bits; the sixteenfold midpoint rule makes the energy all but continuous.
                    assert_abs_diff_eq!(enclosed.within(enclosed.reach_um(share)), share, epsilon = 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_gaussian_fills_a_square_as_the_error_function_says() {
        let picture = gaussian(9.0, DVec2::splat(50.5));
        // erf(h / √2 σ)² is a half at h = 1.0517 σ; σ is 18 µm, to which pixels add a twelfth of 4 µm² in square.
        assert_abs_diff_eq!(picture.energy_half_side_um(0.5), 1.0517 * 18.009, epsilon = 0.03);
    }
}
