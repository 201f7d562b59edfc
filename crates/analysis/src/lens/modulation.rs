//! The modulation that a lens leaves: over frequency, over field and through focus, by waves.

use std::f64::consts::{FRAC_PI_2, TAU};

use dioptric_diffraction::{TransferFunction, TransferQuality};
use dioptric_optics::{
    Lens, MonoLens,
    analysis::{PupilLight, PupilRule},
    glam::DVec2,
};
use rayon::prelude::*;

use super::afocal::AfocalView;
use super::{
    request::Field,
    rows::{FieldPlace, LensAnalysis},
};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::{PipelineError, number};

/// Steps along the axis of frequencies.
const STEPS: usize = 60;
/// One in so many of the fields of an analysis's curves has a place in the curve over field.
const EACH: usize = 2;
/// Steps of the film to each side of its place.
const FOCUS_STEPS: i32 = 10;
/// Rings of rays of a geometric modulation: so many, and more for each period that the blur reaches from its middle.
const FEWEST_RINGS: usize = 12;
const RINGS_A_TURN: f64 = 2.0;
const MOST_RINGS: usize = 120;
/// Where a modulation counts as lost.
const LOST: f64 = 0.1;
/// The color of the diffraction limit.
const LIMIT_COLOR: &str = "#888888";

/// Charts of the modulation that a lens leaves of sine waves, free of pixels and windows.
///
/// Tangential lines (waves along the radius of the field) are solid, sagittal ones dashed, as ISO 9334 names them. Over frequency
/// and field all wavelengths count together, by their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct LensModulation {
    /// Over frequency, of each field; and of a lens without aberrations with the pupil of the first, at the reference wavelength.
    pub over_frequency: LineChart,
    /// The same by rays alone, as if light had no wavelength.
    pub geometric: LineChart,
    /// Over field, at three frequencies.
    pub over_field: LineChart,
    /// As the film moves, at the middle one of these and the reference wavelength.
    pub through_focus: LineChart,
}

impl LensModulation {
    /// Returns the charts, each with the name of its file.
    pub fn charts(&self) -> [(&'static str, &LineChart); 4] {
        [
            ("mtf", &self.over_frequency),
            ("mtf_geometric", &self.geometric),
            ("mtf_over_field", &self.over_field),
            ("mtf_through_focus", &self.through_focus),
        ]
    }
}

impl LensAnalysis {
    /// Computes the modulation of the lens that was analyzed at the fields, wavelengths and film of the analysis.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength, or no field sends waves to the film that can be summed.
    pub fn modulation(&self, lens: &Lens) -> Result<LensModulation, PipelineError> {
        let lenses = self.wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<Vec<MonoLens>, _>>()?;
        let weights = match self.wavelength_weights.len() == lenses.len() {
            true => self.wavelength_weights.clone(),
            false => vec![1.0; lenses.len()],
        };
        let reference = lens.at(self.reference_nm)?;
        let dioptres = 1e3 / (self.distance_mm + reference.projection_center_z_mm());
        let bench = Bench { analysis: self, lenses, weights, reference, dioptres };
        let fields: Vec<FieldPlace> = self.fields.iter().map(|row| row.place).collect();
        let at_fields: Vec<FieldLight> = fields.par_iter().map(|place| bench.light(place)).collect();
        if at_fields.iter().all(|light| light.parts.is_empty()) {
            return Err(PipelineError::Value {
                origin: "the analysis".to_owned(),
                key: "fields_deg",
                found: "no field whose waves can be summed".to_owned(),
                expected: "light that reaches the film within 88° of the axis".to_owned(),
            });
        }
        let reach_per_mm = reach_per_mm(&at_fields);
        let frequencies = round_frequencies(reach_per_mm);
        let charts = [
            bench.over_frequency(&fields, &at_fields, reach_per_mm),
            bench.geometric(&fields, &at_fields, reach_per_mm),
            bench.over_field(frequencies),
            bench.through_focus(&fields, frequencies[1]),
        ];
        let [over_frequency, geometric, over_field, through_focus] =
            if self.afocal.is_some() { charts.map(AfocalView::chart_in_angles) } else { charts };
        Ok(LensModulation { over_frequency, geometric, over_field, through_focus })
    }
}

/// A lens and the numbers that it is looked at with.
struct Bench<'a> {
    analysis: &'a LensAnalysis,
    lenses: Vec<MonoLens>,
    weights: Vec<f64>,
    reference: MonoLens,
    dioptres: f64,
}

