//! How a deviation at the stop moves a ray on the film.

use dioptric_optics::{FilmPoint, MonoLens, Placement, RayBatch, StopPoint, Vignetting};
use glam::{DVec2, DVec3};

use crate::{CircularStop, Covariance, Hurb};

/// Step of a direction cosine for the difference quotients: the truncation error, of order its square, and the
/// rounding error, 1e-16 over it, are both below 1e-9 of the derivative.
const STEP: f64 = 1e-5;

/// A ray as far as diffraction at the stop is concerned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopRay {
    /// Where the ray meets the film.
    pub film: FilmPoint,
    /// Where it crosses the stop.
    pub stop: StopPoint,
    /// Movement on the film, along its own axes, for a unit change of the direction cosine along the stop's own x behind the
    /// stop, mm.
    pub along_l_mm: DVec2,
    /// The same along y.
    pub along_m_mm: DVec2,
}

impl StopRay {
    /// Returns the covariance on the film, mm², of the ray's Gaussian.
    pub fn film_covariance_mm2(&self, edge: CircularStop, model: Hurb) -> Covariance {
        model.covariance(self.stop, edge).mapped(self.along_l_mm, self.along_m_mm)
    }
}

/// Traces rays to the film as it is curved, `film_distance_mm` behind the last vertex, ignoring rims, and finds how deviations at the
/// stop move them there.
///
/// The rays start in object space; those that end on the way are `None`. Each costs four more rays behind the stop.
pub fn trace_stop_rays(lens: &MonoLens, mut rays: RayBatch, film_distance_mm: f64) -> Vec<Option<StopRay>> {
    let (behind, end) = (lens.stop() + 1, lens.n_surfaces());
    lens.trace_surfaces(0..behind, &mut rays, Vignetting::Off);
    let on_film = |mut rays: RayBatch| {
        if behind < end {
            lens.trace_surfaces(behind..end, &mut rays, Vignetting::Off);
        }
        lens.to_film(&mut rays, film_distance_mm);
        let places = lens.film_points(&rays, film_distance_mm);
        (rays.fate, places)
    };
    let stop_placement = lens.stop_placement();
    let deviated =
        [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|d| on_film(turned(&rays, &stop_placement, d * STEP)));
    let stop = lens.stop_points(&rays);
    let straight = on_film(rays);
    (0..stop.len())
        .map(|ray| {
            let all = deviated.iter().chain([&straight]);
            all.clone().all(|(fate, _)| fate[ray].is_in_flight()).then(|| {
                let slope = |i: usize| (deviated[i].1[ray].mm - deviated[i + 1].1[ray].mm) / (2.0 * STEP);
                StopRay { film: straight.1[ray], stop: stop[ray], along_l_mm: slope(0), along_m_mm: slope(2) }
            })
        })
        .collect()
}

