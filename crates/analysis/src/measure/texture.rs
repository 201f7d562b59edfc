//! The spatial frequency response of a texture in a picture.

use dioptric_sensor::{TextureNoise, TextureResponse, TextureSpectra, Viewing};
use ndarray::Array2;
use serde::Serialize;

use super::{MeasuredPicture, Measurement, PixelRegion, edge::viewing_of};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// How a texture is measured.
#[derive(Clone, Debug)]
pub struct TextureRequest {
    /// Where the texture is in both pictures; everywhere where it is not given.
    pub region: Option<PixelRegion>,
    /// What shows the noise of the picture.
    pub noise: TextureNoiseRequest,
    /// Pixels a degree of the viewer's field, for acutance; 60 where it is not given.
    pub pixels_per_degree: Option<f64>,
}

/// What shows the noise of a picture of a texture.
#[derive(Clone, Debug)]
pub enum TextureNoiseRequest {
    /// Nothing: the picture is taken to have none.
    None,
    /// An even patch of the picture.
    Flat(PixelRegion),
    /// Another frame of the same camera.
    SecondFrame(MeasuredPicture),
}

/// The responses of a texture, two a channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextureMeasurement {
    /// The file.
    pub picture: String,
    /// The file that it was compared with.
    pub reference: String,
    /// The region that was measured.
    pub region: PixelRegion,
    /// Pixels a degree of the viewer's field.
    pub pixels_per_degree: f64,
    /// The responses of each channel.
    pub channels: Vec<TextureChannel>,
}

/// The responses of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextureChannel {
    /// The channel.
    pub channel: String,
    /// By the root of the ratio of powers, that of the noise taken off.
    pub direct: TextureCurve,
    /// By what is common with the reference; none where that does not show the same part of the texture.
    pub full_reference: Option<TextureCurve>,
    /// How much of the picture's low frequencies is in the reference, 0 to 1.
    pub coherence: f64,
    /// By how many columns the picture is shifted against the reference.
    pub shift_columns_px: f64,
    /// By how many rows it is.
    pub shift_rows_px: f64,
    /// Frequencies, cycles a pixel.
    pub frequencies_cycles_per_pixel: Vec<f64>,
    /// The power of the picture at each frequency; white noise has its variance there.
    pub picture_power: Vec<f64>,
    /// The least frequency at which the noise has all of the picture's power, cycles a pixel: the direct response is 0 there.
    pub noise_from_cycles_per_pixel: Option<f64>,
    /// The power of the noise, 0 where nothing shows it.
    pub noise_power: Vec<f64>,
    /// The power of the reference.
    pub reference_power: Vec<f64>,
}

/// A response of a texture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextureCurve {
    /// The frequency at which half the response is left, cycles a pixel.
    pub mtf50_cycles_per_pixel: Option<f64>,
    /// The response at half a cycle a pixel.
    pub response_at_nyquist: f64,
    /// The response weighed by the eye's contrast sensitivity, 1 of a perfect picture (IEEE 1858).
    pub acutance: f64,
    /// The response at each frequency, 1 toward 0.
    pub response: Vec<f64>,
}

