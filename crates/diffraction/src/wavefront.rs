//! Wavefronts: by how much the paths of a pupil's rays differ from a perfect lens's.

use dioptric_optics::{
    MonoLens, ObjectPoint, PupilPlane, RayBatch, Vignetting, analysis::StopAim, zernike::FRINGE_TERMS,
};
use glam::{DVec2, DVec3};

use crate::{
    DiffractionError, PupilGrid,
    wave::{FilmRays, PupilCells, cis::cis},
    zernike::{fit, fringe, noll},
};

/// A sphere about a film point, up to which paths are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSphere {
    /// Its center on the film, mm, lens frame.
    pub center_mm: DVec3,
    /// Its radius, mm: positive when the pupil lies before the film, infinite when it is infinitely far.
    pub radius_mm: f64,
}

impl ReferenceSphere {
    /// Returns the sphere about a film point (lens frame) through the axial point of the paraxial exit pupil.
    ///
    /// Where the film is tilted or decentered, that is the point of its own axis as far from it.
    pub fn through_exit_pupil(lens: &MonoLens, center_mm: DVec3) -> Self {
        let pupil_mm = lens.first_order().exit_pupil_z_mm;
        let radius_mm = match pupil_mm.is_finite() {
            true => {
                let way_mm = lens.film_placement(pupil_mm).surface_from_lens(center_mm);
                way_mm.length().copysign(way_mm.z)
            }
            false => f64::INFINITY,
        };
        Self { center_mm, radius_mm }
    }

    /// Returns the optical path of each ray to the sphere, less the radius's own, mm; NaN for rays that have ended.
    ///
    /// The rays may be anywhere in image space, best on the film. Written so that the radius may be infinite.
    pub fn paths_mm(&self, lens: &MonoLens, rays_on_film: &RayBatch) -> Vec<f64> {
        let path = |i: usize| {
            if !rays_on_film.fate[i].is_in_flight() {
                return f64::NAN;
            }
            let (_, back_mm) = self.back_to(rays_on_film, i);
            rays_on_film.opl_mm[i] - lens.image_index() * back_mm
        };
        (0..rays_on_film.len()).map(path).collect()
    }

    /// Returns where a ray is, from the center, and how much farther back than the radius it has crossed the sphere, mm.
    fn back_to(&self, rays: &RayBatch, i: usize) -> (DVec3, f64) {
        let q = rays.point_mm(i) - self.center_mm;
        let along = q.dot(rays.direction(i));
        let excess = (along * along - q.length_squared()) / self.radius_mm;
        (q, along + excess / (1.0 + (1.0 + excess / self.radius_mm).sqrt()))
    }

    /// Returns the unit vector to the center from where a ray crosses the sphere: by it paths grow as the center moves.
    fn inward(&self, rays: &RayBatch, i: usize) -> DVec3 {
        let (q, back_mm) = self.back_to(rays, i);
        rays.direction(i) + (rays.direction(i) * back_mm - q) / self.radius_mm
    }
}

/// What a wavefront is measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WavefrontReference {
    /// The sphere about the image of the chief ray, the one through the middle of the real stop (of the pupil as it is
    /// seen, where no ray takes that way).
    Chief,
    /// The sphere about that film point, and with that radius, for which the wavefront is least: piston and tilt
    /// are taken out.
    Best,
}

/// The aberration of one object point at one wavelength over its true, vignetted pupil.
#[derive(Clone, Debug, PartialEq)]
pub struct Wavefront {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// Where the rays pass the real stop, in units of its radius, from its middle: the unvignetted pupil is the unit
    /// disc, at any field.
    pub pupil: Vec<DVec2>,
    /// Share of the energy at each place; the sum is 1. Behind an obscuration there are as many places of positive as of
    /// negative energy, so that nothing of it remains in sums.
    pub energy: Vec<f64>,
    /// Whether light takes this way: `false` behind an obscuration.
    pub is_clear: Vec<bool>,
    /// The reference's optical path less the ray's, waves: positive where the wavefront is ahead of the sphere, the sign of `OpticStudio`,
    /// CODE V and Welford.
    pub opd_waves: Vec<f64>,
    /// The place on the film about which the wave converges best (of its reference), mm along its own x and y.
    pub center_mm: DVec2,
}

