//! Line charts drawn as SVG, in one style.

use std::fmt::Write;

use dioptric_analysis::{Corner, LineChart, Scale, Series};

use crate::{
    axis::Axis,
    lettering::{FONT, Weight, width_px},
    panel::{Mark, MarkKind, axes_of, escaped},
};

/// Sizes of title, axis labels and the rest, px.
const TITLE_PX: f64 = 15.0;
const LABEL_PX: f64 = 12.0;
const WORD_PX: f64 = 11.0;
/// Height of a row of the legend, length of its sample of the line, and room about them, px.
const ROW_PX: f64 = 16.0;
const SAMPLE_PX: f64 = 22.0;
const PAD_PX: f64 = 6.0;

/// Returns a chart as a self-contained SVG document.
///
/// The legend stands in the chart's corner where it covers no line there, else in the first corner where it does not,
/// else in rows above the frame.
pub fn chart_svg(chart: &LineChart, width_px: f64, height_px: f64) -> String {
    let inside = Frame::of(chart, (width_px, height_px), 0.0);
    let legend = Legend::of(chart);
    let (frame, places) = match legend.free_corner(chart, &inside) {
        Some(places) => (inside, places),
        None => {
            let (rows, places) = legend.rows_above(&inside);
            (Frame::of(chart, (width_px, height_px), rows as f64 * ROW_PX), places)
        }
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width_px:.0}\" height=\"{height_px:.0}\" \
         viewBox=\"0 0 {width_px:.0} {height_px:.0}\" font-family=\"{FONT}\" font-size=\"{WORD_PX}\">\n\
         <title>{}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        escaped(&chart.title)
    );
    frame.draw(chart, &mut svg);
    legend.draw(&places, &mut svg);
    svg.push_str("</svg>\n");
    svg
}

/// Where the frame of the plot lies, px from the left and the top, and its axes.
struct Frame {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    x: Axis,
    y: Axis,
    /// Middle of the column of the label of y.
    y_label_px: f64,
}

impl Frame {
    /// Makes room for the words outside the frame; `above_px` more above it.
    fn of(chart: &LineChart, (width_px, height_px): (f64, f64), above_px: f64) -> Self {
        let top = 14.0 + TITLE_PX + 4.0 + above_px;
        let height = (height_px - top - 44.0).max(10.0);
        let y = Axis::new(chart.y_range, height, chart.scale);
        let widest = y.ticks().iter().map(|(_, word)| wide(word)).fold(0.0, f64::max);
        let y_label_px = 6.0 + 0.5 * LABEL_PX;
        let left = y_label_px + 0.5 * LABEL_PX + 8.0 + widest + 7.0;
        // The last number below the frame must not be cut.
        let last = |width: f64| Axis::new(chart.x_range, width, chart.scale).ticks().pop();
        let right = 12.0_f64.max(last(width_px - left).map_or(0.0, |(_, word)| 0.5 * wide(&word) + 3.0));
        let width = (width_px - left - right).max(10.0);
        Self { left, top, width, height, x: Axis::new(chart.x_range, width, chart.scale), y, y_label_px }
    }

