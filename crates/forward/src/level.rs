//! What keeps a whole surface from covering pixels more or less than once, where blur is wide.
//!
//! The alpha of samples is divided by what second moments make of a uniform plane (`uniform_response.rs`). Blur of a fifth of the film's size that grows outwards has fourth moments
//! as well, and what it spreads is what was divided already: a wall through the two-element lens covered .5 to 1.5 % too little, and was as much too bright.

use dioptric_psf::FilmMap;
use dioptric_spectrum::Cancelled;
use glam::{DMat4, DVec4};

use crate::{
    film_lens::FilmLens,
    knot_kernels::KnotKernel,
    patch::Knot,
    raster::LayerRaster,
    uniform_response::{LEAST_RESPONSE, MOST_EXCESS},
    work::Work,
};

/// A factor of the alpha of a layer's samples: a polynomial of the square of their distance from the axis.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    coefficients: DVec4,
    axis: Knot,
    /// Up to which it was found, pixels; beyond it is as there.
    radius_px: f64,
}

/// The least spread of a point, parts of the distance of the film's corner from the axis, whose fourth moments matter.
const LEAST_SPREAD: f64 = 0.05;
/// The spreads up to which the factor is that, and from which on there is none: blur about as wide as the film is known too roughly.
const WIDE_SPREAD: (f64, f64) = (0.5, 1.0);
/// A factor that is nowhere farther from 1 than this is none.
const NEGLIGIBLE: f64 = 1e-4;
/// How far from 1 it is at most: of blur wider than the film little is known.
const MOST: f64 = 0.2;
/// Distances from the axis at which kernels are computed, the axis left out.
const N_KERNELS: i32 = 32;
/// Places between two of them.
const N_BETWEEN: usize = 4;
/// Blur radius of these kernels, samples at most.
const WIDEST: f64 = 16.0;

impl Level {
    /// Returns the factor b(ρ) of a layer with which the kernels of a lens with an axis make a plane of 1 of b / N₂, N₂ what second moments make of a plane.
    ///
    /// What kernels make of a plane a(ρ) is found weakly, as the polynomial p with `∫ p φ ρ dρ = ∫ a E_ρ[φ] ρ dρ` for some functions φ that end at a distance, `E_ρ` the mean over
    /// the kernel at ρ; then b is b less what p is above 1, a few times. `spread_px` is the widest spread of a point over the film.
    pub(crate) fn of(
        lens: &FilmLens<'_>,
        layer: usize,
        spread_px: f64,
        work: &Work<'_>,
    ) -> Result<Option<Self>, Cancelled> {
        /// Rounds of the correction.
        const N_ROUNDS: usize = 3;
        let FilmMap::Radial(map) = &lens.maps[layer] else { return Ok(None) };
        let axis = Knot::nearest(map.axis_mm(), 1e-3 * lens.film.pitch_um);
        let farthest = |n: usize, axis: i32| 0.5 * n as f64 + f64::from(axis.abs());
        let corner_px = farthest(lens.film.rows, axis.down).hypot(farthest(lens.film.columns, axis.right));
        let part = ((WIDE_SPREAD.1 - spread_px / corner_px) / (WIDE_SPREAD.1 - WIDE_SPREAD.0)).min(1.0);
        if spread_px < LEAST_SPREAD * corner_px || part <= 0.0 {
            return Ok(None);
        }
        let radius_px = corner_px + spread_px;
        let tests = Tests { radius2_px: radius_px * radius_px };
        let points = Point::along((lens, layer), axis, &tests, (spread_px, radius_px + 2.0 * spread_px), work)?;
        let gram = matrix(points.iter().map(|p| (p.rho_px, p.here, p.powers))).inverse();
        let plane = points.iter().map(|p| p.rho_px * p.here).sum::<DVec4>();
        let of_moments = |order: usize| gram * points.iter().map(|p| p.rho_px * p.to_moments[order]).sum::<DVec4>();
        let [first, second] = [0, 1].map(of_moments);
        let mut coefficients = DVec4::X;
        for _ in 0..N_ROUNDS {
            // Clamped as it is where samples are divided by it.
            let response = |p: &Point| {
                let excess = second.dot(p.powers).clamp(-MOST_EXCESS, MOST_EXCESS);
                (1.0 + first.dot(p.powers) + excess).max(f64::from(LEAST_RESPONSE))
            };
            let alpha = |p: &Point| coefficients.dot(p.powers) / response(p);
            let spread = points.iter().map(|p| p.rho_px * alpha(p) * p.spread).sum::<DVec4>();
            coefficients -= gram * (spread - plane);
        }
        let off = points.iter().map(|p| (p.powers.dot(coefficients) - 1.0).abs()).fold(0.0, f64::max);
        if !(coefficients.is_finite() && off > NEGLIGIBLE) {
            return Ok(None);
        }
        let coefficients = DVec4::X.lerp(coefficients, part * (MOST / off).min(1.0));
        Ok(Some(Self { coefficients, axis, radius_px }))
    }

    /// Returns the factor between those of two bands of a layer; none is 1.
    pub(crate) fn between(lower: Option<&Self>, upper: Option<&Self>, fraction: f64) -> Option<Self> {
        let any = lower.or(upper)?;
        let coefficients = |level: Option<&Self>| level.map_or(DVec4::X, |level| level.coefficients);
        Some(Self { coefficients: coefficients(lower).lerp(coefficients(upper), fraction), ..*any })
    }

