//! The plots of an analysis.

use dioptric_optics::wavelength_color;

use crate::{panel::Mark, panel::MarkKind, panel::Panel, panel::Sheet};
use dioptric_analysis::{
    AfocalView, FanRow, FieldPlace, FieldRow, FocusSpot, Footprint, LensAnalysis, SpotRow, line_color,
};

/// Margin of a page, and the room for its words above, px.
pub(super) const MARGIN_PX: f64 = 24.0;
pub(super) const HEAD_PX: f64 = 84.0;
/// Size of the plots of a field, and of those over field, px.
const SMALL_PX: [f64; 2] = [268.0, 196.0];
const LARGE_PX: [f64; 2] = [268.0, 300.0];
/// Colors of two lines that are no wavelengths.
const PAIR: [&str; 2] = ["#2166ac", "#b2182b"];

/// The plots of an analysis.
#[derive(Clone, Copy, Debug)]
pub struct AnalysisPlots<'a>(pub &'a LensAnalysis);

impl AnalysisPlots<'_> {
    /// Returns a page of plots as SVG: for each field its spot, ray fans and path differences; over field, curvature,
    /// distortion, lateral color and illumination; and axial color.
    pub fn page_svg(&self) -> String {
        let n_wavelengths = self.0.wavelengths_nm.len().max(1);
        let (spots, fans): (Vec<&[SpotRow]>, Vec<&[FanRow]>) =
            (self.0.spots.chunks(n_wavelengths).collect(), self.0.fans.chunks(n_wavelengths).collect());
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "real-ray analysis");
        let ranges = Ranges::of(self.0);
        for (row, (spots, fans)) in spots.iter().zip(&fans).enumerate() {
            let y = HEAD_PX + SMALL_PX[1] * row as f64;
            let panels = [self.spot_panel(spots)].into_iter().chain(fan_panels(fans, &ranges));
            for (column, panel) in panels.enumerate() {
                let x = MARGIN_PX + SMALL_PX[0] * column as f64;
                sheet.panel(&self.in_units(panel), [x, y, SMALL_PX[0], SMALL_PX[1]]);
            }
        }
        let y = HEAD_PX + SMALL_PX[1] * spots.len() as f64 + 12.0;
        for (column, panel) in self.field_panels().into_iter().enumerate() {
            let x = MARGIN_PX + LARGE_PX[0] * column as f64;
            sheet.panel(&self.in_units(panel), [x, y, LARGE_PX[0], LARGE_PX[1]]);
        }
        sheet.to_svg(2.0 * MARGIN_PX + 5.0 * SMALL_PX[0], y + LARGE_PX[1] + MARGIN_PX)
    }

    /// Returns the spot diagrams as SVG, a row a field and a column a wavelength, each to its own scale and with Airy's ring.
    pub fn spots_svg(&self) -> String {
        const SIDE_PX: [f64; 2] = [250.0, 248.0];
        let n_wavelengths = self.0.wavelengths_nm.len().max(1);
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "spot diagrams");
        for (i, spot) in self.0.spots.iter().enumerate() {
            let place = [(i % n_wavelengths) as f64, (i / n_wavelengths) as f64];
            let mut panel = self.spot_panel(std::slice::from_ref(spot));
            panel.title = format!("{}, {:.0} nm{}", spot.place.label(), spot.wavelength_nm, rms_words(spot));
            let (x, y) = (MARGIN_PX + SIDE_PX[0] * place[0], HEAD_PX + SIDE_PX[1] * place[1]);
            sheet.panel(&self.in_units(panel), [x, y, SIDE_PX[0], SIDE_PX[1]]);
        }
        let rows = self.0.spots.len().div_ceil(n_wavelengths) as f64;
        let width = (2.0 * MARGIN_PX + SIDE_PX[0] * n_wavelengths as f64).max(760.0);
        sheet.to_svg(width, HEAD_PX + SIDE_PX[1] * rows + MARGIN_PX)
    }

    /// Returns the spots as the film goes through focus as SVG, a row a field, all wavelengths together and all to one scale.
    pub fn focus_spots_svg(&self, rows: &[Vec<FocusSpot>]) -> String {
        const SIDE_PX: [f64; 2] = [250.0, 248.0];
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "spots through focus, the film moved from the lens");
        let points = rows.iter().flatten().flat_map(|spot| &spot.points_um).flat_map(|(_, points)| points);
        let range_um = half_range(points.flat_map(|p| [p.0, p.1]));
        for (i, row) in rows.iter().enumerate() {
            for (j, spot) in row.iter().enumerate() {
                let rms = spot.rms_um.map_or("dark".to_owned(), |rms_um| format!("rms {rms_um:.1} µm"));
                let panel = Panel {
                    title: format!("{}, {:+.3} mm, {rms}", spot.place.label(), spot.shift_mm),
                    x_label: "x, µm".to_owned(),
                    y_label: "y, µm".to_owned(),
                    x_range: (-range_um, range_um),
                    y_range: (-range_um, range_um),
                    is_to_scale: true,
                    marks: dots(spot.points_um.iter().map(|(nm, points)| (*nm, points))),
                };
                let (x, y) = (MARGIN_PX + SIDE_PX[0] * j as f64, HEAD_PX + SIDE_PX[1] * i as f64);
                sheet.panel(&self.in_units(panel), [x, y, SIDE_PX[0], SIDE_PX[1]]);
            }
        }
        let n_columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = (2.0 * MARGIN_PX + SIDE_PX[0] * n_columns as f64).max(760.0);
        sheet.to_svg(width, HEAD_PX + SIDE_PX[1] * rows.len() as f64 + MARGIN_PX)
    }

    /// Returns the footprints of the fields on the surfaces as SVG, with the rims: a plot a surface, each to its own scale.
    pub fn footprints_svg(&self, footprints: &[Footprint]) -> String {
        const SIDE_PX: [f64; 2] = [250.0, 248.0];
        const COLUMNS: usize = 5;
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "footprints at the reference wavelength");
        let mut x = MARGIN_PX;
        for (i, row) in self.0.fields.iter().enumerate() {
            let label = row.place.label();
            sheet.text((x, HEAD_PX + 6.0), 12.5, (&line_color(i), "bold"), &format!("— {label}"));
            x += 34.0 + 8.2 * label.chars().count() as f64;
        }
        let top = HEAD_PX + 20.0;
        for (i, footprint) in footprints.iter().enumerate() {
            let place = [(i % COLUMNS) as f64, (i / COLUMNS) as f64];
            let rectangle = [MARGIN_PX + SIDE_PX[0] * place[0], top + SIDE_PX[1] * place[1], SIDE_PX[0], SIDE_PX[1]];
            sheet.panel(&self.footprint_panel(footprint), rectangle);
        }
        let rows = footprints.len().div_ceil(COLUMNS) as f64;
        let width = (2.0 * MARGIN_PX + SIDE_PX[0] * COLUMNS.min(footprints.len()) as f64).max(760.0);
        sheet.to_svg(width, top + SIDE_PX[1] * rows + MARGIN_PX)
    }

    fn footprint_panel(&self, footprint: &Footprint) -> Panel {
        let line = |color: &str, kind: MarkKind, points: &[(f64, f64)]| Mark {
            color: color.to_owned(),
            kind,
            points: points.to_vec(),
        };
        let color_of = |place: &FieldPlace| {
            line_color(self.0.fields.iter().position(|row| row.place == *place).unwrap_or_default())
        };
        let rims = footprint.rims_mm.iter().map(|rim| line("#777777", MarkKind::Dashed, rim));
        let edges = footprint.edges_mm.iter().map(|(place, edge)| line(&color_of(place), MarkKind::Line, edge));
        let marks: Vec<Mark> = rims.chain(edges).collect();
        let half_mm = half_range(marks.iter().flat_map(|mark| &mark.points).flat_map(|p| [p.0, p.1]));
        Panel {
            title: format!("surface {}: to {:.0} % of the rim", footprint.surface, 100.0 * footprint.share_of_rim()),
            x_label: "x, mm".to_owned(),
            y_label: "y, mm".to_owned(),
            x_range: (-half_mm, half_mm),
            y_range: (-half_mm, half_mm),
            is_to_scale: true,
            marks,
        }
    }

    /// Returns a plot in the units of what is analyzed: angles, of light that leaves in parallel.
    pub(super) fn in_units(&self, panel: Panel) -> Panel {
        match self.0.afocal {
            Some(_) => Panel {
                title: AfocalView::in_angles(&panel.title),
                x_label: AfocalView::in_angles(&panel.x_label),
                y_label: AfocalView::in_angles(&panel.y_label),
                ..panel
            },
            None => panel,
        }
    }

    /// Writes what is analyzed, and what colors mean.
    pub(super) fn head(&self, sheet: &mut Sheet, what: &str) {
        sheet.title = format!("{} — {what}", self.0.lens);
        sheet.text((MARGIN_PX, 32.0), 19.0, ("#111", "bold"), &sheet.title.clone());
        let object = match self.0.distance_mm.is_infinite() {
            true => "object far away".to_owned(),
            false => format!("object at {} mm", short(self.0.distance_mm)),
        };
        let medium = match self.0.object_index == 1.0 {
            true => String::new(),
            false => format!(" in n = {:.4}", self.0.object_index),
        };
        let aperture = self.0.object_na.map_or(String::new(), |aperture| format!(" · NA {aperture:.3}"));
        let film =
            self.0.film_radius_mm.map_or(String::new(), |radius_mm| format!(", curved by R = {radius_mm:.2} mm"));
        let along_x =
            self.0.x_plane.map_or(String::new(), |x| format!(" (along x {:.3} mm · f/{:.2})", x.efl_mm, x.f_number));
        let t_number = self.0.t_number.map_or(String::new(), |t| format!(" · T/{t:.2}"));
        let words = match self.0.afocal {
            Some(view) => format!(
                "afocal{} · exit pupil {:.3} mm across, {:.3} mm behind the last vertex · {object}{medium} · as angles",
                view.angular_magnification.map_or(String::new(), |m| format!(", {m:.3}×")),
                view.exit_pupil_diameter_mm,
                view.exit_pupil_z_mm
            ),
            None => format!(
                "f = {:.3} mm · f/{:.2}{t_number}{along_x}{aperture} · {object}{medium} · film {:.4} mm behind the last vertex{film}",
                self.0.efl_mm, self.0.f_number, self.0.film_distance_mm
            ),
        };
        sheet.text((MARGIN_PX, 52.0), 12.5, ("#333", "normal"), &words);
        let mut x = MARGIN_PX;
        for &nm in &self.0.wavelengths_nm {
            let note = if nm == self.0.reference_nm { " (reference)" } else { "" };
            let words = format!("● {nm:.0} nm{note}");
            sheet.text((x, 71.0), 12.5, (&wavelength_color(nm), "bold"), &words);
            // A bold letter of this size is some 8 px wide.
            x += 14.0 + 8.2 * words.chars().count() as f64;
        }
    }

    /// Returns the plot of spots to their own scale, in which Airy's ring has room.
    fn spot_panel(&self, spots: &[SpotRow]) -> Panel {
        let airy_um = 1.22e-3 * self.0.reference_nm * self.0.working_f_number.abs();
        let reach = spots.iter().flat_map(|spot| &spot.points_um).flat_map(|p| [p.0, p.1]);
        let range_um = half_range(reach.chain([1.15 * airy_um]));
        let circle = (0..=48).map(|i| std::f64::consts::TAU * f64::from(i) / 48.0);
        let mut marks = vec![Mark {
            color: "#888888".to_owned(),
            kind: MarkKind::Line,
            points: circle.map(|t| (airy_um * t.cos(), airy_um * t.sin())).collect(),
        }];
        marks.extend(dots(spots.iter().map(|spot| (spot.wavelength_nm, &spot.points_um))));
        let reference = spots.iter().find(|spot| spot.wavelength_nm == self.0.reference_nm).or(spots.first());
        Panel {
            title: reference.map_or(String::new(), |spot| format!("{}{}", spot.place.label(), rms_words(spot))),
            x_label: "x, µm (circle: Airy's first zero)".to_owned(),
            y_label: "y, µm".to_owned(),
            x_range: (-range_um, range_um),
            y_range: (-range_um, range_um),
            is_to_scale: true,
            marks,
        }
    }

    /// The plots over field, and that of axial color.
    fn field_panels(&self) -> [Panel; 5] {
        let last = self.0.curves.last().map_or(1.0, |row| row.place.field_deg).max(1e-3);
        let upright = |title: &str, x_label: &str, half: f64, marks: Vec<Mark>| Panel {
            title: title.to_owned(),
            x_label: x_label.to_owned(),
            y_label: "field, °".to_owned(),
            x_range: (-half, half),
            y_range: (0.0, last),
            is_to_scale: false,
            marks,
        };
        let curve = |color: &str, kind: MarkKind, of: &dyn Fn(&FieldRow) -> Option<f64>| Mark {
            color: color.to_owned(),
            kind,
            points: self.0.curves.iter().map(|row| (of(row).unwrap_or(f64::NAN), row.place.field_deg)).collect(),
        };
        let (bends, bend_label) = match self.0.x_plane {
            None => (
                vec![
                    curve(PAIR[0], MarkKind::Line, &|row| row.tangential_focus_mm),
                    curve(PAIR[1], MarkKind::Dashed, &|row| row.sagittal_focus_mm),
                ],
                "focus, mm: — tangential, - - sagittal",
            ),
            Some(_) => (
                vec![
                    curve(PAIR[0], MarkKind::Line, &|row| row.x_focus_mm),
                    curve(PAIR[1], MarkKind::Dashed, &|row| row.y_focus_mm),
                ],
                "focus, mm: — of x, - - of y",
            ),
        };
        let distortions = vec![
            curve(PAIR[0], MarkKind::Line, &|row| row.distortion_tangent_percent),
            curve(PAIR[1], MarkKind::Dashed, &|row| row.distortion_angle_percent),
        ];
        let colors: Vec<Mark> = (0..self.0.wavelengths_nm.len())
            .map(|i| curve(&wavelength_color(self.0.wavelengths_nm[i]), MarkKind::Line, &|row| row.lateral_color_um[i]))
            .collect();
        let brightness = Mark {
            color: "#111111".to_owned(),
            kind: MarkKind::Line,
            points: self
                .0
                .curves
                .iter()
                .map(|row| (row.place.field_deg, row.relative_illumination.unwrap_or(f64::NAN)))
                .collect(),
        };
        let lights = self.0.curves.iter().filter_map(|row| row.relative_illumination);
        let brightest = 1.05 * lights.fold(1.0, f64::max);
        [
            upright("field curvature", bend_label, half_range_x(&bends), bends),
            upright("distortion", "%: — against tan θ, - - against θ", half_range_x(&distortions), distortions),
            upright("lateral color", "µm from the reference", half_range_x(&colors), colors),
            Panel {
                title: "relative illumination".to_owned(),
                x_label: "field, °".to_owned(),
                y_label: "over that on the axis".to_owned(),
                x_range: (0.0, last),
                y_range: (0.0, brightest),
                is_to_scale: false,
                marks: vec![brightness],
            },
            self.axial_panel(),
        ]
    }

    fn axial_panel(&self) -> Panel {
        let marks = vec![
            Mark {
                color: PAIR[0].to_owned(),
                kind: MarkKind::Line,
                points: self.0.axial_color.iter().map(|row| (row.paraxial_shift_mm, row.wavelength_nm)).collect(),
            },
            Mark {
                color: PAIR[1].to_owned(),
                kind: MarkKind::Dashed,
                points: self
                    .0
                    .axial_color
                    .iter()
                    .map(|row| (row.rms_shift_mm.unwrap_or(f64::NAN), row.wavelength_nm))
                    .collect(),
            },
        ];
        let ends = self.0.wavelengths_nm.iter().fold((f64::MAX, f64::MIN), |e, nm| (e.0.min(*nm), e.1.max(*nm)));
        let half = half_range_x(&marks);
        Panel {
            title: "axial color".to_owned(),
            x_label: "focus, mm: — paraxial, - - least spot".to_owned(),
            y_label: "wavelength, nm".to_owned(),
            x_range: (-half, half),
            y_range: (ends.0 - 10.0, ends.1 + 10.0),
            is_to_scale: false,
            marks,
        }
    }
}