/// The light of one field: a transfer function each of its wavelengths, with its share.
struct FieldLight {
    parts: Vec<(TransferFunction, f64)>,
    centroid_mm: DVec2,
    /// The diffraction limit at the reference wavelength.
    limit: Option<TransferFunction>,
    /// The direction of the field's meridian on the film, from +x.
    meridian_rad: f64,
}

impl FieldLight {
    /// Returns the tangential and the sagittal modulation of all light, at a frequency in cycles per mm; no numbers where there is no
    /// light.
    fn modulation(&self, cycles_per_mm: f64) -> [f64; 2] {
        if self.parts.is_empty() {
            return [f64::NAN; 2];
        }
        self.directions().map(|direction| {
            let f = DVec2::from_angle(direction) * cycles_per_mm;
            let part = |(transfer, share): &(TransferFunction, f64)| {
                let aside = DVec2::from_angle(-TAU * f.dot(transfer.centroid_mm() - self.centroid_mm));
                *share * aside.rotate(transfer.at(f))
            };
            self.parts.iter().map(part).sum::<DVec2>().length()
        })
    }

    fn directions(&self) -> [f64; 2] {
        [self.meridian_rad, self.meridian_rad + FRAC_PI_2]
    }
}

impl Bench<'_> {
    /// Returns the light of a field at all wavelengths.
    fn light(&self, place: &FieldPlace) -> FieldLight {
        let field = Field::of_place(place);
        let point = field.point(&self.reference, self.dioptres);
        let film_mm = self.analysis.film_distance_mm;
        let mut limit = None;
        let traced = self.lenses.iter().zip(&self.weights).filter_map(|(lens, weight)| {
            let (transfer, of_pupil) = TransferFunction::trace(lens, &point, film_mm, TransferQuality::Quick).ok()?;
            if lens.wavelength_nm() == self.reference.wavelength_nm() {
                limit = Some(of_pupil);
            }
            Some((transfer, *weight))
        });
        let mut parts: Vec<(TransferFunction, f64)> = traced.collect();
        let total: f64 = parts.iter().map(|(_, weight)| weight).sum();
        parts.iter_mut().for_each(|(_, share)| *share /= total);
        let centroid_mm = parts.iter().map(|(transfer, share)| *share * transfer.centroid_mm()).sum();
        FieldLight { parts, centroid_mm, limit, meridian_rad: field.direction.to_angle() }
    }

    fn over_frequency(&self, places: &[FieldPlace], lights: &[FieldLight], reach_per_mm: f64) -> LineChart {
        let of_light = |light: &FieldLight| frequencies(reach_per_mm).map(|f| light.modulation(f)).collect();
        let values = lights.iter().map(of_light).collect();
        self.of_fields("Modulation over frequency", (places, lights), reach_per_mm, values)
    }

    /// Returns the modulation of the rays of each field, all wavelengths together.
    fn geometric(&self, places: &[FieldPlace], lights: &[FieldLight], reach_per_mm: f64) -> LineChart {
        let of_field = |(place, light): (&FieldPlace, &FieldLight)| {
            let rays = self.rays(place, reach_per_mm);
            let total: f64 = rays.iter().map(|(_, share)| share).sum();
            let of_direction = |direction: f64| {
                let step_per_mm = DVec2::from_angle(direction) * (reach_per_mm / STEPS as f64);
                let turn = |(at_mm, share): &(DVec2, f64)| {
                    (DVec2::new(*share, 0.0), DVec2::from_angle(TAU * step_per_mm.dot(*at_mm)))
                };
                let mut waves: Vec<(DVec2, DVec2)> = rays.iter().map(turn).collect();
                let at_step = |_| {
                    let sum: DVec2 = waves.iter().map(|(wave, _)| *wave).sum();
                    waves.iter_mut().for_each(|(wave, turn)| *wave = turn.rotate(*wave));
                    sum.length() / total
                };
                (0..=STEPS).map(at_step).collect::<Vec<f64>>()
            };
            let [tangential, sagittal] = light.directions().map(of_direction);
            tangential.into_iter().zip(sagittal).map(|(t, s)| [t, s]).collect()
        };
        let values = places.par_iter().zip(lights).map(of_field).collect();
        self.of_fields("Geometric modulation, by rays alone", (places, lights), reach_per_mm, values)
    }

    /// Returns where the rays of a field land at all wavelengths, mm, and their shares: as many as resolve their waves.
    fn rays(&self, place: &FieldPlace, reach_per_mm: f64) -> Vec<(DVec2, f64)> {
        let film_mm = self.analysis.film_distance_mm;
        let point = Field::of_place(place).point(&self.reference, self.dioptres);
        let of_lens = |(lens, weight): (&MonoLens, &f64)| {
            let traced = |n_rings| PupilLight::to_film(lens, &point, film_mm, PupilRule::of_rings(n_rings));
            let few = traced(FEWEST_RINGS)?;
            let (centroid_mm, _) = few.moments(lens, film_mm);
            let reach_mm = few.on_film(lens, film_mm).map(|(at_mm, _)| at_mm.distance(centroid_mm)).fold(0.0, f64::max);
            let n_rings = FEWEST_RINGS + (RINGS_A_TURN * reach_mm * reach_per_mm).ceil() as usize;
            let light = if n_rings > FEWEST_RINGS { traced(n_rings.min(MOST_RINGS))? } else { few };
            Some(light.on_film(lens, film_mm).map(|(at_mm, share)| (at_mm, share * weight)).collect::<Vec<_>>())
        };
        self.lenses.iter().zip(&self.weights).filter_map(of_lens).flatten().collect()
    }

    /// Returns a chart of the modulations of each field over frequency, and the diffraction limit.
    fn of_fields(
        &self,
        title: &str,
        (places, lights): (&[FieldPlace], &[FieldLight]),
        reach_per_mm: f64,
        values: Vec<Vec<[f64; 2]>>,
    ) -> LineChart {
        let x: Vec<f64> = frequencies(reach_per_mm).collect();
        let mut series = Vec::new();
        if let Some((limit, light)) = lights.iter().find_map(|light| Some((light.limit.as_ref()?, light))) {
            let points = x.iter().map(|&f| (f, limit.modulation(light.meridian_rad, f))).collect();
            let label = format!("diffraction limit at {:.0} nm", self.reference.wavelength_nm());
            series.push(Series { label: Some(label), color: LIMIT_COLOR.to_owned(), points, is_dashed: false });
        }
        for (i, (place, values)) in places.iter().zip(&values).enumerate() {
            series.extend(pair(Some(place.label()), i, &x, values));
        }
        chart(title, ("cycles per mm", (0.0, reach_per_mm)), series)
    }

    fn over_field(&self, frequencies: [f64; 3]) -> LineChart {
        let places: Vec<FieldPlace> = self.analysis.curves.iter().step_by(EACH).map(|row| row.place).collect();
        let x: Vec<f64> = places.iter().map(|place| place.field_deg).collect();
        let at_field = |place: &FieldPlace| {
            let light = self.light(place);
            frequencies.map(|per_mm| light.modulation(per_mm))
        };
        let found: Vec<[[f64; 2]; 3]> = places.par_iter().map(at_field).collect();
        let mut series = Vec::new();
        for (i, per_mm) in frequencies.into_iter().enumerate() {
            let values: Vec<[f64; 2]> = found.iter().map(|at_field| at_field[i]).collect();
            series.extend(pair(Some(format!("{} /mm", number(per_mm))), i, &x, &values));
        }
        let last = x.last().copied().unwrap_or(1.0).max(1e-3);
        chart("Modulation over field", ("field, °", (0.0, last)), series)
    }

    fn through_focus(&self, places: &[FieldPlace], per_mm: f64) -> LineChart {
        // Where the blur is 1.2 periods wide, the modulation of an even disc is at its first zero.
        let reach_mm = match 1.5 * 1.22 * self.analysis.working_f_number.abs() / per_mm {
            reach_mm if reach_mm.is_finite() => reach_mm.min(5.0),
            _ => 1.0,
        };
        let shifts_mm: Vec<f64> =
            (-FOCUS_STEPS..=FOCUS_STEPS).map(|i| reach_mm * f64::from(i) / f64::from(FOCUS_STEPS)).collect();
        let at = |place: &FieldPlace, shift_mm: f64| {
            let field = Field::of_place(place);
            let point = field.point(&self.reference, self.dioptres);
            let film_mm = self.analysis.film_distance_mm + shift_mm;
            match TransferFunction::trace(&self.reference, &point, film_mm, TransferQuality::Quick) {
                Ok((transfer, _)) => {
                    let meridian_rad = field.direction.to_angle();
                    [meridian_rad, meridian_rad + FRAC_PI_2].map(|direction| transfer.modulation(direction, per_mm))
                }
                Err(_) => [f64::NAN; 2],
            }
        };
        let mut series = Vec::new();
        for (i, place) in places.iter().enumerate() {
            let values: Vec<[f64; 2]> = shifts_mm.par_iter().map(|&shift_mm| at(place, shift_mm)).collect();
            series.extend(pair(Some(place.label()), i, &shifts_mm, &values));
        }
        let title = format!("Through focus at {} /mm, {:.0} nm", number(per_mm), self.reference.wavelength_nm());
        chart(&title, ("film moved from the lens, mm", (-reach_mm, reach_mm)), series)
    }
}

