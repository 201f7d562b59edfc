//! Two lenses side by side.

use dioptric_optics::Lens;
use serde::Serialize;

use super::{
    curves::LensCurves,
    rows::{LensAnalysis, SpotRow},
};
use crate::{LineChart, Series, palette};

/// Curves that are drawn of both lenses in one plot.
const SHARED: [&str; 5] =
    ["rms_over_field", "wavefront_over_field", "rms_over_wavelength", "chromatic_focal_shift", "vignetting"];

/// Two lenses that were analyzed at the same fields and wavelengths, side by side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensComparison {
    /// What they are called.
    pub lenses: [String; 2],
    /// Quantities of both.
    pub rows: Vec<ComparisonRow>,
    /// Curves of both, each with the name that its file has.
    #[serde(skip)]
    pub charts: Vec<(&'static str, LineChart)>,
}

/// A quantity of two lenses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonRow {
    /// The quantity, with its unit.
    pub quantity: String,
    /// Of the first and of the second lens; none where a lens has no such number.
    pub values: [Option<f64>; 2],
}

/// A lens that was analyzed, with its curves.
#[derive(Clone, Copy, Debug)]
pub struct ComparedLens<'a> {
    /// The lens.
    pub lens: &'a Lens,
    /// Its analysis.
    pub analysis: &'a LensAnalysis,
    /// Its curves, where they are to be drawn.
    pub curves: Option<&'a LensCurves>,
}

impl LensComparison {
    /// Compares two lenses, of which the second is looked at in the fields and wavelengths of the first.
    pub fn of(both: [ComparedLens<'_>; 2]) -> Self {
        let lenses = both.map(|one| one.analysis.lens.clone());
        let mut rows = whole(both);
        for (i, row) in both[0].analysis.fields.iter().enumerate() {
            rows.extend(of_field(both.map(|one| one.analysis), i, &row.place.label()));
        }
        let charts = SHARED.iter().filter_map(|name| Some((*name, overlaid(name, both, &lenses)?))).collect();
        Self { lenses, rows, charts }
    }
}

fn row(quantity: impl Into<String>, values: [Option<f64>; 2]) -> ComparisonRow {
    ComparisonRow { quantity: quantity.into(), values: values.map(|value| value.filter(|v| v.is_finite())) }
}

/// The quantities of the lenses as wholes.
fn whole(both: [ComparedLens<'_>; 2]) -> Vec<ComparisonRow> {
    let of = |get: &dyn Fn(&LensAnalysis) -> Option<f64>| both.map(|one| get(one.analysis));
    let length_mm = |one: ComparedLens<'_>| {
        let glass_mm: f64 = one.lens.interfaces().iter().rev().skip(1).map(|side| side.thickness_after_mm).sum();
        Some(glass_mm + one.analysis.film_distance_mm)
    };
    let color_mm = |analysis: &LensAnalysis| {
        let shifts = || analysis.axial_color.iter().map(|row| row.paraxial_shift_mm);
        Some(shifts().fold(f64::NEG_INFINITY, f64::max) - shifts().fold(f64::INFINITY, f64::min))
    };
    let magnification = |one: ComparedLens<'_>| {
        let lens = one.lens.at(one.analysis.reference_nm).ok().filter(|_| one.analysis.distance_mm.is_finite());
        lens.map(|lens| lens.conjugate(one.analysis.distance_mm).magnification)
    };
    let rows = vec![
        row("object before the first vertex, mm", of(&|a| Some(a.distance_mm))),
        row("reference wavelength, nm", of(&|a| Some(a.reference_nm))),
        row("focal length, mm", of(&|a| Some(a.efl_mm))),
        row("f-number", of(&|a| Some(a.f_number))),
        row("T-number", of(&|a| a.t_number)),
        row("f-number at this object", of(&|a| Some(a.working_f_number))),
        row("magnification", both.map(magnification)),
        row("numerical aperture at the object", of(&|a| a.object_na)),
        row("numerical aperture at the image", of(&|a| a.image_na)),
        row("film behind the last vertex, mm", of(&|a| Some(a.film_distance_mm))),
        row("from the first vertex to the film, mm", both.map(length_mm)),
        row("surfaces", both.map(|one| Some(one.lens.interfaces().len() as f64))),
        row("field of half the light, °", of(&|a| a.half_illumination_deg)),
        row("paraxial axial color, mm", of(&color_mm)),
        row("least spot on the axis, µm rms", of(&|a| a.focus.axis_rms_um)),
    ];
    // A far object has no distance and no aperture.
    rows.into_iter().filter(|row| row.values.iter().any(Option::is_some)).collect()
}

