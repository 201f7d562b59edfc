//! Photon transfer: the parameters of the linear model of EMVA standard 1288 from flat frames.
//!
//! Temporal variance comes from the difference of two frames, so that fixed patterns do not enter it. The model is
//! that of release 3.1: variance = dark variance + K × (mean − dark mean), K in digital numbers an electron.

use ndarray::Array2;
use rayon::prelude::*;

use crate::SensorError;

/// The variance of rounding to whole numbers.
const QUANTISATION_VARIANCE: f64 = 1.0 / 12.0;
/// A dark variance below this is that of rounding, DN²: the noise may be anything below its root without that of rounding, 0.4 DN.
pub(crate) const HIDDEN_BELOW_DN2: f64 = 0.24;
/// The signal between which linearity is judged, as shares of saturation (EMVA 1288, 6.7).
const LINEAR_FROM: f64 = 0.05;
const LINEAR_TO: f64 = 0.95;
/// Beyond saturation the variance falls: to this share of its largest or below.
const FALLEN_TO: f64 = 0.9;
/// The share of saturation up to which the gain is fitted (EMVA 1288, 6.6).
const FIT_UP_TO: f64 = 0.7;

/// What two flat frames under equal light show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatPoint {
    /// The mean number of photons that fell on a pixel; 0 in the dark.
    pub photons: f64,
    /// The mean of both frames, DN.
    pub mean_dn: f64,
    /// The temporal variance, DN².
    pub variance_dn2: f64,
}

impl FlatPoint {
    /// Returns the mean and the temporal variance of two frames.
    ///
    /// # Errors
    /// When the frames differ in size.
    pub fn measure(photons: f64, first: &Array2<f32>, second: &Array2<f32>) -> Result<Self, SensorError> {
        check_size(first.dim(), second.dim())?;
        let (mean_first, mean_second) = (mean(first), mean(second));
        let rows: Vec<f64> = (first.outer_iter().into_par_iter())
            .zip(second.outer_iter())
            .map(|(a, b)| a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum())
            .collect();
        let mean_square = rows.iter().sum::<f64>() / first.len() as f64;
        Ok(Self {
            photons,
            mean_dn: 0.5 * (mean_first + mean_second),
            variance_dn2: 0.5 * (mean_square - (mean_first - mean_second).powi(2)),
        })
    }
}

/// How far a signal is from a straight line over light.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearity {
    /// The mean of the deviations' magnitudes, as a share of the line: the linearity error (EMVA 1288, 6.7).
    pub mean_error: f64,
    /// The largest of them.
    pub largest_error: f64,
    /// Photons, and the deviation there as a share of the line.
    pub deviations: Vec<(f64, f64)>,
}

impl Linearity {
    /// Returns the deviations from the line with the least relative ones.
    fn fit(dark: &FlatPoint, points: &[FlatPoint], saturation_dn: f64) -> Option<Self> {
        let full = saturation_dn - dark.mean_dn;
        let signals: Vec<(f64, f64)> = points
            .iter()
            .map(|point| (point.photons, point.mean_dn - dark.mean_dn))
            .filter(|(_, signal)| (LINEAR_FROM * full..=LINEAR_TO * full).contains(signal))
            .collect();
        if signals.len() < 3 {
            return None;
        }
        // y = a + b x with weights 1 / y²: the sum of squared shares is least.
        let sums = signals.iter().fold([0.0; 5], |sums, (x, y)| {
            let weight = 1.0 / (y * y);
            let terms = [weight, weight * x, weight * x * x, weight * y, weight * x * y];
            std::array::from_fn(|i| sums[i] + terms[i])
        });
        let [w, wx, wxx, wy, wxy] = sums;
        let slope = (w * wxy - wx * wy) / (w * wxx - wx * wx);
        let offset = (wy - slope * wx) / w;
        let deviations: Vec<(f64, f64)> =
            signals.iter().map(|(x, y)| (*x, (y - offset - slope * x) / (offset + slope * x))).collect();
        let magnitudes = || deviations.iter().map(|(_, share)| share.abs());
        Some(Self {
            mean_error: magnitudes().sum::<f64>() / deviations.len() as f64,
            largest_error: magnitudes().fold(0.0, f64::max),
            deviations,
        })
    }
}