    /// Returns the factor at a place, pixels of the film to the right of its middle and below it.
    pub(crate) fn at(&self, right_px: f64, down_px: f64) -> f32 {
        let rho_px = f64::hypot(right_px - f64::from(self.axis.right), down_px - f64::from(self.axis.down));
        Tests { radius2_px: self.radius_px * self.radius_px }.powers(rho_px).dot(self.coefficients) as f32
    }
}

/// Functions (1 − t)⁴ tᵏ of t, the square of the distance from the axis over that of a radius, k from 0 to 3; 0 beyond.
struct Tests {
    radius2_px: f64,
}

/// What a kernel does to the functions.
struct Point {
    rho_px: f64,
    /// The powers of t there.
    powers: DVec4,
    /// Their values at its place.
    here: DVec4,
    /// Their means over it.
    spread: DVec4,
    /// By how much their means over it differ from their values at its place as far as first moments make them, and as far as second ones do.
    to_moments: [DVec4; 2],
}

impl Point {
    /// Returns those of a layer to the right of the axis, evenly up to a distance; kernels lie on straight lines between some.
    fn along(
        (lens, layer): (&FilmLens<'_>, usize),
        axis: Knot,
        tests: &Tests,
        (spread_px, end_px): (f64, f64),
        work: &Work<'_>,
    ) -> Result<Vec<Self>, Cancelled> {
        // One raster for all, for moments to have no steps.
        let factor = LayerRaster::factor_for(spread_px, WIDEST);
        let step = (end_px / f64::from(N_KERNELS)).ceil() as i32;
        let kernel = |i: i32| lens.kernel(layer, Knot { right: axis.right + i * step, down: axis.down }, factor);
        let checked = |i: i32| work.check().map(|()| kernel(i));
        let kernels: Vec<KnotKernel> = (0..=N_KERNELS).map(checked).collect::<Result<_, Cancelled>>()?;
        let between = |(i, pair): (i32, &[KnotKernel])| {
            let at = |j: usize| {
                let fraction = (j as f64 + 0.5) / N_BETWEEN as f64;
                let rho_px = f64::from(step) * (f64::from(i) + fraction);
                let [mut point, next] = [&pair[0], &pair[1]].map(|kernel| tests.at(rho_px, kernel, factor as f64));
                point.spread += fraction * (next.spread - point.spread);
                let moments = point.to_moments.iter_mut().zip(next.to_moments);
                moments.for_each(|(here, next)| *here += fraction * (next - *here));
                point
            };
            (0..N_BETWEEN).map(at).collect::<Vec<_>>()
        };
        Ok((0..).zip(kernels.windows(2)).flat_map(between).collect())
    }
}

impl Tests {
    /// Returns the powers 0 to 3 of t, at most 1.
    fn powers(&self, rho_px: f64) -> DVec4 {
        let t = (rho_px * rho_px / self.radius2_px).min(1.0);
        DVec4::new(1.0, t, t * t, t * t * t)
    }

    fn values(&self, rho2_px: f64) -> DVec4 {
        let t = rho2_px / self.radius2_px;
        if t >= 1.0 { DVec4::ZERO } else { (1.0 - t).powi(4) * DVec4::new(1.0, t, t * t, t * t * t) }
    }

    /// Returns their first and second derivatives by t.
    fn derivatives(&self, rho2_px: f64) -> [DVec4; 2] {
        let t = rho2_px / self.radius2_px;
        if t >= 1.0 {
            return [DVec4::ZERO; 2];
        }
        let rest = 1.0 - t;
        let power = |k: i32| if k < 0 { 0.0 } else { t.powi(k) };
        let first = |k: i32| f64::from(k) * rest.powi(4) * power(k - 1) - 4.0 * rest.powi(3) * power(k);
        let second = |k: i32| {
            f64::from(k * (k - 1)) * rest.powi(4) * power(k - 2) - f64::from(8 * k) * rest.powi(3) * power(k - 1)
                + 12.0 * rest.powi(2) * power(k)
        };
        [DVec4::from_array([0, 1, 2, 3].map(first)), DVec4::from_array([0, 1, 2, 3].map(second))]
    }

    /// Returns what a kernel at a distance to the right of the axis does, on pixels `factor` times as wide as the film's.
    fn at(&self, rho_px: f64, kernel: &KnotKernel, factor: f64) -> Point {
        let mut spread = DVec4::ZERO;
        kernel.for_each(|down_px, right_px, sample| {
            let (down, right) = (factor * down_px, rho_px + factor * right_px);
            spread += sample * self.values(right * right + down * down);
        });
        let ([_, outwards], [around, _, along]) = (kernel.first_moments(), kernel.second_moments());
        let [first, second] = self.derivatives(rho_px * rho_px);
        let slope = 2.0 * rho_px / self.radius2_px;
        let bend_along = second * (slope * slope) + first * (2.0 / self.radius2_px);
        let bend_around = first * (2.0 / self.radius2_px);
        let to_moments =
            [first * (slope * factor * outwards), 0.5 * factor * factor * (along * bend_along + around * bend_around)];
        Point { rho_px, powers: self.powers(rho_px), here: self.values(rho_px * rho_px), spread, to_moments }
    }
}

/// Returns the sum of outer products with weights: row by row the first vector's entries.
fn matrix(terms: impl Iterator<Item = (f64, DVec4, DVec4)>) -> DMat4 {
    terms.fold(DMat4::ZERO, |sum, (weight, rows, columns)| {
        let column = |part: f64| weight * part * rows;
        sum + DMat4::from_cols(column(columns.x), column(columns.y), column(columns.z), column(columns.w))
    })
}
