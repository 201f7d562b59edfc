//! The numbers of an analysis.

use std::borrow::Cow;

use dioptric_diffraction::{
    PupilGrid, PupilSamples, Wavefront, WavefrontReference, best_wavefront_film_mm, opd_waves_at,
};
use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilBoundary, Vignetting,
    analysis::{
        AstigmaticFoci, Autofocus, AxisFoci, NumericalApertures, PupilCoordinates, PupilLight, PupilRule,
        PupilSampling, RayFan, SpotDiagram, StraightMap, field_limit_deg, hexapolar, projected_solid_angle_onto,
        pupil_line,
    },
    glam::{DVec2, DVec3},
    zernike::FRINGE_TERMS,
};
use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use super::{
    afocal::AfocalView,
    film::{FilmUse, RINGS},
    request::{AnalysisRequest, Field},
    rows::{
        AxialColorRow, FanRow, FieldRow, FocusData, GridRow, LensAnalysis, OpdMap, PupilRow, SpotRow, WavefrontRow,
    },
};
use crate::PlaneData;
use dioptric_pipeline::{PipelineError, nearest_to_reference_nm};

/// Steps of the curves over field.
const CURVE_STEPS: usize = 40;
/// Places along a fan.
const FAN_PLACES: usize = 41;
/// Azimuths of the edge of a pupil for the illumination, and of those the ones in the table.
const EDGE_AZIMUTHS: usize = 128;
const LISTED_AZIMUTHS: usize = 36;
/// The share of the stop's radius that the outermost rays keep to, so that rounding does not end them at its rim.
const WITHIN_RIM: f64 = 1.0 - 1e-9;
/// Cells of a map across the stop: an odd number, so that there is one in the middle.
const MAP_CELLS: usize = 51;
/// Lines of a grid of fields in each direction, and the widest angle that it goes to.
/// Lines of the grid of a distortion plot, each way.
pub const GRID_LINES: usize = 11;
const WIDEST_GRID_DEG: f64 = 60.0;
/// Zernike coefficients in the table: up to the sixth degree, less its last.
const ZERNIKE_TERMS: usize = 22;

impl AnalysisRequest {
    /// The reference wavelength, nm: of fields, pupils, f-numbers and focus.
    pub fn reference_nm(&self) -> f64 {
        let stated = self.main_wavelength_nm.filter(|nm| self.wavelengths_nm.contains(nm));
        stated.unwrap_or_else(|| nearest_to_reference_nm(&self.wavelengths_nm))
    }

    /// Analyzes a lens; where its light leaves in parallel and no film is given, through an ideal lens behind it.
    ///
    /// # Errors
    /// When a number makes no sense, a glass is not known at a wavelength, or the lens has no focus and no film is given.
    pub fn compute(&self, lens: &Lens) -> Result<LensAnalysis, PipelineError> {
        self.compute_until(lens, &Cancel::new())
    }

    /// Analyzes a lens until that is cancelled.
    ///
    /// # Errors
    /// As [`compute`](Self::compute), and when it is cancelled.
    pub fn compute_until(&self, lens: &Lens, cancel: &Cancel) -> Result<LensAnalysis, PipelineError> {
        self.check()?;
        let (lens, view) = self.lens_with_image(lens)?;
        let mut analysis = self.compute_imaging(&lens, cancel)?;
        analysis.notes.extend(view.map(|view| view.note()));
        analysis.afocal = view;
        Ok(analysis)
    }

