//! Gray steps of known luminance: the opto-electronic conversion (ISO 14524), and noise and dynamic range by it (ISO 15739).

use std::path::Path;

use dioptric_pipeline::PipelineError;
use serde::Serialize;

use super::{MeasuredPicture, Measurement, PixelRegion};
use crate::{Corner, LineChart, Scale, Series, palette};

/// The share of a patch's samples at the highest code from which on it is blown.
const BLOWN: f64 = 0.02;
/// The fewest steps.
const FEWEST: usize = 3;

/// How gray steps are measured.
#[derive(Clone, Debug, PartialEq)]
pub struct StepsRequest {
    /// The steps: their places and luminances.
    pub steps: Vec<Step>,
}

/// A gray step of a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Where it is.
    pub region: PixelRegion,
    /// Its luminance, cd/m², or in any unit that all steps share.
    pub luminance: f64,
}

/// The conversion and the noise of a picture of gray steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepsMeasurement {
    /// The file.
    pub picture: String,
    /// The numbers of each channel; of a mosaic each filter by itself.
    pub channels: Vec<StepsChannel>,
    /// What is only a limit, a sentence each.
    pub notes: Vec<String>,
}

/// The conversion and the noise of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepsChannel {
    /// The channel.
    pub channel: String,
    /// The luminance at which the highest code is reached; that of the brightest step where none is blown.
    pub saturation_luminance: f64,
    /// Whether a step is blown, so that this is no mere limit.
    pub is_saturated: bool,
    /// The luminance at which signal and noise are equal, by the darkest step's noise and slope.
    pub least_luminance: Option<f64>,
    /// The ratio of both, in decibels.
    pub dynamic_range_db: Option<f64>,
    /// The same in powers of two.
    pub dynamic_range_stops: Option<f64>,
    /// The exponent of the conversion, the slope of log signal over log luminance between the steps that are not blown: 1 of linear light.
    pub exponent: f64,
    /// A row a step, darkest first.
    pub steps: Vec<StepRow>,
}

/// What a step gives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepRow {
    /// Its luminance.
    pub luminance: f64,
    /// The mean of its samples.
    pub mean: f64,
    /// Their standard deviation: noise of one frame, temporal and fixed.
    pub deviation: f64,
    /// The slope of the mean over luminance at it (incremental gain).
    pub gain: f64,
    /// Luminance × gain over the standard deviation (ISO 15739, total); none without noise, or where the step is blown.
    pub signal_to_noise: Option<f64>,
    /// The share of samples at the highest code.
    pub blown: f64,
}

