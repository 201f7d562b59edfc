//! Light in a hair: what its surface mirrors, what goes through, and what comes back from within (Chiang, Bitterli, Tappan & Burley
//! 2016, "A practical and controllable hair and fur model for production path tracing", as pbrt has it).
//!
//! The local frame has x along the hair and z along the normal of the round tube that it is. Light that goes through leaves from where
//! it came in: the width of a hair is left out.

use std::f32::consts::{PI, TAU};

use dioptric_spectrum::lanes;
use glam::Vec3;

use crate::fresnel;

/// Ways of light that are told apart: mirrored, through, mirrored once inside; what is left is one more.
const WAYS: usize = 3;

/// How a hair scatters light that leaves it in one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hair<const N: usize> {
    /// Of each way the longitudinal variance.
    variances: [f32; WAYS + 1],
    /// The scale of the azimuthal logistic.
    scale: f32,
    /// Sines and cosines of the tilts of the scales on the hair, by which each way is turned.
    tilts: [(f32, f32); WAYS],
    index: f32,
    /// What is absorbed over a radius.
    absorption: [f32; N],
}

/// What the direction that light leaves in makes of it.
struct Leaving<const N: usize> {
    sin: f32,
    cos: f32,
    azimuth: f32,
    /// Where on its width the hair is met, as angles outside and inside.
    gammas: [f32; 2],
    /// What each way sends on.
    shares: [[f32; N]; WAYS + 1],
}

fn root(of: f32) -> f32 {
    of.max(0.0).sqrt()
}

/// Returns what Chiang & al. divide the logarithm of a color by, whose square is the absorption of hair that has it when there is much.
pub(crate) fn color_factor(beta_n: f32) -> f32 {
    5.969 + beta_n * (-0.215 + beta_n * (2.532 + beta_n * (-10.73 + beta_n * (5.574 + beta_n * 0.245))))
}