    /// Returns the lens that is analyzed: the lens itself or, where it sends the light of the object off in parallel and no film
    /// is given, the lens with an ideal one behind it, and how that is looked at.
    ///
    /// # Errors
    /// When a glass is not known at the reference wavelength.
    pub fn lens_with_image<'a>(&self, lens: &'a Lens) -> Result<(Cow<'a, Lens>, Option<AfocalView>), PipelineError> {
        AfocalView::applied(lens, self.film, &self.film_use())
    }

    fn film_use(&self) -> FilmUse<'_> {
        FilmUse {
            main_nm: self.main_wavelength_nm,
            wavelengths_nm: &self.wavelengths_nm,
            weights: &self.wavelength_weights,
            distance_mm: self.distance_mm,
        }
    }

    fn compute_imaging(&self, lens: &Lens, cancel: &Cancel) -> Result<LensAnalysis, PipelineError> {
        let lenses: Vec<MonoLens> = self.wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let reference_nm = self.reference_nm();
        let reference = self.wavelengths_nm.iter().position(|&nm| nm == reference_nm).unwrap_or(0);
        let way_mm = self.distance_mm + lenses[reference].projection_center_z_mm();
        if way_mm == 0.0 {
            return Err(PipelineError::Value {
                origin: "the analysis".to_owned(),
                key: "distance_mm",
                found: self.distance_mm.to_string(),
                expected: "an object that does not lie in the entrance pupil".to_owned(),
            });
        }
        let (fields, mut notes) = self.fields_of(&lenses[reference], way_mm);
        notes.extend(lenses[reference].note_on_limit(self.distance_mm));
        notes.extend(lens.notes_on_ranges(&self.wavelengths_nm));
        // A stop that is wider than the light is no measure of where rays pass the pupil.
        let beam = lenses[reference].axial_beam(self.distance_mm);
        let coordinates = match beam.is_some_and(|beam| !beam.is_limited_by_stop) {
            true => PupilCoordinates::Vignetted,
            false => PupilCoordinates::Stop { radius_mm: WITHIN_RIM * lens.stop_semi_aperture_mm() },
        };
        let bench = Bench {
            lenses,
            reference,
            dioptres: 1e3 / way_mm,
            film_distance_mm: 0.0,
            sampling: PupilSampling { coordinates, places: hexapolar(self.n_rings), rims: Vignetting::On },
            rule: PupilRule::of_rings(self.n_rings),
            cancel: cancel.clone(),
        };
        bench.analyze(self, lens, (fields, notes))
    }
}

/// A lens at all wavelengths, with its object and film.
struct Bench {
    lenses: Vec<MonoLens>,
    reference: usize,
    dioptres: f64,
    film_distance_mm: f64,
    /// The rays of spot diagrams and fans.
    sampling: PupilSampling,
    /// The rays that stand for the light, of which sizes and foci are.
    rule: PupilRule,
    cancel: Cancel,
}

impl Bench {
    fn reference(&self) -> &MonoLens {
        &self.lenses[self.reference]
    }

    /// The point of a field, the same for all wavelengths.
    fn point(&self, field: &Field) -> ObjectPoint {
        field.point(self.reference(), self.dioptres)
    }

    /// The point of these tangents of field angles.
    fn point_of_tan(&self, field_tan: DVec2) -> ObjectPoint {
        ObjectPoint::from_field(self.reference(), field_tan, self.dioptres)
    }

    /// Returns the film with the least spots of these points at all wavelengths, mm, and their size, mm rms; each counts by its weight.
    fn best(&self, points: &[ObjectPoint], request: &AnalysisRequest, from_mm: f64) -> Option<(f64, f64)> {
        let of = |weights: &'_ [f64], n: usize| if weights.len() == n { weights.to_vec() } else { Vec::new() };
        let wavelength_weights = &of(&request.wavelength_weights, self.lenses.len());
        let point_weights = &of(&request.field_weights, points.len());
        // By the rays that every command focuses with, however many its spots have.
        let alike = Autofocus::alike(&self.lenses, points, PupilRule::of_rings(RINGS));
        Autofocus { wavelength_weights, point_weights, ..alike }.best_film_mm(from_mm)
    }

    /// Returns where each wavelength of a point on the axis focuses; films are sought about `from_mm`.
    fn axial_color(&self, distance_mm: f64, from_mm: f64) -> Vec<AxialColorRow> {
        let axis = [self.point_of_tan(DVec2::ZERO)];
        let focus_mm = |lens: &MonoLens| {
            let focus = Autofocus::alike(std::slice::from_ref(lens), &axis, PupilRule::of_rings(RINGS));
            focus.best_film_mm(from_mm).map(|found| found.0)
        };
        let reference_focus_mm = focus_mm(self.reference());
        let image_z_mm = |lens: &MonoLens| lens.conjugate(distance_mm).image_z_mm;
        let row = |lens: &MonoLens| AxialColorRow {
            wavelength_nm: lens.wavelength_nm(),
            paraxial_shift_mm: image_z_mm(lens) - image_z_mm(self.reference()),
            rms_shift_mm: focus_mm(lens).zip(reference_focus_mm).map(|(own, reference)| own - reference),
        };
        self.lenses.iter().map(row).collect()
    }

