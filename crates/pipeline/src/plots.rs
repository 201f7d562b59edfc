//! Line plots as SVG, in one style.

use std::fmt::Write;

use kuva::prelude::{Layout, LegendPosition, LinePlot, Plot, render_to_svg};

/// A line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; none for a line that needs no entry.
    pub label: Option<String>,
    /// Colour, `#rrggbb`.
    pub color: String,
    /// Points x, y in the plot's units.
    pub points: Vec<(f64, f64)>,
    /// Draws the line dashed.
    pub is_dashed: bool,
}

/// A plot of lines.
#[derive(Clone, Debug, PartialEq)]
pub struct LineChart {
    /// Title above the plot.
    pub title: String,
    /// Name and unit of x.
    pub x_label: String,
    /// Name and unit of y.
    pub y_label: String,
    /// First and last x.
    pub x_range: (f64, f64),
    /// First and last y.
    pub y_range: (f64, f64),
    /// Lines, drawn in this order.
    pub series: Vec<Series>,
    /// Where the legend has room.
    pub legend: Corner,
}

/// A corner of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corner {
    /// Top right.
    TopRight,
    /// Top left.
    TopLeft,
    /// Bottom left.
    BottomLeft,
    /// Bottom right.
    BottomRight,
}

impl LineChart {
    /// Returns the plot as a self-contained SVG document.
    pub fn to_svg(&self, width_px: f64, height_px: f64) -> String {
        self.drawn(width_px, height_px, |layout| layout)
    }

    /// Returns the plot with both axes logarithmic; ranges and points must be above 0.
    pub fn to_logarithmic_svg(&self, width_px: f64, height_px: f64) -> String {
        self.drawn(width_px, height_px, Layout::with_log_scale)
    }

    /// Returns the lines as a table: the name of the line, whether it is solid or dashed, x and y.
    ///
    /// A line without a name is the other half of the one before it.
    pub fn to_csv(&self) -> String {
        let mut csv = format!("line,style,\"{}\",\"{}\"\n", self.x_label, self.y_label);
        let mut name = "";
        for series in &self.series {
            name = series.label.as_deref().unwrap_or(name);
            let style = if series.is_dashed { "dashed" } else { "solid" };
            for (x, y) in &series.points {
                let _ = writeln!(csv, "\"{name}\",{style},{x},{y}");
            }
        }
        csv
    }

    fn drawn(&self, width_px: f64, height_px: f64, scaled: impl Fn(Layout) -> Layout) -> String {
        let plots: Vec<Plot> = self.series.iter().map(|series| line(series).into()).collect();
        let mut layout = scaled(Layout::auto_from_plots(&plots))
            .with_width(width_px)
            .with_height(height_px)
            .with_title(self.title.clone())
            .with_title_size(15)
            .with_x_label(self.x_label.clone())
            .with_y_label(self.y_label.clone())
            .with_label_size(12)
            .with_tick_size(11)
            .with_body_size(11)
            .with_font_family(FONT)
            .with_x_axis_min(self.x_range.0)
            .with_x_axis_max(self.x_range.1)
            .with_y_axis_min(self.y_range.0)
            .with_y_axis_max(self.y_range.1)
            .with_clamp_axis();
        if self.series.iter().any(|series| series.label.is_some()) {
            layout = layout.with_legend_position(match self.legend {
                Corner::TopRight => LegendPosition::InsideTopRight,
                Corner::TopLeft => LegendPosition::InsideTopLeft,
                Corner::BottomLeft => LegendPosition::InsideBottomLeft,
                Corner::BottomRight => LegendPosition::InsideBottomRight,
            });
        }
        render_to_svg(plots, layout)
    }
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
        };
        let svg = chart.to_svg(480.0, 320.0);
        for word in ["<svg", "Line spread", "550 nm", "#00aa00"] {
            assert!(svg.contains(word), "{word}");
        }
        let csv = chart.to_csv();
        assert!(csv.starts_with("line,style,\"x, µm\",\"share per µm\"\n\"550 nm\",solid,-1,0\n"), "{csv}");
    }
}
