//! The numbers of an analysis.

use dioptric_diffraction::{PupilGrid, Wavefront, WavefrontReference, best_wavefront_film_mm, opd_waves_at};
use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilBoundary, Rims,
    analysis::{
        AstigmaticFoci, Autofocus, Distortion, Projection, PupilCoordinates, PupilSampling, RayFan, SpotDiagram,
        field_limit_deg, hexapolar, projected_solid_angle, pupil_line,
    },
    glam::DVec2,
};
use rayon::prelude::*;

use super::rows::{AxialColorRow, FanRow, FieldRow, FocusData, LensAnalysis, PupilRow, SpotRow, WavefrontRow};
use crate::{PipelineError, REFERENCE_WAVELENGTH_NM};

/// The share of the axial illumination down to which fields are chosen where none are given.
const DIMMEST: f64 = 0.25;
/// Steps of the curves over field.
const CURVE_STEPS: usize = 40;
/// Places along a fan.
const FAN_PLACES: usize = 41;
/// Azimuths of a pupil's edge for the illumination, and those that are told.
const EDGE_AZIMUTHS: usize = 128;
const TOLD_AZIMUTHS: usize = 36;
/// The share of the stop's radius that the outermost rays keep to, so that rounding does not end them at its rim.
const WITHIN_RIM: f64 = 1.0 - 1e-9;
/// Zernike coefficients that are told: up to the sixth degree, less its last.
const ZERNIKE_TERMS: usize = 22;

/// Where the film is for an analysis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnalysisFilm {
    /// Where the spot on the axis is smallest, all wavelengths together.
    BestFocus,
    /// At the paraxial image, at the reference wavelength, of an object this far before the first vertex, mm.
    FocusMm(f64),
    /// This far behind the last vertex, mm.
    FilmMm(f64),
}

/// What to analyse a lens for.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalysisRequest {
    /// Field angles at the entrance pupil, degrees; `None` for 0, 0.5, 0.7 and 1 of the field at which the illumination
    /// falls to a quarter.
    pub fields_deg: Option<Vec<f64>>,
    /// Wavelengths, nm; that nearest to 550 nm is the reference.
    pub wavelengths_nm: Vec<f64>,
    /// Distance of the object before the first vertex, mm; infinity for a far one.
    pub distance_mm: f64,
    /// Where the film is.
    pub film: AnalysisFilm,
    /// Rings of rays in a spot diagram.
    pub n_rings: usize,
}

impl AnalysisRequest {
    /// Analyses a lens.
    ///
    /// # Errors
    /// When a number makes no sense, a glass is not known at a wavelength, or the lens has no focus and no film is given.
    pub fn compute(&self, lens: &Lens) -> Result<LensAnalysis, PipelineError> {
        self.check()?;
        let lenses: Vec<MonoLens> = self.wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let off = |i: &usize| (self.wavelengths_nm[*i] - REFERENCE_WAVELENGTH_NM).abs();
        let reference = (0..lenses.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
        let dioptres = 1e3 / (self.distance_mm + lenses[reference].projection_center_z_mm());
        let fields_deg = match &self.fields_deg {
            Some(fields_deg) => fields_deg.clone(),
            None => {
                let limit_deg = field_limit_deg(&lenses[reference], DIMMEST).unwrap_or(0.0);
                // A tenth of a degree is a round number.
                [0.0, 0.5, 0.7, 1.0].map(|share| (share * limit_deg * 10.0).floor() / 10.0).to_vec()
            }
        };
        let bench = Bench {
            lenses,
            reference,
            dioptres,
            film_mm: 0.0,
            sampling: PupilSampling {
                coordinates: PupilCoordinates::Stop { radius_mm: WITHIN_RIM * lens.stop_semi_aperture_mm() },
                places: hexapolar(self.n_rings),
                rims: Rims::Clip,
            },
        };
        bench.analyse(self, lens, fields_deg)
    }

    fn check(&self) -> Result<(), PipelineError> {
        let wrong = |key, found: f64, expected: &str| PipelineError::Value {
            origin: "the analysis".to_owned(),
            key,
            found: found.to_string(),
            expected: expected.to_owned(),
        };
        if let Some(field) = self.fields_deg.iter().flatten().find(|f| !(0.0..89.0).contains(*f)) {
            return Err(wrong("fields_deg", *field, "angles from 0 to below 89 degrees"));
        }
        if self.wavelengths_nm.is_empty() || self.fields_deg.as_ref().is_some_and(Vec::is_empty) {
            return Err(wrong("the number of fields or wavelengths", 0.0, "at least 1"));
        }
        if self.distance_mm.is_nan() || self.distance_mm <= 0.0 {
            return Err(wrong("distance_mm", self.distance_mm, "a number above 0, or inf"));
        }
        if !(1..=200).contains(&self.n_rings) {
            return Err(wrong("rings", self.n_rings as f64, "1 to 200"));
        }
        Ok(())
    }
}

/// A lens at all wavelengths, with its object and film.
struct Bench {
    lenses: Vec<MonoLens>,
    reference: usize,
    dioptres: f64,
    film_mm: f64,
    sampling: PupilSampling,
}

impl Bench {
    fn reference(&self) -> &MonoLens {
        &self.lenses[self.reference]
    }