    fn analyze(
        mut self,
        request: &AnalysisRequest,
        lens: &Lens,
        (fields, mut notes): (Vec<Field>, Vec<String>),
    ) -> Result<LensAnalysis, PipelineError> {
        notes.extend(self.note_on_chief_rays(lens, &fields));
        let paraxial = self.reference().film_distance_mm_for(request.distance_mm);
        let axis = self.point_of_tan(DVec2::ZERO);
        let on_axis =
            paraxial.as_ref().ok().and_then(|&film_distance_mm| self.best(&[axis], request, film_distance_mm));
        let film = request.film.place(lens, request.film_use())?;
        self.film_distance_mm = film.distance_mm;
        let from_mm = paraxial.as_ref().map_or(self.film_distance_mm, |film_distance_mm| *film_distance_mm);
        let points: Vec<ObjectPoint> = fields.iter().map(|field| self.point(field)).collect();
        let over_fields = self.best(&points, request, from_mm);
        let wavefront = on_axis.and_then(|(film_distance_mm, _)| {
            best_wavefront_film_mm(self.reference(), &axis, film_distance_mm, PupilGrid::STANDARD).ok()
        });
        let first = self.reference().first_order();
        let pairs: Vec<(&Field, &MonoLens)> =
            fields.iter().flat_map(|field| self.lenses.iter().map(move |lens| (field, lens))).collect();
        let curve_fields = curve_fields(&fields);
        let straight = StraightMap::of(self.reference(), self.dioptres, self.film_distance_mm);
        let axial_cone = self.cone(&axis);
        self.cancel.check()?;
        let field_rows =
            |fields: &[Field]| self.each(fields, |field| self.field_row(field, (straight.as_ref(), axial_cone)));
        let (mut of_fields, mut of_curves) = (field_rows(&fields)?, field_rows(&curve_fields)?);
        let calibrated_scale = calibrated_scale(&of_curves);
        for row in of_fields.iter_mut().chain(&mut of_curves) {
            let relative = row.distortion_angle_percent.zip(calibrated_scale);
            row.distortion_calibrated_percent = relative.map(|(percent, scale)| (100.0 + percent) / scale - 100.0);
        }
        let apertures = NumericalApertures::find(self.reference(), request.distance_mm);
        let is_round = self.reference().is_rotational();
        let conjugate_x = self.reference().conjugate_x(request.distance_mm);
        let film_curvature = self.reference().image_surface().curvature_per_mm;
        Ok(LensAnalysis {
            lens: lens.name().to_owned(),
            distance_mm: request.distance_mm,
            reference_nm: self.reference().wavelength_nm(),
            wavelengths_nm: request.wavelengths_nm.clone(),
            wavelength_weights: request.wavelength_weights.clone(),
            notes,
            afocal: None,
            object_index: first.object_index,
            image_index: first.image_index,
            object_na: apertures.map(|found| found.object).filter(|_| request.distance_mm.is_finite()),
            image_na: apertures.map(|found| found.image),
            x_plane: (!is_round).then(|| PlaneData::of_x(self.reference())),
            film_radius_mm: (film_curvature != 0.0).then(|| 1.0 / film_curvature),
            efl_mm: first.efl_mm,
            f_number: first.f_number,
            t_number: self.reference().t_number(request.distance_mm),
            working_f_number: self.reference().working_f_number(request.distance_mm),
            film_distance_mm: self.film_distance_mm,
            film: film.origin,
            half_illumination_deg: field_limit_deg(self.reference(), 0.5),
            focus: FocusData {
                paraxial_film_mm: paraxial.ok(),
                paraxial_x_film_mm: (!is_round).then_some(conjugate_x.image_z_mm),
                axis_film_mm: on_axis.map(|found| found.0),
                axis_rms_um: on_axis.map(|found| 1e3 * found.1),
                fields_film_mm: over_fields.map(|found| found.0),
                fields_rms_um: over_fields.map(|found| 1e3 * found.1),
                wavefront_film_mm: wavefront.map(|found| found.0),
                wavefront_rms_waves: wavefront.map(|found| found.1),
            },
            axial_color: self.axial_color(request.distance_mm, from_mm),
            spots: self.each(&pairs, |(field, lens)| self.spot_row(field, lens))?,
            fans: self.each(&pairs, |(field, lens)| self.fan_row(field, lens))?,
            opd_maps: self.each(&pairs, |(field, lens)| self.opd_map(field, lens))?,
            grid: straight.map_or_else(Vec::new, |straight| self.grid(&fields, &straight)),
            calibrated_scale,
            fields: of_fields,
            curves: of_curves,
        })
    }

