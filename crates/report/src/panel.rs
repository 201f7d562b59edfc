//! Small plots for sheets of many, as SVG: frame, ticks, lines and dots.

use std::fmt::Write;

use crate::{axis::ticks, lettering::FONT};

/// Room left of, above, right of and below the frame of a plot, px.
const ROOM_PX: [f64; 4] = [48.0, 22.0, 14.0, 34.0];

/// A small plot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    pub(crate) x_range: (f64, f64),
    pub(crate) y_range: (f64, f64),
    /// Widens the range of x about its middle until both axes have one scale.
    pub(crate) is_to_scale: bool,
    pub(crate) marks: Vec<Mark>,
}

/// What is drawn in a plot.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    pub(crate) color: String,
    pub(crate) kind: MarkKind,
    /// Places; a line is broken at those that are not finite.
    pub(crate) points: Vec<(f64, f64)>,
}

/// How places are marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MarkKind {
    Line,
    Dashed,
    Dots,
    /// Filled rectangles of this width and height about the places.
    Cells([f64; 2]),
    /// Filled rectangles between each two places, its lower left and its upper right corner.
    Boxes,
}

/// A sheet that plots are put on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sheet {
    /// What it shows, for those who cannot see it.
    pub(crate) title: String,
    body: String,
}

impl Sheet {
    /// Writes words; `weight` is CSS's.
    pub(crate) fn text(&mut self, (x, y): (f64, f64), size: f64, (color, weight): (&str, &str), words: &str) {
        let words = escaped(words);
        let _ = writeln!(
            self.body,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" fill=\"{color}\" font-weight=\"{weight}\">{words}</text>"
        );
    }

    /// Draws a plot into the rectangle at x, y of this width and height, px.
    pub(crate) fn panel(&mut self, panel: &Panel, rectangle: [f64; 4]) {
        panel.draw(rectangle, &mut self.body);
    }

    /// Returns the sheet as an SVG document of this size, px.
    pub(crate) fn to_svg(&self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"{FONT}\">\n\
             <title>{}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{}</svg>\n",
            escaped(&self.title),
            self.body
        )
    }
}

impl Panel {
    fn draw(&self, [x, y, width, height]: [f64; 4], svg: &mut String) {
        let [left, top, right, bottom] = ROOM_PX;
        let (w, h) = (width - left - right, height - top - bottom);
        let y_range = self.y_range;
        let x_range = if self.is_to_scale {
            let (middle, half) = (0.5 * (self.x_range.0 + self.x_range.1), 0.5 * (y_range.1 - y_range.0) * w / h);
            (middle - half, middle + half)
        } else {
            self.x_range
        };
        let across = |value: f64| w * (value - x_range.0) / (x_range.1 - x_range.0);
        let down = |value: f64| h * (y_range.1 - value) / (y_range.1 - y_range.0);
        let _ = writeln!(
            svg,
            "<svg x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" font-size=\"11\">"
        );
        let mut text = |x: f64, y: f64, anchor: &str, more: &str, words: &str| {
            let words = escaped(words);
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"#333\" {more}>{words}</text>"
            );
        };
        text(left + 0.5 * w, top - 7.0, "middle", "font-size=\"12\" font-weight=\"bold\"", &self.title);
        text(left + 0.5 * w, top + h + 28.0, "middle", "", &self.x_label);
        let turn = format!("transform=\"rotate(-90 11 {:.1})\"", top + 0.5 * h);
        text(11.0, top + 0.5 * h, "middle", &turn, &self.y_label);
        let mut grid = String::new();
        for (value, word) in ticks(x_range, w) {
            text(left + across(value), top + h + 13.0, "middle", "", &word);
            let _ = write!(grid, "M{:.1} 0V{h:.1}", across(value));
        }
        for (value, word) in ticks(y_range, h) {
            text(left - 4.0, top + down(value) + 3.5, "end", "", &word);
            let _ = write!(grid, "M0 {:.1}H{w:.1}", down(value));
        }
        // A nested drawing cuts off what lies outside the frame.
        let _ = writeln!(
            svg,
            "<svg x=\"{left:.1}\" y=\"{top:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" {}>\n\
             <path d=\"{grid}\" stroke=\"#e4e4e4\" stroke-width=\"0.7\"/>",
            axes_of((x_range, y_range), [&self.title, &self.x_label, &self.y_label])
        );
        let mut axes = String::new();
        if x_range.0 < 0.0 && x_range.1 > 0.0 {
            let _ = write!(axes, "M{:.1} 0V{h:.1}", across(0.0));
        }
        if y_range.0 < 0.0 && y_range.1 > 0.0 {
            let _ = write!(axes, "M0 {:.1}H{w:.1}", down(0.0));
        }
        let _ = writeln!(svg, "<path d=\"{axes}\" stroke=\"#aaaaaa\" stroke-width=\"0.8\"/>");
        for mark in &self.marks {
            mark.draw(&across, &down, svg);
        }
        let _ = writeln!(
            svg,
            "</svg>\n<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"none\" \
             stroke=\"#777\" stroke-width=\"0.8\"/>\n</svg>"
        );
    }
}

