//! The lens bench: spots, fans, curves over field and modulation of the lens as it stands before the film.

use dioptric_analysis::{LensAnalysis, LineChart, SpotRow};
use egui::{Color32, ScrollArea, Sense, Ui, pos2, vec2};
use egui_plot::{Legend, Line, LineStyle, Plot, PlotPoints};

use super::super::fields::LINES;
use crate::engine::{LensAnswer, three};

/// Height of a row of charts, points.
const HEIGHT: f32 = 190.0;

/// Shows the analysis.
pub(in crate::ui) fn show(ui: &mut Ui, answer: &LensAnswer) {
    let analysis = &answer.analysis;
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        ui.label(format!(
            "{}: f = {} mm, f/{}{}, working f/{}, film {:.3} mm behind the last vertex; blue, orange and green are {}",
            analysis.lens,
            three(analysis.efl_mm),
            three(analysis.f_number),
            analysis.t_number.map_or_else(String::new, |t| format!(", T/{}", three(t))),
            three(analysis.working_f_number),
            analysis.film_distance_mm,
            analysis.wavelengths_nm.iter().map(|nm| format!("{nm} nm")).collect::<Vec<_>>().join(", "),
        ));
        let width = (ui.available_width() / 3.0 - 8.0).max(160.0);
        row(ui, "Spots", |ui| spots(ui, analysis, width));
        row(ui, "Ray fans, µm over the stop: along the field (lines), across it (dashes)", |ui| {
            fans(ui, analysis, width, "µm", |fan| (&fan.tangential_um, &fan.sagittal_um));
        });
        row(ui, "Path differences, waves over the stop", |ui| {
            fans(ui, analysis, width, "waves", |fan| (&fan.tangential_waves, &fan.sagittal_waves));
        });
        row(ui, "Over the field", |ui| curves(ui, analysis, width));
        if let Some(modulation) = &answer.modulation {
            row(ui, "Modulation", |ui| {
                for (_, chart) in modulation.charts() {
                    ui.allocate_ui(vec2(width, HEIGHT), |ui| line_chart(ui, chart));
                }
            });
        }
    });
}

fn row(ui: &mut Ui, title: &str, contents: impl FnOnce(&mut Ui)) {
    ui.add_space(4.0);
    ui.strong(title);
    ui.horizontal_top(contents);
}

/// The fields of an analysis, in their order.
fn fields(analysis: &LensAnalysis) -> Vec<String> {
    analysis.fields.iter().map(|row| row.place.label()).collect()
}

fn spots(ui: &mut Ui, analysis: &LensAnalysis, width: f32) {
    let n_wavelengths = analysis.wavelengths_nm.len().max(1);
    let reach = |row: &SpotRow| row.points_um.iter().map(|(x, y)| x.hypot(*y)).fold(0.0, f64::max);
    let most_um = analysis.spots.iter().map(reach).fold(1e-3, f64::max);
    for (field, rows) in fields(analysis).iter().zip(analysis.spots.chunks(n_wavelengths)) {
        ui.vertical(|ui| {
            let (response, painter) = ui.allocate_painter(vec2(width, HEIGHT - 20.0), Sense::hover());
            let rect = response.rect;
            painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
            let scale = f64::from(0.46 * rect.width().min(rect.height())) / most_um;
            for (i, row) in rows.iter().enumerate() {
                for (x_um, y_um) in &row.points_um {
                    let at = rect.center() + vec2((scale * x_um) as f32, -(scale * y_um) as f32);
                    painter.circle_filled(at, 1.2, LINES[i % LINES.len()]);
                }
            }
            let foot = pos2(rect.left() + 6.0, rect.bottom() - 6.0);
            let end = foot + vec2((scale * most_um) as f32, 0.0);
            painter.line_segment([foot, end], egui::Stroke::new(1.0, ui.visuals().text_color()));
            let rms: Vec<String> = rows.iter().map(|row| row.rms_um.map_or("dark".to_owned(), three)).collect();
            ui.small(format!("{field}: rms {} µm; the line is {} µm", rms.join(", "), three(most_um)));
            response.accessible_name(format!("spot at {field}"));
        });
    }
}

