//! The knots of one axis of the bank, and interpolation between them.

use serde::{Deserialize, Serialize};

/// Ascending places at which something is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Axis {
    // Invariant: at least one knot, ascending.
    knots: Vec<f64>,
}

/// Up to four knots and their weights, whose sum is 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stencil {
    n: usize,
    first: usize,
    weights: [f64; 4],
}

impl Axis {
    /// Returns an axis on these knots, or `None` if they do not ascend or there are none.
    pub(crate) fn new(knots: Vec<f64>) -> Option<Self> {
        let ascends = knots.windows(2).all(|pair| pair[0] < pair[1]);
        (ascends && !knots.is_empty() && knots.iter().all(|k| k.is_finite())).then_some(Self { knots })
    }

    pub(crate) fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Returns Lagrange's quadratic weights of the three knots nearest to a place, which is moved into the axis.
    ///
    /// On a knot, that knot alone has a weight; on an axis of two knots it is linear, on one constant.
    pub(crate) fn stencil(&self, at: f64) -> Stencil {
        let n = self.knots.len();
        let at = at.clamp(self.knots[0], self.knots[n - 1]);
        if n <= 2 {
            return self.linear(at);
        }
        let above = self.knots.partition_point(|&k| k < at).clamp(1, n - 1);
        let nearest = if at - self.knots[above - 1] < self.knots[above] - at { above - 1 } else { above };
        let first = nearest.saturating_sub(1).min(n - 3);
        let k = &self.knots[first..first + 3];
        let weight = |i: usize, j: usize, l: usize| (at - k[j]) * (at - k[l]) / ((k[i] - k[j]) * (k[i] - k[l]));
        Stencil { n: 3, first, weights: [weight(0, 1, 2), weight(1, 0, 2), weight(2, 0, 1), 0.0] }
    }

    /// Returns Lagrange's cubic weights of the two knots on each side of a place, which is moved into the axis; on an
    /// axis of fewer than four knots those of [`stencil`](Self::stencil).
    pub(crate) fn cubic(&self, at: f64) -> Stencil {
        let n = self.knots.len();
        if n < 4 {
            return self.stencil(at);
        }
        let at = at.clamp(self.knots[0], self.knots[n - 1]);
        let first = self.knots.partition_point(|&k| k < at).saturating_sub(2).min(n - 4);
        let k = &self.knots[first..first + 4];
        let weight = |i: usize| {
            let others = (0..4).filter(|j| *j != i);
            others.map(|j| (at - k[j]) / (k[i] - k[j])).product()
        };
        Stencil { n: 4, first, weights: std::array::from_fn(weight) }
    }

    /// Returns the weights of the straight line between the knots on both sides of a place, which is moved into the axis.
    pub(crate) fn linear(&self, at: f64) -> Stencil {
        let n = self.knots.len();
        let at = at.clamp(self.knots[0], self.knots[n - 1]);
        if n == 1 {
            return Stencil { n: 1, first: 0, weights: [1.0, 0.0, 0.0, 0.0] };
        }
        let first = self.knots.partition_point(|&k| k < at).clamp(1, n - 1) - 1;
        let fraction = (at - self.knots[first]) / (self.knots[first + 1] - self.knots[first]);
        Stencil { n: 2, first, weights: [1.0 - fraction, fraction, 0.0, 0.0] }
    }

    /// Returns Lagrange's weights of the value and of its slope at a place, from the up to four knots about it: cubic on
    /// an axis of four knots or more. Beyond the axis the polynomial goes on.
    pub(crate) fn value_and_slope(&self, at: f64) -> [Stencil; 2] {
        let n = self.knots.len().min(4);
        let first = self.knots.partition_point(|&k| k < at).saturating_sub(n.div_ceil(2)).min(self.knots.len() - n);
        let k = &self.knots[first..first + n];
        let (mut value, mut slope) = ([0.0; 4], [0.0; 4]);
        for i in 0..n {
            let others = || (0..n).filter(move |j| *j != i);
            value[i] = others().map(|j| (at - k[j]) / (k[i] - k[j])).product();
            // The product rule, factor by factor.
            slope[i] = others()
                .map(|m| {
                    let rest = others().filter(|j| *j != m).map(|j| (at - k[j]) / (k[i] - k[j]));
                    rest.product::<f64>() / (k[i] - k[m])
                })
                .sum();
        }
        [value, slope].map(|weights| Stencil { n, first, weights })
    }
}

