//! Beams of rays from an object point, and their way to the film without being stored.

use glam::{DVec2, DVec3};
use multiversion::multiversion;

use crate::{
    MonoLens, ObjectPoint, RayBatch, RayBatchF32, RayFate, Vignetting,
    bundle::{Aim, rays_within},
    rays::RaySlices,
    trace::{self, Goal, Plan},
};

/// Rays that are made, traced and shown together: few enough for the nearest cache.
const LOT: usize = 256;

/// The rays from an object point towards targets in a plane.
#[derive(Clone, Copy, Debug)]
pub struct Beam<'a> {
    /// Where the rays come from.
    pub point: ObjectPoint,
    /// Where they are aimed, mm.
    pub targets_mm: &'a [DVec2],
    /// z of the plane of the targets in the lens frame, mm.
    pub z_mm: f64,
}

/// Fills a batch with the rays towards as many targets.
#[multiversion(targets("x86_64+avx2"))]
fn aim_at(aim: &Aim<'_>, targets_mm: &[DVec2], rays: RaySlices<'_>) {
    let n = targets_mm.len();
    let RaySlices { x, y, z, l, m, n: nz, opl, fate } = rays;
    let (x, y, z, opl) = (&mut x[..n], &mut y[..n], &mut z[..n], &mut opl[..n]);
    let (l, m, nz) = (&mut l[..n], &mut m[..n], &mut nz[..n]);
    for (i, &target_mm) in targets_mm.iter().enumerate() {
        let (start_mm, direction, opl_mm) = aim.ray(target_mm);
        (x[i], y[i], z[i]) = start_mm.into();
        (l[i], m[i], nz[i]) = direction.into();
        opl[i] = opl_mm;
    }
    fate.fill(RayFate::InFlight);
}

impl ObjectPoint {
    /// Returns the point seen from the paraxial entrance-pupil center of `lens` under these tangents of field angles,
    /// `dioptres` = 1/Z away (Z the axial distance from that center in metres; 0 is infinitely far).
    ///
    /// A telecentric lens has no such center; there the first vertex stands for it
    /// ([`MonoLens::projection_center_z_mm`]).
    pub fn from_field(lens: &MonoLens, field_tan: DVec2, dioptres: f64) -> Self {
        let center_z_mm = lens.projection_center_z_mm();
        if dioptres == 0.0 {
            return Self::Infinite(DVec3::new(-field_tan.x, -field_tan.y, 1.0).normalize());
        }
        let distance_mm = 1e3 / dioptres;
        Self::Finite((field_tan * distance_mm).extend(center_z_mm - distance_mm))
    }
}

impl MonoLens {
    /// Returns rays as [`rays_towards`](crate::rays_towards) does, with path lengths in the medium that the object of
    /// this lens is in.
    pub fn rays_towards(&self, point: &ObjectPoint, targets_mm: &[DVec2], z_mm: f64, start_z_mm: f64) -> RayBatch {
        rays_within(self.object_index(), point, targets_mm, [z_mm, start_z_mm])
    }

    /// Traces a beam to the film, `film_distance_mm` behind the last vertex, and shows the rays there to `visit`, a few hundred
    /// at a time and in their order.
    ///
    /// The same rays as those of [`rays_towards`](Self::rays_towards) from the first vertex plane and
    /// [`trace_to_film`](Self::trace_to_film), to the bit, without storing them: for counting rays on pixels.
    pub fn trace_onto(
        &self,
        beam: &Beam<'_>,
        rims: Vignetting,
        film_distance_mm: f64,
        mut visit: impl FnMut(&RayBatch),
    ) {
        let plan = Plan::new(&self.steps_for(beam.point.z_mm()), 0, rims);
        beam.for_each_lot(self.object_index(), |rays| {
            match self.has_plain_film() {
                true => trace::trace_batch(&plan, Goal::Film { film_distance_mm }, rays.slices()),
                false => self.trace_to_film(rays, rims, film_distance_mm),
            }
            visit(rays);
        });
    }

    /// Traces a beam as [`trace_onto`](Self::trace_onto) does, in single precision: within 0.05 µm, and faster.
    pub fn trace_onto_f32(
        &self,
        beam: &Beam<'_>,
        rims: Vignetting,
        film_distance_mm: f64,
        mut visit: impl FnMut(&RayBatchF32),
    ) {
        let plan = Plan::new(self.steps(), 0, rims);
        let mut single = RayBatchF32::default();
        beam.for_each_lot(self.object_index(), |rays| {
            single.set(rays);
            match self.has_plain_film() {
                true => trace::trace_batch(&plan, Goal::Film { film_distance_mm }, single.slices()),
                false => self.trace_to_film_f32(&mut single, rims, film_distance_mm),
            }
            visit(&single);
        });
    }
}

impl Beam<'_> {
    /// Makes the rays, lot by lot in the same batch.
    fn for_each_lot(&self, index: f64, mut work: impl FnMut(&mut RayBatch)) {
        let aim = Aim::new(&self.point, self.z_mm, 0.0).within(index);
        let mut rays = RayBatch { object_z_mm: self.point.z_mm(), ..RayBatch::default() };
        for targets_mm in self.targets_mm.chunks(LOT) {
            rays.resize(targets_mm.len());
            aim_at(&aim, targets_mm, rays.slices());
            work(&mut rays);
        }
    }
}