type Fan = dioptric_analysis::FanRow;

fn fans(
    ui: &mut Ui,
    analysis: &LensAnalysis,
    width: f32,
    unit: &str,
    of: impl for<'a> Fn(&'a Fan) -> (&'a Vec<Option<f64>>, &'a Vec<Option<f64>>),
) {
    let n_wavelengths = analysis.wavelengths_nm.len().max(1);
    for (field, rows) in fields(analysis).iter().zip(analysis.fans.chunks(n_wavelengths)) {
        let id = format!("fan {unit} {field}");
        plain(&id, ui, width, "stop").y_axis_label(unit.to_owned()).show(ui, |plot| {
            for (i, fan) in rows.iter().enumerate() {
                let (tangential, sagittal) = of(fan);
                let points = |values: &[Option<f64>]| -> PlotPoints<'_> {
                    fan.places.iter().zip(values).filter_map(|(at, value)| Some([*at, (*value)?])).collect()
                };
                let color = LINES[i % LINES.len()];
                plot.line(Line::new(format!("{field} {}", fan.wavelength_nm), points(tangential)).color(color));
                let across = Line::new(format!("{field} {} across", fan.wavelength_nm), points(sagittal));
                plot.line(across.color(color).style(LineStyle::dashed_loose()));
            }
        });
    }
}

fn curves(ui: &mut Ui, analysis: &LensAnalysis, width: f32) {
    let over = |value: &dyn Fn(&dioptric_analysis::FieldRow) -> Option<f64>| -> PlotPoints<'static> {
        analysis.curves.iter().filter_map(|row| Some([row.place.field_deg, value(row)?])).collect()
    };
    plain("field curvature", ui, width, "°").y_axis_label("focus, mm").legend(legend()).show(ui, |plot| {
        plot.line(Line::new("tangential", over(&|row| row.tangential_focus_mm)).color(LINES[0]));
        plot.line(
            Line::new("sagittal", over(&|row| row.sagittal_focus_mm)).color(LINES[1]).style(LineStyle::dashed_loose()),
        );
    });
    plain("distortion", ui, width, "°").y_axis_label("%").legend(legend()).show(ui, |plot| {
        plot.line(Line::new("distortion", over(&|row| row.distortion_tangent_percent)).color(LINES[2]));
    });
    plain("illumination", ui, width, "°").include_y(0.0).include_y(1.05).legend(legend()).show(ui, |plot| {
        plot.line(Line::new("relative illumination", over(&|row| row.relative_illumination)).color(LINES[4]));
    });
}

fn legend() -> Legend {
    Legend::default().text_style(egui::TextStyle::Small)
}

fn plain<'a>(id: &str, _: &Ui, width: f32, x_words: &str) -> Plot<'a> {
    Plot::new(id.to_owned())
        .width(width)
        .height(HEIGHT)
        .x_axis_label(x_words.to_owned())
        .allow_drag(false)
        .allow_scroll(false)
        .allow_zoom(false)
        .allow_boxed_zoom(false)
}

/// Draws a chart of an analysis.
pub(in crate::ui) fn line_chart(ui: &mut Ui, chart: &LineChart) {
    let width = ui.available_width();
    let (x, y) = (chart.x_range, chart.y_range);
    let plot = plain(&chart.title, ui, width, &chart.x_label)
        .y_axis_label(chart.y_label.clone())
        .include_x(x.0)
        .include_x(x.1)
        .include_y(y.0)
        .include_y(y.1);
    plot.show(ui, |plot| {
        for (i, series) in chart.series.iter().enumerate() {
            let points: PlotPoints<'_> = series.points.iter().map(|(x, y)| [*x, *y]).collect();
            let color = Color32::from_hex(&series.color).unwrap_or(LINES[i % LINES.len()]);
            let style = if series.is_dashed { LineStyle::dashed_loose() } else { LineStyle::Solid };
            let name = series.label.clone().unwrap_or_else(|| format!("line {i}"));
            plot.line(Line::new(name, points).color(color).style(style));
        }
    });
}