impl Stencil {
    /// The knots whose weight is not 0, with their weights.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.n).map(|i| (self.first + i, self.weights[i])).filter(|(_, weight)| *weight != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratics_are_met_exactly() {
        let axis = Axis::new(vec![0.0, 0.5, 1.5, 2.0, 4.0]).unwrap();
        let f = |x: f64| 3.0 - x + 0.7 * x * x;
        for x in [0.0, 0.1, 0.5, 0.9, 1.7, 2.9, 3.9, 4.0] {
            let value: f64 = axis.stencil(x).iter().map(|(i, w)| w * f(axis.knots()[i])).sum();
            assert!((value - f(x)).abs() < 1e-13, "at {x}: {value}");
        }
        assert_eq!(axis.stencil(1.5).iter().collect::<Vec<_>>(), [(2, 1.0)]);
    }

    #[test]
    fn cubics_are_met_exactly() {
        let axis = Axis::new(vec![0.0, 0.5, 1.5, 2.0, 4.0]).unwrap();
        let f = |x: f64| 3.0 - x + 0.7 * x * x - 0.3 * x.powi(3);
        for x in [0.0, 0.1, 0.5, 0.9, 1.7, 2.9, 3.9, 4.0] {
            let value: f64 = axis.cubic(x).iter().map(|(i, w)| w * f(axis.knots()[i])).sum();
            assert!((value - f(x)).abs() < 1e-12, "at {x}: {value}");
        }
        assert_eq!(axis.cubic(2.0).iter().collect::<Vec<_>>(), [(3, 1.0)]);
        let few = Axis::new(vec![0.0, 1.0, 2.0]).unwrap();
        assert_eq!(few.cubic(0.3), few.stencil(0.3));
    }

    #[test]
    fn cubics_have_their_slopes_and_go_on() {
        let axis = Axis::new(vec![0.0, 0.5, 1.5, 2.0, 4.0]).unwrap();
        let f = |x: f64| 3.0 - x + 0.7 * x * x - 0.3 * x.powi(3);
        for x in [-0.3, 0.0, 0.1, 0.5, 1.7, 4.0, 4.4] {
            let [value, slope] =
                axis.value_and_slope(x).map(|stencil| stencil.iter().map(|(i, w)| w * f(axis.knots()[i])).sum::<f64>());
            assert!((value - f(x)).abs() < 1e-12, "at {x}: {value}");
            assert!((slope - (-1.0 + 1.4 * x - 0.9 * x * x)).abs() < 1e-12, "at {x}: {slope}");
        }
        let two = Axis::new(vec![1.0, 3.0]).unwrap();
        let [value, slope] = two.value_and_slope(1.5).map(|stencil| stencil.iter().collect::<Vec<_>>());
        assert_eq!((value, slope), (vec![(0, 0.75), (1, 0.25)], vec![(0, -0.5), (1, 0.5)]));
    }

    #[test]
    fn places_off_the_axis_are_moved_to_its_end() {
        let axis = Axis::new(vec![1.0, 2.0]).unwrap();
        assert_eq!(axis.stencil(9.0).iter().collect::<Vec<_>>(), [(1, 1.0)]);
        assert_eq!(axis.stencil(1.25).iter().collect::<Vec<_>>(), [(0, 0.75), (1, 0.25)]);
        assert_eq!(Axis::new(vec![7.0]).unwrap().stencil(3.0).iter().collect::<Vec<_>>(), [(0, 1.0)]);
        assert!(Axis::new(vec![]).is_none() && Axis::new(vec![1.0, 1.0]).is_none());
    }
}
