//! Plots of the photon transfer.

use super::{Measurement, NoiseData, NoisePoint, SpatialPatterns};
use crate::{Corner, LineChart, Scale, Series, palette};

impl Measurement for NoiseData {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let mut charts =
            vec![("photon-transfer".to_owned(), self.transfer_plot()), ("snr".to_owned(), self.snr_plot())];
        if let Some(patterns) = &self.patterns {
            charts.extend([
                ("spectrogram-dsnu".to_owned(), patterns.spectrogram("Spectrogram of the dark", "electrons", true)),
                ("spectrogram-prnu".to_owned(), patterns.spectrogram("Spectrogram at half saturation", "%", false)),
                ("accumulated-dsnu".to_owned(), accumulated("DSNU, electrons", &patterns.dsnu_accumulated_e)),
                ("accumulated-prnu".to_owned(), accumulated("PRNU, %", &patterns.prnu_accumulated_percent)),
            ]);
        }
        charts
    }
}

const MEASURED: &str = palette::LINES[0];
const MODEL: &str = palette::LINES[1];
const TOTAL: &str = palette::LINES[2];

impl SpatialPatterns {
    fn spectrogram(&self, title: &str, unit: &str, is_dark: bool) -> LineChart {
        let (horizontal, vertical) = match is_dark {
            true => (&self.horizontal_dsnu_e, &self.vertical_dsnu_e),
            false => (&self.horizontal_prnu_percent, &self.vertical_prnu_percent),
        };
        let line =
            |frequencies: &[f64], values: &[f64]| frequencies.iter().copied().zip(values.iter().copied()).collect();
        let most = horizontal.iter().chain(vertical).copied().fold(f64::MIN_POSITIVE, f64::max);
        LineChart {
            title: title.to_owned(),
            x_label: "cycles per pixel".to_owned(),
            y_label: format!("root of the power, {unit}"),
            x_range: (0.0, 0.5),
            y_range: (0.0, 1.1 * most),
            series: vec![
                series("along rows", MEASURED, line(&self.horizontal_cycles_per_pixel, horizontal), false),
                series("along columns", MODEL, line(&self.vertical_cycles_per_pixel, vertical), false),
            ],
            legend: Corner::TopRight,
            scale: Scale::Linear,
        }
    }
}

/// Returns the share of pixels that are off by a value or more.
fn accumulated(label: &str, shares: &[(f64, f64)]) -> LineChart {
    let points: Vec<(f64, f64)> =
        shares.iter().map(|(share, off)| (*off, *share)).filter(|(off, _)| *off > 0.0).collect();
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return empty_chart() };
    let least = 10.0_f64.powf(first.0.log10().floor());
    let most = 10.0_f64.powf(last.0.log10().ceil()).max(10.0 * least);
    LineChart {
        title: "Pixels that are off by a value or more".to_owned(),
        x_label: label.to_owned(),
        y_label: "share of all pixels".to_owned(),
        x_range: (least, most),
        y_range: (10.0_f64.powf(last.1.log10().floor()), 1.0),
        series: vec![Series { label: None, color: MEASURED.to_owned(), points, is_dashed: false }],
        legend: Corner::TopRight,
        scale: Scale::Logarithmic,
    }
}

impl NoiseData {
    fn transfer_plot(&self) -> LineChart {
        let (Some(dark), Some(last)) = (self.points.first(), self.points.last()) else {
            return empty_chart();
        };
        let signal = |p: &NoisePoint| p.mean_dn - dark.mean_dn;
        let top = self.points.iter().map(|p| p.variance_dn2).fold(f64::MIN_POSITIVE, f64::max);
        let line = |x: f64| (x, dark.variance_dn2 + self.gain_dn_per_e * x);
        let reach = signal(last).min((top - dark.variance_dn2) / self.gain_dn_per_e);
        LineChart {
            title: match self.dark_noise_e {
                Some(noise_e) => format!("Photon transfer: K = {:.4} DN/e, σd = {noise_e:.2} e", self.gain_dn_per_e),
                None => format!("Photon transfer: K = {:.4} DN/e", self.gain_dn_per_e),
            },
            x_label: "signal above dark, DN".to_owned(),
            y_label: "temporal variance, DN²".to_owned(),
            x_range: (0.0, 1.02 * signal(last)),
            y_range: (0.0, 1.1 * top),
            series: vec![
                series("measured", MEASURED, self.points.iter().map(|p| (signal(p), p.variance_dn2)).collect(), false),
                series("σd² + K signal", MODEL, vec![line(0.0), line(reach)], true),
            ],
            legend: Corner::TopLeft,
            scale: Scale::Linear,
        }
    }

    fn snr_plot(&self) -> LineChart {
        // Beyond saturation there is no noise left to compare with.
        let most_e = self.saturation_e.unwrap_or(f64::INFINITY);
        let lit = || self.points.iter().filter(|p| p.electrons > 0.0 && p.electrons <= most_e);
        let measured: Vec<(f64, f64)> = lit().filter_map(|p| Some((p.electrons, p.snr?))).collect();
        let model: Vec<(f64, f64)> = lit().filter_map(|p| Some((p.electrons, p.model_snr?))).collect();
        let total: Vec<(f64, f64)> = lit().filter_map(|p| Some((p.electrons, p.total_snr?))).collect();
        let all = || measured.iter().chain(&model).filter(|p| p.1 > 0.0);
        let range = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = all().map(of).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
            (10.0_f64.powf(low.log10().floor()), 10.0_f64.powf(high.log10().ceil()))
        };
        if measured.is_empty() {
            return empty_chart();
        }
        LineChart {
            title: match self.dynamic_range_db {
                Some(db) => format!("Signal to noise: dynamic range {db:.1} dB"),
                None => "Signal to noise".to_owned(),
            },
            x_label: "electrons".to_owned(),
            y_label: "SNR".to_owned(),
            x_range: range(|p| p.0),
            y_range: range(|p| p.1),
            series: vec![
                series("measured", MEASURED, measured.clone(), false),
                series("linear model", MODEL, model, true),
            ]
            .into_iter()
            .chain((!total.is_empty()).then(|| series("with fixed patterns", TOTAL, total, true)))
            .collect(),
            legend: Corner::TopLeft,
            scale: Scale::Logarithmic,
        }
    }
}

fn series(label: &str, color: &str, points: Vec<(f64, f64)>, is_dashed: bool) -> Series {
    Series { label: Some(label.to_owned()), color: color.to_owned(), points, is_dashed }
}

fn empty_chart() -> LineChart {
    LineChart {
        title: "nothing to show".to_owned(),
        x_label: String::new(),
        y_label: String::new(),
        x_range: (0.0, 1.0),
        y_range: (0.0, 1.0),
        series: Vec::new(),
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}
