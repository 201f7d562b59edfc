//! Plots of point-spread functions: line and edge spread, modulation, encircled energy, modulation through focus.

use std::f64::consts::FRAC_PI_2;

use dioptric_optics::Lens;
use dioptric_psf::{Picture, Profile};

use crate::{Corner, FocusChoice, LineChart, PipelineError, PsfRequest, PsfRow, PsfSet, Series};

/// Steps of the film to each side of its place, for the modulation through focus.
const STEPS: i32 = 12;
/// The frequency of the modulation through focus where none is asked for, cycles per mm.
const THROUGH_FOCUS_PER_MM: f64 = 30.0;
/// Point-spread functions that a plot tells apart.
const MOST_LINES: usize = 12;
/// Colours of lines, told apart also by those who see few.
const COLORS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// The modulation at one frequency as the film moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ThroughFocus {
    /// Spatial frequency, cycles per mm.
    pub cycles_per_mm: f64,
    /// How far the film is moved away from the lens, mm.
    pub shifts_mm: Vec<f64>,
    /// For each point-spread function, in the order of the set, the modulations of waves along the radial direction
    /// and across it.
    pub modulations: Vec<Vec<(f64, f64)>>,
}

impl PsfRequest {
    /// Computes the modulation at the first of the frequencies asked for (or 30 cycles per mm) while the film moves by
    /// so much that the sharpest of the pictures is blurred past it.
    ///
    /// # Errors
    /// Those of [`compute`](Self::compute).
    pub fn through_focus(&self, lens: &Lens, set: &PsfSet) -> Result<ThroughFocus, PipelineError> {
        let cycles_per_mm = self.mtf_per_mm.iter().copied().find(|f| *f > 0.0).unwrap_or(THROUGH_FOCUS_PER_MM);
        let reference = lens.at(crate::REFERENCE_WAVELENGTH_NM)?;
        let first = reference.first_order();
        let f_number = (set.film_mm - first.exit_pupil_z_mm) / first.exit_pupil_diameter_mm;
        // Where the blur is 1.2 periods wide, the modulation of an even disc is at its first zero.
        let reach_mm = match 1.5 * 1.22 * f_number.abs() / cycles_per_mm {
            reach if reach.is_finite() => reach.min(5.0),
            _ => 1.0,
        };
        let shifts_mm: Vec<f64> = (-STEPS..=STEPS).map(|i| reach_mm * f64::from(i) / f64::from(STEPS)).collect();
        let mut modulations = vec![Vec::with_capacity(shifts_mm.len()); set.rows.len()];
        for shift_mm in &shifts_mm {
            let here = Self {
                focus: FocusChoice::FilmMm(set.film_mm + shift_mm),
                mtf_per_mm: vec![cycles_per_mm],
                size: None,
                ..self.clone()
            };
            for (found, row) in modulations.iter_mut().zip(here.compute(lens)?.rows) {
                found.extend(row.mtf.first().map(|mtf| (mtf.radial, mtf.tangential)));
            }
        }
        Ok(ThroughFocus { cycles_per_mm, shifts_mm, modulations })
    }
}

impl PsfSet {
    /// Returns plots by name, as SVG: `lsf`, `esf`, `mtf`, `encircled_energy` and `through_focus`, of at most twelve
    /// point-spread functions.
    ///
    /// Radial lines are solid, those across dashed. Where the set has several wavelengths, `mtf` also shows that of the
    /// whole light of the first field and distance, of these weights (none: all alike).
    ///
    /// # Errors
    /// When there are weights, but not one of 0 or more for each wavelength.
    pub fn plots(&self, through_focus: &ThroughFocus, weights: &[f64]) -> Result<Vec<(String, String)>, PipelineError> {
        let n_colors = self.rows.iter().take_while(|row| is_same_point(row, &self.rows[0])).count();
        let is_list =
            weights.len() == n_colors && weights.iter().all(|w| *w >= 0.0) && weights.iter().sum::<f64>() > 0.0;
        if !weights.is_empty() && !is_list {
            return Err(PipelineError::Value {
                origin: "psf".to_owned(),
                key: "spectral_weights",
                found: format!("{weights:?}"),
                expected: format!("{n_colors} numbers of 0 or more, one a wavelength"),
            });
        }
        let weights = if weights.is_empty() { vec![1.0; n_colors] } else { weights.to_vec() };
        let pictures: Vec<Picture> =
            self.pictures.iter().take(MOST_LINES).map(|p| Picture::new(p.view(), self.pixel_um)).collect();
        let charts = [
            ("lsf", self.spreads("Line spread", "energy per µm", &pictures, Picture::line_spread)),
            ("esf", self.spreads("Edge spread", "energy up to there", &pictures, Picture::edge_spread)),
            ("mtf", self.modulation(&pictures, &weights)),
            ("encircled_energy", self.encircled(&pictures)),
            ("through_focus", self.through_focus(through_focus)),
        ];
        Ok(charts.map(|(name, chart)| (name.to_owned(), chart.to_svg(640.0, 420.0))).into())
    }