/// The quantities of the `i`-th field, at the reference wavelength.
fn of_field(both: [&LensAnalysis; 2], i: usize, label: &str) -> Vec<ComparisonRow> {
    let spot = |get: &dyn Fn(&SpotRow) -> Option<f64>| {
        both.map(|analysis| {
            let n_wavelengths = analysis.wavelengths_nm.len();
            let spots = analysis.spots.get(i * n_wavelengths..(i + 1) * n_wavelengths)?;
            get(spots.iter().find(|spot| spot.wavelength_nm == analysis.reference_nm).or(spots.first())?)
        })
    };
    let fields = both.map(|analysis| analysis.fields.get(i));
    vec![
        row(format!("{label}: spot, µm rms"), spot(&|spot| spot.rms_um)),
        row(format!("{label}: wavefront, waves rms"), spot(&|spot| Some(spot.wavefront.as_ref()?.rms_waves))),
        row(format!("{label}: Strehl ratio"), spot(&|spot| spot.wavefront.as_ref()?.strehl)),
        row(format!("{label}: distortion against tan θ, %"), fields.map(|field| field?.distortion_tangent_percent)),
        row(format!("{label}: light over that on the axis"), fields.map(|field| field?.relative_illumination)),
    ]
}

/// Returns a curve of both lenses in one plot, the second dashed; `None` where one has none of this name.
fn overlaid(name: &str, both: [ComparedLens<'_>; 2], lenses: &[String; 2]) -> Option<LineChart> {
    let chart =
        |one: ComparedLens<'_>| one.curves?.0.iter().find(|(other, _)| *other == name).map(|(_, chart)| chart.clone());
    let [first, second] = both.map(chart);
    let (first, second) = (first?, second?);
    let union = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    let (x_range, y_range) = (union(first.x_range, second.x_range), union(first.y_range, second.y_range));
    // A dashed line is a limit that both share.
    let (limits, own): (Vec<Series>, Vec<Series>) = first.series.into_iter().partition(|line| line.is_dashed);
    let lines = [own, second.series.into_iter().filter(|line| !line.is_dashed).collect()];
    let of_lens = |(which, lines): (usize, Vec<Series>)| {
        lines.into_iter().enumerate().map(move |(i, line)| Series {
            label: Some(match &line.label {
                Some(label) => format!("{}: {label}", lenses[which]),
                None => lenses[which].clone(),
            }),
            color: palette::line(i),
            is_dashed: which == 1,
            ..line
        })
    };
    let series = limits.into_iter().chain(lines.into_iter().enumerate().flat_map(of_lens)).collect();
    Some(LineChart { x_range, y_range, series, ..first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    #[test]
    fn a_lens_beside_one_twice_as_large_has_twice_its_lengths() {
        let lens = Lens::built_in("cooke-50mm").unwrap();
        let larger = lens.scaled(2.0).unwrap();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
            wavelengths_nm: vec![500.0, 550.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::FocusMm(f64::INFINITY),
            n_rings: 6,
        };
        let analyses = [&lens, &larger].map(|lens| request.compute(lens).unwrap());
        let curves = [0, 1].map(|i| analyses[i].lens_curves([&lens, &larger][i]).unwrap());
        let one =
            |i: usize| ComparedLens { lens: [&lens, &larger][i], analysis: &analyses[i], curves: Some(&curves[i]) };
        let comparison = LensComparison::of([one(0), one(1)]);
        let ratio = |quantity: &str| {
            let row = comparison.rows.iter().find(|row| row.quantity == quantity).unwrap();
            row.values[1].unwrap() / row.values[0].unwrap()
        };
        let twofold = [
            "focal length, mm",
            "from the first vertex to the film, mm",
            "10.0°: spot, µm rms",
            "10.0°: wavefront, waves rms",
        ];
        for quantity in twofold {
            assert!((ratio(quantity) - 2.0).abs() < 1e-6, "{quantity} {}", ratio(quantity));
        }
        for quantity in ["f-number", "10.0°: distortion against tan θ, %", "10.0°: light over that on the axis"] {
            assert!((ratio(quantity) - 1.0).abs() < 1e-6, "{quantity} {}", ratio(quantity));
        }
        assert_eq!(comparison.charts.len(), SHARED.len());
        for (name, chart) in &comparison.charts {
            let n_dashed =
                chart.series.iter().filter(|line| line.is_dashed && line.label.as_deref() != Some("1/14 wave")).count();
            assert!(n_dashed > 0 && chart.series.iter().filter(|line| !line.is_dashed).count() == n_dashed, "{name}");
        }
    }
}
