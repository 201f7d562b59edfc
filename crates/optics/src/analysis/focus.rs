//! Best focus by the sizes of spots.

use glam::DVec2;

use super::pupil_light::{PupilLight, PupilRule};
use crate::{MonoLens, ObjectPoint, RayBatch};

/// Rays on a film, gathered to find where their spots are smallest.
///
/// The root-mean-square size of a spot is a parabola in the film's place, so the best place follows from the rays at
/// one place, without a search.
#[derive(Clone, Copy, Debug, Default)]
pub struct FocusRays {
    /// Sum over spots of the mean square size, mm².
    size_mm2: f64,
    /// Half its slope with the film's place, mm.
    slope_mm: f64,
    /// Half its curvature.
    bend: f64,
    /// The sum of the weights of the spots.
    n_spots: f64,
}

/// Where a ray meets the film, how that place moves as the film moves on, and how much light it stands for.
#[derive(Clone, Copy)]
struct FocusRay {
    place: DVec2,
    slope: DVec2,
    weight: f64,
}

/// Moves of a curved film after the first, at most, and the move that is none, mm.
const ROUNDS: usize = 20;
const AT_REST_MM: f64 = 1e-10;

impl FocusRays {
    /// Adds a spot: the rays of one point on a flat film, of several wavelengths if its colors are to coincide; all count
    /// alike.
    pub fn add(&mut self, wavelengths: &[RayBatch]) {
        let arrived = |rays: &RayBatch| (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect::<Vec<_>>();
        let ray = |rays: &RayBatch, i: usize| FocusRay {
            place: rays.point_mm(i).truncate(),
            slope: rays.direction(i).truncate() / rays.n[i].abs(),
            weight: 1.0,
        };
        self.add_rays(
            &wavelengths
                .iter()
                .flat_map(|rays| arrived(rays).into_iter().map(move |i| ray(rays, i)))
                .collect::<Vec<_>>(),
            1.0,
        );
    }

    /// Adds the spot of a point's light, of wavelengths that count by their weights, on the film of a lens, `film_distance_mm` behind its
    /// last vertex, however it is curved and stands.
    fn add_on_film(&mut self, lens: &MonoLens, film_distance_mm: f64, wavelengths: &[(PupilLight, f64)], weight: f64) {
        let placement = lens.film_placement(film_distance_mm);
        let ray = |rays: &RayBatch, i: usize, weight: f64| {
            let place = lens.on_film_mm(rays.point_mm(i), film_distance_mm);
            let direction = placement.rotation.transpose() * rays.direction(i);
            let slope = direction.truncate() / direction.z;
            // As a sloping film moves on, a ray meets it sooner or later.
            FocusRay { place, slope: slope / (1.0 - slope.dot(lens.image_surface().slope_at(place))), weight }
        };
        let of_light = |(light, of_color): &(PupilLight, f64)| -> Vec<FocusRay> {
            light.weights().iter().enumerate().map(|(i, weight)| ray(light.rays(), i, of_color * weight)).collect()
        };
        self.add_rays(&wavelengths.iter().flat_map(of_light).collect::<Vec<_>>(), weight);
    }

    /// Adds a spot of rays, which counts so much.
    fn add_rays(&mut self, rays: &[FocusRay], weight: f64) {
        let total: f64 = rays.iter().map(|ray| ray.weight).sum();
        if total <= 0.0 {
            return;
        }
        let mean = |of: &dyn Fn(&FocusRay) -> DVec2| rays.iter().map(|ray| of(ray) * ray.weight).sum::<DVec2>() / total;
        let (place, slope) = (mean(&|ray| ray.place), mean(&|ray| ray.slope));
        for ray in rays {
            let (p, s, share) = (ray.place - place, ray.slope - slope, weight * ray.weight / total);
            self.size_mm2 += p.length_squared() * share;
            self.slope_mm += p.dot(s) * share;
            self.bend += s.length_squared() * share;
        }
        self.n_spots += weight;
    }

    /// Returns how far to move the film, mm, for the least mean square of the spots; `None` where it does not matter.
    pub fn shift_mm(&self) -> Option<f64> {
        (self.bend > 0.0).then(|| -self.slope_mm / self.bend)
    }

    /// Returns the root mean square of the spots on a film moved by this much, mm.
    pub fn rms_mm(&self, shift_mm: f64) -> f64 {
        let total = self.size_mm2 + shift_mm * (2.0 * self.slope_mm + shift_mm * self.bend);
        (total / self.n_spots).max(0.0).sqrt()
    }
}

/// What a camera focuses on.
#[derive(Clone, Debug)]
pub struct Autofocus<'a> {
    /// The lens at each wavelength that counts.
    pub lenses: &'a [MonoLens],
    /// The points that count, each a spot.
    pub points: &'a [ObjectPoint],
    /// How much each wavelength counts; empty where all count alike.
    pub wavelength_weights: &'a [f64],
    /// How much each point counts; empty where all count alike.
    pub point_weights: &'a [f64],
    /// How finely their light is sampled.
    pub rule: PupilRule,
}

