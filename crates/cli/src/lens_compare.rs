//! `dioptric lens compare`: two lenses by real rays, side by side.

use std::{fmt::Write, fs};

use anyhow::Context;
use dioptric_analysis::{
    AnalysisFields, AnalysisRequest, ComparedLens, LensAnalysis, LensComparison, LensDefaults, LensPageData,
};
use dioptric_pipeline::{Staged, number};
use dioptric_report::{AnalysisPlots, LensComparisonPage, LensPage, chart_svg, write_drawing};

use crate::{
    analyze::{lens_line, request},
    args::Common,
    lens_args::LensCompareArgs,
    terminal::{Bar, fixed, print, print_json, remark},
};

/// Pixels of the plots as PNG for each of the drawing's own.
const PNG_SCALE: f64 = 1.5;

pub(crate) fn run(arguments: &LensCompareArgs, common: &Common) -> anyhow::Result<()> {
    // The place is tried before the work.
    let staged = arguments.out.as_ref().map(|path| Staged::folder(path)).transpose()?;
    let bar = Bar::new(common.quiet);
    bar.show("tracing the lenses", 0.0);
    let first = Analyzed::of(arguments, &arguments.lens, None, common)?;
    let second = Analyzed::of(arguments, &arguments.other, Some(&first), common)?;
    drop(bar);
    for one in [&first, &second] {
        one.analysis.notes.iter().for_each(|note| remark(common.quiet, &format!("{}: {note}", one.analysis.lens)));
    }
    note_on_object(&first, &second).iter().for_each(|note| remark(common.quiet, note));
    let comparison = LensComparison::of([first.compared(), second.compared()]);
    let pages = first.page().zip(second.page());
    if let (Some(staged), Some(path), Some((page, other))) = (staged, &arguments.out, pages) {
        let cannot = || format!("cannot write {}", path.display());
        let json = serde_json::to_string_pretty(&comparison)? + "\n";
        fs::write(staged.path().join("comparison.json"), json).with_context(cannot)?;
        for (name, chart) in &comparison.charts {
            write_drawing(&chart_svg(chart, 640.0, 420.0), staged.path(), name, PNG_SCALE)?;
            fs::write(staged.path().join(format!("{name}.csv")), chart.to_csv()).with_context(cannot)?;
        }
        let page = LensComparisonPage { comparison: &comparison, pages: [page, other] };
        fs::write(staged.path().join("comparison.html"), page.html()?).with_context(cannot)?;
        staged.commit()?;
        let words = format!("wrote comparison.json, comparison.html and the curves of both in {}", path.display());
        remark(common.quiet, &words);
    }
    if common.json {
        return print_json(&comparison);
    }
    print(&([&first, &second].map(|one| lens_line(&one.analysis)).concat() + &table(&comparison)?))
}

/// Says that the second lens is looked at with the object of the first, where its file has another one.
fn note_on_object(first: &Analyzed, second: &Analyzed) -> Option<String> {
    let (own_mm, used_mm) = (second.used.distance_mm, first.request.distance_mm);
    let far = |mm: f64| if mm.is_finite() { format!("{} mm before it", number(mm)) } else { "far away".to_owned() };
    (own_mm != used_mm && own_mm.is_finite()).then(|| {
        format!(
            "{}: it is looked at with an object {}, as {} is; that of its own file is {}",
            second.analysis.lens,
            far(used_mm),
            first.analysis.lens,
            far(own_mm)
        )
    })
}

/// A lens that was analyzed.
struct Analyzed {
    request: AnalysisRequest,
    used: LensDefaults,
    analysis: LensAnalysis,
    /// What is shown of it on a page, if one is written.
    shown: Option<LensPageData>,
}

impl Analyzed {
    /// Analyzes a lens; the second as the first one was.
    fn of(arguments: &LensCompareArgs, name: &str, first: Option<&Self>, common: &Common) -> anyhow::Result<Self> {
        let reading = arguments.state.reading.reading();
        let used = LensDefaults::open(name, &reading, arguments.state.stop_mm)?;
        used.notes.iter().for_each(|note| remark(common.quiet, &format!("{name}: {note}")));
        let request = match first {
            None => request(&arguments.asked, &used, common)?,
            Some(first) => AnalysisRequest {
                fields: first.fields(),
                film: arguments.asked.film.of(&used),
                main_wavelength_nm: used.reference_nm,
                ..first.request.clone()
            },
        };
        let used = arguments.state.apply(used, &request.wavelengths_nm, common)?;
        let analysis = request.compute(&used.lens)?;
        let is_shown = arguments.out.is_some();
        let shown = is_shown.then(|| LensPageData::of(&request, &used, &analysis)).transpose()?;
        Ok(Self { request, used, analysis, shown })
    }

    /// The fields that it was looked at in, by name.
    fn fields(&self) -> AnalysisFields {
        let places = self.analysis.fields.iter().map(|row| row.place);
        match self.analysis.fields.first().and_then(|row| row.place.object_mm) {
            Some(_) => AnalysisFields::HeightsMm(places.filter_map(|place| place.object_mm).collect()),
            None => AnalysisFields::AnglesDeg(places.map(|place| place.field_xy_deg).collect()),
        }
    }

    fn compared(&self) -> ComparedLens<'_> {
        let curves = self.shown.as_ref().map(|shown| &shown.curves);
        ComparedLens { lens: &self.used.lens, analysis: &self.analysis, curves }
    }

    fn page(&self) -> Option<LensPage<'_>> {
        let shown = self.shown.as_ref()?;
        Some(LensPage { plots: AnalysisPlots(&self.analysis), shown, tables: "" })
    }
}

fn table(comparison: &LensComparison) -> Result<String, std::fmt::Error> {
    let widths = comparison.lenses.each_ref().map(|name| name.chars().count().max(14) + 2);
    let widest = comparison.rows.iter().map(|row| row.quantity.chars().count()).max().unwrap_or(0);
    let mut text = format!("{:widest$}", "");
    for (name, width) in comparison.lenses.iter().zip(widths) {
        write!(text, "{name:>width$}")?;
    }
    text += "\n";
    for row in &comparison.rows {
        write!(text, "{:<widest$}", row.quantity)?;
        for (value, width) in row.values.iter().zip(widths) {
            let cell = value.map_or("–".to_owned(), |value| fixed(value, 4));
            write!(text, "{cell:>width$}")?;
        }
        text += "\n";
    }
    Ok(text)
}
