//! Uncertainty bending of single rays: random, in the two forms that are in use.

use dioptric_optics::RayBatch;
use glam::{DVec2, DVec3};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::{Edge, Hurb};

/// Rays that share a stream of random numbers: results do not depend on how many threads share the work.
const CHUNK: usize = 4096;

/// How a deviation turns a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BendForm {
    /// It is added to the direction cosines in the plane of the stop: right in phase space, and it cannot turn a ray
    /// back.
    DirectionCosines,
    /// It is added to azimuth and elevation in the frame of radius, tangent and axis, as the paper's authors did.
    Angles,
}

/// Bends the rays in flight at an edge by random Gaussian deviations, independent along the radius and across it.
///
/// The rays must be at the stop: between `trace_surfaces(0..stop + 1)` and the rest. Ray `i` draws from stream
/// `i / 4096` of the seed.
pub fn bend(rays: &mut RayBatch, edge: Edge, model: Hurb, form: BendForm, seed: u64) {
    let n_chunks = rays.len().div_ceil(CHUNK);
    let turned: Vec<Vec<DVec3>> = (0..n_chunks)
        .into_par_iter()
        .map(|chunk| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(chunk as u64);
            let range = chunk * CHUNK..rays.len().min((chunk + 1) * CHUNK);
            range.map(|ray| turn(rays, ray, edge, model, form, &mut random)).collect()
        })
        .collect();
    for (ray, direction) in turned.into_iter().flatten().enumerate() {
        if rays.fate[ray].is_in_flight() {
            rays.set_direction(ray, direction);
        }
    }
}

/// Returns the direction of a ray after a random deviation. Every ray draws the same number of times, or redraws.
fn turn(rays: &RayBatch, ray: usize, edge: Edge, model: Hurb, form: BendForm, random: &mut ChaCha8Rng) -> DVec3 {
    let before = rays.direction(ray);
    let point = rays.point_mm(ray).truncate();
    let r_mm = point.length();
    let spread = model.spread(r_mm, edge);
    let radial = if r_mm > 0.0 { point / r_mm } else { DVec2::X };
    loop {
        let (a, b): (f64, f64) = (StandardNormal.sample(random), StandardNormal.sample(random));
        let (a, b) = (a * spread.radial, b * spread.across);
        match form {
            BendForm::DirectionCosines => {
                let cosines = before.truncate() + radial * a + radial.perp() * b;
                let rest = 1.0 - cosines.length_squared();
                if rest > 0.0 {
                    return cosines.extend(rest.sqrt());
                }
            }
            BendForm::Angles => {
                let (s, l, u) = (before.truncate().dot(radial), before.truncate().dot(radial.perp()), before.z);
                let azimuth = s.atan2(u) + a;
                let elevation = l.atan2(s.hypot(u)) + b;
                let across = radial.perp() * elevation.sin();
                return (radial * (elevation.cos() * azimuth.sin()) + across).extend(elevation.cos() * azimuth.cos());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle(n: usize, at: DVec3) -> RayBatch {
        RayBatch::from_points(&vec![at; n], &vec![DVec3::Z; n])
    }

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn deviations_have_the_spread_of_the_model() {
        let edge = Edge::new(1.0, 550.0, 1.5);
        let n = 200_000;
        for form in [BendForm::DirectionCosines, BendForm::Angles] {
            let mut rays = bundle(n, DVec3::new(0.0, 0.8, 0.0));
            bend(&mut rays, edge, Hurb::PAPER, form, 7);
            let wanted = Hurb::PAPER.spread(0.8, edge);
            // Two standard errors of a width from n draws: √(1/2n) = 0.16 %.
            assert!((rms(&rays.m) / wanted.radial - 1.0).abs() < 0.0032);
            assert!((rms(&rays.l) / wanted.across - 1.0).abs() < 0.0032);
            for ray in 0..n {
                assert!((rays.direction(ray).length() - 1.0).abs() < 1e-12 && rays.n[ray] > 0.0);
            }
        }
    }

    #[test]
    fn one_thread_and_four_agree_to_the_bit() {
        let with = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let mut rays = bundle(10_000, DVec3::new(0.1, 0.2, 0.0));
            pool.install(|| {
                bend(&mut rays, Edge::new(1.0, 550.0, 1.0), Hurb::PAPER, BendForm::DirectionCosines, 1);
            });
            rays
        };
        assert_eq!(with(1), with(4));
    }

    #[test]
    fn a_ray_at_the_very_edge_stays_forward() {
        let mut rays = bundle(1000, DVec3::new(1.0, 0.0, 0.0));
        bend(&mut rays, Edge::new(1.0, 550.0, 1.0), Hurb::PAPER, BendForm::DirectionCosines, 1);
        assert!(rays.n.iter().all(|&n| n > 0.0));
    }
}
