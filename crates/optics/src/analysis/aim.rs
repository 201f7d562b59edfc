//! Aiming at the real stop: the rays of an object point that pass given places of it.

use glam::{DMat2, DVec2};

use crate::{MonoLens, ObjectPoint, PupilPlane, RayBatch, Vignetting};

/// Newton steps before an aim is given up from where it started.
const NEWTON_STEPS: usize = 25;
/// Distance over which slopes are taken, in units of the pupil's radius.
const SLOPE_STEP: f64 = 1e-5;
/// Distance from the goal at which a ray is held to hit it, in units of the stop's radius; rounding reaches 1e-15 near
/// the axis, and some hundred times as much at 85°.
const HIT: f64 = 1e-11;
/// The shortest piece of the way from the axis to the point that is tried.
const SHORTEST_PIECE: f64 = 1e-5;
/// Pieces, and halvings of them, after which a way is given up; 20 lead to the edge of a fisheye.
const MOST_PIECES: usize = 200;

/// Rays of one object point, aimed at places of the real stop: where they cross the plane of the paraxial entrance
/// pupil (of the first vertex, where that is infinitely far) or, of light that comes in across the axis or from behind,
/// the plane through the first vertex that faces it.
#[derive(Clone, Debug, PartialEq)]
pub struct StopAim {
    plane: PupilPlane,
    targets_mm: Vec<Option<DVec2>>,
}

impl StopAim {
    /// Finds the ray from `point` to each of these places in the stop, given in units of its radius; rims are ignored.
    ///
    /// Newton's method is led to the point's own rays from those of the axis, in pieces as long as it can bear, so
    /// that the strong pupil aberration of a fisheye does not lead it astray. What cannot be reached is `None`.
    pub fn find(lens: &MonoLens, point: &ObjectPoint, stop_places: &[DVec2]) -> Self {
        let search = Search::new(lens, point);
        let plane = search.plane(point);
        let lost = || Self { plane, targets_mm: vec![None; stop_places.len()] };
        let Some(chief) = search.lead(DVec2::ZERO, |share| (search.point_at(point, share), DVec2::ZERO)) else {
            return lost();
        };
        let Some(chief_slope) = search.slope(point, chief) else { return lost() };
        let aim_at = |&place: &DVec2| {
            let first = chief + chief_slope.inverse() * place;
            let direct = search.newton(point, place, first);
            direct.or_else(|| search.lead(chief, |share| (*point, place * share)))
        };
        Self { plane, targets_mm: stop_places.iter().map(aim_at).collect() }
    }

    /// The plane of the targets.
    pub fn plane(&self) -> &PupilPlane {
        &self.plane
    }

    /// Where each ray crosses that plane, mm; `None` for a place of the stop that no ray was found to.
    pub fn targets_mm(&self) -> &[Option<DVec2>] {
        &self.targets_mm
    }
}

struct Search<'a> {
    lens: &'a MonoLens,
    z_mm: f64,
    /// The radius of the entrance pupil or, where that is infinite, of the stop, mm.
    radius_mm: f64,
    /// Whether targets lie in planes that face the light: all the way, where it ends across the axis or behind.
    is_facing: bool,
}

impl<'a> Search<'a> {
    fn new(lens: &'a MonoLens, point: &ObjectPoint) -> Self {
        let first = lens.first_order();
        let (z_mm, radius_mm) = (first.entrance_pupil_z_mm, 0.5 * first.entrance_pupil_diameter_mm);
        let is_facing = matches!(point, ObjectPoint::Infinite(_)) && !PupilPlane::of(lens, point).is_across_axis();
        match z_mm.is_finite() && radius_mm.is_finite() {
            true => Self { lens, z_mm, radius_mm, is_facing },
            false => Self { lens, z_mm: 0.0, radius_mm: lens.stop_semi_aperture_mm(), is_facing },
        }
    }

    fn plane(&self, point: &ObjectPoint) -> PupilPlane {
        if self.is_facing { PupilPlane::facing(point) } else { PupilPlane::across_axis(self.z_mm) }
    }

    fn rays(&self, point: &ObjectPoint, targets_mm: &[DVec2]) -> RayBatch {
        self.plane(point).rays(self.lens, point, targets_mm)
    }

