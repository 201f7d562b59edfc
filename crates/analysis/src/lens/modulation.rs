//! The modulation that a lens leaves: over frequency, over field and through focus, by waves.

use std::f64::consts::{FRAC_PI_2, PI};

use dioptric_optics::Lens;
use dioptric_psf::Diffraction;

use super::rows::{FieldPlace, LensAnalysis};
use crate::{Corner, LineChart, PsfRequest, PsfSampling, PsfSet, Scale, Series, palette};
use dioptric_pipeline::{FocusSpec, PipelineError, number};

/// Colors of lines, told apart also by those who see few.
/// Steps along the axis of frequencies.
const STEPS: usize = 60;
/// One in so many of the fields of an analysis's curves has a place in the curve over field.
const EACH: usize = 2;
/// Side of a pixel over the wavelength times the f-number: well below half the shortest period that light has.
const PIXEL: f64 = 0.35;
/// Pixels across the largest spot.
const MOST_PIXELS: f64 = 1200.0;
/// Where a modulation counts as lost.
const LOST: f64 = 0.1;

/// Charts of the modulation that a lens leaves of sine waves.
///
/// Tangential lines (waves along the radius of the field) are solid, sagittal ones dashed, as ISO 9334 names them. Over frequency
/// and field all wavelengths count together, by their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct LensModulation {
    /// Over frequency, of each field.
    pub over_frequency: LineChart,
    /// Over field, at three frequencies.
    pub over_field: LineChart,
    /// As the film moves, at the middle one of these and the reference wavelength.
    pub through_focus: LineChart,
}

impl LensAnalysis {
    /// Computes the modulation of the lens that was analyzed at the fields, wavelengths and film of the analysis.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength, or no light gets through on the axis.
    pub fn modulation(&self, lens: &Lens, weights: &[f64]) -> Result<LensModulation, PipelineError> {
        let bench = Bench { analysis: self, lens, weights };
        let fields: Vec<FieldPlace> = self.fields.iter().map(|row| row.place).collect();
        let at_fields = bench.sets(&fields, &self.wavelengths_nm)?;
        let reach_per_mm = bench.reach_per_mm(&at_fields);
        let [low, middle, high] = round_frequencies(reach_per_mm);
        let over_field: Vec<FieldPlace> = self.curves.iter().step_by(EACH).map(|row| row.place).collect();
        let along_field = bench.sets(&over_field, &self.wavelengths_nm)?;
        Ok(LensModulation {
            over_frequency: bench.over_frequency(&fields, &at_fields, reach_per_mm),
            over_field: bench.over_field(&over_field, &along_field, [low, middle, high]),
            through_focus: bench.through_focus(&fields, middle)?,
        })
    }
}

/// A lens and the numbers that it is looked at with.
struct Bench<'a> {
    analysis: &'a LensAnalysis,
    lens: &'a Lens,
    weights: &'a [f64],
}

/// The light of one field: a set of point-spread functions and the rows of it.
struct FieldLight {
    set: usize,
    first_row: usize,
    meridian_rad: f64,
}

/// Point-spread functions of fields: sets, and where each field stands in them.
struct Sets {
    sets: Vec<PsfSet>,
    fields: Vec<FieldLight>,
}

impl Sets {
    /// Returns the tangential and the sagittal modulation of all light of a field, over frequency in cycles per mm.
    fn modulation(&self, field: &FieldLight) -> impl Fn(f64) -> [f64; 2] {
        let set = &self.sets[field.set];
        let whole = set.polychromatic_modulation(field.first_row..field.first_row + set.spectral_weights.len());
        let (meridian_rad, pixel_mm) = (field.meridian_rad, 1e-3 * set.pixel_um);
        move |cycles_per_mm| {
            [meridian_rad, meridian_rad + FRAC_PI_2].map(|direction| {
                let of_pixels = [direction.cos(), direction.sin()].map(|share| {
                    let x = PI * pixel_mm * cycles_per_mm * share;
                    if x == 0.0 { 1.0 } else { x.sin() / x }
                });
                (whole(direction, cycles_per_mm) / (of_pixels[0] * of_pixels[1])).min(1.0)
            })
        }
    }
}

