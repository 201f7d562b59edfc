//! The charts beneath the picture: point spread, modulation, histogram, light.

use dioptric_sensor::EdgeResponse;
use egui::{Color32, RichText, TextureHandle, Ui, vec2};
use egui_plot::{Legend, Line, Plot, PlotPoints, VLine};

use super::super::fields::{LINES, wrong};
use crate::engine::{Product, Spread, three};

/// Shows the point spread at the cursor.
pub(in crate::ui) fn spread(ui: &mut Ui, texture: Option<&TextureHandle>, spread: Option<&Spread>) {
    let (Some(texture), Some(spread)) = (texture, spread) else {
        ui.weak("Point at the picture: the point spread there.");
        return;
    };
    let side = ui.available_width().min(ui.available_height() - 20.0).max(16.0);
    ui.vertical_centered(|ui| {
        let image = egui::Image::new((texture.id(), vec2(side, side))).alt_text("point spread function");
        ui.add(image)
            .on_hover_text("Point spread of what is seen there, all wavelengths together; square root of the light");
        let width_um = spread.side as f64 * spread.pitch_um;
        ui.small(format!("{} µm wide, rms {} µm", three(width_um), three(spread.rms_um)));
    });
}

/// Shows the modulation at the cursor, and the response of the edge that was marked on pixels of a pitch, µm.
pub(in crate::ui) fn modulation(
    ui: &mut Ui,
    spread: Option<&Spread>,
    edge: Option<(&Result<EdgeResponse, String>, f64)>,
) {
    let Some(spread) = spread else {
        ui.weak("Point at the picture: the modulation there.");
        return;
    };
    if let Some((Err(words), _)) = edge {
        wrong(ui, words);
    }
    let line = |name: &str, values: &[f64], color: Color32| {
        let points: PlotPoints<'_> = spread.frequencies_per_mm.iter().zip(values).map(|(f, m)| [*f, *m]).collect();
        Line::new(name, points).color(color).width(1.8)
    };
    let reach = spread.frequencies_per_mm.last().copied().unwrap_or(1.0);
    plot("modulation", ui, "cycles/mm", reach, 1.0).show(ui, |plot| {
        plot.line(line("tangential", &spread.tangential, LINES[0]));
        plot.line(line("sagittal", &spread.sagittal, LINES[1]).style(egui_plot::LineStyle::dashed_loose()));
        if let Some((Ok(edge), pitch_um)) = edge {
            let per_mm = edge.frequencies.iter().map(|f| f * 1e3 / pitch_um);
            let shown = per_mm.zip(&edge.response).take_while(|(f, _)| *f <= reach);
            let points: PlotPoints<'_> = shown.map(|(f, response)| [f, *response]).collect();
            plot.line(Line::new("edge in the picture", points).color(LINES[2]).width(1.8));
        }
        if spread.nyquist_per_mm < reach {
            plot.vline(VLine::new("Nyquist of the pixels", spread.nyquist_per_mm).color(Color32::GRAY));
        }
    });
}

/// Shows the histogram of the raw frame.
pub(in crate::ui) fn histogram(ui: &mut Ui, product: &Product) {
    let raw = &product.capture.frames.exposed.raw;
    let channels = &product.statistics.channels;
    let most = channels.iter().flat_map(|channel| &channel.histogram).copied().fold(1e-6, f64::max);
    let color = |filter: &str, i: usize| match filter.chars().next().map(|first| first.to_ascii_lowercase()) {
        Some('r') => LINES[1],
        Some('g') => LINES[2],
        Some('b') => LINES[0],
        _ => LINES[i % LINES.len()],
    };
    let unit = if raw.dn().is_some() { "DN" } else { "V" };
    plot("histogram", ui, unit, raw.levels.top, most).show(ui, |plot| {
        for (i, channel) in channels.iter().enumerate() {
            let step = raw.levels.top / channel.histogram.len() as f64;
            let points: PlotPoints<'_> =
                channel.histogram.iter().enumerate().map(|(bin, share)| [step * (bin as f64 + 0.5), *share]).collect();
            plot.line(Line::new(channel.filter.clone(), points).color(color(&channel.filter, i)).width(1.5));
        }
        plot.vline(VLine::new("saturation", raw.levels.white).color(Color32::GRAY));
    });
}

/// Shows where the light goes from the scene to the numbers.
pub(in crate::ui) fn light(ui: &mut Ui, product: &Product) {
    egui::Grid::new("light").num_columns(2).spacing([10.0, 2.0]).show(ui, |ui| {
        for step in product.light() {
            ui.label(RichText::new(step.place).small());
            ui.label(RichText::new(step.amount).small().strong());
            ui.end_row();
        }
    });
}

/// Returns a chart of the size of its place, from 0 to what is to be seen.
pub(in crate::ui) fn plot<'a>(id: &'a str, ui: &Ui, x_words: &str, x_most: f64, y_most: f64) -> Plot<'a> {
    Plot::new(id)
        .height(ui.available_height().max(40.0))
        .include_x(0.0)
        .include_x(x_most)
        .include_y(0.0)
        .include_y(1.04 * y_most)
        .x_axis_label(x_words.to_owned())
        .set_margin_fraction(vec2(0.0, 0.0))
        .grid_spacing(egui::Rangef::new(6.0, 60.0))
        .allow_drag(false)
        .allow_scroll(false)
        .allow_zoom(false)
        .allow_boxed_zoom(false)
        .legend(Legend::default().text_style(egui::TextStyle::Small))
}
