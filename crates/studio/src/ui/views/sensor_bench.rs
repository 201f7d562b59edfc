//! The sensor bench: photon transfer, signal over noise, and the sharpness of an edge in the picture.

use dioptric_analysis::measure::NoiseData;
use dioptric_sensor::EdgeResponse;
use egui::{ScrollArea, Ui};
use egui_plot::{Legend, Line, MarkerShape, Plot, PlotPoints, Points};

use super::super::fields::LINES;
use crate::engine::three;

/// Height of a chart, points.
const HEIGHT: f32 = 240.0;

/// Shows what the bench measured of the sensor, and the edge that was dragged on the picture.
pub(in crate::ui) fn show(ui: &mut Ui, noise: Option<&NoiseData>, edge: Option<&Result<EdgeResponse, String>>) {
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        let width = (ui.available_width() / 2.0 - 8.0).max(160.0);
        match noise {
            Some(noise) => {
                ui.horizontal_top(|ui| {
                    transfer(ui, noise, width);
                    signal_to_noise(ui, noise, width);
                });
                ui.label(summary(noise));
            }
            None => drop(ui.weak("The sensor is being measured.")),
        }
        ui.separator();
        edge_view(ui, edge);
    });
}

fn chart<'a>(id: &str, width: f32, x: &str, y: &str) -> Plot<'a> {
    Plot::new(id.to_owned())
        .width(width)
        .height(HEIGHT)
        .x_axis_label(x.to_owned())
        .y_axis_label(y.to_owned())
        .allow_drag(false)
        .allow_scroll(false)
        .allow_zoom(false)
        .allow_boxed_zoom(false)
        .legend(Legend::default().text_style(egui::TextStyle::Small))
}

fn transfer(ui: &mut Ui, noise: &NoiseData, width: f32) {
    chart("photon transfer", width, "mean, DN", "variance, DN²").show(ui, |plot| {
        let points: PlotPoints<'_> = noise.points.iter().map(|point| [point.mean_dn, point.variance_dn2]).collect();
        plot.points(Points::new("photon transfer", points).color(LINES[0]).radius(3.0).shape(MarkerShape::Circle));
        if let Some(dark) = noise.points.first() {
            let brightest = noise.points.iter().map(|point| point.electrons).fold(0.0, f64::max);
            let top_dn = dark.mean_dn + noise.gain_dn_per_e * noise.saturation_e.unwrap_or(brightest);
            let line = |mean_dn: f64| [mean_dn, dark.variance_dn2 + noise.gain_dn_per_e * (mean_dn - dark.mean_dn)];
            let points: PlotPoints<'_> = [dark.mean_dn, top_dn].map(line).into_iter().collect();
            plot.line(Line::new("shot noise alone", points).color(LINES[1]));
        }
    });
}

fn signal_to_noise(ui: &mut Ui, noise: &NoiseData, width: f32) {
    chart("signal to noise", width, "log₁₀ of electrons", "dB").show(ui, |plot| {
        let lit = || noise.points.iter().filter(|point| point.electrons > 0.0);
        let of = |value: &dyn Fn(&dioptric_analysis::measure::NoisePoint) -> Option<f64>| -> PlotPoints<'static> {
            let decibels = |ratio: f64| 20.0 * ratio.log10();
            lit()
                .filter_map(|p| Some([p.electrons.log10(), decibels(value(p).filter(|ratio| *ratio > 0.0)?)]))
                .collect()
        };
        plot.points(Points::new("measured", of(&|point| point.snr)).color(LINES[0]).radius(3.0));
        plot.line(Line::new("linear model", of(&|point| point.model_snr)).color(LINES[1]));
    });
}

fn summary(noise: &NoiseData) -> String {
    let electrons =
        |value: Option<f64>| value.map_or_else(|| "not measured".to_owned(), |e| format!("{} e⁻", three(e)));
    let decibels = |value: Option<f64>| value.map_or_else(|| "not measured".to_owned(), |db| format!("{db:.1} dB"));
    let numbers = format!(
        "{}: gain {} DN/e⁻, dark noise {}, saturation {}, dynamic range {}{}, largest signal over noise {}",
        noise.source,
        three(noise.gain_dn_per_e),
        electrons(noise.dark_noise_e),
        electrons(noise.saturation_e),
        decibels(noise.dynamic_range_db),
        noise.dynamic_range_stops.map_or_else(String::new, |stops| format!(" ({stops:.1} stops)")),
        decibels(noise.max_snr_db),
    );
    std::iter::once(numbers).chain(noise.notes.iter().cloned()).collect::<Vec<_>>().join("\n")
}

fn edge_view(ui: &mut Ui, edge: Option<&Result<EdgeResponse, String>>) {
    match edge {
        None => drop(ui.weak(
            "Drag a rectangle over a slanted edge in the picture with Shift held: its spatial frequency response.",
        )),
        Some(Err(words)) => super::super::fields::wrong(ui, words),
        Some(Ok(edge)) => {
            let mtf50 = edge
                .mtf50()
                .map_or("above the sampled frequencies".to_owned(), |f| format!("{} cycles/pixel", three(f)));
            ui.label(format!("Edge slanted by {:.2}°, half the response at {mtf50}", edge.slant_deg));
            let width = ui.available_width();
            chart("edge", width, "cycles/pixel", "response").include_y(0.0).show(ui, |plot| {
                let shown = edge.frequencies.iter().zip(&edge.response).take_while(|(f, _)| **f <= 1.0);
                let points: PlotPoints<'_> = shown.map(|(f, response)| [*f, *response]).collect();
                plot.line(Line::new("spatial frequency response", points).color(LINES[0]).width(1.8));
            });
        }
    }
}
