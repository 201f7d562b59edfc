//! The page of two lenses side by side.

use dioptric_analysis::{LensComparison, LineChart};
use dioptric_pipeline::PipelineError;

use super::LensPage;
use crate::{
    page::{self, note, section},
    panel::escaped,
};

/// Two lenses, their comparison and what else is shown of each.
#[derive(Clone, Copy, Debug)]
pub struct LensComparisonPage<'a> {
    /// The numbers and curves of both.
    pub comparison: &'a LensComparison,
    /// The page of each.
    pub pages: [LensPage<'a>; 2],
}

impl LensComparisonPage<'_> {
    /// Returns the self-contained page: drawings, numbers, curves of both in one plot, modulations and spots side by side.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength.
    pub fn html(&self) -> Result<String, PipelineError> {
        let [first, second] = &self.comparison.lenses;
        let mut body = String::new();
        for (page, name) in self.pages.iter().zip([first, second]) {
            body += &section(&escaped(name), &(page.drawing()? + &note(page.shown.lens.source())));
        }
        body += &section("Numbers", &self.numbers());
        let words = format!(
            "Solid: {first}; dashed: {second}. The second lens is looked at in the fields and colors of the first."
        );
        let curves = page::charts(self.comparison.charts.iter().map(|(_, chart)| chart));
        body += &section("Curves of both", &(curves + &note(&words)));
        let modulations = self.pages.map(|page| page.shown.modulation.as_ref().ok());
        if let [Some(one), Some(other)] = modulations {
            let pairs = one.charts().into_iter().zip(other.charts()).map(|((_, one), (_, other))| (one, other));
            let named = |chart: &LineChart, name: &str| LineChart {
                title: format!("{name}: {}", chart.title),
                ..chart.clone()
            };
            let charts: Vec<LineChart> = pairs
                .flat_map(|(one, other)| {
                    let reach = one.x_range.1.max(other.x_range.1);
                    let wide = |chart: LineChart| LineChart {
                        x_range: (chart.x_range.0, reach.max(chart.x_range.1)),
                        ..chart
                    };
                    [wide(named(one, first)), wide(named(other, second))]
                })
                .collect();
            body += &section("Modulation", &page::charts(&charts));
        }
        for (page, name) in self.pages.iter().zip([first, second]) {
            body += &section(&format!("Spot diagrams of {}", escaped(name)), &page.plots.spots_svg());
        }
        Ok(page::page(&format!("{first} and {second}"), "two lenses at the same fields and wavelengths", &body))
    }

    fn numbers(&self) -> String {
        let cell = |value: &Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
        let row = |row: &dioptric_analysis::ComparisonRow| {
            let values: String =
                row.values.iter().map(|value| format!("<td class=\"n\">{}</td>", cell(value))).collect();
            format!("<tr><td class=\"w\">{}</td>{values}</tr>\n", escaped(&row.quantity))
        };
        let rows: String = self.comparison.rows.iter().map(row).collect();
        let heads: String =
            self.comparison.lenses.iter().map(|name| format!("<th class=\"n\">{}</th>", escaped(name))).collect();
        format!("<table>\n<tr><th></th>{heads}</tr>\n{rows}</table>\n")
    }
}
