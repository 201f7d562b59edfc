//! Wavefronts: by how much the paths of a pupil's rays differ from a perfect lens's.

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, RayBatch, Rims, rays_towards};
use glam::DVec2;

use crate::{
    DiffractionError, PupilGrid,
    wave::{cis::cis, polar, solid_angle_per_area},
    zernike::fit_noll,
};

/// A sphere about a film point, up to which paths are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSphere {
    /// Its centre on the film, mm, lens frame.
    pub center_mm: DVec2,
    /// Its radius, mm: positive when the pupil lies before the film, infinite when it is infinitely far.
    pub radius_mm: f64,
}

impl ReferenceSphere {
    /// Returns the sphere about a film point through the axial point of the paraxial exit pupil.
    pub fn through_exit_pupil(lens: &MonoLens, film_mm: f64, center_mm: DVec2) -> Self {
        let way_mm = film_mm - lens.first_order().exit_pupil_z_mm;
        let radius_mm =
            if way_mm.is_finite() { center_mm.extend(way_mm).length().copysign(way_mm) } else { f64::INFINITY };
        Self { center_mm, radius_mm }
    }

    /// Returns the optical path of each ray to the sphere, less the radius's own, mm; NaN for rays that have ended.
    ///
    /// The rays are on the film. Written so that the radius may be infinite.
    pub fn paths_mm(&self, lens: &MonoLens, rays_on_film: &RayBatch) -> Vec<f64> {
        let path = |i: usize| {
            if !rays_on_film.fate[i].is_in_flight() {
                return f64::NAN;
            }
            let q = rays_on_film.point_mm(i).truncate() - self.center_mm;
            let along = q.dot(rays_on_film.direction(i).truncate());
            let excess = (along * along - q.length_squared()) / self.radius_mm;
            let back_mm = along + excess / (1.0 + (1.0 + excess / self.radius_mm).sqrt());
            rays_on_film.opl_mm[i] - lens.image_index() * back_mm
        };
        (0..rays_on_film.len()).map(path).collect()
    }
}

/// What a wavefront is measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WavefrontReference {
    /// The sphere about the image of the chief ray, the one through the middle of the paraxial entrance pupil.
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
    /// Places in the entrance pupil, in units of its paraxial radius, from its centre: the unvignetted pupil is about
    /// the unit disc.
    pub pupil: Vec<DVec2>,
    /// Share of the energy at each place; the sum is 1.
    pub energy: Vec<f64>,
    /// Optical path less the reference's, waves: positive where the light comes late.
    pub opd_waves: Vec<f64>,
    /// The film point about which the wave converges best (of its reference), mm, lens frame.
    pub center_mm: DVec2,
}