impl<const N: usize> Hair<N> {
    /// Returns hair of these roughnesses along and around, 0 to 1, whose scales are tilted so, and of which much has this color.
    pub(crate) fn new(color: [f32; N], [beta_m, beta_n]: [f32; 2], tilt_deg: f32, index: f32) -> Self {
        let [m, n] = [beta_m, beta_n].map(|beta| beta.clamp(0.01, 1.0));
        let first = (0.726 * m + 0.812 * m * m + 3.7 * m.powi(20)).powi(2);
        let scale = (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22));
        let by = color_factor(n);
        // Each way by twice the angle of the one before.
        let tilt = |times: f32| (times * tilt_deg).to_radians().sin_cos();
        Self {
            variances: [first, 0.25 * first, 4.0 * first, 4.0 * first],
            scale,
            tilts: [tilt(1.0), tilt(2.0), tilt(4.0)],
            index,
            absorption: color.map(|c| (c.clamp(1e-4, 1.0).ln() / by).powi(2)),
        }
    }

    fn leaving(&self, o: Vec3) -> Leaving<N> {
        let (sin, cos) = (o.x.clamp(-1.0, 1.0), root(1.0 - o.x * o.x));
        let across = (o.y * o.y + o.z * o.z).sqrt().max(1e-6);
        let h = (-o.y / across).clamp(-1.0, 1.0);
        let cos_within = root(1.0 - (sin / self.index).powi(2));
        // The index of the section that a slanted ray sees.
        let index = root(self.index * self.index - sin * sin) / cos.max(1e-4);
        let sin_gamma = (h / index).clamp(-1.0, 1.0);
        let length = 2.0 * root(1.0 - sin_gamma * sin_gamma) / cos_within.max(1e-4);
        let mirrored = fresnel::dielectric(cos * root(1.0 - h * h), self.index);
        let through: [f32; N] = lanes(|i| (-self.absorption[i] * length).exp());
        let once: [f32; N] = lanes(|i| (1.0 - mirrored) * (1.0 - mirrored) * through[i]);
        let twice: [f32; N] = lanes(|i| once[i] * through[i] * mirrored);
        let rest = lanes(|i| twice[i] * mirrored * through[i] / (1.0 - through[i] * mirrored).max(1e-6));
        let gammas = [h.asin(), sin_gamma.asin()];
        Leaving { sin, cos, azimuth: o.z.atan2(o.y), gammas, shares: [[mirrored; N], once, twice, rest] }
    }

    /// Returns the sine and cosine of the longitudinal angle that a way is centered against.
    fn tilted(&self, way: usize, of: &Leaving<N>) -> (f32, f32) {
        let (sin, cos) = match way {
            0 => {
                let (s, c) = self.tilts[1];
                (of.sin * c - of.cos * s, of.cos * c + of.sin * s)
            }
            1 => {
                let (s, c) = self.tilts[0];
                (of.sin * c + of.cos * s, of.cos * c - of.sin * s)
            }
            2 => {
                let (s, c) = self.tilts[2];
                (of.sin * c + of.cos * s, of.cos * c - of.sin * s)
            }
            _ => (of.sin, of.cos),
        };
        (sin, cos.abs())
    }

    /// The density of a way around the hair.
    fn around(&self, way: usize, by: f32, of: &Leaving<N>) -> f32 {
        if way == WAYS {
            return 1.0 / TAU;
        }
        let off = by - turned(way, of.gammas);
        trimmed_logistic(off - TAU * (off / TAU).round(), self.scale)
    }

    /// Returns the function times the cosine of light from one direction that leaves in another.
    pub(crate) fn value(&self, o: Vec3, i: Vec3) -> [f32; N] {
        let of = self.leaving(o);
        let mut sum = [0.0; N];
        for (way, share) in of.shares.iter().enumerate() {
            let density = self.density(way, i, &of);
            sum = lanes(|lane| sum[lane] + share[lane] * density);
        }
        sum
    }

    fn density(&self, way: usize, i: Vec3, of: &Leaving<N>) -> f32 {
        let (sin_i, cos_i) = (i.x.clamp(-1.0, 1.0), root(1.0 - i.x * i.x));
        let (sin_o, cos_o) = self.tilted(way, of);
        longitudinal([sin_i, cos_i], [sin_o, cos_o], self.variances[way])
            * self.around(way, i.z.atan2(i.y) - of.azimuth, of)
    }

    /// How often each way is drawn.
    fn chances(of: &Leaving<N>) -> [f32; WAYS + 1] {
        let means = of.shares.map(|share| share.iter().sum::<f32>());
        let total: f32 = means.iter().sum();
        means.map(|mean| mean / total)
    }

    pub(crate) fn pdf(&self, o: Vec3, i: Vec3) -> f32 {
        let of = self.leaving(o);
        Self::chances(&of).iter().enumerate().map(|(way, chance)| chance * self.density(way, i, &of)).sum()
    }

    pub(crate) fn draw(&self, o: Vec3, u_way: f32, u: [f32; 2]) -> Vec3 {
        let of = self.leaving(o);
        let (mut rest, mut way) = (u_way, WAYS);
        for (index, chance) in Self::chances(&of).into_iter().enumerate() {
            if rest < chance || index == WAYS {
                (way, rest) = (index, (rest / chance.max(1e-9)).clamp(0.0, 1.0));
                break;
            }
            rest -= chance;
        }
        let (sin_o, cos_o) = self.tilted(way, &of);
        let v = self.variances[way];
        let cos = (1.0 + v * (u[0].max(1e-7) + (1.0 - u[0]) * (-2.0 / v).exp()).ln()).clamp(-1.0, 1.0);
        let sin = root(1.0 - cos * cos);
        let sin_i = (-cos * sin_o + sin * (TAU * rest).cos() * cos_o).clamp(-1.0, 1.0);
        let cos_i = root(1.0 - sin_i * sin_i);
        let by = match way {
            WAYS => TAU * u[1],
            _ => turned(way, of.gammas) + draw_logistic(u[1], self.scale),
        };
        let (y, x) = (of.azimuth + by).sin_cos();
        Vec3::new(sin_i, cos_i * x, cos_i * y)
    }

    /// The share of light that comes back in all directions.
    pub(crate) fn albedo(&self, o: Vec3) -> [f32; N] {
        let shares = self.leaving(o).shares;
        lanes(|i| shares.iter().map(|share| share[i]).sum())
    }
}