impl StepsRequest {
    /// Reads a table of steps: a header `x,y,w,h,luminance`, then a line a step; pixels are whole numbers.
    ///
    /// # Errors
    /// When the table cannot be read, has another header, or fewer than three steps.
    pub fn read_steps(path: &Path) -> Result<Vec<Step>, PipelineError> {
        let wrong =
            |line: usize, reason: String| PipelineError::Table { path: path.to_owned(), line: line as u64, reason };
        let text = dioptric_files::text::read(path)
            .map_err(|e| PipelineError::Read { path: path.to_owned(), reason: e.to_string() })?;
        let text = dioptric_files::text::with_commas(&text);
        let mut lines =
            text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).filter(|(_, line)| !line.is_empty());
        let words = |line: &str| line.split(',').map(|word| word.trim().to_owned()).collect::<Vec<String>>();
        match lines.next() {
            Some((_, header)) if words(header) == ["x", "y", "w", "h", "luminance"] => {}
            Some((line, header)) => {
                return Err(wrong(line, format!("the header is '{header}', expected x,y,w,h,luminance")));
            }
            None => return Err(wrong(1, "there is no line, expected a header and a line a step".to_owned())),
        }
        let step = |(line, text): (usize, &str)| {
            let words = words(text);
            let [place @ .., luminance] = words.as_slice() else {
                return Err(wrong(line, "the line is empty".to_owned()));
            };
            let region = PixelRegion::parse(&place.join(","))
                .map_err(|_| wrong(line, format!("'{text}' has no place, expected four whole numbers of pixels")))?;
            match luminance.parse::<f64>() {
                Ok(luminance) if luminance > 0.0 && luminance.is_finite() => Ok(Step { region, luminance }),
                _ => Err(wrong(line, format!("the luminance is '{luminance}', expected a number above 0"))),
            }
        };
        let steps = lines.map(step).collect::<Result<Vec<Step>, PipelineError>>()?;
        if steps.len() < FEWEST {
            return Err(wrong(1, format!("there are {} steps, expected {FEWEST} or more", steps.len())));
        }
        Ok(steps)
    }

    /// Measures the steps of a picture.
    ///
    /// # Errors
    /// When a step is not within it, or two steps have one luminance.
    pub fn measure(&self, picture: &MeasuredPicture) -> Result<StepsMeasurement, PipelineError> {
        let unfit = |reason: String| picture.unfit(reason);
        let mut steps = self.steps.clone();
        steps.sort_by(|a, b| a.luminance.total_cmp(&b.luminance));
        if steps.len() < FEWEST {
            return Err(unfit(format!("{} steps were given, expected {FEWEST} or more", steps.len())));
        }
        if let Some(pair) = steps.windows(2).find(|pair| pair[0].luminance == pair[1].luminance) {
            return Err(unfit(format!("two steps have the luminance {}, expected one each", pair[0].luminance)));
        }
        for step in &steps {
            step.region.check_within(picture.size())?;
        }
        let mut channels = Vec::new();
        for (name, plane, is_own) in picture.filters() {
            let samples = |step: &Step| -> Vec<f64> {
                let PixelRegion { column, row, .. } = step.region;
                let own = |((r, c), v): ((usize, usize), &f32)| is_own((row + r, column + c)).then(|| f64::from(*v));
                step.region.of(plane).indexed_iter().filter_map(own).collect()
            };
            channels.push(StepsChannel::of(&name, &steps, &samples).map_err(unfit)?);
        }
        if picture.planes.len() > 1 && picture.rgb().is_ok() {
            let luminance = picture.luminance();
            let samples = |step: &Step| step.region.of(&luminance).iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
            channels.push(StepsChannel::of("luminance", &steps, &samples).map_err(unfit)?);
        }
        let open: Vec<&str> =
            channels.iter().filter(|channel| !channel.is_saturated).map(|channel| channel.channel.as_str()).collect();
        let mut notes = Vec::new();
        if !open.is_empty() {
            notes.push(format!(
                "no step reaches the highest code in {}: saturation and dynamic range are at least what is stated",
                open.join(", ")
            ));
        }
        let quiet: Vec<&str> = channels
            .iter()
            .filter(|channel| channel.dynamic_range_db.is_none())
            .map(|channel| channel.channel.as_str())
            .collect();
        if !quiet.is_empty() {
            notes.push(format!(
                "the darkest step has no noise, or no slope, in {}: dynamic range is not measured",
                quiet.join(", ")
            ));
        }
        Ok(StepsMeasurement { picture: picture.name.clone(), channels, notes })
    }
}