impl Mark {
    pub(crate) fn draw(&self, across: &dyn Fn(f64) -> f64, down: &dyn Fn(f64) -> f64, svg: &mut String) {
        match self.kind {
            MarkKind::Cells([width, height]) => {
                let corners = |&(x, y): &(f64, f64)| [-0.5, 0.5].map(|side| (x + side * width, y + side * height));
                return self.fill(&self.points.iter().flat_map(corners).collect::<Vec<_>>(), across, down, svg);
            }
            MarkKind::Boxes => return self.fill(&self.points, across, down, svg),
            _ => {}
        }
        let mut path = String::new();
        let mut is_open = false;
        for &(x, y) in &self.points {
            let (x, y) = (across(x), down(y));
            if !(x.is_finite() && y.is_finite()) {
                is_open = false;
                continue;
            }
            let letter = if is_open && self.kind != MarkKind::Dots { 'L' } else { 'M' };
            let _ = write!(path, "{letter}{x:.2} {y:.2}");
            if self.kind == MarkKind::Dots {
                path.push_str("h.01");
            }
            is_open = true;
        }
        let style = match self.kind {
            MarkKind::Line => "stroke-width=\"1.5\" stroke-linejoin=\"round\"",
            MarkKind::Dashed => "stroke-width=\"1.5\" stroke-dasharray=\"5 3\"",
            MarkKind::Cells(_) | MarkKind::Boxes | MarkKind::Dots => {
                "stroke-width=\"1.7\" stroke-linecap=\"round\" stroke-opacity=\"0.75\""
            }
        };
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" {style}/>", self.color);
    }

    /// Fills the rectangles between these corners, two each.
    fn fill(&self, corners: &[(f64, f64)], across: &dyn Fn(f64) -> f64, down: &dyn Fn(f64) -> f64, svg: &mut String) {
        let mut path = String::new();
        for pair in corners.chunks_exact(2).filter(|pair| pair.iter().all(|(x, y)| x.is_finite() && y.is_finite())) {
            let [left, right] = [pair[0].0, pair[1].0].map(across);
            let [top, bottom] = [pair[1].1, pair[0].1].map(down);
            let _ = write!(path, "M{left:.1} {top:.1}H{right:.1}V{bottom:.1}H{left:.1}Z");
        }
        // Without smoothed edges, which would leave seams between neighbors.
        let color = &self.color;
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"{color}\" shape-rendering=\"crispEdges\"/>");
    }
}

/// Returns what a page's script knows of a plot: the ranges of its axes, its title and their labels.
pub(crate) fn axes_of((x, y): ((f64, f64), (f64, f64)), words: [&str; 3]) -> String {
    let [title, x_label, y_label] = words.map(escaped);
    format!(
        "data-x=\"{} {}\" data-y=\"{} {}\" data-title=\"{title}\" data-x-label=\"{x_label}\" data-y-label=\"{y_label}\"",
        x.0, x.1, y.0, y.1
    )
}

pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_meet_without_gaps() {
        let kind = MarkKind::Cells([0.5, 1.0]);
        let marks = vec![Mark { color: "#123456".to_owned(), kind, points: vec![(0.25, 0.5), (0.75, 0.5)] }];
        let panel = Panel { x_range: (0.0, 1.0), y_range: (0.0, 1.0), marks, ..Panel::default() };
        let mut sheet = Sheet::default();
        sheet.panel(&panel, [0.0, 0.0, 162.0, 156.0]);
        let svg = sheet.to_svg(200.0, 200.0);
        assert!(svg.contains("M0.0 0.0H50.0V100.0H0.0ZM50.0 0.0H100.0V100.0H50.0Z"), "{svg}");
    }

    #[test]
    fn lines_break_where_values_are_missing() {
        let mark = |kind| Mark {
            color: "#123456".to_owned(),
            kind,
            points: vec![(0.0, 0.0), (1.0, 1.0), (f64::NAN, 0.5), (0.5, 1.0)],
        };
        let panel =
            |kind| Panel { x_range: (0.0, 1.0), y_range: (0.0, 1.0), marks: vec![mark(kind)], ..Panel::default() };
        let draw = |kind| {
            let mut sheet = Sheet::default();
            sheet.panel(&panel(kind), [0.0, 0.0, 162.0, 156.0]);
            sheet.to_svg(200.0, 200.0)
        };
        assert!(draw(MarkKind::Line).contains("\"M0.00 100.00L100.00 0.00M50.00 0.00\""));
        assert!(draw(MarkKind::Dots).contains("M0.00 100.00h.01M100.00 0.00h.01M50.00 0.00h.01"));
        let svg = draw(MarkKind::Dashed);
        assert!(svg.contains("stroke-dasharray") && !svg.contains("NaN"));
    }
}
