//! Smooth functions over a pupil that is symmetric about its x axis: polynomials, by radius and azimuth.

use std::sync::LazyLock;

use multiversion::multiversion;

/// The highest power of the radius.
pub(super) const DEGREE: usize = 12;

/// Whether a function stays the same or changes its sign when the pupil is mirrored in its x axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parity {
    Even,
    Odd,
}

impl Parity {
    /// The azimuthal orders and powers of the radius of all terms, in the order of their coefficients.
    fn terms(self) -> &'static [(usize, usize)] {
        static EVEN: LazyLock<Vec<(usize, usize)>> = LazyLock::new(|| list(0));
        static ODD: LazyLock<Vec<(usize, usize)>> = LazyLock::new(|| list(1));
        fn list(least: usize) -> Vec<(usize, usize)> {
            let orders = |k: usize| (0..=k).filter(move |m| *m >= least && (k - m).is_multiple_of(2));
            (0..=DEGREE).flat_map(|k| orders(k).map(move |m| (m, k))).collect()
        }
        match self {
            Self::Even => &EVEN,
            Self::Odd => &ODD,
        }
    }

    /// The number of terms.
    pub(super) fn n_terms(self) -> usize {
        self.terms().len()
    }
}

/// Coefficients of the powers of the radius along one azimuth.
pub(super) type Ray = [f64; DEGREE + 1];

/// Cosines and sines of the multiples of an azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Azimuth {
    cos: Ray,
    sin: Ray,
}

impl Azimuth {
    /// Returns those of the azimuth with this cosine and sine.
    pub(super) fn new(c: f64, s: f64) -> Self {
        let (mut cos, mut sin) = ([1.0; DEGREE + 1], [0.0; DEGREE + 1]);
        for m in 1..=DEGREE {
            cos[m] = cos[m - 1] * c - sin[m - 1] * s;
            sin[m] = sin[m - 1] * c + cos[m - 1] * s;
        }
        Self { cos, sin }
    }

    /// Returns a function along this azimuth.
    pub(super) fn value(&self, parity: Parity, coefficients: &[f64]) -> Ray {
        let of = if parity == Parity::Even { &self.cos } else { &self.sin };
        let mut ray = [0.0; DEGREE + 1];
        for (&(m, k), c) in parity.terms().iter().zip(coefficients) {
            ray[k] += c * of[m];
        }
        ray
    }

    /// Returns the derivative of a function by the azimuth.
    pub(super) fn slope(&self, parity: Parity, coefficients: &[f64]) -> Ray {
        let (of, sign) = if parity == Parity::Even { (&self.sin, -1.0) } else { (&self.cos, 1.0) };
        let mut ray = [0.0; DEGREE + 1];
        for (&(m, k), c) in parity.terms().iter().zip(coefficients) {
            ray[k] += sign * m as f64 * c * of[m];
        }
        ray
    }
}

/// Returns the derivative of a function along an azimuth by the radius.
pub(super) fn radial_slope(ray: &Ray) -> Ray {
    std::array::from_fn(|k| if k < DEGREE { (k + 1) as f64 * ray[k + 1] } else { 0.0 })
}

/// Places to which functions are fitted, with weights: polar places in the half of the pupil at azimuths of 0 to π.
pub(super) struct Places {
    /// Radius, azimuth and weight of each.
    pub(super) polar: Vec<(f64, Azimuth, f64)>,
}

/// Places that are fitted together.
const LANES: usize = 4;
/// The number of even terms, of which there are more than of odd ones, rounded up to whole [`LANES`]: to each power k of the
/// radius belong k/2 + 1.
const MOST_TERMS: usize = {
    let (mut n, mut k) = (0, 0);
    while k <= DEGREE {
        n += k / 2 + 1;
        k += 1;
    }
    n.next_multiple_of(LANES)
};
/// The terms at places, each place a row.
type Basis = [[f64; MOST_TERMS]; LANES];

impl Places {
    /// Returns the coefficients of the functions of one parity that meet these values best, each list a function;
    /// `None` where the places do not determine the terms.
    pub(super) fn fit<const N: usize>(&self, parity: Parity, values: [&[f64]; N]) -> Option<[Vec<f64>; N]> {
        // Zernike's polynomials are nearly orthogonal over a pupil that nearly fills the disc; powers are not.
        let n = parity.n_terms();
        let mut gram = vec![0.0; n * MOST_TERMS];
        let mut right = [[0.0; MOST_TERMS]; N];
        for (group, places) in self.polar.chunks(LANES).enumerate() {
            let (mut basis, mut weighted) = ([[0.0; MOST_TERMS]; LANES], [[0.0; LANES]; N]);
            for (lane, (.., weight)) in places.iter().enumerate() {
                for (weighted, values) in weighted.iter_mut().zip(values) {
                    weighted[lane] = weight * values[group * LANES + lane];
                }
            }
            fill(&mut basis, parity, zernikes(parity), places);
            add_products(&mut gram, &basis, places);
            for (right, weighted) in right.iter_mut().zip(weighted) {
                add_sums(right, &basis, weighted);
            }
        }
        let mut gram: Vec<f64> = gram.chunks_exact(MOST_TERMS).flat_map(|row| row[..n].iter().copied()).collect();
        factor(&mut gram, n)?;
        Some(right.map(|mut right| {
            solve(&gram, n, &mut right[..n]);
            as_powers(parity, &right[..n])
        }))
    }
}