    /// Returns the point at a share of the angle from the axis.
    fn point_at(&self, point: &ObjectPoint, share: f64) -> ObjectPoint {
        let shrink = |tan: f64| if tan == 0.0 { 0.0 } else { (share * tan.atan()).tan() / tan };
        match *point {
            ObjectPoint::Infinite(direction) => {
                let across = direction.truncate();
                ObjectPoint::far(share * across.length().atan2(direction.z), -across)
            }
            ObjectPoint::Finite(place) => {
                let factor = shrink(place.truncate().length() / (self.z_mm - place.z));
                ObjectPoint::Finite((place.truncate() * factor).extend(place.z))
            }
        }
    }

    /// Returns where the rays to these targets pass the stop, in units of its radius, if all of them do.
    fn at_stop<const N: usize>(&self, point: &ObjectPoint, targets_mm: [DVec2; N]) -> Option<[DVec2; N]> {
        let mut rays = self.rays(point, &targets_mm);
        self.lens.trace_surfaces(0..self.lens.stop() + 1, &mut rays, Vignetting::Off);
        let radius_mm = self.lens.stop_semi_aperture_mm();
        let all = rays.n_in_flight() == N;
        all.then(|| std::array::from_fn(|i| self.lens.in_stop_mm(rays.point_mm(i)) / radius_mm))
    }

    /// Returns how the place in the stop moves with the target, per mm.
    fn slope(&self, point: &ObjectPoint, target_mm: DVec2) -> Option<DMat2> {
        let h = SLOPE_STEP * self.radius_mm;
        let around = [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|side| target_mm + side * h);
        let [right, left, up, down] = self.at_stop(point, around)?;
        let slope = DMat2::from_cols(right - left, up - down) * (0.5 / h);
        (slope.determinant() != 0.0).then_some(slope)
    }

    /// Returns the target of the ray to this place of the stop by Newton's method, or `None` when it strays.
    fn newton(&self, point: &ObjectPoint, place: DVec2, first_mm: DVec2) -> Option<DVec2> {
        let mut target_mm = first_mm;
        let mut miss = place - self.at_stop(point, [target_mm])?[0];
        for _ in 0..NEWTON_STEPS {
            if miss.length() <= HIT {
                // One step more takes what rounding leaves.
                return Some(target_mm + self.slope(point, target_mm)?.inverse() * miss);
            }
            let next_mm = target_mm + self.slope(point, target_mm)?.inverse() * miss;
            let next_miss = place - self.at_stop(point, [next_mm])?[0];
            // A step that does not bring the ray much nearer is on its way to elsewhere.
            if next_miss.length() > 0.5 * miss.length() {
                return None;
            }
            (target_mm, miss) = (next_mm, next_miss);
        }
        None
    }

