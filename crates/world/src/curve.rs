//! Functions of wavelength, ready for rendering.

use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

use dioptric_spectrum::{Illuminant, Observer, SmoothReflectance, Spectrum, WavelengthGrid, lanes};

/// A function of wavelength that is quick to look up and cheap to copy.
///
/// It is a number, points with straight lines between them, or the smooth spectrum of a color. A spectrum of many points
/// is tabulated every nanometer, to which points between whole nanometers are moved by linear interpolation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Written", from = "Written")]
pub struct SpectralCurve {
    kind: Kind,
    scale: f32,
    /// Over 400–700 nm, scale included.
    mean: f32,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Constant,
    Knots {
        knots: Arc<[(f32, f32)]>,
        beyond: Beyond,
    },
    Table {
        first_nm: f32,
        values: Arc<[f32]>,
        beyond: Beyond,
    },
    Smooth(SmoothReflectance),
    /// A smooth spectrum times D65.
    SmoothLight(SmoothReflectance),
}

/// A curve as files hold it.
#[derive(Serialize, Deserialize)]
enum Written {
    Constant(f32),
    Knots { scale: f32, knots: Vec<(f32, f32)>, beyond: Beyond },
    Table { scale: f32, first_nm: f32, values: Vec<f32>, beyond: Beyond },
    Smooth { scale: f32, of: SmoothReflectance },
    SmoothLight { scale: f32, of: SmoothReflectance },
}

impl From<SpectralCurve> for Written {
    fn from(SpectralCurve { kind, scale, .. }: SpectralCurve) -> Self {
        match kind {
            Kind::Constant => Self::Constant(scale),
            Kind::Knots { knots, beyond } => Self::Knots { scale, knots: knots.to_vec(), beyond },
            Kind::Table { first_nm, values, beyond } => {
                Self::Table { scale, first_nm, values: values.to_vec(), beyond }
            }
            Kind::Smooth(of) => Self::Smooth { scale, of },
            Kind::SmoothLight(of) => Self::SmoothLight { scale, of },
        }
    }
}

impl From<Written> for SpectralCurve {
    fn from(written: Written) -> Self {
        let constant = Self::constant;
        let (kind, scale) = match written {
            Written::Constant(scale) => return constant(scale),
            // What has no points is nothing.
            Written::Knots { knots, .. } if knots.is_empty() => return constant(0.0),
            Written::Table { values, .. } if values.is_empty() => return constant(0.0),
            Written::Knots { scale, knots, beyond } => (Kind::Knots { knots: knots.into(), beyond }, scale),
            Written::Table { scale, first_nm, values, beyond } => {
                (Kind::Table { first_nm, values: values.into(), beyond }, scale)
            }
            Written::Smooth { scale, of } => (Kind::Smooth(of), scale),
            Written::SmoothLight { scale, of } => (Kind::SmoothLight(of), scale),
        };
        Self::of(kind).scaled(scale)
    }
}

/// What a curve is beyond the ends of its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Beyond {
    /// Its end values: for reflectances and indices.
    Held,
    /// Nothing: for emission.
    Zero,
}

/// Tables begin and end within this range, nm.
const RANGE_NM: (f64, f64) = (200.0, 2500.0);
/// Spectra of more points than this are tabulated.
const MAX_KNOTS: usize = 64;

impl SpectralCurve {
    /// Returns the curve that is the same at every wavelength.
    pub fn constant(value: f32) -> Self {
        Self { kind: Kind::Constant, scale: value, mean: value }
    }

    /// Returns the curve of a spectrum. A spectrum of one point is constant; what lies outside 200–2500 nm may be left
    /// out.
    pub fn new(spectrum: &Spectrum, beyond: Beyond) -> Self {
        let knots_nm = spectrum.wavelengths_nm();
        if let [value] = spectrum.values() {
            return Self::constant(*value as f32);
        }
        if knots_nm.len() <= MAX_KNOTS {
            let knots = knots_nm.iter().zip(spectrum.values()).map(|(w, v)| (*w as f32, *v as f32)).collect();
            return Self::of(Kind::Knots { knots, beyond });
        }
        let (low, high) = RANGE_NM;
        let first_nm = knots_nm[0].clamp(low, high).floor();
        let last_nm = knots_nm[knots_nm.len() - 1].clamp(low, high).ceil();
        let n = (last_nm - first_nm) as usize + 1;
        let values = (0..n).map(|i| spectrum.at_held(first_nm + i as f64) as f32).collect();
        Self::of(Kind::Table { first_nm: first_nm as f32, values, beyond })
    }

    /// Returns the smooth reflectance of a linear sRGB color seen under D65; it is clamped to [0, 1].
    pub fn from_rgb_reflectance(rgb: [f32; 3]) -> Self {
        Self::of(Kind::Smooth(SmoothReflectance::of_rgb(rgb)))
    }