/// Writes a length with as many decimals as a short one needs.
fn short(mm: f64) -> String {
    if mm >= 100.0 { format!("{mm:.0}") } else { format!("{mm:.3}") }
}

/// The points of spots in the colors of their wavelengths, nm.
fn dots<'a>(spots: impl Iterator<Item = (f64, &'a Vec<(f64, f64)>)>) -> Vec<Mark> {
    spots
        .map(|(nm, points)| Mark { color: wavelength_color(nm), kind: MarkKind::Dots, points: points.clone() })
        .collect()
}

fn rms_words(spot: &SpotRow) -> String {
    spot.rms_um.map_or(", dark".to_owned(), |rms_um| format!(", rms {rms_um:.1} µm"))
}

/// The ranges that all fields share, so that they can be compared.
struct Ranges {
    fan_um: f64,
    waves: f64,
}

impl Ranges {
    fn of(analysis: &LensAnalysis) -> Self {
        let fans = || analysis.fans.iter();
        let errors = fans().flat_map(|fan| fan.tangential_um.iter().chain(&fan.sagittal_um)).flatten().copied();
        let waves = fans().flat_map(|fan| fan.tangential_waves.iter().chain(&fan.sagittal_waves)).flatten().copied();
        Self { fan_um: half_range(errors), waves: half_range(waves) }
    }
}

