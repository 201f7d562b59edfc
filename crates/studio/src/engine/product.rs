//! What one rung of the ladder hands over: a capture, ready to be looked at.

use std::sync::Arc;

use dioptric_analysis::SensorStatistics;
use dioptric_pipeline::{Camera, Capture, KeptCamera, PipelineError, Progress, picture_png};
use dioptric_psf::LensImageModel;
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, DepthMap};

use super::Rung;

/// The results of a camera on one rung.
#[derive(Clone, Debug)]
pub struct Product {
    /// The camera that was asked for.
    camera: Camera,
    /// The rung.
    pub rung: Rung,
    /// Every stage of it.
    pub capture: Capture,
    /// The model of the lens's image that it was made with.
    pub model: Arc<LensImageModel>,
    /// The depth of each sample of the scene, m.
    pub depth: Arc<DepthMap>,
    /// Where the samples of the scene are, where it has a view.
    pub view: Option<View>,
    /// The picture, 8 bits a channel, red, green and blue in turn, row by row from the top.
    pub rgb8: Vec<u8>,
    /// What the sensor saw.
    pub statistics: SensorStatistics,
    /// Samples of a pixel, of the picture of a world on its way.
    pub n_samples: Option<u32>,
}

/// A step of the way of the light from the scene to digital numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct LightStep {
    /// Where.
    pub place: &'static str,
    /// How much, with its unit.
    pub amount: String,
}

impl Product {
    /// Takes the picture of a camera; `kept` is of the quality of the rung.
    pub(super) fn make(
        kept: &KeptCamera,
        camera: &Camera,
        rung: Rung,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self, PipelineError> {
        let kept = kept.with(|own| *own = rung.camera(camera));
        let capture = kept.capture(progress, cancel)?;
        let model = kept.model(progress, cancel)?;
        let depth = kept.depth(progress, cancel)?;
        let view = kept.scene(progress, cancel)?.scene.view;
        let rgb8 = capture.developed.picture.to_rgb8();
        let statistics = SensorStatistics::new(&capture.frame_parts())?;
        Ok(Self { camera: camera.clone(), rung, capture, model, depth, view, rgb8, statistics, n_samples: None })
    }

    /// Makes it a picture on its way to that of a camera, after so many samples of a pixel.
    pub(super) fn take_camera(&mut self, camera: &Camera, n_samples: u32) {
        (self.camera, self.n_samples) = (camera.clone(), Some(n_samples));
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Columns and rows of the picture.
    pub fn size(&self) -> [usize; 2] {
        let picture = &self.capture.developed.picture;
        [picture.columns(), picture.rows()]
    }

    /// Returns the picture as `dioptric run` writes it: the bytes of `picture.png`.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>, PipelineError> {
        picture_png(&self.capture.developed.picture)
    }

    /// Returns how much light there is from the scene to the digital numbers.
    pub fn light(&self) -> Vec<LightStep> {
        let Self { capture, statistics, .. } = self;
        let mut steps = vec![
            LightStep { place: "scene, mean", amount: format!("{} cd/m²", three(capture.scene.mean_luminance_cd_m2)) },
            LightStep { place: "film, mean", amount: format!("{} lx", three(capture.irradiance.summary.mean_lux)) },
            LightStep { place: "exposure", amount: exposure_words(statistics) },
        ];
        for channel in &statistics.channels {
            let amount = format!(
                "{} e⁻, {} DN, {:.0} dB",
                three(channel.mean_e),
                three(channel.mean_raw),
                channel.snr_db.max(0.0)
            );
            steps.push(LightStep { place: channel_place(&channel.filter), amount });
        }
        let clipped = 100.0 * statistics.saturated_fraction;
        steps.push(LightStep {
            place: "saturated",
            amount: format!("{clipped:.2} % of pixels, at {} e⁻", three(statistics.saturation_e)),
        });
        steps
    }
}

fn exposure_words(statistics: &SensorStatistics) -> String {
    let time_s = statistics.exposure_time_s;
    let time = if time_s > 0.0 && time_s < 0.3 {
        format!("1/{} s", three(1.0 / time_s))
    } else {
        format!("{} s", three(time_s))
    };
    format!("{time}, gain {}", three(statistics.analog_gain))
}

/// Returns the place of a channel's mean; filters have names of one letter or words.
fn channel_place(filter: &str) -> &'static str {
    match filter.chars().next().map(|first| first.to_ascii_lowercase()) {
        Some('r') => "red pixels, mean",
        Some('g') => "green pixels, mean",
        Some('b') => "blue pixels, mean",
        _ => "pixels, mean",
    }
}

/// Returns a number of three significant digits.
pub(crate) fn three(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    if decimals > 6 {
        return format!("{value:.2e}");
    }
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_kept() {
        let cases =
            [(1234.5, "1234"), (12.345, "12.3"), (0.012345, "0.0123"), (2.0, "2"), (0.0, "0"), (3.2e-9, "3.20e-9")];
        for (value, text) in cases {
            assert_eq!(three(value), text);
        }
    }
}