    /// Returns the light of a linear sRGB color: D65 times a smooth spectrum; 0 outside the table of D65.
    ///
    /// Its scale is that of pbrt, 4th version: (1, 1, 1) is as bright as an even spectrum of 1 per nm, that is 72 983
    /// cd m⁻² where the curve is a radiance in W m⁻² sr⁻¹ nm⁻¹.
    pub fn from_rgb_light(rgb: [f32; 3]) -> Self {
        let rgb = rgb.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 });
        let largest = rgb.into_iter().fold(0.0, f32::max);
        if largest == 0.0 {
            return Self::constant(0.0);
        }
        Self::of(Kind::SmoothLight(SmoothReflectance::of_rgb(rgb.map(|v| v / largest)))).scaled(largest)
    }

    /// Returns [`from_rgb_light`](Self::from_rgb_light) of one color at these wavelengths, nm.
    pub(crate) fn light_at<const N: usize>(rgb: [f32; 3], wavelengths_nm: &[f32; N]) -> [f32; N] {
        let largest = rgb.into_iter().fold(0.0, f32::max);
        if !(largest > 0.0 && largest.is_finite()) {
            return [0.0; N];
        }
        let share = SmoothReflectance::of_rgb(rgb.map(|v| v / largest)).at(wavelengths_nm);
        let white = d65().at(wavelengths_nm);
        lanes(|lane| largest * share[lane] * white[lane])
    }

    /// Returns it as points with straight lines between them, nm and values: its own, or every 5 nm from 300 to 1100 nm of the smooth spectrum of a
    /// color, and within the table of D65 of a light's.
    pub(crate) fn points(&self) -> Vec<(f32, f32)> {
        let at = |nm: f32| (nm, self.at(&[nm])[0]);
        match &self.kind {
            Kind::Constant => vec![(550.0, self.scale)],
            Kind::Knots { knots, .. } => knots.iter().map(|(nm, value)| (*nm, self.scale * value)).collect(),
            Kind::Table { first_nm, values, .. } => {
                values.iter().enumerate().map(|(i, value)| (first_nm + i as f32, self.scale * value)).collect()
            }
            Kind::Smooth(_) => (0..=160).map(|i| at(300.0 + 5.0 * i as f32)).collect(),
            Kind::SmoothLight(_) => (0..=106).map(|i| at(300.0 + 5.0 * i as f32)).collect(),
        }
    }

    /// Whether it is a table, and no number or color.
    #[cfg(feature = "gltf")]
    pub(crate) fn is_spectrum(&self) -> bool {
        matches!(self.kind, Kind::Knots { .. } | Kind::Table { .. })
    }

    /// Whether it has the same value at every wavelength.
    pub(crate) fn constant_value(&self) -> Option<f32> {
        matches!(self.kind, Kind::Constant).then_some(self.scale)
    }

    /// Whether it is lifted from a color, which tells nothing beyond what is seen; grays are the same everywhere.
    pub(crate) fn is_of_color(&self) -> bool {
        let is_gray = || {
            let [low, high] = self.at(&[450.0, 650.0]);
            (low - high).abs() <= 1e-4 * low.abs().max(high.abs())
        };
        matches!(self.kind, Kind::Smooth(_)) && !is_gray()
    }

    fn of(kind: Kind) -> Self {
        let curve = Self { kind, scale: 1.0, mean: 0.0 };
        let mean = (0..=60).map(|i| curve.at(&[400.0 + 5.0 * i as f32])[0]).sum::<f32>() / 61.0;
        Self { mean, ..curve }
    }

    /// Returns the values at these wavelengths, nm.
    pub fn at<const N: usize>(&self, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.kind {
            Kind::Constant => [self.scale; N],
            Kind::Knots { knots, beyond } => lanes(|i| self.scale * between_knots(knots, *beyond, wavelengths_nm[i])),
            Kind::Table { first_nm, values, beyond: Beyond::Held } => {
                lanes(|i| self.scale * held_in_table(wavelengths_nm[i] - first_nm, values))
            }
            Kind::Table { first_nm, values, beyond: Beyond::Zero } => {
                let last_nm = first_nm + (values.len() - 1) as f32;
                lanes(|i| match (*first_nm..=last_nm).contains(&wavelengths_nm[i]) {
                    true => self.scale * held_in_table(wavelengths_nm[i] - first_nm, values),
                    false => 0.0,
                })
            }
            Kind::Smooth(smooth) => {
                let share = smooth.at(wavelengths_nm);
                lanes(|lane| self.scale * share[lane])
            }
            Kind::SmoothLight(smooth) => {
                let (share, white) = (smooth.at(wavelengths_nm), d65().at(wavelengths_nm));
                lanes(|lane| self.scale * share[lane] * white[lane])
            }
        }
    }

    /// Returns the curve with every value multiplied.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        Self { scale: self.scale * factor, mean: self.mean * factor, ..self }
    }

    /// Returns a function of every value of a curve, its points moved.
    #[must_use]
    pub(crate) fn mapped(&self, function: impl Fn(f32) -> f32) -> Self {
        let of = |v: f32| function(self.scale * v);
        match &self.kind {
            Kind::Constant => Self::constant(function(self.scale)),
            Kind::Knots { knots, beyond } => {
                Self::of(Kind::Knots { knots: knots.iter().map(|(w, v)| (*w, of(*v))).collect(), beyond: *beyond })
            }
            Kind::Table { first_nm, values, beyond } => Self::of(Kind::Table {
                first_nm: *first_nm,
                values: values.iter().map(|v| of(*v)).collect(),
                beyond: *beyond,
            }),
            Kind::Smooth(_) | Kind::SmoothLight(_) => {
                let every_5_nm = (60..=220).map(|i| 5.0 * i as f32);
                let values = every_5_nm.map(|w| (w, function(self.at(&[w])[0]))).collect();
                Self::of(Kind::Knots { knots: values, beyond: Beyond::Held })
            }
        }
    }

    /// The mean over 400–700 nm.
    pub fn mean_visible(&self) -> f32 {
        self.mean
    }
}

