//! Field curvature: where the rays close to a chief ray come together.

use glam::DVec2;

use super::aim::StopAim;
use crate::{MonoLens, ObjectPoint, Vignetting};

/// Distance of the outer close rays from the chief ray in the pupil, in units of the pupil's radius.
const CLOSE: f64 = 2e-3;

/// Where the rays close to the chief ray of a point come to a line, as Coddington's equations have it.
///
/// Distances are along the axis from the last vertex, mm; infinite where the close rays leave in parallel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AstigmaticFoci {
    /// Of the rays in the plane of the chief ray and the axis.
    pub tangential_mm: f64,
    /// Of the rays beside it.
    pub sagittal_mm: f64,
}

impl AstigmaticFoci {
    /// Finds the foci on the real chief ray, the one through the middle of the stop; `None` if there is none.
    ///
    /// They are the limit of real rays: slopes from five places of the pupil, with an error of its fourth power,
    /// 1e-11 of the focal length. So they hold for every shape of surface that can be traced.
    pub fn find(lens: &MonoLens, point: &ObjectPoint) -> Option<Self> {
        let close = CloseRays::about_chief(lens, point)?;
        let across = match point {
            ObjectPoint::Finite(place) => place.truncate(),
            ObjectPoint::Infinite(direction) => -direction.truncate(),
        };
        let tangential = across.try_normalize().unwrap_or(DVec2::Y);
        let focus_mm = |direction: DVec2| close.focus_mm(direction);
        Some(Self { tangential_mm: focus_mm(tangential)?, sagittal_mm: focus_mm(tangential.perp())? })
    }
}

/// Where the close rays of a pupil's own axes come nearest to the chief ray: what astigmatism is for a lens without an
/// axis of symmetry.
///
/// Distances are along the film's axis from the last vertex, mm; infinite where the close rays leave in parallel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisFoci {
    /// Of the rays beside the chief ray along x.
    pub x_mm: f64,
    /// Of the rays above and below it.
    pub y_mm: f64,
}

impl AxisFoci {
    /// Finds the foci on the real chief ray, as [`AstigmaticFoci::find`] does; `None` if there is none.
    ///
    /// Rays that pass the chief ray askew have their focus where they are nearest to it in the film's plane.
    pub fn find(lens: &MonoLens, point: &ObjectPoint) -> Option<Self> {
        let close = CloseRays::about_chief(lens, point)?;
        Some(Self { x_mm: close.focus_mm(DVec2::X)?, y_mm: close.focus_mm(DVec2::Y)? })
    }
}

/// The rays close to a chief ray.
struct CloseRays<'a> {
    lens: &'a MonoLens,
    point: &'a ObjectPoint,
    aim: StopAim,
    chief_mm: DVec2,
}

impl<'a> CloseRays<'a> {
    fn about_chief(lens: &'a MonoLens, point: &'a ObjectPoint) -> Option<Self> {
        let aim = StopAim::find(lens, point, &[DVec2::ZERO]);
        let chief_mm = aim.targets_mm()[0]?;
        Some(Self { lens, point, aim, chief_mm })
    }

