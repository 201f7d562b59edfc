//! How much light the exit cone holds.

use glam::{DQuat, DVec2, DVec3};

use crate::{MonoLens, ObjectPoint, PupilBoundary, PupilRegion, Vignetting};

/// Returns the projected solid angle of the cone of light that arrives at the image of a point, times the square of the
/// image space's index over the object space's, sr: the irradiance there for a uniform scene of radiance 1; 0 where no
/// light gets through. What surfaces and glass take is left out; of the light that diffractive surfaces send into other orders it is left out.
///
/// The solid angle is the area that the rays' direction cosines (l, m) fill; its edge is that of the true, vignetted
/// pupil, found at `n_azimuths` (rounded up to an even number), less what obscurations stop. It is exact for a sharp image; where aberrations are
/// large, film points see slightly other pupils than the object point does. Its ratio to that on the axis is the
/// relative illumination.
pub fn projected_solid_angle(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize) -> f64 {
    projected_solid_angle_onto(lens, point, n_azimuths, DVec3::Z)
}

/// Returns the same for a film with this normal at the image, a unit vector of the lens frame.
pub fn projected_solid_angle_onto(lens: &MonoLens, point: &ObjectPoint, n_azimuths: usize, normal: DVec3) -> f64 {
    let cone = |lens: &MonoLens| whole_cone(lens, point, n_azimuths.max(16).next_multiple_of(2), normal);
    lens.diffraction_efficiency() * lens.over_clear_pupil(&cone)
}

/// Places on each line across a region, and the distance, over the size of the region, across which directions are compared.
const N_ON_LINE: usize = 6;
const DIFFERENCE: f64 = 1e-6;

/// Returns the projected solid angle where there are no obscurations.
fn whole_cone(lens: &MonoLens, point: &ObjectPoint, n: usize, normal: DVec3) -> f64 {
    let turn = DQuat::from_rotation_arc(normal, DVec3::Z);
    let is_straight = normal == DVec3::Z;
    let in_film = |direction: DVec3| if is_straight { direction } else { turn * direction };
    let of_outline = |pupil: &PupilBoundary| {
        let mut rays = pupil.plane().rays(lens, point, &pupil.edge_mm());
        lens.trace(&mut rays, Vignetting::Off);
        let cosines: Vec<DVec2> = (0..rays.len()).map(|i| in_film(rays.direction(i)).truncate()).collect();
        let area = |step: usize| {
            let corners: Vec<DVec2> = cosines.iter().copied().step_by(step).collect();
            let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
            0.5 * pairs.map(|(a, b)| a.perp_dot(*b)).sum::<f64>().abs()
        };
        // A polygon falls short by the square of its sides; two of them show by how much.
        (4.0 * area(1) - area(2)) / 3.0
    };
    let of_nodes = |region: &PupilRegion| {
        let nodes = region.nodes(N_ON_LINE);
        let step_mm = DIFFERENCE * region.area_mm2().sqrt();
        let offsets = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y];
        let beside = nodes.iter().flat_map(|(place, _)| offsets.map(|offset| *place + step_mm * offset));
        let mut rays = region.plane().rays(lens, point, &beside.collect::<Vec<_>>());
        lens.trace(&mut rays, Vignetting::Off);
        let cosines = |i: usize| rays.fate[i].is_in_flight().then(|| in_film(rays.direction(i)).truncate());
        let area = |(i, (_, area_mm2)): (usize, &(DVec2, f64))| {
            let (over_x, over_y) = (cosines(4 * i)? - cosines(4 * i + 1)?, cosines(4 * i + 2)? - cosines(4 * i + 3)?);
            Some(area_mm2 * over_x.perp_dot(over_y) / (4.0 * step_mm * step_mm))
        };
        nodes.iter().enumerate().filter_map(area).sum::<f64>().abs()
    };
    let area = PupilRegion::find(lens, point, n).map_or(0.0, |region| match region.outline() {
        Some(outline) => of_outline(outline) * lens.mean_share(&region, point, N_ON_LINE),
        None => of_nodes(&region) * lens.mean_share(&region, point, N_ON_LINE),
    });
    (lens.image_index() / lens.object_index()).powi(2) * area
}

/// The steepest field of points in a plane before a lens that is looked at, degrees.
pub const STEEPEST_FIELD_DEG: f64 = 88.0;
/// The widest angle from the axis at which far points are looked at, degrees.
pub const WIDEST_FIELD_DEG: f64 = 120.0;

