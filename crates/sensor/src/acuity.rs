//! How sharp an edge's response looks: acutance, the square-root integral, and the share that aliases.

use crate::{EdgeResponse, SensorError};

/// How a picture is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewing {
    /// Pixels a degree of the eye's field.
    pub pixels_per_degree: f64,
    /// The angle that the picture spans, degrees: the square root of its area.
    pub picture_deg: f64,
    /// The mean luminance of the picture, cd/m².
    pub luminance_cd_m2: f64,
}

impl Viewing {
    /// Returns how a picture of so many rows and columns is seen on a display of so many pixels a millimeter from a
    /// distance, at 100 cd/m².
    pub fn of_display(pixels_per_mm: f64, distance_mm: f64, (rows, columns): (usize, usize)) -> Self {
        let pixels_per_degree = pixels_per_mm * distance_mm * 1.0_f64.to_radians().tan();
        let picture_deg = (rows as f64 * columns as f64).sqrt() / pixels_per_degree;
        Self { pixels_per_degree, picture_deg, luminance_cd_m2: 100.0 }
    }

    fn check(&self) -> Result<(), SensorError> {
        let numbers = [
            ("pixels_per_degree", self.pixels_per_degree),
            ("picture_deg", self.picture_deg),
            ("luminance_cd_m2", self.luminance_cd_m2),
        ];
        match numbers.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((key, value)) => Err(SensorError::value("the viewing", key, value, "a number above 0")),
            None => Ok(()),
        }
    }
}

/// Steps of the sums, cycles a degree, and where they end: the eye sees nothing finer.
const STEP_PER_DEG: f64 = 0.01;
const END_PER_DEG: f64 = 80.0;
/// Steps of the square-root integral.
const ROOT_STEPS: usize = 4000;

impl EdgeResponse {
    /// Returns the acutance: the response weighted by the eye's contrast sensitivity, 1 for a response of 1 everywhere.
    ///
    /// The sensitivity is ν^0.8 exp(−0.2 ν) up to a factor, ν in cycles a degree (IEEE Std 1858-2016, CPIQ). What lies
    /// beyond the pixels' Nyquist frequency cannot be shown and counts as 0.
    ///
    /// # Errors
    /// When the viewing has a number that is not above 0.
    pub fn acutance(&self, viewing: &Viewing) -> Result<f64, SensorError> {
        acutance(|frequency| self.at(frequency), viewing)
    }

    /// Returns the square-root integral, just noticeable differences (Barten, "Evaluation of subjective image quality with
    /// the square-root integral method", J. Opt. Soc. Am. A 7, 1990): 1/ln 2 ∫ √(response × contrast sensitivity) dν/ν.
    ///
    /// The sensitivity is Barten's formula of that paper, of the luminance and the angle of the picture.
    ///
    /// # Errors
    /// When the viewing has a number that is not above 0.
    pub fn square_root_integral(&self, viewing: &Viewing) -> Result<f64, SensorError> {
        viewing.check()?;
        let luminance = viewing.luminance_cd_m2;
        let sensitivity = |nu: f64| {
            let of_size = 1.0 + 12.0 / (viewing.picture_deg * (1.0 + nu / 3.0).powi(2));
            let a = 540.0 * (1.0 + 0.7 / luminance).powf(-0.2) / of_size;
            let b = 0.3 * (1.0 + 100.0 / luminance).powf(0.15);
            a * nu * (-b * nu).exp() * (1.0 + 0.06 * (b * nu).exp()).sqrt()
        };
        // By the root of the frequency: what is integrated grows without end towards 0 by frequency, as one over its root.
        let step = (0.5 * viewing.pixels_per_degree).min(END_PER_DEG).sqrt() / ROOT_STEPS as f64;
        let part = |i: usize| {
            let root = step * (i as f64 + 0.5);
            let nu = root * root;
            let contrast = self.at(nu / viewing.pixels_per_degree).max(0.0) * sensitivity(nu);
            2.0 * contrast.sqrt() / root
        };
        Ok(step * (0..ROOT_STEPS).map(part).sum::<f64>() / std::f64::consts::LN_2)
    }

    /// Returns the share of the response beyond the Nyquist frequency, where it comes back as coarser patterns: the area
    /// from 0.5 to 1 cycles a pixel over that from 0 to 1.
    pub fn aliasing_share(&self) -> f64 {
        const STEPS: usize = 2000;
        let response = |i: usize| self.at((i as f64 + 0.5) / STEPS as f64).abs();
        let above: f64 = (STEPS / 2..STEPS).map(response).sum();
        above / (0..STEPS).map(response).sum::<f64>()
    }
}

