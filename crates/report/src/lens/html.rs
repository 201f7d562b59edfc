//! The page of an analysis for a browser.

use dioptric_analysis::{LensData, LensPageData, WavefrontRow, placement_lines, surface_rows};
use dioptric_optics::{Layout, SeidelSums};
use dioptric_pipeline::PipelineError;

use super::{AnalysisPlots, LensDrawing, glass_map::glass_map_svg};
use crate::{
    page::{self, note, section},
    panel::escaped,
};

/// All that the page of a lens shows.
#[derive(Clone, Copy, Debug)]
pub struct LensPage<'a> {
    /// The analysis, and its plots.
    pub plots: AnalysisPlots<'a>,
    /// What else is shown of the lens.
    pub shown: &'a LensPageData,
    /// The numbers of the analysis as text.
    pub tables: &'a str,
}

impl LensPage<'_> {
    /// Returns the self-contained page: prescription, drawing, first-order data, modulation, spots, fans, path differences,
    /// distortion, glasses, and the numbers as text.
    ///
    /// # Errors
    /// When a glass is not known at a wavelength.
    pub fn html(&self) -> Result<String, PipelineError> {
        let analysis = self.plots.0;
        let mut body = section("Lens", &(self.drawing()? + &note(&analysis.notes.join(" · "))));
        body += &section("Prescription", &self.prescription());
        body += &section("First order", &self.first_order());
        body += &section("Third order", &self.third_order());
        if let Ok(modulation) = &self.shown.modulation {
            let charts = page::charts(modulation.charts().map(|(_, chart)| chart));
            let words = "Tangential (solid): lines across the plane of axis and field, a wave along the radius. Sagittal \
                         (dashed): lines along it. By the waves of all wavelengths together; where the blur is too large for \
                         that, by HURB. Geometric: by rays alone, which leave more than the diffraction limit where a lens is good.";
            body += &section("Modulation", &(charts + &note(words)));
        }
        let curves = page::charts(self.shown.curves.0.iter().map(|(_, chart)| chart));
        body += &section("Focus, spots and light over wavelength, field and film", &curves);
        body += &section("Aberrations of each surface", &self.surface_sums());
        body += &section("Zernike coefficients", &self.zernike());
        let fans = "Tangential rays and curves are those in the plane of axis and field (along y), sagittal ones across it \
                    (along x): solid and dashed where they share a plot. Each spot has its own scale; the gray circle is Airy's \
                    first zero.";
        body += &section("Spots, fans and curves over field", &(self.plots.page_svg() + &note(fans)));
        let beams =
            "Edges of the light of each field, in the frame of the surface; dashed: rims, openings and obscurations.";
        body += &section("Footprints", &(self.plots.footprints_svg(&self.shown.footprints) + &note(beams)));
        body += &section("Spot diagrams", &self.plots.spots_svg());
        body += &section("Spots through focus", &self.plots.focus_spots_svg(&self.shown.focus_spots));
        body += &section("Optical path differences", &self.plots.opd_svg());
        body += &section("Distortion", &self.plots.grid_svg());
        if let Some(map) = glass_map_svg(&self.shown.lens) {
            body += &section("Glasses", &(map + &note("Numbers in brackets: the surfaces that a glass lies behind.")));
        }
        body += &section("Numbers", &page::lines(self.tables));
        Ok(page::page(&analysis.lens, self.shown.lens.source(), &body))
    }

    /// Draws the lens with the rays of the fields, as far as a drawing shows them.
    pub(super) fn drawing(&self) -> Result<String, PipelineError> {
        let analysis = self.plots.0;
        let steepest_deg = if analysis.distance_mm.is_finite() { 89.0 } else { *Layout::WIDEST_FIELDS_DEG.end() };
        let mut fields_deg: Vec<f64> = analysis.fields.iter().map(|row| row.place.field_xy_deg[1]).collect();
        fields_deg.retain(|field_deg| field_deg.abs() < steepest_deg);
        fields_deg.sort_by(f64::total_cmp);
        fields_deg.dedup();
        let drawing = LensDrawing {
            fields_deg,
            distance_mm: analysis.distance_mm,
            wavelengths_nm: vec![analysis.reference_nm],
            film_distance_mm: analysis.film_distance_mm,
            film_label: format!("film: {}", analysis.film),
        };
        drawing.to_svg(&self.shown.lens)
    }

    fn prescription(&self) -> String {
        let mm = |value: f64| if value.is_finite() { format!("{value:.4}") } else { "∞".to_owned() };
        let row = |row: dioptric_analysis::SurfaceRow| {
            let stop = if row.is_stop { "stop".to_owned() } else { String::new() };
            let comment = self.shown.surface_comments.get(row.surface).filter(|comment| !comment.is_empty()).cloned();
            let remarks: Vec<String> =
                comment.into_iter().chain([stop].into_iter().filter(|s| !s.is_empty())).chain(row.remarks).collect();
            let cells = [mm(row.radius_mm), mm(row.thickness_mm), mm(row.diameter_mm)];
            let cells: String = cells.iter().map(|cell| format!("<td class=\"n\">{cell}</td>")).collect();
            format!(
                "<tr><td>{}</td>{cells}<td class=\"w\">{}</td><td class=\"w\">{}</td></tr>\n",
                row.surface,
                escaped(&row.medium_after),
                escaped(&remarks.join("; "))
            )
        };
        let rows: String = surface_rows(&self.shown.lens).into_iter().map(row).collect();
        let moves: String = placement_lines(&self.shown.lens).iter().map(|line| note(line)).collect();
        format!(
            "<table>\n<tr><th>surface</th><th class=\"n\">radius mm</th><th class=\"n\">distance mm</th>\
             <th class=\"n\">diameter mm</th><th class=\"w\">medium behind</th><th class=\"w\"></th></tr>\n{rows}</table>\n{moves}"
        )
    }

    fn first_order(&self) -> String {
        let row = |(name, of): &Quantity| self.quantity(name, *of, |v| format!("{v:.4}"));
        let quantities: [Quantity; 19] = [
            ("focal length, mm", |d| Some(d.first_order.efl_mm)),
            ("back focal length, mm", |d| Some(d.first_order.bfl_mm)),
            ("front focal length, mm", |d| Some(d.first_order.ffl_mm)),
            ("front principal plane, mm behind the first vertex", |d| Some(d.first_order.front_principal_mm)),
            ("rear principal plane, mm behind the last vertex", |d| Some(d.first_order.rear_principal_mm)),
            ("entrance pupil, mm behind the first vertex", |d| Some(d.first_order.entrance_pupil_z_mm)),
            ("its diameter, mm", |d| Some(d.first_order.entrance_pupil_diameter_mm)),
            ("exit pupil, mm behind the last vertex", |d| Some(d.first_order.exit_pupil_z_mm)),
            ("its diameter, mm", |d| Some(d.first_order.exit_pupil_diameter_mm)),
            ("f-number", |d| Some(d.first_order.f_number)),
            ("f-number of the real beam", |d| d.real_f_number),
            ("share of the light that gets through", |d| d.transmission),
            ("T-number", |d| d.t_number),
            ("magnification", |d| d.image.map(|image| image.magnification)),
            ("working f-number", |d| d.image.map(|image| image.working_f_number)),
            ("Petzval radius, mm", |d| d.petzval_radius_mm),
            ("field where the light falls to half, °", |d| d.half_light_field_deg),
            ("field where it ends, °", |d| d.last_light_field_deg),
            ("pupil magnification", |d| Some(d.pupil_magnification)),
        ];
        self.by_wavelength(&quantities.iter().map(row).collect::<String>())
    }

    /// The Seidel sums of the whole lens, or why there are none.
    fn third_order(&self) -> String {
        let quantities: [Quantity; 7] = [
            ("S1 (spherical aberration), mm", |d| d.seidel.map(|sums| sums.s1)),
            ("S2 (coma), mm", |d| d.seidel.map(|sums| sums.s2)),
            ("S3 (astigmatism), mm", |d| d.seidel.map(|sums| sums.s3)),
            ("S4 (Petzval curvature), mm", |d| d.seidel.map(|sums| sums.s4)),
            ("S5 (distortion), mm", |d| d.seidel.map(|sums| sums.s5)),
            ("C1 (axial color), mm", |d| d.seidel.map(|sums| sums.c1).filter(|c1| c1.is_finite())),
            ("C2 (lateral color), mm", |d| d.seidel.map(|sums| sums.c2).filter(|c2| c2.is_finite())),
        ];
        let row = |(name, of): &Quantity| self.quantity(name, *of, |v| format!("{v:.4e}"));
        let rows: String = quantities.iter().map(row).collect();
        let Some(data) = self.shown.data.first().filter(|_| !rows.is_empty()) else {
            let why = LensData::note_on_third_order(&self.shown.lens);
            return note(&why.unwrap_or_else(|| "Third-order sums are left out.".to_owned()));
        };
        let color = data
            .seidel_colors_nm
            .map_or(String::new(), |[short, long]| format!(" Color from {short:.1} to {long:.1} nm."));
        let words = format!(
            "Seidel sums of the full aperture and a field of {:.2}°, in Welford's signs: a positive S1 is undercorrected.{color}",
            self.shown.sums_field_deg
        );
        self.by_wavelength(&rows) + &note(&words)
    }

    /// The Seidel sums of each surface at the reference wavelength, in waves of the wavefront at the edge of pupil and field.
    fn surface_sums(&self) -> String {
        let reference_nm = self.plots.0.reference_nm;
        let data = self.shown.data.iter().find(|data| data.first_order.wavelength_nm == reference_nm);
        let Some((data, total)) = data.and_then(|data| Some((data, data.seidel?))) else { return self.third_order() };
        // W040, W131, W222, W220 of Petzval's part, W311, W020 and W111 of color (Welford 1986, 8.2).
        let waves = |sums: &SeidelSums| {
            let per_mm = 1.0 / (reference_nm * 1e-6);
            [sums.s1 / 8.0, sums.s2 / 2.0, sums.s3 / 2.0, sums.s4 / 4.0, sums.s5 / 2.0, sums.c1 / 2.0, sums.c2]
                .map(|mm| mm * per_mm)
        };
        let all: Vec<[f64; 7]> = data.seidel_surfaces.iter().map(waves).collect();
        let largest: Vec<f64> = (0..7).map(|i| all.iter().map(|row| row[i].abs()).fold(0.0, f64::max)).collect();
        let cell = |value: f64, largest: f64| {
            if !value.is_finite() {
                return "<td class=\"n\">–</td>".to_owned();
            }
            let width = if largest > 0.0 { 3.0 * (value / largest).abs() } else { 0.0 };
            let color = if value < 0.0 { "#d55e00" } else { "#0072b2" };
            format!(
                "<td class=\"n\">{:.3}<br><span style=\"display:inline-block;height:.3em;width:{width:.2}em;background:{color}\"></span></td>",
                value + 0.0
            )
        };
        let row = |(surface, values): (usize, &[f64; 7])| {
            let cells: String = values.iter().zip(&largest).map(|(value, largest)| cell(*value, *largest)).collect();
            format!("<tr><td>{surface}</td>{cells}</tr>\n")
        };
        let rows: String = all.iter().enumerate().map(row).collect();
        let sums: String = waves(&total).map(|value| cell(value, 0.0)).concat();
        let words = format!(
            "Third-order wavefront aberrations at the edge of pupil and field ({:.2}°), waves of {reference_nm:.1} nm, in Welford's signs: \
             W040 = S1/8, W131 = S2/2, W222 = S3/2, W220 = S4/4 (Petzval's), W311 = S5/2, and color W020 = C1/2, W111 = C2{}.",
            self.shown.sums_field_deg,
            data.seidel_colors_nm.map_or(String::new(), |[short, long]| format!(" from {short:.1} to {long:.1} nm"))
        );
        format!(
            "<table>\n<tr><th>surface</th><th class=\"n\">W040</th><th class=\"n\">W131</th><th class=\"n\">W222</th>\
             <th class=\"n\">W220</th><th class=\"n\">W311</th><th class=\"n\">W020</th><th class=\"n\">W111</th></tr>\n{rows}\
             <tr><td>sum</td>{sums}</tr>\n</table>\n{}",
            note(&words)
        )
    }

    /// The coefficients of the wavefronts of the reference wavelength, a column a field.
    fn zernike(&self) -> String {
        let analysis = self.plots.0;
        let spots: Vec<_> = analysis
            .spots
            .iter()
            .filter(|spot| spot.wavelength_nm == analysis.reference_nm)
            .filter_map(|spot| Some((spot.place.label(), spot.wavefront.as_ref()?)))
            .collect();
        if spots.is_empty() {
            return note("No field has a wavefront.");
        }
        let head: String = spots.iter().map(|(label, _)| format!("<th class=\"n\">{label}</th>")).collect();
        let table = |name: &str, of: &dyn Fn(&WavefrontRow) -> &Vec<f64>| {
            let n_terms = of(spots[0].1).len();
            let row = |term: usize| {
                let cells: String = spots
                    .iter()
                    .map(|(_, front)| format!("<td class=\"n\">{:.4}</td>", of(front)[term] + 0.0))
                    .collect();
                format!("<tr><td>Z{}</td>{cells}</tr>\n", term + 1)
            };
            let rows: String = (0..n_terms).map(row).collect();
            format!("<details><summary>{name}</summary>\n<table>\n<tr><th></th>{head}</tr>\n{rows}</table></details>\n")
        };
        let words = "Over the unit disc of the stop, at the reference wavelength, about the best sphere; positive where the wavefront is \
                     ahead of it, the sign of OpticStudio and CODE V.";
        table("Noll's order, waves rms (OpticStudio: Zernike standard)", &|front| &front.zernike_waves)
            + &table("Fringe set, waves at the edge", &|front| &front.fringe_waves)
            + &note(words)
    }

    /// Returns a table of rows with one column a wavelength.
    fn by_wavelength(&self, rows: &str) -> String {
        let head = |d: &LensData| format!("<th class=\"n\">{:.1} nm</th>", d.first_order.wavelength_nm);
        let head: String = self.shown.data.iter().map(head).collect();
        format!("<table>\n<tr><th></th>{head}</tr>\n{rows}</table>\n")
    }

    /// Returns the row of a quantity; nothing where no wavelength has it.
    fn quantity(&self, name: &str, of: fn(&LensData) -> Option<f64>, written: impl Fn(f64) -> String) -> String {
        let values: Vec<Option<f64>> = self.shown.data.iter().map(of).collect();
        if values.iter().all(Option::is_none) {
            return String::new();
        }
        let cell = |value: &Option<f64>| match value {
            Some(value) if value.is_finite() => format!("<td class=\"n\">{}</td>", written(*value)),
            Some(_) => "<td class=\"n\">∞</td>".to_owned(),
            None => "<td class=\"n\">–</td>".to_owned(),
        };
        format!("<tr><td>{name}</td>{}</tr>\n", values.iter().map(cell).collect::<String>())
    }
}

/// A quantity of the data of a lens, with its name and unit.
type Quantity = (&'static str, fn(&LensData) -> Option<f64>);
