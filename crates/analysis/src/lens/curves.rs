//! Curves that designers read of a lens: the shift of the focus with the wavelength, the size of spots over field, focus and
//! wavelength, wavefronts over field, and what rims leave of the pupil.

use dioptric_diffraction::{PupilGrid, Wavefront, WavefrontReference};
use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilRegion, SeidelSettings,
    analysis::{PupilLight, PupilRule},
};
use rayon::prelude::*;

use super::{
    afocal::AfocalView,
    request::Field,
    rows::{FieldPlace, LensAnalysis},
};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// Steps of the wavelength.
const WAVELENGTHS: usize = 40;
/// By how much of it the wavelength goes to each side where there is one alone.
const BESIDE: f64 = 0.15;
/// One in so many of the fields of an analysis's curves has a place in a curve over field.
const EACH: usize = 2;
/// Steps of the film to each side of its place.
const FOCUS_STEPS: i32 = 16;
/// Rings of the rays that stand for the light, and azimuths of the outline of a pupil.
const RINGS: usize = 8;
const AZIMUTHS: usize = 96;
/// The widest field whose chief ray first-order theory is asked for, degrees.
const WIDEST_CHIEF_DEG: f64 = 45.0;

/// Curves of a lens that was analyzed, each with the name that its file has.
#[derive(Clone, Debug, PartialEq)]
pub struct LensCurves(pub Vec<(&'static str, LineChart)>);

impl LensAnalysis {
    /// Computes curves of the lens that was analyzed, at the fields, wavelengths and film of the analysis.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength.
    pub fn lens_curves(&self, lens: &Lens) -> Result<LensCurves, PipelineError> {
        let bench = Bench::of(self, lens)?;
        let mut curves = vec![
            ("chromatic_focal_shift", bench.chromatic_focal_shift()),
            ("rms_over_field", bench.spots_over_field()),
            ("wavefront_over_field", bench.wavefronts_over_field()),
            ("rms_over_focus", bench.spots_over_focus()),
            ("rms_over_wavelength", bench.spots_over_wavelength()),
            ("vignetting", bench.vignetting()),
        ];
        curves.extend(bench.y_ybar().map(|chart| ("y_ybar", chart)));
        if self.afocal.is_some() {
            let in_angles = |(name, chart)| match name {
                "y_ybar" => (name, chart),
                _ => (name, AfocalView::chart_in_angles(chart)),
            };
            curves = curves.into_iter().map(in_angles).collect();
        }
        Ok(LensCurves(curves))
    }
}

/// A lens that was analyzed, at its wavelengths, with its object.
pub(super) struct Bench<'a> {
    analysis: &'a LensAnalysis,
    lens: &'a Lens,
    pub(super) lenses: Vec<MonoLens>,
    pub(super) reference: MonoLens,
    dioptres: f64,
}

impl<'a> Bench<'a> {
    pub(super) fn of(analysis: &'a LensAnalysis, lens: &'a Lens) -> Result<Self, PipelineError> {
        let lenses = analysis.wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<Vec<MonoLens>, _>>()?;
        let reference = lens.at(analysis.reference_nm)?;
        let dioptres = 1e3 / (analysis.distance_mm + reference.projection_center_z_mm());
        Ok(Self { analysis, lens, lenses, reference, dioptres })
    }

    /// The point of a place of the field, the same for all wavelengths.
    pub(super) fn point(&self, place: &FieldPlace) -> ObjectPoint {
        Field::of_place(place).point(&self.reference, self.dioptres)
    }

    /// How far the film is moved to each side through focus, mm: as far as the blur of the cone is eight times the pattern of a perfect
    /// lens, or twice the spot on the axis.
    pub(super) fn focus_reach_mm(&self) -> f64 {
        let f_number = self.analysis.working_f_number.abs();
        let airy_um = 1.22e-3 * self.analysis.reference_nm * f_number;
        let spot_um = self.analysis.focus.axis_rms_um.unwrap_or(0.0);
        match 2e-3 * (4.0 * airy_um).max(2.0 * spot_um) * f_number {
            reach_mm if reach_mm.is_finite() && reach_mm > 0.0 => reach_mm.min(5.0),
            _ => 1.0,
        }
    }

    /// The fields of curves over field.
    fn places(&self) -> Vec<FieldPlace> {
        self.analysis.curves.iter().step_by(EACH).map(|row| row.place).collect()
    }

    fn over_field(&self, title: &str, y_label: &str, series: Vec<Series>) -> LineChart {
        let last = self.analysis.curves.last().map_or(1.0, |row| row.place.field_deg).max(1e-3);
        chart(title, ("field, °", (0.0, last)), y_label, series)
    }

    /// The wavelengths of curves over them: from the shortest to the longest of the analysis, or about the one that it has.
    fn wavelengths_nm(&self) -> Vec<f64> {
        let nm = self.analysis.reference_nm;
        let [first_nm, last_nm] =
            ends_of(&self.analysis.wavelengths_nm).unwrap_or([nm * (1.0 - BESIDE), nm * (1.0 + BESIDE)]);
        (0..=WAVELENGTHS).map(|i| first_nm + (last_nm - first_nm) * i as f64 / WAVELENGTHS as f64).collect()
    }

    /// The root mean square radius of the spot of a field at a wavelength, µm; NaN where no light gets through.
    pub(super) fn rms_um(&self, lens: &MonoLens, place: &FieldPlace, film_mm: f64) -> f64 {
        let light = PupilLight::to_film(lens, &self.point(place), film_mm, PupilRule::of_rings(RINGS));
        light.map_or(f64::NAN, |light| {
            let (_, [xx, yy, _]) = light.moments(lens, film_mm);
            1e3 * (xx + yy).max(0.0).sqrt()
        })
    }

    fn chromatic_focal_shift(&self) -> LineChart {
        let image_mm = |lens: &MonoLens| lens.conjugate(self.analysis.distance_mm).image_z_mm;
        let at_reference_mm = image_mm(&self.reference);
        let shift = |&nm: &f64| Some((nm, image_mm(&self.lens.at(nm).ok()?) - at_reference_mm));
        let wavelengths_nm = self.wavelengths_nm();
        let points: Vec<(f64, f64)> = wavelengths_nm.iter().filter_map(shift).collect();
        let series = vec![line(None, palette::line(0), points)];
        let x = ("wavelength, nm", (wavelengths_nm[0], wavelengths_nm[WAVELENGTHS]));
        chart("Chromatic focal shift (paraxial)", x, "shift of the image, mm", series)
    }

    fn spots_over_field(&self) -> LineChart {
        let places = self.places();
        let film_mm = self.analysis.film_distance_mm;
        let mut series: Vec<Series> = Vec::new();
        for (i, lens) in self.lenses.iter().enumerate() {
            let points = places.par_iter().map(|place| (place.field_deg, self.rms_um(lens, place, film_mm))).collect();
            series.push(line(Some(format!("{:.0} nm", lens.wavelength_nm())), palette::line(i), points));
        }
        self.over_field("RMS spot radius over field", "rms radius, µm", series)
    }

    fn wavefronts_over_field(&self) -> LineChart {
        let film_mm = self.analysis.film_distance_mm;
        let waves = |place: &FieldPlace| {
            let reference = WavefrontReference::Best;
            let found = Wavefront::trace(&self.reference, &self.point(place), film_mm, PupilGrid::STANDARD, reference);
            (place.field_deg, found.map_or(f64::NAN, |wavefront| wavefront.rms_waves()))
        };
        let points: Vec<(f64, f64)> = self.places().par_iter().map(waves).collect();
        let last = points.last().map_or(1.0, |point| point.0);
        // Maréchal's criterion: a Strehl ratio of 0.8.
        let limit = Series {
            is_dashed: true,
            ..line(Some("1/14 wave".to_owned()), "#888888".to_owned(), vec![(0.0, 1.0 / 14.0), (last, 1.0 / 14.0)])
        };
        let label = format!("{:.0} nm", self.analysis.reference_nm);
        let series = vec![limit, line(Some(label), palette::line(0), points)];
        self.over_field("RMS wavefront over field (tilt taken out)", "rms, waves", series)
    }

    fn spots_over_focus(&self) -> LineChart {
        let reach_mm = self.focus_reach_mm();
        let film_mm = self.analysis.film_distance_mm;
        let shifts: Vec<f64> =
            (-FOCUS_STEPS..=FOCUS_STEPS).map(|i| reach_mm * f64::from(i) / f64::from(FOCUS_STEPS)).collect();
        let mut series = Vec::new();
        for (i, row) in self.analysis.fields.iter().enumerate() {
            let at = |&shift: &f64| (shift, self.rms_um(&self.reference, &row.place, film_mm + shift));
            let points = shifts.par_iter().map(at).collect();
            series.push(line(Some(row.place.label()), palette::line(i), points));
        }
        let title = format!("RMS spot radius through focus, {:.0} nm", self.analysis.reference_nm);
        chart(&title, ("film moved from the lens, mm", (-reach_mm, reach_mm)), "rms radius, µm", series)
    }

    fn spots_over_wavelength(&self) -> LineChart {
        let wavelengths_nm = self.wavelengths_nm();
        let lenses: Vec<MonoLens> = wavelengths_nm.iter().filter_map(|&nm| self.lens.at(nm).ok()).collect();
        let film_mm = self.analysis.film_distance_mm;
        let mut series = Vec::new();
        for (i, row) in self.analysis.fields.iter().enumerate() {
            let at = |lens: &MonoLens| (lens.wavelength_nm(), self.rms_um(lens, &row.place, film_mm));
            let points = lenses.par_iter().map(at).collect();
            series.push(line(Some(row.place.label()), palette::line(i), points));
        }
        let x = ("wavelength, nm", (wavelengths_nm[0], wavelengths_nm[WAVELENGTHS]));
        chart("RMS spot radius over wavelength", x, "rms radius, µm", series)
    }

    /// The heights of the marginal over those of the chief ray at each surface and at the image, to first order (Delano's diagram); `None` of
    /// lenses without third-order sums.
    fn y_ybar(&self) -> Option<LineChart> {
        let widest_deg = self.analysis.fields.iter().map(|row| row.place.field_deg).fold(0.0, f64::max);
        let field_deg = if widest_deg > 0.0 { widest_deg.min(WIDEST_CHIEF_DEG) } else { 1.0 };
        let nm = self.analysis.reference_nm;
        let settings = SeidelSettings {
            wavelength_nm: nm,
            colors_nm: [nm; 2],
            object_distance_mm: self.analysis.distance_mm,
            chief_slope: field_deg.to_radians().tan(),
        };
        let heights_mm = self.lens.seidel(&settings).ok()?.heights_mm;
        let points: Vec<(f64, f64)> = heights_mm.iter().map(|&[marginal, chief]| (chief, marginal)).collect();
        if !points.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            return None;
        }
        let (low, high) =
            points.iter().fold((0.0_f64, 0.0_f64), |ends, point| (ends.0.min(point.0), ends.1.max(point.0)));
        let room = 0.05 * (high - low).max(1e-9);
        let title = format!("y–ȳ diagram, chief ray of {field_deg:.1}°");
        let x = ("chief ray, mm", (low - room, high + room));
        Some(chart(&title, x, "marginal ray, mm", vec![line(None, palette::line(0), points)]))
    }

    /// The area of the pupil that each field sees, over that of the axis: rims and obscurations, and how the pupil is foreshortened.
    fn vignetting(&self) -> LineChart {
        let area_mm2 = |place: &FieldPlace| {
            let point = Field::of_place(place).point(&self.reference, self.dioptres);
            self.reference.over_clear_pupil(&|lens: &MonoLens| {
                PupilRegion::find(lens, &point, AZIMUTHS).map_or(0.0, |region| region.area_mm2())
            })
        };
        let places = self.places();
        let areas: Vec<f64> = places.par_iter().map(area_mm2).collect();
        let axis = areas.first().copied().filter(|area| *area > 0.0).unwrap_or(f64::NAN);
        let points = places.iter().zip(&areas).map(|(place, area)| (place.field_deg, area / axis)).collect();
        let light =
            self.analysis.curves.iter().filter_map(|row| Some((row.place.field_deg, row.relative_illumination?)));
        let series = vec![
            line(Some("area of the pupil".to_owned()), palette::line(0), points),
            line(Some("illumination".to_owned()), palette::line(1), light.collect()),
        ];
        self.over_field("Vignetting and illumination over field", "share of the axis", series)
    }
}