    /// Returns where rays that differ from the chief ray in this direction of the pupil come nearest to it, from the last
    /// vertex, mm.
    fn focus_mm(&self, direction: DVec2) -> Option<f64> {
        let Self { lens, point, aim, chief_mm } = self;
        let radius_mm = match 0.5 * lens.first_order().entrance_pupil_diameter_mm {
            radius_mm if radius_mm.is_finite() => radius_mm,
            _ => lens.stop_semi_aperture_mm(),
        };
        let h = 0.5 * CLOSE * radius_mm;
        let targets_mm = [-2.0, -1.0, 1.0, 2.0].map(|share| chief_mm + direction * (share * h));
        let mut rays = aim.plane().rays(lens, point, &targets_mm);
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film_plane(&mut rays, 0.0);
        if rays.n_in_flight() < targets_mm.len() {
            return None;
        }
        let turn = lens.film_placement(0.0).rotation.transpose();
        let slope = |of: &dyn Fn(usize) -> DVec2| 8.0 * (of(2) - of(1)) - (of(3) - of(0));
        let place = slope(&|i| lens.on_film_mm(rays.point_mm(i), 0.0));
        let tangent = slope(&|i| {
            let direction = turn * rays.direction(i);
            direction.truncate() / direction.z
        });
        let squared = tangent.length_squared();
        Some(if squared == 0.0 { f64::INFINITY } else { -place.dot(tangent) / squared })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{Glass, Interface, Lens, Surface};

    #[test]
    fn one_surface_obeys_coddingtons_equations() {
        // A sphere with the stop on it, light from a far point at an angle: n' cos²θ'/t' − n cos²θ/t = P = n'/s' − n/s.
        let (radius_mm, index) = (30.0, 1.6);
        let surface = Surface::sphere(radius_mm, 3.0);
        let interface = Interface { surface, medium_after: Glass::Constant { index }, thickness_after_mm: 0.0 };
        let lens = Lens::new("sphere", "test", vec![interface], 0).unwrap().at(550.0).unwrap();
        for field_deg in [0.0f64, 10.0, 35.0, 60.0] {
            let theta = field_deg.to_radians();
            let theta_after = (theta.sin() / index).asin();
            let power = (index * theta_after.cos() - theta.cos()) / radius_mm;
            for distance_mm in [f64::INFINITY, 200.0] {
                let (point, vergence) = match distance_mm.is_infinite() {
                    true => (ObjectPoint::Infinite(DVec3::new(0.0, -theta.sin(), theta.cos())), 0.0),
                    false => {
                        let place = DVec3::new(0.0, theta.sin(), -theta.cos()) * distance_mm;
                        (ObjectPoint::Finite(place), -1.0 / distance_mm)
                    }
                };
                let t = index * theta_after.cos().powi(2) / (power + theta.cos().powi(2) * vergence);
                let s = index / (power + vergence);
                let foci = AstigmaticFoci::find(&lens, &point).unwrap();
                // The lengths are along the chief ray, which passes the vertex.
                for (found, along) in [(foci.tangential_mm, t), (foci.sagittal_mm, s)] {
                    let expected = along * theta_after.cos();
                    assert!((found / expected - 1.0).abs() < 1e-10, "{field_deg}°: {found}, expected {expected}");
                }
            }
        }
    }

    #[test]
    fn small_fields_bend_as_the_seidel_sums_say() {
        for name in ["dgauss-50mm", "tessar-50mm", "singlet-50mm"] {
            let lens = Lens::built_in(name).unwrap();
            let mono = lens.at(550.0).unwrap();
            let settings = crate::SeidelSettings {
                wavelength_nm: 550.0,
                colors_nm: [500.0, 600.0],
                object_distance_mm: f64::INFINITY,
                chief_slope: 0.01,
            };
            let sums = lens.seidel(&settings).unwrap();
            let first = mono.first_order();
            let marginal = 0.5 * first.entrance_pupil_diameter_mm / first.efl_mm;
            // Longitudinal: δz = −ΔW's curvature: sagittal (S3 + S4) / 2 u'², tangential (3 S3 + S4) / 2 u'².
            let [sagittal, tangential] =
                [1.0, 3.0].map(|k| -(k * sums.total.s3 + sums.total.s4) / (2.0 * marginal * marginal));
            let point = ObjectPoint::from_field(&mono, DVec2::new(0.0, 0.01), 0.0);
            let foci = AstigmaticFoci::find(&mono, &point).unwrap();
            for (found, expected) in [(foci.sagittal_mm, sagittal), (foci.tangential_mm, tangential)] {
                let bend_mm = found - first.bfl_mm;
                // Fifth-order terms are smaller by the square of the slope, times some tens.
                assert!((bend_mm / expected - 1.0).abs() < 0.01, "{name}: {bend_mm} {expected}");
            }
        }
    }

    #[test]
    fn an_ideal_lens_has_a_flat_field() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        for field_tan in [0.0, 0.3, 1.0] {
            let foci = AstigmaticFoci::find(&lens, &ObjectPoint::from_field(&lens, DVec2::X * field_tan, 0.0)).unwrap();
            assert!((foci.tangential_mm - 50.0).abs() < 1e-9 && (foci.sagittal_mm - 50.0).abs() < 1e-9, "{foci:?}");
        }
    }

    #[test]
    fn rays_of_a_tiny_stop_meet_there() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let tiny = lens.with_f_number(200.0, 550.0).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&tiny, DVec2::new(0.0, 0.25), 0.5);
        let foci = AstigmaticFoci::find(&tiny, &point).unwrap();
        for (direction, focus_mm) in [(DVec2::Y, foci.tangential_mm), (DVec2::X, foci.sagittal_mm)] {
            let sampling = crate::analysis::PupilSampling {
                coordinates: crate::analysis::PupilCoordinates::stop(&tiny),
                places: vec![-direction, direction],
                rims: Vignetting::Off,
            };
            let rays = sampling.rays_on_film(&tiny, &point, focus_mm);
            let apart = (rays.point_mm(1) - rays.point_mm(0)).truncate().dot(direction);
            // The pair is 0.25 mm apart at the pupil; what is left is of third order in it.
            assert!(apart.abs() < 1e-6, "{apart:e}");
        }
    }
}