/// Returns the frequencies of a chart, cycles per mm.
fn frequencies(reach_per_mm: f64) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |step| reach_per_mm * step as f64 / STEPS as f64)
}

/// Returns a round frequency up to which there is something to see, cycles per mm: where the sharpest field has lost its
/// modulation, at most where light ends.
fn reach_per_mm(lights: &[FieldLight]) -> f64 {
    let cutoffs = lights.iter().flat_map(|light| &light.parts).map(|(transfer, _)| transfer.cutoff_per_mm());
    let last_per_mm = cutoffs.fold(0.0, f64::max);
    // The modulation may be gone long before light ends: look closer from step to step.
    let mut end_per_mm = last_per_mm;
    for _ in 0..3 {
        let frequency = |i: usize| end_per_mm * i as f64 / STEPS as f64;
        let lost_at = |light: &FieldLight| {
            let is_lost = |i: &usize| light.modulation(frequency(*i)).iter().all(|m| m.is_nan() || *m <= LOST);
            (1..STEPS).find(is_lost).unwrap_or(STEPS)
        };
        let lost = lights.iter().map(lost_at).max().unwrap_or(STEPS);
        end_per_mm = frequency(lost);
        if lost > STEPS / 6 {
            break;
        }
    }
    round_above(end_per_mm)
}

