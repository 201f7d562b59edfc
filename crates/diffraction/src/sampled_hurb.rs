//! HURB by random deviations of single rays, in the two forms that are in use.

use dioptric_optics::{Placement, RayBatch, StopPoint};
use glam::DVec3;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::{Hurb, StopEdge};

/// Rays that share a stream of random numbers: results do not depend on how many threads share the work.
const CHUNK: usize = 4096;

/// How a deviation changes the direction of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HurbForm {
    /// It is added to the direction cosines in the plane of the stop: right in phase space, and it cannot turn a ray
    /// back.
    DirectionCosines,
    /// It is added to azimuth and elevation in the frame of radius, tangent and axis, as the paper's authors did.
    Angles,
}

/// HURB at an edge by random Gaussian deviations, independent towards it (in a round one along the radius) and across that.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledHurb {
    /// The constants of the model.
    pub model: Hurb,
    /// The edge.
    pub edge: StopEdge,
    /// How a deviation changes the direction of a ray.
    pub form: HurbForm,
    /// The seed: ray `i` draws from its stream `i / 4096`.
    pub seed: u64,
}

impl SampledHurb {
    /// Deviates the rays in flight at the edge, which stands at this placement: at
    /// [`MonoLens::stop_placement`](dioptric_optics::MonoLens::stop_placement) if it is the stop.
    ///
    /// The rays must be at the edge: of the stop between `trace_surfaces(0..stop + 1)` and the rest.
    pub fn apply(&self, rays: &mut RayBatch, edge_placement: &Placement) {
        let n_chunks = rays.len().div_ceil(CHUNK);
        let deviated: Vec<Vec<DVec3>> = (0..n_chunks)
            .into_par_iter()
            .map(|chunk| {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(chunk as u64);
                let range = chunk * CHUNK..rays.len().min((chunk + 1) * CHUNK);
                range.map(|ray| self.deviated(rays, ray, edge_placement, &mut random)).collect()
            })
            .collect();
        for (ray, direction) in deviated.into_iter().flatten().enumerate() {
            if rays.fate[ray].is_in_flight() {
                rays.set_direction(ray, direction);
            }
        }
    }

    /// Returns the direction of a ray after a random deviation. Every ray draws the same number of times, or redraws.
    fn deviated(&self, rays: &RayBatch, ray: usize, edge_placement: &Placement, random: &mut ChaCha8Rng) -> DVec3 {
        // Place and direction in the frame of the edge.
        let before = edge_placement.direction_to_own(rays.direction(ray));
        let place_mm = edge_placement.surface_from_lens(rays.point_mm(ray)).truncate();

        // Standard deviations along the radius and across it.
        let (radial, spread) = self.model.spread_at(StopPoint { mm: place_mm }, &self.edge);
        let after = loop {
            let (a, b): (f64, f64) = (StandardNormal.sample(random), StandardNormal.sample(random));
            let (a, b) = (a * spread.radial, b * spread.across);
            match self.form {
                HurbForm::DirectionCosines => {
                    let cosines = before.truncate() + radial * a + radial.perp() * b;
                    let rest = 1.0 - cosines.length_squared();
                    if rest > 0.0 {
                        break cosines.extend(rest.sqrt());
                    }
                }
                HurbForm::Angles => {
                    let (s, l, u) = (before.truncate().dot(radial), before.truncate().dot(radial.perp()), before.z);
                    let azimuth = s.atan2(u) + a;
                    let elevation = l.atan2(s.hypot(u)) + b;
                    let across = radial.perp() * elevation.sin();
                    let along = radial * (elevation.cos() * azimuth.sin());
                    break (along + across).extend(elevation.cos() * azimuth.cos());
                }
            }
        };
        edge_placement.direction_to_lens(after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CircularStop;

    fn bundle(n: usize, at: DVec3) -> RayBatch {
        RayBatch::from_points(&vec![at; n], &vec![DVec3::Z; n])
    }

    fn in_air(seed: u64) -> SampledHurb {
        let form = HurbForm::DirectionCosines;
        SampledHurb { model: Hurb::PAPER, edge: CircularStop::new(1.0, 550.0, 1.0).into(), form, seed }
    }

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn deviations_have_the_spread_of_the_model() {
        let edge = CircularStop::new(1.0, 550.0, 1.5);
        let n = 200_000;
        for form in [HurbForm::DirectionCosines, HurbForm::Angles] {
            let mut rays = bundle(n, DVec3::new(0.0, 0.8, 0.0));
            SampledHurb { model: Hurb::PAPER, edge: edge.into(), form, seed: 7 }
                .apply(&mut rays, &Placement::centered(0.0));
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
                in_air(1).apply(&mut rays, &Placement::centered(0.0));
            });
            rays
        };
        assert_eq!(with(1), with(4));
    }

    #[test]
    fn a_ray_at_the_very_edge_stays_forward() {
        let mut rays = bundle(1000, DVec3::new(1.0, 0.0, 0.0));
        in_air(1).apply(&mut rays, &Placement::centered(0.0));
        assert!(rays.n.iter().all(|&n| n > 0.0));
    }

    /// A decentered, tilted edge deviates the same rays as a centered one, in its own frame.
    #[test]
    fn deviations_follow_the_edge() {
        use dioptric_optics::glam::DMat3;
        let rotation = DMat3::from_rotation_x(0.2) * DMat3::from_rotation_y(-0.1);
        let placement = Placement { vertex_mm: DVec3::new(0.3, -0.4, 2.0), rotation };
        let points: Vec<DVec3> = (0..500).map(|i| DVec3::new(0.001 * f64::from(i), 0.6, 0.0)).collect();
        let placed: Vec<DVec3> = points.iter().map(|point| placement.lens_from_surface(*point)).collect();
        for form in [HurbForm::DirectionCosines, HurbForm::Angles] {
            let hurb = SampledHurb { form, ..in_air(3) };
            let mut centered = RayBatch::from_points(&points, &[DVec3::Z; 500]);
            let mut moved = RayBatch::from_points(&placed, &[rotation.z_axis; 500]);
            hurb.apply(&mut centered, &Placement::centered(0.0));
            hurb.apply(&mut moved, &placement);
            for ray in 0..500 {
                let off = moved.direction(ray) - placement.direction_to_lens(centered.direction(ray));
                assert!(off.length() < 1e-9, "{ray}: {off}");
            }
        }
    }
}