impl<'a> Autofocus<'a> {
    /// Returns a focus on points and wavelengths that all count alike.
    pub fn alike(lenses: &'a [MonoLens], points: &'a [ObjectPoint], rule: PupilRule) -> Self {
        Self { lenses, points, wavelength_weights: &[], point_weights: &[], rule }
    }

    /// Returns the film's distance behind the last vertex at which the spots are smallest, and their size there, both
    /// mm; `None` if no light gets through, or none that comes to a focus.
    ///
    /// `film_distance_mm` is the film from which the rays are taken; it changes the result by rounding only. A curved film comes to
    /// rest in a few rounds.
    pub fn best_film_mm(&self, film_distance_mm: f64) -> Option<(f64, f64)> {
        let is_flat = self.lenses.iter().all(|lens| lens.image_surface().curvature_per_mm == 0.0);
        let mut best = self.better_film_mm(film_distance_mm)?;
        for _ in 0..if is_flat { 0 } else { ROUNDS } {
            let before_mm = best.0;
            best = self.better_film_mm(before_mm)?;
            if (best.0 - before_mm).abs() <= AT_REST_MM {
                break;
            }
        }
        Some(best)
    }

    /// Returns the best film as the rays on this one foretell it.
    fn better_film_mm(&self, film_distance_mm: f64) -> Option<(f64, f64)> {
        let mut rays = FocusRays::default();
        let weight = |weights: &[f64], i: usize| weights.get(i).copied().unwrap_or(1.0);
        for (i, point) in self.points.iter().enumerate() {
            let light = |(color, lens): (usize, &MonoLens)| {
                let light = PupilLight::to_film(lens, point, film_distance_mm, self.rule)?;
                Some((light, weight(self.wavelength_weights, color)))
            };
            let lights: Vec<_> = self.lenses.iter().enumerate().filter_map(light).collect();
            if let Some(lens) = self.lenses.first() {
                rays.add_on_film(lens, film_distance_mm, &lights, weight(self.point_weights, i));
            }
        }
        let shift_mm = rays.shift_mm()?;
        Some((film_distance_mm + shift_mm, rays.rms_mm(shift_mm)))
    }
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use super::*;
    use crate::{
        Lens, Vignetting,
        analysis::{PupilCoordinates, PupilSampling},
    };

    const RULE: PupilRule = PupilRule { n_rings: 8, n_azimuths: 48 };

    /// The root-mean-square size of a point's light on a film, mm.
    fn rms_on_mm(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64) -> f64 {
        let light = PupilLight::to_film(lens, point, film_distance_mm, RULE).unwrap();
        let (_, [xx, yy, _]) = light.moments(lens, film_distance_mm);
        (xx + yy).sqrt()
    }

