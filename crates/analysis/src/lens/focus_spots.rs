//! Spots of each field on a film that is moved through focus.

use dioptric_optics::{
    Lens, MonoLens, Vignetting,
    analysis::{PupilCoordinates, PupilSampling, SpotDiagram, hexapolar},
};
use rayon::prelude::*;

use super::{curves::Bench, rows::FieldPlace, rows::LensAnalysis};
use dioptric_pipeline::PipelineError;

/// Steps of the film to each side of its place, of half its reach.
const STEPS: i32 = 2;
/// Rings of the rays of a spot.
const RINGS: usize = 8;

/// The spot of a field on a film that is moved.
#[derive(Clone, Debug, PartialEq)]
pub struct FocusSpot {
    /// The point of the field.
    pub place: FieldPlace,
    /// How far the film is moved from the lens, mm.
    pub shift_mm: f64,
    /// The root mean square radius at the reference wavelength, µm; none in the dark.
    pub rms_um: Option<f64>,
    /// Of each wavelength, nm, the rays' film points, µm from the chief ray of the reference wavelength, in the picture frame.
    pub points_um: Vec<(f64, Vec<(f64, f64)>)>,
}

impl LensAnalysis {
    /// Returns the spots of its fields, a row a field, as the film goes through focus: as far as curves over focus do.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength.
    pub fn focus_spots(&self, lens: &Lens) -> Result<Vec<Vec<FocusSpot>>, PipelineError> {
        let bench = Bench::of(self, lens)?;
        let reach_mm = bench.focus_reach_mm();
        let shifts_mm = (-STEPS..=STEPS).map(|i| reach_mm * f64::from(i) / f64::from(STEPS));
        let shifts_mm: Vec<f64> = shifts_mm.collect();
        let row = |place: &FieldPlace| shifts_mm.iter().map(|&mm| self.focus_spot(&bench, place, mm)).collect();
        Ok(self.fields.par_iter().map(|field| row(&field.place)).collect())
    }

    fn focus_spot(&self, bench: &Bench<'_>, place: &FieldPlace, shift_mm: f64) -> FocusSpot {
        let (point, film_mm) = (bench.point(place), self.film_distance_mm + shift_mm);
        let sampling =
            PupilSampling { coordinates: PupilCoordinates::Vignetted, places: hexapolar(RINGS), rims: Vignetting::On };
        let on_film = |lens: &MonoLens| SpotDiagram::trace(lens, &point, film_mm, &sampling);
        let center_mm =
            bench.reference.chief_film_point_mm(&point, film_mm).or_else(|| on_film(&bench.reference).centroid_mm());
        let center_mm = center_mm.unwrap_or_default();
        // The picture frame is the film turned by half a turn.
        let of = |lens: &MonoLens| {
            let points =
                on_film(lens).points_mm.iter().map(|at| (center_mm - *at) * 1e3).map(|at| (at.x, at.y)).collect();
            (lens.wavelength_nm(), points)
        };
        FocusSpot {
            place: *place,
            shift_mm,
            rms_um: Some(bench.rms_um(&bench.reference, place, film_mm)).filter(|rms_um| rms_um.is_finite()),
            points_um: bench.lenses.iter().map(of).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    #[test]
    fn spots_out_of_focus_are_the_cone_of_the_light() {
        let lens = Lens::thin(50.0, 10.0).unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
            wavelengths_nm: vec![550.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::FocusMm(f64::INFINITY),
            n_rings: 6,
        };
        let rows = request.compute(&lens).unwrap().focus_spots(&lens).unwrap();
        assert_eq!((rows.len(), rows[0].len(), rows[0][2].shift_mm), (2, 5, 0.0));
        for spot in rows.iter().flatten() {
            let radius_um = spot.points_um[0].1.iter().map(|(x, y)| x.hypot(*y)).fold(0.0, f64::max);
            // A disc of f/5 as wide as a fifth of the way, whose root mean square radius is its own over the root of 2.
            let expected_um = 100.0 * spot.shift_mm.abs();
            assert!((radius_um - expected_um).abs() < 1e-2 * expected_um + 1e-6, "{} {radius_um}", spot.shift_mm);
            let rms_um = spot.rms_um.unwrap() * 2f64.sqrt();
            assert!((rms_um - expected_um).abs() < 1e-3 * expected_um + 1e-6, "{} {rms_um}", spot.shift_mm);
        }
    }
}
