//! Functions of wavelength, tabulated for rendering.

use dioptric_spectrum::Spectrum;

/// A function of wavelength that is quick to look up: a number, or a table every nanometer.
///
/// Between its points it runs straight. Points of a [`Spectrum`] that fall between whole nanometers are moved onto them
/// by linear interpolation.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralCurve(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Constant(f32),
    Table { first_nm: f32, values: Vec<f32>, beyond: Beyond },
}

/// What a curve is beyond the ends of its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// Its end values: for reflectances and indices.
    Held,
    /// Nothing: for emission.
    Zero,
}

/// Tables begin and end within this range, nm.
const RANGE_NM: (f64, f64) = (200.0, 2500.0);

impl SpectralCurve {
    /// Returns the curve that is the same at every wavelength.
    pub fn constant(value: f32) -> Self {
        Self(Kind::Constant(value))
    }

    /// Returns the curve of a spectrum. A spectrum of one point is constant; what lies outside 200–2500 nm is left out.
    pub fn new(spectrum: &Spectrum, beyond: Beyond) -> Self {
        let knots_nm = spectrum.wavelengths_nm();
        if let [value] = spectrum.values() {
            return Self::constant(*value as f32);
        }
        let (low, high) = RANGE_NM;
        let first_nm = knots_nm[0].clamp(low, high).floor();
        let last_nm = knots_nm[knots_nm.len() - 1].clamp(low, high).ceil();
        let n = (last_nm - first_nm) as usize + 1;
        let values = (0..n).map(|i| spectrum.at_held(first_nm + i as f64) as f32).collect();
        Self(Kind::Table { first_nm: first_nm as f32, values, beyond })
    }

    /// Returns the values at these wavelengths, nm.
    pub fn at<const N: usize>(&self, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.0 {
            Kind::Constant(value) => [*value; N],
            Kind::Table { first_nm, values, beyond } => wavelengths_nm.map(|wavelength_nm| {
                let last = values.len() - 1;
                let along = wavelength_nm - first_nm;
                if *beyond == Beyond::Zero && !(along >= 0.0 && along <= last as f32) {
                    return 0.0;
                }
                let along = along.clamp(0.0, last as f32);
                let below = (along as usize).min(last.saturating_sub(1));
                let above = (below + 1).min(last);
                values[below] + (along - below as f32) * (values[above] - values[below])
            }),
        }
    }

    /// Returns the curve with every value multiplied.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        match &mut self.0 {
            Kind::Constant(value) => *value *= factor,
            Kind::Table { values, .. } => values.iter_mut().for_each(|value| *value *= factor),
        }
        self
    }

    /// The least and the largest value.
    pub fn range(&self) -> (f32, f32) {
        match &self.0 {
            Kind::Constant(value) => (*value, *value),
            Kind::Table { values, .. } => {
                values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
            }
        }
    }

    /// The mean over 400–700 nm.
    pub fn mean_visible(&self) -> f32 {
        (0..=60).map(|i| self.at(&[400.0 + 5.0 * i as f32])[0]).sum::<f32>() / 61.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_follows_its_spectrum() {
        let spectrum = Spectrum::new(vec![400.0, 500.5, 700.0], vec![1.0, 3.0, 0.0]).unwrap();
        let held = SpectralCurve::new(&spectrum, Beyond::Held);
        let zero = SpectralCurve::new(&spectrum, Beyond::Zero);
        for wavelength_nm in [400.0, 417.3, 490.0, 600.0, 699.9, 700.0] {
            let expected = spectrum.at_held(f64::from(wavelength_nm)) as f32;
            assert!((held.at(&[wavelength_nm])[0] - expected).abs() < 2e-5, "{wavelength_nm}");
            assert_eq!(held.at(&[wavelength_nm]), zero.at(&[wavelength_nm]));
        }
        assert_eq!(held.at(&[300.0, 900.0]), [1.0, 0.0]);
        assert_eq!(zero.at(&[399.9, 700.1]), [0.0, 0.0]);
    }

    #[test]
    fn constants_have_no_ends() {
        assert_eq!(SpectralCurve::new(&Spectrum::constant(0.5), Beyond::Zero).at(&[100.0, 5000.0]), [0.5; 2]);
    }
}