/// Places of a true pupil and the rays through them.
struct Traced {
    energy: Vec<f64>,
    is_clear: Vec<bool>,
    /// Where the rays pass the stop, in units of its radius.
    in_stop: Vec<DVec2>,
    /// On the film; the chief ray comes last.
    rays: RayBatch,
}

impl Wavefront {
    /// Traces the wavefront to the film as it is curved, `film_distance_mm` behind the last vertex.
    ///
    /// The grid is laid over the pupil as the point sees it. That of a wide field is long and narrow, and takes as many
    /// more azimuths as it needs.
    ///
    /// # Errors
    /// When no light gets through or rays within the pupil are lost.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        grid: PupilGrid,
        reference: WavefrontReference,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let Traced { energy, is_clear, in_stop, rays } = Traced::new(lens, point, film_distance_mm, grid)?;
        let chief = rays.len() - 1;
        let sphere = ReferenceSphere::through_exit_pupil(lens, rays.point_mm(chief));
        let paths_mm = sphere.paths_mm(lens, &rays);
        let opd_waves = paths_mm[..chief].iter().map(|p| (paths_mm[chief] - p) / (wavelength_nm * 1e-6)).collect();
        let center_mm = lens.film_point(sphere.center_mm, film_distance_mm).mm;
        let mut wavefront = Self { wavelength_nm, pupil: in_stop, energy, is_clear, opd_waves, center_mm };
        if reference == WavefrontReference::Best {
            let on_film = FilmRays::new(&rays, lens, film_distance_mm);
            let directions: Vec<DVec2> =
                (0..chief).map(|i| on_film.along_film(sphere.inward(&rays, i), center_mm)).collect();
            wavefront.take_out_tilt(&directions, lens.image_index());
        }
        Ok(wavefront)
    }

    /// Takes out the piston and tilt that leave the least mean square, and moves the center accordingly.
    fn take_out_tilt(&mut self, directions: &[DVec2], index: f64) {
        let mean_d: DVec2 = self.energy.iter().zip(directions).map(|(e, d)| *e * *d).sum();
        let mean_w = self.mean(|w| w);
        let (mut xx, mut xy, mut yy, mut to_w) = (0.0, 0.0, 0.0, DVec2::ZERO);
        for ((e, d), w) in self.energy.iter().zip(directions).zip(&self.opd_waves) {
            let d = *d - mean_d;
            xx += e * d.x * d.x;
            xy += e * d.x * d.y;
            yy += e * d.y * d.y;
            to_w += *e * (w - mean_w) * d;
        }
        let slope = DVec2::new(yy * to_w.x - xy * to_w.y, xx * to_w.y - xy * to_w.x) / (xx * yy - xy * xy);
        for (w, d) in self.opd_waves.iter_mut().zip(directions) {
            *w -= mean_w + slope.dot(*d - mean_d);
        }
        // Counted to a point s further on, a path is longer by n s·d, and the wavefront as much further behind.
        self.center_mm += slope * (self.wavelength_nm * 1e-6 / index);
    }

    fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.energy.iter().zip(&self.opd_waves).map(|(e, w)| e * of(*w)).sum()
    }

    /// Returns the root mean square of the aberration about its mean, waves, weighted by energy.
    pub fn rms_waves(&self) -> f64 {
        let mean = self.mean(|w| w);
        self.mean(|w| (w - mean).powi(2)).sqrt()
    }

    /// Returns the difference of the largest and the least aberration of what light there is, waves.
    pub fn peak_to_valley_waves(&self) -> f64 {
        let clear = self.opd_waves.iter().zip(&self.is_clear).filter_map(|(w, is_clear)| is_clear.then_some(w));
        let ends = clear.fold((f64::INFINITY, f64::NEG_INFINITY), |e, w| (e.0.min(*w), e.1.max(*w)));
        ends.1 - ends.0
    }

    /// Returns the irradiance at the center over that without aberration: |mean of cis(opd)|², weighted by energy.
    pub fn strehl(&self) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for (e, w) in self.energy.iter().zip(&self.opd_waves) {
            let (c, s) = cis(*w);
            re += e * c;
            im += e * s;
        }
        re * re + im * im
    }

    /// Returns the coefficients of the first `n_terms` of Zernike's polynomials in Noll's order
    /// ([`zernike`](crate::zernike)), in waves rms, over the unit disc of the stop: `OpticStudio`'s standard ones.
    pub fn zernike_waves(&self, n_terms: usize) -> Vec<f64> {
        fit(noll, &self.pupil, &self.opd_waves, &self.energy, n_terms)
    }

    /// Returns the coefficients of the Fringe set's first `n_terms`, of at most 37, in waves at the edge.
    pub fn fringe_waves(&self, n_terms: usize) -> Vec<f64> {
        fit(fringe, &self.pupil, &self.opd_waves, &self.energy, n_terms.min(FRINGE_TERMS))
    }
}