/// The four plots of a field's fans.
fn fan_panels(fans: &[FanRow], ranges: &Ranges) -> [Panel; 4] {
    let panel = |title: &str, y_label: &str, half: f64, of: &dyn Fn(&FanRow) -> &[Option<f64>]| Panel {
        title: title.to_owned(),
        x_label: "place in the stop".to_owned(),
        y_label: y_label.to_owned(),
        x_range: (-1.0, 1.0),
        y_range: (-half, half),
        is_to_scale: false,
        marks: fans
            .iter()
            .map(|fan| Mark {
                color: wavelength_color(fan.wavelength_nm),
                kind: MarkKind::Line,
                points: fan.places.iter().zip(of(fan)).map(|(place, v)| (*place, v.unwrap_or(f64::NAN))).collect(),
            })
            .collect(),
    };
    [
        panel("tangential rays (along y)", "εy, µm", ranges.fan_um, &|fan| &fan.tangential_um),
        panel("sagittal rays (along x)", "εx, µm", ranges.fan_um, &|fan| &fan.sagittal_um),
        panel("tangential path (along y)", "waves", ranges.waves, &|fan| &fan.tangential_waves),
        panel("sagittal path (along x)", "waves", ranges.waves, &|fan| &fan.sagittal_waves),
    ]
}

/// Returns a round number that holds all these values, with some room; of nothing but rounding, a thousandth.
pub(super) fn half_range(values: impl Iterator<Item = f64>) -> f64 {
    let largest = 1.02 * values.filter(|v| v.is_finite()).map(f64::abs).fold(1e-3, f64::max);
    let power = 10_f64.powf(largest.log10().floor());
    let round = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    round.into_iter().map(|m| m * power).find(|v| *v >= largest).unwrap_or(10.0 * power)
}

fn half_range_x(marks: &[Mark]) -> f64 {
    half_range(marks.iter().flat_map(|mark| &mark.points).map(|point| point.0))
}
