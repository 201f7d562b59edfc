//! The page of an analysis for a browser.

use super::AnalysisPlots;

impl AnalysisPlots<'_> {
    /// Returns a self-contained page with all plots, and with these tables as text.
    pub fn html(&self, tables: &str) -> String {
        let plots = [
            ("Spots, fans and curves over field", self.page_svg()),
            ("Spot diagrams", self.spots_svg()),
            ("Optical path differences", self.opd_svg()),
            ("Distortion", self.grid_svg()),
        ];
        let section = |(title, svg): &(&str, String)| format!("<section><h2>{title}</h2>\n{svg}</section>\n");
        let plots: String = plots.iter().map(section).collect();
        let (name, tables) = (escaped(&self.0.lens), escaped(tables));
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name} – dioptric</title>\n\
             <style>body {{ margin: 0 auto; max-width: 1440px; padding: 20px; background: #f3f5f8; color: #1d2330; \
             font: 15px/1.5 system-ui, \"DejaVu Sans\", sans-serif; }} section {{ background: #fff; \
             border: 1px solid #dfe3ea; border-radius: 10px; padding: 18px 22px; margin-bottom: 20px; overflow-x: auto; }} \
             h2 {{ margin: 0 0 12px; font-size: 17px; }} svg {{ max-width: 100%; height: auto; }} \
             pre {{ font: 13px/1.45 \"DejaVu Sans Mono\", monospace; margin: 0; }}</style>\n</head>\n<body>\n\
             <h1>{name}</h1>\n<section><h2>Numbers</h2>\n<pre>{tables}</pre></section>\n{plots}</body>\n</html>\n"
        )
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