/// Returns the field angle, degrees, at which the illumination of a far point has fallen to a share of that on the axis
/// (by rims and cosines); `None` if none comes together on the axis, the widest of 120° if it has not fallen so far.
///
/// Twice this angle is a lens's field of view where its film sets no limit.
pub fn field_limit_deg(lens: &MonoLens, share: f64) -> Option<f64> {
    field_limits_deg(lens, [share])[0]
}

/// Returns the same for several shares, in less time than one after the other.
pub fn field_limits_deg<const N: usize>(lens: &MonoLens, shares: [f64; N]) -> [Option<f64>; N] {
    let point = |field_deg: f64| ObjectPoint::far(field_deg.to_radians(), DVec2::Y);
    let mut cones = Cones::of(lens, WIDEST_FIELD_DEG, &point);
    shares.map(|share| cones.limit_deg(share))
}

/// Returns the same along a direction of the field, a unit vector, for points `dioptres` = 1/Z away; of near ones at most 88°.
pub fn field_limit_along_deg(lens: &MonoLens, share: f64, direction: DVec2, dioptres: f64) -> Option<f64> {
    if dioptres == 0.0 {
        let point = |field_deg: f64| ObjectPoint::far(field_deg.to_radians(), direction);
        return Cones::of(lens, WIDEST_FIELD_DEG, &point).limit_deg(share);
    }
    let point = |field_deg: f64| ObjectPoint::from_field(lens, direction * field_deg.to_radians().tan(), dioptres);
    Cones::of(lens, STEEPEST_FIELD_DEG, &point).limit_deg(share)
}

/// The cones of light of points along a direction of the field.
struct Cones<'a> {
    lens: &'a MonoLens,
    last_deg: f64,
    /// The point of a field in degrees.
    point: &'a dyn Fn(f64) -> ObjectPoint,
    /// Projected solid angles from the axis on, a degree apart, as far as they were asked for.
    by_degree: Vec<f64>,
}

impl<'a> Cones<'a> {
    fn of(lens: &'a MonoLens, last_deg: f64, point: &'a dyn Fn(f64) -> ObjectPoint) -> Self {
        Self { lens, last_deg, point, by_degree: Vec::new() }
    }

    fn at(&self, field_deg: f64) -> f64 {
        const N_AZIMUTHS: usize = 48;
        projected_solid_angle(self.lens, &(self.point)(field_deg), N_AZIMUTHS)
    }

    fn at_degree(&mut self, degree: usize) -> f64 {
        while self.by_degree.len() <= degree {
            self.by_degree.push(self.at(self.by_degree.len() as f64));
        }
        self.by_degree[degree]
    }

    /// Returns the field at which the light has fallen to a share of that on the axis.
    fn limit_deg(&mut self, share: f64) -> Option<f64> {
        let least = share * self.at_degree(0);
        if least <= 0.0 {
            return None;
        }
        // The first degree that is too dark, then the place within it.
        let dark = (1..=self.last_deg as usize).find(|&degree| self.at_degree(degree) < least);
        let Some(dark) = dark else { return Some(self.last_deg) };
        let excesses = [dark - 1, dark].map(|degree| self.at_degree(degree) - least);
        Some(last_above_zero([dark as f64 - 1.0, dark as f64], excesses, 1e-4, |field_deg| self.at(field_deg) - least))
    }
}

