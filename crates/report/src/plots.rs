//! Line charts drawn as SVG, in one style.

use dioptric_analysis::{Corner, LineChart, Scale, Series};
use kuva::prelude::{Layout, LegendPosition, LinePlot, Plot, render_to_svg};

/// Returns a chart as a self-contained SVG document.
pub fn chart_svg(chart: &LineChart, width_px: f64, height_px: f64) -> String {
    let plots: Vec<Plot> = chart.series.iter().map(|series| line(series).into()).collect();
    let layout = Layout::auto_from_plots(&plots);
    let layout = match chart.scale {
        Scale::Linear => layout,
        Scale::Logarithmic => layout.with_log_scale(),
    };
    let mut layout = layout
        .with_width(width_px)
        .with_height(height_px)
        .with_title(chart.title.clone())
        .with_title_size(15)
        .with_x_label(chart.x_label.clone())
        .with_y_label(chart.y_label.clone())
        .with_label_size(12)
        .with_tick_size(11)
        .with_body_size(11)
        .with_font_family(FONT)
        .with_x_axis_min(chart.x_range.0)
        .with_x_axis_max(chart.x_range.1)
        .with_y_axis_min(chart.y_range.0)
        .with_y_axis_max(chart.y_range.1)
        .with_clamp_axis();
    if chart.series.iter().any(|series| series.label.is_some()) {
        layout = layout.with_legend_position(match chart.legend {
            Corner::TopRight => LegendPosition::InsideTopRight,
            Corner::TopLeft => LegendPosition::InsideTopLeft,
            Corner::BottomLeft => LegendPosition::InsideBottomLeft,
            Corner::BottomRight => LegendPosition::InsideBottomRight,
        });
    }
    render_to_svg(plots, layout)
}

/// The font of all drawings: what the reader's system has.
pub(crate) const FONT: &str = "system-ui, 'Segoe UI', 'DejaVu Sans', Helvetica, Arial, sans-serif";

fn line(series: &Series) -> LinePlot {
    let mut plot =
        LinePlot::new().with_data(series.points.clone()).with_color(series.color.clone()).with_stroke_width(1.6);
    if let Some(label) = &series.label {
        plot = plot.with_legend(label.clone());
    }
    if series.is_dashed { plot.with_dashed() } else { plot }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_holds_its_words() {
        let chart = LineChart {
            title: "Line spread".to_owned(),
            x_label: "x, µm".to_owned(),
            y_label: "share per µm".to_owned(),
            x_range: (-1.0, 1.0),
            y_range: (0.0, 1.0),
            series: vec![Series {
                label: Some("550 nm".to_owned()),
                color: "#00aa00".to_owned(),
                points: vec![(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)],
                is_dashed: false,
            }],
            legend: Corner::TopRight,
            scale: Scale::Linear,
        };
        let svg = chart_svg(&chart, 480.0, 320.0);
        for word in ["<svg", "Line spread", "550 nm", "#00aa00"] {
            assert!(svg.contains(word), "{word}");
        }
        let csv = chart.to_csv();
        assert!(csv.starts_with("line,style,\"x, µm\",\"share per µm\"\n\"550 nm\",solid,-1,0\n"), "{csv}");
    }
}
