//! Two pictures compared as codes, as structures and as the eye sees them.

use std::path::Path;

use dioptric_scene::DisplayModel;
use dioptric_sensor::{psnr_db, scielab_delta_e, ssim, visual_snr};
use ndarray::Array3;
use serde::Serialize;

use super::{CodeCurve, MeasuredPicture, Measurement, PixelRegion};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// Points of the plotted distribution.
const POINTS: usize = 100;

/// How two pictures are compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareRequest {
    /// How they are seen.
    pub viewing: PictureViewing,
    /// An even patch, whose visual signal-to-noise ratio is measured.
    pub patch: Option<PixelRegion>,
}

/// How a viewer sees pictures.
#[derive(Clone, Debug, PartialEq)]
pub enum PictureViewing {
    /// As sRGB, at so many pixels a degree of the viewer's field.
    PixelsPerDegree(f64),
    /// On a display at a distance, m: codes are its own, and its white is white.
    Display {
        /// The display.
        display: Box<DisplayModel>,
        /// The distance, m.
        distance_m: f64,
    },
}

impl PictureViewing {
    /// Pixels a degree of the viewer's field.
    pub fn pixels_per_degree(&self) -> f64 {
        match self {
            Self::PixelsPerDegree(n) => *n,
            Self::Display { display, distance_m } => display.pixels_per_degree(*distance_m),
        }
    }

    /// Opens a picture file to be seen so; `curve` is how its samples stand for light.
    ///
    /// # Errors
    /// As [`MeasuredPicture::open`].
    pub fn open(&self, path: &Path, curve: CodeCurve) -> Result<SeenPicture, PipelineError> {
        let codes = match self {
            Self::PixelsPerDegree(_) => None,
            Self::Display { .. } => Some(MeasuredPicture::open(path, CodeCurve::Linear)?),
        };
        Ok(SeenPicture { picture: MeasuredPicture::open(path, curve)?, codes })
    }

    /// Returns the light of a picture as the viewer sees it, in linear sRGB.
    fn light(&self, seen: &SeenPicture) -> Result<Array3<f32>, PipelineError> {
        match (self, &seen.codes) {
            (Self::Display { display, .. }, Some(codes)) => Ok(display.seen(&codes.rgb()?)),
            (Self::Display { .. }, None) => {
                Err(seen.picture.unfit("holds light, expected codes for a display".to_owned()))
            }
            (Self::PixelsPerDegree(_), _) => seen.picture.rgb(),
        }
    }
}

/// A picture that is compared with another.
#[derive(Clone, Debug)]
pub struct SeenPicture {
    /// Its light.
    picture: MeasuredPicture,
    /// Its codes from 0 to 1, where a display shows them.
    codes: Option<MeasuredPicture>,
}

impl SeenPicture {
    /// A picture whose light a program holds; no display shows it.
    pub fn of_light(picture: MeasuredPicture) -> Self {
        Self { picture, codes: None }
    }
}

/// How alike two pictures are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The first picture.
    pub picture: String,
    /// The second.
    pub against: String,
    /// The peak signal-to-noise ratio of sRGB codes, dB; none for equal pictures.
    pub psnr_db: Option<f64>,
    /// The mean structural similarity of the luma, 1 for equal pictures.
    pub ssim: f64,
    /// Pixels a degree of the viewer's field.
    pub pixels_per_degree: f64,
    /// ΔE₀₀ of S-CIELAB over all pixels.
    pub scielab: DeltaESummary,
    /// The visual signal-to-noise ratio of the even patch in the first picture, where one was given; none where it has
    /// no noise.
    pub vsnr: Option<f64>,
    /// That of the second.
    pub against_vsnr: Option<f64>,
}

/// Color differences over all pixels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeltaESummary {
    /// The mean.
    pub mean: f64,
    /// The median.
    pub median: f64,
    /// What 95 % of all pixels do not exceed.
    pub p95: f64,
    /// The largest.
    pub max: f64,
    /// Pairs of ΔE₀₀ and the share of pixels that do not exceed it.
    #[serde(skip)]
    pub distribution: Vec<(f64, f64)>,
}

impl CompareRequest {
    /// Compares two pictures.
    ///
    /// # Errors
    /// When the pictures differ in size or have no colors, or a setting makes no sense.
    pub fn compare(&self, first: &SeenPicture, second: &SeenPicture) -> Result<Comparison, PipelineError> {
        let pixels_per_degree = self.viewing.pixels_per_degree();
        let (light, other_light) = (self.viewing.light(first)?, self.viewing.light(second)?);
        let (first, second) = (&first.picture, &second.picture);
        let patch = self.patch.map(|patch| patch.check_within(first.size())).transpose()?;
        let (codes, other_codes) = (first.coded()?, second.coded()?);
        let psnr = psnr_db(&codes, &other_codes)?;
        let delta_e = scielab_delta_e(&light, &other_light, pixels_per_degree)?;
        let vsnr = |light: &ndarray::Array3<f32>| -> Result<Option<f64>, PipelineError> {
            let Some(patch) = patch else { return Ok(None) };
            Ok(Some(visual_snr(&patch.of_picture(light), pixels_per_degree)?).filter(|v| v.is_finite()))
        };
        Ok(Comparison {
            vsnr: vsnr(&light)?,
            against_vsnr: vsnr(&other_light)?,
            picture: first.name.clone(),
            against: second.name.clone(),
            psnr_db: psnr.is_finite().then_some(psnr),
            ssim: ssim(&codes, &other_codes)?,
            pixels_per_degree,
            scielab: DeltaESummary::of(delta_e.iter().map(|&v| f64::from(v)).collect()),
        })
    }
}

impl DeltaESummary {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let last = values.len() - 1;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        let shares = (0..=POINTS).map(|i| i as f64 / POINTS as f64);
        Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            median: at(0.5),
            p95: at(0.95),
            max: values[last],
            distribution: shares.map(|share| (at(share), share)).collect(),
        }
    }
}

impl Measurement for Comparison {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let chart = LineChart {
            title: format!(
                "S-CIELAB at {} pixels a degree: mean ΔE00 {:.2}",
                self.pixels_per_degree, self.scielab.mean
            ),
            x_label: "ΔE00".to_owned(),
            y_label: "share of pixels that do not exceed it".to_owned(),
            x_range: (0.0, self.scielab.max.max(0.1)),
            y_range: (0.0, 1.0),
            series: vec![Series {
                label: None,
                color: palette::line(0),
                points: self.scielab.distribution.clone(),
                is_dashed: false,
            }],
            legend: Corner::BottomRight,
            scale: Scale::Linear,
        };
        vec![("scielab".to_owned(), chart)]
    }
}