impl TextureRequest {
    /// Measures the texture of a picture against the same framing as an ideal camera pictures it.
    ///
    /// In a picture of R, G and B the luminance is measured too. A channel is compared with that of the same name in the
    /// reference, or with the luminance of the reference where there is none.
    ///
    /// # Errors
    /// When sizes differ, a region does not lie within the picture, or there is no texture.
    pub fn measure(
        &self,
        picture: &MeasuredPicture,
        reference: &MeasuredPicture,
    ) -> Result<TextureMeasurement, PipelineError> {
        picture.require_whole()?;
        let viewing = viewing_of(self.pixels_per_degree, picture.size())?;
        let check_size = |other: &MeasuredPicture| {
            let ((rows, columns), (wanted_rows, wanted_columns)) = (other.size(), picture.size());
            if other.size() == picture.size() {
                return Ok(());
            }
            let reason = format!(
                "it has {columns} × {rows} pixels, expected {wanted_columns} × {wanted_rows} as {}",
                picture.name
            );
            Err(other.unfit(reason))
        };
        check_size(reference)?;
        let second = match &self.noise {
            TextureNoiseRequest::SecondFrame(second) => {
                check_size(second)?;
                Some(second)
            }
            TextureNoiseRequest::None | TextureNoiseRequest::Flat(_) => None,
        };
        let (rows, columns) = picture.size();
        let whole = PixelRegion { column: 0, row: 0, columns, rows };
        let region = self.region.unwrap_or(whole).check_within(picture.size())?;
        let flat = match self.noise {
            TextureNoiseRequest::Flat(patch) => Some(patch.check_within(picture.size())?),
            TextureNoiseRequest::None | TextureNoiseRequest::SecondFrame(_) => None,
        };
        let channels = channels(picture);
        let measured = channels.iter().map(|(name, plane)| {
            let ideal = channel_of(reference, name);
            let other = second.as_ref().map(|second| channel_of(second, name));
            let noise = match (flat, &other) {
                (Some(patch), _) => Some(TextureNoise::Flat(patch.of(plane))),
                (None, Some(other)) => Some(TextureNoise::SecondFrame(region.of(other))),
                (None, None) => None,
            };
            let spectra = TextureSpectra::measure(&region.of(plane), &region.of(&ideal), noise);
            let unfit = |error: dioptric_sensor::SensorError| picture.unfit(format!("channel {name}: {error}"));
            TextureChannel::of(name, spectra.map_err(unfit)?, &viewing)
        });
        Ok(TextureMeasurement {
            channels: measured.collect::<Result<_, _>>()?,
            picture: picture.name.clone(),
            reference: reference.name.clone(),
            region,
            pixels_per_degree: viewing.pixels_per_degree,
        })
    }
}

const LUMINANCE: &str = "luminance";

/// The channels of a picture, and the luminance of R, G and B.
fn channels(picture: &MeasuredPicture) -> Vec<(String, Array2<f32>)> {
    let mut channels = picture.planes.clone();
    if picture.rgb().is_ok() && picture.planes.len() > 1 {
        channels.push((LUMINANCE.to_owned(), picture.luminance()));
    }
    channels
}

/// Returns the channel of a name, or the luminance.
fn channel_of(picture: &MeasuredPicture, name: &str) -> Array2<f32> {
    let named = picture.planes.iter().find(|(own, _)| own == name);
    named.map_or_else(|| picture.luminance(), |(_, plane)| plane.clone())
}

impl TextureChannel {
    fn of(name: &str, spectra: TextureSpectra, viewing: &Viewing) -> Result<Self, PipelineError> {
        Ok(Self {
            channel: name.to_owned(),
            noise_from_cycles_per_pixel: spectra.noise_from(),
            direct: TextureCurve::of(spectra.direct, viewing)?,
            full_reference: spectra.full_reference.map(|response| TextureCurve::of(response, viewing)).transpose()?,
            coherence: spectra.coherence,
            shift_columns_px: spectra.shift_px.1,
            shift_rows_px: spectra.shift_px.0,
            frequencies_cycles_per_pixel: spectra.frequencies,
            picture_power: spectra.picture_power,
            noise_power: spectra.noise_power,
            reference_power: spectra.reference_power,
        })
    }
}

impl TextureCurve {
    fn of(response: TextureResponse, viewing: &Viewing) -> Result<Self, PipelineError> {
        Ok(Self {
            mtf50_cycles_per_pixel: response.mtf50(),
            response_at_nyquist: response.at(0.5),
            acutance: response.acutance(viewing)?,
            response: response.response,
        })
    }
}