    /// The point straight above the axis, the same for all wavelengths.
    fn point(&self, field_deg: f64) -> ObjectPoint {
        ObjectPoint::from_field(self.reference(), DVec2::new(0.0, field_deg.to_radians().tan()), self.dioptres)
    }

    fn analyse(
        mut self,
        request: &AnalysisRequest,
        lens: &Lens,
        fields_deg: Vec<f64>,
    ) -> Result<LensAnalysis, PipelineError> {
        let paraxial = self.reference().film_mm_for(request.distance_mm);
        let best = |points: &[ObjectPoint], lenses: &[MonoLens], from_mm: f64| {
            Autofocus { lenses, points, sampling: &self.sampling }.best_film_mm(from_mm)
        };
        let axis = self.point(0.0);
        let on_axis = paraxial.as_ref().ok().and_then(|&film_mm| best(&[axis], &self.lenses, film_mm));
        self.film_mm = match (request.film, on_axis) {
            (AnalysisFilm::FilmMm(film_mm), _) => film_mm,
            (AnalysisFilm::FocusMm(distance_mm), _) => self.reference().film_mm_for(distance_mm)?,
            (AnalysisFilm::BestFocus, Some((film_mm, _))) => film_mm,
            (AnalysisFilm::BestFocus, None) => paraxial.clone()?,
        };
        let from_mm = paraxial.as_ref().map_or(self.film_mm, |film_mm| *film_mm);
        let points: Vec<ObjectPoint> = fields_deg.iter().map(|&field_deg| self.point(field_deg)).collect();
        let over_fields = best(&points, &self.lenses, from_mm);
        let wavefront = on_axis.and_then(|(film_mm, _)| {
            best_wavefront_film_mm(self.reference(), &axis, film_mm, PupilGrid::STANDARD).ok()
        });
        let own_focus = |lens: &MonoLens| best(&[axis], std::slice::from_ref(lens), from_mm).map(|found| found.0);
        let reference_focus = own_focus(self.reference());
        let image_z_mm = |lens: &MonoLens| lens.conjugate(request.distance_mm).image_z_mm;
        let axial_color = |lens: &MonoLens| AxialColorRow {
            wavelength_nm: lens.wavelength_nm(),
            paraxial_shift_mm: image_z_mm(lens) - image_z_mm(self.reference()),
            rms_shift_mm: own_focus(lens).zip(reference_focus).map(|(own, reference)| own - reference),
        };
        let first = self.reference().first_order();
        let pairs: Vec<(f64, &MonoLens)> =
            fields_deg.iter().flat_map(|&field_deg| self.lenses.iter().map(move |lens| (field_deg, lens))).collect();
        let last_deg = fields_deg.iter().copied().fold(0.0, f64::max);
        let curve_fields: Vec<f64> = (0..=CURVE_STEPS).map(|i| last_deg * i as f64 / CURVE_STEPS as f64).collect();
        let axial_cone = projected_solid_angle(self.reference(), &axis, EDGE_AZIMUTHS);
        let field_rows =
            |fields: &[f64]| fields.par_iter().map(|&field_deg| self.field_row(field_deg, axial_cone)).collect();
        Ok(LensAnalysis {
            lens: lens.name().to_owned(),
            distance_mm: request.distance_mm,
            reference_nm: self.reference().wavelength_nm(),
            wavelengths_nm: request.wavelengths_nm.clone(),
            efl_mm: first.efl_mm,
            f_number: first.f_number,
            working_f_number: self.reference().working_f_number(request.distance_mm),
            film_mm: self.film_mm,
            half_illumination_deg: field_limit_deg(self.reference(), 0.5),
            focus: FocusData {
                paraxial_film_mm: paraxial.ok(),
                axis_film_mm: on_axis.map(|found| found.0),
                axis_rms_um: on_axis.map(|found| 1e3 * found.1),
                fields_film_mm: over_fields.map(|found| found.0),
                fields_rms_um: over_fields.map(|found| 1e3 * found.1),
                wavefront_film_mm: wavefront.map(|found| found.0),
                wavefront_rms_waves: wavefront.map(|found| found.1),
            },
            axial_color: self.lenses.iter().map(axial_color).collect(),
            spots: pairs.par_iter().map(|&(field_deg, lens)| self.spot_row(field_deg, lens)).collect(),
            fans: pairs.par_iter().map(|&(field_deg, lens)| self.fan_row(field_deg, lens)).collect(),
            fields: field_rows(&fields_deg),
            curves: field_rows(&curve_fields),
        })
    }