/// Returns rays from an object point to a square grid of `n_across`² points, of which those in a disc are kept, on
/// the flat front disc of the lens: the paper's way of choosing rays.
///
/// The disc has the radius of the first surface's rim and lies in its vertex plane.
pub fn rays_over_front(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> RayBatch {
    let radius_mm = lens.semi_aperture_mm(0);
    let at = |i: usize| if n_across < 2 { 0.0 } else { 2.0 * i as f64 / (n_across - 1) as f64 - 1.0 };
    let grid = (0..n_across).flat_map(|row| (0..n_across).map(move |column| DVec2::new(at(column), at(row))));
    let targets: Vec<DVec2> = grid.filter(|p| p.length_squared() <= 1.0).map(|p| p * radius_mm).collect();
    lens.rays_towards(point, &targets, 0.0, 0.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{CoordinateBreak, Lens, rays_towards};

    fn targets() -> Vec<DVec2> {
        (0..1000).map(|i| 0.4 * f64::from(i).sqrt() * DVec2::from_angle(2.4 * f64::from(i))).collect()
    }

    /// Gathers the rays that a beam shows.
    fn shown(lens: &MonoLens, beam: &Beam<'_>, film_distance_mm: f64) -> RayBatch {
        let mut all = RayBatch { object_z_mm: beam.point.z_mm(), ..RayBatch::default() };
        lens.trace_onto(beam, Vignetting::On, film_distance_mm, |rays| {
            for i in 0..rays.len() {
                all.push(rays.point_mm(i), rays.direction(i), rays.opl_mm[i]);
            }
            all.fate.truncate(all.fate.len() - rays.len());
            all.fate.extend(&rays.fate);
        });
        all
    }

    #[test]
    fn beam_is_the_stored_rays_to_the_bit() {
        let centered = Lens::built_in("dgauss-50mm").unwrap();
        let tilt_deg = [0.5, 0.0, 0.0];
        let tilt = CoordinateBreak {
            surfaces: (2, 3),
            pivot_mm: 0.0,
            decenter_mm: [0.1, 0.0, 0.0],
            tilt_deg,
            tilt_first: false,
        };
        let tilted = centered.clone().with_moves(vec![tilt]).unwrap();
        let targets_mm = targets();
        for lens in [centered, tilted] {
            let lens = lens.at(550.0).unwrap();
            for dioptres in [0.0, 0.5] {
                let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.05), dioptres);
                let beam = Beam { point, targets_mm: &targets_mm, z_mm: 20.0 };
                let mut stored = rays_towards(&point, &targets_mm, 20.0, 0.0);
                lens.trace_to_film(&mut stored, Vignetting::On, 36.5);
                let found = shown(&lens, &beam, 36.5);
                assert!(found.n_in_flight() > 500 && found.n_in_flight() < 1000);
                assert_eq!(found, stored);

                let mut single = RayBatchF32::from(&rays_towards(&point, &targets_mm, 20.0, 0.0));
                lens.trace_to_film_f32(&mut single, Vignetting::On, 36.5);
                let mut x_mm: Vec<f32> = Vec::new();
                lens.trace_onto_f32(&beam, Vignetting::On, 36.5, |rays| x_mm.extend(&rays.x_mm));
                assert_eq!(x_mm, single.x_mm);
            }
        }
    }

    #[test]
    fn no_targets_show_nothing() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let beam = Beam { point: ObjectPoint::Infinite(DVec3::Z), targets_mm: &[], z_mm: 0.0 };
        let mut n_shown = 0;
        lens.trace_onto(&beam, Vignetting::On, 36.0, |_| n_shown += 1);
        assert_eq!(n_shown, 0);
    }

    #[test]
    fn path_lengths_do_not_depend_on_the_start_plane() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let (film_distance_mm, z_mm) = (36.5, lens.first_order().entrance_pupil_z_mm);
        let targets = [DVec2::ZERO, DVec2::new(5.0, 2.0), DVec2::new(-3.0, 7.0)];
        // 1 km away and 20 degrees off, where paths are 4e8 waves of light long.
        for dioptres in [0.0, 1e-3, 2.0] {
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.2, 0.1), dioptres);
            let paths = |start_z_mm: f64| {
                let mut rays = rays_towards(&point, &targets, z_mm, start_z_mm);
                lens.trace(&mut rays, Vignetting::On);
                lens.to_film(&mut rays, film_distance_mm);
                [rays.opl_mm[1] - rays.opl_mm[0], rays.opl_mm[2] - rays.opl_mm[0]]
            };
            let (near, far) = (paths(0.0), paths(-100.0));
            for (a, b) in near.into_iter().zip(far) {
                assert!((a - b).abs() < 1e-6 * 550e-6, "{dioptres}: {a} {b}");
            }
        }
    }

    #[test]
    fn paper_mode_fills_the_front_disc_evenly() {
        let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.5);
        let rays = rays_over_front(&lens, &point, 201);
        assert!((rays.len() as f64 / 201_f64.powi(2) - PI / 4.0).abs() < 0.01);
        assert!(rays.z_mm.iter().all(|z| *z == 0.0));
        let widest = (0..rays.len()).map(|i| rays.x_mm[i].hypot(rays.y_mm[i])).fold(0.0, f64::max);
        assert!((widest - 12.5).abs() < 1e-9, "{widest}");
    }
}
