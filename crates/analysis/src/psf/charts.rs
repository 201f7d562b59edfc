//! Plots of point-spread functions: line and edge spread, modulation, enclosed energy, modulation through focus.

use std::f64::consts::FRAC_PI_2;

use dioptric_pipeline::number;
use dioptric_psf::{EnclosedEnergy, Picture, Profile};

use super::windowed::Windowed;
use crate::{Corner, LineChart, PsfRow, PsfSet, Scale, Series, ThroughFocus, palette};

/// Point-spread functions that a plot tells apart.
const MOST_LINES: usize = palette::LINES.len();
/// Steps along the axis of a plot.
const STEPS: i32 = 60;

/// A plotted point-spread function.
struct Plotted<'a> {
    row: &'a PsfRow,
    picture: Picture,
    whole: Windowed,
}

impl PsfSet {
    /// Returns plots by name: `lsf`, `esf`, `mtf`, `encircled_energy`, `ensquared_energy` and `through_focus` (where it is known) of at
    /// most nine point-spread functions, where there are more of a middle wavelength and evenly chosen; with several
    /// wavelengths also `polychromatic_mtf`, the modulation of the light of all wavelengths of each point.
    ///
    /// Tangential lines (along the radius of the field) are solid, sagittal ones dashed. Where the set has several wavelengths, `mtf` also shows that of the
    /// polychromatic light of the first field and distance.
    pub fn charts(&self, through_focus: &ThroughFocus) -> Vec<(String, LineChart)> {
        let plotted: Vec<Plotted<'_>> = self
            .plotted()
            .into_iter()
            .map(|i| Plotted {
                row: &self.rows[i],
                picture: Picture::new(self.pictures[i].view(), self.pixel_um),
                whole: Windowed::new(self.pictures[i].view(), self.pixel_um),
            })
            .collect();
        let reach_per_mm = self.reach_per_mm(&plotted);
        let mut charts = vec![
            ("lsf", self.spreads("Line spread", "energy per µm", &plotted, Picture::line_spread)),
            ("esf", self.spreads("Edge spread", "energy up to there", &plotted, Picture::edge_spread)),
            ("mtf", self.modulation(&plotted, reach_per_mm)),
            ("encircled_energy", self.enclosed(&plotted, ("Encircled energy", "radius, µm"), Picture::encircled)),
            (
                "ensquared_energy",
                self.enclosed(&plotted, ("Ensquared energy", "half the side, µm"), Picture::ensquared),
            ),
        ];
        if !through_focus.rows.is_empty() {
            charts.push(("through_focus", self.through_focus(through_focus)));
        }
        if self.spectral_weights.len() > 1 {
            charts.push(("polychromatic_mtf", self.polychromatic_modulations(reach_per_mm)));
        }
        charts.into_iter().map(|(name, chart)| (name.to_owned(), chart)).collect()
    }

    /// Returns the rows that plots show: all of them; where these are too many, those of the middle wavelength; where
    /// these are, some of them, evenly chosen.
    pub(crate) fn plotted(&self) -> Vec<usize> {
        if self.rows.len() <= MOST_LINES {
            return (0..self.rows.len()).collect();
        }
        let n_colors = self.spectral_weights.len();
        evenly((0..self.rows.len()).skip(n_colors / 2).step_by(n_colors).collect())
    }