    /// Returns a row of each on all threads, until the work is cancelled.
    fn each<T: Sync, R: Send>(&self, of: &[T], row: impl Fn(&T) -> R + Sync) -> Result<Vec<R>, Cancelled> {
        of.par_iter().map(|one| self.cancel.check().map(|()| row(one))).collect()
    }

    /// Returns a sentence on lit fields whose chief ray a rim or an opening stops; that it is stopped by an obscuration goes without saying.
    fn note_on_chief_rays(&self, lens: &Lens, fields: &[Field]) -> Option<String> {
        if lens.apertures().iter().any(|aperture| aperture.is_obscuration) {
            return None;
        }
        let mono = self.reference();
        let is_stopped = |field: &&Field| {
            let point = self.point(field);
            let mut chief = PupilCoordinates::stop(mono).rays(mono, &point, &[DVec2::ZERO]);
            mono.trace(&mut chief, Vignetting::On);
            chief.n_in_flight() == 0 && PupilLight::to_film(mono, &point, self.film_distance_mm, self.rule).is_some()
        };
        let labels: Vec<String> = fields.iter().filter(is_stopped).map(|field| field.place.label()).collect();
        (!labels.is_empty()).then(|| {
            format!(
                "the chief ray of {} is stopped: heights, path differences and wavefronts are about where it would land",
                labels.join(", ")
            )
        })
    }

    fn spot_row(&self, field: &Field, lens: &MonoLens) -> SpotRow {
        let point = self.point(field);
        let spot = SpotDiagram::trace(lens, &point, self.film_distance_mm, &self.sampling);
        let light = PupilLight::to_film(lens, &point, self.film_distance_mm, self.rule);
        let moments = light.map(|light| light.moments(lens, self.film_distance_mm));
        let um = |mm: Option<f64>| mm.map(|mm| 1e3 * mm);
        let centroid_mm = moments.map(|(centroid_mm, _)| centroid_mm);
        let [sigma_x_mm, sigma_y_mm, rms_mm] = match moments {
            Some((_, [xx, yy, _])) => [xx, yy, xx + yy].map(|square: f64| Some(square.max(0.0).sqrt())),
            None => [None; 3],
        };
        let from_chief_mm =
            spot.chief_mm.zip(centroid_mm).map(|(chief_mm, centroid_mm)| chief_mm.distance(centroid_mm));
        let center_mm = self.reference().chief_film_point_mm(&point, self.film_distance_mm).or(centroid_mm);
        let pupil = PupilBoundary::find(lens, &point, LISTED_AZIMUTHS).map(|pupil| PupilRow {
            z_mm: pupil.z_mm(),
            center_mm: pupil.center_mm().to_array(),
            rho_max_mm: pupil.rho_at_azimuths_mm().to_vec(),
            area_mm2: pupil.area_mm2(),
        });
        let wavefront =
            Wavefront::trace(lens, &point, self.film_distance_mm, PupilGrid::STANDARD, WavefrontReference::Best).ok();
        SpotRow {
            place: field.place,
            wavelength_nm: lens.wavelength_nm(),
            height_mm: centroid_mm.map(|centroid_mm| 0.0 - centroid_mm.dot(field.direction)),
            image_mm: centroid_mm.map(in_picture),
            rms_um: um(rms_mm),
            rms_about_chief_um: um(rms_mm.zip(from_chief_mm).map(|(rms, off)| rms.hypot(off))),
            radius_um: um(spot.radius_about_chief_mm()),
            sigma_x_um: um(sigma_x_mm),
            sigma_y_um: um(sigma_y_mm),
            ray_share: spot.ray_share(),
            wavefront: wavefront.map(|wavefront| {
                let peak = PupilSamples::peak_of(lens, &point, self.film_distance_mm);
                WavefrontRow {
                    rms_waves: wavefront.rms_waves(),
                    peak_to_valley_waves: wavefront.peak_to_valley_waves(),
                    strehl: peak.as_ref().ok().map(|peak| peak.strehl),
                    no_strehl: peak.err().map(|error| error.to_string()),
                    strehl_of_rms: (-(std::f64::consts::TAU * wavefront.rms_waves()).powi(2)).exp(),
                    zernike_waves: wavefront.zernike_waves(ZERNIKE_TERMS),
                    fringe_waves: wavefront.fringe_waves(FRINGE_TERMS),
                }
            }),
            pupil,
            points_um: center_mm.map_or(Vec::new(), |center_mm| {
                let from_center = |p: &DVec2| (center_mm - *p) * 1e3;
                spot.points_mm.iter().map(from_center).map(|p| (p.x, p.y)).collect()
            }),
        }
    }

