//! Plots of the photon transfer.

use super::{Measurement, NoiseData, NoisePoint};
use crate::{Corner, LineChart, Scale, Series, palette};

impl Measurement for NoiseData {
    fn charts(&self) -> Vec<(String, LineChart)> {
        vec![("photon-transfer".to_owned(), self.transfer_plot()), ("snr".to_owned(), self.snr_plot())]
    }
}

const MEASURED: &str = palette::LINES[0];
const MODEL: &str = palette::LINES[1];

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
            title: format!("Photon transfer: K = {:.4} DN/e, σd = {:.2} e", self.gain_dn_per_e, self.dark_noise_e),
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
        let lit = || self.points.iter().filter(|p| p.electrons > 0.0 && p.electrons <= self.saturation_e);
        let measured: Vec<(f64, f64)> = lit().filter_map(|p| Some((p.electrons, p.snr?))).collect();
        let model: Vec<(f64, f64)> = lit().filter_map(|p| Some((p.electrons, p.model_snr?))).collect();
        let all = || measured.iter().chain(&model).filter(|p| p.1 > 0.0);
        let range = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = all().map(of).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
            (10.0_f64.powf(low.log10().floor()), 10.0_f64.powf(high.log10().ceil()))
        };
        if measured.is_empty() {
            return empty_chart();
        }
        LineChart {
            title: format!("Signal to noise: dynamic range {:.1} dB", self.dynamic_range_db),
            x_label: "electrons".to_owned(),
            y_label: "SNR".to_owned(),
            x_range: range(|p| p.0),
            y_range: range(|p| p.1),
            series: vec![
                series("measured", MEASURED, measured.clone(), false),
                series("linear model", MODEL, model, true),
            ],
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