/// The temporal parameters of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonTransfer {
    /// The system gain K, DN an electron.
    pub gain_dn_per_e: f64,
    /// The responsivity, DN a photon.
    pub responsivity_dn_per_photon: f64,
    /// The quantum efficiency: responsivity over gain.
    pub quantum_efficiency: f64,
    /// The temporal dark noise without that of rounding, electrons.
    pub dark_noise_e: f64,
    /// Whether rounding hides the dark noise, so that this is the most that it may be (EMVA 1288, 6.5: a variance below 0.24 DN²).
    pub dark_noise_is_limit: bool,
    /// How far the signal is from the straight line that fits it best; `None` where fewer than three points lie between 5 and 95 % of
    /// saturation.
    pub linearity: Option<Linearity>,
    /// The electrons at which the variance is largest: saturation, where [`is_saturated`](Self::is_saturated).
    pub saturation_e: f64,
    /// Whether the series goes on to where the variance has fallen; where not, saturation lies beyond its brightest point.
    pub is_saturated: bool,
    /// The photons at which signal and noise are equal.
    pub threshold_photons: f64,
    /// Saturation over the threshold, dB.
    pub dynamic_range_db: f64,
    /// The dark point.
    pub dark: FlatPoint,
    /// The other points, by rising light.
    pub points: Vec<FlatPoint>,
}

impl PhotonTransfer {
    /// Returns the parameters that a dark point and points of rising light show.
    ///
    /// # Errors
    /// When fewer than three points lie in the fitted range, or the signal does not rise with light.
    pub fn fit(dark: FlatPoint, points: &[FlatPoint]) -> Result<Self, SensorError> {
        let mut points = points.to_vec();
        points.sort_by(|a, b| a.photons.total_cmp(&b.photons));
        let few = |found: usize| SensorError::Shape {
            what: "flat points below 70 % of saturation",
            expected: "3 or more".to_owned(),
            found: found.to_string(),
        };
        let saturated = points.iter().max_by(|a, b| a.variance_dn2.total_cmp(&b.variance_dn2)).ok_or_else(|| few(0))?;
        let limit = FIT_UP_TO * saturated.photons;
        let is_saturated = points
            .iter()
            .any(|p| p.photons > saturated.photons && p.variance_dn2 <= FALLEN_TO * saturated.variance_dn2);
        let fitted: Vec<&FlatPoint> = points.iter().filter(|p| p.photons <= limit).collect();
        if fitted.len() < 3 {
            return Err(few(fitted.len()));
        }
        let signal = |p: &&FlatPoint| p.mean_dn - dark.mean_dn;
        // The dark point fixes the line, so that its slope alone is fitted (EMVA 1288, 6.6).
        let gain_dn_per_e = slope_from_zero(fitted.iter().map(|p| (signal(p), p.variance_dn2 - dark.variance_dn2)));
        let responsivity = slope_from_zero(fitted.iter().map(|p| (p.photons, signal(p))));
        if !(gain_dn_per_e > 0.0 && responsivity > 0.0) {
            let reason = "needs a mean and a variance that rise with light".to_owned();
            return Err(SensorError::Unsuitable { what: "photon transfer", reason });
        }
        let quantum_efficiency = responsivity / gain_dn_per_e;
        let dark_noise_is_limit = dark.variance_dn2 < HIDDEN_BELOW_DN2;
        let dark_dn2 = dark.variance_dn2.max(HIDDEN_BELOW_DN2) - QUANTISATION_VARIANCE;
        let dark_e2 = dark_dn2 / gain_dn_per_e.powi(2);
        let rounding_e2 = QUANTISATION_VARIANCE / gain_dn_per_e.powi(2);
        // Signal = noise: e = √(e + σd² + σq²), solved for e (EMVA 1288, equation 26).
        let threshold_e = 0.5 + (dark_e2 + rounding_e2 + 0.25).sqrt();
        let saturation_e = quantum_efficiency * saturated.photons;
        Ok(Self {
            gain_dn_per_e,
            responsivity_dn_per_photon: responsivity,
            quantum_efficiency,
            dark_noise_e: dark_e2.sqrt(),
            dark_noise_is_limit,
            linearity: Linearity::fit(&dark, &points, saturated.mean_dn),
            saturation_e,
            is_saturated,
            threshold_photons: threshold_e / quantum_efficiency,
            dynamic_range_db: 20.0 * (saturation_e / threshold_e).log10(),
            dark,
            points,
        })
    }

    /// Returns the measured signal-to-noise ratio of a point.
    pub fn snr(&self, point: &FlatPoint) -> f64 {
        (point.mean_dn - self.dark.mean_dn) / point.variance_dn2.sqrt()
    }

    /// Returns the largest signal-to-noise ratio: that of the photons alone at saturation.
    pub fn max_snr(&self) -> f64 {
        self.saturation_e.sqrt()
    }