    fn fan_row(&self, field: &Field, lens: &MonoLens) -> FanRow {
        let point = self.point(field);
        let along = |direction: DVec2| {
            let sampling = PupilSampling { places: pupil_line(direction, FAN_PLACES), ..self.sampling.clone() };
            let none = || vec![None; FAN_PLACES];
            let errors_um = RayFan::trace(lens, &point, self.film_distance_mm, &sampling).map_or_else(none, |fan| {
                // The picture frame is the lens frame turned by half a turn.
                fan.errors_mm.iter().map(|error| error.map(|mm| -1e3 * mm.dot(direction))).collect()
            });
            (errors_um, opd_waves_at(lens, &point, self.film_distance_mm, &sampling).unwrap_or_else(none))
        };
        let ((tangential_um, tangential_waves), (sagittal_um, sagittal_waves)) = (along(DVec2::Y), along(DVec2::X));
        FanRow {
            place: field.place,
            wavelength_nm: lens.wavelength_nm(),
            places: pupil_line(DVec2::X, FAN_PLACES).iter().map(|place| place.x).collect(),
            tangential_um,
            sagittal_um,
            tangential_waves,
            sagittal_waves,
        }
    }

    fn field_row(&self, field: &Field, (straight, axial_cone): (Option<&StraightMap>, f64)) -> FieldRow {
        let (point, lens) = (self.point(field), self.reference());
        let place_mm = |lens: &MonoLens| lens.chief_film_point_mm(&point, self.film_distance_mm);
        let height_mm = |lens: &MonoLens| place_mm(lens).map(|place_mm| 0.0 - place_mm.dot(field.direction));
        let reference_mm = height_mm(lens);
        let shift_um =
            |lens: &MonoLens| height_mm(lens).zip(reference_mm).map(|(own, reference)| 1e3 * (own - reference));
        let [against_tangent, against_angle] = self.distortions(field, straight, place_mm(lens));
        // Along the axis from where the chief ray meets the film, which may be curved.
        let film_distance_mm = self.film_distance_mm + self.chief_on_film(&point).map_or(0.0, |own| own.z);
        let foci = AstigmaticFoci::find(lens, &point);
        let axes = (!lens.is_rotational()).then(|| AxisFoci::find(lens, &point)).flatten();
        FieldRow {
            place: field.place,
            height_mm: reference_mm,
            image_mm: place_mm(lens).map(in_picture),
            distortion_tangent_percent: against_tangent.map(|relative| 100.0 * relative),
            distortion_angle_percent: against_angle.map(|relative| 100.0 * relative),
            distortion_calibrated_percent: None,
            tangential_focus_mm: foci.map(|foci| foci.tangential_mm - film_distance_mm),
            sagittal_focus_mm: foci.map(|foci| foci.sagittal_mm - film_distance_mm),
            x_focus_mm: axes.map(|foci| foci.x_mm - film_distance_mm),
            y_focus_mm: axes.map(|foci| foci.y_mm - film_distance_mm),
            relative_illumination: (axial_cone > 0.0).then(|| self.cone(&point) / axial_cone),
            lateral_color_um: self.lenses.iter().map(shift_um).collect(),
        }
    }

    /// Returns the relative distortion against the tangent of the field and against its angle: that of the paraxial scale
    /// or, for a lens without an axis of symmetry, of the straight map of small fields.
    fn distortions(&self, field: &Field, straight: Option<&StraightMap>, chief_mm: Option<DVec2>) -> [Option<f64>; 2] {
        let (tan, angle) = (field.tan(), Some(field.angle_rad));
        if self.reference().is_rotational() {
            let scale_mm = self.reference().film_scale_mm(self.film_distance_mm);
            let height_mm = chief_mm.map(|chief_mm| -chief_mm.dot(field.direction));
            return [tan, angle].map(|ideal| {
                let ideal_mm = scale_mm * ideal?;
                Some(if ideal_mm == 0.0 { 0.0 } else { height_mm? / ideal_mm - 1.0 })
            });
        }
        [tan, angle.filter(|_| tan.is_some())]
            .map(|ideal| Some(straight?.relative(ideal? * field.direction, chief_mm?)))
    }

    /// Returns where the chief ray meets the film, in the film's own frame, mm.
    fn chief_on_film(&self, point: &ObjectPoint) -> Option<DVec3> {
        let ray = self.reference().chief_ray_on_film(point, self.film_distance_mm)?;
        Some(self.reference().film_placement(self.film_distance_mm).surface_from_lens(ray.point_mm(0)))
    }