/// Returns the solid tangential line and the dashed sagittal one.
fn pair(label: Option<String>, i: usize, x: &[f64], values: &[[f64; 2]]) -> [Series; 2] {
    [0, 1].map(|which| Series {
        label: label.clone().filter(|_| which == 0),
        color: palette::line(i),
        points: x.iter().zip(values).map(|(x, value)| (*x, value[which])).collect(),
        is_dashed: which == 1,
    })
}

fn chart(title: &str, (x_label, x_range): (&str, (f64, f64)), series: Vec<Series>) -> LineChart {
    LineChart {
        title: format!("{title} (tangential solid, sagittal dashed)"),
        x_label: x_label.to_owned(),
        y_label: "modulation".to_owned(),
        x_range,
        y_range: (0.0, 1.0),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

/// Returns the least of 1, 2, 3, 5 and 8 times a power of ten that is not below a number.
fn round_above(value: f64) -> f64 {
    let power = 10_f64.powf(value.max(1e-3).log10().floor());
    [1.0, 2.0, 3.0, 5.0, 8.0].into_iter().map(|m| m * power).find(|round| *round >= value).unwrap_or(10.0 * power)
}

/// Returns three round frequencies, each twice the one before, of which the last is below half of the reach.
fn round_frequencies(reach_per_mm: f64) -> [f64; 3] {
    let power = 10_f64.powf((reach_per_mm / 10.0).log10().floor());
    let low = [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|low| 10.0 * low <= reach_per_mm).unwrap_or(power);
    [low, 2.0 * low, 4.0 * low]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use dioptric_diffraction::airy::bessel_j;

    use super::*;
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    #[test]
    fn perfect_lens_has_the_modulation_of_its_pupil() {
        let lens = Lens::thin(50.0, 5.0).unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
            wavelengths_nm: vec![500.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::FilmMm(50.0),
            n_rings: 6,
        };
        let found = request.compute(&lens).unwrap().modulation(&lens).unwrap();
        // A round pupil of f/10 leaves 2/π (acos s − s √(1 − s²)) at the share s of 200 cycles per mm.
        // The first line is the limit.
        let axis = &found.over_frequency.series[..3];
        for line in axis {
            for &(per_mm, modulation) in line.points.iter().filter(|(per_mm, _)| *per_mm <= 200.0) {
                let s: f64 = per_mm / 200.0;
                let expected = 2.0 / PI * (s.acos() - s * (1.0 - s * s).sqrt());
                // The lattice of a curve; tests of transfer functions hold them to 1e-4.
                assert!((modulation - expected).abs() < 0.002, "{per_mm}: {modulation} {expected}");
            }
        }
        // In focus it is sharpest.
        let focus = &found.through_focus.series[0].points;
        let best = focus.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(best.0.abs() < 1e-12, "{best:?}");
        assert_eq!((found.over_field.series.len(), found.over_frequency.series.len()), (6, 5));
    }

    #[test]
    fn geometric_modulation_of_defocus_is_that_of_an_even_disc() {
        let lens = Lens::thin(50.0, 5.0).unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0]),
            wavelengths_nm: vec![500.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::FilmMm(50.5),
            n_rings: 6,
        };
        let found = request.compute(&lens).unwrap().modulation(&lens).unwrap();
        // Half a millimetre behind the focus of f/10.
        let radius_mm = 0.5 / 20.0;
        for line in &found.geometric.series[1..] {
            for &(per_mm, modulation) in &line.points {
                let x = TAU * per_mm * radius_mm;
                let expected = if x == 0.0 { 1.0 } else { (2.0 * bessel_j(1, x) / x).abs() };
                assert!((modulation - expected).abs() < 1e-9, "{per_mm}: {modulation} {expected}");
            }
        }
        assert_eq!(found.charts()[1].0, "mtf_geometric");
    }

    #[test]
    fn frequencies_are_round_and_within_reach() {
        assert_eq!([97.0, 130.0, 200.0, 8.5].map(round_above), [100.0, 200.0, 200.0, 10.0]);
        assert_eq!(round_frequencies(100.0), [10.0, 20.0, 40.0]);
        assert_eq!(round_frequencies(300.0), [20.0, 40.0, 80.0]);
        assert_eq!(round_frequencies(500.0), [50.0, 100.0, 200.0]);
    }
}