    /// Returns the signal-to-noise ratio that the linear model gives for a number of electrons.
    pub fn model_snr(&self, electrons: f64) -> f64 {
        electrons / self.variance_e2(electrons).sqrt()
    }

    /// Returns the temporal variance that the linear model gives for a number of electrons.
    pub(crate) fn variance_e2(&self, electrons: f64) -> f64 {
        electrons + self.dark_noise_e.powi(2) + QUANTISATION_VARIANCE / self.gain_dn_per_e.powi(2)
    }
}

/// The dark current that dark points of several exposure times show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DarkCurrentEstimate {
    /// From the rise of the mean, electrons a second.
    pub by_mean_e_per_s: f64,
    /// From the rise of the variance, electrons a second.
    pub by_variance_e_per_s: f64,
}

impl DarkCurrentEstimate {
    /// Returns the dark current from pairs of exposure time, s, and dark point.
    pub fn fit(points: &[(f64, FlatPoint)], gain_dn_per_e: f64) -> Self {
        let by_mean = slope(points.iter().map(|(time_s, p)| (*time_s, p.mean_dn)));
        let by_variance = slope(points.iter().map(|(time_s, p)| (*time_s, p.variance_dn2)));
        Self { by_mean_e_per_s: by_mean / gain_dn_per_e, by_variance_e_per_s: by_variance / gain_dn_per_e.powi(2) }
    }
}

fn mean(frame: &Array2<f32>) -> f64 {
    let rows: Vec<f64> =
        frame.outer_iter().into_par_iter().map(|row| row.iter().map(|&v| f64::from(v)).sum()).collect();
    rows.iter().sum::<f64>() / frame.len() as f64
}

/// Checks that a frame has the size of the one before it.
pub(crate) fn check_size(expected: (usize, usize), found: (usize, usize)) -> Result<(), SensorError> {
    if expected == found {
        return Ok(());
    }
    let text = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
    let (expected, found) = (text(expected), text(found));
    Err(SensorError::Shape { what: "rows × columns of a flat frame", expected, found })
}

/// Returns the slope of the least-squares line through zero.
fn slope_from_zero(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (xy, xx) = points.fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + x * y, xx + x * x));
    xy / xx
}

/// Returns the slope of the least-squares line.
fn slope(points: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let n = points.clone().count() as f64;
    let (sum_x, sum_y) = points.clone().fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x, sy + y));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xy, xx) =
        points.fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + (x - mean_x) * (y - mean_y), xx + (x - mean_x).powi(2)));
    xy / xx
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn point(photons: f64, mean_dn: f64, variance_dn2: f64) -> FlatPoint {
        FlatPoint { photons, mean_dn, variance_dn2 }
    }

    #[test]
    fn a_bent_response_has_its_linearity_error_and_hidden_noise_its_limit() {
        // A signal of 0.1 DN a photon that sags by 2 % towards saturation at 3000 DN, where the variance is largest.
        let signal = |photons: f64| 0.1 * photons * (1.0 - 0.02 * photons / 30_000.0);
        let points: Vec<FlatPoint> = (1..=40)
            .map(|i| 750.0 * f64::from(i))
            .map(|photons| point(photons, 10.0 + signal(photons), 0.1 + 0.2 * signal(photons)))
            .collect();
        let transfer = PhotonTransfer::fit(point(0.0, 10.0, 0.1), &points).unwrap();
        let linearity = transfer.linearity.unwrap();
        // The best line through a parabola of 2 %: a quarter of it is left at the ends, and about a tenth on the mean.
        assert!((0.001..0.004).contains(&linearity.mean_error), "{}", linearity.mean_error);
        assert!(linearity.largest_error < 0.012 && linearity.deviations.len() > 30);
        // A dark variance of 0.1 DN² is that of rounding: the noise is below 0.4 DN, 2 electrons at 0.2 DN an electron.
        assert!(transfer.dark_noise_is_limit);
        assert_relative_eq!(transfer.dark_noise_e, 0.3958 / 0.2, max_relative = 0.02);
        let straight: Vec<FlatPoint> =
            (1..=20).map(|i| 1500.0 * f64::from(i)).map(|p| point(p, 10.0 + 0.1 * p, 9.0 + 0.02 * p)).collect();
        let transfer = PhotonTransfer::fit(point(0.0, 10.0, 9.0), &straight).unwrap();
        assert!(transfer.linearity.unwrap().largest_error < 1e-12 && !transfer.dark_noise_is_limit);
    }
}