    fn spreads(
        &self,
        title: &str,
        y_label: &str,
        pictures: &[Picture],
        of: impl Fn(&Picture, f64) -> Profile,
    ) -> LineChart {
        let reach_um = pictures.iter().map(|p| p.energy_radius_um(0.95)).fold(0.0, f64::max) * 1.3;
        let lines = self.lines(pictures, |picture, direction| {
            let profile = of(picture, direction);
            profile.at_um.into_iter().zip(profile.values).filter(|(x, _)| x.abs() <= reach_um).collect()
        });
        chart(title, ("place, µm", (-reach_um, reach_um)), (y_label, None), lines)
    }

    fn modulation(&self, pictures: &[Picture], weights: &[f64]) -> LineChart {
        // A pixel's own modulation has its first zero at one cycle a pixel; light's may end before.
        let last_per_mm = 0.5e3 / self.pixel_um;
        let sharpest = |p: &Picture| {
            let is_lost = |i: &i32| p.mtf(0.0, last_per_mm * f64::from(*i) / 60.0) < 0.03;
            (1..60).find(is_lost).unwrap_or(60)
        };
        let reach = pictures.iter().map(sharpest).max().map_or(last_per_mm, |i| last_per_mm * f64::from(i) / 60.0);
        let frequencies = || (0..=60).map(|i| reach * f64::from(i) / 60.0);
        let mut lines =
            self.lines(pictures, |picture, direction| frequencies().map(|f| (f, picture.mtf(direction, f))).collect());
        if weights.len() > 1 && weights.len() <= pictures.len() {
            for (direction, is_dashed) in [(0.0, false), (FRAC_PI_2, true)] {
                let points =
                    frequencies().map(|f| (f, self.whole_modulation(pictures, weights, direction, f))).collect();
                let label = (!is_dashed).then(|| "whole light".to_owned());
                lines.push(Series { label, color: "#000000".to_owned(), points, is_dashed });
            }
        }
        chart("Modulation", ("cycles per mm", (0.0, reach)), ("modulation", Some((0.0, 1.0))), lines)
    }

    /// Returns the modulation of the light of all wavelengths, each where its centroid lies.
    fn whole_modulation(&self, pictures: &[Picture], weights: &[f64], direction: f64, cycles_per_mm: f64) -> f64 {
        let (mut real, mut imaginary, mut total) = (0.0, 0.0, 0.0);
        for ((picture, row), weight) in pictures.iter().zip(&self.rows).zip(weights) {
            let place_mm = row.centroid_x_mm * direction.cos() + row.centroid_y_mm * direction.sin();
            let (re, im) = picture.optical_transfer(direction, cycles_per_mm);
            let (s, c) = (std::f64::consts::TAU * cycles_per_mm * place_mm).sin_cos();
            real += weight * (re * c - im * s);
            imaginary += weight * (re * s + im * c);
            total += weight;
        }
        real.hypot(imaginary) / total
    }

    fn encircled(&self, pictures: &[Picture]) -> LineChart {
        let reach_um = pictures.iter().map(|p| p.energy_radius_um(0.98)).fold(0.0, f64::max) * 1.2;
        let lines = self
            .lines(pictures, |picture, direction| {
                // Once: it has no direction.
                let radii = (0..=60).map(|i| reach_um * f64::from(i) / 60.0).filter(|_| direction == 0.0);
                radii.map(|r| (r, picture.encircled_energy(r))).collect()
            })
            .into_iter()
            .filter(|series| !series.points.is_empty())
            .collect();
        chart("Encircled energy", ("radius, µm", (0.0, reach_um)), ("share of the picture", Some((0.0, 1.0))), lines)
    }