impl Bench<'_> {
    fn request(&self, fields_deg: Vec<f64>, field_y_deg: f64, wavelengths_nm: &[f64]) -> PsfRequest {
        let has_weights = self.weights.len() == wavelengths_nm.len();
        PsfRequest {
            fields_deg,
            field_y_deg,
            distances_mm: vec![self.analysis.distance_mm],
            wavelengths_nm: wavelengths_nm.to_vec(),
            focus: FocusSpec::FilmMm(self.analysis.film_distance_mm),
            diffraction: Diffraction::Wave,
            pixel_um: self.pixel_um(),
            size: None,
            sampling: PsfSampling::Pupil,
            mtf_per_mm: Vec::new(),
            seed: 1,
            spectral_weights: if has_weights { self.weights.to_vec() } else { Vec::new() },
        }
    }

    /// Returns the side of pixels that hold all that light can resolve, or of so many as the largest spot needs.
    fn pixel_um(&self) -> f64 {
        let finest_um = PIXEL * 1e-3 * self.shortest_nm() * self.analysis.working_f_number.abs();
        let radii_um = self.analysis.spots.iter().filter_map(|spot| spot.radius_um);
        let finest_um = if finest_um.is_finite() { finest_um } else { 1.0 };
        finest_um.max(2.0 * radii_um.fold(0.0, f64::max) / MOST_PIXELS)
    }

    fn shortest_nm(&self) -> f64 {
        self.analysis.wavelengths_nm.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Computes the point-spread functions of fields: of a lens with an axis of symmetry all at once.
    fn sets(&self, places: &[FieldPlace], wavelengths_nm: &[f64]) -> Result<Sets, PipelineError> {
        let (mut sets, mut fields) = (Vec::new(), Vec::new());
        if self.lens.is_rotational() {
            let fields_deg = places.iter().map(|place| place.field_deg).collect();
            sets.push(self.request(fields_deg, 0.0, wavelengths_nm).compute(self.lens)?);
            let field = |i: usize| FieldLight { set: 0, first_row: i * wavelengths_nm.len(), meridian_rad: 0.0 };
            fields.extend((0..places.len()).map(field));
        } else {
            for place in places {
                let [x_deg, y_deg] = place.field_xy_deg;
                let [x, y] = [x_deg, y_deg].map(|deg| deg.to_radians().tan());
                // The meridian of a point on the axis is that of the drawing.
                let meridian_rad = if x == 0.0 { FRAC_PI_2 } else { y.atan2(x) };
                fields.push(FieldLight { set: sets.len(), first_row: 0, meridian_rad });
                sets.push(self.request(vec![x_deg], y_deg, wavelengths_nm).compute(self.lens)?);
            }
        }
        Ok(Sets { sets, fields })
    }

    /// Returns a round frequency up to which there is something to see, cycles per mm: where the sharpest field has lost its
    /// modulation, at most where light ends.
    fn reach_per_mm(&self, sets: &Sets) -> f64 {
        let cutoff_per_mm = 1e6 / (self.shortest_nm() * self.analysis.working_f_number.abs());
        let last_per_mm = cutoff_per_mm.min(0.45e3 / self.pixel_um());
        let frequency = |i: usize| last_per_mm * i as f64 / STEPS as f64;
        let lost_at = |field: &FieldLight| {
            let modulation = sets.modulation(field);
            (1..STEPS).find(|&i| modulation(frequency(i)).iter().all(|m| m.is_nan() || *m <= LOST)).unwrap_or(STEPS)
        };
        let lost = sets.fields.iter().map(lost_at).max().unwrap_or(STEPS);
        round_above(frequency(lost))
    }

    fn over_frequency(&self, places: &[FieldPlace], sets: &Sets, reach_per_mm: f64) -> LineChart {
        let mut series = Vec::new();
        for (i, (place, field)) in places.iter().zip(&sets.fields).enumerate() {
            let at = |step: usize| reach_per_mm * step as f64 / STEPS as f64;
            let modulation = sets.modulation(field);
            let values: Vec<[f64; 2]> = (0..=STEPS).map(|step| modulation(at(step))).collect();
            let x: Vec<f64> = (0..=STEPS).map(at).collect();
            series.extend(pair(Some(place.label()), i, &x, &values));
        }
        chart("Modulation over frequency", ("cycles per mm", (0.0, reach_per_mm)), series)
    }

    fn over_field(&self, places: &[FieldPlace], sets: &Sets, frequencies: [f64; 3]) -> LineChart {
        let x: Vec<f64> = places.iter().map(|place| place.field_deg).collect();
        let mut series = Vec::new();
        for (i, per_mm) in frequencies.into_iter().enumerate() {
            let values: Vec<[f64; 2]> = sets.fields.iter().map(|field| sets.modulation(field)(per_mm)).collect();
            series.extend(pair(Some(format!("{} /mm", number(per_mm))), i, &x, &values));
        }
        let last = x.last().copied().unwrap_or(1.0).max(1e-3);
        chart("Modulation over field", ("field, °", (0.0, last)), series)
    }

    fn through_focus(&self, places: &[FieldPlace], per_mm: f64) -> Result<LineChart, PipelineError> {
        let reference_nm = [self.analysis.reference_nm];
        let (mut series, mut reach_mm) = (Vec::new(), 0.0_f64);
        let mut add = |request: &PsfRequest, labels: &[String], first: usize| -> Result<(), PipelineError> {
            let found = request.through_focus(self.lens, &request.compute(self.lens)?)?;
            for (row, modulations) in found.rows.iter().zip(&found.modulations) {
                let values: Vec<[f64; 2]> = modulations.iter().map(|(along, across)| [*along, *across]).collect();
                series.extend(pair(labels.get(*row).cloned(), first + row, &found.shifts_mm, &values));
            }
            reach_mm = found.shifts_mm.last().copied().map_or(reach_mm, |last| reach_mm.max(last));
            Ok(())
        };
        let with = |request: PsfRequest| PsfRequest { mtf_per_mm: vec![per_mm], ..request };
        if self.lens.is_rotational() {
            let fields_deg = places.iter().map(|place| place.field_deg).collect();
            let labels: Vec<String> = places.iter().map(FieldPlace::label).collect();
            add(&with(self.request(fields_deg, 0.0, &reference_nm)), &labels, 0)?;
        } else {
            for (i, place) in places.iter().enumerate() {
                let [x_deg, y_deg] = place.field_xy_deg;
                add(&with(self.request(vec![x_deg], y_deg, &reference_nm)), &[place.label()], i)?;
            }
        }
        let title = format!("Through focus at {} /mm, {:.0} nm", number(per_mm), reference_nm[0]);
        Ok(chart(&title, ("film moved from the lens, mm", (-reach_mm, reach_mm)), series))
    }
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
    use super::*;
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    #[test]
    fn perfect_lens_has_the_modulation_of_its_pupil() {
        let lens = Lens::thin(50.0, 5.0).unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
            wavelengths_nm: vec![500.0],
            main_wavelength_nm: None,
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::FilmMm(50.0),
            n_rings: 6,
        };
        let found = request.compute(&lens).unwrap().modulation(&lens, &[]).unwrap();
        // A round pupil of f/10 leaves 2/π (acos s − s √(1 − s²)) at the share s of 200 cycles per mm.
        let axis = &found.over_frequency.series[..2];
        for line in axis {
            for &(per_mm, modulation) in line.points.iter().filter(|(per_mm, _)| *per_mm <= 200.0) {
                let s: f64 = per_mm / 200.0;
                let expected = 2.0 / PI * (s.acos() - s * (1.0 - s * s).sqrt());
                // The window of a picture cuts off the outermost rings, whose part is estimated.
                assert!((modulation - expected).abs() < 0.006, "{per_mm}: {modulation} {expected}");
            }
        }
        // In focus it is sharpest.
        let focus = &found.through_focus.series[0].points;
        let best = focus.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(best.0.abs() < 1e-12, "{best:?}");
        assert_eq!((found.over_field.series.len(), found.over_frequency.series.len()), (6, 4));
    }

    #[test]
    fn frequencies_are_round_and_within_reach() {
        assert_eq!([97.0, 130.0, 200.0, 8.5].map(round_above), [100.0, 200.0, 200.0, 10.0]);
        assert_eq!(round_frequencies(100.0), [10.0, 20.0, 40.0]);
        assert_eq!(round_frequencies(300.0), [20.0, 40.0, 80.0]);
        assert_eq!(round_frequencies(500.0), [50.0, 100.0, 200.0]);
    }
}