/// D65 whose mean, weighted by the photopic sensitivity, is 1.
fn d65_of_unit_mean() -> Spectrum {
    let d65 = Illuminant::D65.spectrum();
    let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
    let luminance = |spectrum: &Spectrum| Observer::Cie1931.xyz(&fine, &spectrum.sample_held(&fine)).luminance_cd_m2();
    let even = luminance(&Spectrum::constant(1.0));
    d65.scaled(even / luminance(&d65))
}

fn d65() -> &'static SpectralCurve {
    static D65: OnceLock<SpectralCurve> = OnceLock::new();
    D65.get_or_init(|| SpectralCurve::new(&d65_of_unit_mean(), Beyond::Zero))
}

fn between_knots(knots: &[(f32, f32)], beyond: Beyond, wavelength_nm: f32) -> f32 {
    let above = knots.partition_point(|(w, _)| *w < wavelength_nm);
    let last = knots.len() - 1;
    if above == 0 || above > last {
        let (end_nm, value) = knots[above.min(last)];
        return if beyond == Beyond::Held || wavelength_nm == end_nm { value } else { 0.0 };
    }
    let ((w0, v0), (w1, v1)) = (knots[above - 1], knots[above]);
    v0 + (v1 - v0) * (wavelength_nm - w0) / (w1 - w0)
}

#[inline]
fn held_in_table(along_nm: f32, values: &[f32]) -> f32 {
    let last = values.len() - 1;
    let along_nm = along_nm.clamp(0.0, last as f32);
    // A whole number of nanometers fits into 32 bits, from which it is quicker to turn back.
    let below = along_nm as i32;
    let (low, high) = (values[below as usize], values[(below as usize + 1).min(last)]);
    low + (along_nm - below as f32) * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_light_is_as_bright_as_an_even_one() {
        let light = SpectralCurve::from_rgb_light([1.0; 3]);
        let grid = WavelengthGrid::uniform(380.0, 780.0, 1.0).unwrap();
        let values: Vec<f64> = grid.centers_nm().iter().map(|&w| f64::from(light.at(&[w as f32])[0])).collect();
        let luminance = Observer::Cie1931.xyz(&grid, &values).luminance_cd_m2();
        // 683 lm/W times the area under the sensitivity, 106.857 nm.
        assert!((luminance / (683.002 * 106.857) - 1.0).abs() < 1e-3, "{luminance}");
    }

    #[test]
    fn curve_follows_its_spectrum() {
        let few = Spectrum::new(vec![400.0, 500.5, 700.0], vec![1.0, 3.0, 0.0]).unwrap();
        let many_nm: Vec<f64> = (0..=100).map(|i| 400.0 + 3.0 * f64::from(i)).collect();
        let many = Spectrum::new(many_nm.clone(), many_nm.iter().map(|w| (w / 40.0).sin()).collect()).unwrap();
        for spectrum in [few, many] {
            let held = SpectralCurve::new(&spectrum, Beyond::Held);
            let zero = SpectralCurve::new(&spectrum, Beyond::Zero);
            for wavelength_nm in [400.0, 417.3, 490.0, 600.0, 699.9, 700.0] {
                let expected = spectrum.at_held(f64::from(wavelength_nm)) as f32;
                assert!((held.at(&[wavelength_nm])[0] - expected).abs() < 2e-5, "{wavelength_nm}");
                assert_eq!(held.at(&[wavelength_nm]), zero.at(&[wavelength_nm]));
            }
            let ends = [spectrum.values()[0], spectrum.values()[spectrum.values().len() - 1]].map(|v| v as f32);
            assert_eq!((held.at(&[300.0, 900.0]), zero.at(&[399.9, 700.1])), (ends, [0.0; 2]));
            assert_eq!(held.clone().scaled(2.0).at(&[450.0])[0], 2.0 * held.at(&[450.0])[0]);
            let squared = held.mapped(|v| v * v);
            assert!((squared.at(&[400.0])[0] - held.at(&[400.0])[0].powi(2)).abs() < 1e-6);
        }
    }

    #[test]
    fn constants_have_no_ends() {
        assert_eq!(SpectralCurve::new(&Spectrum::constant(0.5), Beyond::Zero).at(&[100.0, 5000.0]), [0.5; 2]);
    }
}