/// Returns the last place, but for `within` or less, at which a function is not below 0 that falls below it between two: the ITP method (Oliveira & Takahashi 2020, An
/// enhancement of the bisection method average performance preserving minmax optimality), which takes one look more than halving at most.
fn last_above_zero(
    [mut above, mut below]: [f64; 2],
    [mut at_above, mut at_below]: [f64; 2],
    within: f64,
    function: impl Fn(f64) -> f64,
) -> f64 {
    let whole = below - above;
    let n_looks = (whole / within).log2().ceil() + 1.0;
    let mut projected = 0.5 * within * n_looks.exp2();
    while below - above > within {
        let half = 0.5 * (below - above);
        let middle = above + half;
        // Interpolated, moved a little towards the middle, and no farther from it than leaves enough looks to halve what is left.
        let straight = above + 2.0 * half * at_above / (at_above - at_below);
        let little = 0.2 * (2.0 * half).powi(2) / whole;
        let towards = (middle - straight).clamp(-little, little);
        let most = (projected - half).max(0.0);
        let place = middle + (straight + towards - middle).clamp(-most, most);
        let value = function(place);
        if value < 0.0 {
            (below, at_below) = (place, value);
        } else {
            (above, at_above) = (place, value);
        }
        projected *= 0.5;
    }
    above
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{Glass, Interface, Lens, Surface};

    #[test]
    fn a_small_hole_has_the_fourth_power_of_the_cosine() {
        let lens = Lens::pinhole(0.2).unwrap().at(550.0).unwrap();
        let cone = |degrees: f64| {
            let place = DVec3::new(0.0, -degrees.to_radians().tan(), -1.0) * 1000.0;
            projected_solid_angle(&lens, &ObjectPoint::Finite(place), 256)
        };
        // A disc of radius a at distance d: sin²u = a²/(a² + d²) of π on the axis.
        assert!((cone(0.0) / (PI * 1e-8 / (1.0 + 1e-8)) - 1.0).abs() < 1e-6);
        for degrees in [10.0f64, 40.0] {
            assert!((cone(degrees) / cone(0.0) / degrees.to_radians().cos().powi(4) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn on_the_axis_it_is_pi_sine_squared_in_any_medium() {
        for index in [1.0, 1.5] {
            let surface = Surface::sphere(20.0, 4.0);
            let front = Interface { surface, medium_after: Glass::Constant { index: 1.7 }, thickness_after_mm: 3.0 };
            let back = Interface {
                surface: Surface::sphere(-40.0, 5.0),
                medium_after: Glass::Constant { index },
                thickness_after_mm: 0.0,
            };
            let lens = Lens::new("thick", "test", vec![front, back], 0).unwrap().at(550.0).unwrap();
            let far = ObjectPoint::Infinite(DVec3::Z);
            let mut edge = lens.rays_towards(&far, &[DVec2::new(0.0, 4.0)], 0.0, 0.0);
            lens.trace(&mut edge, Vignetting::Off);
            let expected = PI * (index * edge.m[0]).powi(2);
            // The polygon is off by the fourth power of its sides: (2π / n)⁴ / 30.
            for (n, error) in [(64, 3.2e-6), (256, 1.3e-8)] {
                let found = projected_solid_angle(&lens, &far, n);
                assert!((found / expected - 1.0).abs() < error, "{found} {expected}");
            }
        }
    }

    #[test]
    fn darkness_is_zero() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(1.2, 0.0), 0.0);
        assert_eq!(projected_solid_angle(&lens, &point, 64), 0.0);
    }

    /// A smooth fall takes half the looks of halving, a step one more than it at most.
    #[test]
    fn falls_are_found_with_few_looks() {
        let check = |function: fn(f64) -> f64, expected: f64, most: usize| {
            let looks = std::cell::Cell::new(0);
            let counted = |x: f64| {
                looks.set(looks.get() + 1);
                function(x)
            };
            let found = last_above_zero([0.0, 1.0], [function(0.0), function(1.0)], 1e-4, counted);
            assert!((0.0..=1e-4).contains(&(expected - found)), "{found} {expected}");
            assert!(looks.get() <= most, "{} looks", looks.get());
        };
        check(|x| (1.0 - x).powi(3) - 0.2, 1.0 - 0.2f64.cbrt(), 7);
        check(|x| if x < 0.7341 { 0.4 } else { -1e-3 }, 0.7341, 15);
    }

    #[test]
    fn several_shares_are_those_one_by_one() {
        let lens = Lens::built_in("cooke-50mm").unwrap().at(550.0).unwrap();
        let shares = [0.5, 0.01, 0.8];
        assert_eq!(field_limits_deg(&lens, shares), shares.map(|share| field_limit_deg(&lens, share)));
    }

    #[test]
    fn the_field_ends_where_the_light_does() {
        let slow = Lens::thin(50.0, 0.5).unwrap().at(550.0).unwrap();
        // cos⁴ = 1/4 at 45°, but for the square of the aperture's angle, 2.5e-5.
        assert!((field_limit_deg(&slow, 0.25).unwrap() - 45.0).abs() < 2e-3);
        // Far light leaves a hole in parallel: it forms no image.
        assert_eq!(field_limit_deg(&Lens::pinhole(0.2).unwrap().at(550.0).unwrap(), 0.25), None);
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let [half, tenth] = [0.5, 0.1].map(|share| field_limit_deg(&lens, share).unwrap());
        assert!(5.0 < half && half < tenth && tenth < 35.0, "{half} {tenth}");
        assert!(field_limit_deg(&Lens::built_in("fisheye-12.5mm").unwrap().at(550.0).unwrap(), 0.1).unwrap() > 70.0);
    }
}