impl StepsChannel {
    fn of(name: &str, steps: &[Step], samples: &dyn Fn(&Step) -> Vec<f64>) -> Result<Self, String> {
        let mut rows = Vec::new();
        for step in steps {
            let samples = samples(step);
            let n = samples.len() as f64;
            if n < 4.0 {
                return Err(format!(
                    "has {n} samples of {name} in the step of luminance {}, expected 4 or more",
                    step.luminance
                ));
            }
            let mean = samples.iter().sum::<f64>() / n;
            let variance = samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let blown = samples.iter().filter(|v| **v >= 0.9999).count() as f64 / n;
            rows.push(StepRow {
                luminance: step.luminance,
                mean,
                deviation: variance.sqrt(),
                gain: 0.0,
                signal_to_noise: None,
                blown,
            });
        }
        let sound = rows.iter().position(|row| row.blown >= BLOWN).unwrap_or(rows.len());
        if sound < 2 {
            return Err(format!("has {sound} steps in {name} that are not blown, expected 2 or more"));
        }
        for i in 0..rows.len() {
            // Through both neighbors that are not blown, as a parabola has it.
            let (a, b) = (i.saturating_sub(1), (i + 1).min(sound - 1));
            rows[i].gain = if i < sound { slope(&rows, a, i, b) } else { 0.0 };
            let row = &rows[i];
            let is_known = i < sound && row.deviation > 0.0;
            rows[i].signal_to_noise = is_known.then(|| row.luminance * row.gain / row.deviation);
        }
        let is_saturated = sound < rows.len();
        let last = &rows[sound - 1];
        // The line through the last two steps that are not blown, to the highest code.
        let saturation_luminance = match is_saturated {
            true => {
                let slope = (last.mean - rows[sound - 2].mean) / (last.luminance - rows[sound - 2].luminance);
                (last.luminance + (1.0 - last.mean) / slope.max(f64::MIN_POSITIVE))
                    .clamp(last.luminance, rows[sound].luminance)
            }
            false => last.luminance,
        };
        let least_luminance =
            Some(&rows[0]).filter(|row| row.deviation > 0.0 && row.gain > 0.0).map(|row| row.deviation / row.gain);
        let range = least_luminance.map(|least| saturation_luminance / least);
        // A line through the logarithms.
        let logs: Vec<(f64, f64)> =
            rows[..sound].iter().filter(|row| row.mean > 0.0).map(|row| (row.luminance.ln(), row.mean.ln())).collect();
        let n = logs.len() as f64;
        let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / n, y + b / n));
        let (xy, xx) = logs.iter().fold((0.0, 0.0), |(xy, xx), (a, b)| (xy + (a - x) * (b - y), xx + (a - x).powi(2)));
        Ok(Self {
            channel: name.to_owned(),
            saturation_luminance,
            is_saturated,
            least_luminance,
            dynamic_range_db: range.map(|range| 20.0 * range.log10()),
            dynamic_range_stops: range.map(f64::log2),
            exponent: xy / xx,
            steps: rows,
        })
    }
}

/// Returns the slope of the mean over luminance at one of three rows, by the parabola through them; of two by their line.
fn slope(rows: &[StepRow], a: usize, i: usize, b: usize) -> f64 {
    let line = |p: usize, q: usize| (rows[q].mean - rows[p].mean) / (rows[q].luminance - rows[p].luminance);
    if a == i {
        return line(i, b);
    }
    if b == i {
        return line(a, i);
    }
    let (before, after) = (rows[i].luminance - rows[a].luminance, rows[b].luminance - rows[i].luminance);
    (line(a, i) * after + line(i, b) * before) / (before + after)
}