    /// Returns where a point lies within the frame, px from its top left corner.
    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.px(x), self.height - self.y.px(y))
    }

    fn draw(&self, chart: &LineChart, svg: &mut String) {
        let Self { left, top, width, height, .. } = *self;
        let mut text = |(x, y): (f64, f64), anchor: &str, more: &str, words: &str| {
            let words = escaped(words);
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"#1d2330\"{more}>{words}</text>"
            );
        };
        let middle = (left + 0.5 * width, top + 0.5 * height);
        let (label, x) = (format!(" font-size=\"{LABEL_PX}\""), self.y_label_px);
        // A long title is written smaller, as far as it can be read, and stays within the chart.
        let (wide, room) = (width_px(&chart.title, TITLE_PX, Weight::Bold), left + width);
        let title_px = (TITLE_PX * room / wide).clamp(WORD_PX, TITLE_PX);
        let half = 0.5 * wide * title_px / TITLE_PX;
        let title = format!(" font-size=\"{title_px:.1}\" font-weight=\"600\"");
        text((middle.0.min(room - half).max(half), 8.0 + TITLE_PX), "middle", &title, &chart.title);
        text((middle.0, top + height + 36.0), "middle", &label, &chart.x_label);
        let turned = format!("{label} transform=\"rotate(-90 {x:.1} {:.1})\" dominant-baseline=\"central\"", middle.1);
        text((x, middle.1), "middle", &turned, &chart.y_label);
        let mut grid = String::new();
        for (value, word) in self.x.ticks() {
            let x = self.x.px(value);
            text((left + x, top + height + 17.0), "middle", "", &word);
            let _ = write!(grid, "M{x:.1} 0V{height:.1}");
        }
        for (value, word) in self.y.ticks() {
            let y = height - self.y.px(value);
            text((left - 7.0, top + y + 4.0), "end", "", &word);
            let _ = write!(grid, "M0 {y:.1}H{width:.1}");
        }
        // A nested drawing cuts off what lies outside the frame.
        let _ = writeln!(
            svg,
            "<svg x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" {}{}>\n\
             <path d=\"{grid}\" stroke=\"#e2e5ea\" stroke-width=\"0.8\"/>",
            axes_of((chart.x_range, chart.y_range), [&chart.title, &chart.x_label, &chart.y_label]),
            if chart.scale == Scale::Logarithmic { " data-log=\"\"" } else { "" }
        );
        let mut name = "";
        for series in &chart.series {
            name = series.label.as_deref().unwrap_or(name);
            let _ = writeln!(svg, "<g data-name=\"{}\">", escaped(name));
            let points = series.points.iter().map(|point| self.place(*point)).collect();
            let kind = if series.is_dashed { MarkKind::Dashed } else { MarkKind::Line };
            Mark { color: series.color.clone(), kind, points }.draw(&|x| x, &|y| y, svg);
            svg.push_str("</g>\n");
        }
        let _ = writeln!(
            svg,
            "</svg>\n<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"none\" \
             stroke=\"#6b7280\"/>"
        );
    }

    /// Reports whether a line passes through a rectangle of the frame.
    fn crosses(&self, series: &Series, rectangle: [f64; 4]) -> bool {
        let places: Vec<(f64, f64)> = series.points.iter().map(|point| self.place(*point)).collect();
        places.windows(2).any(|ends| segment_meets(ends[0], ends[1], rectangle))
    }
}

/// Reports whether the segment between two places meets a rectangle given by its left, top, right and bottom.
fn segment_meets(from: (f64, f64), to: (f64, f64), [left, top, right, bottom]: [f64; 4]) -> bool {
    // The part of the segment, as shares of its length, that lies between each pair of sides (Liang and Barsky).
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (start, end, low, high) in [(from.0, to.0, left, right), (from.1, to.1, top, bottom)] {
        let step = end - start;
        if step == 0.0 {
            if !(low..=high).contains(&start) {
                return false;
            }
            continue;
        }
        let (a, b) = ((low - start) / step, (high - start) / step);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    // False too where a place is not finite.
    first <= last && (from.0 + from.1 + to.0 + to.1).is_finite()
}

/// The names of the lines.
struct Legend<'a> {
    entries: Vec<(&'a Series, &'a str, f64)>,
}

impl<'a> Legend<'a> {
    fn of(chart: &'a LineChart) -> Self {
        let named = chart.series.iter().filter_map(|series| Some((series, series.label.as_deref()?)));
        Self { entries: named.map(|(series, label)| (series, label, SAMPLE_PX + 6.0 + wide(label))).collect() }
    }

    /// Returns the top left corners of the entries, one below the other, in a corner of the frame where no line passes.
    fn free_corner(&self, chart: &LineChart, frame: &Frame) -> Option<Vec<(f64, f64)>> {
        let width = self.entries.iter().map(|entry| entry.2).fold(0.0, f64::max) + 2.0 * PAD_PX;
        let height = self.entries.len() as f64 * ROW_PX + PAD_PX;
        if width > 0.6 * frame.width || height > 0.8 * frame.height {
            return None;
        }
        let all = [Corner::TopRight, Corner::TopLeft, Corner::BottomLeft, Corner::BottomRight];
        let corners = [chart.legend].into_iter().chain(all);
        let rectangle = |corner: Corner| {
            let (is_right, is_bottom) = match corner {
                Corner::TopRight => (true, false),
                Corner::TopLeft => (false, false),
                Corner::BottomLeft => (false, true),
                Corner::BottomRight => (true, true),
            };
            let left = if is_right { frame.width - width } else { 0.0 };
            let top = if is_bottom { frame.height - height } else { 0.0 };
            [left, top, left + width, top + height]
        };
        let is_free = |rectangle: &[f64; 4]| !chart.series.iter().any(|series| frame.crosses(series, *rectangle));
        let [left, top, ..] = corners.map(rectangle).find(is_free)?;
        let place = |i: usize| (frame.left + left + PAD_PX, frame.top + top + 0.5 * PAD_PX + i as f64 * ROW_PX);
        Some((0..self.entries.len()).map(place).collect())
    }