    fn through_focus(&self, found: &ThroughFocus) -> LineChart {
        let lines = self.rows.iter().zip(&found.modulations).take(MOST_LINES).enumerate();
        let series = lines.flat_map(|(i, (row, modulations))| {
            let line = |is_dashed: bool| {
                let values = modulations.iter().map(|(radial, across)| if is_dashed { *across } else { *radial });
                let points = found.shifts_mm.iter().copied().zip(values).collect();
                Series { label: (!is_dashed).then(|| self.label(row)), color: color(i), points, is_dashed }
            };
            [line(false), line(true)]
        });
        let title = format!("Modulation through focus at {} cycles per mm", found.cycles_per_mm);
        let reach_mm = found.shifts_mm.last().copied().unwrap_or(1.0);
        let x = ("film moved from the lens, mm", (-reach_mm, reach_mm));
        chart(&title, x, ("modulation", Some((0.0, 1.0))), series.collect())
    }

    /// Returns two lines for each picture: along the radial direction, and dashed across it.
    fn lines(&self, pictures: &[Picture], of: impl Fn(&Picture, f64) -> Vec<(f64, f64)>) -> Vec<Series> {
        let both = pictures.iter().zip(&self.rows).enumerate().flat_map(|(i, (picture, row))| {
            let line = |direction: f64, is_dashed: bool| Series {
                label: (!is_dashed).then(|| self.label(row)),
                color: color(i),
                points: of(picture, direction),
                is_dashed,
            };
            [line(0.0, false), line(FRAC_PI_2, true)]
        });
        both.collect()
    }

    /// Returns what tells a point-spread function from the others.
    fn label(&self, row: &PsfRow) -> String {
        let differs = |of: fn(&PsfRow) -> f64| self.rows.iter().any(|other| of(other) != of(row));
        let mut words = vec![];
        if differs(|r| r.field_deg) {
            words.push(format!("{}°", row.field_deg));
        }
        if differs(|r| r.distance_mm) {
            words.push(format!("{} mm", row.distance_mm));
        }
        if differs(|r| r.wavelength_nm) || words.is_empty() {
            words.push(format!("{} nm", row.wavelength_nm));
        }
        words.join(", ")
    }
}

fn is_same_point(a: &PsfRow, b: &PsfRow) -> bool {
    a.field_deg == b.field_deg && a.distance_mm == b.distance_mm
}

fn color(i: usize) -> String {
    COLORS[i % COLORS.len()].to_owned()
}

fn chart(
    title: &str,
    (x_label, x_range): (&str, (f64, f64)),
    (y_label, y_range): (&str, Option<(f64, f64)>),
    series: Vec<Series>,
) -> LineChart {
    let highest = series.iter().flat_map(|s| &s.points).map(|(_, y)| *y).fold(0.0, f64::max);
    LineChart {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x_range,
        y_range: y_range.unwrap_or((0.0, 1.05 * highest.max(1e-9))),
        series,
        legend: Corner::TopRight,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DiffractionChoice, PsfSampling};

    #[test]
    fn plots_tell_what_they_show() {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(4.0).unwrap();
        let request = PsfRequest {
            fields_deg: vec![0.0, 5.0],
            distances_mm: vec![8000.0],
            wavelengths_nm: vec![450.0, 600.0],
            focus: FocusChoice::FilmMm(51.8145),
            diffraction: DiffractionChoice::Hurb { gamma: 1.0 },
            pixel_um: 4.0,
            size: None,
            sampling: PsfSampling::Pupil,
            mtf_per_mm: vec![10.0],
            seed: 1,
        };
        let set = request.compute(&lens).unwrap();
        let through = request.through_focus(&lens, &set).unwrap();
        assert_eq!((through.modulations.len(), through.modulations[0].len()), (4, 2 * STEPS as usize + 1));
        // Red light comes to its focus behind blue: the lens is simple.
        let best = |row: usize| {
            let radial = through.modulations[row].iter().map(|m| m.0);
            radial.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
        };
        assert!(best(0) < best(1), "{} {}", best(0), best(1));
        let plots = set.plots(&through, &[]).unwrap();
        assert_eq!(plots.len(), 5);
        for (name, svg) in &plots {
            assert!(svg.contains("5°, 600 nm"), "{name}");
        }
        assert!(plots[2].1.contains("whole light"));
        assert!(set.plots(&through, &[1.0]).is_err() && set.plots(&through, &[-1.0, 2.0]).is_err());
        // The whole light of an axial point is blurrier than its sharpest part.
        let pictures: Vec<Picture> = set.pictures.iter().map(|p| Picture::new(p.view(), 4.0)).collect();
        let whole = set.whole_modulation(&pictures[..2], &[1.0, 1.0], 0.0, 10.0);
        let parts = [0, 1].map(|i| pictures[i].mtf(0.0, 10.0));
        assert!(whole < parts[0].max(parts[1]) && whole > 0.0);
    }
}
