//! Line charts as data: what is drawn, not how.

use std::fmt::Write;

/// A line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; none for a line that needs no entry.
    pub label: Option<String>,
    /// Color, `#rrggbb`.
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
    /// Whether the axes are linear.
    pub scale: Scale,
}

/// How values lie along both axes of a chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    #[default]
    Linear,
    /// By their logarithms; ranges and points must be above 0.
    Logarithmic,
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
}