    #[test]
    fn an_ideal_lens_is_focused_where_its_equation_says() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let points = [0.0, 0.2].map(|tan| ObjectPoint::from_field(&lens, DVec2::X * tan, 0.5));
        let focus = Autofocus::alike(from_ref(&lens), &points, RULE);
        let (film_distance_mm, rms_mm) = focus.best_film_mm(40.0).unwrap();
        assert!((film_distance_mm - 1.0 / (1.0 / 50.0 - 1.0 / 2000.0)).abs() < 1e-11);
        // What is left is the square root of rounding in squares of 1 mm.
        assert!(rms_mm < 1e-7);
    }

    #[test]
    fn a_curved_film_is_focused_as_a_whole() {
        use crate::ImageSurface;
        let flat = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let curved = ImageSurface { curvature_per_mm: -1.0 / 60.0, conic: 0.0 };
        let lens = flat.with_image_surface(curved).unwrap().at(550.0).unwrap();
        let points = [0.0, 0.15, 0.3].map(|tan| ObjectPoint::from_field(&lens, DVec2::Y * tan, 0.0));
        let focus = Autofocus::alike(from_ref(&lens), &points, RULE);
        let (film_distance_mm, rms_mm) = focus.best_film_mm(36.0).unwrap();
        let found_mm = |film_distance_mm: f64| {
            let squares = points.iter().map(|point| rms_on_mm(&lens, point, film_distance_mm).powi(2));
            (squares.sum::<f64>() / 3.0).sqrt()
        };
        assert!((found_mm(film_distance_mm) - rms_mm).abs() < 1e-9, "{} {rms_mm}", found_mm(film_distance_mm));
        assert!(found_mm(film_distance_mm - 0.02) > rms_mm && found_mm(film_distance_mm + 0.02) > rms_mm);
        // The start matters no more than to the last move.
        assert!((focus.best_film_mm(34.0).unwrap().0 - film_distance_mm).abs() < 1e-8);
    }

    #[test]
    fn no_other_film_is_better_and_the_start_does_not_matter() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.0, 0.2), 0.0);
        let points = [point];
        let focus = Autofocus::alike(from_ref(&lens), &points, RULE);
        let (film_distance_mm, rms_mm) = focus.best_film_mm(36.0).unwrap();
        assert!((focus.best_film_mm(30.0).unwrap().0 - film_distance_mm).abs() < 1e-11);
        let spot = |film_distance_mm: f64| rms_on_mm(&lens, &point, film_distance_mm);
        assert!((spot(film_distance_mm) - rms_mm).abs() < 1e-12);
        assert!(spot(film_distance_mm - 0.01) > rms_mm && spot(film_distance_mm + 0.01) > rms_mm);
    }

    #[test]
    fn spherical_aberration_of_third_order_is_balanced_halfway_and_more() {
        // For S1 alone the least rms spot lies 2/3 of the way from the paraxial to the marginal focus of even disc
        // sampling: minimise ∫ (a r³ − b r)² r dr, b = ∫ r⁴ r dr / ∫ r² r dr · a = (1/6) / (1/4) a.
        let lens = Lens::built_in("singlet-50mm").unwrap().with_f_number(20.0, 550.0).unwrap().at(550.0).unwrap();
        let axis = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.0);
        let points = [axis];
        let focus = Autofocus::alike(from_ref(&lens), &points, RULE);
        let paraxial_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let coordinates = PupilCoordinates::entrance(&lens);
        let edge = PupilSampling { coordinates, places: vec![DVec2::Y], rims: Vignetting::Off };
        let marginal = edge.rays_on_film(&lens, &axis, paraxial_mm);
        let marginal_mm = paraxial_mm - marginal.y_mm[0] * marginal.n[0] / marginal.m[0];
        let share = (focus.best_film_mm(paraxial_mm).unwrap().0 - paraxial_mm) / (marginal_mm - paraxial_mm);
        // Fifth order is the square of the aperture, (1/40)², times some.
        assert!((share - 2.0 / 3.0).abs() < 2e-3, "{share}");
    }

    #[test]
    fn darkness_has_no_focus() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.0, 1.2), 0.0);
        let points = [point];
        let focus = Autofocus::alike(from_ref(&lens), &points, RULE);
        assert_eq!(focus.best_film_mm(36.0), None);
    }
}