impl Traced {
    /// Traces the nodes of a pupil and the chief ray.
    fn new(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        grid: PupilGrid,
    ) -> Result<Self, DiffractionError> {
        let PupilCells { mut targets_mm, energy, plane, center_mm, .. } = PupilCells::find(lens, point, grid)
            .ok_or(DiffractionError::NoLight { wavelength_nm: lens.wavelength_nm() })?;

        let is_clear = match lens.n_obscurations() {
            0 => vec![true; energy.len()],
            _ => {
                let mut rays = plane.rays(lens, point, &targets_mm);
                lens.trace(&mut rays, Vignetting::On);
                rays.fate.iter().map(|fate| fate.is_in_flight()).collect()
            }
        };

        // Of a strongly vignetted pupil the chief ray need not get through the rims.
        targets_mm.push(chief_target_mm(lens, point, &plane).unwrap_or(center_mm));
        let mut rays = plane.rays(lens, point, &targets_mm);
        let behind = lens.stop() + 1;
        lens.trace_surfaces(0..behind, &mut rays, Vignetting::Off);
        let stop_mm = lens.stop_semi_aperture_mm();
        let in_stop = (0..energy.len()).map(|i| lens.stop_point(rays.point_mm(i)).mm / stop_mm).collect();
        lens.trace_surfaces(behind..lens.n_surfaces(), &mut rays, Vignetting::Off);
        lens.to_film(&mut rays, film_distance_mm);
        let (n_rays, n_lost) = (rays.len(), rays.len() - rays.n_in_flight());
        match n_lost {
            0 => Ok(Self { energy, is_clear, in_stop, rays }),
            _ => Err(DiffractionError::LostRays { wavelength_nm: lens.wavelength_nm(), n_lost, n_rays }),
        }
    }
}