    fn spot_row(&self, field_deg: f64, lens: &MonoLens) -> SpotRow {
        let point = self.point(field_deg);
        let spot = SpotDiagram::trace(lens, &point, self.film_mm, &self.sampling);
        let um = |mm: Option<f64>| mm.map(|mm| 1e3 * mm);
        let sigma_mm = spot.sigma_mm();
        let center_mm = self.reference().chief_film_point_mm(&point, self.film_mm).or(spot.centroid_mm());
        let pupil = PupilBoundary::find(lens, &point, TOLD_AZIMUTHS).map(|pupil| PupilRow {
            z_mm: pupil.z_mm(),
            center_mm: pupil.center_mm().to_array(),
            rho_max_mm: pupil.rho_at_azimuths_mm().to_vec(),
            area_mm2: pupil.area_mm2(),
        });
        let wavefront =
            Wavefront::trace(lens, &point, self.film_mm, PupilGrid::STANDARD, WavefrontReference::Best).ok();
        SpotRow {
            field_deg,
            wavelength_nm: lens.wavelength_nm(),
            height_mm: spot.centroid_mm().map(|centroid_mm| 0.0 - centroid_mm.y),
            rms_um: um(spot.rms_mm()),
            rms_about_chief_um: um(spot.rms_about_chief_mm()),
            radius_um: um(spot.radius_about_chief_mm()),
            sigma_x_um: um(sigma_mm.map(|sigma| sigma.x)),
            sigma_y_um: um(sigma_mm.map(|sigma| sigma.y)),
            transmission: spot.transmission(),
            wavefront: wavefront.map(|wavefront| WavefrontRow {
                rms_waves: wavefront.rms_waves(),
                peak_to_valley_waves: wavefront.peak_to_valley_waves(),
                strehl: wavefront.strehl(),
                zernike_waves: wavefront.zernike_waves(ZERNIKE_TERMS),
            }),
            pupil,
            points_um: center_mm.map_or(Vec::new(), |center_mm| {
                let in_picture = |p: &DVec2| (center_mm - *p) * 1e3;
                spot.points_mm.iter().map(in_picture).map(|p| (p.x, p.y)).collect()
            }),
        }
    }

