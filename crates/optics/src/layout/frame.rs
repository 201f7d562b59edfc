//! The sheet that a lens is drawn on: its scale, and what is written at its foot.

use std::fmt::Write;

use glam::DVec2;

use super::{FIELD_COLORS, Fan, Layout, WavelengthKey, extent_z_mm};
use crate::Lens;

/// Margin around the drawing, px.
const MARGIN_PX: f64 = 28.0;
/// Room for the words below the drawing, px.
const FOOT_PX: f64 = 34.0;
/// Width of a letter of the words below, px, about.
const LETTER_PX: f64 = 7.3;

/// The drawing's scale and bounds.
pub(super) struct Frame {
    z_min_mm: f64,
    pub(super) y_min_mm: f64,
    pub(super) y_max_mm: f64,
    pub(super) px_per_mm: f64,
    width_px: f64,
    height_px: f64,
}

impl Frame {
    pub(super) fn around(lens: &Lens, layout: &Layout, fans: &[Fan]) -> Self {
        let points = || fans.iter().flat_map(|fan| &fan.lines).flat_map(|line| &line.points);
        let [front_mm, back_mm] = extent_z_mm(lens, layout);
        let z_min_mm = points().map(|p| p.x).fold(front_mm, f64::min);
        let z_max_mm = points().map(|p| p.x).fold(back_mm, f64::max);
        let rims = lens.interfaces().iter().map(|interface| interface.surface.semi_aperture_mm);
        let rim_mm = 1.15 * rims.fold(0.0, f64::max);
        let y_min_mm = points().map(|p| p.y).fold(-rim_mm, f64::min);
        let y_max_mm = points().map(|p| p.y).fold(rim_mm, f64::max);
        let px_per_mm = (layout.width_px - 2.0 * MARGIN_PX) / (z_max_mm - z_min_mm).max(1e-9);
        let height_px = 2.0 * MARGIN_PX + (y_max_mm - y_min_mm) * px_per_mm + FOOT_PX;
        Self { z_min_mm, y_min_mm, y_max_mm, px_per_mm, width_px: layout.width_px, height_px }
    }

    pub(super) fn x(&self, z_mm: f64) -> f64 {
        MARGIN_PX + (z_mm - self.z_min_mm) * self.px_per_mm
    }

    pub(super) fn y(&self, y_mm: f64) -> f64 {
        MARGIN_PX + (self.y_max_mm - y_mm) * self.px_per_mm
    }

    /// The upper right corner of the room for drawings, px.
    pub(super) fn corner_px(&self) -> DVec2 {
        DVec2::new(self.width_px - MARGIN_PX, MARGIN_PX)
    }

    pub(super) fn open(&self, name: &str) -> String {
        let (w, h) = (self.width_px, self.height_px);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w:.0}\" height=\"{h:.0}\" viewBox=\"0 0 {w:.0} {h:.0}\" \
             font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\">\n<title>{}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
            escaped(name)
        )
    }

    pub(super) fn axis(&self, svg: &mut String) {
        let y = self.y(0.0);
        let _ = writeln!(
            svg,
            "<line x1=\"{:.2}\" y1=\"{y:.2}\" x2=\"{:.2}\" y2=\"{y:.2}\" stroke=\"#888\" stroke-width=\"0.7\" \
             stroke-dasharray=\"12 3 2 3\"/>",
            0.3 * MARGIN_PX,
            self.width_px - 0.3 * MARGIN_PX
        );
    }

    pub(super) fn path(&self, points: impl IntoIterator<Item = DVec2>) -> String {
        let mut path = String::new();
        for (i, p) in points.into_iter().enumerate() {
            let _ = write!(path, "{}{:.2} {:.2}", if i == 0 { "M" } else { " L" }, self.x(p.x), self.y(p.y));
        }
        path
    }

    pub(super) fn rays(&self, fan: &Fan, svg: &mut String) {
        for (reaches_film, opacity) in [(true, 0.85), (false, 0.3)] {
            let lines = fan.lines.iter().filter(|line| line.reaches_film == reaches_film);
            let path: Vec<String> = lines.map(|line| self.path(line.points.iter().copied())).collect();
            if !path.is_empty() {
                let _ = writeln!(
                    svg,
                    "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"0.9\" \
                     stroke-opacity=\"{opacity}\" stroke-dasharray=\"{}\"/>",
                    path.join(" "),
                    fan.color,
                    fan.dashes
                );
            }
        }
    }

    /// Writes the words below the drawing, and the scale bar.
    pub(super) fn foot(&self, words: &str, svg: &mut String) {
        let y = self.height_px - 0.6 * FOOT_PX;
        let _ =
            writeln!(svg, "<text x=\"{MARGIN_PX:.1}\" y=\"{:.1}\" fill=\"#222\">{}</text>", y + 5.0, escaped(words));
        let length_mm = round_length_mm(0.16 * self.width_px / self.px_per_mm);
        let (x1, length_px) = (self.width_px - MARGIN_PX, length_mm * self.px_per_mm);
        let _ = writeln!(
            svg,
            "<path d=\"M{:.2} {:.1} v6 h{length_px:.2} v-6\" fill=\"none\" stroke=\"#222\"/>\n\
             <text x=\"{:.2}\" y=\"{:.1}\" fill=\"#222\" text-anchor=\"middle\">{length_mm} mm</text>",
            x1 - length_px,
            y - 8.0,
            x1 - 0.5 * length_px,
            y + 13.0
        );
    }

    /// Writes what colors and dashes mean, behind these words.
    pub(super) fn keys(&self, words: &str, layout: &Layout, fans: &[Fan], svg: &mut String) {
        let (mut x, y) =
            (MARGIN_PX + LETTER_PX * (words.chars().count() + 4) as f64, self.height_px - 0.6 * FOOT_PX + 5.0);
        if layout.fields_deg.len() > 1 {
            for (i, field_deg) in layout.fields_deg.iter().enumerate() {
                let color = FIELD_COLORS[i % FIELD_COLORS.len()];
                let dark = if fans.iter().any(|fan| fan.field == i) { "" } else { " dark" };
                let text = format!("{field_deg:.1}°{dark}");
                let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{color}\">{text}</text>");
                x += 16.0 + LETTER_PX * text.chars().count() as f64;
            }
            x += 16.0;
        }
        if layout.wavelengths_nm.len() < 2 {
            return;
        }
        for WavelengthKey { wavelength_nm, color, dashes } in layout.wavelength_keys() {
            let color = color.as_deref().unwrap_or("#222");
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {:.1} h30\" stroke=\"{color}\" stroke-width=\"1.4\" stroke-dasharray=\"{dashes}\"/>\n\
                 <text x=\"{:.1}\" y=\"{y:.1}\" fill=\"{color}\">{wavelength_nm:.0} nm</text>",
                y - 4.5,
                x + 35.0
            );
            x += 100.0;
        }
    }

    /// Writes a small word.
    pub(super) fn label(&self, (x, y): (f64, f64), anchor: &str, word: &str, svg: &mut String) {
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"#444\" font-size=\"11\" text-anchor=\"{anchor}\">{word}</text>"
        );
    }
}

/// Returns the longest of 1, 2 or 5 times a power of ten that is at most this long.
fn round_length_mm(longest_mm: f64) -> f64 {
    let power = 10_f64.powf(longest_mm.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|&length| length <= longest_mm).unwrap_or(power)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bar_has_a_round_length() {
        assert_eq!([0.7, 2.0, 19.0, 51.0].map(round_length_mm), [0.5, 2.0, 10.0, 50.0]);
    }
}