    fn spreads(
        &self,
        title: &str,
        y_label: &str,
        plotted: &[Plotted<'_>],
        of: impl Fn(&Picture, f64) -> Profile,
    ) -> LineChart {
        let reach_um = plotted.iter().map(|p| p.picture.energy_radius_um(0.95)).fold(0.0, f64::max) * 1.3;
        let lines = self.lines(plotted, |Plotted { picture, .. }, direction| {
            let profile = of(picture, direction);
            profile.at_um.into_iter().zip(profile.values).filter(|(x, _)| x.abs() <= reach_um).collect()
        });
        let chart = chart(title, ("place, µm", (-reach_um, reach_um)), (y_label, None), lines);
        // An edge spread ends high.
        let legend = if title.starts_with("Edge") { Corner::TopLeft } else { Corner::TopRight };
        LineChart { legend, ..chart }
    }

    /// Returns up to which frequency plots of modulations go, cycles per mm: where the sharpest has lost its own, at
    /// most where pixels end.
    fn reach_per_mm(&self, plotted: &[Plotted<'_>]) -> f64 {
        // A pixel's own modulation has its first zero at one cycle a pixel; light's may end before.
        let last_per_mm = 0.5e3 / self.pixel_um;
        let lost = |p: &Plotted<'_>| {
            let is_lost = |i: &i32| p.picture.mtf(0.0, last_per_mm * f64::from(*i) / f64::from(STEPS)) < 0.03;
            (1..STEPS).find(is_lost).unwrap_or(STEPS)
        };
        let reach = plotted.iter().map(lost).max().unwrap_or(STEPS);
        // The lines of others may go on a little.
        (1.3 * last_per_mm * f64::from(reach) / f64::from(STEPS)).min(last_per_mm)
    }

    fn modulation(&self, plotted: &[Plotted<'_>], reach_per_mm: f64) -> LineChart {
        let mut lines = self.lines(plotted, |p, direction| match &p.row.curves {
            Some(curves) => {
                let which = usize::from(direction != p.row.meridian_rad());
                curves.modulation.iter().filter(|at| at.0 <= reach_per_mm).map(|(f, m, _)| (*f, m[which])).collect()
            }
            None => steps(reach_per_mm).map(|f| (f, p.whole.modulation(direction, f))).collect(),
        });
        if let Some(curves) = plotted.iter().find_map(|p| p.row.curves.as_ref()) {
            let within = curves.modulation.iter().filter(|at| at.0 <= reach_per_mm);
            let points = within.map(|(f, _, limit)| (*f, limit[0])).collect();
            let label = Some("diffraction limit".to_owned());
            lines.push(Series { label, color: "#888888".to_owned(), points, is_dashed: false });
        }
        if let Some(first) = self.points().next().filter(|point| point.len() > 1) {
            let start = first.start;
            let words = self.point_words(&self.rows[start]);
            let name = [words, vec!["polychromatic".to_owned()]].concat().join(", ");
            let whole = self.polychromatic_modulation(first);
            let meridian = self.rows[start].meridian_rad();
            for (direction, is_dashed) in [(meridian, false), (meridian + FRAC_PI_2, true)] {
                let points = steps(reach_per_mm).map(|f| (f, whole(direction, f))).collect();
                let label = (!is_dashed).then(|| name.clone());
                lines.push(Series { label, color: "#000000".to_owned(), points, is_dashed });
            }
        }
        chart(
            "Modulation (tangential solid, sagittal dashed)",
            ("cycles per mm", (0.0, reach_per_mm)),
            ("modulation", Some((0.0, 1.0))),
            lines,
        )
    }

    fn polychromatic_modulations(&self, reach_per_mm: f64) -> LineChart {
        let points = evenly(self.points().collect());
        let lines = points.into_iter().enumerate().flat_map(|(i, point)| {
            let row = &self.rows[point.start];
            let whole = self.polychromatic_modulation(point);
            let meridian = row.meridian_rad();
            [(meridian, false), (meridian + FRAC_PI_2, true)].map(|(direction, is_dashed)| Series {
                label: (!is_dashed).then(|| self.point_label(row)),
                color: palette::line(i),
                points: steps(reach_per_mm).map(|f| (f, whole(direction, f))).collect(),
                is_dashed,
            })
        });
        let title = "Modulation of all wavelengths together (tangential solid, sagittal dashed)";
        chart(title, ("cycles per mm", (0.0, reach_per_mm)), ("modulation", Some((0.0, 1.0))), lines.collect())
    }

    fn enclosed(
        &self,
        plotted: &[Plotted<'_>],
        (title, x_label): (&str, &str),
        of: impl Fn(&Picture) -> EnclosedEnergy,
    ) -> LineChart {
        let is_round = title.starts_with("Encircled");
        let energies: Vec<EnclosedEnergy> = plotted.iter().map(|p| of(&p.picture)).collect();
        let reach_um = energies.iter().map(|energy| energy.reach_um(0.98)).fold(0.0, f64::max) * 1.2;
        let lines = energies.iter().zip(plotted).enumerate().map(|(i, (energy, p))| Series {
            label: Some(self.label(p.row)),
            color: palette::line(i),
            points: match p.row.curves.as_ref().filter(|_| is_round) {
                Some(curves) => curves.encircled.iter().copied().filter(|(radius, _)| *radius <= reach_um).collect(),
                None => steps(reach_um).map(|reach| (reach, energy.within(reach))).collect(),
            },
            is_dashed: false,
        });
        let is_of_waves = is_round && plotted.iter().all(|p| p.row.curves.is_some());
        let y = (if is_of_waves { "share of all light" } else { "share of the picture" }, Some((0.0, 1.0)));
        LineChart { legend: Corner::BottomRight, ..chart(title, (x_label, (0.0, reach_um)), y, lines.collect()) }
    }

    fn through_focus(&self, found: &ThroughFocus) -> LineChart {
        let lines = found.rows.iter().zip(&found.modulations).enumerate();
        let series = lines.flat_map(|(i, (row, modulations))| {
            let line = |is_dashed: bool| {
                let values = modulations.iter().map(|(along, across)| if is_dashed { *across } else { *along });
                let points = found.shifts_mm.iter().copied().zip(values).collect();
                Series {
                    label: (!is_dashed).then(|| self.label(&self.rows[*row])),
                    color: palette::line(i),
                    points,
                    is_dashed,
                }
            };
            [line(false), line(true)]
        });
        let per_mm = number(found.cycles_per_mm);
        let title = format!("Modulation through focus at {per_mm} cycles per mm (tangential solid, sagittal dashed)");
        let extent_mm = found.shifts_mm.last().copied().unwrap_or(1.0);
        let x = ("film moved from the lens, mm", (-extent_mm, extent_mm));
        chart(&title, x, ("modulation", Some((0.0, 1.0))), series.collect())
    }

    /// Returns two lines for each picture: along the radius of the field, and dashed across it.
    fn lines(&self, plotted: &[Plotted<'_>], of: impl Fn(&Plotted<'_>, f64) -> Vec<(f64, f64)>) -> Vec<Series> {
        let both = plotted.iter().enumerate().flat_map(|(i, plotted)| {
            let row = plotted.row;
            let line = |direction: f64, is_dashed: bool| Series {
                label: (!is_dashed).then(|| self.label(row)),
                color: palette::line(i),
                points: of(plotted, direction),
                is_dashed,
            };
            let meridian = row.meridian_rad();
            [line(meridian, false), line(meridian + FRAC_PI_2, true)]
        });
        both.collect()
    }

    /// Returns what tells a point-spread function from the others.
    fn label(&self, row: &PsfRow) -> String {
        let point = self.point_words(row);
        let nm = format!("{} nm", number(row.wavelength_nm));
        match self.rows.iter().any(|other| other.wavelength_nm != row.wavelength_nm) || point.is_empty() {
            true => [point, vec![nm]].concat().join(", "),
            false => point.join(", "),
        }
    }

    /// Returns what tells a point from the others.
    fn point_label(&self, row: &PsfRow) -> String {
        match self.point_words(row) {
            words if words.is_empty() => "polychromatic".to_owned(),
            words => words.join(", "),
        }
    }

    fn point_words(&self, row: &PsfRow) -> Vec<String> {
        let differs = |of: fn(&PsfRow) -> f64| self.rows.iter().any(|other| of(other) != of(row));
        let mut words = vec![];
        if differs(|r| r.field_deg) {
            words.push(format!("{}°", number(row.field_deg)));
        }
        if differs(|r| r.distance_mm) {
            words.push(format!("{} mm", number(row.distance_mm)));
        }
        words
    }
}

/// Returns at most as many as a plot tells apart, evenly chosen from first to last.
fn evenly<T: Clone>(all: Vec<T>) -> Vec<T> {
    match all.len() {
        n if n <= MOST_LINES => all,
        n => (0..MOST_LINES).map(|i| all[i * (n - 1) / (MOST_LINES - 1)].clone()).collect(),
    }
}

fn steps(last: f64) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |i| last * f64::from(i) / f64::from(STEPS))
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
        scale: Scale::Linear,
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;
    use crate::AnalysisFilm;
    use crate::{PsfRequest, PsfSampling};
    use dioptric_psf::Diffraction;

    fn request() -> PsfRequest {
        PsfRequest {
            fields_deg: vec![[0.0, 0.0], [5.0, 0.0]],
            distances_mm: vec![8000.0],
            wavelengths_nm: vec![450.0, 600.0],
            film: AnalysisFilm::FilmMm(51.8145),
            focus_nm: Vec::new(),
            main_nm: None,
            diffraction: Diffraction::Hurb { gamma: 1.0 },
            pixel_um: 4.0,
            size: None,
            sampling: PsfSampling::Pupil,
            mtf_per_mm: vec![10.0],
            seed: 1,
            spectral_weights: vec![],
        }
    }

    #[test]
    fn plots_tell_what_they_show() {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(4.0).unwrap();
        let set = request().compute(&lens).unwrap();
        let through = request().through_focus(&lens, &set).unwrap();
        assert_eq!((through.modulations.len(), through.modulations[0].len()), (4, 25));
        // The film at its place has the modulation of the row.
        for (row, modulations) in through.rows.iter().zip(&through.modulations) {
            let (radial, across) = modulations[12];
            let own = set.rows[*row].mtf[0];
            // Pixels of another size, whose own modulation is taken out.
            assert!((radial - own.radial).abs() < 2e-3 && (across - own.sagittal).abs() < 2e-3, "{radial} {own:?}");
        }
        // Red light comes to its focus behind blue: the lens is simple.
        let best = |row: usize| {
            let radial = through.modulations[row].iter().map(|m| m.0);
            radial.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
        };
        assert!(best(0) < best(1), "{} {}", best(0), best(1));
        let plots = set.charts(&through);
        assert_eq!(plots.len(), 7);
        for (name, chart) in &plots {
            let expected = if name == "polychromatic_mtf" { "5°" } else { "5°, 600 nm" };
            assert!(chart.to_csv().contains(expected), "{name}");
            assert!(chart.to_csv().lines().count() > 25, "{name}");
        }
        assert!(plots[2].1.series.iter().any(|s| s.label.as_deref() == Some("0°, polychromatic")));
        let wrong = PsfRequest { spectral_weights: vec![1.0], ..request() };
        assert!(wrong.compute(&lens).is_err());
        assert!(PsfRequest { spectral_weights: vec![-1.0, 2.0], ..request() }.compute(&lens).is_err());
    }

    #[test]
    fn the_polychromatic_spread_is_blurrier_than_its_sharpest_part() {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(4.0).unwrap();
        let set = request().compute(&lens).unwrap();
        let whole = set.polychromatic(&[10.0]);
        assert_eq!(whole.len(), 2);
        for (i, light) in whole.iter().enumerate() {
            let parts = [&set.rows[2 * i], &set.rows[2 * i + 1]];
            let (modulation, sharpest) = (light.row.mtf[0].radial, parts.map(|p| p.mtf[0].radial));
            assert!(modulation > 0.0 && modulation < sharpest[0].max(sharpest[1]));
            // Its moments are those of its picture, in which parts of pixels add up to a quarter of a pixel squared.
            let picture = Picture::new(light.picture.view(), set.pixel_um);
            let second = picture.second_moments_um2();
            assert!((second.xx - light.row.sigma_x_um.powi(2)).abs() < 0.26 * 16.0, "{second:?} {:?}", light.row);
            assert!(picture.centroid_um().length() < 0.5, "{}", picture.centroid_um());
            assert!(light.row.sigma_x_um >= parts.map(|p| p.sigma_x_um).into_iter().fold(f64::MAX, f64::min));
        }
    }

    #[test]
    fn a_set_of_many_shows_a_few_of_all() {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(2.0).unwrap();
        let request = PsfRequest {
            fields_deg: vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
            distances_mm: vec![4000.0, 8000.0],
            wavelengths_nm: vec![450.0, 550.0, 650.0],
            diffraction: Diffraction::None,
            ..request()
        };
        let set = request.compute(&lens).unwrap();
        assert_eq!(set.plotted(), [1, 4, 7, 10, 13, 16]);
    }
}