    /// Returns how many rows above the frame hold the entries, and their top left corners.
    fn rows_above(&self, frame: &Frame) -> (usize, Vec<(f64, f64)>) {
        let (mut row, mut x) = (0, 0.0);
        let mut places = Vec::new();
        for (_, _, width) in &self.entries {
            if x > 0.0 && x + width > frame.width {
                (row, x) = (row + 1, 0.0);
            }
            places.push((frame.left + x, frame.top - 4.0 + f64::from(row) * ROW_PX));
            x += width + 16.0;
        }
        (row as usize + 1, places)
    }

    fn draw(&self, places: &[(f64, f64)], svg: &mut String) {
        for ((series, label, _), (x, y)) in self.entries.iter().zip(places) {
            let middle = y + 0.5 * ROW_PX;
            let kind = if series.is_dashed { MarkKind::Dashed } else { MarkKind::Line };
            let points = vec![(*x, middle), (x + SAMPLE_PX, middle)];
            Mark { color: series.color.clone(), kind, points }.draw(&|x| x, &|y| y, svg);
            let (x, y, words) = (x + SAMPLE_PX + 6.0, middle + 4.0, escaped(label));
            let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"#1d2330\">{words}</text>");
        }
    }
}

fn wide(words: &str) -> f64 {
    width_px(words, WORD_PX, Weight::Regular)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> LineChart {
        LineChart {
            title: "Line spread".to_owned(),
            x_label: "x, µm".to_owned(),
            y_label: "share per µm".to_owned(),
            x_range: (-1.0, 1.0),
            y_range: (0.0, 1.0),
            series: vec![Series {
                label: Some("550 nm".to_owned()),
                color: "#00aa00".to_owned(),
                points,
                is_dashed: false,
            }],
            legend: Corner::TopRight,
            scale: Scale::Linear,
        }
    }

    /// Where the name of the line stands, px.
    fn legend_place(svg: &str) -> (f64, f64) {
        let line = svg.lines().find(|line| line.contains(">550 nm<")).unwrap();
        let number = |key: &str| {
            let start = line.find(key).unwrap() + key.len();
            line[start..].split('"').next().unwrap().parse().unwrap()
        };
        (number(" x=\""), number(" y=\""))
    }

    #[test]
    fn a_chart_holds_its_words() {
        let chart = chart(vec![(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)]);
        let svg = chart_svg(&chart, 480.0, 320.0);
        for word in ["<svg", "Line spread", "550 nm", "#00aa00", ">-1.0<", ">1.0<"] {
            assert!(svg.contains(word), "{word}");
        }
        let csv = chart.to_csv();
        assert!(csv.starts_with("line,style,\"x, µm\",\"share per µm\"\n\"550 nm\",solid,-1,0\n"), "{csv}");
    }

    #[test]
    fn a_legend_leaves_lines_uncovered() {
        let place = |points| legend_place(&chart_svg(&chart(points), 480.0, 320.0));
        let free = place(vec![(-1.0, 0.5), (1.0, 0.5)]);
        assert!(free.0 > 300.0 && free.1 < 80.0, "{free:?}");
        let below = place(vec![(-1.0, 1.0), (1.0, 0.99)]);
        assert!(below.1 > 200.0, "{below:?}");
        // A line through every corner drives it out of the frame.
        let outside = place(vec![(-1.0, 0.02), (-0.98, 0.98), (0.98, 0.98), (0.98, 0.02), (-1.0, 0.02)]);
        assert!(outside.1 < 50.0, "{outside:?}");
    }

    #[test]
    fn a_segment_meets_what_it_passes() {
        let square = [0.0, 0.0, 1.0, 1.0];
        for (from, to, meets) in [
            ((-1.0, 0.5), (2.0, 0.5), true),
            ((0.2, 0.2), (0.3, 0.3), true),
            ((-1.0, 1.5), (1.5, -1.0), true),
            ((-1.0, 1.5), (0.4, 1.6), false),
            ((1.1, -1.0), (1.1, 2.0), false),
            ((f64::NAN, 0.5), (0.5, 0.5), false),
        ] {
            assert_eq!(segment_meets(from, to, square), meets, "{from:?} {to:?}");
        }
    }

    #[test]
    fn the_last_number_is_inside() {
        let wide = LineChart { x_range: (0.0, 100_000.0), ..chart(vec![(0.0, 0.0), (100_000.0, 1.0)]) };
        let svg = chart_svg(&wide, 480.0, 320.0);
        let line = svg.lines().find(|line| line.contains(">100000<")).unwrap();
        let x: f64 = line.split('"').nth(1).unwrap().parse().unwrap();
        assert!(x + 0.5 * super::wide("100000") < 480.0, "{x}");
    }
}