/// Sets the terms at up to four places, those of the others to 0.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn fill(basis: &mut Basis, parity: Parity, zernikes: &[Vec<(usize, f64)>], places: &[(f64, Azimuth, f64)]) {
    let mut angular = [[0.0; LANES]; DEGREE + 1];
    let mut powers = [[0.0; LANES]; DEGREE + 1];
    for (lane, (radius, azimuth, _)) in places.iter().enumerate() {
        let of = if parity == Parity::Even { &azimuth.cos } else { &azimuth.sin };
        let mut power = 1.0;
        for k in 0..=DEGREE {
            (angular[k][lane], powers[k][lane]) = (of[k], power);
            power *= radius;
        }
    }
    for (term, (zernike, (m, _))) in zernikes.iter().zip(parity.terms()).enumerate() {
        let mut values = [0.0; LANES];
        for (k, c) in zernike {
            for (value, power) in values.iter_mut().zip(&powers[*k]) {
                *value += c * power;
            }
        }
        for ((row, value), angular) in basis.iter_mut().zip(values).zip(angular[*m]) {
            row[term] = value * angular;
        }
    }
}

/// Adds the products of terms, times the places' weights, to the lower triangle of a matrix; something may be added above it.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_products(gram: &mut [f64], basis: &Basis, places: &[(f64, Azimuth, f64)]) {
    let mut weights = [0.0; LANES];
    for (weight, (.., of_place)) in weights.iter_mut().zip(places) {
        *weight = *of_place;
    }
    let [b0, b1, b2, b3] = basis;
    for (i, row) in gram.chunks_exact_mut(MOST_TERMS).enumerate() {
        let [w0, w1, w2, w3] = std::array::from_fn(|lane| basis[lane][i] * weights[lane]);
        let n = (i + 1).next_multiple_of(LANES).min(MOST_TERMS);
        for ((((sum, b0), b1), b2), b3) in row[..n].iter_mut().zip(&b0[..n]).zip(&b1[..n]).zip(&b2[..n]).zip(&b3[..n]) {
            *sum += (w0 * b0 + w1 * b1) + (w2 * b2 + w3 * b3);
        }
    }
}

/// Adds the sums over places of a function, times the places' weights, and the terms.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_sums(sums: &mut [f64; MOST_TERMS], [b0, b1, b2, b3]: &Basis, [w0, w1, w2, w3]: [f64; LANES]) {
    for ((((sum, b0), b1), b2), b3) in sums.iter_mut().zip(b0).zip(b1).zip(b2).zip(b3) {
        *sum += (w0 * b0 + w1 * b1) + (w2 * b2 + w3 * b3);
    }
}

/// Returns, for each term (m, k), the powers and coefficients of Zernike's radial polynomial of degree k and order m.
fn zernikes(parity: Parity) -> &'static [Vec<(usize, f64)>] {
    static EVEN: LazyLock<Vec<Vec<(usize, f64)>>> = LazyLock::new(|| list(Parity::Even));
    static ODD: LazyLock<Vec<Vec<(usize, f64)>>> = LazyLock::new(|| list(Parity::Odd));
    fn list(parity: Parity) -> Vec<Vec<(usize, f64)>> {
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        let term = |&(m, n): &(usize, usize)| {
            let (sum, difference) = (usize::midpoint(n, m), (n - m) / 2);
            let norm = ((n + 1) as f64 * if m == 0 { 1.0 } else { 2.0 }).sqrt();
            (0..=difference)
                .map(|s| {
                    let sign = if s.is_multiple_of(2) { norm } else { -norm };
                    let below = factorial(s) * factorial(sum - s) * factorial(difference - s);
                    (n - 2 * s, sign * factorial(n - s) / below)
                })
                .collect()
        };
        parity.terms().iter().map(term).collect()
    }
    match parity {
        Parity::Even => &EVEN,
        Parity::Odd => &ODD,
    }
}

/// Returns the coefficients of powers of a sum of Zernike's polynomials.
fn as_powers(parity: Parity, sum: &[f64]) -> Vec<f64> {
    let mut table = [[0.0; DEGREE + 1]; DEGREE + 1];
    for ((coefficient, zernike), (m, _)) in sum.iter().zip(zernikes(parity)).zip(parity.terms()) {
        for (k, c) in zernike {
            table[*m][*k] += coefficient * c;
        }
    }
    parity.terms().iter().map(|&(m, k)| table[m][k]).collect()
}

