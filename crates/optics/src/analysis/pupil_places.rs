//! Places in the pupil: what they are fractions of, the usual patterns of them, and the rays through them.

use std::f64::consts::TAU;

use glam::DVec2;

use super::aim::StopAim;
use crate::{MonoLens, ObjectPoint, PupilBoundary, RayBatch, RayFate, Vignetting};

/// What places in the pupil are fractions of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PupilCoordinates {
    /// The paraxial entrance pupil: the place (1, 0) lies `radius_mm` right of the axis in the plane `z_mm`.
    ///
    /// One plane and radius, of a reference wavelength, should serve all wavelengths that are compared.
    Entrance {
        /// z of its plane from the first vertex, mm.
        z_mm: f64,
        /// Its radius, mm.
        radius_mm: f64,
    },
    /// The real stop: rays are aimed at it, whatever the aberration of the pupil.
    Stop {
        /// The radius that a place at distance 1 has, mm.
        radius_mm: f64,
    },
    /// The real, vignetted pupil of each point: a place at distance 1 lies on its edge, in the same direction from its
    /// middle. It serves where the stop is wider than the light that the rims let through.
    Vignetted,
}

impl PupilCoordinates {
    /// Returns fractions of the entrance pupil of this lens, or of its stop where the pupil is infinite.
    pub fn entrance(lens: &MonoLens) -> Self {
        let first = lens.first_order();
        let (z_mm, radius_mm) = (first.entrance_pupil_z_mm, 0.5 * first.entrance_pupil_diameter_mm);
        if z_mm.is_finite() && radius_mm.is_finite() { Self::Entrance { z_mm, radius_mm } } else { Self::stop(lens) }
    }

    /// Returns fractions of the stop of this lens.
    pub fn stop(lens: &MonoLens) -> Self {
        Self::Stop { radius_mm: lens.stop_semi_aperture_mm() }
    }

    /// Returns the rays from a point through these places, before the lens, with path lengths as those of
    /// [`MonoLens::rays_towards`].
    ///
    /// A place of the stop that no ray reaches gives a ray that has ended, missing the stop.
    pub fn rays(&self, lens: &MonoLens, point: &ObjectPoint, places: &[DVec2]) -> RayBatch {
        match *self {
            Self::Entrance { z_mm, radius_mm } => {
                let targets_mm: Vec<DVec2> = places.iter().map(|place| *place * radius_mm).collect();
                lens.rays_towards(point, &targets_mm, z_mm, 0.0)
            }
            Self::Vignetted => {
                let Some(pupil) = PupilBoundary::find(lens, point, EDGE_AZIMUTHS) else {
                    let mut rays = lens.rays_towards(point, &vec![DVec2::ZERO; places.len()], 0.0, 0.0);
                    rays.fate.fill(RayFate::Missed { surface: lens.stop() as u16 });
                    return rays;
                };
                let on_edge = |place: &DVec2| *place * (WITHIN_EDGE * pupil.rho_max_mm(place.to_angle()));
                let targets_mm: Vec<DVec2> = places.iter().map(|place| pupil.center_mm() + on_edge(place)).collect();
                pupil.plane().rays(lens, point, &targets_mm)
            }
            Self::Stop { radius_mm } => {
                let scale = radius_mm / lens.stop_semi_aperture_mm();
                let scaled: Vec<DVec2> = places.iter().map(|place| *place * scale).collect();
                let aim = StopAim::find(lens, point, &scaled);
                let targets_mm: Vec<DVec2> = aim.targets_mm().iter().map(|t| t.unwrap_or(DVec2::ZERO)).collect();
                let mut rays = aim.plane().rays(lens, point, &targets_mm);
                for (fate, target) in rays.fate.iter_mut().zip(aim.targets_mm()) {
                    if target.is_none() {
                        *fate = RayFate::Missed { surface: lens.stop() as u16 };
                    }
                }
                rays
            }
        }
    }
}

/// Azimuths at which the edge of a vignetted pupil is found, and how near to it outermost rays pass.
const EDGE_AZIMUTHS: usize = 192;
const WITHIN_EDGE: f64 = 1.0 - 1e-9;

/// Which rays of a point are traced.
#[derive(Clone, Debug, PartialEq)]
pub struct PupilSampling {
    /// What the places are fractions of.
    pub coordinates: PupilCoordinates,
    /// A place of the pupil for each ray.
    pub places: Vec<DVec2>,
    /// Whether rims end rays.
    pub rims: Vignetting,
}

impl PupilSampling {
    /// Returns the rays of a point on the film as it is curved, `film_distance_mm` behind the last vertex, or where they ended.
    pub fn rays_on_film(&self, lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64) -> RayBatch {
        let mut rays = self.coordinates.rays(lens, point, &self.places);
        lens.trace(&mut rays, self.rims);
        lens.to_film(&mut rays, film_distance_mm);
        rays
    }

    /// Returns the chief ray alone, the one through the middle of the pupil, which no rim ends.
    pub fn chief(&self) -> Self {
        Self { places: vec![DVec2::ZERO], rims: Vignetting::Off, ..*self }
    }
}

/// Returns the center of the pupil and rings about it, the k-th of 6k places beginning on +x: 1 + 3 n (n + 1) places of
/// about equal areas.
pub fn hexapolar(n_rings: usize) -> Vec<DVec2> {
    let ring = |k: usize| {
        let place = move |i: usize| DVec2::from_angle(TAU * i as f64 / (6 * k) as f64) * (k as f64 / n_rings as f64);
        (0..6 * k).map(place)
    };
    std::iter::once(DVec2::ZERO).chain((1..=n_rings).flat_map(ring)).collect()
}

/// Returns `n` places (at least 2) from −1 to 1 along a direction of the pupil.
pub fn pupil_line(direction: DVec2, n: usize) -> Vec<DVec2> {
    let n = n.max(2);
    (0..n).map(|i| direction * (2.0 * i as f64 / (n - 1) as f64 - 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lens;

    #[test]
    fn patterns_have_their_numbers_and_middles() {
        let rings = hexapolar(12);
        assert_eq!(rings.len(), 469);
        assert!(rings.iter().sum::<DVec2>().length() < 1e-12);
        assert_eq!(pupil_line(DVec2::Y, 3), [DVec2::NEG_Y, DVec2::ZERO, DVec2::Y]);
    }

    #[test]
    fn both_coordinates_agree_where_the_pupil_has_no_aberration() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.2), 1.0);
        let places = hexapolar(3);
        let entrance = PupilCoordinates::entrance(&lens).rays(&lens, &point, &places);
        let stop = PupilCoordinates::stop(&lens).rays(&lens, &point, &places);
        for i in 0..places.len() {
            assert!((entrance.point_mm(i) - stop.point_mm(i)).length() < 1e-12);
        }
    }

    #[test]
    fn a_place_that_no_ray_reaches_is_a_ray_that_has_ended() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.0);
        let mut rays = PupilCoordinates::stop(&lens).rays(&lens, &point, &[DVec2::X * 20.0, DVec2::X * 0.5]);
        lens.trace(&mut rays, Vignetting::Off);
        assert_eq!(rays.fate, [RayFate::Missed { surface: lens.stop() as u16 }, RayFate::InFlight]);
    }
}