    /// Returns the projected solid angle of a point's light on the film as it slopes there.
    fn cone(&self, point: &ObjectPoint) -> f64 {
        let lens = self.reference();
        let slope = self.chief_on_film(point).map(|own| lens.image_surface().slope_at(own.truncate()));
        let normal = slope.map_or(DVec3::Z, |slope| (-slope).extend(1.0).normalize());
        let normal = lens.film_placement(self.film_distance_mm).rotation * normal;
        projected_solid_angle_onto(lens, point, EDGE_AZIMUTHS, normal)
    }

    fn opd_map(&self, field: &Field, lens: &MonoLens) -> OpdMap {
        let at = |i: usize| (2 * i + 1) as f64 / MAP_CELLS as f64 - 1.0;
        let cells = (0..MAP_CELLS).flat_map(|row| (0..MAP_CELLS).map(move |column| DVec2::new(at(column), at(row))));
        let cells: Vec<DVec2> = cells.collect();
        let is_inside = |cell: &DVec2| cell.length_squared() < 1.0;
        let places = cells.iter().copied().filter(is_inside).collect();
        let sampling = PupilSampling { places, ..self.sampling.clone() };
        let found = opd_waves_at(lens, &self.point(field), self.film_distance_mm, &sampling).unwrap_or_default();
        let mut found = found.into_iter();
        let waves = cells.iter().map(|cell| if is_inside(cell) { found.next().flatten() } else { None }).collect();
        OpdMap { place: field.place, wavelength_nm: lens.wavelength_nm(), n_across: MAP_CELLS, waves }
    }

    /// Returns a grid of chief rays that reaches as far as the fields do.
    fn grid(&self, fields: &[Field], straight: &StraightMap) -> Vec<GridRow> {
        let tan = |field: &Field| field.direction * field.angle_rad.min(WIDEST_GRID_DEG.to_radians()).tan();
        let widest = |of: &dyn Fn(DVec2) -> f64| fields.iter().map(|field| of(tan(field))).fold(0.0, f64::max);
        let [x, y] = [widest(&|tan| tan.x.abs()), widest(&|tan| tan.y.abs())];
        // A row of fields is the half diagonal of a square.
        let half = match x == 0.0 || y == 0.0 {
            true => DVec2::splat(x.max(y) * std::f64::consts::FRAC_1_SQRT_2),
            false => DVec2::new(x, y),
        };
        let at = |i: usize| 2.0 * i as f64 / (GRID_LINES - 1) as f64 - 1.0;
        let places = (0..GRID_LINES).flat_map(|row| (0..GRID_LINES).map(move |column| DVec2::new(at(column), at(row))));
        let places: Vec<DVec2> = places.map(|place| place * half).collect();
        let row = |&tan: &DVec2| GridRow {
            field_xy_deg: tan.to_array().map(|tan| tan.atan().to_degrees()),
            image_mm: self
                .reference()
                .chief_film_point_mm(&self.point_of_tan(tan), self.film_distance_mm)
                .map(in_picture),
            straight_mm: in_picture(straight.at_mm(tan)),
        };
        places.par_iter().map(row).collect()
    }
}

/// Returns c for which Σ (h − c f θ)² is least over rows with h = (1 + relative) f θ; none of the axis alone.
fn calibrated_scale(rows: &[FieldRow]) -> Option<f64> {
    let [with_height, with_angle] = rows.iter().fold([0.0; 2], |[a, b], row| {
        let square = row.place.field_deg.powi(2);
        row.distortion_angle_percent.map_or([a, b], |percent| [a + square * (1.0 + 0.01 * percent), b + square])
    });
    (with_angle > 0.0).then(|| with_height / with_angle)
}

/// Returns a place on the film in the picture frame, which is turned by half a turn.
fn in_picture(on_film_mm: DVec2) -> [f64; 2] {
    [0.0 - on_film_mm.x, 0.0 - on_film_mm.y]
}

/// Returns the fields that curves are drawn over: from the axis to the widest of these.
fn curve_fields(fields: &[Field]) -> Vec<Field> {
    let last = fields.iter().max_by(|a, b| a.place.field_deg.total_cmp(&b.place.field_deg));
    let curve = |last: &Field| (0..=CURVE_STEPS).map(|i| last.at_share(i as f64 / CURVE_STEPS as f64)).collect();
    last.map(curve).unwrap_or_default()
}

#[cfg(test)]
mod tests;
