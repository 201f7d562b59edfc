//! Where the rays of a point land: centroid, moments and losses, without any pixels.

use std::f64::consts::PI;

use dioptric_diffraction::{CircularStop, Covariance, Hurb, HurbForm, SampledHurb};
use dioptric_optics::{
    FilmPoint, MonoLens, ObjectPoint, PupilRegion, Vignetting,
    analysis::{PupilLight, PupilRule},
    glam::{DVec2, DVec3, Vec2Swizzles},
};
use dioptric_psf::FrontGrid;

/// Azimuths of a pupil.
const AZIMUTHS: usize = 96;
/// The rays of a spot.
const RULE: PupilRule = PupilRule { n_rings: 24, n_azimuths: AZIMUTHS };

/// Where rays land on the film, in the picture frame (mm, x to the right, y up), each with its share of the energy.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spot {
    pub(crate) at_mm: Vec<DVec2>,
    pub(crate) weights: Vec<f64>,
    /// How much light reached the film, over that of an axial point (of the paper's rays, over that of all rays).
    pub(crate) energy: f64,
}

/// The place and the size of a spot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    pub(crate) centroid_mm: DVec2,
    /// Second moments about the centroid, mm².
    pub(crate) second_mm2: Covariance,
}

impl Spot {
    /// Sends the light of a point through its true pupil.
    ///
    /// `energy` is the solid angle (of a far point the cross-section of the beam) over that of the axial point; where the axis is dark, over
    /// that of the paraxial entrance pupil.
    pub(crate) fn through_pupil(
        mono: &MonoLens,
        point: &ObjectPoint,
        axial: &ObjectPoint,
        film_distance_mm: f64,
    ) -> Self {
        let Some(light) = PupilLight::to_film(mono, point, film_distance_mm, RULE) else { return Self::default() };
        let on_axis = PupilLight::to_film(mono, axial, film_distance_mm, RULE);
        Self {
            at_mm: mono.landed(light.rays(), film_distance_mm).map(FilmPoint::in_picture_mm).collect(),
            weights: light.weights().to_vec(),
            energy: light.collected() / on_axis.map_or_else(|| stated_light(mono, axial), |light| light.collected()),
        }
    }

    /// Sends rays to a square grid over the front disc, as the paper does; `bending` also draws diffraction.
    ///
    /// `energy` is the share of the rays that reached the film.
    pub(crate) fn over_front(mono: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, paper: &PaperRays) -> Self {
        let mut rays = mono.rays_towards(point, &paper.grid().targets_mm(mono), 0.0, 0.0);
        let stop = mono.stop();
        mono.trace_surfaces(0..stop + 1, &mut rays, Vignetting::On);
        if let Some(model) = paper.bending {
            let edge = CircularStop::new(mono.stop_semi_aperture_mm(), mono.wavelength_nm(), mono.stop_medium_index());
            let hurb = SampledHurb { model, edge, form: HurbForm::Angles, seed: paper.seed };
            hurb.apply(&mut rays, &mono.stop_placement());
        }
        mono.trace_surfaces(stop + 1..mono.n_surfaces(), &mut rays, Vignetting::On);
        mono.to_film(&mut rays, film_distance_mm);
        let at_mm: Vec<DVec2> = mono.landed(&rays, film_distance_mm).map(FilmPoint::in_picture_mm).collect();
        let n_passed = at_mm.len() as f64;
        Self { weights: vec![1.0 / n_passed; at_mm.len()], at_mm, energy: n_passed / rays.len().max(1) as f64 }
    }

    /// Returns the modulation of a wave along a direction from +x; no number if no light arrived.
    pub(crate) fn modulation(&self, direction_rad: f64, cycles_per_mm: f64) -> f64 {
        if self.at_mm.is_empty() {
            return f64::NAN;
        }
        let wave = DVec2::from_angle(direction_rad) * (std::f64::consts::TAU * cycles_per_mm);
        let sum = self.at_mm.iter().zip(&self.weights).map(|(p, w)| DVec2::from_angle(p.dot(wave)) * *w).sum::<DVec2>();
        sum.length()
    }

    /// Returns the place and the size of the spot, or `None` if no light arrived.
    pub(crate) fn moments(&self) -> Option<Moments> {
        if self.at_mm.is_empty() {
            return None;
        }
        let mean = |of: &dyn Fn(DVec2) -> DVec2| -> DVec2 {
            self.at_mm.iter().zip(&self.weights).map(|(&p, &w)| of(p) * w).sum()
        };
        let centroid_mm = mean(&|p| p);
        let squares = mean(&|p| (p - centroid_mm) * (p - centroid_mm));
        let products = mean(&|p| (p - centroid_mm) * (p - centroid_mm).yx());
        let second_mm2 = Covariance { xx: squares.x, xy: products.x, yy: squares.y };
        Some(Moments { centroid_mm, second_mm2 })
    }
}