/// Replaces the lower triangle of a symmetric matrix by Cholesky's factor, or returns `None` if it is singular.
pub(super) fn factor(matrix: &mut [f64], n: usize) -> Option<()> {
    let largest = (0..n).map(|i| matrix[i * n + i]).fold(0.0, f64::max);
    for i in 0..n {
        let (above, below) = matrix.split_at_mut(i * n);
        for j in 0..i {
            let dot: f64 = below[..j].iter().zip(&above[j * n..][..j]).map(|(a, b)| a * b).sum();
            below[j] = (below[j] - dot) / above[j * n + j];
        }
        let rest = below[i] - below[..i].iter().map(|x| x * x).sum::<f64>();
        if rest.is_nan() || rest <= 1e-13 * largest {
            return None;
        }
        below[i] = rest.sqrt();
    }
    Some(())
}

/// Solves by Cholesky's factor, in place.
pub(super) fn solve(lower: &[f64], n: usize, right: &mut [f64]) {
    for i in 0..n {
        let dot: f64 = lower[i * n..][..i].iter().zip(&right[..i]).map(|(l, r)| l * r).sum();
        right[i] = (right[i] - dot) / lower[i * n + i];
    }
    for i in (0..n).rev() {
        right[i] /= lower[i * n + i];
        let value = right[i];
        for (r, l) in right[..i].iter_mut().zip(&lower[i * n..][..i]) {
            *r -= l * value;
        }
    }
}

/// Sets each value to the polynomial at each radius.
#[inline(always)]
pub(super) fn horner(ray: &Ray, radii: &[f64], values: &mut [f64]) {
    const LANES: usize = 8;
    let (mut radii, mut values) = (radii.chunks_exact(LANES), values.chunks_exact_mut(LANES));
    for (radii, values) in (&mut radii).zip(&mut values) {
        let mut sums = [ray[DEGREE]; LANES];
        for c in ray[..DEGREE].iter().rev() {
            for (sum, r) in sums.iter_mut().zip(radii) {
                *sum = *sum * r + c;
            }
        }
        values.copy_from_slice(&sums);
    }
    for (value, r) in values.into_remainder().iter_mut().zip(radii.remainder()) {
        *value = ray[..DEGREE].iter().rev().fold(ray[DEGREE], |sum, c| sum * r + c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ray: &Ray, radius: f64) -> f64 {
        let mut value = [0.0];
        horner(ray, &[radius], &mut value);
        value[0]
    }

    #[test]
    fn polynomials_are_met_with_their_slopes() {
        let angle = |i: usize| std::f64::consts::PI * i as f64 / 24.0;
        let polar: Vec<_> = (0..=24)
            .flat_map(|i| (1..=12).map(move |ring| (i, f64::from(ring) / 12.0)))
            // Not a disc: a lens, half as wide as high.
            .map(|(i, t)| (t * (0.7 + 0.3 * angle(i).sin()), Azimuth::new(angle(i).cos(), angle(i).sin()), t))
            .collect();
        let xy = |r: f64, a: &Azimuth| (r * a.cos[1], r * a.sin[1]);
        let even = |x: f64, y: f64| 0.3 + x - 2.0 * y * y + x.powi(5) * y.powi(4) - 0.1 * y.powi(12);
        let odd = |x: f64, y: f64| y + x * y.powi(3) - 2.0 * x.powi(10) * y;
        let values = |of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            polar.iter().map(|(r, a, _)| xy(*r, a)).map(|(x, y)| of(x, y)).collect()
        };
        let (evens, odds) = (values(&even), values(&odd));
        let places = Places { polar };
        let [even_fit] = places.fit(Parity::Even, [&evens]).unwrap();
        let [odd_fit] = places.fit(Parity::Odd, [&odds]).unwrap();
        for (x, y) in [(0.3, 0.2), (-0.4, 0.5), (0.1, -0.7)] {
            let (r, c, s) = (f64::hypot(x, y), x / f64::hypot(x, y), y / f64::hypot(x, y));
            let azimuth = Azimuth::new(c, s);
            // The condition of the fit over a lens loses some digits.
            assert!((at(&azimuth.value(Parity::Even, &even_fit), r) - even(x, y)).abs() < 1e-8);
            assert!((at(&azimuth.value(Parity::Odd, &odd_fit), r) - odd(x, y)).abs() < 1e-8);
            let h = 1e-5;
            let around = |of: &dyn Fn(f64, f64) -> f64| {
                let turned = |a: f64| of(x * a.cos() - y * a.sin(), x * a.sin() + y * a.cos());
                (turned(h) - turned(-h)) / (2.0 * h)
            };
            assert!((at(&azimuth.slope(Parity::Even, &even_fit), r) - around(&even)).abs() < 1e-7);
            assert!((at(&azimuth.slope(Parity::Odd, &odd_fit), r) - around(&odd)).abs() < 1e-7);
            let outwards = (even(x * (1.0 + h), y * (1.0 + h)) - even(x * (1.0 - h), y * (1.0 - h))) / (2.0 * h * r);
            let slope = radial_slope(&azimuth.value(Parity::Even, &even_fit));
            assert!((at(&slope, r) - outwards).abs() < 1e-7);
        }
    }
}
