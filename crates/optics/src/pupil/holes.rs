//! Sums over pupils with holes.

use glam::DVec3;

use super::PupilRegion;
use crate::{MonoLens, ObjectPoint};

/// Azimuths of the outline of a pupil whose area is wanted: a multiple of 8, so that corners of squares are among them.
const AREA_AZIMUTHS: usize = 192;

impl MonoLens {
    /// Hands the lens as a sum of lenses without obscurations, each with its sign: the lens without them, less that of each
    /// obscuration inverted, plus those of each two of them, and so on.
    ///
    /// `visit` returns whether light gets through; where none does, none gets through with further obscurations inverted,
    /// and those are left out. The number of parts doubles with each obscuration that lies over all others.
    pub fn for_each_clear_part(&self, visit: &mut dyn FnMut(&Self, f64) -> bool) {
        if self.n_obscurations() == 0 {
            visit(self, 1.0);
        } else if visit(&self.with_obscurations_inverted(&[]), 1.0) {
            self.visit_inverted(visit, &mut vec![]);
        }
    }

    fn visit_inverted(&self, visit: &mut dyn FnMut(&Self, f64) -> bool, inverted: &mut Vec<usize>) {
        for next in inverted.last().map_or(0, |last| last + 1)..self.n_obscurations() {
            inverted.push(next);
            let sign = if inverted.len() % 2 == 1 { -1.0 } else { 1.0 };
            if visit(&self.with_obscurations_inverted(inverted), sign) {
                self.visit_inverted(visit, inverted);
            }
            inverted.pop();
        }
    }

    /// Returns a quantity that adds up over the pupil (its area, a solid angle), for what obscurations leave clear of it;
    /// `of` gives it for lenses without any, and 0 where no light gets through.
    pub fn over_clear_pupil(&self, of: &dyn Fn(&Self) -> f64) -> f64 {
        let mut sum = 0.0;
        self.for_each_clear_part(&mut |part, sign| {
            let here = of(part);
            sum += sign * here;
            here != 0.0
        });
        sum
    }

    /// The f-number for a far object of the round beam with as much light as gets through on the axis, what obscurations stop left
    /// out: the focal length over 2 √(A/π) of the pupil's area A. `None` where no light does, or the lens has no power.
    ///
    /// Of a lens with round rims alone it is [`real_f_number`](Self::real_f_number); a rectangular stop, or one with a hole, has
    /// the light, and so the exposure, of this f-number.
    pub fn f_number_of_light(&self) -> Option<f64> {
        let point = ObjectPoint::Infinite(DVec3::Z);
        let area_mm2 = self.over_clear_pupil(&|lens: &Self| {
            PupilRegion::find(lens, &point, AREA_AZIMUTHS).map_or(0.0, |region| region.area_mm2())
        });
        let f_number = self.first_order_of_stop().efl_mm.abs() / (2.0 * (area_mm2 / std::f64::consts::PI).sqrt());
        (area_mm2 > 0.0 && f_number.is_finite()).then_some(f_number)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec3;

    use crate::{Aperture, Lens, MonoLens, ObjectPoint, Outline, PupilBoundary, analysis::projected_solid_angle};

    fn lens(apertures: &[(Outline, [f64; 2])]) -> MonoLens {
        let thin = Lens::thin(50.0, 10.0).unwrap();
        let aperture = |(outline, center_mm): &(Outline, [f64; 2])| Aperture {
            surface: 0,
            outline: outline.clone(),
            center_mm: *center_mm,
            is_obscuration: true,
        };
        let apertures = apertures.iter().map(aperture).collect();
        let lens = Lens::new_with_apertures("holed", "test", thin.interfaces().to_vec(), 0, apertures);
        lens.unwrap().at(550.0).unwrap()
    }

    #[test]
    fn what_two_discs_stop_is_counted_once() {
        let disc = |radius_mm, x| (Outline::Circle { radius_mm }, [x, 0.0]);
        // Apart; within one another; over one another by the lens of two circles of radius 1 at a distance of 1; under a third;
        // outside the rim.
        let overlap = 2.0 * PI / 3.0 - 0.75f64.sqrt();
        for (apertures, stopped_mm2) in [
            (vec![disc(1.0, 2.0), disc(1.5, -2.0)], 3.25 * PI),
            (vec![disc(2.0, 0.0), disc(1.0, 0.5)], 4.0 * PI),
            (vec![disc(1.0, 0.5), disc(1.0, -0.5)], 2.0 * PI - overlap),
            (vec![disc(1.0, 0.5), disc(1.0, -0.5), disc(3.0, 0.0)], 9.0 * PI),
            (vec![disc(1.0, 7.0)], 0.0),
        ] {
            let lens = lens(&apertures);
            let point = ObjectPoint::Infinite(DVec3::Z);
            let area = |lens: &MonoLens| PupilBoundary::find(lens, &point, 720).map_or(0.0, |pupil| pupil.area_mm2());
            let found = lens.over_clear_pupil(&area);
            // 720 azimuths about a kink of the edge: a part in 1e5.
            assert!((found - (25.0 * PI - stopped_mm2)).abs() < 1e-3, "{apertures:?}: {found}");
        }
    }

    #[test]
    fn an_annulus_lights_the_film_by_its_own_cone() {
        let holed = lens(&[(Outline::Circle { radius_mm: 2.5 }, [0.0; 2])]);
        let point = ObjectPoint::Infinite(DVec3::Z);
        let sine2 = |radius_mm: f64| radius_mm * radius_mm / (radius_mm * radius_mm + 2500.0);
        let found = projected_solid_angle(&holed, &point, 64);
        assert!((found / (PI * (sine2(5.0) - sine2(2.5))) - 1.0).abs() < 1e-5, "{found}");
    }
}