/// By how much a way turns light around the hair.
fn turned(way: usize, [outside, inside]: [f32; 2]) -> f32 {
    2.0 * way as f32 * inside - 2.0 * outside + way as f32 * PI
}

/// The density of longitudinal angles (d'Eon & al. 2011); times the cosine its integral is 1.
fn longitudinal([sin_i, cos_i]: [f32; 2], [sin_o, cos_o]: [f32; 2], v: f32) -> f32 {
    let (a, b) = (cos_i * cos_o / v, sin_i * sin_o / v);
    // 1/(2 v sinh(1/v)), without what would overflow.
    let scale = 1.0 / (v * (1.0 - (-2.0 / v).exp()));
    (log_bessel(a) - b - 1.0 / v).exp() * scale
}

/// The logarithm of the modified Bessel function of the first kind, of order 0.
fn log_bessel(x: f32) -> f32 {
    if x > 12.0 {
        let y = 1.0 / (8.0 * x);
        return x - 0.5 * (TAU * x).ln() + (1.0 + y * (1.0 + 4.5 * y * (1.0 + 8.333_333 * y))).ln();
    }
    let (mut sum, mut term) = (1.0, 1.0);
    for i in 1..24 {
        term *= x * x / (4 * i * i) as f32;
        sum += term;
    }
    sum.ln()
}

/// The cumulative logistic distribution.
fn below(x: f32, scale: f32) -> f32 {
    1.0 / (1.0 + (-x / scale).exp())
}

/// The logistic distribution within −π to π.
fn trimmed_logistic(x: f32, scale: f32) -> f32 {
    let fall = (-x.abs() / scale).exp();
    fall / (scale * (1.0 + fall) * (1.0 + fall)) / (below(PI, scale) - below(-PI, scale))
}