    fn fan_row(&self, field_deg: f64, lens: &MonoLens) -> FanRow {
        let point = self.point(field_deg);
        let along = |direction: DVec2| {
            let sampling = PupilSampling { places: pupil_line(direction, FAN_PLACES), ..self.sampling.clone() };
            let none = || vec![None; FAN_PLACES];
            let errors_um = RayFan::trace(lens, &point, self.film_mm, &sampling).map_or_else(none, |fan| {
                // The picture frame is the lens frame turned by half a turn.
                fan.errors_mm.iter().map(|error| error.map(|mm| -1e3 * mm.dot(direction))).collect()
            });
            (errors_um, opd_waves_at(lens, &point, self.film_mm, &sampling).unwrap_or_else(none))
        };
        let ((tangential_um, tangential_waves), (sagittal_um, sagittal_waves)) = (along(DVec2::Y), along(DVec2::X));
        FanRow {
            field_deg,
            wavelength_nm: lens.wavelength_nm(),
            places: pupil_line(DVec2::X, FAN_PLACES).iter().map(|place| place.x).collect(),
            tangential_um,
            sagittal_um,
            tangential_waves,
            sagittal_waves,
        }
    }

    fn field_row(&self, field_deg: f64, axial_cone: f64) -> FieldRow {
        let (point, lens) = (self.point(field_deg), self.reference());
        let field = (field_deg.to_radians().tan(), self.dioptres);
        let distortion = |projection| Distortion::of(lens, field, self.film_mm, projection);
        let percent = |projection| distortion(projection).map(|found| 100.0 * found.relative());
        let foci = AstigmaticFoci::find(lens, &point);
        let height_mm =
            |lens: &MonoLens| lens.chief_film_point_mm(&point, self.film_mm).map(|place_mm| 0.0 - place_mm.y);
        let reference_mm = height_mm(lens);
        let shift_um =
            |lens: &MonoLens| height_mm(lens).zip(reference_mm).map(|(own, reference)| 1e3 * (own - reference));
        FieldRow {
            field_deg,
            height_mm: reference_mm,
            distortion_tangent_percent: percent(Projection::Tangent),
            distortion_angle_percent: percent(Projection::Angle),
            tangential_focus_mm: foci.map(|foci| foci.tangential_mm - self.film_mm),
            sagittal_focus_mm: foci.map(|foci| foci.sagittal_mm - self.film_mm),
            relative_illumination: (axial_cone > 0.0)
                .then(|| projected_solid_angle(lens, &point, EDGE_AZIMUTHS) / axial_cone),
            lateral_color_um: self.lenses.iter().map(shift_um).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use dioptric_psf::{BankSettings, Diffraction, PsfBank};

    use super::*;

    fn request(fields_deg: Vec<f64>) -> AnalysisRequest {
        AnalysisRequest {
            fields_deg: Some(fields_deg),
            wavelengths_nm: vec![450.0, 550.0, 650.0],
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::BestFocus,
            n_rings: 6,
        }
    }

    #[test]
    fn every_part_is_there_and_agrees_with_the_others() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let analysis = request(vec![0.0, 10.0]).compute(&lens).unwrap();
        assert_eq!((analysis.spots.len(), analysis.fans.len(), analysis.fields.len()), (6, 6, 2));
        assert_eq!((analysis.reference_nm, analysis.film_mm), (550.0, analysis.focus.axis_film_mm.unwrap()));
        let on_axis = &analysis.spots[1];
        // Rims end no ray of the axis, and its spot is round.
        assert_eq!(on_axis.transmission, 1.0);
        assert!((on_axis.sigma_x_um.unwrap() / on_axis.sigma_y_um.unwrap() - 1.0).abs() < 1e-9);
        let oblique = &analysis.spots[4];
        assert!(oblique.height_mm.unwrap() > 8.5 && oblique.height_mm.unwrap() < 9.2);
        assert_eq!(oblique.wavefront.as_ref().unwrap().zernike_waves.len(), ZERNIKE_TERMS);
        let (last, curve_end) = (&analysis.fields[1], &analysis.curves[CURVE_STEPS]);
        assert_eq!(last, curve_end);
        assert_eq!(last.lateral_color_um[1], Some(0.0));
        assert!((analysis.fields[0].relative_illumination.unwrap() - 1.0).abs() < 1e-12);
        let svg = analysis.page_svg();
        assert!(svg.contains("field curvature") && svg.contains("550 nm (reference)") && !svg.contains("NaN"));
        assert!(analysis.spots_svg().contains("10.0°, 650 nm"));
    }

    #[test]
    fn a_fan_ends_in_its_spot() {
        let lens = Lens::built_in("tessar-50mm").unwrap();
        let analysis = request(vec![12.0]).compute(&lens).unwrap();
        for (spot, fan) in analysis.spots.iter().zip(&analysis.fans) {
            let largest =
                fan.tangential_um.iter().chain(&fan.sagittal_um).flatten().fold(0.0_f64, |m, e| m.max(e.abs()));
            // The spot has more rays, but none beyond the same rims and stop by much.
            assert!(largest > 0.4 * spot.radius_um.unwrap() && largest < 1.2 * spot.radius_um.unwrap(), "{largest}");
            // The slope of the path difference is the transverse error: it vanishes at the chief ray's place.
            let middle = FAN_PLACES / 2;
            assert_eq!((fan.tangential_um[middle], fan.tangential_waves[middle]), (Some(0.0), Some(0.0)));
        }
    }

    #[test]
    fn illumination_is_that_of_the_ray_map() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
        let analysis = request(vec![0.0, 5.0, 10.0]).compute(&lens).unwrap();
        let tan = 12f64.to_radians().tan();
        let settings = BankSettings::covering(analysis.film_mm, tan, (0.0, 0.0), (550.0, 550.0), Diffraction::None);
        let geometry = PsfBank::build(&lens, &settings).unwrap().geometry(0.0, 550.0);
        let on_axis = geometry.irradiance_per_radiance(0.0);
        for row in &analysis.fields {
            let expected = geometry.irradiance_per_radiance(row.field_deg.to_radians().tan()) / on_axis;
            // Forward and backward illumination differ by 0.01 to 0.16 % where no rim but the stop's counts; the map's
            // own interpolation adds as much.
            assert!((row.relative_illumination.unwrap() / expected - 1.0).abs() < 3e-3, "{row:?} {expected}");
        }
    }