    /// Follows a ray from share 0, where it is near `first_mm`, to share 1 of a way of points and places.
    fn lead(&self, first_mm: DVec2, way: impl Fn(f64) -> (ObjectPoint, DVec2)) -> Option<DVec2> {
        let (point, place) = way(0.0);
        let mut here = (0.0, self.newton(&point, place, first_mm)?);
        let mut rate_mm = DVec2::ZERO;
        let mut piece: f64 = 1.0;
        for _ in 0..MOST_PIECES {
            if here.0 >= 1.0 {
                return Some(here.1);
            }
            let share = (here.0 + piece).min(1.0);
            let (point, place) = way(share);
            match self.newton(&point, place, here.1 + rate_mm * (share - here.0)) {
                Some(target_mm) => {
                    rate_mm = (target_mm - here.1) / (share - here.0);
                    here = (share, target_mm);
                    piece *= 1.5;
                }
                None if piece > SHORTEST_PIECE => piece *= 0.5,
                None => return None,
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lens;

    /// Past 90° light comes from behind: its chief ray goes on moving outwards on the film, as steadily as before.
    #[test]
    fn chief_rays_go_on_beyond_90_degrees() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap().at(550.0).unwrap();
        let film_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let height_mm = |field_deg: f64| {
            let point = ObjectPoint::far(field_deg.to_radians(), DVec2::Y);
            -lens.chief_film_point_mm(&point, film_mm).expect("a chief ray").y
        };
        // Both planes of targets have the same ray.
        let from_front = ObjectPoint::far(89.0f64.to_radians(), DVec2::Y);
        let facing = Search { is_facing: true, ..Search::new(&lens, &from_front) };
        let way = |share| (facing.point_at(&from_front, share), DVec2::ZERO);
        let mut rays = facing.rays(&from_front, &[facing.lead(DVec2::ZERO, way).unwrap()]);
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film(&mut rays, film_mm);
        assert!((-rays.point_mm(0).y / height_mm(89.0) - 1.0).abs() < 1e-9);
        let heights: Vec<f64> = (0..=8).map(|i| height_mm(80.0 + 2.5 * f64::from(i))).collect();
        for steps in heights.windows(3).map(|h| [h[1] - h[0], h[2] - h[1]]) {
            // Steps of the angle lead ever less far, by no more than a quarter; a wrong sign would be a hundred times a step.
            assert!(steps[0] > 0.0 && (0.75..1.0).contains(&(steps[1] / steps[0])), "{heights:?}");
        }
    }

    fn point_at(lens: &MonoLens, field_deg: f64, dioptres: f64) -> ObjectPoint {
        let direction = DVec2::new(0.6, 0.8);
        ObjectPoint::from_field(lens, direction * field_deg.to_radians().tan(), dioptres)
    }

    /// Checks that rays through the aims pass the stop where they should.
    #[track_caller]
    fn check(lens: &MonoLens, point: &ObjectPoint, places: &[DVec2]) {
        let aim = StopAim::find(lens, point, places);
        let targets: Vec<DVec2> = aim.targets_mm().iter().map(|target| target.expect("the aim is found")).collect();
        let mut rays = aim.plane().rays(lens, point, &targets);
        lens.trace_surfaces(0..lens.stop() + 1, &mut rays, Vignetting::Off);
        for (i, place) in places.iter().enumerate() {
            let miss = (rays.point_mm(i).truncate() / lens.stop_semi_aperture_mm() - *place).length();
            assert!(rays.fate[i].is_in_flight() && miss < 2.0 * HIT, "{i}: {miss:e}");
        }
    }

    #[test]
    fn every_place_of_the_stop_is_hit_even_at_the_edge_of_a_fisheye() {
        let places: Vec<DVec2> =
            (0..40).map(|i| DVec2::from_angle(2.4 * f64::from(i)) * (f64::from(i) / 39.0)).collect();
        for (name, fields_deg) in [
            ("dgauss-50mm", &[0.0, 10.0, 20.0][..]),
            ("paper-2el", &[0.0, 12.0]),
            ("telephoto-127mm", &[0.0, 5.0]),
            ("fisheye-12.5mm", &[0.0, 30.0, 60.0, 75.0]),
        ] {
            let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
            for &field_deg in fields_deg {
                for dioptres in [0.0, 1.0] {
                    check(&lens, &point_at(&lens, field_deg, dioptres), &places);
                }
            }
        }
    }

    #[test]
    fn the_chief_ray_of_a_fisheye_is_found_to_85_degrees() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap().at(550.0).unwrap();
        let mut before_mm = 0.0;
        for field_deg in [5.0, 25.0, 45.0, 65.0, 80.0, 85.0] {
            let point = point_at(&lens, field_deg, 0.0);
            check(&lens, &point, &[DVec2::ZERO]);
            let aim = StopAim::find(&lens, &point, &[DVec2::ZERO]);
            let target_mm = aim.targets_mm()[0].unwrap();
            // The pupil walks outwards, faster and faster, in the plane of the field.
            assert!(target_mm.perp_dot(DVec2::new(0.6, 0.8)).abs() < 1e-9 * target_mm.length());
            assert!(target_mm.length() > before_mm, "{field_deg}: {target_mm}");
            before_mm = target_mm.length();
        }
    }

    #[test]
    fn a_stop_in_front_is_its_own_pupil() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let places = [DVec2::new(0.3, -0.9), DVec2::ZERO];
        let aim = StopAim::find(&lens, &point_at(&lens, 30.0, 2.0), &places);
        for (target, place) in aim.targets_mm().iter().zip(places) {
            assert!((target.unwrap() - 5.0 * place).length() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_reached_is_none() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        // No ray comes so steeply, and none reaches a place ten radii out.
        let steep = StopAim::find(&lens, &point_at(&lens, 80.0, 0.0), &[DVec2::ZERO]);
        assert_eq!(steep.targets_mm(), [None]);
        let far = StopAim::find(&lens, &point_at(&lens, 0.0, 0.0), &[DVec2::ZERO, DVec2::new(10.0, 0.0)]);
        assert!(far.targets_mm()[0].is_some() && far.targets_mm()[1].is_none());
    }
}