impl Measurement for TextureMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let mut series = Vec::new();
        let mut highest = 1.0_f64;
        for channel in &self.channels {
            let curves = [("direct", Some(&channel.direct)), ("full reference", channel.full_reference.as_ref())];
            for (method, curve) in curves.into_iter().filter_map(|(method, curve)| Some((method, curve?))) {
                highest = curve.response.iter().copied().fold(highest, f64::max);
                let frequencies = channel.frequencies_cycles_per_pixel.iter().copied();
                series.push(Series {
                    label: Some(format!("{}, {method}", channel.channel)),
                    color: palette::channel(&channel.channel),
                    points: frequencies.zip(curve.response.iter().copied()).collect(),
                    is_dashed: method == "direct",
                });
            }
        }
        let chart = LineChart {
            title: "Response of a texture".to_owned(),
            x_label: "cycles a pixel".to_owned(),
            y_label: "response".to_owned(),
            x_range: (0.0, 0.5),
            y_range: (0.0, (10.0 * highest).ceil() / 10.0),
            series,
            legend: Corner::TopRight,
            scale: Scale::Linear,
        };
        vec![("texture".to_owned(), chart)]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use approx::assert_relative_eq;
    use dioptric_scene::{Pattern, Target, TargetLight};
    use dioptric_sensor::{EdgeResponse, Viewing};
    use dioptric_spectrum::WavelengthGrid;

    use super::*;

    const SIDE: usize = 256;
    /// The standard deviation of the noise: the texture's is 0.14 over all frequencies.
    const NOISE: f64 = 0.005;
    const VIEWING: Viewing = Viewing { pixels_per_degree: 60.0, picture_deg: 4.0, luminance_cd_m2: 100.0 };

    /// A target as shares of white.
    fn target(pattern: Pattern, supersampling: usize) -> Array2<f32> {
        let target = Target {
            pattern,
            rows: SIDE,
            columns: SIDE,
            light: TargetLight::EqualEnergy,
            luminance_cd_m2: 100.0,
            dark: 0.2,
            supersampling,
            horizontal_fov_deg: 5.0,
            distance_m: 2.0,
        };
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let of = |target: &Target| target.scene(&grid).unwrap().radiance.planes()[0].clone();
        let white = of(&Target { pattern: Pattern::Uniform, ..target.clone() })[(0, 0)];
        of(&target).mapv(|v| v / white)
    }

    fn leaves(supersampling: usize) -> Array2<f32> {
        let pattern = Pattern::DeadLeaves {
            min_radius_px: 1.0,
            max_radius_px: 60.0,
            min_reflectance: 0.25,
            max_reflectance: 0.75,
            seed: 5,
        };
        target(pattern, supersampling)
    }

    /// The plane convolved with a Gaussian, its edges held.
    fn blurred(plane: &Array2<f32>, sigma_px: f64) -> Array2<f32> {
        let reach = (6.0 * sigma_px).ceil() as i64;
        let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let along = |plane: &Array2<f32>| {
            let (rows, columns) = plane.dim();
            Array2::from_shape_fn((columns, rows), |(c, r)| {
                let value = |i: i64| plane[(r, (c as i64 + i).clamp(0, columns as i64 - 1) as usize)];
                let sum = (-reach..=reach).zip(&weights).map(|(i, w)| w * f64::from(value(i))).sum::<f64>();
                (sum / total) as f32
            })
        };
        along(&along(plane))
    }

    /// White noise: twelve uniform numbers a sample, by a counter that is mixed.
    fn noise(seed: u64) -> Array2<f32> {
        let uniform = |i: u64| {
            let mut z = (seed << 40).wrapping_add(i).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        Array2::from_shape_fn((SIDE, SIDE), |(r, c)| {
            let first = 12 * (r * SIDE + c) as u64;
            (NOISE * ((0..12).map(|i| uniform(first + i)).sum::<f64>() - 6.0)) as f32
        })
    }

    /// The median of 5 × 5 samples about each.
    fn median(plane: &Array2<f32>) -> Array2<f32> {
        let last = SIDE as i64 - 1;
        Array2::from_shape_fn((SIDE, SIDE), |(r, c)| {
            let at = |i: usize, by: i64| (i as i64 + by).clamp(0, last) as usize;
            let mut about: Vec<f32> = (0..25).map(|k| plane[(at(r, k / 5 - 2), at(c, k % 5 - 2))]).collect();
            about.sort_by(f32::total_cmp);
            about[12]
        })
    }

    fn gaussian(sigma_px: f64, frequency: f64) -> f64 {
        (-2.0 * (PI * sigma_px * frequency).powi(2)).exp()
    }

    /// Whether a response is that of a Gaussian from 0.02 cycles a pixel to where a fifth is left.
    #[track_caller]
    fn check(response: &TextureResponse, sigma_px: f64, tolerance: f64) {
        for (&f, &found) in response.frequencies.iter().zip(&response.response) {
            let expected = gaussian(sigma_px, f);
            if f >= 0.02 && expected >= 0.2 {
                assert!((found - expected).abs() < tolerance, "{found} not {expected} at {f}, σ {sigma_px}");
            }
        }
    }

    #[test]
    fn a_gaussian_blur_is_found_by_both_methods() {
        let ideal = leaves(8);
        for sigma_px in [0.8, 1.1, 1.5] {
            let picture = blurred(&ideal, sigma_px);
            let spectra = TextureSpectra::measure(&picture.view(), &ideal.view(), None).unwrap();
            // The window is not blurred with the texture, and samples of a Gaussian of 0.8 pixels fold 0.005 of it back.
            check(&spectra.direct, sigma_px, 0.01);
            check(spectra.full_reference.as_ref().unwrap(), sigma_px, 0.01);
            let expected = (0.5 * 2_f64.ln()).sqrt() / (PI * sigma_px);
            assert_relative_eq!(spectra.direct.mtf50().unwrap(), expected, max_relative = 0.01);
        }
    }

    #[test]
    fn noise_is_taken_off_and_is_not_in_the_reference() {
        let (ideal, sigma_px) = (leaves(8), 0.8);
        let clean = blurred(&ideal, sigma_px);
        let (first, second) = (&clean + &noise(1), &clean + &noise(2));
        let flat = noise(3).mapv(|v| 0.5 + v);
        let measured = |noise| TextureSpectra::measure(&first.view(), &ideal.view(), noise).unwrap();
        for shown in [TextureNoise::Flat(flat.view()), TextureNoise::SecondFrame(second.view())] {
            let spectra = measured(Some(shown));
            // Rings tell power to a tenth; where a fifth is left the noise has a quarter of the power of the texture or more.
            check(&spectra.direct, sigma_px, 0.04);
            check(spectra.full_reference.as_ref().unwrap(), sigma_px, 0.04);
            let mean = spectra.noise_power.iter().sum::<f64>() / spectra.noise_power.len() as f64;
            assert_relative_eq!(mean, NOISE * NOISE, max_relative = 0.05);
        }
        // Noise that is not taken off looks like texture.
        let (left, off) = (measured(None), measured(Some(TextureNoise::Flat(flat.view()))));
        let (left_at, off_at) = (left.direct.at(0.45), off.direct.at(0.45));
        assert!(left_at > 1.2 * off_at, "{left_at} {off_at}");
        assert_eq!(left.full_reference, off.full_reference);
    }

    #[test]
    fn a_median_takes_texture_and_leaves_edges() {
        let noise = noise(4);
        let edge = target(Pattern::SlantedBar { slope: 10.0 }, 8);
        let filtered = |plane: &Array2<f32>| median(&(plane + &noise));
        let ideal = leaves(8);
        let texture = filtered(&ideal);
        let spectra = TextureSpectra::measure(&texture.view(), &ideal.view(), None).unwrap();
        let of_edge = EdgeResponse::measure(&filtered(&edge).view()).unwrap().acutance(&VIEWING).unwrap();
        for response in [&spectra.direct, spectra.full_reference.as_ref().unwrap()] {
            let of_texture = response.acutance(&VIEWING).unwrap();
            assert!(of_texture < 0.9 * of_edge, "texture {of_texture}, edge {of_edge}");
        }
    }

    #[test]
    fn power_of_leaves_falls_as_a_power_of_frequency() {
        let spectra = TextureSpectra::measure(&leaves(8).view(), &leaves(16).view(), None).unwrap();
        // A straight line through the logarithms between the largest and the smallest disc.
        let band = spectra.frequencies.iter().zip(&spectra.reference_power).filter(|(f, _)| (0.03..0.25).contains(*f));
        let points: Vec<(f64, f64)> = band.map(|(f, power)| (f.ln(), power.ln())).collect();
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2));
        // The transform of the model's covariance falls by 1.96 here, with the area of the samples by 2.05.
        assert!((-2.2..-1.8).contains(&slope), "{slope}");
        // Eight points a sample and direction, as a camera file has, are enough up to Nyquist.
        spectra.direct.response.iter().for_each(|&r| assert_relative_eq!(r, 1.0, max_relative = 0.01));
    }
}