    #[test]
    fn fields_are_chosen_where_none_are_given() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap();
        let analysis = AnalysisRequest { fields_deg: None, ..request(vec![]) }.compute(&lens).unwrap();
        assert_eq!(analysis.fields.len(), 4);
        assert!(analysis.fields[3].field_deg > 80.0 && analysis.fields[3].distortion_tangent_percent.unwrap() < -80.0);
        assert!(analysis.fans[11].tangential_um[FAN_PLACES / 2].is_some(), "the chief ray is found");
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let good = request(vec![0.0]);
        for (wrong, word) in [
            (AnalysisRequest { fields_deg: Some(vec![89.0]), ..good.clone() }, "fields_deg is 89"),
            (AnalysisRequest { wavelengths_nm: vec![], ..good.clone() }, "at least 1"),
            (AnalysisRequest { distance_mm: -1.0, ..good.clone() }, "distance_mm is -1"),
            (AnalysisRequest { n_rings: 0, ..good.clone() }, "rings is 0"),
            (AnalysisRequest { distance_mm: 10.0, ..good.clone() }, "forms no image"),
        ] {
            let message = wrong.compute(&lens).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        // A pinhole has no focus, but works with a film.
        let pinhole = Lens::pinhole(0.5).unwrap();
        assert!(good.compute(&pinhole).is_err());
        let analysis = AnalysisRequest { film: AnalysisFilm::FilmMm(40.0), ..request(vec![0.0, 20.0]) };
        let analysis = analysis.compute(&pinhole).unwrap();
        assert!(analysis.fields[1].distortion_tangent_percent.unwrap().abs() < 1e-9);
    }
}