/// Returns the acutance of a response by cycles a pixel, as [`EdgeResponse::acutance`] has it.
///
/// # Errors
/// When the viewing has a number that is not above 0.
pub(crate) fn acutance(response: impl Fn(f64) -> f64, viewing: &Viewing) -> Result<f64, SensorError> {
    viewing.check()?;
    let sensitivity = |nu: f64| nu.powf(0.8) * (-0.2 * nu).exp();
    let (mut seen, mut all) = (0.0, 0.0);
    for nu in frequencies() {
        all += sensitivity(nu);
        seen += sensitivity(nu) * shown(&response, nu, viewing);
    }
    Ok(seen / all)
}

/// Returns the response at a frequency of the eye's field, cycles a degree, as far as pixels show it.
fn shown(response: &impl Fn(f64) -> f64, nu: f64, viewing: &Viewing) -> f64 {
    let per_pixel = nu / viewing.pixels_per_degree;
    if per_pixel <= 0.5 { response(per_pixel) } else { 0.0 }
}

/// The middles of the steps of the sums, cycles a degree.
fn frequencies() -> impl Iterator<Item = f64> {
    (0..(END_PER_DEG / STEP_PER_DEG) as usize).map(|i| STEP_PER_DEG * (i as f64 + 0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// A response by formula, cycles a pixel.
    fn response(formula: impl Fn(f64) -> f64) -> EdgeResponse {
        let frequencies: Vec<f64> = (0..=1000).map(|i| f64::from(i) / 1000.0).collect();
        let response = frequencies.iter().map(|&f| formula(f)).collect();
        EdgeResponse::of_curve(frequencies, response)
    }

    fn viewing(pixels_per_degree: f64) -> Viewing {
        Viewing { pixels_per_degree, picture_deg: 20.0, luminance_cd_m2: 100.0 }
    }

    #[test]
    fn acutance_of_an_exponential_is_exact() {
        // ∫ ν^0.8 exp(−(0.2 + k) ν) dν = Γ(1.8) / (0.2 + k)^1.8.
        for k in [0.0, 0.05, 0.2] {
            let found = response(|f| (-k * 160.0 * f).exp()).acutance(&viewing(160.0)).unwrap();
            // The sums end at 80 cycles a degree, where 1e-6 is left; straight lines stand for the exponential.
            assert_relative_eq!(found, (0.2_f64 / (0.2 + k)).powf(1.8), max_relative = 1e-3);
        }
        // Seen from nearer, coarse pixels show less.
        assert!(response(|_| 1.0).acutance(&viewing(20.0)).unwrap() < 0.9);
    }

    #[test]
    fn the_square_root_integral_follows_contrast() {
        let of = |level: f64| response(|_| level).square_root_integral(&viewing(60.0)).unwrap();
        // The same integral by scipy's adaptive quadrature over ln ν.
        assert_relative_eq!(of(0.9), 134.775_058, max_relative = 1e-6);
        assert_relative_eq!(of(0.9) / of(0.225), 2.0, max_relative = 1e-9);
        assert!(response(|_| 1.0).square_root_integral(&viewing(f64::NAN)).is_err());
        let display = Viewing::of_display(4.0, 500.0, (1080, 1920));
        // 2000 pixels a radian are 34.9 a degree.
        assert_relative_eq!(display.pixels_per_degree, 34.91, max_relative = 1e-3);
        assert_relative_eq!(display.picture_deg, 41.25, max_relative = 1e-3);
    }

    #[test]
    fn aliasing_is_the_area_beyond_nyquist() {
        // A straight fall to 0 at 1: a quarter of the triangle lies beyond its half.
        assert_relative_eq!(response(|f| 1.0 - f).aliasing_share(), 0.25, max_relative = 1e-6);
        assert_relative_eq!(response(|_| 1.0).aliasing_share(), 0.5, max_relative = 1e-9);
        // The box of a pixel: ∫ sinc from 0.5 to 1 over that from 0 to 1, in numpy.
        let pi_f = |f: f64| std::f64::consts::PI * f.max(1e-9);
        assert_relative_eq!(response(|f| pi_f(f).sin() / pi_f(f)).aliasing_share(), 0.259_822, max_relative = 1e-5);
    }
}