impl Wavefront {
    /// Traces the wavefront to the film, `film_mm` behind the last vertex.
    ///
    /// # Errors
    /// When no light gets through or rays within the pupil are lost.
    pub fn trace(
        lens: &MonoLens,
        point: &ObjectPoint,
        film_mm: f64,
        grid: PupilGrid,
        reference: WavefrontReference,
    ) -> Result<Self, DiffractionError> {
        let wavelength_nm = lens.wavelength_nm();
        let boundary =
            PupilBoundary::find(lens, point, grid.n_azimuths).ok_or(DiffractionError::NoLight { wavelength_nm })?;
        let (center, z_mm, rho_mm) = (boundary.center_mm(), boundary.z_mm(), boundary.rho_at_azimuths_mm());
        let (mut targets_mm, areas): (Vec<DVec2>, Vec<f64>) =
            polar(grid, |azimuth| rho_mm[azimuth]).map(|(offset, area)| (center + offset, area)).unzip();
        let taken = |(target, area): (&DVec2, &f64)| area * solid_angle_per_area(point, target.extend(z_mm));
        let mut energy: Vec<f64> = targets_mm.iter().zip(&areas).map(taken).collect();
        let total: f64 = energy.iter().sum();
        energy.iter_mut().for_each(|e| *e /= total);

        // The chief ray comes last; of a strongly vignetted pupil it need not get through the rims.
        targets_mm.push(DVec2::ZERO);
        let mut rays = rays_towards(point, &targets_mm, z_mm, 0.0);
        lens.trace(&mut rays, Rims::Ignore);
        lens.to_film(&mut rays, film_mm);
        let (n_rays, n_lost) = (rays.len(), rays.len() - rays.n_in_flight());
        if n_lost > 0 {
            return Err(DiffractionError::LostRays { wavelength_nm, n_lost, n_rays });
        }
        let chief = n_rays - 1;
        let sphere = ReferenceSphere::through_exit_pupil(lens, film_mm, rays.point_mm(chief).truncate());
        let paths_mm = sphere.paths_mm(lens, &rays);
        let opd_waves = paths_mm[..chief].iter().map(|p| (p - paths_mm[chief]) / (wavelength_nm * 1e-6)).collect();
        targets_mm.pop();
        let first = lens.first_order();
        let radius_mm = match 0.5 * first.entrance_pupil_diameter_mm {
            radius_mm if radius_mm.is_finite() => radius_mm,
            _ => (boundary.area_mm2() / std::f64::consts::PI).sqrt(),
        };
        let pupil = targets_mm.iter().map(|target| *target / radius_mm).collect();
        let mut wavefront = Self { wavelength_nm, pupil, energy, opd_waves, center_mm: sphere.center_mm };
        if reference == WavefrontReference::Best {
            let directions: Vec<DVec2> = (0..chief).map(|i| rays.direction(i).truncate()).collect();
            wavefront.take_out_tilt(&directions, lens.image_index());
        }
        Ok(wavefront)
    }

    /// Takes out the piston and tilt that leave the least mean square, and moves the centre accordingly.
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
        // Counted to a point s further on, a path is longer by n s·d.
        self.center_mm -= slope * (self.wavelength_nm * 1e-6 / index);
    }

    fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.energy.iter().zip(&self.opd_waves).map(|(e, w)| e * of(*w)).sum()
    }

    /// Returns the root mean square of the aberration about its mean, waves, weighted by energy.
    pub fn rms_waves(&self) -> f64 {
        let mean = self.mean(|w| w);
        self.mean(|w| (w - mean).powi(2)).sqrt()
    }

    /// Returns the difference of the largest and the least aberration, waves.
    pub fn peak_to_valley_waves(&self) -> f64 {
        let ends = self.opd_waves.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |e, w| (e.0.min(*w), e.1.max(*w)));
        ends.1 - ends.0
    }

    /// Returns the irradiance at the centre over that without aberration: |mean of cis(opd)|², weighted by energy.
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
    /// ([`zernike`](crate::zernike)), in waves rms, over the unit disc of the paraxial pupil.
    pub fn zernike_waves(&self, n_terms: usize) -> Vec<f64> {
        fit_noll(&self.pupil, &self.opd_waves, &self.energy, n_terms)
    }
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
        let trace =
            |film_mm: f64| Wavefront::trace(&lens, &far, film_mm, PupilGrid::STANDARD, WavefrontReference::Chief);
        assert!(trace(50.0).unwrap().peak_to_valley_waves() < 1e-9);
        // A film 0.1 mm too near: W20 = −dz sin²u / 2 at the edge, seen from a sphere about the film point.
        let wavefront = trace(49.9).unwrap();
        let zernike = wavefront.zernike_waves(15);
        let sine2 = 0.05f64.powi(2) / (1.0 + 0.05f64.powi(2));
        let w20 = 0.1 * sine2 / 2.0 / 550e-6;
        // Terms in the fourth power of the slope are left out: sin²u/4 = 6e-4 of it.
        assert!((zernike[3].abs() / (w20 / 12f64.sqrt()) - 1.0).abs() < 3e-3, "{zernike:?}");
        assert!(zernike[3] > 0.0, "the edge's rays are on a longer way to a film point before the focus");
        assert!((wavefront.rms_waves() / zernike[3].abs() - 1.0).abs() < 1e-3);
        let sinc = (std::f64::consts::PI * w20).sin() / (std::f64::consts::PI * w20);
        assert!((wavefront.strehl() - sinc * sinc).abs() < 1e-3, "{} {}", wavefront.strehl(), sinc * sinc);
    }
}