/// Returns the area of the pupil that a point sees in a plane across the axis over that which an axial point sees, both without what
/// obscurations stop; where the axis is dark, over that of the paraxial entrance pupil.
pub(crate) fn pupil_share(mono: &MonoLens, point: &ObjectPoint, axial: &ObjectPoint) -> f64 {
    let area_mm2 = |point: &ObjectPoint| {
        mono.over_clear_pupil(&|lens| {
            PupilRegion::find(lens, point, AZIMUTHS).map_or(0.0, |region| area_of(point, &region))
        })
    };
    let stated_mm2 = || 0.25 * PI * mono.first_order_of_stop().entrance_pupil_diameter_mm.powi(2);
    area_mm2(point) / Some(area_mm2(axial)).filter(|area| *area > 0.0).unwrap_or_else(stated_mm2)
}

/// Returns what the paraxial entrance pupil takes up of an axial point: sr, or mm² of a far one.
fn stated_light(mono: &MonoLens, axial: &ObjectPoint) -> f64 {
    let first = mono.first_order_of_stop();
    let radius_mm = 0.5 * first.entrance_pupil_diameter_mm;
    match axial {
        ObjectPoint::Infinite(_) => PI * radius_mm.powi(2),
        ObjectPoint::Finite(place) => {
            let way_mm = first.entrance_pupil_z_mm - place.z;
            2.0 * PI * (1.0 - way_mm.abs() / way_mm.hypot(radius_mm))
        }
    }
}

/// Returns the area that a pupil, as light comes in, has in a plane across the axis, mm².
fn area_of(point: &ObjectPoint, pupil: &PupilRegion) -> f64 {
    let (plane, area_mm2, direction) = (pupil.plane(), pupil.area_mm2(), point.direction_to(DVec3::ZERO));
    if plane.is_across_axis() { area_mm2 } else { area_mm2 * direction.dot(plane.normal()) / direction.z }
}

/// The paper's way of choosing rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PaperRays {
    /// Rays along the side of the square grid.
    pub(crate) n_across: usize,
    /// Whether rays are moved within the steps of the grid.
    pub(crate) jitter: bool,
    /// Diffraction drawn at the stop.
    pub(crate) bending: Option<Hurb>,
    pub(crate) seed: u64,
}

impl PaperRays {
    fn grid(&self) -> FrontGrid {
        // Diffraction draws from the seed itself.
        FrontGrid { n_across: self.n_across, jitter_seed: self.jitter.then(|| self.seed.wrapping_add(1)) }
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;

    fn spot_at(field_deg: f64, distance_mm: f64) -> Spot {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm = mono.film_distance_mm_for(distance_mm).unwrap();
        let point = ObjectPoint::from_field(&mono, DVec2::new(field_deg.to_radians().tan(), 0.0), 1e3 / distance_mm);
        let axial = ObjectPoint::from_field(&mono, DVec2::ZERO, 1e3 / distance_mm);
        Spot::through_pupil(&mono, &point, &axial, film_distance_mm)
    }

    #[test]
    fn an_axial_point_loses_nothing_and_an_oblique_one_does() {
        let axial = spot_at(0.0, 2000.0);
        assert!((axial.energy - 1.0).abs() < 1e-12);
        let moments = axial.moments().unwrap();
        assert!(moments.centroid_mm.length() < 1e-9);
        let second = moments.second_mm2;
        // Alike to rounding; σ is some µm.
        assert!((second.xx.sqrt() - second.yy.sqrt()).abs() < 1e-9 && second.xy.abs() < 1e-12);
        let oblique = spot_at(24.0, 2000.0);
        assert!(oblique.energy > 0.2 && oblique.energy < 0.95, "{}", oblique.energy);
    }

    #[test]
    fn a_point_to_the_right_lands_on_the_right_of_the_picture() {
        let moments = spot_at(10.0, 1e6).moments().unwrap();
        // The focal length times the tangent, within distortion and coma.
        let expected = 50.35 * 10f64.to_radians().tan();
        assert!((moments.centroid_mm.x / expected - 1.0).abs() < 0.02, "{}", moments.centroid_mm);
    }
}