fn line(label: Option<String>, color: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series { label, color: color.into(), points, is_dashed: false }
}

fn chart(title: &str, (x_label, x_range): (&str, (f64, f64)), y_label: &str, series: Vec<Series>) -> LineChart {
    let values = || series.iter().flat_map(|line| &line.points).map(|point| point.1).filter(|y| y.is_finite());
    let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let margin = 0.05 * (high - low).max(1e-9);
    LineChart {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x_range,
        y_range: (if low < 0.0 { low - margin } else { 0.0 }, high + margin),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

/// Returns the shortest and the longest of several wavelengths, nm: those between which color is counted.
pub fn ends_of(wavelengths_nm: &[f64]) -> Option<[f64; 2]> {
    let ends = |[first, last]: [f64; 2], nm: &f64| [first.min(*nm), last.max(*nm)];
    let [first_nm, last_nm] = wavelengths_nm.iter().fold([f64::INFINITY, 0.0], ends);
    (first_nm < last_nm).then_some([first_nm, last_nm])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    #[test]
    fn curves_have_the_numbers_of_the_tables() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
            wavelengths_nm: vec![450.0, 550.0, 650.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::BestFocus,
            n_rings: RINGS,
        };
        let analysis = request.compute(&lens).unwrap();
        let curves = analysis.lens_curves(&lens).unwrap().0;
        let of = |name: &str| &curves.iter().find(|(other, _)| *other == name).unwrap().1.series;
        let last = |series: &Series| series.points.last().unwrap().1;
        // Of the last wavelength and field, in the order of the analysis.
        let spot = &analysis.spots[5];
        assert!((last(&of("rms_over_field")[2]) - spot.rms_um.unwrap()).abs() < 1e-9);
        assert!((last(&of("rms_over_wavelength")[1]) - spot.rms_um.unwrap()).abs() < 1e-9);
        assert!((last(&of("chromatic_focal_shift")[0]) - analysis.axial_color[2].paraxial_shift_mm).abs() < 1e-12);
        let wavefront = analysis.spots[4].wavefront.as_ref().unwrap();
        assert!((last(&of("wavefront_over_field")[1]) - wavefront.rms_waves).abs() < 1e-9);
        let middle = &of("rms_over_focus")[0].points[FOCUS_STEPS as usize];
        assert!(middle.0.abs() < 1e-12 && (middle.1 - analysis.spots[1].rms_um.unwrap()).abs() < 1e-9);
        let vignetting = of("vignetting");
        assert!((vignetting[0].points[0].1 - 1.0).abs() < 1e-12 && last(&vignetting[0]) < 0.95);
    }
}