/// Returns where the ray to the middle of the stop crosses a plane, if it comes through.
fn chief_target_mm(lens: &MonoLens, point: &ObjectPoint, plane: &PupilPlane) -> Option<DVec2> {
    let aim = StopAim::find(lens, point, &[DVec2::ZERO]);
    let aimed = aim.plane().rays(lens, point, &[aim.targets_mm()[0]?]);
    let target_mm = plane.meets_mm(aimed.point_mm(0), aimed.direction(0));
    let mut ray = plane.rays(lens, point, &[target_mm]);
    lens.trace(&mut ray, Vignetting::Off);
    ray.fate[0].is_in_flight().then_some(target_mm)
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;
    use glam::DVec3;

    use super::*;

    #[test]
    fn defocus_of_a_thin_lens_is_its_zernike_term() {
        let lens = Lens::thin(50.0, 5.0).unwrap().at(550.0).unwrap();
        let far = ObjectPoint::Infinite(DVec3::Z);
        let trace = |film_distance_mm: f64| {
            Wavefront::trace(&lens, &far, film_distance_mm, PupilGrid::STANDARD, WavefrontReference::Chief)
        };
        assert!(trace(50.0).unwrap().peak_to_valley_waves() < 1e-9);
        // A film 0.1 mm too near: W20 = −dz sin²u / 2 at the edge, seen from a sphere about the film point.
        let wavefront = trace(49.9).unwrap();
        let zernike = wavefront.zernike_waves(15);
        let sine2 = 0.05f64.powi(2) / (1.0 + 0.05f64.powi(2));
        let w20 = 0.1 * sine2 / 2.0 / 550e-6;
        // Terms in the fourth power of the slope are left out: sin²u/4 = 6e-4 of it.
        assert!((zernike[3].abs() / (w20 / 12f64.sqrt()) - 1.0).abs() < 3e-3, "{zernike:?}");
        assert!(zernike[3] < 0.0, "the edge's rays are on a longer way to a film point before the focus");
        assert!((wavefront.rms_waves() / zernike[3].abs() - 1.0).abs() < 1e-3);
        let sinc = (std::f64::consts::PI * w20).sin() / (std::f64::consts::PI * w20);
        assert!((wavefront.strehl() - sinc * sinc).abs() < 1e-3, "{} {}", wavefront.strehl(), sinc * sinc);
    }

    #[test]
    fn a_fisheye_has_a_wavefront_as_far_as_it_sees() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap().with_f_number(16.0, 550.0).unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        for field_deg in [0.0f64, 30.0, 60.0, 62.0, 70.0, 80.0, 85.0] {
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.6, 0.8) * field_deg.to_radians().tan(), 0.0);
            let trace = |grid, reference| Wavefront::trace(&lens, &point, film_distance_mm, grid, reference).unwrap();
            let best = trace(PupilGrid::STANDARD, WavefrontReference::Best);
            assert!((best.energy.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            // The edge of the pupil is that of the stop, or within it where rims vignette; nodes stay off it by 1 %.
            let widest = best.pupil.iter().map(|p| p.length()).fold(0.0, f64::max);
            assert!(widest < 1.0 && widest > 0.8, "{field_deg}°: {widest}");
            let strehl = best.strehl();
            assert!(strehl > 0.0 && strehl < 1.0, "{field_deg}°: {strehl}");
            // Twice the nodes see the same wavefront.
            let finer = trace(PupilGrid::STANDARD.scaled(2.0), WavefrontReference::Best);
            assert!((finer.strehl() - strehl).abs() < 1e-3, "{field_deg}°: {strehl} {}", finer.strehl());
            assert!((finer.rms_waves() / best.rms_waves() - 1.0).abs() < 1e-3, "{field_deg}°");
            // The chief ray is that through the middle of the stop, where the wavefront is 0.
            let chief = trace(PupilGrid::STANDARD, WavefrontReference::Chief);
            assert_eq!(Some(chief.center_mm), lens.chief_film_point_mm(&point, film_distance_mm));
            let inner =
                (0..chief.pupil.len()).min_by(|&a, &b| chief.pupil[a].length().total_cmp(&chief.pupil[b].length()));
            assert!(chief.opd_waves[inner.unwrap()].abs() < 0.05, "{field_deg}°");
        }
    }

    #[test]
    fn strehl_ratio_of_a_wide_field_is_that_of_huygens_sum() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap().with_f_number(8.0, 550.0).unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.0, 80f64.to_radians().tan()), 0.0);
        let best =
            Wavefront::trace(&lens, &point, film_distance_mm, PupilGrid::STANDARD, WavefrontReference::Best).unwrap();
        let sources = crate::HuygensSources::trace(&lens, &point, film_distance_mm, best.center_mm, 60).unwrap();
        let summed = sources.strehl_at(best.center_mm);
        // The amplitudes of the sum follow the brightness of the exit cone, which at 80° is uneven: 2.5e-4 was found.
        assert!((summed - best.strehl()).abs() < 1e-3, "{summed} {}", best.strehl());
    }
}
