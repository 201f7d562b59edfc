//! Beams of rays from an object point, and their way to the film without being stored.

use glam::{DVec2, DVec3};
use multiversion::multiversion;

use crate::{
    MonoLens, ObjectPoint, RayBatch, RayBatchF32, RayFate, Vignetting,
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

/// How rays from an object point start, of path length 0 for the one aimed at the axis.
pub(crate) struct Aim<'a> {
    point: &'a ObjectPoint,
    z_mm: f64,
    start_z_mm: f64,
    reference_mm: DVec3,
    /// Of the medium that the rays start in.
    index: f64,
}

impl<'a> Aim<'a> {
    /// Aims at targets in the plane `z_mm`; rays start on the plane `start_z_mm`.
    pub(crate) fn new(point: &'a ObjectPoint, z_mm: f64, start_z_mm: f64) -> Self {
        let aim = Self { point, z_mm, start_z_mm, reference_mm: DVec3::ZERO, index: 1.0 };
        let (reference_mm, _) = aim.start(DVec2::ZERO);
        Self { reference_mm, ..aim }
    }

    /// The same in a medium of this index.
    pub(crate) fn within(self, index: f64) -> Self {
        Self { index, ..self }
    }

    /// Returns the start and the direction of the ray towards a target.
    #[inline(always)]
    fn start(&self, target_mm: DVec2) -> (DVec3, DVec3) {
        let target_mm = target_mm.extend(self.z_mm);
        let direction = self.point.direction_to(target_mm);
        // Where the pupil appears behind the object, light runs as though it came from the target.
        let direction = direction * 1.0_f64.copysign(direction.z);
        (target_mm + direction * ((self.start_z_mm - self.z_mm) / direction.z), direction)
    }

    /// Returns the start, the direction and the path length of the ray towards a target.
    #[inline(always)]
    pub(crate) fn ray(&self, target_mm: DVec2) -> (DVec3, DVec3, f64) {
        let (start_mm, direction) = self.start(target_mm);
        (start_mm, direction, self.index * self.point.path_difference_mm(start_mm, self.reference_mm))
    }
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

impl MonoLens {
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

#[cfg(test)]
mod tests {
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
}