impl Measurement for StepsMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let of = |value: fn(&StepRow) -> Option<f64>| -> Vec<Series> {
            let series = self.channels.iter().map(|channel| Series {
                label: Some(channel.channel.clone()),
                color: palette::channel(&channel.channel),
                points: channel
                    .steps
                    .iter()
                    .filter_map(|row| Some((row.luminance, value(row).filter(|v| *v > 0.0)?)))
                    .collect(),
                is_dashed: channel.channel == "luminance",
            });
            series.collect()
        };
        let charts = [
            ("oecf", "Opto-electronic conversion", "mean, of the highest code", of(|row| Some(row.mean))),
            ("snr", "Signal to noise of a frame", "signal over noise", of(|row| row.signal_to_noise)),
        ];
        let range = |series: &[Series], of: fn(&(f64, f64)) -> f64| {
            let all = || series.iter().flat_map(|line| &line.points).map(of);
            (0.9 * all().fold(f64::INFINITY, f64::min), 1.1 * all().fold(f64::MIN_POSITIVE, f64::max))
        };
        let drawn = charts.into_iter().filter(|(.., series)| series.iter().any(|line| !line.points.is_empty()));
        drawn
            .map(|(name, title, y_label, series)| {
                let chart = LineChart {
                    title: title.to_owned(),
                    x_label: "luminance".to_owned(),
                    y_label: y_label.to_owned(),
                    x_range: range(&series, |point| point.0),
                    y_range: range(&series, |point| point.1),
                    series,
                    legend: Corner::BottomRight,
                    scale: Scale::Logarithmic,
                };
                (name.to_owned(), chart)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(state: &mut u64) -> f64 {
        let uniform = |state: &mut u64| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform(state)).sum::<f64>() - 6.0
    }

    #[test]
    fn conversion_noise_and_range_come_back() {
        // Mean = (L / 1000)^γ with shot-like noise √(a + b L), cut at 1.
        for gamma in [1.0, 0.5] {
            let steps: Vec<Step> = (0..14)
                .map(|i| Step {
                    region: PixelRegion { column: 0, row: 0, columns: 1, rows: 1 },
                    luminance: 0.5 * 2.0_f64.powi(i),
                })
                .collect();
            let mean = |l: f64| (l / 1000.0).powf(gamma);
            let sigma = |l: f64| (1e-7 + 1e-7 * l).sqrt();
            let samples = |step: &Step| {
                let mut state = (step.luminance * 64.0) as u64;
                let sample = |_| (mean(step.luminance) + sigma(step.luminance) * normal(&mut state)).min(1.0);
                (0..20_000).map(sample).collect::<Vec<f64>>()
            };
            let channel = StepsChannel::of("Y", &steps, &samples).unwrap();
            assert!(channel.is_saturated && (channel.exponent - gamma).abs() < 0.01, "{}", channel.exponent);
            // 512 is the last that is not blown, 1024 the first that is.
            assert!(channel.saturation_luminance > 512.0 && channel.saturation_luminance <= 1024.0);
            for row in &channel.steps[..11] {
                // 20 000 samples tell a deviation to 0.5 %.
                assert!((row.deviation / sigma(row.luminance) - 1.0).abs() < 0.02, "{row:?}");
            }
            if gamma == 1.0 {
                let least = sigma(0.5) * 1000.0;
                assert!((channel.least_luminance.unwrap() / least - 1.0).abs() < 0.02, "{:?}", channel.least_luminance);
                assert!((channel.saturation_luminance / 1000.0 - 1.0).abs() < 0.01, "{}", channel.saturation_luminance);
                let range = 20.0 * (1000.0 / least).log10();
                assert!((channel.dynamic_range_db.unwrap() - range).abs() < 0.2);
                for row in &channel.steps[1..10] {
                    let wanted = row.luminance / 1000.0 / sigma(row.luminance);
                    assert!((row.signal_to_noise.unwrap() / wanted - 1.0).abs() < 0.02, "{row:?}");
                }
            }
        }
    }

    #[test]
    fn a_table_of_steps_is_read_or_refused_by_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            StepsRequest::read_steps(&path).map_err(|error| error.to_string())
        };
        let steps = read("x,y,w,h,luminance\n0,0,8,8,1.5\n8,0,8,8,3\n16,0,8,8,6\n").unwrap();
        assert_eq!((steps.len(), steps[1].region.column, steps[2].luminance), (3, 8, 6.0));
        for (text, word) in [
            ("", "header"),
            ("x,y,w,h,L\n", "x,y,w,h,luminance"),
            ("x,y,w,h,luminance\n0,0,8,8,1\n", "3 or more"),
            ("x,y,w,h,luminance\n0,0,8,1\n", "whole numbers"),
            ("x,y,w,h,luminance\n0,0,8,8,-1\n", "above 0"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
