//! Pages for a browser: one style, and what they are made of.

use base64::{Engine, engine::general_purpose::STANDARD};
use dioptric_analysis::LineChart;

use crate::{chart_svg, panel::escaped};

const STYLE: &str = include_str!("page.css");
/// What its drawings can do where scripts run; without, they are all there too.
const SCRIPT: &str = include_str!("page.js");
/// Size of a chart, px: two stand side by side in a window of 1280.
const CHART_PX: (f64, f64) = (560.0, 360.0);
/// The largest drawing that a printed page of A4 holds beside its title, px.
const PRINTED_PX: [f64; 2] = [710.0, 850.0];

/// Returns a self-contained page; `body` is HTML, name and source are text.
pub(crate) fn page(name: &str, source: &str, body: &str) -> String {
    let (name, source) = (escaped(name), escaped(source));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name} – dioptric</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header>\n<h1>{name}</h1>\n<p>{source}</p>\n</header>\n<main>\n{body}</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

pub(crate) fn section(title: &str, inside: &str) -> String {
    let class = if holds_large_drawing(inside) { " class=\"large\"" } else { "" };
    format!("<section{class}>\n<h2>{title}</h2>\n{inside}</section>\n")
}

/// Whether a drawing is there that would be shrunk on a printed page.
fn holds_large_drawing(inside: &str) -> bool {
    let px = |head: &str, key: &str| -> Option<f64> { head.split_once(key)?.1.split_once('"')?.0.parse().ok() };
    inside.split("<svg xmlns=").skip(1).any(|drawing| {
        let head = drawing.split('>').next().unwrap_or_default();
        let sides = [" width=\"", " height=\""].map(|key| px(head, key).unwrap_or(0.0));
        sides.iter().zip(PRINTED_PX).any(|(side, most)| *side > most)
    })
}

pub(crate) fn note(words: &str) -> String {
    if words.is_empty() { String::new() } else { format!("<p class=\"note\">{}</p>\n", escaped(words)) }
}

/// Returns charts two by two, or one under the other where the window is narrow.
pub(crate) fn charts<'a>(charts: impl IntoIterator<Item = &'a LineChart>) -> String {
    let card = |chart: &LineChart| {
        let (svg, csv) = (chart_svg(chart, CHART_PX.0, CHART_PX.1), escaped(&chart.to_csv()));
        format!("<div>\n{svg}<template>{csv}</template>\n</div>\n")
    };
    let drawn: String = charts.into_iter().map(card).collect();
    format!("<div class=\"charts\">\n{drawn}</div>\n")
}

/// Returns lines of text as they are.
pub(crate) fn lines(text: &str) -> String {
    format!("<pre>{}</pre>\n", escaped(text))
}

/// Returns a PNG picture as a part of the page.
pub(crate) fn picture(png: &[u8], alt: &str) -> String {
    format!("<img src=\"data:image/png;base64,{}\" alt=\"{}\">\n", STANDARD.encode(png), escaped(alt))
}
