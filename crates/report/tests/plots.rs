//! Charts and lens drawings look as they did: small golden drawings in `fixtures/golden/report`, to be opened in a browser.

use dioptric_analysis::{Corner, LineChart, Scale, Series};
use dioptric_golden::check_svg;
use dioptric_optics::Lens;
use dioptric_report::{LensDrawing, chart_svg};

/// Drawings state places to a tenth of a pixel, which may round to the other side.
const ROUNDING_PX: f64 = 0.11;

fn line(label: Option<&str>, color: &str, is_dashed: bool, of: impl Fn(f64) -> f64) -> Series {
    let points = (0..=20).map(|i| f64::from(i) / 20.0).map(|x| (x, of(x))).collect();
    Series { label: label.map(str::to_owned), color: color.to_owned(), points, is_dashed }
}

fn chart() -> LineChart {
    LineChart {
        title: "Modulation & light".to_owned(),
        x_label: "cycles per µm".to_owned(),
        y_label: "modulation".to_owned(),
        x_range: (0.0, 1.0),
        y_range: (0.0, 1.0),
        series: vec![
            line(Some("0°, 550 nm"), "#0072b2", false, |x| 1.0 - x),
            line(None, "#0072b2", true, |x| (1.0 - x) * (1.0 - x)),
        ],
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

#[test]
fn linear_chart_is_the_golden_one() {
    check_svg("report/chart_linear.svg", &chart_svg(&chart(), 360.0, 240.0), ROUNDING_PX);
}

#[test]
fn logarithmic_chart_is_the_golden_one() {
    let points = (0..=8).map(|i| 10_f64.powf(0.5 * f64::from(i))).map(|x| (x, x.sqrt())).collect();
    let noise = Series { points, ..line(Some("noise, e⁻"), "#d55e00", false, |x| x) };
    let logarithmic = LineChart {
        x_range: (1.0, 1e4),
        y_range: (0.1, 1e3),
        series: vec![noise],
        legend: Corner::TopLeft,
        scale: Scale::Logarithmic,
        ..chart()
    };
    check_svg("report/chart_logarithmic.svg", &chart_svg(&logarithmic, 360.0, 240.0), ROUNDING_PX);
}

#[test]
fn crowded_chart_has_its_legend_above() {
    let colors = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
    let rising = |i: usize| {
        let share = i as f64 / 3.0;
        line(Some(["450 nm", "550 nm", "600 nm", "650 nm"][i]), colors[i], false, move |x| {
            0.02 + 0.96 * (share + (1.0 - 2.0 * share) * x)
        })
    };
    let frame = Series {
        points: vec![(0.02, 0.02), (0.02, 0.98), (0.98, 0.98), (0.98, 0.02), (0.02, 0.02)],
        ..line(None, "#808080", false, |x| x)
    };
    let series = (0..4).map(rising).chain([frame]).collect();
    check_svg("report/chart_crowded.svg", &chart_svg(&LineChart { series, ..chart() }, 360.0, 240.0), ROUNDING_PX);
}

#[test]
fn drawn_lens_is_the_golden_one() {
    let lens = Lens::built_in("paper-2el").unwrap();
    let drawing = LensDrawing {
        fields_deg: vec![0.0, 3.0],
        distance_mm: 2000.0,
        wavelengths_nm: vec![550.0],
        film_distance_mm: lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap(),
        film_label: "film".to_owned(),
    };
    let svg = drawing.to_svg(&lens).unwrap();
    check_svg("report/lens.svg", &svg, ROUNDING_PX);
}