fn draw_logistic(u: f32, scale: f32) -> f32 {
    let (low, high) = (below(-PI, scale), below(PI, scale));
    let at = low + u * (high - low);
    (-scale * (1.0 / at.clamp(1e-7, 1.0 - 1e-7) - 1.0).ln()).clamp(-PI, PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions(n: usize) -> impl Iterator<Item = (Vec3, f64)> {
        (0..n * n).map(move |index| {
            let x = 2.0 * ((index / n) as f32 + 0.5) / n as f32 - 1.0;
            let (z, y) = (TAU * ((index % n) as f32 + 0.5) / n as f32).sin_cos();
            let cos = (1.0 - x * x).sqrt();
            (Vec3::new(x, cos * y, cos * z), 4.0 * std::f64::consts::PI / (n * n) as f64)
        })
    }

    fn ways() -> [Vec3; 4] {
        [(0.0, 0.2), (0.5, -0.7), (-0.8, 0.5), (0.3, 0.98)].map(|(x, h): (f32, f32)| {
            let cos = (1.0 - x * x).sqrt();
            Vec3::new(x, -cos * h, cos * (1.0 - h * h).sqrt())
        })
    }

    /// Hair that absorbs nothing sends back all light, from whatever direction and however rough it is.
    #[test]
    fn white_hair_loses_nothing() {
        for betas in [[0.15, 0.2], [0.3, 0.3], [0.6, 0.9], [1.0, 1.0]] {
            for tilt_deg in [0.0, 2.0] {
                let hair = Hair::<1>::new([1.0], betas, tilt_deg, 1.55);
                for o in ways() {
                    let total: f64 = directions(900).map(|(i, dw)| f64::from(hair.value(o, i)[0]) * dw).sum();
                    assert!((total - 1.0).abs() < 0.005, "{betas:?} {tilt_deg} {o}: {total}");
                    assert!((hair.albedo(o)[0] - 1.0).abs() < 1e-4);
                }
            }
        }
    }

    /// Directions are drawn by their density: of brown hair the mean weight is the integral of the function.
    #[test]
    fn directions_are_drawn_by_their_density() {
        for betas in [[0.2, 0.3], [0.5, 0.8]] {
            let hair = Hair::<2>::new([0.6, 0.2], betas, 2.0, 1.55);
            for o in ways() {
                let integral: f64 = directions(600).map(|(i, dw)| f64::from(hair.pdf(o, i)) * dw).sum();
                assert!((integral - 1.0).abs() < 0.005, "{betas:?} {o}: {integral}");
                let n = 200;
                let mut mean = [0.0_f64; 2];
                for k in 0..n * n {
                    let u = [((k % n) as f32 + 0.5) / n as f32, ((k / n) as f32 + 0.5) / n as f32];
                    let i = hair.draw(o, (k as f32 * 0.618_034).fract(), u);
                    assert!((i.length() - 1.0).abs() < 1e-4);
                    let (value, pdf) = (hair.value(o, i), hair.pdf(o, i));
                    (0..2).for_each(|lane| mean[lane] += f64::from(value[lane] / pdf) / f64::from((n * n) as u32));
                }
                let albedo = hair.albedo(o);
                for lane in 0..2 {
                    let off = (mean[lane] / f64::from(albedo[lane]) - 1.0).abs();
                    assert!(off < 0.01, "{betas:?} {o}: {mean:?} {albedo:?}");
                }
            }
        }
    }

    /// Values of the `hair` of Mitsuba 3.9, whose fibers run along y, to the four digits of the directions.
    #[test]
    fn values_are_mitsubas() {
        let cases = [
            (0.05, [0.6, 0.8], 0.0, [-0.0759, 0.9555, 0.285], [0.5071, 0.8335, -0.2195], 0.070_908),
            (0.05, [0.6, 0.8], 0.0, [0.5086, -0.7099, 0.4872], [-0.804, 0.477, -0.3551], 0.178_761),
            (0.2, [0.3, 0.3], 2.0, [0.0213, -0.9439, 0.3295], [-0.6761, -0.6988, 0.2336], 0.055_824),
            (0.2, [0.3, 0.3], 2.0, [0.0893, 0.9584, 0.271], [0.4817, 0.8513, 0.208], 0.058_638),
        ];
        for (absorption, betas, tilt_deg, o, i, expected) in cases {
            let color = (-f32::sqrt(absorption) * color_factor(betas[1])).exp();
            let [o, i] = [o, i].map(|v| Vec3::from_array(v).normalize());
            let value = Hair::<1>::new([color], betas, tilt_deg, 1.55).value(o, i)[0];
            assert!((value / expected - 1.0).abs() < 0.005, "{betas:?}: {value} {expected}");
        }
    }

    /// A smooth hair mirrors light about its normal, and lets it through on the other side.
    #[test]
    fn light_goes_where_a_cylinder_sends_it() {
        let hair = Hair::<1>::new([1.0], [0.02, 0.05], 0.0, 1.55);
        let o = ways()[1];
        let mirrored = hair.value(o, Vec3::new(-o.x, -o.y, o.z))[0];
        let beside = hair.value(o, Vec3::new(-o.x, o.y, o.z))[0];
        assert!(mirrored > 100.0 * beside, "{mirrored} {beside}");
        let n = 2000;
        let through = (0..n).filter(|k| hair.draw(o, (*k as f32 + 0.5) / n as f32, [0.5, 0.5]).z < 0.0).count();
        assert!(through > n * 8 / 10, "{through}");
    }
}
