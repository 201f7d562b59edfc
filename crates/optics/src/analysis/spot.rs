//! Spot diagrams: where the rays of a point meet the film.

use glam::{DVec2, DVec3};

use super::pupil_places::PupilSampling;
use crate::{MonoLens, ObjectPoint, RayBatch, RayFate};

/// Where the rays of one point at one wavelength meet the film, each counted alike.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotDiagram {
    /// The film points of the rays that arrive, mm, in the order of their pupil places: x and y of the lens frame, or of
    /// the film's own where it is tilted or decentered.
    pub points_mm: Vec<DVec2>,
    /// The film point of the chief ray (through the middle of the pupil, whether rims end it or not), mm.
    pub chief_mm: Option<DVec2>,
    /// How each ray ended, in the order of the pupil places.
    pub fates: Vec<RayFate>,
}

impl SpotDiagram {
    /// Traces rays through these places of the pupil to the film as it is curved, `film_distance_mm` behind the last vertex.
    pub fn trace(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, sampling: &PupilSampling) -> Self {
        let rays = sampling.rays_on_film(lens, point, film_distance_mm);
        let chief = sampling.chief().rays_on_film(lens, point, film_distance_mm);
        let chief_mm = chief.fate[0].is_in_flight().then(|| lens.on_film_mm(chief.point_mm(0), film_distance_mm));
        Self::on(|point_mm| lens.on_film_mm(point_mm, film_distance_mm), &rays, chief_mm)
    }

    /// Returns the spot of rays that have been traced to the film.
    pub fn of(rays_on_film: &RayBatch, chief_mm: Option<DVec2>) -> Self {
        Self::on(DVec3::truncate, rays_on_film, chief_mm)
    }

    fn on(film: impl Fn(DVec3) -> DVec2, rays_on_film: &RayBatch, chief_mm: Option<DVec2>) -> Self {
        let arrived = (0..rays_on_film.len()).filter(|&i| rays_on_film.fate[i].is_in_flight());
        let points_mm = arrived.map(|i| film(rays_on_film.point_mm(i))).collect();
        Self { points_mm, chief_mm, fates: rays_on_film.fate.clone() }
    }

    /// The share of the rays that arrive.
    pub fn ray_share(&self) -> f64 {
        self.points_mm.len() as f64 / self.fates.len() as f64
    }

    /// Returns the mean of the points, mm; `None` where no ray arrives.
    pub fn centroid_mm(&self) -> Option<DVec2> {
        let n = self.points_mm.len();
        (n > 0).then(|| self.points_mm.iter().sum::<DVec2>() / n as f64)
    }

    /// Returns the root-mean-square distance of the points from their centroid, mm.
    pub fn rms_mm(&self) -> Option<f64> {
        self.rms_about_mm(self.centroid_mm()?)
    }

    /// Returns the root-mean-square distance of the points from the chief ray's, mm.
    pub fn rms_about_chief_mm(&self) -> Option<f64> {
        self.rms_about_mm(self.chief_mm?)
    }

    /// Returns the root mean squares of x and y about the centroid, mm.
    pub fn sigma_mm(&self) -> Option<DVec2> {
        let centroid_mm = self.centroid_mm()?;
        let squares: DVec2 = self.points_mm.iter().map(|p| (*p - centroid_mm) * (*p - centroid_mm)).sum();
        let mean = squares / self.points_mm.len() as f64;
        Some(DVec2::new(mean.x.sqrt(), mean.y.sqrt()))
    }

    /// Returns the distance of the farthest point from the chief ray's, mm.
    pub fn radius_about_chief_mm(&self) -> Option<f64> {
        let chief_mm = self.chief_mm?;
        self.points_mm.iter().map(|p| p.distance(chief_mm)).reduce(f64::max)
    }

    fn rms_about_mm(&self, center_mm: DVec2) -> Option<f64> {
        let squares: f64 = self.points_mm.iter().map(|p| p.distance_squared(center_mm)).sum();
        let n = self.points_mm.len();
        (n > 0).then(|| (squares / n as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Lens, Vignetting,
        analysis::{PupilCoordinates, hexapolar},
    };

    fn sampling(lens: &MonoLens, n_rings: usize, rims: Vignetting) -> PupilSampling {
        PupilSampling { coordinates: PupilCoordinates::entrance(lens), places: hexapolar(n_rings), rims }
    }

    #[test]
    fn a_thin_lens_out_of_focus_shows_its_pupil() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.2, -0.1), 0.0);
        // Rays at the very rim: rounding would decide their fate.
        let sampling = sampling(&lens, 6, Vignetting::Off);
        let focused = SpotDiagram::trace(&lens, &point, 50.0, &sampling);
        assert!(focused.rms_mm().unwrap() < 1e-12 && focused.ray_share() == 1.0);
        assert!(focused.chief_mm.unwrap().distance(DVec2::new(-10.0, 5.0)) < 1e-12);
        let spread = SpotDiagram::trace(&lens, &point, 51.0, &sampling);
        // Similar triangles: the pupil's radius of 5 mm shrinks by 1 in 50.
        assert!((spread.radius_about_chief_mm().unwrap() - 0.1).abs() < 1e-13);
        let squares: f64 = sampling.places.iter().map(|p| p.length_squared()).sum();
        let pupil_rms = (squares / sampling.places.len() as f64).sqrt();
        assert!((spread.rms_mm().unwrap() - 0.1 * pupil_rms).abs() < 1e-13);
        let sigma = spread.sigma_mm().unwrap();
        assert!((sigma.length() - spread.rms_mm().unwrap()).abs() < 1e-15 && (sigma.x - sigma.y).abs() < 1e-13);
        assert!((spread.rms_about_chief_mm().unwrap() - spread.rms_mm().unwrap()).abs() < 1e-13);
    }

    #[test]
    fn rims_take_their_share_and_darkness_has_no_centroid() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let spot = |field_tan: f64, rims| {
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.0, field_tan), 0.0);
            SpotDiagram::trace(&lens, &point, 36.0, &sampling(&lens, 8, rims))
        };
        let (clipped, whole) = (spot(0.3, Vignetting::On), spot(0.3, Vignetting::Off));
        assert!(clipped.ray_share() < 0.8 && clipped.ray_share() > 0.2);
        assert!(whole.ray_share() > clipped.ray_share() && whole.chief_mm == clipped.chief_mm);
        assert_eq!(clipped.fates.iter().filter(|f| f.is_in_flight()).count(), clipped.points_mm.len());
        let dark = spot(1.2, Vignetting::On);
        assert!(dark.centroid_mm().is_none() && dark.rms_mm().is_none() && dark.ray_share() == 0.0);
    }
}