/// Returns the rays with their direction cosines along the stop's own x and y changed.
fn turned(rays: &RayBatch, stop_placement: &Placement, by: DVec2) -> RayBatch {
    let mut rays = rays.clone();
    for ray in 0..rays.len() {
        let cosines = stop_placement.direction_to_own(rays.direction(ray)).truncate() + by;
        let rest = 1.0 - cosines.length_squared();
        let direction = DVec3::new(cosines.x, cosines.y, rest.max(0.0).sqrt());
        rays.set_direction(ray, stop_placement.direction_to_lens(direction));
    }
    rays
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use approx::assert_abs_diff_eq;
    use dioptric_optics::Lens;

    use super::*;
    use crate::{HurbForm, SampledHurb};

    /// `n` points spread evenly over the disc of radius 1 (Vogel's spiral).
    fn vogel(n: usize) -> impl Iterator<Item = DVec2> {
        (0..n).map(move |i| DVec2::from_angle(2.399_963_229_728_653 * i as f64) * ((i as f64 + 0.5) / n as f64).sqrt())
    }

    const FILM_MM: f64 = 51.282_051_282_051_28;
    const OBJECT_MM: f64 = 2000.0;
    const RADIUS_MM: f64 = 1.136_35;

    /// The lens of Figure 2, its rays from the point at 2 m, and λN of its image.
    fn figure_2(n_rays: usize, wavelength_nm: f64) -> (MonoLens, RayBatch, CircularStop, f64) {
        let lens = Lens::thin(50.0, 2.0 * RADIUS_MM).unwrap().at(wavelength_nm).unwrap();
        let (points, directions): (Vec<DVec3>, Vec<DVec3>) = vogel(n_rays)
            .map(|p| {
                let point = (p * RADIUS_MM).extend(0.0);
                (point, (point + DVec3::Z * OBJECT_MM).normalize())
            })
            .unzip();
        let mut rays = RayBatch::from_points(&points, &directions);
        rays.object_z_mm = -OBJECT_MM;
        let edge = CircularStop::new(RADIUS_MM, wavelength_nm, 1.0);
        (lens, rays, edge, wavelength_nm * 1e-6 * FILM_MM / (2.0 * RADIUS_MM))
    }

    /// Returns the rms over ±3 λN of the difference of a splatted line spread from the closed form, over the peak.
    fn splat_error(n_rays: usize, model: Hurb) -> f64 {
        let (lens, rays, edge, unit) = figure_2(n_rays, 550.0);
        let splats = trace_stop_rays(&lens, rays, FILM_MM);
        let lsf = |u: f64| -> f64 {
            let values = splats.iter().map(|ray| {
                let ray = ray.unwrap();
                let variance = ray.film_covariance_mm2(edge, model).xx / (unit * unit);
                let from = u - ray.film.mm.x / unit;
                (-0.5 * from * from / variance).exp() / (2.0 * PI * variance).sqrt()
            });
            values.sum::<f64>() / n_rays as f64
        };
        let at: Vec<f64> = (-30..=30).map(|i| 0.1 * f64::from(i)).collect();
        let squares: f64 = at.iter().map(|&u| ((lsf(u) - model.lsf(u)) / model.lsf(0.0)).powi(2)).sum();
        (squares / at.len() as f64).sqrt()
    }

    #[test]
    fn deterministic_splats_meet_the_closed_form_with_256_rays() {
        for model in [Hurb::PAPER, Hurb::SCENE3D, Hurb::CALIBRATED] {
            let error = splat_error(256, model);
            assert!(error < 1e-3, "{model:?}: {error}");
            assert!(splat_error(1024, model) < 0.5 * error);
        }
    }

    #[test]
    fn random_bending_meets_the_closed_form_within_its_noise() {
        let n_rays = 400_000;
        for (model, width) in [(Hurb::PAPER, 0.6174), (Hurb::SCENE3D, 0.8732)] {
            let (lens, mut rays, edge, unit) = figure_2(n_rays, 550.0);
            lens.trace_surfaces(0..lens.stop() + 1, &mut rays, Vignetting::On);
            let form = HurbForm::DirectionCosines;
            SampledHurb { model, edge: edge.into(), form, seed: 3 }.apply(&mut rays, &lens.stop_placement());
            lens.to_film(&mut rays, FILM_MM);
            let share = |limit: f64| rays.x_mm.iter().filter(|x| x.abs() < limit * unit).count() as f64 / n_rays as f64;
            for limit in [0.25 * width, 0.5 * width, width, 3.0] {
                let nodes = dioptric_optics::quadrature::gauss_legendre_on(64, 0.0, limit);
                let expected: f64 = nodes.iter().map(|(u, w)| 2.0 * w * model.lsf(*u)).sum();
                // Four standard errors of a share are below 0.0032.
                assert_abs_diff_eq!(share(limit), expected, epsilon = 0.0032);
            }
        }
    }

    #[test]
    fn movement_on_the_film_is_the_distance_behind_a_lens_in_the_stop() {
        let (lens, rays, ..) = figure_2(16, 550.0);
        for ray in trace_stop_rays(&lens, rays, FILM_MM) {
            let ray = ray.unwrap();
            // Slopes here are within 1/40 of the axis: cos⁻³ is within 1e-3 of 1.
            assert!((ray.along_l_mm - DVec2::X * FILM_MM).length() < 2e-3 * FILM_MM);
            assert!((ray.along_m_mm - DVec2::Y * FILM_MM).length() < 2e-3 * FILM_MM);
            assert!(ray.film.mm.length() < 1e-9);
        }
    }
}
